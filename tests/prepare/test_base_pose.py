"""Where the robot stands: kinematics, reach, and what is in its way."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from importlib.metadata import files
from pathlib import Path

import numpy as np
import pytest
import trimesh
from cabinet_rooms import box, clean_cabinet_room
from only_part import base as base_of
from scanned_drawers import scanned_drawer
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from settings import load

from s2a import robot
from s2a.geometry.sweep import sweep
from s2a.planner.motion import PlannerConfig, _hand_path, _tracks
from s2a.prepare import PrepareConfig, prepare
from s2a.prepare.base_pose import BaseConfig, BasePose, find_base
from s2a.prepare.grasp import find_grasp
from s2a.prepare.obstacles import Surroundings
from s2a.prepare.path_clearance import deepest_clash
from s2a.prepare.reach import follow, hand_way
from s2a.robot import panda
from s2a.scene import Joint, Mesh, Part, Scene
from s2a.sim.room import PEDESTAL, pedestal
from s2a.sim.world import JointConfig, build_world, read_stage
from s2a.usd import sim_stage
from s2a.usd.sim_scene import SimRoom


@cache
def config() -> BaseConfig:
    return load(PrepareConfig, "prepare/handle").base


def base(scene: Scene, target: str = "drawer_7", **changes: object) -> BasePose:
    moving = (target, *scene.descendants(target))
    way = [piece for i in moving for piece in sweep(scene.parts[i].mesh, scene.joint(target))]
    return find_base(scene, target, find_grasp(scene, target), moving, way, replace(config(), **changes))


def with_block(low: tuple[float, ...], high: tuple[float, ...], scene: Scene | None = None) -> Scene:
    """Return a room with a block that is to be avoided."""
    scene = scene or clean_cabinet_room()
    solid = box(*zip(low, high, strict=True)).subdivide().subdivide()
    return replace(scene, parts={**scene.parts, "block_99": Part("block", Mesh(solid.vertices, solid.faces))})


def test_the_kinematics_are_those_of_the_simulated_robot() -> None:
    import newton
    import warp as wp

    from s2a.robot.model import add_robot

    builder = newton.ModelBuilder()
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    add_robot(builder, robot.load("panda"), wp.transform())
    model = builder.finalize(device="cpu")
    names = [label.split("/")[-1] for label in model.body_label]
    rows = [names.index(n) for n in (*(f"panda_link{i}" for i in range(1, 8)), "panda_hand_tcp")]
    for q in np.random.default_rng(0).uniform(panda.LOWER, panda.UPPER, (5, 7)):
        state = model.state()
        newton.eval_fk(model, wp.array([*q, 0.0, 0.0], dtype=float), model.joint_qd, state)
        found, poses = panda.frames(q[None])[0], state.body_q.numpy()[rows]
        assert found[:, :3, 3] == pytest.approx(poses[:, :3], abs=1e-6)
        assert found[:, :3, :3] == pytest.approx(Rotation.from_quat(poses[:, 3:]).as_matrix(), abs=1e-5)
    limits = model.joint_limit_lower.numpy()[:7], model.joint_limit_upper.numpy()[:7]
    assert np.array(limits) == pytest.approx(np.array([panda.LOWER, panda.UPPER]))


@pytest.mark.parametrize(("link", "frame"), [*((f"link{i}", i - 1) for i in range(1, 8)), ("hand", panda.TOOL)])
def test_the_spheres_cover_the_links_and_little_more(link: str, frame: int) -> None:
    path = next(
        f.locate()
        for f in files("example-robot-data") or []
        if f"panda_description/meshes/collision/{link}.stl" in str(f)
    )
    solid = trimesh.load(str(path)).convex_hull
    points = solid.sample(2000, seed=0) - ([0, 0, 0.1034] if link == "hand" else [0, 0, 0])
    balls = panda.SPHERES[:-4][panda.SPHERES[:-4, 0] == frame]
    gap = (np.linalg.norm(points[:, None] - balls[:, 1:4], axis=2) - balls[:, 4]).min(axis=1)
    assert gap.max() < 0.01
    planes = ConvexHull(solid.vertices - ([0, 0, 0.1034] if link == "hand" else [0, 0, 0])).equations
    outwards = (balls[:, 1:4] @ planes[:, :3].T + planes[:, 3]).max(axis=1) + balls[:, 4]
    assert outwards.max() < 0.022


def test_inverse_kinematics_finds_what_kinematics_made() -> None:
    rng = np.random.default_rng(0)
    q = rng.uniform(0.8 * panda.LOWER + 0.2 * panda.UPPER, 0.2 * panda.LOWER + 0.8 * panda.UPPER, (200, 7))
    targets = panda.frames(q)[:, panda.TOOL]
    found, left = panda.solve(targets, q + rng.normal(0.0, 0.2, q.shape), 60)
    assert (left < 1e-3).mean() > 0.95
    good = left < 1e-3
    assert panda.frames(found)[good, panda.TOOL] == pytest.approx(targets[good], abs=2e-3)
    assert (found >= panda.LOWER).all() and (found <= panda.UPPER).all()


def test_the_hand_turns_with_a_door_and_moves_straight_with_a_drawer() -> None:
    room = clean_cabinet_room()
    drawer = hand_way(find_grasp(room, "drawer_7"), room.joint("drawer_7"), 0.1, 0.3)
    assert drawer[0, :3, 3] - drawer[-1, :3, 3] == pytest.approx([-0.2, 0, 0], abs=1e-6)  # 0.1 m before, 0.3 m out
    assert drawer[:, :3, :3] == pytest.approx(np.broadcast_to(drawer[0, :3, :3], (len(drawer), 3, 3)), abs=1e-9)
    door = hand_way(find_grasp(room, "door_5"), room.joint("door_5"), 0.1, math.pi / 2)
    turn = Rotation.from_matrix(door[-1, :3, :3] @ door[0, :3, :3].T).as_rotvec()
    assert turn == pytest.approx([0, 0, math.pi / 2], abs=1e-6)


def test_nothing_beyond_the_arms_length_is_reached() -> None:
    room = clean_cabinet_room()
    way = hand_way(find_grasp(room, "drawer_7"), room.joint("drawer_7"), 0.1, 0.3)
    away = np.eye(4)
    away[0, 3] = 1.6
    assert len(follow(way, away[None], np.array(config().start), 8)[0]) == 0


def test_the_papers_place_is_kept_where_it_serves() -> None:
    found = base(clean_cabinet_room())
    assert found.free and found.pedestal == 0.0
    away = np.array(found.position) - clean_cabinet_room().grasp_point("drawer_7")
    assert np.hypot(*away[:2]) == pytest.approx(0.55, abs=1e-6)
    assert "0.55 m before the handle, on the floor" in found.reason


def test_a_floor_lamp_is_no_floor_to_stand_on() -> None:
    lit = with_block((0.7, -0.5, 1.5), (1.2, -0.3, 1.6))
    lamp = replace(lit.parts["block_99"], label="floor lamp")
    scene = replace(lit, parts={**lit.parts, "block_99": lamp})
    assert base(scene, search=False).position[2] == pytest.approx(0.0, abs=1e-6)


def test_what_stands_there_is_walked_around_and_named() -> None:
    blocked = with_block((0.8, -0.2, 0.0), (1.1, 0.05, 0.3))
    stuck, found = base(blocked, search=False), base(blocked)
    assert not stuck.free and "block_99" in stuck.reason
    assert found.free and "not" in found.reason and "block_99" in found.reason
    gap = np.maximum(np.array([0.8, -0.2]) - found.position[:2], np.array(found.position[:2]) - [1.1, 0.05]).max()
    assert gap >= config().radius - 1e-3


def test_what_hangs_where_the_arm_starts_is_noticed() -> None:
    hanging = with_block((0.4, -0.6, 0.85), (1.4, 0.6, 1.0))
    assert "block_99" in base(hanging, search=False).reason


@pytest.mark.parametrize("height", [0.25, 1.5])
def test_low_and_high_handles_are_reached_from_elsewhere(height: float) -> None:
    scene = scanned_drawer(height=height)
    assert not base(scene, search=False).free
    found = base(scene)
    assert found.free
    assert found.position[2] == pytest.approx(found.pedestal, abs=1e-6)


def test_the_arm_does_not_reach_through_what_it_stands_on() -> None:
    # So low that the wrist comes back to the robot's foot at the height of a pedestal.
    scene = scanned_drawer(height=0.2)
    low, found = Surroundings(scene, [], np.zeros(3), 0.0), base(scene)
    assert found.free
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.from_quat(found.orientation).as_matrix(), found.position
    way = hand_way(find_grasp(scene, "drawer_7"), scene.joint("drawer_7"), config().approach, config().opening)
    stand = low.with_pedestal(np.array(found.position), found.pedestal, config().radius)
    depths = []
    for track in follow(way, pose[None], np.array(config().start), config().restarts)[0]:
        balls = panda.spheres(track) @ pose[:3, :3].T + pose[:3, 3]
        depths.append(stand.hit(balls.reshape(-1, 3), np.tile(panda.SPHERES[:, 4], len(track)), moving=True)[0])
    assert min(depths) == 0.0


@pytest.mark.parametrize(("ball", "depth"), [((0.2, 0.0, 0.1), 0.02), ((0.0, 0.0, 0.33), 0.07), ((0.0, 0.0, 0.5), 0.0)])
def test_a_pedestal_is_an_upright_column_under_the_foot(ball: tuple[float, float, float], depth: float) -> None:
    nothing = Surroundings(scanned_drawer(), [], np.array([50.0, 0.0, 0.0]), 0.1)
    stand = nothing.with_pedestal(np.array([0.0, 0.0, 0.3]), 0.3, 0.12)
    assert stand.hit(np.array([ball]), np.array([0.1]), moving=True)[0] == pytest.approx(depth, abs=1e-9)
    assert nothing.hit(np.array([ball]), np.array([0.1]), moving=True)[0] == 0.0


def test_the_arm_turns_to_the_handle_without_touching_anything() -> None:
    # The first joint turns by 2 rad: halfway the hand is at 1 rad, far off the chord on which it would move straight.
    start = np.array(config().start)
    turned = start - 2.0 * np.eye(7)[0]
    halfway, end = panda.frames(np.stack([(start + turned) / 2, turned]))[:, panda.TOOL]
    low, high = halfway[:3, 3] - 0.03, halfway[:3, 3] + 0.03
    room = with_block(low, high, Scene("room", {}))
    near, nothing = (Surroundings(room, [], np.array([x, 0.0, 0.0]), 1.6) for x in (0.0, 50.0))
    around, still = np.stack([turned, turned]), np.stack([start, start])
    depth, problem = deepest_clash(near, np.eye(4), 0.0, end[None], around[None], start)
    assert 0.02 < depth < 0.2 and "block_99 on its way to the handle" in problem
    assert deepest_clash(nothing, np.eye(4), 0.0, end[None], around[None], start)[0] == 0.0
    assert deepest_clash(near, np.eye(4), 0.0, end[None], np.stack([around, still]), start)[0] == 0.0


def test_where_no_place_is_free_the_stage_says_so() -> None:
    walled = with_block((0.45, -3.0, 0.0), (3.0, 3.0, 2.0))
    found = base(walled, pedestals=(0.0, 0.6), turns=(0.0,))
    assert not found.free and "no place is free" in found.reason


def test_a_part_does_not_open_into_the_base() -> None:
    room = clean_cabinet_room()
    drawer = room.parts["drawer_7"]
    far = Joint("prismatic", drawer.motion.axis, drawer.motion.origin, (0.0, 0.6))
    scene = replace(room, parts={**room.parts, "drawer_7": replace(drawer, motion=far)})
    found = base(scene)
    assert found.free
    # The bar ends 0.6 m farther out than at first; the base with its radius of 0.12 m stands beyond or beside it.
    assert found.position[0] > 0.359 + 0.6 + 0.12 - 0.01 or abs(found.position[1]) > 0.4


def test_one_lucky_start_of_the_kinematics_is_not_enough() -> None:
    # No solver that starts elsewhere would find a way that so few of many starts find.
    found = base(clean_cabinet_room(), tracks=1000, search=False)
    assert not found.free and "cannot reach" in found.reason
    assert base(clean_cabinet_room(), tracks=2, search=False).free


@pytest.fixture(scope="module")
def high_up() -> SimRoom:
    """A drawer whose handle is reached from a pedestal alone."""
    settings = load(PrepareConfig, "prepare/handle")
    furniture, room = (replace(one, resolution=3000) for one in (settings.cabinet, settings.room))
    return prepare(scanned_drawer(height=1.5), "drawer_7", replace(settings, cabinet=furniture, room=room))


def test_what_the_robot_stands_on_ends_just_below_its_base(high_up: SimRoom, tmp_path: Path) -> None:
    sim_stage.write(high_up, tmp_path / "sim.usd")
    stage = read_stage(tmp_path / "sim.usd")
    stand, foot = pedestal(stage.base, *stage.pedestal), np.array(base_of(high_up).position)
    assert stand.bounds[0, 2] == pytest.approx(0.0, abs=1e-6)  # the floor
    assert 0.001 < foot[2] - stand.bounds[1, 2] < 0.003
    assert stand.bounds.mean(axis=0)[:2] == pytest.approx(foot[:2], abs=1e-3)
    builder = build_world(stage, JointConfig(0.0, 0.0), 0.01)
    assert builder.shape_body[builder.shape_label.index(PEDESTAL)] == -1


def test_the_planner_finds_a_way_from_where_the_arm_is_said_to_reach(high_up: SimRoom, tmp_path: Path) -> None:
    sim_stage.write(high_up, tmp_path / "sim.usd")
    assert base_of(high_up).free
    # Planned at a tenth of the simulation's rate, at which the steps are longer and harder to follow.
    settings, stage = load(PlannerConfig, "policy/planner"), read_stage(tmp_path / "sim.usd")
    poses, _ = _hand_path(stage, settings, 10.0)
    assert _tracks(stage, robot.load("panda"), poses, settings).shape[1:] == (len(poses), 7)
