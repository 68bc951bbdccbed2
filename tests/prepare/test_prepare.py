"""What `prepare` makes of a room: the file's promises to a simulation."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from cabinet_rooms import clean_cabinet_room
from closeness import surface_distance
from few import few
from only_part import base, cabinet, moving, part
from scanned_drawers import scanned_drawer
from scipy.spatial.transform import Rotation
from settings import load

from s2a import robot
from s2a.core.errors import InputError
from s2a.motion.gripper import gripper_spheres
from s2a.prepare.base_pose import find_base
from s2a.prepare.grasp import find_grasp
from s2a.prepare.part_hulls import cabinet_body
from s2a.prepare.room import PrepareConfig, prepare
from s2a.robot.tool_path import matrix
from s2a.scene.geometry.convex import box, column, overlap, sweep
from s2a.scene.geometry.front_panel import fraction_inside
from s2a.scene.geometry.mesh_ops import keep, merge, sample
from s2a.scene.scene import Mesh, Part, Scene
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import SimRoom
from s2a.scene.usd.stage import problems

BAR_HEIGHT = 0.73
"""[m] of the scanned drawer's bar above the floor."""


@cache
def config(method: str = "handle") -> PrepareConfig:
    """Return the settings as they are, but for how finely what only stands around is decomposed: that takes seconds."""
    settings = load(PrepareConfig, f"prepare/{method}")
    furniture, room = (replace(one, resolution=3000) for one in (settings.cabinet, settings.room))
    return replace(settings, cabinet=furniture, room=room)


@cache
def prepared(target: str, method: str = "handle") -> SimRoom:
    return prepare(clean_cabinet_room(), target, config(method))


@cache
def scanned(seed: int = 0, method: str = "handle", web: float = 0.0) -> SimRoom:
    return prepare(scanned_drawer(seed, web=web), "drawer_7", config(method))


def behind_the_bar() -> np.ndarray:
    """Return points between bar and front, 80 mm along it, 2 mm off either."""
    low, high = [0.002, -0.04, BAR_HEIGHT - 0.0119], [0.0219, 0.04, BAR_HEIGHT + 0.0119]
    return np.random.default_rng(0).uniform(low, high, (4000, 3))


@pytest.mark.parametrize("seed", few(range(3), 1))
def test_fingers_fit_behind_a_scanned_handle(seed: int) -> None:
    pieces = [collider.mesh for collider in moving(scanned(seed)).colliders]
    assert fraction_inside(pieces, behind_the_bar()) <= 0.01
    assert len(pieces) <= 32


def test_a_gap_that_the_scan_closed_with_a_skin_is_opened() -> None:
    pieces = [collider.mesh for collider in moving(scanned(web=1.0)).colliders]
    assert fraction_inside(pieces, behind_the_bar()) <= 0.01


def test_one_hull_swallows_the_gap() -> None:
    pieces = [collider.mesh for collider in moving(scanned(method="one_hull")).colliders]
    assert len(pieces) == 1
    assert fraction_inside(pieces, behind_the_bar()) > 0.9


@pytest.mark.parametrize("seed", range(3))
def test_a_scanned_handle_lies_within_a_millimetre_of_its_pieces_on_average(seed: int) -> None:
    pieces = [collider.mesh for collider in moving(scanned(seed)).colliders if collider.part == "handle_9"]
    surface = sample(scanned_drawer(seed).parts["handle_9"].mesh, 1000, 0)
    assert surface_distance(pieces, surface).mean() <= 0.001


def test_the_front_is_solid_where_the_handle_hid_it() -> None:
    front = [collider.mesh for collider in moving(scanned()).colliders if collider.part == "drawer_7"]
    inside = np.array([[-0.01, y, BAR_HEIGHT + z] for y in (-0.3, 0.0, 0.3) for z in (-0.05, 0.0, 0.05)])
    assert fraction_inside(front, inside) == 1.0


def test_pieces_have_few_vertices_and_a_volume() -> None:
    scene = scanned()
    for collider in (*moving(scene).colliders, *cabinet(prepared("drawer_7")).colliders):
        assert 4 <= len(collider.mesh.vertices) <= 32
        assert (np.ptp(collider.mesh.vertices, axis=0) > 5e-4).all()


@pytest.mark.parametrize(("target", "yaw"), [("drawer_7", 0.0), ("drawer_8", 1.1), ("door_5", 0.0), ("door_6", -2.0)])
def test_the_robot_stands_on_the_floor_before_the_handle_and_looks_at_it(target: str, yaw: float) -> None:
    scene = clean_cabinet_room(yaw)
    grasp = find_grasp(scene, target)
    found = find_base(scene, target, grasp, (target,), [], replace(config().base, search=False), robot.load("panda"))
    position, orientation = found.position, found.orientation
    away = np.array(position) - scene.grasp_point(target)
    assert np.hypot(*away[:2]) == pytest.approx(0.55, abs=1e-6)
    assert away[:2] @ [np.cos(yaw), np.sin(yaw)] > 0.53
    assert position[2] == pytest.approx(0.0, abs=1e-6)
    ahead = Rotation.from_quat(orientation).apply([1.0, 0.0, 0.0])
    assert ahead[:2] @ away[:2] == pytest.approx(-0.55, abs=1e-6)


def test_the_grasp_frame_of_a_level_bar_looks_into_the_furniture_with_y_up() -> None:
    grasp = part(scanned()).grasp
    frame = Rotation.from_quat(grasp.orientation).as_matrix()
    assert frame[:, 2] == pytest.approx([-1, 0, 0], abs=1e-6)
    assert frame[:, 1] == pytest.approx([0, 0, 1], abs=0.02)
    assert frame[:, 0] == pytest.approx(np.cross(frame[:, 1], frame[:, 2]), abs=1e-9)
    # The bar is 168 mm long and 24 mm thick and stands 38 mm out of the front.
    assert grasp.size == pytest.approx([0.168, 0.0238, 0.038], abs=0.005)


def test_an_upright_bar_is_grasped_from_its_sides() -> None:
    scene, turn = scanned_drawer(), np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    handle = scene.parts["handle_9"]
    upright = Mesh((handle.mesh.vertices - [0, 0, 0.73]) @ turn.T + [0, 0, 0.73], handle.mesh.faces)
    parts = {**scene.parts, "handle_9": Part("handle", upright, "drawer_7", graspable=True)}
    grasp = part(prepare(Scene("upright", parts), "drawer_7", config())).grasp
    assert abs(Rotation.from_quat(grasp.orientation).as_matrix()[1, 1]) > 0.99


@pytest.mark.parametrize("target", ["drawer_7", "drawer_8", "door_5"])
def test_no_room_collider_reaches_into_the_robot_or_the_way_of_the_target(target: str) -> None:
    scene = prepared(target)
    obstacles = [column(np.array(base(scene).position) + [0, 0, 0.01], 0.25, 1.19)]
    obstacles += sweep(moving(scene).visual, part(scene).joint)
    assert len(scene.static_colliders) > 0
    for collider in scene.static_colliders:
        assert max(overlap(collider.mesh, obstacle) for obstacle in obstacles) < 5e-4


def test_a_table_in_the_way_of_an_opening_drawer_is_cut_off_not_forgotten() -> None:
    room = clean_cabinet_room()
    block = _box([0.5, 0.1, 0.0], [0.9, 0.7, 0.9])
    scene = Scene("blocked", {**room.parts, "block_99": Part("block", block)})
    found = prepare(scene, "drawer_7", config())
    kept = [collider.mesh for collider in found.static_colliders if collider.part == "block_99"]
    assert kept
    ways = sweep(moving(found).visual, part(found).joint)
    assert all(overlap(piece, way) < 5e-4 for piece in kept for way in ways)


def test_the_other_drawers_and_doors_are_frozen_into_the_cabinet() -> None:
    scene = prepared("drawer_7")
    assert cabinet(scene).id == "cabinet_3"
    frozen = {"cabinet_3", "drawer_8", "handle_12", "door_5", "knob_15", "door_6", "knob_16"}
    assert {collider.part for collider in cabinet(scene).colliders} == frozen
    assert {collider.part for collider in moving(scene).colliders} == {"drawer_7", "handle_11"}
    parts = clean_cabinet_room().parts
    assert len(cabinet(scene).visual.faces) == sum(len(parts[i].mesh.faces) for i in frozen)


def test_the_hand_reaches_the_handle_past_the_cabinet() -> None:
    scene = prepared("drawer_7")
    way = np.array(part(scene).grasp.point) + np.random.default_rng(0).uniform(
        [0, -0.1, -0.05], [0.2, 0.1, 0.05], (2000, 3)
    )
    assert fraction_inside([collider.mesh for collider in cabinet(scene).colliders], way) == 0.0


def test_what_hangs_before_the_handle_is_cut_back_from_the_hands_way() -> None:
    ledge = Part("ledge", _box([0.36, -0.3, 0.75], [0.5, 0.3, 0.9]), "cabinet_3")
    room = clean_cabinet_room()
    scene = replace(room, parts={**room.parts, "ledge_20": ledge})
    corridor = box(np.array([0.5, 0.0, 0.73]), np.eye(3), np.array([0.3, 0.3, 0.16]))
    (cut,) = cabinet_body(scene, ["ledge_20"], [corridor], [], config().cabinet).colliders
    assert overlap(cut.mesh, corridor) < 5e-4
    # The corridor ends at 0.81 m.
    assert cut.mesh.bounds == pytest.approx(np.array([[0.36, -0.3, 0.81], [0.5, 0.3, 0.9]]), abs=1e-3)


def test_a_target_without_a_cabinet_moves_against_an_empty_anchor() -> None:
    parts = dict(clean_cabinet_room().parts)
    parts["drawer_7"] = Part("drawer", parts["drawer_7"].mesh, None, parts["drawer_7"].motion)
    scene = prepare(Scene("lone", parts), "drawer_7", config())
    assert cabinet(scene).id == "drawer_7_anchor"
    assert not cabinet(scene).colliders and not len(cabinet(scene).visual.faces)


@pytest.mark.slow
def test_a_drawer_without_a_cabinet_leaves_the_gripper_its_way_too() -> None:
    """As in a phone's scan: what stands around it is one surface, whose hulls fill the air before the handle."""
    parts = dict(clean_cabinet_room().parts)
    parts["drawer_7"] = Part("drawer", parts["drawer_7"].mesh, None, parts["drawer_7"].motion)
    parts["rest_30"] = Part("object", _box([0.36, -0.3, 0.79], [0.8, 0.3, 0.9]))
    scene = prepare(Scene("lone", parts), "drawer_7", config())
    kept = [collider.mesh for collider in scene.static_colliders if collider.part == "rest_30"]
    assert kept  # it is cut, not left out
    grasp, gripper = part(scene).grasp, robot.load("panda").gripper
    tool = matrix(np.array([*grasp.point, *grasp.orientation]))
    back = np.linspace(0.0, 0.1, 9)[:, None, None] * tool[:3, 2]
    way = gripper_spheres(gripper, fingers=False).placed(tool[None]) - back
    assert fraction_inside(kept, way.reshape(-1, 3)) == 0.0


@pytest.mark.slow
def test_a_shelf_that_is_not_annotated_as_furniture_keeps_its_compartments_free() -> None:
    """Eight of 0.15 m, beside each other, around a drawer of no furniture: more than the six hulls of what only stands around."""
    parts = dict(clean_cabinet_room().parts)
    drawer = Part("drawer", parts["drawer_7"].mesh, None, parts["drawer_7"].motion)
    walls = [_box([0.0, y, 0.0], [0.35, y + 0.02, 0.95]) for y in np.linspace(-0.62, 0.58, 9)]
    back = _box([-0.02, -0.62, 0.0], [0.0, 0.6, 0.95])
    shelf = Part("object", merge([*walls, back]))
    inside = np.random.default_rng(0).uniform([0.1, -0.6, 0.1], [0.34, 0.6, 0.6], (2000, 3))
    settings = replace(config(), room=replace(config().room, resolution=20000))
    scene = prepare(Scene("shelf", {"drawer_7": drawer, "rest_30": shelf}), "drawer_7", settings)
    hulls = [collider.mesh for collider in scene.static_colliders if collider.part == "rest_30"]
    assert fraction_inside(hulls, inside) < 0.2  # the walls themselves are 0.15 of it


def test_an_annotated_mass_wins_over_the_label() -> None:
    parts = dict(clean_cabinet_room().parts)
    drawer = parts["drawer_7"]
    parts["drawer_7"] = Part("drawer", drawer.mesh, drawer.parent, drawer.motion, mass=3.2)
    assert moving(prepare(Scene("heavy", parts), "drawer_7", config())).mass.mass == pytest.approx(3.2)
    assert moving(prepared("drawer_7")).mass.source.endswith("m of front of a drawer")


def test_a_body_is_as_hard_to_turn_as_the_box_around_it() -> None:
    mass = moving(prepared("drawer_7")).mass
    size = np.array([0.0381 + 0.2732 + 0.2575, 0.7588, 0.1238])
    expected = mass.mass / 12 * (np.sum(size**2) - size**2)
    inertia = (
        Rotation.from_quat(mass.axes).as_matrix() @ np.diag(mass.inertia) @ Rotation.from_quat(mass.axes).as_matrix().T
    )
    assert np.diag(inertia) == pytest.approx(expected, rel=1e-4)
    assert mass.center == pytest.approx([0.0515 + (0.3113 - 0.2575) / 2, 0.0, 0.7172], abs=1e-4)


def test_an_unknown_or_immovable_target_is_refused_with_the_movable_ones() -> None:
    for target in ("cabinet_3", "drawer_70"):
        with pytest.raises(InputError, match="drawer_7, "):
            prepare(clean_cabinet_room(), target, config())


@pytest.mark.parametrize("unit", [0.0254, 0.01, 0.001])
def test_a_room_that_is_not_in_metres_is_refused_at_once(unit: float) -> None:
    def scaled(one: Part) -> Part:
        return replace(one, mesh=Mesh(one.mesh.vertices / np.float32(unit), one.mesh.faces))

    scene = clean_cabinet_room()
    with pytest.raises(InputError, match="m long; expected metres"):
        prepare(replace(scene, parts={i: scaled(one) for i, one in scene.parts.items()}), "drawer_7", config())


def test_the_file_is_sound_and_the_same_each_time(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        sim_stage.write(prepare(scanned_drawer(), "drawer_7", config()), tmp_path / name / "sim.usda")
    for file in ("sim.usda", "sim_visuals.usda"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
    assert problems(tmp_path / "a/sim.usda") == []


def _box(low: list[float], high: list[float]) -> Mesh:
    import trimesh

    solid = trimesh.creation.box(bounds=[low, high]).subdivide().subdivide()
    return keep(Mesh(solid.vertices, solid.faces), np.ones(len(solid.faces), bool))
