"""ScanNet++ scans without Articulate3D's annotation, bare meshes, and which reader a folder goes to."""

from __future__ import annotations

import numpy as np
import tiny_multiscan
import tiny_scan
from tiny_scan import ARTIC, PARTS, PLY, assert_refused, corners, triangles

from s2a import scan


def flat_files():
    """Return ScanNet++'s two annotation files alone."""
    files = tiny_scan.contents()
    return {name: files[name] for name in ("segments.json", "segments_anno.json")}


def test_without_articulate3d_the_objects_of_scannetpp_are_flat_fixed_parts(tmp_path):
    scene = scan.read(tiny_scan.write(tmp_path / "0a5c013435", flat_files()))
    assert scene.name == "0a5c013435"
    assert list(scene.parts) == ["door_1", "office_chair_2"]
    assert {(part.parent, part.motion, part.graspable) for part in scene.parts.values()} == {(None, "fixed", False)}
    assert np.array_equal(triangles(scene.parts["door_1"]), corners(0, 1, 2, 3, 4, 5, 6))
    assert np.array_equal(triangles(scene.parts["office_chair_2"]), corners(7, 8, 9))


def test_what_no_object_covers_is_one_more_part(tmp_path):
    files = flat_files()
    files["segments_anno.json"]["segGroups"][1]["segments"] = [8, 9]
    scene = scan.read(tiny_scan.write(tmp_path / "scan", files))
    assert list(scene.parts) == ["door_1", "office_chair_2", "unannotated_3"]
    # Of face 9 (vertices 9, 10, 11) only one vertex is the chair's.
    assert np.array_equal(triangles(scene.parts["unannotated_3"]), corners(9))


def test_a_mesh_alone_is_one_static_part_and_the_user_is_told(tmp_path, caplog):
    scene = scan.read(tiny_scan.write(tmp_path / "room", {}))
    assert list(scene.parts) == ["unannotated_1"] and scene.name == "room" and not scene.movable
    assert np.array_equal(triangles(scene.parts["unannotated_1"]), corners(*range(10)))
    assert "nothing is annotated" in caplog.text and PLY in caplog.text


def test_the_mesh_may_lie_in_the_subfolder_scans_or_have_another_name(tmp_path):
    folder = tiny_scan.write(tmp_path / "0a5c013435" / "scans", flat_files())
    assert scan.read(folder) == scan.read(folder.parent)
    assert scan.read(folder).name == "0a5c013435"
    other = tiny_scan.write(tmp_path / "other", {})
    (other / PLY).rename(other / "scan.ply")
    assert list(scan.read(other).parts) == ["unannotated_1"]


def test_several_meshes_of_other_names_are_refused(tmp_path):
    folder = tiny_scan.write(tmp_path / "scan", {})
    (folder / PLY).rename(folder / "a.ply")
    (folder / "b.ply").write_bytes(tiny_scan.ply())
    assert_refused(folder, "one mesh", "a.ply, b.ply", PLY)


def test_half_an_annotation_is_refused_and_not_taken_for_none(tmp_path):
    folder = tiny_scan.write(tmp_path / "scan")
    (folder / PARTS).unlink()
    assert_refused(folder, "_parts.json is missing")
    flat = tiny_scan.write(tmp_path / "flat", flat_files())
    (flat / "segments_anno.json").unlink()
    assert_refused(flat, "segments_anno.json is missing")


def test_the_files_tell_whose_annotation_it_is(tmp_path):
    folder = tiny_scan.write(tmp_path / "scan")
    assert scan.read(folder).name == tiny_scan.NAME
    tiny_multiscan.write_released(folder)
    assert scan.read(folder).name == tiny_scan.NAME
    (folder / PARTS).unlink()
    (folder / ARTIC).unlink()
    assert scan.read(folder).name == tiny_multiscan.NAME
