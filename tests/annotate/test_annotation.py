"""Regions, cuts, joints, handles and undo, on a board whose numbers are known."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import plain_room
import pytest

from s2a import scan
from s2a.annotate import annotation, files, handle, shown
from s2a.annotate.annotation import Draft, Editor
from s2a.annotate.region import GrowConfig, around, grow, grow_most
from s2a.annotate.surface import ADDED, SplitSurface
from s2a.scan.evidence import Bounds
from s2a.scan.evidence import annotation as evidence
from s2a.scan.formats.articulate3d import read_overlaps
from s2a.scene.geometry.mesh_ops import merge

GROW = GrowConfig()
BOUNDS = Bounds()
DRAWER = np.array([(0, y, z) for y, z in ((-0.71, 0.613), (-0.11, 0.613), (-0.11, 0.787), (-0.71, 0.787))], float)
"""Corners between the board's vertices: 0.6 x 0.174 m around the bar."""


@pytest.fixture
def editor() -> Editor:
    mesh = plain_room.room()
    return Editor(Draft(SplitSurface.of(mesh.vertices, mesh.faces, mesh.colors)), GROW)


def click(editor: Editor, *point: float) -> int:
    middles = editor.annotation.surface.centroids
    return int(np.argmin(np.linalg.norm(middles - np.array(point), axis=1)))


def drawer(editor: Editor) -> Editor:
    editor.click_front(click(editor, 0.0, -0.4, 0.64))
    editor.rectangle(DRAWER)
    editor.slide()
    editor.handle(plain_room.BAR)
    return editor


def test_a_region_ends_where_colour_and_plane_end(editor: Editor) -> None:
    editor.click_front(click(editor, 0.0, -0.4, 0.3))
    region = editor.item.region
    np.testing.assert_allclose(region.normal, (1, 0, 0), atol=1e-9)
    np.testing.assert_allclose(region.size, (0.8, 0.9), atol=0.025)  # a column of cells has both colours
    assert (editor.annotation.surface.centroids[region.faces][:, 0] == 0).all()


def test_a_rectangle_is_cut_out_to_the_micrometre(editor: Editor) -> None:
    before = editor.annotation.surface
    drawer(editor)
    after, faces = editor.annotation.surface, editor.item.region.faces
    assert after.areas[faces].sum() == pytest.approx(0.6 * 0.174, abs=1e-6)
    assert after.areas.sum() == pytest.approx(before.areas.sum(), abs=1e-9)
    corners = after.vertices[after.faces[faces]]
    np.testing.assert_allclose(corners[..., 1].min(), -0.71, atol=1e-9)
    assert (after.source[: len(before.faces)] == np.arange(len(before.faces))).all()
    assert (after.normals[faces] @ (1, 0, 0) > 0.999).all()


def test_no_crack_opens_where_triangles_are_split(editor: Editor) -> None:
    """Every edge inside of the board belongs to two triangles, as before."""
    drawer(editor)
    surface = editor.annotation.surface
    flat = np.flatnonzero((np.abs(surface.vertices[surface.faces][..., 0]) < 1e-9).all(axis=1))
    edges = np.concatenate([np.sort(surface.faces[flat][:, pair], axis=1) for pair in ([0, 1], [1, 2], [2, 0])])
    unique, count = np.unique(edges, axis=0, return_counts=True)
    y, z = np.moveaxis(surface.vertices[unique[count == 1]][..., 1:], -1, 0)
    border = [np.ptp(v, axis=1) < 1e-9 for v in (y, z)]
    on = [(np.abs(v - low) < 1e-6) | (np.abs(v - high) < 1e-6) for v, low, high in ((y, -0.8, 0.8), (z, 0.0, 0.9))]
    assert ((border[0] & on[0].all(axis=1)) | (border[1] & on[1].all(axis=1))).all()


@pytest.mark.parametrize(("point", "axis"), [((0, -0.7, 0.7), -1), ((0, -0.12, 0.7), 1)])
def test_a_click_at_an_upright_side_makes_a_hinge_that_opens_to_the_room(editor, point, axis) -> None:
    """FrontShape from the room, +y is to the right: a door hinged at its right side turns its left one to the viewer about +z."""
    drawer(editor).hinge(np.array([point], float))
    joint = editor.item.joint
    np.testing.assert_allclose(joint.axis, (0, 0, axis), atol=1e-9)
    assert joint.origin[1] == pytest.approx(-0.71 if axis < 0 else -0.11, abs=1e-6)
    assert joint.limits == (0.0, pytest.approx(np.pi / 2))


def test_two_points_off_the_sides_are_a_line_of_their_own(editor: Editor) -> None:
    drawer(editor).hinge(np.array([(0, -0.6, 0.7), (0, -0.2, 0.7)], float))
    joint = editor.item.joint
    np.testing.assert_allclose(np.abs(joint.axis), (0, 1, 0), atol=1e-9)
    assert joint.origin[2] == pytest.approx(0.7)
    editor.hinge(np.array([(0.03, -0.6, 0.8), (0.0, -0.2, 0.77)], float))  # near the top, one before it
    assert editor.item.joint.origin[2] == pytest.approx(0.787, abs=1e-6)


def test_a_handle_that_stands_out_is_found_and_one_that_does_not_is_added(editor: Editor) -> None:
    drawer(editor)
    surface = editor.annotation.surface
    assert surface.centroids[editor.item.handle][:, 0].max() == pytest.approx(0.035)
    assert editor.item.completed == "" and len(editor.item.handle) > 10
    editor.handle(np.array([0.0, -0.6, 0.64]))
    added, surface = editor.item.handle, editor.annotation.surface
    assert editor.item.completed == "bar" and (surface.source[added] == ADDED).all()
    corners = surface.vertices[surface.faces[added]]
    assert corners[..., 0].max() == pytest.approx(0.032 + 2 * 0.006, abs=5e-4)
    a, b, c = np.moveaxis(corners, 1, 0)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0  # closed, faces outwards
    editor.undo()
    assert editor.item.completed == "" and len(editor.annotation.surface.faces) < len(surface.faces)


def test_the_mean_surface_point_of_an_added_bar_is_inside_of_it(editor: Editor) -> None:
    """There the gripper closes; thick posts would pull that point out of the bar, towards the front."""
    region, point = drawer(editor).item.region, np.array([0.0, -0.4, 0.64])
    bar = handle.shape("bar", region, point, editor.item.joint)
    a, b, c = np.moveaxis(bar.vertices[bar.faces], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    mean = np.average((a + b + c) / 3, axis=0, weights=area)
    axis = handle.CLEARANCE + handle.RADIUS
    assert float((mean - point) @ region.normal) == pytest.approx(axis, abs=handle.RADIUS)


def test_undo_goes_back_to_the_bare_scan(editor: Editor) -> None:
    before = editor.annotation
    drawer(editor).label("top drawer.1")
    assert editor.item.name == "top drawer 1"
    while editor.undo():
        pass
    assert editor.annotation is before and editor.item is None


def test_the_next_front_takes_no_faces_of_the_first(editor: Editor) -> None:
    drawer(editor)
    editor.rectangle_around(np.array([click(editor, 0.0, -0.4, 0.55)]), lambda region: DRAWER - [0, 0, 0.1])
    one, other = editor.annotation.items
    assert not np.intersect1d(one.region.faces, other.region.faces).size
    assert editor.annotation.surface.areas[one.region.faces].sum() == pytest.approx(0.6 * 0.174, abs=1e-6)
    assert editor.annotation.surface.areas[other.region.faces].sum() == pytest.approx(0.6 * 0.1, abs=1e-6)


def test_a_rectangle_lies_on_the_plane_that_most_of_it_shows(editor: Editor) -> None:
    """Its middle shows the handle, or an edge that a phone has rounded."""
    pytest.importorskip("newton", reason="newton is not installed", exc_type=ImportError)
    surface = editor.annotation.surface
    eye = np.array([1.5, plain_room.BAR[1], plain_room.BAR[2]])
    view = shown.CameraView(eye, np.array([(0, 0, -1), (1, 0, 0), (0, -1, 0)], float), 0.8, 1.0)
    half = 0.1 / (1.5 * np.tan(0.4)) / 2
    faces = shown.seen(view, surface.mesh(), (0.5 - half, 0.5 - half), (0.5 + half, 0.5 + half))
    at_handle = grow(surface, int(faces[0]), GROW)
    assert len(faces) == 49 and at_handle.offset > 0.01
    found = grow_most(surface, faces, GROW)
    np.testing.assert_allclose(found.normal, (1, 0, 0), atol=1e-9)
    assert found.offset == pytest.approx(0.0, abs=1e-9)


def test_what_is_written_is_what_was_annotated(editor: Editor, tmp_path: Path) -> None:
    plain_room.write(tmp_path / "scan")
    (tmp_path / "scan" / "keyframes").mkdir()
    (tmp_path / "scan" / "keyframes" / "keyframes.json").write_text('{"frames": []}')
    bare = files.read(tmp_path / "scan")
    drawer(editor).handle(np.array([0.0, -0.6, 0.64]))  # a bar that is given up again
    editor.handle(plain_room.BAR)
    door = np.array([(0, y, z) for y in (0.2, 0.6) for z in (0.1, 0.5)], float)
    editor.rectangle_around(np.array([click(editor, 0, 0.4, 0.3)]), lambda region: door)
    editor.hinge(np.array([(0, 0.21, 0.3)]))
    editor.handle(np.array([0.0, 0.55, 0.4]), "knob")
    files.write(editor.annotation, bare, tmp_path / "out")
    assert (tmp_path / "out" / "keyframes" / "keyframes.json").is_file()
    read = scan.read(tmp_path / "out")
    assert read.movable == ("drawer_1", "door_3")
    here, ids = annotation.scene(editor.annotation)
    for part in ("drawer_1", "handle_2", "door_3", "handle_4"):
        assert read.parts[part].mesh.face_areas.sum() == pytest.approx(here.parts[part].mesh.face_areas.sum(), rel=1e-4)
    assert list(ids.values()) == ["drawer_1", "door_3"]
    source = np.load(tmp_path / "out" / "source_faces.npy")
    count = len(bare.mesh.faces)
    assert (source[:count] == np.arange(count)).all() and (source[count:] < count).all()
    record = json.loads((tmp_path / "out" / "annotate.json").read_text())
    assert [part["completed_handle"] for part in record["parts"]] == [None, "knob"]
    assert (source == ADDED).sum() == record["parts"][1]["handle_faces"]


def test_the_checks_of_the_page_are_those_of_the_command(editor: Editor, tmp_path: Path) -> None:
    bare = files.read(plain_room.write(tmp_path / "scan"))
    drawer(editor)
    files.write(editor.annotation, bare, tmp_path / "out")
    written = evidence.check(scan.read(tmp_path / "out"), BOUNDS, read_overlaps(tmp_path / "out"))
    live = annotation.of_part(editor.annotation, 0, BOUNDS)
    assert [(f.name, f.status) for f in written if f.part] == [(f.name, f.status) for f in live]
    assert len(live) > 5


def test_what_a_scan_made_of_a_handle_goes_with_the_front_that_gets_another(editor: Editor) -> None:
    """Left behind, it would stand still in the room before the part, in the way of part and gripper."""
    scanned = drawer(editor).item.handle
    added = editor.annotation.with_handle(0, plain_room.BAR, "bar").items[0]
    assert len(scanned) and np.isin(scanned, added.front).all() and not np.isin(scanned, added.handle).any()


@pytest.mark.parametrize("side", [0.0, 0.02])
def test_a_bulge_that_looks_ahead_all_over_is_no_handle(side: float) -> None:
    """A scan that has filled the gap behind a bar and rounded its sides leaves nothing to press on."""
    x, y, z = np.eye(3)
    front = plain_room.grid(np.zeros(3), y, z, (0.6, 0.9), (0, 0, 0))
    bulge = plain_room.grid(np.array([0.03, 0.2, 0.4]), y, z, (0.02, 0.12), (0, 0, 0))
    sides = [plain_room.grid(np.array([0.03, 0.22, 0.4]), -x, z, (side, 0.12), (0, 0, 0))] if side else []
    whole = merge([front, bulge, *sides])
    surface = SplitSurface.of(whole.vertices, whole.faces, whole.colors)
    region = around(surface, np.arange(len(front.faces)))
    found = handle.find(surface, region, np.array([0.03, 0.21, 0.46]))
    assert bool(len(found)) == (side > 0.0)


@pytest.mark.parametrize(("height", "expected"), [(0.065, True), (0.038, False)])
def test_a_handle_on_a_frame_stands_out_of_the_frame(height: float, expected: bool) -> None:
    y, z = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    glass = plain_room.grid(np.zeros(3), y, z, (0.6, 0.9), (0, 0, 0))
    frame = plain_room.grid(np.array([0.03, 0.6, 0.0]), y, z, (0.1, 0.9), (0, 0, 0))
    piece = plain_room.grid(np.array([height, 0.62, 0.4]), y, z, (0.02, 0.12), (0, 0, 0))
    whole = merge([glass, frame, piece])
    surface = SplitSurface.of(whole.vertices, whole.faces, whole.colors)
    front = around(surface, np.arange(len(glass.faces)))
    last = np.arange(len(surface.faces) - len(piece.faces), len(surface.faces))
    assert handle.resolved(surface, front, last) == expected
