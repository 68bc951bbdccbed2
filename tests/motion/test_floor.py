"""A base that drives: its place on free floor, its paths, its motion in physics."""

from __future__ import annotations

import itertools
from dataclasses import replace

import newton
import numpy as np
import pytest
import warp as wp
from cabinet import free_cube

from s2a import robot
from s2a.core.errors import InputError
from s2a.motion.far import plan_far
from s2a.motion.floor import FreeFloor, connected
from s2a.motion.grasps import GraspCache
from s2a.motion.gripper import FIRM
from s2a.motion.pick_plan import PickTask
from s2a.motion.segments import CALM, Drive, Timeline
from s2a.motion.trajectory import Trajectory, preceded
from s2a.robot.collision import robot_shape
from s2a.robot.kinematics import arm_pose, base_coordinates
from s2a.robot.model import add_robot
from s2a.robot.tool_path import matrix
from s2a.scene.geometry.convex import box
from s2a.scene.scene import Mesh
from s2a.scene.usd.sim_scene import Collider, SimRoom

SPEC = robot.load("panda_mobile")
WIDTH = 0.793  # [m] Of a Ridgeback


def room(gap: float, low: float = 0.0) -> SimRoom:
    """Return a room of 6 x 4 m whose two halves a wall divides that leaves a gap [m] of its length, from a height [m] on."""

    def solid(part: str, center: tuple[float, ...], size: tuple[float, ...]) -> Collider:
        return Collider(part, box(np.array(center), np.eye(3), np.array(size)), structure=True)

    side = (4.0 - gap) / 2
    walls = [solid("wall", (x, 0.0, 1.0), (0.1, 4.0, 2.0)) for x in (-3.0, 3.0)]
    walls += [solid("wall", (0.0, y, 1.0), (6.0, 0.1, 2.0)) for y in (-2.0, 2.0)]
    walls += [solid("wall", (0.0, s * (2.0 - side / 2), 1.0 + low / 2), (0.1, side, 2.0 - low)) for s in (-1.0, 1.0)]
    none = Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32))
    return SimRoom("halves", {}, {}, none, (solid("floor", (0.0, 0.0, -0.05), (6.0, 4.0, 0.1)), *walls))


LEFT, RIGHT = np.array([-1.5, 0.0, 0.0, 0.0]), np.array([1.5, 0.0, 0.0, 0.1])


@pytest.mark.slow
@pytest.mark.parametrize(("gap", "passes"), [(WIDTH - 0.1, False), (WIDTH + 0.4, True)])
def test_it_drives_through_gaps_that_are_wider_than_it(gap: float, passes: bool) -> None:
    floor = FreeFloor(room(gap), SPEC, LEFT)
    assert floor.height == pytest.approx(0.0, abs=1e-6)
    assert floor.free(np.stack([LEFT, RIGHT])).all()
    assert floor.reachable(RIGHT[None])[0] == passes
    path = floor.path(RIGHT)
    assert (path is not None) == passes
    if path is not None:
        np.testing.assert_allclose(path[[0, -1]], [LEFT, RIGHT], atol=1e-9)
        assert floor.free(path).all()
        assert np.abs(np.diff(path, axis=0)).max() < 0.06


def test_no_footprint_is_free_that_reaches_into_a_wall_or_off_the_floor() -> None:
    floor = FreeFloor(room(WIDTH + 0.4), SPEC, LEFT)
    half = SPEC.drive.chassis[0] / 2 if SPEC.drive else 0.0
    # Its end before the wall, beside the gap; the arm is at the other one.
    before = np.array([[-0.05 - half + off, -1.0, np.pi, 0.0] for off in (-0.1, 0.02)])
    assert floor.free(before).tolist() == [True, False]
    assert not floor.free(np.array([[-5.0, 0.0, 0.0, 0.0]])).any()  # beyond the walls there is no floor


def test_the_column_and_the_arm_need_room_above_the_base() -> None:
    """Below a wall that begins 0.4 m above the floor the base has room, and its column has not."""
    under = np.array([[0.0, -1.0, np.pi / 2, 0.0]])
    assert not FreeFloor(room(0.0, low=0.4), SPEC, LEFT).free(under).any()
    backwards = np.array([[-0.35, -1.0, np.pi, 0.0]])  # its end below the wall, 0.08 m past it, the arm away from it
    assert FreeFloor(room(0.0, low=0.4), SPEC, LEFT).free(backwards).all()
    assert not FreeFloor(room(0.0), SPEC, LEFT).free(backwards).any()


def test_the_lower_end_of_the_column_is_seen_where_the_lift_is_up() -> None:
    shelf = Collider("shelf", box(np.array([-1.14, 0.0, 0.34]), np.eye(3), np.array([0.1, 0.1, 0.02])))
    whole = room(WIDTH + 0.4)
    with_it = FreeFloor(replace(whole, static_colliders=(*whole.static_colliders, shelf)), SPEC, RIGHT)
    assert with_it.free(np.array([[-1.5, y, 0.0, 0.3] for y in (0.0, 0.9)])).tolist() == [False, True]


def test_a_room_without_floor_for_it_is_refused() -> None:
    with pytest.raises(InputError, match="no floor of the room is free"):
        FreeFloor(replace(room(0.0), static_colliders=(room(0.0).static_colliders[0], *_filled())), SPEC)


def _filled() -> tuple[Collider, ...]:
    return tuple(
        Collider("box", box(np.array([x, y, 0.3]), np.eye(3), np.array([0.3, 0.3, 0.6])))
        for x in np.arange(-3, 3.1, 0.6)
        for y in np.arange(-2, 2.1, 0.6)
    )


def test_coordinates_and_pose_of_a_base_belong_together() -> None:
    assert SPEC.drive is not None
    q = np.array([1.0, -2.0, np.pi / 2, 0.2])
    pose = arm_pose(SPEC.drive, q, floor=0.1)
    np.testing.assert_allclose(pose[:3, 3], [1.0, -2.0 + 0.36, 0.1 + 0.63 + 0.2], atol=1e-9)
    np.testing.assert_allclose(base_coordinates(SPEC.drive, pose, 0.63 + 0.2), q, atol=1e-9)


def test_headings_that_go_around_join_all_pieces_that_they_touch() -> None:
    free = np.zeros((5, 1, 8), bool)
    free[[0, 2], :, :2] = True  # two pieces, which only a third one joins, across the last heading
    free[:3, :, 6:] = True
    free[4, :, 3] = True
    assert np.unique(connected(free)[:3][free[:3]]).size == 1
    assert np.unique(connected(free)).tolist() == [0, 1, 2]


def test_a_drive_keeps_the_limits_and_the_arm_stands_meanwhile() -> None:
    line = Timeline(np.array(SPEC.home), SPEC, SPEC.limits, 60.0, 0.8, base=LEFT)
    line.add([Drive(np.linspace(LEFT, [1.5, 0.5, 1.2, 0.1], 40))])
    assert line.base is not None
    speed = np.diff(line.base, axis=0) * 60.0
    assert SPEC.drive is not None
    assert (np.abs(speed).max(axis=0) <= np.minimum(SPEC.drive.velocity, CALM.velocity)).all()
    assert (
        np.abs(np.diff(speed, axis=0)).max(axis=0) * 60.0 <= np.minimum(SPEC.drive.acceleration, CALM.acceleration)
    ).all()
    assert np.ptp(line.targets, axis=0).max() == 0.0
    np.testing.assert_allclose(line.base[-1], [1.5, 0.5, 1.2, 0.1], atol=1e-9)
    arm = len(SPEC.arm_joints)
    after = Trajectory(np.tile(line.targets[-1], (5, 1)), np.zeros(5), 30, 3)
    whole = preceded(after, line.targets, line.base)
    assert whole.base is not None
    assert len(whole.base) == len(whole.targets) == len(whole.part) == len(line.targets) + 29 + 5
    assert whole.closed == 3 + len(line.targets) + 29
    assert np.abs(np.diff(whole.targets[:, :arm], axis=0)).max() < 1e-9
    after = replace(after, base=np.tile(line.base[-1] + [0.0, 0.0, 2.0 * np.pi, 0.0], (5, 1)))  # the same heading
    np.testing.assert_allclose(preceded(after, line.targets, line.base).base, whole.base, atol=1e-9)


@pytest.mark.slow
def test_in_physics_it_is_where_it_is_led_to() -> None:
    """Beside a world that stands still, 3 s of driving, turning and lifting: within 5 mm and 5 mrad, and no faster than led."""
    assert SPEC.drive is not None
    line = Timeline(np.array(SPEC.home), SPEC, SPEC.limits, 60.0, 0.8, base=np.zeros(4))
    line.add([Drive(np.linspace(np.zeros(4), [0.4, 0.2, 0.5, 0.1], 20))])
    assert line.base is not None
    builder = newton.ModelBuilder()
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    add_robot(builder, SPEC, wp.transform(*arm_pose(SPEC.drive, np.zeros(4), 0.0)[:3, 3], 0, 0, 0, 1), height=0.63)
    with wp.ScopedDevice("cpu"):
        model = builder.finalize()
        solver = newton.solvers.SolverMuJoCo(model, integrator="implicitfast")
        state, other, control, q, peak = model.state(), model.state(), model.control(), np.zeros(4), np.zeros(4)
        for now, then in zip(line.base, [*line.base[1:], line.base[-1]], strict=True):
            targets, speeds = control.joint_target_q.numpy(), control.joint_target_qd.numpy()
            targets[:4], speeds[:4] = now, (then - now) * 60.0
            control.joint_target_q.assign(targets)
            control.joint_target_qd.assign(speeds)
            for _ in range(4):
                solver.step(state, other, control, None, 1 / 240)
                state, other = other, state
            q, peak = state.joint_q.numpy()[:4], np.maximum(peak, np.abs(state.joint_qd.numpy()[:4]))
    np.testing.assert_allclose(q, [0.4, 0.2, 0.5, 0.1], atol=5e-3)
    assert (peak <= 1.05 * np.abs(np.diff(line.base, axis=0)).max(axis=0) * 60.0 + 0.01).all()


@pytest.mark.slow
def test_an_object_is_carried_from_one_half_of_a_room_to_the_other() -> None:
    """All its motions join, both ends are where they are to be, and base, arm and object are clear on the whole route."""
    sizes = np.array([0.6, 0.5, 0.7])
    tops = [Collider("table", box(np.array([x, 1.7, 0.35]), np.eye(3), sizes)) for x in (-2.0, 2.0)]
    whole, cube = room(WIDTH + 0.4), free_cube("cube", (-2.0, 1.6, 0.73), side=0.06)
    whole = replace(whole, static_colliders=(*whole.static_colliders, *tops), free={"cube": cube})
    start, goal = (np.array([x, 1.6, 0.73, 0.0, 0.0, 0.0, 1.0]) for x in (-2.0, 2.0))
    floor = FreeFloor(whole, SPEC, LEFT)
    plan = plan_far(PickTask(whole, "cube", start, goal, 0.1, floor=floor), SPEC, FIRM, GraspCache(cube, SPEC.gripper))
    assert plan.driven is not None
    kin, held, drive = robot_shape(SPEC).kin, np.linalg.inv(plan.grasp), plan.driven
    for base, q, at in ((plan.base, plan.lift[0], start), (drive.base, plan.lower[-1], goal)):
        np.testing.assert_allclose((matrix(base) @ kin.tool(q[None])[0] @ held)[:3, 3], at[:3], atol=5e-3)
    arm = (plan.reach, plan.approach, plan.lift, plan.carry, drive.carry, plan.lower, plan.retreat)
    for before, after in itertools.pairwise(arm):
        np.testing.assert_allclose(before[-1], after[0], atol=1e-6)
    np.testing.assert_allclose(drive.route[0], floor.stands(matrix(plan.base), plan.pedestal), atol=1e-6)
    ends = floor.stands(matrix(drive.base), drive.pedestal) - drive.route[-1]
    np.testing.assert_allclose(ends % (2 * np.pi) % (2 * np.pi - 1e-9), 0.0, atol=1e-6)
    body = kin.tool(plan.carry[-1:])[0] @ held
    corners = np.concatenate([c.mesh.vertices for c in cube.colliders]) @ body[:3, :3].T + body[:3, 3]
    assert floor.loaded(drive.route[0], plan.carry[-1], corners).free(drive.route).all()
