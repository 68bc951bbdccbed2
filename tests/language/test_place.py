"""Where objects land: free, carried, turned the right way, and no drawer blocked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rough_furniture import at, block, sheet, sink, table
from scipy.spatial.transform import Rotation

from s2a.core.config import compose, load
from s2a.core.errors import InputError
from s2a.language.insert.describe import RoomState
from s2a.language.insert.fit import NoRoom, Pose, reaching_into, swept_volumes
from s2a.language.insert.plan import Choice, Plan
from s2a.language.insert.poses import PoseConfig, Relation, candidate_poses, places
from s2a.language.insert.supports import SurfaceConfig, nearby, place_paper, target_plane, target_regions
from s2a.scene.geometry.convex import box
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.mesh_query import crossing, depth, inside
from s2a.scene.geometry.planes import RansacConfig
from s2a.scene.geometry.regions import Kind, RegionConfig
from s2a.scene.scene import Joint, Mesh, Part, Scene

VALUES = compose("insert/placement")["insert"]
REGIONS: RegionConfig = RegionConfig()
POSE: PoseConfig = load(PoseConfig, VALUES["pose"])


def put(
    scene: Scene, thing: Mesh, target: str, relation: Relation = "on", kind: Kind = "horizontal", near=None
) -> Pose:
    region = target_regions(scene, target, REGIONS, (kind,))[0]
    return next(places(scene, thing, region, relation, POSE, target, swept_volumes(scene), near))


def check(scene: Scene, thing: Mesh, pose: Pose) -> None:
    """Assert that a thing at a pose cuts nothing, is in nothing, and is carried."""
    moved = pose.moved(thing)
    around = nearby(scene, *(moved.bounds + [[-0.05], [0.05]]))
    assert crossing(moved, around) is None
    assert depth(moved, around) < 0.001
    assert not any(inside(part.mesh, moved.vertices).any() for part in scene.parts.values() if len(part.mesh.faces))


def test_a_cup_stands_free_on_the_table() -> None:
    cup = block(0.08, 0.08, 0.1)
    pose = put(table(), cup, "table_2")
    check(table(), cup, pose)
    assert pose.position[2] == pytest.approx(0.742, abs=0.004)
    # The table leaves 0.8 m beside the crate: 0.3 m to all sides, 0.26 m without the cup.
    assert pose.clearance > 0.11


def test_what_is_too_large_for_the_free_part_finds_no_room() -> None:
    with pytest.raises(NoRoom, match=r"0\.90 x 0\.50 x 0\.10 m finds no place on a horizontal region"):
        put(table(), block(0.9, 0.5, 0.1), "table_2")


def test_a_wished_neighbour_draws_an_object_near() -> None:
    cup = block(0.08, 0.08, 0.1)
    away, near = put(table(), cup, "table_2"), put(table(), cup, "table_2", near="crate_3")
    check(table(), cup, near)
    assert near.position[0] < away.position[0]
    # The crate ends at x = 0.4; room beyond what is enough would not make the place better.
    assert near.moved(cup).bounds[0, 0] - 0.4 < POSE.search.max_useful_clearance + 2 * REGIONS.cell


def test_the_same_question_has_the_same_answer() -> None:
    cup = block(0.08, 0.08, 0.1)
    assert put(table(), cup, "table_2") == put(table(), cup, "table_2")


def test_a_closed_box_is_no_place_although_none_of_its_triangles_is_cut() -> None:
    big = at(block(0.4, 0.4, 0.4), 0.7, 0.3, 0.74)
    cup = at(block(0.05, 0.05, 0.05), 0.7, 0.3, 0.9)
    assert crossing(cup, big) is None
    assert inside(big, cup.vertices).all()


def test_a_soap_goes_into_the_basin_and_not_onto_the_rim() -> None:
    scene = Scene("bathroom", {"sink_1": Part("sink", sink())})
    basin = min(target_regions(scene, "sink_1", REGIONS, ("horizontal",)), key=lambda region: region.height)
    soap = block(0.09, 0.06, 0.03)
    pose = next(places(scene, soap, basin, "in", POSE, "sink_1", []))
    check(scene, soap, pose)
    assert pose.position[2] == pytest.approx(0.703, abs=0.004)
    assert np.abs(pose.moved(soap).vertices[:, :2]).max() < 0.2


def cabinet() -> Scene:
    """A cabinet front at y = 0 whose drawer slides out 0.4 m over the floor, x from 0 to 0.6; the floor ends at x = 0.9."""
    front = box(np.array([0.3, 0.01, 0.2]), np.eye(3), np.array([0.6, 0.02, 0.3]))
    drawer = Part("drawer", front, "cabinet_2", Joint("prismatic", (0.0, -1.0, 0.0), (0.3, 0.0, 0.2), (0.0, 0.4)))
    body = at(block(0.6, 0.5, 0.4), 0.3, 0.28, 0.0)
    floor = Part("floor", sheet((0.0, 0.9), (-0.5, 0.0), 0.0))
    return Scene("room", {"floor_1": floor, "cabinet_2": Part("cabinet", body), "drawer_3": drawer})


def test_nothing_is_put_where_a_drawer_slides() -> None:
    scene, bin_ = cabinet(), block(0.2, 0.2, 0.3)
    pose = put(scene, bin_, "floor_1", near="drawer_3")
    check(scene, bin_, pose)
    still = Scene("room", {i: replace(part, motion="fixed") for i, part in scene.parts.items()})
    blind = put(still, bin_, "floor_1", near="drawer_3")
    low, high = np.array([-1.0, -1.0, 0.0]), np.array([2.0, 1.0, 1.0])
    volumes = [volume.hull for volume in reaching_into(swept_volumes(scene), low, high, scene)]
    assert not any(inside(volume, pose.moved(bin_).vertices).any() for volume in volumes)
    assert pose.moved(bin_).bounds[0, 0] > 0.59
    # If it did not open, the nearest place would be right before it.
    assert blind.moved(bin_).bounds[0, 0] < 0.59


def test_what_a_drawer_carries_is_not_in_its_way() -> None:
    scene = cabinet()
    low, high = np.array([-1.0, -1.0, 0.0]), np.array([2.0, 1.0, 1.0])
    assert {volume.part for volume in reaching_into(swept_volumes(scene), low, high, scene)} == {"drawer_3"}
    assert reaching_into(swept_volumes(scene), low, high, scene, carrier="drawer_3") == []


def corner() -> Scene:
    """A floor with a wall at y = 0 that looks along +y."""
    flat = sheet((-1, 1), (0, 2.0), 0.0, 0.02)
    wall = Mesh(flat.vertices[:, [0, 2, 1]] * [1, 1, 1], flat.faces[:, ::-1])
    return Scene("room", {"floor_1": Part("floor", sheet((-1, 1), (0, 2), 0.0)), "wall_2": Part("wall", wall)})


def test_a_cupboard_against_a_wall_turns_its_back_to_it() -> None:
    cupboard = block(0.3, 0.6, 1.0)
    pose = put(corner(), cupboard, "floor_1", "against")
    check(corner(), cupboard, pose)
    assert np.degrees(pose.yaw) == pytest.approx(90.0, abs=2.0)
    assert pose.moved(cupboard).bounds[0, 1] == pytest.approx(0.008, abs=0.008)


def test_a_picture_hangs_upright_and_looks_into_the_room() -> None:
    picture = block(0.02, 0.5, 0.4)
    pose = put(corner(), picture, "wall_2", "hanging", "vertical")
    check(corner(), picture, pose)
    assert np.degrees(pose.yaw) == pytest.approx(90.0, abs=1.0)
    assert pose.moved(picture).bounds[0, 1] < 0.008
    with pytest.raises(InputError, match="only hanging goes with vertical"):
        put(corner(), picture, "wall_2", "on", "vertical")


def test_a_book_goes_into_the_shelf_compartment_that_is_high_enough() -> None:
    boards = [box(np.array([0, 0, z - 0.01]), np.eye(3), np.array([0.8, 0.3, 0.02])) for z in (0.1, 0.5, 0.7)]
    scene = Scene("room", {"shelf_1": Part("shelf", merge(boards))})
    low, high = sorted(target_regions(scene, "shelf_1", REGIONS, ("inside",)), key=lambda region: region.height)
    book = block(0.15, 0.03, 0.25)
    check(scene, book, next(places(scene, book, low, "in", POSE, "shelf_1", [])))
    with pytest.raises(NoRoom):
        next(places(scene, book, high, "in", POSE, "shelf_1", []))


def test_the_papers_rule_shifts_until_nothing_is_cut() -> None:
    cup = block(0.08, 0.08, 0.1)
    plane, inliers = target_plane(table(), "table_2", False, RansacConfig())
    pose = place_paper(table(), cup, plane, inliers, POSE.paper)
    around = table().parts["table_2"].mesh
    assert crossing(pose.moved(cup), around) is None
    assert pose.quaternion == (0.0, 0.0, 0.0, 1.0)


def counter(wall: bool) -> Scene:
    """A counter 2 m long and 0.6 m deep whose wall, if there is one, rises at y = 0.6 and looks along -y."""
    flat = sheet((-1, 3), (0, 2.0), 0.0, 0.02)
    back = Mesh(flat.vertices[:, [0, 2, 1]] + [0, 0.61, 0], flat.faces)
    parts = {
        "floor_1": Part("floor", sheet((-1, 3), (-3, 0.6), 0.0)),
        "counter_2": Part("counter", sheet((0, 2), (0, 0.6), 0.9)),
    }
    return Scene("room", parts | ({"wall_3": Part("wall", back)} if wall else {}))


def test_things_go_to_the_back_of_a_counter_and_not_to_its_middle() -> None:
    cup = block(0.08, 0.08, 0.1)
    back, middle = (put(counter(wall), cup, "counter_2") for wall in (True, False))
    check(counter(True), cup, back)
    assert back.moved(cup).bounds[1, 1] > 0.5
    assert middle.moved(cup).bounds[1, 1] < 0.48  # 0.12 m from the border, where no wall is


def test_nothing_reaches_over_the_edge() -> None:
    foot = at(block(0.06, 0.06, 0.02), 0.0, 0.0, 0.0)
    bowl = merge([foot, at(block(0.3, 0.3, 0.1), 0.0, 0.0, 0.02)])
    for near in (None, "floor_1"):  # which lies beyond the border, and draws it there
        low, high = put(counter(False), bowl, "counter_2", near=near).moved(bowl).bounds
        over = np.prod(np.clip(np.minimum(high, (2, 0.6, 9)) - np.maximum(low, (0, 0, 0)), 0, None)[:2]) / 0.09
        assert over > 0.85


def gallery(*more: tuple[str, Part]) -> Scene:
    """A wall at y = 0, 3 m long and 2.4 m high, that looks along +y, and a floor before it."""
    flat = sheet((-1.5, 1.5), (0, 2.4), 0.0, 0.02)
    wall = Part("wall", Mesh(flat.vertices[:, [0, 2, 1]] * [1, 1, 1], flat.faces[:, ::-1]))
    return Scene("room", {"floor_1": Part("floor", sheet((-1.5, 1.5), (0, 3), 0.0)), "wall_2": wall, **dict(more)})


def hung(scene: Scene, near: str | None = None) -> np.ndarray:
    """Return the box around a clock of 0.3 m that hangs on the wall [m]."""
    clock = block(0.03, 0.3, 0.3)
    return np.asarray(put(scene, clock, "wall_2", "hanging", "vertical", near).moved(clock).bounds)


def test_what_hangs_is_at_eye_level_wherever_its_neighbour_is() -> None:
    sofa = "sofa_3", Part("sofa", at(block(1.6, 0.8, 0.8), 0.6, 1.6, 0.0))  # in the middle of the room
    for near in (None, "floor_1", "sofa_3"):
        box = hung(gallery(sofa), near)
        assert 1.44 <= box[:, 2].mean() <= 1.61
    assert hung(gallery(sofa), "sofa_3")[:, 0].mean() == pytest.approx(0.6, abs=0.15)


def test_a_low_front_is_hung_on_and_a_height_is_no_middle_of_a_bare_wall() -> None:
    flat = sheet((-0.4, 0.4), (0, 0.9), 0.0, 0.02)
    front = Part("oven", Mesh(flat.vertices[:, [0, 2, 1]] * [1, 1, 1] + [0, 2, 0], flat.faces[:, ::-1]))
    bare = replace(gallery().parts["wall_2"], label="unannotated")
    surface = SurfaceConfig("regions")
    scene = gallery(("oven_3", front), ("wall_2", bare))
    for target, height in (("oven_3", None), ("wall_2", 1.5), ("wall_2", None)):
        plan = Plan("+z", "+x", None, (Choice(target, "vertical", "hanging", height, "there"),), ())
        made = candidate_poses(RoomState(scene, "", surface), block(0.03, 0.3, 0.3), plan, surface, POSE, [])
        assert next(made).target == target


def test_what_hangs_is_above_what_stands_there_and_not_behind_it() -> None:
    tall = "wardrobe_3", Part("wardrobe", at(block(1.0, 0.5, 1.55), 0.7, 0.35, 0.0))
    assert hung(gallery(tall))[1, 0] < 0.25  # beside it
    above = hung(gallery(tall), "wardrobe_3")
    assert above[0, 2] > 1.6
    assert 0.2 < above[:, 0].mean() < 1.2


def test_a_clock_hangs_at_the_height_of_the_pictures() -> None:
    picture = "picture_3", Part("picture", at(block(0.4, 0.02, 0.3), -0.8, 0.015, 1.25))
    assert hung(gallery(picture))[:, 2].mean() == pytest.approx(1.4, abs=0.06)


def guitar() -> Mesh:
    """What stands on a foot 4 cm deep and is 1 m high: it would fall at a touch."""
    return at(block(0.04, 0.3, 1.0), 0.0, 0.0, 0.0)


def test_what_would_fall_over_leans_at_the_wall() -> None:
    pose = put(corner(), guitar(), "floor_1", "against")
    moved = pose.moved(guitar())
    check(corner(), guitar(), pose)
    up = Rotation.from_quat(pose.quaternion).apply([0.0, 0.0, 1.0])
    assert np.degrees(np.arccos(up[2])) == pytest.approx(10.0, abs=1.0)
    assert moved.bounds[0, 1] < POSE.back_gap + 0.005  # the bumps of the scan
    assert moved.vertices[moved.vertices[:, 2] > 0.9, 1].mean() < moved.vertices[moved.vertices[:, 2] < 0.1, 1].mean()


@pytest.mark.slow
def test_what_is_against_something_has_something_behind_it() -> None:
    open_floor = Scene("room", {"floor_1": corner().parts["floor_1"]})
    with pytest.raises(NoRoom, match="nothing behind them"):
        put(open_floor, block(0.3, 0.6, 1.0), "floor_1", "against")


def test_other_places_on_a_support_are_offered() -> None:
    region = target_regions(table(), "table_2", REGIONS, ("horizontal",))[0]
    cup = block(0.08, 0.08, 0.1)
    found = [pose.position for pose in places(table(), cup, region, "on", POSE, "table_2", [])]
    assert 5 <= len(found) <= POSE.alternatives
    apart = np.linalg.norm(np.array(found)[:, None] - np.array(found), axis=-1) + np.eye(len(found))
    assert apart.min() > 0.018
