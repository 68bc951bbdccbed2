"""Every class of wrong annotation in a room of flat sheets, with numbers derived by hand; a right one raises no alarm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from box_room import bar, bounds, changed, door, joined, moved, room, sheet

from s2a.core.check import Check
from s2a.scan.evidence import annotation
from s2a.scan.evidence import joint as hinge
from s2a.scan.evidence import joint as opening
from s2a.scan.evidence.front import front
from s2a.scan.evidence.joint import depth_behind
from s2a.scan.evidence.surface import ScanSurface, sweep
from s2a.scan.formats.articulate3d import Overlap
from s2a.scene.scene import Joint, Mesh, Part, Scene

BOUNDS = bounds()
Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])


def findings(scene: Scene, part: str = "") -> dict[str, Check]:
    """Check a scene; return what is found of one part, or of the room, by check."""
    return {f.name: f for f in annotation.check(scene, BOUNDS) if f.part == part}


def doubted(scene: Scene) -> set[tuple[str, str]]:
    return {(f.part, f.name) for f in annotation.check(scene, BOUNDS) if f.status in ("warn", "fail")}


def test_a_right_annotation_raises_no_alarm_and_every_question_is_answered() -> None:
    found = annotation.check(room(), BOUNDS)
    assert [str(f) for f in found if f.status != "pass"] == []
    assert {f.name for f in found} >= {
        "opens_outward",
        "slide_axis",
        "hinge_edge",
        "swept_path",
        "up_axis",
        "scan_units",
    }


def test_the_front_of_a_drawer_is_the_side_seen_from_the_room_whatever_the_order_of_its_corners() -> None:
    scene = room()
    mesh = scene.parts["drawer_6"].mesh
    flipped = replace(scene.parts["drawer_6"], mesh=Mesh(mesh.vertices, mesh.faces[:, ::-1]))
    for given in (scene, Scene("flipped", {**scene.parts, "drawer_6": flipped})):
        found = front(ScanSurface(given), "drawer_6")
        assert found is not None
        assert found.normal == pytest.approx([1, 0, 0], abs=1e-6)
        assert found.center == pytest.approx([0.52, 1.25, 0.5], abs=1e-6)
        assert sorted(found.size) == pytest.approx([0.46, 0.96], abs=1e-6)
        assert found.seen > 0.9
        # Area-weighted mean height of the bar's five sides: face 0.2 x 0.02 at 40 mm, four rims of depth 30 mm at 25 mm.
        rims = 2 * 0.03 * (0.2 + 0.02)
        assert found.relief == pytest.approx((0.004 * 0.04 + rims * 0.025) / (0.004 + rims), abs=1e-6)


def test_a_reversed_slide_and_a_reversed_hinge_open_into_the_furniture() -> None:
    slide = findings(changed(room(), "drawer_6", axis=(-1, 0, 0)), "drawer_6")["opens_outward"]
    assert (slide.status, slide.value) == ("fail", pytest.approx(-1.0))
    turned = findings(changed(room(), "door_8", axis=(0, 0, -1)), "door_8")["opens_outward"]
    assert (turned.status, turned.value) == ("fail", pytest.approx(-1.0))
    assert "negate the axis" in turned.remedy
    # The same opening written with a negative range is right.
    mirrored = changed(room(), "drawer_6", axis=(-1, 0, 0), limits=(-0.4, 0.0))
    assert findings(mirrored, "drawer_6")["opens_outward"].status == "pass"


def test_a_part_scanned_ajar_moves_both_ways() -> None:
    scene = changed(room(), "door_8", axis=(0, 0, -1), limits=(-0.9, 0.6))
    assert findings(scene, "door_8")["opens_outward"].status == "skipped"


@pytest.mark.parametrize("towards", [(0, 1, 0), (0, 0, 1), (0, -1, 1)])
def test_an_axis_tilted_by_fifteen_degrees_is_named_with_its_angle(towards: tuple[float, float, float]) -> None:
    aside = np.array(towards) / np.linalg.norm(towards)
    axis = np.cos(np.radians(15)) * np.array([1.0, 0, 0]) + np.sin(np.radians(15)) * aside
    found = findings(changed(room(), "drawer_6", axis=tuple(axis)), "drawer_6")["slide_axis"]
    assert (found.status, found.value) == ("fail", pytest.approx(15.0, abs=0.1))
    axis = np.cos(np.radians(15)) * np.array([0, 0, 1.0]) + np.sin(np.radians(15)) * np.array([1.0, 0, 0])
    found = findings(changed(room(), "door_8", axis=tuple(axis)), "door_8")["hinge_parallel"]
    assert (found.status, found.value) == ("fail", pytest.approx(15.0, abs=0.1))


def test_a_hinge_off_its_part_is_named_with_its_distance() -> None:
    scene = changed(room(), "door_8", origin=(0.52, 2.48, 0.5))
    found = findings(scene, "door_8")["hinge_edge"]
    assert (found.status, found.value) == ("fail", pytest.approx(0.5, abs=2e-3))
    # In the middle of the leaf: 0.23 m from both edges. Along the axis a hinge may lie anywhere.
    surface = ScanSurface(room())
    leaf, points = front(surface, "door_8"), surface.scene.parts["door_8"].mesh.vertices
    assert leaf is not None
    assert hinge.edge_distance(door(1.75), leaf, points) == pytest.approx((0.23, 0.46), abs=2e-3)
    up = replace(door(1.98), origin=(0.52, 1.98, 9.0))
    assert hinge.edge_distance(up, leaf, points)[0] == pytest.approx(0.0, abs=2e-3)
    before = replace(door(1.98), origin=(0.82, 1.98, 0.5))
    assert hinge.edge_distance(before, leaf, points)[0] == pytest.approx(0.3, abs=2e-3)


def test_a_hinge_at_the_handles_edge_is_doubtful_even_if_it_opens_outward() -> None:
    scene = changed(room(), "door_8", origin=(0.52, 1.52, 0.5), axis=(0, 0, -1))
    found = findings(scene, "door_8")
    assert found["opens_outward"].status == "pass" and found["hinge_edge"].status == "pass"
    # The bar's mean lies at y 1.56: 40 mm from the hinge, of 460 mm.
    assert (found["hinge_handle"].status, found["hinge_handle"].value) == (
        "warn",
        pytest.approx(0.04 / 0.46, abs=2e-3),
    )


def test_the_wrong_kind_is_named_by_name_and_by_handle() -> None:
    pulled = changed(room(), "door_8", kind="prismatic", axis=(1, 0, 0), limits=(0.0, 0.3))
    found = findings(pulled, "door_8")
    assert {check for check, f in found.items() if f.status == "warn"} == {"kind", "slide_handle"}
    # The bar lies at y 1.56, the leaf's middle at 1.75, and it is 0.46 m wide.
    assert found["slide_handle"].value == pytest.approx(0.19 / 0.46, abs=2e-3)
    turned = changed(room(), "drawer_6", kind="revolute", axis=(0, 0, 1), origin=(0.52, 1.48, 0.5))
    assert {check for check, f in findings(turned, "drawer_6").items() if f.status == "warn"} == {
        "kind",
        "hinge_handle",
    }


def test_a_doubled_travel_exceeds_the_depth_of_the_furniture() -> None:
    surface = ScanSurface(room())
    face = front(surface, "drawer_6")
    assert face is not None
    assert depth_behind(surface, "drawer_6", face) == pytest.approx(0.52, abs=1e-3)
    found = findings(changed(room(), "drawer_6", limits=(0.0, 0.8)), "drawer_6")["slide_travel"]
    assert (found.status, found.bound) == ("warn", pytest.approx(0.55, abs=1e-3))
    wide = findings(changed(room(), "door_8", limits=(0.0, 3.0)), "door_8")["hinge_range"]
    assert wide.status == "warn" and wide.value == 3.0


def test_a_mesh_wound_the_other_way_tells_the_same() -> None:
    parts = {i: p for i, p in room().parts.items() if p.label != "handle"}
    parts["floor_1"] = replace(parts["floor_1"], label="rest")
    other = {i: replace(p, mesh=Mesh(p.mesh.vertices, p.mesh.faces[:, ::-1])) for i, p in parts.items()}
    said = [[(f.name, f.status) for f in annotation.check(Scene("", given), BOUNDS)] for given in (parts, other)]
    assert said[0] == said[1] and {verdict for _, verdict in said[1]} == {"pass"}


def test_free_space_behind_furniture_ends_it_before_the_wall_does() -> None:
    shift, scene = np.array([1.0, 0.0, 0.0]), room()
    own = ("cabinet_5", "drawer_6", "handle_7", "door_8", "handle_9")
    back = sheet((0, 1, 0), (0, 0, 1), (0, 1, 0))
    closed = replace(scene.parts["cabinet_5"], mesh=joined(scene.parts["cabinet_5"].mesh, back))
    parts = {**scene.parts, "cabinet_5": closed}
    island = {i: replace(p, mesh=Mesh(p.mesh.vertices + shift, p.mesh.faces)) for i, p in parts.items() if i in own}
    surface = ScanSurface(Scene("island", {**parts, **island}))
    face = front(surface, "drawer_6")
    assert face is not None and depth_behind(surface, "drawer_6", face) == pytest.approx(0.52, abs=1e-3)


def test_a_path_through_the_untrimmed_scan_says_what_is_in_the_way_and_from_where() -> None:
    scene = room()
    chest = Part("chest", sheet((0.82, 0.5, 0), (0, 0, 1), (0, 1.0, 0)))
    found = sweep(ScanSurface(Scene("blocked", {**scene.parts, "chest_10": chest})), "drawer_6", 0.1)
    # The chest's side stands 0.3 m before the front, and steps of the path are 0.4 / 24 m.
    assert found.blocked == pytest.approx(1.0) and found.free == pytest.approx(0.3, abs=0.4 / 24 + 1e-6)
    assert found.obstacles[0][0] == "chest_10"
    assert sweep(ScanSurface(scene), "drawer_6", 0.1).blocked == 0.0


def test_a_sheet_alongside_the_path_is_no_obstacle() -> None:
    scene = room()
    beside = Part("shelf", sheet((0.53, 1.2, 0.2), (1, 0.02, 0), (0, 0, 0.6)))
    assert sweep(ScanSurface(Scene("beside", {**scene.parts, "shelf_10": beside})), "drawer_6", 0.1).blocked < 0.1


def test_up_is_told_by_the_labelled_floor_and_without_one_by_what_is_level() -> None:
    assert findings(moved(room(), Y_UP))["up_axis"].value == pytest.approx(90.0, abs=0.5)
    over = findings(moved(room(), np.diag([1, -1, -1])))["up_axis"]
    assert (over.status, over.value) == ("fail", pytest.approx(180.0, abs=0.5))
    unlabelled = replace(room().parts["floor_1"], label="rest")
    scene = Scene("unlabelled", {**room().parts, "floor_1": unlabelled})
    assert {f.status for f in findings(scene).values()} == {"pass"}
    # Between floor and ceiling lie 1.5 m2 of table and cabinet top, and 0.01 m2 of undersides of handles.
    over = findings(moved(scene, np.diag([1, -1, -1])))
    assert over["up_side"].status == "fail" and over["up_side"].value < -0.95
    # Floor and ceiling are 24 m2, the walls along y 20 and along x 15.
    assert findings(moved(scene, np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])))["up_axis"].status == "warn"


@pytest.mark.parametrize(("unit", "factor"), [("feet", 1 / 0.3048), ("cm", 100.0), ("km", 0.001)])
def test_a_scan_in_another_unit_is_named(unit: str, factor: float) -> None:
    found = findings(moved(room(), factor * np.eye(3)))["scan_units"]
    assert found.status == "fail" and found.value == pytest.approx(2.5 * factor, rel=1e-3)


def test_a_high_hall_is_doubtful_and_a_room_without_handles_in_feet_is_wrong() -> None:
    parts = {}
    for name, part in room().parts.items():
        points = part.mesh.vertices.copy()
        points[points[:, 2] > 2.49, 2] = 8.0
        parts[name] = replace(part, mesh=Mesh(points, part.mesh.faces))
    hall = findings(Scene("hall", parts))["scan_units"]
    assert (hall.status, hall.value) == ("warn", pytest.approx(8.0, abs=1e-3))
    # Without handles, the room's height and the table at 0.7 / 0.3048 = 2.3 m tell.
    bare = Scene("bare", {name: part for name, part in room().parts.items() if part.label != "handle"})
    assert findings(bare)["scan_units"].status == "pass"
    assert findings(moved(bare, np.eye(3) / 0.3048))["scan_units"].status == "fail"


@pytest.mark.parametrize("normal", [(1.0, 0.0, 0.0), (0.98, 0.0, 0.199)])
def test_a_round_door_hangs_plumb_or_level_and_a_round_lid_any_way(normal: tuple[float, float, float]) -> None:
    leaf = front(ScanSurface(room()), "door_8")
    assert leaf is not None
    out = np.array(normal) / np.linalg.norm(normal)
    disc = replace(leaf, normal=out, fill=np.pi / 4)
    up = np.cross(out, [0.0, 1.0, 0.0])
    for angle in (0.0, 15.0, 40.0, 75.0, 90.0):
        axis = np.cos(np.radians(angle)) * up + np.sin(np.radians(angle)) * np.array([0.0, 1.0, 0.0])
        assert opening.edge_angle(axis, disc) == pytest.approx(min(angle, 90.0 - angle), abs=1e-4)
    lid = replace(disc, normal=np.array([0.0, 0.0, 1.0]))
    assert opening.edge_angle(np.array([0.8, 0.6, 0.0]), lid) == pytest.approx(0.0, abs=1e-6)
    assert opening.edge_angle(np.array([0.8, 0.0, 0.6]), lid) == pytest.approx(np.degrees(np.arcsin(0.6)))


def test_a_ring_shaped_region_has_its_grasp_point_in_the_air() -> None:
    scene = room()
    ring = joined(*(bar(y, z, (0.53, 0.56)) for y, z in RIM))
    parts = {**scene.parts, "handle_7": replace(scene.parts["handle_7"], mesh=ring)}
    # The mean of a square rim of 0.2 m, 20 mm wide, lies 80 mm from its inner sides.
    assert annotation.grasp_gap(Scene("ring", parts), "drawer_6") == pytest.approx(0.08, abs=1e-3)
    assert ("drawer_6", "grasp_on_region") in doubted(Scene("ring", parts))


def test_one_of_two_handles_is_grasped_and_no_point_between_them() -> None:
    scene = room()
    second = replace(scene.parts["handle_7"], mesh=bar((1.40, 1.45), (0.5, 0.52), (0.53, 0.56)))
    two = Scene("two", {**scene.parts, "handle_10": second})
    assert annotation.grasp_gap(two, "drawer_6") == annotation.grasp_gap(scene, "drawer_6")
    assert ("drawer_6", "grasp_on_region") not in doubted(two)


RIM = [
    ((1.15, 1.35), (0.4, 0.42)),
    ((1.15, 1.35), (0.58, 0.6)),
    ((1.15, 1.17), (0.42, 0.58)),
    ((1.33, 1.35), (0.42, 0.58)),
]


def test_a_handle_in_the_colours_alone_has_no_relief_and_a_recess_has() -> None:
    scene = room()
    for depth, flat in ((0.0, True), (-0.02, False)):
        printed = replace(
            scene.parts["handle_7"], mesh=sheet((0.52 + depth, 1.15, 0.5), (0, 0.2, 0), (0, 0, 0.02), 0.01)
        )
        found = doubted(Scene("printed", {**scene.parts, "handle_7": printed}))
        assert (("drawer_6", "handle_relief") in found) is flat


def test_a_handle_annotated_to_the_other_part_is_named_with_its_distance() -> None:
    scene = room()
    far = replace(scene.parts["handle_7"], mesh=scene.parts["handle_9"].mesh)
    found = findings(Scene("far", {**scene.parts, "handle_7": far}), "drawer_6")["handle_on_part"]
    # From y 1.48 at x 0.52 to y 1.55 at x 0.53.
    assert (found.status, found.value) == ("fail", pytest.approx(np.hypot(0.07, 0.01), abs=1e-4))


def test_a_part_in_the_air_floats_by_its_distance() -> None:
    lamp = Part("lamp", bar((1.0, 1.2), (1.5, 1.7), (2.0, 2.2)))
    scene = Scene("floating", {**room().parts, "lamp_10": lamp})
    [found] = annotation.floating(ScanSurface(scene), BOUNDS)
    # Its top is at 1.7 m and the ceiling at 2.5 m; the table's edge is farther: 0.3 m beside and 0.8 m below it.
    assert found.part == "lamp_10" and found.value == pytest.approx(0.8, abs=1e-4)


def test_shared_faces_warn_above_their_bound() -> None:
    overlaps = [Overlap(("drawer_1", "floor_2"), 200, 0.5), Overlap(("door_3", "floor_2"), 1, 0.001)]
    assert [f.part for f in annotation.shared_faces(overlaps, BOUNDS)] == ["drawer_1"]


def test_the_opening_cosine_needs_nothing_of_the_axis_to_know_the_outward_side() -> None:
    surface = ScanSurface(room())
    for axis in ((1, 0, 0), (-1, 0, 0), (0, 1, 0)):
        joint = Joint("prismatic", axis, (0.52, 1.25, 0.5), (0.0, 0.4))
        found = front(surface.with_scene(changed(room(), "drawer_6", axis=axis)), "drawer_6")
        assert found is not None
        assert opening.outward_cosine(joint, found) == pytest.approx(axis[0])


@pytest.mark.parametrize("part", ["drawer_6", "handle_7", "cabinet_5", "door_8"])
@pytest.mark.parametrize("faces", [0, 1])
def test_parts_of_one_face_and_of_none_are_checked_as_far_as_they_go(part: str, faces: int) -> None:
    scene = room()
    mesh = scene.parts[part].mesh
    few = Mesh(mesh.vertices[:0] if not faces else mesh.vertices, mesh.faces[:faces])
    found = annotation.check(Scene("few", {**scene.parts, part: replace(scene.parts[part], mesh=few)}), BOUNDS)
    assert {f.part for f in found} >= {"drawer_6", "door_8"}


def test_an_upright_sliver_is_no_crash() -> None:
    scene = room()
    sliver = Mesh([[0.53, 1.2, 0.5], [0.56, 1.2, 0.5], [0.56, 1.2, 0.53]], [[0, 1, 2]])
    parts = {**scene.parts, "handle_7": replace(scene.parts["handle_7"], mesh=sliver)}
    assert annotation.check(Scene("sliver", parts), BOUNDS)


def test_a_scene_without_a_surface_is_unknown() -> None:
    empty = Part("box", Mesh(np.empty((0, 3)), np.empty((0, 3))))
    assert {f.status for f in annotation.check(Scene("empty", {"box_1": empty}), BOUNDS)} <= {"skipped", "fail"}


def test_only_parts_that_share_a_vertex_with_another_touch_it() -> None:
    def triangle(height: float) -> Part:
        return Part("part", Mesh([[0, 0, height], [1, 0, height], [0, 1, 0.5]], [[0, 1, 2]]))

    # Two share one corner, -0 is 0, and the others only have x and y in common with them.
    low = Part("part", Mesh([[-0.0, 1, 0.5], [5, 5, 5], [6, 5, 5]], [[0, 1, 2]]))
    above = Part("part", Mesh([[0, 0, 3], [1, 0, 3], [0, 1, 3]], [[0, 1, 2]]))
    parts = {"a_1": triangle(0.0), "b_2": low, "c_3": above, "d_4": Part("part", Mesh([[5, 5, 6]] * 3, [[0, 1, 2]]))}
    assert annotation.isolated(ScanSurface(Scene("corners", parts))) == ["c_3", "d_4"]
