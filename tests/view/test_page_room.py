"""What a page shows of a room: rows, what moves with which joint, and how far."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tiny_scan
import usd_room
from cabinet import free_cube, write_cabinet

from s2a.core.errors import InputError
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Joint, Mesh, Part, Scene
from s2a.scene.usd import descriptive, geometric, sim_stage
from s2a.scene.usd.sim_scene import Collider, SimRoom
from s2a.view.page import cards, layers, panel
from s2a.view.page.panel import pick
from s2a.view.page.room import Coordinates, PageRoom, of_scene, of_sim_room, read, unit


@pytest.fixture
def room() -> PageRoom:
    return of_scene(usd_room.room())


def hinge_room() -> Scene:
    """A door of 1 m x 2 m that turns about the vertical line through (2, 1, 0)."""
    door = Joint("revolute", (0.0, 0.0, 1.0), (2.0, 1.0, 0.0), (0.0, math.pi / 2))
    parts = {"frame_1": Part("frame", usd_room.box((2.5, 1.0, 2.1), (1.2, 0.1, 0.1)))}
    parts["door_2"] = Part("door", usd_room.box((2.5, 1.0, 1.0), (1.0, 0.04, 2.0)), "frame_1", door)
    return Scene("hinge", parts)


def test_a_scan_and_its_geometric_stage_make_the_same_page(tmp_path: Path) -> None:
    scan = tiny_scan.write(tmp_path / "scan")
    geometric.write(tiny_scan.scan.read(scan), tmp_path / "room.usd")
    assert read(tmp_path / "room.usd") == read(scan)


def test_every_part_is_a_row_below_its_parent(room: PageRoom) -> None:
    listed = dict(cards.rows(room))
    assert sorted(listed) == sorted(usd_room.room().parts)
    assert all(part.parent is None or listed[i] == listed[part.parent] + 1 for i, part in room.parts.items())
    order = list(listed)
    assert order.index("drawer_7") < order.index("handle_9") < order.index("door_21")


def test_what_hangs_on_a_jointed_part_moves_with_it(room: PageRoom) -> None:
    assert {i: part.mover for i, part in room.parts.items() if part.mover} == {
        "drawer_7": "drawer_7",
        "handle_base_8": "drawer_7",
        "handle_9": "drawer_7",
        "flap_10": "flap_10",
        "door_20": "door_20",
        "door_21": "door_21",
    }
    assert room.carriers == {"drawer_7": None, "flap_10": "drawer_7", "door_20": None, "door_21": None}
    assert room.carried("drawer_7") == ("drawer_7", "flap_10")


def test_a_slider_at_half_of_a_hinge_turns_it_by_45_degrees_about_its_axis() -> None:
    at = Coordinates(of_scene(hinge_room()))
    at.set("door_2", 45.0)
    s = math.sqrt(0.5)
    # A turn by 45 degrees about the vertical line through (2, 1): p -> R (p - o) + o; o - R o = (2 - 2s + s, 1 - 2s - s).
    expected = [[s, -s, 0, 2 - s], [s, s, 0, 1 - 3 * s], [0, 0, 1, 0], [0, 0, 0, 1]]
    np.testing.assert_allclose(at.pose("door_2"), expected, atol=1e-12)
    assert at.pose(None).tolist() == np.eye(4).tolist()


def test_a_slider_in_millimetres_slides_along_the_axis(room: PageRoom) -> None:
    at = Coordinates(room)
    at.set("drawer_7", 200.0)
    np.testing.assert_allclose(at.pose("drawer_7")[:3, 3], 0.2 * np.array(room.joints["drawer_7"].axis), atol=1e-12)
    assert unit(room.joints["drawer_7"]) == ("mm", 1e-3)


def test_a_flap_on_an_open_drawer_turns_first_and_is_then_carried(room: PageRoom) -> None:
    at = Coordinates(room, {"drawer_7": 0.3, "flap_10": 1.0})
    alone = Coordinates(room, {"flap_10": 1.0}).pose("flap_10")
    np.testing.assert_allclose(at.pose("flap_10")[:3, :3], alone[:3, :3])
    shifted = alone[:3, 3] + 0.3 * np.array(room.joints["drawer_7"].axis)
    np.testing.assert_allclose(at.pose("flap_10")[:3, 3], shifted)


def test_surfaces_hold_every_face_once_and_jointed_parts_are_nodes_of_their_own(room: PageRoom) -> None:
    nodes = [node for layer in (layers.surfaces, layers.colored) for node in layer(room)]
    for caption in (layers.SURFACES, layers.BY_PART):
        found = [node for node in nodes if node.layer == caption]
        faces = sum(len(part.surface.faces) for part in room.parts.values())
        assert sum(len(node.mesh.faces) for node in found) == faces
        assert {node.mover for node in found} == {None, "drawer_7", "flap_10", "door_20"}  # door_21 has no face
        assert len({node.name for node in found}) == len(found)


def test_colours_by_part_tell_parts_apart(room: PageRoom) -> None:
    colors = {tuple(c) for node in layers.colored(room) for c in node.mesh.colors.tolist()}
    assert len(colors) == sum(len(part.surface.faces) > 0 for part in room.parts.values())


def test_grasp_regions_are_the_handles_lifted_off_their_surface(room: PageRoom) -> None:
    assert {(region.part, region.mover) for region in room.grasps} == {("drawer_7", "drawer_7")}
    (node,) = layers.grasps(room)
    handle = room.parts["handle_9"].surface
    # At the corner of a box, with one or two triangles on each side, the normal leaves the box.
    grown = np.ptp(node.mesh.bounds, axis=0) - np.ptp(handle.bounds, axis=0)
    assert (grown > 0.0).all() and (grown <= 2.0 * layers.LIFT + 1e-6).all()


def test_a_slides_arrow_is_as_long_as_its_travel_and_a_hinges_lies_on_its_axis(room: PageRoom) -> None:
    arrows = {arrow.name: arrow for arrow in layers.arrows(room)}
    slide = arrows["drawer_7"].ends
    np.testing.assert_allclose(slide[1] - slide[0], 0.4 * np.array(room.joints["drawer_7"].axis), atol=1e-9)
    hinge = next(iter(layers.arrows(of_scene(hinge_room())))).ends
    np.testing.assert_allclose(hinge, [(2.0, 1.0, 0.0 - layers.MARGIN), (2.0, 1.0, 2.0 + layers.MARGIN)], atol=1e-6)
    assert arrows["flap_10"].mover == "drawer_7"  # its axis travels with the drawer
    assert set(arrows) == set(room.joints)


def test_a_ray_meets_the_nearest_part_and_finds_it_where_it_has_moved() -> None:
    page = of_scene(hinge_room())
    at = Coordinates(page)
    eye, way = np.array([2.9, -3.0, 1.0]), np.array([0.0, 1.0, 0.0])
    assert pick(at, eye, way) == "door_2"
    at.set("door_2", 90.0)  # it stands away from the ray now, along y from (2, 1)
    assert pick(at, eye, way) is None
    assert pick(at, np.array([2.0, 1.5, 5.0]), np.array([0.0, 0.0, -2.0])) == "door_2"
    assert pick(at, np.array([2.9, 1.0, 5.0]), np.array([0.0, 0.0, -1.0])) == "frame_1"


def test_a_still_surface_seen_from_behind_is_not_met() -> None:
    triangle = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))
    at = Coordinates(of_scene(Scene("one", {"plate_1": Part("plate", triangle)})))
    down = np.array([0.0, 0.0, -1.0])
    assert pick(at, np.array([0.2, 0.2, 1.0]), down) == "plate_1"
    assert pick(at, np.array([0.2, 0.2, -1.0]), -down) is None
    assert pick(at, np.array([0.8, 0.8, 1.0]), down) is None
    slide = Joint("prismatic", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 1.0))
    moving = Coordinates(of_scene(Scene("one", {"lid_1": Part("lid", triangle, None, slide)})))
    assert pick(moving, np.array([0.2, 0.2, -1.0]), -down) == "lid_1"  # what moves is shown from both sides
    assert pick(moving, np.array([0.8, 0.8, -1.0]), -down) is None


def test_a_description_shows_boxes_that_move_as_it_says(tmp_path: Path) -> None:
    scene = usd_room.room()
    parts = {i: part for i, part in scene.parts.items() if i.isascii() and i not in ("picture_2", "door_21")}
    path = tmp_path / "descriptive.usda"
    descriptive.write(Scene("described", parts), path)
    page = read(path)
    assert page.boxes and list(layers.surfaces(page)) == []
    assert page.carriers == {"drawer_7": None, "flap_10": "drawer_7", "door_20": None}
    assert page.parts["handle_9"].mover == "drawer_7"
    assert page.parts["cabinet_3"].mass == pytest.approx(21.123)
    handle = page.parts["handle_9"].surface
    np.testing.assert_allclose(handle.bounds, parts["handle_9"].mesh.bounds, atol=1e-3)
    # Closed, and its triangles look outside: the volume under them is that of the box.
    a, b, c = np.moveaxis(handle.vertices[handle.faces].astype(np.float64), 1, 0)
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0
    assert volume == pytest.approx(np.prod(np.ptp(handle.bounds, axis=0)), rel=1e-4)
    # Of boxes within boxes a click means the smallest.
    assert pick(Coordinates(page), np.array([4.0, 1.0, 0.5]), np.array([-1.0, 0.0, 0.0])) == "handle_9"


def test_the_card_says_what_a_part_is(room: PageRoom) -> None:
    text = cards.card(room, "drawer_7")
    assert all(word in text for word in ("drawer_7", "cabinet_3", "slides -10 to 400 mm", "12"))
    assert "21.1 kg" in cards.card(room, "cabinet_3")
    assert "drawer_7" in cards.card(room, "handle_9")  # what it moves with
    assert "Click" in cards.card(room, None)
    assert "<b>x</b>" not in cards.card(of_scene(Scene("s", {"a_1": Part("<b>x</b>", Mesh([], []))})), "a_1")


def test_a_file_that_is_no_room_is_refused(tmp_path: Path) -> None:
    stage = descriptive.new_stage()
    stage.Export(str(tmp_path / "other.usda"))
    with pytest.raises(InputError, match="cannot be shown"):
        read(tmp_path / "other.usda")


def test_a_simulation_ready_room_shows_bodies_hulls_and_static_parts(tmp_path: Path) -> None:
    path = write_cabinet(tmp_path / "sim.usd", free=[free_cube("cube_9", (0.2, 0.1, 0.822), 0.04, 0.1)])
    stage, page = sim_stage.read(path), read(path)
    assert set(page.joints) == set(stage.articulations) and page.carriers == dict.fromkeys(page.joints)
    assert {hull.mover for hull in page.colliders} == {None, *page.joints}
    assert len(page.colliders) == sum(map(len, _hulls(stage)))
    assert page.parts["cube_9"].mass == pytest.approx(0.1) and page.parts["cube_9"].motion == "free"
    hulls = [hull.mesh for hull in page.colliders if hull.part == "cube_9"]
    middle = np.mean([hull.bounds.mean(axis=0) for hull in hulls], axis=0)
    np.testing.assert_allclose(middle, (0.2, 0.1, 0.822), atol=1e-6)  # in the scene, not in its body's frame


def _hulls(stage: sim_stage.SimRoom) -> list[tuple[Collider, ...]]:
    return [body.colliders for body in (*stage.bodies.values(), *stage.free.values())] + [stage.static_colliders]


def test_static_faces_go_back_to_their_parts() -> None:
    floor, wall = usd_room.box((0, 0, 0), (4, 4, 0.1), seed=1), usd_room.box((0, 2, 1), (4, 0.1, 2), seed=2)
    both = merge([floor, wall])
    owners = np.repeat([1, 0], 12)
    room = SimRoom("two", {}, {}, both, (), static_parts=("wall_2", "floor_1"), static_face_part=owners)
    page = of_sim_room(room)
    assert page.parts["floor_1"].surface.bounds.tolist() == floor.bounds.tolist()
    assert page.parts["wall_2"].surface.bounds.tolist() == wall.bounds.tolist()
    assert page.parts["wall_2"].label == "wall"
    assert of_sim_room(SimRoom("one", {}, {}, both, ())).parts["static"].surface == both


def test_supports_are_what_looks_up_and_is_level_of_what_stands_still() -> None:
    slope = Mesh(np.array([(0.0, 0, 3), (1, 0, 3), (1, 1, 4), (0, 1, 4)]), np.array([(0, 1, 2), (0, 2, 3)]))
    joint = Joint("prismatic", (0.0, 1.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.3))
    shelf, speck = usd_room.box((0.0, 0.0, 1.0), (0.8, 0.4, 0.02)), usd_room.box((2.0, 0.0, 1.0), (0.02, 0.02, 0.02))
    parts = {"shelf_1": Part("shelf", shelf), "slope_2": Part("slope", slope), "speck_3": Part("speck", speck)}
    parts["drawer_4"] = Part("drawer", usd_room.box((0.0, 2.0, 1.0), (0.8, 0.4, 0.02)), "shelf_1", joint)
    (node,) = layers.supports(of_scene(Scene("room", parts)))
    assert node.mover is None and node.mesh.face_areas.sum() == pytest.approx(0.8 * 0.4, rel=0.02)
    np.testing.assert_allclose(node.mesh.vertices[:, 2], 1.01 + layers.LIFT, atol=layers.LIFT + 1e-6)


def test_reach_is_what_the_stretched_arm_comes_to_and_moves_with_its_part(tmp_path: Path) -> None:
    page = read(write_cabinet(tmp_path / "sim.usd"))
    (stand,) = page.stands
    assert stand.part == "drawer_2" and stand.free and stand.reach == 0.855
    away = np.array([stand.shoulder + [x, 0.0, 0.0] for x in (-0.85, 0.85, -0.86, 0.86)])
    np.testing.assert_array_equal(layers.within_reach(page, away), [True, True, False, False])
    nodes = {node.mover: node.mesh for node in layers.reach(page)}
    assert set(nodes) == {None, "drawer_2"}
    middle = nodes["drawer_2"].vertices[nodes["drawer_2"].faces].mean(axis=1)
    assert (np.linalg.norm(middle - stand.shoulder, axis=1) <= stand.reach + 4 * layers.LIFT).all()
    posts = nodes[None].vertices[(nodes[None].colors == layers.FREE_COLOR).all(axis=1)]
    np.testing.assert_allclose(
        (posts[:, 2].min(), posts[:, 2].max()), (stand.position[2], stand.shoulder[2]), atol=1e-6
    )


def test_a_scan_has_supports_and_no_reach_and_a_description_neither(room: PageRoom, tmp_path: Path) -> None:
    assert layers.SUPPORTS in panel.offered(room) and layers.REACH not in panel.offered(room)
    boxes = replace(room, boxes=True)
    assert not {layers.SUPPORTS, layers.REACH} & set(panel.offered(boxes))
