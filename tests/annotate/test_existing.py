"""An annotation that is edited: what was not touched is written as it was, what was is changed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import plain_room
import pytest
import tiny_scan

from s2a import scan
from s2a.annotate import existing, files
from s2a.annotate.annotation import Draft, Editor
from s2a.annotate.region import GrowConfig
from s2a.commands import cli
from s2a.scan.ply_file import write_ply

GROW = GrowConfig()
DRAWER = np.array([(0, y, z) for y, z in ((-0.71, 0.613), (-0.11, 0.613), (-0.11, 0.787), (-0.71, 0.787))], float)
LOWER = DRAWER - [0.0, 0.0, 0.3]


def at(editor: Editor, *point: float) -> int:
    middles = editor.annotation.surface.centroids
    return int(np.argmin(np.linalg.norm(middles - np.array(point), axis=1)))


@pytest.fixture
def annotated(tmp_path: Path) -> Path:
    """Return a scan with two drawers, one with its scanned bar, one with an added knob, and what nobody annotated."""
    bare = files.read(plain_room.write(tmp_path / "scan"))
    editor = Editor(Draft(bare.surface), GROW)
    for corners, handle, kind in ((DRAWER, plain_room.BAR, None), (LOWER, np.array([0.0, -0.4, 0.4]), "knob")):
        editor.rectangle_around(np.array([at(editor, *corners.mean(axis=0))]), lambda region, corners=corners: corners)
        editor.slide()
        editor.handle(handle, kind)
    files.write(editor.annotation, bare, tmp_path / "annotated")
    return tmp_path / "annotated"


def edit(path: Path) -> tuple[Editor, files.BareScan, existing.Existing]:
    bare = files.read(path)
    known = existing.read(path, bare.mesh, bare.surface)
    return Editor(known.start(bare.surface), GROW), bare, known


def content(path: Path) -> dict[str, object]:
    return {
        file.name: json.loads(file.read_text()) if file.suffix == ".json" else file.read_bytes()
        for file in sorted(path.iterdir())
        if file.name != files.RECORD
    }


def test_an_unchanged_round_trip_is_identical(annotated: Path, tmp_path: Path) -> None:
    keys = [f"scan={annotated}", f"out={tmp_path / 'again'}", "edit=true", "page=false"]
    assert cli.main(["annotate", *keys]) == 0
    assert content(tmp_path / "again") == content(annotated)


def test_all_that_another_annotator_wrote_stays(tmp_path: Path) -> None:
    """Keys that s2a does not read, labels' depth, vertices, statistics, degrees and several articulations of a part."""
    written = tiny_scan.contents()
    joint = written[tiny_scan.ARTIC]["data"]["articulations"][0]
    written[tiny_scan.ARTIC]["data"]["articulations"] = [joint | {"rangeMax": 40}, joint | {"rangeMax": 90}]
    path = tiny_scan.write(tmp_path / "scan", written)
    keys = [f"scan={path}", f"out={tmp_path / 'again'}", "edit=true", "page=false"]
    assert cli.main(["annotate", *keys]) == 0
    assert content(tmp_path / "again") == content(path)
    editor, bare, known = edit(path)
    assert editor.annotation.items[0].joint.limits == (0.0, pytest.approx(np.pi / 2))
    editor.select(0)
    editor.limit(1.2)
    files.write(editor.annotation, bare, tmp_path / "changed", known)
    limits = [r["rangeMax"] for r in content(tmp_path / "changed")[tiny_scan.ARTIC]["data"]["articulations"]]
    assert limits == [1.2, 1.2]  # in radians, both records of the part
    assert content(tmp_path / "changed")[tiny_scan.PARTS] == written[tiny_scan.PARTS]


def test_an_edited_joint_and_name_change_alone(annotated: Path, tmp_path: Path) -> None:
    editor, bare, known = edit(annotated)
    assert [item.name for item in editor.annotation.items] == ["drawer", "drawer"]
    assert all(len(item.handle) for item in editor.annotation.items)
    editor.select(0)
    editor.hinge(np.array([(0, -0.7, 0.7)]))
    editor.label("flap")
    files.write(editor.annotation, bare, tmp_path / "out", known)
    before, after = scan.read(annotated), scan.read(tmp_path / "out")
    assert after.movable == ("flap_1", "drawer_3")
    assert after.joint("flap_1").kind == "revolute" and after.joint("drawer_3") == before.joint("drawer_3")
    np.testing.assert_allclose(after.joint("flap_1").origin[1], -0.71, atol=1e-3)
    for part, mesh in ((i.replace("flap", "drawer"), part.mesh) for i, part in after.parts.items()):
        assert np.array_equal(mesh.vertices, before.parts[part].mesh.vertices)


def test_a_deleted_part_leaves_its_faces_and_takes_its_added_handle_along(annotated: Path, tmp_path: Path) -> None:
    editor, bare, known = edit(annotated)
    editor.select(1)
    editor.remove()
    files.write(editor.annotation, bare, tmp_path / "out", known)
    before, after = scan.read(annotated), scan.read(tmp_path / "out")
    assert after.movable == ("drawer_1",) and "handle_4" not in after.parts
    knob = before.parts["handle_4"].mesh.face_areas.sum()
    total = [sum(part.mesh.face_areas.sum() for part in scene.parts.values()) for scene in (before, after)]
    assert total[0] - total[1] == pytest.approx(knob, rel=1e-4)
    source = np.load(tmp_path / "out" / "source_faces.npy")
    assert (source >= 0).all() and source.max() == len(plain_room.room().faces) - 1


def test_a_new_part_and_a_new_border_take_faces_of_what_was_there(annotated: Path, tmp_path: Path) -> None:
    editor, bare, known = edit(annotated)
    door = np.array([(0, y, z) for y in (0.2, 0.6) for z in (0.1, 0.5)], float)
    editor.rectangle_around(np.array([at(editor, 0, 0.4, 0.3)]), lambda region: door)
    editor.hinge(np.array([(0, 0.21, 0.3)]))
    editor.handle(np.array([0.0, 0.55, 0.4]), "bar")
    editor.select(0)
    editor.rectangle(DRAWER + [[0, 0.1, 0], [0, 0, 0], [0, 0, 0], [0, 0.1, 0]])  # narrower at its left
    files.write(editor.annotation, bare, tmp_path / "out", known)
    before, after = scan.read(annotated), scan.read(tmp_path / "out")
    (new,) = set(after.movable) - set(before.movable)
    assert after.parts[new].mesh.face_areas.sum() == pytest.approx(0.4 * 0.4, rel=1e-4)
    assert after.parts[after.handle_parts(new)[0]].label == "handle"
    np.testing.assert_allclose(np.ptp(after.parts["drawer_1"].mesh.bounds, axis=0)[1:], (0.5, 0.174), atol=1e-4)
    assert np.array_equal(after.joint("drawer_3").axis, before.joint("drawer_3").axis)
    listed = [r["triIndices"] for r in content(tmp_path / "out")["scan_parts.json"]["data"]["annotations"]]
    assert len(np.unique(np.concatenate(listed))) == sum(map(len, listed))  # nobody shares a face


def test_a_scan_that_lies_far_from_its_origin_keeps_its_joints(annotated: Path, tmp_path: Path) -> None:
    """The file of a scan may count from another place; a mesh that is written again counts from the scene's."""
    bare = files.read(annotated)
    far = np.array([1000.0, 2000.0, 0.0])
    mesh = bare.mesh
    write_ply(
        annotated / "mesh_aligned_0.05.ply", type(bare.surface.mesh())(mesh.vertices + far, mesh.faces, mesh.colors)
    )
    artic = annotated / "scan_artic.json"
    moved = json.loads(artic.read_text())
    for record in moved["data"]["articulations"]:
        record["origin"] = (np.array(record["origin"]) + far).tolist()
    artic.write_text(json.dumps(moved))
    before = scan.read(annotated)
    editor, bare, known = edit(annotated)
    editor.select(1)
    editor.handle(np.array(known.items[3].region.center), "bar")
    files.write(editor.annotation, bare, tmp_path / "out", known)
    after = scan.read(tmp_path / "out")
    middle = [
        np.mean(scene.parts["drawer_1"].mesh.bounds, axis=0) - scene.joint("drawer_1").origin
        for scene in (before, after)
    ]
    np.testing.assert_allclose(*middle, atol=2e-4)


@pytest.mark.parametrize(
    ("keys", "words"),
    [(["edit=true"], ["edit=true", "annotate"]), (["edit=true", "auto=true"], ["'auto'", "'edit'"])],
)
def test_what_cannot_be_edited_is_one_line(
    keys: list[str], words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bare = plain_room.write(tmp_path / "bare")
    assert cli.main(["annotate", f"scan={bare}", f"out={tmp_path / 'out'}", "page=false", *keys]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and all(word in error for word in words)
    assert not (tmp_path / "out").exists()
