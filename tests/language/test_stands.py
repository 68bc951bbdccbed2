"""What stands by itself, what leans, and what is seen where it stands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from rough_furniture import at, block, sheet
from scipy.spatial.transform import Rotation

from s2a.core.config import compose, load
from s2a.language.insert.poses import PoseConfig, facing_first, places
from s2a.language.insert.serves import Fault, PlaceServes, front
from s2a.language.insert.stable_pose import has_stand, leans_forward, settled_axis, slender, tilt_margin
from s2a.language.insert.supports import target_regions
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.regions import RegionConfig
from s2a.scene.scene import Joint, Mesh, Part, Scene

VALUES = compose("insert/placement")["insert"]
REGIONS: RegionConfig = RegionConfig()
POSE: PoseConfig = load(PoseConfig, VALUES["pose"])
UP = np.array([0.0, 0.0, 1.0])
LAMP = merge([block(0.28, 0.28, 0.02), block(0.03, 0.03, 1.5), at(block(0.35, 0.35, 0.3), 0, 0, 1.3)])
BROOM = merge([block(0.05, 0.3, 0.05), block(0.03, 0.03, 1.4)])
BOARD = block(0.02, 0.3, 1.2)


@pytest.mark.parametrize(("thing", "stands"), [(LAMP, True), (BROOM, False), (BOARD, False)])
def test_a_lamp_has_a_stand_and_a_broom_leans(thing: Mesh, stands: bool) -> None:
    assert tilt_margin(thing, UP) < 0.11  # all are shaky
    assert has_stand(thing) == stands
    assert slender(thing) != stands


@pytest.mark.slow
def test_a_lamp_against_a_wall_stands_straight() -> None:
    flat = sheet((-1.5, 1.5), (0, 2.4), 0.0, 0.02)
    wall = Part("wall", Mesh(flat.vertices[:, [0, 2, 1]], flat.faces[:, ::-1]))
    scene = Scene("room", {"floor_1": Part("floor", sheet((-1.5, 1.5), (0, 3), 0.0)), "wall_2": wall})
    for thing, leans in ((LAMP, False), (BOARD, True)):
        region = target_regions(scene, "floor_1", REGIONS, ("horizontal",))[0]
        pose = next(places(scene, thing, region, "against", POSE, "floor_1", []))
        tilted = Rotation.from_quat(pose.quaternion).apply(UP)
        assert (tilted[2] < 0.99) == leans


def test_a_photo_frame_stands_on_its_strut_and_not_on_its_edge() -> None:
    def turned(mesh: Mesh, angle: float) -> Mesh:
        return Mesh(Rotation.from_euler("y", angle).apply(mesh.vertices), mesh.faces)

    # Its edge is 10 mm wide and 0.25 m high, so 2 deg firm; leaning by 12 deg on its strut it has a foot of 60 mm.
    frame = at(block(0.01, 0.16, 0.25), -0.005, 0, 0)
    back = at(block(0.004, 0.02, 0.15), -0.004, 0, 0)
    strut = at(turned(back, np.radians(18.0)), -0.06, 0, 0.012)
    photo = merge([frame, strut])
    up = settled_axis(photo, UP)
    assert tilt_margin(photo, up) >= 0.05
    assert np.degrees(np.arccos(up @ UP)) > 2.0
    assert settled_axis(block(0.1, 0.1, 0.1), UP) == pytest.approx(UP)
    # It leans back onto the strut, which is behind it, at -x: its picture looks along +x, whoever says what.
    assert not leans_forward(photo, up, across(up, 1.0))
    assert leans_forward(photo, up, across(up, -1.0))
    assert not any(leans_forward(block(0.01, 0.16, 0.25), UP, across(UP, way)) for way in (1.0, -1.0))
    round_rod = trimesh.creation.cylinder(0.02, 0.3)
    rod = turned(Mesh(round_rod.vertices, round_rod.faces), np.radians(15.0))
    assert not any(leans_forward(rod, UP, across(UP, way)) for way in (1.0, -1.0))


def across(up: np.ndarray, way: float) -> np.ndarray:
    """Return the unit direction nearest to +x, or with -1 to -x, across `up`."""
    x = np.array([way, 0.0, 0.0])
    x -= x @ up * up
    return x / np.linalg.norm(x)


def test_what_slides_back_does_not_drop_behind_its_support() -> None:
    flat = sheet((-1.0, 1.0), (0, 2.0), 0.0, 0.02)
    wall = Part("wall", Mesh(flat.vertices[:, [0, 2, 1]], flat.faces[:, ::-1]))
    chest = Part("chest", at(block(1.0, 0.4, 0.7), 0, 0.28, 0.0))  # 8 cm before the wall
    scene = Scene("room", {"wall_1": wall, "chest_2": chest, "floor_3": Part("floor", sheet((-1, 1), (0, 2), 0.0))})
    thing = block(0.06, 0.2, 0.25)
    region = target_regions(scene, "chest_2", REGIONS, ("horizontal",))[0]
    for pose in places(scene, thing, region, "against", POSE, "chest_2", []):
        assert pose.position[2] == pytest.approx(0.7, abs=0.006)


def room_with_screen() -> Scene:
    """A desk with a screen 0.5 m high and 0.6 m wide in its middle, seen from +y."""
    return Scene("room", {
        "floor_1": Part("floor", sheet((-2, 2), (-0.4, 4), 0.0, 0.03)),
        "desk_2": Part("desk", sheet((-0.8, 0.8), (-0.4, 0.4), 0.74)),
        "screen_3": Part("screen", at(block(0.6, 0.04, 0.5), 0, 0.0, 0.742)),
    })  # fmt: skip


def test_what_is_behind_a_screen_is_hidden_and_what_is_beside_it_is_seen() -> None:
    scene = room_with_screen()
    region = target_regions(scene, "desk_2", REGIONS, ("horizontal",))[0]
    serves, cup = PlaceServes(scene, region, "desk_2"), block(0.08, 0.08, 0.1)
    assert serves.fault(at(cup, 0.0, -0.1, 0.742)) is Fault.MOSTLY
    assert serves.fault(at(block(0.3, 0.08, 0.1), 0.4, -0.1, 0.742)) is Fault.PARTLY
    assert serves.fault(at(cup, 0.0, 0.2, 0.742)) is Fault.NONE
    assert serves.fault(at(cup, 0.6, -0.1, 0.742)) is Fault.NONE


def test_what_hides_a_vase_is_faulty_and_what_stands_beside_or_behind_it_is_not() -> None:
    vase, screen = at(block(0.1, 0.1, 0.25), 0.0, -0.05, 0.742), block(0.6, 0.05, 0.4)
    parts = {i: part for i, part in room_with_screen().parts.items() if i != "screen_3"} | {
        "vase_3": Part("vase", vase)
    }
    scene = Scene("room", parts)
    region = target_regions(scene, "desk_2", REGIONS, ("horizontal",))[0]
    serves = PlaceServes(scene, region, "desk_2")
    assert serves.fault(at(screen, 0.0, 0.2, 0.742)) is Fault.PARTLY
    assert serves.fault(at(screen, 0.45, 0.2, 0.742)) is Fault.NONE
    assert serves.fault(at(screen, 0.0, -0.3, 0.742)) is Fault.NONE


def bathroom() -> Scene:
    """A toilet with its back at a wall at x = -1; the side at y = -0.2 is 4 cm off another wall; it is used from +x."""
    bowl = merge([at(block(0.4, 0.38, 0.4), -0.55, 0, 0), at(block(0.25, 0.38, 0.8), -0.86, 0, 0)])
    walls = [at(block(0.1, 4.0, 2.4), -1.06, 1.5, 0.0), at(block(4.0, 0.1, 2.4), 1.0, -0.28, 0.0)]
    floor = sheet((-1, 1), (-0.2, 2.5), 0.0, 0.02)
    return Scene("room", {
        "floor_1": Part("floor", floor), "toilet_2": Part("toilet", bowl),
        "wall_3": Part("wall", walls[0]), "wall_4": Part("wall", walls[1]),
    })  # fmt: skip


def test_a_toilet_faces_away_from_the_wall_behind_it_though_one_is_beside_it() -> None:
    scene = bathroom()
    assert front(scene, "toilet_2") == pytest.approx([1.0, 0.0], abs=1e-6)


@pytest.mark.parametrize("yaw", [0.0, 0.6, 2.5])
def test_a_chair_in_the_open_faces_away_from_its_back_and_a_chest_to_where_its_drawer_slides(yaw: float) -> None:
    chair = merge([at(block(0.45, 0.45, 0.45), 0, 0, 0), at(block(0.06, 0.45, 0.9), -0.2, 0, 0)])
    chest, panel = block(0.4, 0.8, 0.7), at(block(0.02, 0.8, 0.2), 0.21, 0, 0.3)
    turn = Rotation.from_euler("z", yaw)

    def turned(mesh: Mesh) -> Mesh:
        return Mesh(turn.apply(mesh.vertices) + [1.0, 0.5, 0.0], mesh.faces)

    axis = tuple(turn.apply([1.0, 0.0, 0.0]).tolist())
    slides = Joint("prismatic", axis, (1.0, 0.5, 0.4), (0.0, 0.3))
    # The middle of the room lies behind both.
    beyond = at(block(0.5, 0.5, 0.5), *(np.array([1.0, 0.5]) - 4.0 * np.array(axis[:2])), 0.0)
    for parts in (
        {"thing_1": Part("chair", turned(chair))},
        {
            "thing_1": Part("chest", turned(chest)),
            "drawer_2": Part("drawer", turned(panel), parent="thing_1", motion=slides),
        },
    ):
        scene = Scene("room", parts | {"box_3": Part("box", beyond)})
        assert front(scene, "thing_1") == pytest.approx(axis[:2], abs=1e-5)


def test_nothing_but_a_mat_stands_before_a_toilet() -> None:
    scene = bathroom()
    region = target_regions(scene, "floor_1", REGIONS, ("horizontal",))[0]
    serves, basket, mat = PlaceServes(scene, region, "floor_1"), block(0.35, 0.35, 0.5), block(0.4, 0.4, 0.02)
    assert serves.fault(at(basket, -0.1, 0.0, 0.0)) is Fault.MOSTLY
    assert serves.fault(at(mat, -0.1, 0.0, 0.0)) is Fault.NONE
    assert serves.fault(at(basket, -0.1, 0.9, 0.0)) is Fault.NONE
    assert serves.fault(at(basket, -0.75, 0.6, 0.0)) is Fault.NONE  # beside it


def test_hidden_places_come_after_seen_ones() -> None:
    scene = room_with_screen()
    region = target_regions(scene, "desk_2", REGIONS, ("horizontal",))[0]
    serves, cup = PlaceServes(scene, region, "desk_2"), block(0.08, 0.08, 0.1)

    def behind(points: np.ndarray) -> np.ndarray:
        return (np.abs(points[:, 0]) < 0.25) & (points[:, 1] < -0.05)

    found = [serves.fault(pose.moved(cup)) for pose in places(scene, cup, region, "on", POSE, "desk_2", [])]
    assert found == sorted(found)
    only = list(places(scene, cup, region, "on", POSE, "desk_2", [], keep=behind))
    assert only  # where there is no other place, a hidden one is offered


@pytest.mark.parametrize(
    ("sides", "anyhow", "most"),
    [((0.1, 0.1), False, [45, 180]), ((0.4, 0.3), False, [10]), ((0.4, 0.3), True, [10, 180])],
)
def test_large_things_stand_squarely(sides: tuple[float, float], anyhow: bool, most: list[float]) -> None:
    found = facing_first(block(*sides, 0.2), POSE, anyhow)
    assert [max(abs(turn) for turn in one.search.turns) for one in found] == most
    paper = replace(POSE, pose="paper")
    assert facing_first(block(*sides, 0.2), paper, anyhow) == (paper,)
