"""Forward kinematics are the simulated robot's; inverse kinematics find what forward kinematics made."""

from __future__ import annotations

import math
from dataclasses import replace

import newton
import numpy as np
import pytest
import warp as wp
from scipy.spatial.transform import Rotation

from s2a import robot
from s2a.robot.kinematics import kinematics
from s2a.robot.model import add_robot
from s2a.robot.tool_path import (
    JUMP,
    MAX_SLIP,
    VARIANTS,
    follow,
    opening_coordinate,
    part_path,
    slipping,
    straight,
    variants,
)
from s2a.scene.scene import Joint

SLIDE = Joint("prismatic", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.4))
HINGE = Joint("revolute", (0.0, 0.0, 1.0), (0.0, -0.4, 0.0), (-2.0, 0.0))
GRASP = np.array([0.0, 0.0, 0.5, *Rotation.from_matrix([[0, 0, -1], [1, 0, 0], [0, -1, 0]]).as_quat()])


@pytest.mark.parametrize("name", robot.names())
def test_the_kinematics_are_those_of_the_simulated_robot(name: str) -> None:
    spec = robot.load(name)
    kin, builder = kinematics(spec), newton.ModelBuilder()
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    add_robot(builder, spec, wp.transform())
    model = builder.finalize(device="cpu")
    names = [label.split("/")[-1] for label in model.body_label]
    rows, base = [names.index(link) for link in kin.links], builder.joint_q[: spec.base_joints]
    for q in np.random.default_rng(0).uniform(kin.lower, kin.upper, (5, len(kin.lower))):
        state, fingers = model.state(), 2 * [spec.gripper.finger_joint_open]
        newton.eval_fk(model, wp.array([*base, *q, *fingers], dtype=float), model.joint_qd, state)
        found, poses = kin.frames(q[None])[0], state.body_q.numpy()[rows]
        assert found[:, :3, 3] == pytest.approx(poses[:, :3], abs=1e-6)
        assert found[:, :3, :3] == pytest.approx(Rotation.from_quat(poses[:, 3:]).as_matrix(), abs=1e-5)
    limits = [each.numpy()[len(base) :] for each in (model.joint_limit_lower, model.joint_limit_upper)]
    assert np.array(limits)[:, : len(kin.lower)] == pytest.approx(np.array([kin.lower, kin.upper]))
    assert np.array(limits)[:, len(kin.lower) :].T == pytest.approx(
        np.array(2 * [[0.0, spec.gripper.finger_joint_open]])
    )


def test_the_tool_frame_of_the_panda_is_between_its_pads() -> None:
    # 0.333 + 0.316 + 0.384 m up, 0.088 m ahead, 0.107 + 0.1034 m down again with the forearm folded by a right angle.
    kin = kinematics(robot.load("panda"))
    tool = kin.tool(np.array([[0.0, 0.0, 0.0, -math.pi / 2, 0.0, math.pi / 2, math.pi / 4]]))[0]
    assert tool[:3, 3] == pytest.approx([0.0825 + 0.384 + 0.088, 0.0, 0.333 + 0.316 + 0.0825 - 0.2104], abs=1e-6)
    assert tool[:3, :3] == pytest.approx(np.diag([1.0, -1.0, -1.0]), abs=1e-6)


@pytest.mark.parametrize("name", robot.names())
def test_inverse_kinematics_find_what_kinematics_made(name: str) -> None:
    kin, rng = kinematics(robot.load(name)), np.random.default_rng(0)
    q = rng.uniform(0.8 * kin.lower + 0.2 * kin.upper, 0.2 * kin.lower + 0.8 * kin.upper, (200, len(kin.lower)))
    targets = kin.tool(q)
    found, left = kin.solve(targets, q + rng.normal(0.0, 0.2, q.shape), iterations=40, damping=1e-2)
    good = left < 1e-4
    assert good.mean() > 0.95
    assert kin.tool(found)[good] == pytest.approx(targets[good], abs=2e-4)
    assert (found[good] > kin.lower - 1e-4).all() and (found[good] < kin.upper + 1e-4).all()
    # Nothing that an arm does is called too far, anywhere within its limits; twice as far away is.
    anywhere = kin.tool(rng.uniform(kin.lower, kin.upper, (20_000, len(kin.lower))))
    assert kin.may_reach(anywhere).all()
    anywhere[:, :2, 3] += 3.0
    assert not kin.may_reach(anywhere).any()


def test_the_tool_path_turns_with_a_door_and_is_straight_with_a_drawer() -> None:
    drawer = part_path(SLIDE, GRASP, 0.1, 0.3)
    assert drawer.poses[0, :3, 3] - drawer.poses[-1, :3, 3] == pytest.approx(
        [-0.2, 0, 0], abs=1e-9
    )  # 0.1 m before, 0.3 m out
    assert drawer.poses[drawer.grasp, :3, 3] == pytest.approx(GRASP[:3])
    assert drawer.poses[:, :3, :3] == pytest.approx(np.broadcast_to(drawer.poses[0, :3, :3], (len(drawer.q), 3, 3)))
    door = part_path(HINGE, GRASP, 0.1, -math.pi / 2)
    turn = Rotation.from_matrix(door.poses[-1, :3, :3] @ door.poses[0, :3, :3].T).as_rotvec()
    assert turn == pytest.approx([0, 0, -math.pi / 2], abs=1e-9)
    assert door.poses[-1, :3, 3] == pytest.approx([0.4, -0.4, 0.5])


def test_a_slipping_handle_stays_in_the_gripper_which_turns_less_than_the_door() -> None:
    fast = part_path(HINGE, GRASP, 0.1, -1.0)
    turn, count = np.eye(4), fast.grasp
    turn[:3, :3] = Rotation.from_euler("z", -1.0).as_matrix()
    origin = np.eye(4)
    origin[:3, 3] = HINGE.origin
    retreat = origin @ turn @ np.linalg.inv(origin) @ fast.poses[:count][::-1]
    fast = replace(fast, poses=np.concatenate([fast.poses, retreat]), q=np.append(fast.q, np.full(count, -1.0)))
    path = slipping(fast, HINGE, 0.5)
    end = len(path.poses) - count - 1
    np.testing.assert_allclose(path.poses[: end + 1, :3, 3], fast.poses[: end + 1, :3, 3], atol=1e-12)
    np.testing.assert_allclose(path.poses[: count + 1], fast.poses[: count + 1], atol=1e-12)
    turned = Rotation.from_matrix(path.poses[end, :3, :3] @ path.poses[count, :3, :3].T).as_rotvec()
    assert turned == pytest.approx([0, 0, -0.5], abs=1e-9)
    # It draws back along its own fingers, which is not where the door's front looks.
    np.testing.assert_allclose(path.poses[-1, :3, 3], path.poses[end, :3, 3] - 0.1 * path.poses[end, :3, 2], atol=1e-9)
    assert slipping(fast, HINGE, 0.0) is fast
    wide = slipping(part_path(HINGE, GRASP, 0.1, -1.5), HINGE, 0.8)
    turned = Rotation.from_matrix(wide.poses[-1, :3, :3] @ wide.poses[0, :3, :3].T).as_rotvec()
    assert turned == pytest.approx([0, 0, -1.5 + MAX_SLIP], abs=1e-9), "the hand would meet the front"


def test_a_handle_turns_in_the_gripper_only_about_its_hinge() -> None:
    upright = np.array([0.0, 0.0, 0.5, *Rotation.from_matrix([[0, 0, -1], [0, -1, 0], [-1, 0, 0]]).as_quat()])
    assert variants(HINGE, upright, internal=False) == list(VARIANTS)
    fast = [variant for variant in VARIANTS if variant[1] == 0.0]
    level = np.array([0.0, 0.0, 0.5, *Rotation.from_matrix([[0, 0, -1], [1, 0, 0], [0, -1, 0]]).as_quat()])
    assert variants(HINGE, level, internal=False) == fast
    assert variants(HINGE, upright, internal=True) == fast
    assert variants(SLIDE, upright, internal=False) == fast


def test_a_part_is_opened_as_far_as_asked_or_nearly_as_far_as_it_goes() -> None:
    assert opening_coordinate(SLIDE, GRASP[:3], 0.3) == pytest.approx(0.3)
    assert opening_coordinate(SLIDE, GRASP[:3], 0.5) == pytest.approx(0.38)
    assert opening_coordinate(HINGE, GRASP[:3], 0.2) == pytest.approx(-0.5)


@pytest.mark.parametrize("name", robot.names())
@pytest.mark.parametrize(("joint", "opening"), [(SLIDE, 0.3), (HINGE, -0.75)])
def test_joint_paths_follow_the_tool_path_on_one_branch(name: str, joint: Joint, opening: float) -> None:
    kin = kinematics(robot.load(name))
    base = np.diag([-1.0, -1.0, 1.0, 1.0])
    base[0, 3] = kin.spec.base.distances[0]
    path = part_path(joint, GRASP, 0.1, opening)
    away = base.copy()
    away[0, 3] += 2.0
    found, none = follow(kin, path.poses, np.stack([base, away]), 16)
    assert len(found) and not len(none)
    assert np.abs(np.diff(found, axis=1)).max() < JUMP
    reached = base @ kin.tool(found[0])
    assert reached[:, :3, 3] == pytest.approx(path.poses[:, :3, 3], abs=2e-4)
    assert np.abs(reached[:, :3, 2] - path.poses[:, :3, 2]).max() < 2e-4


def test_a_straight_joint_path_ends_at_its_end_in_small_steps() -> None:
    path = straight(np.zeros(7), np.linspace(0.0, 1.0, 7))
    assert path[-1] == pytest.approx(np.linspace(0.0, 1.0, 7))
    assert np.abs(np.diff(path, axis=0)).max() <= 0.05 + 1e-9
