"""Where the robot stands: kinematics, reach, and what is in its way."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from cabinet_rooms import box, clean_cabinet_room
from only_part import base as base_of
from scanned_drawers import scanned_drawer
from scipy.spatial.transform import Rotation
from settings import load

from s2a import robot
from s2a.motion import search
from s2a.motion.obstacles import Obstacles
from s2a.motion.open import joint_paths, opening_path
from s2a.motion.search import Stand
from s2a.motion.trajectory import PlannerConfig
from s2a.prepare.base_pose import BaseConfig, BasePose, ScannedSurfaces, find_base
from s2a.prepare.grasp import find_grasp, floor_height
from s2a.prepare.room import PrepareConfig, prepare
from s2a.robot.collision import robot_shape
from s2a.robot.kinematics import Kinematics, kinematics
from s2a.robot.spec import RobotSpec
from s2a.robot.tool_path import follow, opening_coordinate, part_path
from s2a.scene.geometry.convex import sweep
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Joint, Mesh, Part, Scene
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import SimRoom
from s2a.sim.room import PEDESTAL, pedestal
from s2a.sim.world import JointConfig, build_world, read_stage

PANDA = robot.load("panda")


@cache
def config() -> BaseConfig:
    return load(PrepareConfig, "prepare/handle").base


def base(scene: Scene, target: str = "drawer_7", spec: RobotSpec = PANDA, **changes: object) -> BasePose:
    moving = (target, *scene.descendants(target))
    way = [piece for i in moving for piece in sweep(scene.parts[i].mesh, scene.joint(target))]
    return find_base(scene, target, find_grasp(scene, target), moving, way, replace(config(), **changes), spec)


def poses_of(scene: Scene, target: str) -> np.ndarray:
    """Return the poses of the tool frame that open a part."""
    grasp, joint = find_grasp(scene, target), scene.joint(target)
    opening = opening_coordinate(joint, np.array(grasp.point), config().opening)
    held = np.array([*grasp.point, *grasp.orientation])
    return part_path(joint, held, config().approach, opening).poses


def with_block(low: tuple[float, ...], high: tuple[float, ...], scene: Scene | None = None) -> Scene:
    """Return a room with a block that is to be avoided."""
    scene = scene or clean_cabinet_room()
    solid = box(*zip(low, high, strict=True)).subdivide().subdivide()
    return replace(scene, parts={**scene.parts, "block_99": Part("block", Mesh(solid.vertices, solid.faces))})


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


def with_floor(low: tuple[float, ...], high: tuple[float, ...]) -> Scene:
    """Return a room of whose floor this much was scanned."""
    scene, solid = clean_cabinet_room(), box(*zip(low, high, strict=True))
    floor = replace(scene.parts["floor_2"], mesh=Mesh(solid.vertices, solid.faces))
    return replace(scene, parts={**scene.parts, "floor_2": floor})


def test_a_robot_stands_where_floor_was_scanned() -> None:
    half = with_floor((-0.4, 0.05, -0.05), (2.5, 2.0, 0.0))
    straight, found = base(half, search=False), base(half)
    assert not straight.free and "no floor was scanned there" in straight.reason
    assert found.free and "no floor was scanned there" in found.reason
    assert found.position[1] > 0.05  # more than half of its footprint
    aside = base(with_floor((-0.4, 0.48, -0.05), (2.5, 2.0, 0.0)), sides=(0.0,), turns=(0.0,))
    assert aside.free and aside.position[1] > 0.48
    away = base(with_floor((-0.4, 1.5, -0.05), (2.5, 2.0, 0.0)), pedestals=(0.0,))
    assert not away.free and ", but no floor was scanned there" in away.reason


@pytest.mark.parametrize("shaft", [False, True])
def test_a_robot_stands_in_a_hole_amid_scanned_floor_but_not_in_a_shaft(shaft: bool) -> None:
    slabs = [
        ((-2.0, -2.0), (0.65, 2.0)),
        ((1.3, -2.0), (3.0, 2.0)),
        ((0.65, -2.0), (1.3, -0.8)),
        ((0.65, 0.8), (1.3, 2.0)),
    ]
    solids = [box(*zip(low, high, strict=True), (-0.05, 0.0)) for low, high in slabs]
    solids += [box((0.65, 1.3), (-0.8, 0.8), (-1.05, -1.0))] if shaft else []
    scene = clean_cabinet_room()
    floor = replace(scene.parts["floor_2"], mesh=merge([Mesh(solid.vertices, solid.faces) for solid in solids]))
    stands = base(replace(scene, parts={**scene.parts, "floor_2": floor}), pedestals=(0.0,))
    assert (stands.free, stands.assumed_floor) == (not shaft, not shaft)
    assert shaft or (stands.position == base(scene).position and "the floor there is assumed" in stands.reason)


def test_the_floor_is_asked_for_where_the_foot_of_a_turned_robot_stands() -> None:
    baxter = robot.load("baxter")  # whose arm is beside its axis
    straight, turned = (
        base(clean_cabinet_room(), spec=baxter, search=False, turns=(turn,)).position for turn in (0.0, 0.8)
    )
    assert abs(turned[1] - straight[1]) > 0.03
    middle = (turned[1] + straight[1]) / 2
    low, high = (middle, 4.0) if straight[1] > turned[1] else (-4.0, middle)
    half = with_floor((-4.0, low, -0.05), (4.0, high, 0.0))
    for turn, said in ((0.0, False), (0.8, True)):
        reason = base(half, spec=baxter, search=False, turns=(turn,)).reason
        assert ("no floor was scanned there" in reason) is said, reason


def test_where_no_part_is_labelled_as_floor_none_is_asked_for() -> None:
    scene = clean_cabinet_room()
    parts = {i: part for i, part in scene.parts.items() if i != "floor_2"}
    assert base(replace(scene, parts=parts)).free


def test_what_stands_there_is_walked_around_and_named() -> None:
    blocked = with_block((0.8, -0.2, 0.0), (1.1, 0.05, 0.3))
    stuck, found = base(blocked, search=False), base(blocked)
    assert not stuck.free and "block_99" in stuck.reason
    assert found.free and "not" in found.reason and "block_99" in found.reason
    gap = np.maximum(np.array([0.8, -0.2]) - found.position[:2], np.array(found.position[:2]) - [1.1, 0.05]).max()
    assert gap >= PANDA.base.radius - 1e-3


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
    low, found, shape = Obstacles.of_scan(scene, np.zeros(3), 0.0), base(scene), robot_shape(PANDA)
    assert found.free
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.from_quat(found.orientation).as_matrix(), found.position
    stand = low.with_column(np.array(found.position), found.pedestal, PANDA.base.radius)
    depths = []
    for path in follow(shape.kin, poses_of(scene, "drawer_7"), pose[None], config().ik_seeds)[0]:
        centers = shape.centers(path)[:, shape.moving] @ pose[:3, :3].T + pose[:3, 3]
        depths.append(stand.deepest(centers, shape.radii[shape.moving])[0])
    assert min(depths) == 0.0


def test_the_arm_turns_to_the_handle_without_touching_anything() -> None:
    # The first joint turns by 3 rad: halfway the gripper is at 1.5 rad, far off the chord on which it would move straight.
    shape = robot_shape(PANDA)
    home = np.array(PANDA.home)
    turned = home - 3.0 * np.eye(7)[0]
    halfway, end = shape.kin.tool(np.stack([(home + turned) / 2, turned]))
    low, high = halfway[:3, 3] - 0.05, halfway[:3, 3] + 0.05
    room = with_block(low, high, Scene("room", {}))
    near, nothing = (Obstacles.of_scan(room, np.array([x, 0.0, 0.0]), 1.6) for x in (0.0, 50.0))
    around, still, stand = np.stack([turned, turned]), np.stack([home, home]), Stand(np.eye(4))
    depth, problem = ScannedSurfaces(near, near, shape).meets(stand, around)
    assert 0.005 < depth < 0.2 and problem == "block_99 on its path to the handle"
    assert ScannedSurfaces(nothing, nothing, shape).meets(stand, around)[0] == 0.0
    assert ScannedSurfaces(near, near, shape).meets(stand, still)[0] == 0.0


@pytest.mark.slow
def test_where_no_place_is_free_the_stage_says_so() -> None:
    walled = with_block((0.45, -3.0, 0.0), (3.0, 3.0, 2.0))
    found = base(walled, pedestals=(0.0, 0.6), turns=(0.0,))
    assert not found.free and ", but " in found.reason


def test_inverse_kinematics_are_not_asked_for_where_the_robot_starts_in_something(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # A slab at the height of the elbow at home, 0.75 m before the furniture: a robot on the floor starts in it everywhere.
    slab = with_block((0.55, -3.0, 0.5), (3.0, 3.0, 0.52))
    asked: list[int] = []

    def counted(kin: Kinematics, poses: np.ndarray, bases: np.ndarray, *more: object) -> list[np.ndarray]:
        asked.append(len(bases))
        return follow(kin, poses, bases, *more)

    monkeypatch.setattr(search, "follow", counted)
    found = base(slab, pedestals=(0.0,), turns=(0.0,))
    assert not found.free and ", but " in found.reason
    # The preferred place, of which is said why it was not taken; then those where the robot collides least.
    assert asked[0] == 1 and len(asked) == 2


def test_the_floor_is_as_high_as_its_points_around_a_place() -> None:
    random = np.random.default_rng(0)
    points = random.uniform(-2.0, 2.0, (3000, 3))
    points = points[np.argsort(points[:, 0])]
    for place in random.uniform(-2.5, 2.5, (50, 2)):
        away = np.linalg.norm(points[:, :2] - place, axis=1)
        near = next((away < radius for radius in (0.05, 0.3) if (away < radius).any()), slice(None))
        assert floor_height(points, place, (0.05, 0.3)) == np.median(points[near, 2])


def test_a_part_does_not_open_into_the_base() -> None:
    room = clean_cabinet_room()
    drawer = room.parts["drawer_7"]
    far = Joint("prismatic", drawer.motion.axis, drawer.motion.origin, (0.0, 0.6))
    scene = replace(room, parts={**room.parts, "drawer_7": replace(drawer, motion=far)})
    found = base(scene)
    assert found.free
    # The bar ends 0.6 m farther out than at first; the base with its radius of 0.12 m stands beyond or beside it.
    assert found.position[0] > 0.359 + 0.6 + 0.12 - 0.01 or abs(found.position[1]) > 0.4


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
    builder = build_world(stage, JointConfig(0.0, 0.0, "grasp"), 0.01)
    assert builder.shape_body[builder.shape_label.index(PEDESTAL)] == -1


def test_the_planner_finds_the_joint_paths_that_the_base_search_found(high_up: SimRoom, tmp_path: Path) -> None:
    sim_stage.write(high_up, tmp_path / "sim.usd")
    (articulation,) = high_up.articulations.values()
    assert base_of(high_up).free
    settings, stage = load(PlannerConfig, "planner/default"), read_stage(tmp_path / "sim.usd")
    (articulation,) = high_up.articulations.values()
    path = opening_path(stage, settings)
    searched = part_path(
        articulation.joint,
        np.array([*articulation.grasp.point, *articulation.grasp.orientation]),
        config().approach,
        opening_coordinate(articulation.joint, np.array(articulation.grasp.point), config().opening),
    )
    assert path.poses == pytest.approx(searched.poses, abs=1e-6)
    assert len(joint_paths(kinematics(PANDA), stage, path, settings))
