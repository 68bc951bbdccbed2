"""What annotators called REMOVE is left out, what they called SPLIT has no label, in every format and spelling."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tiny_multiscan
import tiny_scan
from tiny_scan import ARTIC, PARTS, corners, triangles

from s2a import scan
from s2a.scan import labels

SEGMENTS, GROUPS = "segments.json", "segments_anno.json"


def relabelled(label: str, group: int = 1) -> dict[str, Any]:
    """Return ScanNet++'s two files alone, with another label for the door (0) or the chair (1)."""
    files = {name: content for name, content in tiny_scan.contents().items() if name in (SEGMENTS, GROUPS)}
    files[GROUPS]["segGroups"][group]["label"] = label
    return files


def faces(scene: Any) -> dict[str, int]:
    return {part_id: len(part.mesh.faces) for part_id, part in scene.parts.items()}


@pytest.mark.parametrize(
    "label",
    ["REMOVE", "remove", " Remove ", "REMOVE_2", "remove.1", "Removed", "remove (ghost)", "to_remove"],
)
def test_artefacts_of_scannetpp_are_left_out_with_their_count(
    label: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    scene = scan.read(tiny_scan.write(tmp_path / "scan", relabelled(label)))
    assert faces(scene) == {"door_1": 7}
    assert "3 faces" in caplog.text and "remove" in caplog.text and GROUPS in caplog.text


@pytest.mark.parametrize("label", ["SPLIT", "split", "Split_3", "SPLIT 2"])
def test_what_could_not_be_annotated_has_no_label(label: str, tmp_path: Path) -> None:
    scene = scan.read(tiny_scan.write(tmp_path / "scan", relabelled(label)))
    assert faces(scene) == {"door_1": 7, "unannotated_2": 3}
    assert {part.label for part in scene.parts.values()} == {"door", "unannotated"}


@pytest.mark.parametrize("label", ["remover", "split level sofa", "splitter", "remote", "unremoved", "room divider"])
def test_things_with_like_names_stay(label: str, tmp_path: Path) -> None:
    scene = scan.read(tiny_scan.write(tmp_path / "scan", relabelled(label)))
    assert sorted(faces(scene).values()) == [3, 7] and label in {part.label for part in scene.parts.values()}


def test_artefacts_beside_articulate3ds_parts_are_left_out(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    files = tiny_scan.contents() | relabelled("REMOVE")
    scene = scan.read(tiny_scan.write(tmp_path / "scan", files))
    whole = scan.read(tiny_scan.write(tmp_path / "whole"))
    assert sum(faces(whole).values()) == 10 and sum(faces(scene).values()) == 7
    assert "3 faces" in caplog.text


def test_artefacts_among_articulate3ds_parts_go_with_what_belongs_to_them(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    files = {name: content for name, content in tiny_scan.contents().items() if name in (PARTS, ARTIC)}
    files[PARTS]["data"]["annotations"][2]["label"] = "REMOVE.1.2.1"  # the handle's base, with the handle
    scene = scan.read(tiny_scan.write(tmp_path / "scan", files))
    assert faces(scene) == {"door_frame_1": 2, "door_3": 2, "unannotated_6": 4}
    assert "2 faces" in caplog.text and scene.movable == ("door_3",)


def test_a_split_part_of_articulate3d_is_unannotated_and_its_children_move_up(tmp_path: Path) -> None:
    files = {name: content for name, content in tiny_scan.contents().items() if name in (PARTS, ARTIC)}
    files[PARTS]["data"]["annotations"][2]["label"] = "SPLIT.1.2.1"
    scene = scan.read(tiny_scan.write(tmp_path / "scan", files))
    assert scene.parts["handle_5"].parent == "door_3"
    assert np.array_equal(triangles(scene.parts["unannotated_6"]), corners(4, 6, 7, 8, 9))


def test_artefacts_of_scannet_are_left_out(tmp_path: Path) -> None:
    files, folder = relabelled("REMOVE"), tmp_path / "scene0000_00"
    folder.mkdir()
    (folder / "scene0000_00_vh_clean_2.ply").write_bytes(tiny_scan.ply())
    (folder / "scene0000_00_vh_clean_2.0.010000.segs.json").write_text(json.dumps(files[SEGMENTS]))
    (folder / "scene0000_00.aggregation.json").write_text(json.dumps(files[GROUPS]))
    assert faces(scan.read(folder)) == {"door_1": 7}


@pytest.mark.parametrize(("label", "left"), [("REMOVE.1", 9), ("Removed.1", 9), ("SPLIT.1", 10)])
def test_multiscans_spellings(label: str, left: int, tmp_path: Path) -> None:
    annotation = json.loads(json.dumps(tiny_multiscan.released()).replace('"remove"', json.dumps(label)))
    scene = tiny_multiscan.read_released(tmp_path, annotation)
    assert sum(faces(scene).values()) == left
    assert not [i for i in scene.parts if i.lower().startswith(("remove", "split"))]


def test_a_label_is_one_line(tmp_path: Path) -> None:
    files = relabelled("office\n\tchair <b>\x1b[31m")
    scene = scan.read(tiny_scan.write(tmp_path / "scan", files))
    assert [part.label for part in scene.parts.values()][1].split("\x1b")[0] == "office chair <b>"


def test_marks_are_told_from_names() -> None:
    assert labels.is_removed("to be removed") and labels.is_removed("REMOVE-chair") and not labels.is_removed("remover")
    assert labels.is_split("split") and not labels.is_split("split air conditioner")
