"""Damaged MultiScan inputs: each is refused in one line that names the file, the place and what belongs there."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import tiny_multiscan as tiny
from tiny_multiscan import ANNOTATIONS, PLY, SEMSEG
from tiny_scan import assert_refused

Json = dict[str, Any]
REMOVED = object()


def top(annotation: Json) -> Json:
    return annotation


def thing(number: int) -> Callable[[Json], Json]:
    """Return how to find an object's record."""
    return lambda annotation: annotation["objects"][number - 1]


def part(number: int) -> Callable[[Json], Json]:
    """Return how to find a part's record."""
    return lambda annotation: annotation["parts"][number - 1]


def turn(annotation: Json) -> Json:
    return annotation["parts"][1]["articulations"][0]


def older_turn(annotation: Json) -> Json:
    return annotation["articulations"]["wall_cabinet.1:door.1"]


def older_joints(annotation: Json) -> Json:
    return annotation["articulations"]


# Where in which record, the key, the damaged value (or REMOVED), and words that the message must contain.
RELEASED = {
    "objects are missing": (top, "objects", REMOVED, ("objects", "missing", "parts")),
    "objects are an object": (top, "objects", {}, ("objects", "list of objects")),
    "parts are missing": (top, "parts", REMOVED, ("parts", "missing")),
    "a part is a number": (top, "parts", [1], ("parts", "list of objects")),
    "object without id": (thing(2), "objectId", REMOVED, ("object 1", "objectId", "missing")),
    "object id is zero": (thing(2), "objectId", 0, ("object 0", "bag.1", "objectId", "from 1")),
    "object id twice": (thing(2), "objectId", 1, ("object 1", "bag.1", "wall_cabinet.1")),
    "label is a number": (thing(2), "label", 7, ("object 1", "label", "7", "string")),
    "part id is a string": (part(3), "partId", "3", ("part 2", "partId", "'3'", "whole number")),
    "part id is zero": (part(3), "partId", 0, ("part 0", "shelf.1", "partId", "from 1")),
    "part id twice": (part(3), "partId", 2, ("part 2", "shelf.1", "door.1")),
    "part without label": (part(3), "label", REMOVED, ("part 2", "label", "missing")),
    "object of a part not there": (thing(2), "partIds", [9], ("object 2", "bag.1", "partIds", "9")),
    "part of two objects": (thing(2), "partIds", [4, 3], ("object 2", "part 3", "wall_cabinet.1")),
    "part ids are a string": (thing(2), "partIds", "4", ("object 2", "partIds", "'4'", "list of whole")),
    "parent not there": (part(2), "parentId", 99, ("part 2", "door.1", "parentId", "99", "1, 2, 3")),
    "parent in another object": (part(2), "parentId", 4, ("part 2", "parentId", "4", "1, 2, 3")),
    "parent is itself": (part(3), "parentId", 3, ("parentId", "cycle", "'shelf.1' -> 'shelf.1'")),
    "parents in a cycle": (part(6), "parentId", 5, ("parentId", "cycle", "'door.1'", "'door_frame.1'")),
    "articulations are an object": (
        part(2),
        "articulations",
        {"type": "rotation"},
        ("part 2", "articulations", "list"),
    ),
    "kind is unknown": (turn, "type", "screw", ("part 2", "type", "'screw'", "rotation, translation")),
    "axis is zero": (turn, "axis", [0, 0, 0], ("part 2", "axis", "[0, 0, 0]", "length 1")),
    "axis has two numbers": (turn, "axis", [0, 1], ("part 2", "axis", "three")),
    "origin is missing": (turn, "origin", REMOVED, ("part 2", "origin", "missing")),
    "range is not a number": (turn, "rangeMax", float("nan"), ("part 2", "rangeMax", "nan", "finite")),
    "range runs backwards": (turn, "rangeMin", 1.6, ("part 2", "rangeMin", "1.6", "rangeMax", "1.5")),
}
OLDER = {
    "label twice": (thing(2), "label", "door.1", ("object 2", "label", "door.1", "one of its own")),
    "parts are a string": (thing(1), "parts", "door.1", ("object 0", "parts", "list of labels")),
    "part twice": (thing(1), "parts", ["door.1", "door.1"], ("object 0", "parts", "twice")),
    "moving part not there": (older_joints, "bag.1:lid.1", {}, ("bag.1:lid.1", "not an object or part")),
    "moving object not there": (older_joints, "box.1", {}, ("box.1", "not an object or part")),
    "articulation is a list": (older_joints, "door.1:door.1", [], ("door.1:door.1", "object")),
    "articulations are a list": (top, "articulations", [1], ("articulations", "[1]", "object")),
    "older kind is unknown": (older_turn, "type", "hinge", ("wall_cabinet.1:door.1", "type", "'hinge'", "rotation")),
    "older origin is infinite": (older_turn, "origin", [0, 0, float("inf")], ("origin", "inf", "finite")),
}
FACES = {
    "face out of range": ("bag.1", [10], ("bag.1", "10", "10 faces")),
    "face negative": ("bag.1", [-1], ("bag.1", "-1")),
    "faces are a string": ("bag.1", "5", ("bag.1", "'5'", "list of whole")),
    "label not there": ("bag.2", [5], ("bag.2", ANNOTATIONS, "wall_cabinet.1")),
}


def damaged(annotation: Json, case: tuple[Callable[[Json], Json], str, Any, tuple[str, ...]]) -> Json:
    """Return an annotation with one value replaced or removed."""
    find, key, value, _ = case
    record = find(annotation)
    record[key] = value
    if value is REMOVED:
        del record[key]
    return annotation


@pytest.mark.parametrize("case", RELEASED)
def test_a_wrong_value_in_the_released_schema_is_refused(tmp_path, case):
    annotation = damaged(tiny.released(), RELEASED[case])
    assert_refused(tiny.write_released(tmp_path / "scan", annotation), ANNOTATIONS, *RELEASED[case][3])


@pytest.mark.parametrize("case", OLDER)
def test_a_wrong_value_in_the_older_schema_is_refused(tmp_path, case):
    annotation = damaged(tiny.older(), OLDER[case])
    assert_refused(tiny.write_older(tmp_path / "scan", annotation), ANNOTATIONS, *OLDER[case][3])


@pytest.mark.parametrize("case", FACES)
def test_a_wrong_list_of_faces_is_refused(tmp_path, case):
    label, value, words = FACES[case]
    faces = tiny.semseg()
    faces["triIndices"][label] = value
    assert_refused(tiny.write_older(tmp_path / "scan", faces=faces), SEMSEG, *words)


@pytest.mark.parametrize("name", [ANNOTATIONS, SEMSEG])
@pytest.mark.parametrize("damage", ["truncated", "empty", "a list", "not text"])
def test_a_damaged_json_file_is_refused(tmp_path, name, damage):
    file = tiny.write_older(tmp_path / "scan") / name
    whole = file.read_bytes()
    file.write_bytes({"truncated": whole[:-20], "empty": b"", "a list": b"[1]", "not text": b'{"\xff\xfe": 1}'}[damage])
    assert_refused(file.parent, name, "object" if damage == "a list" else "download")


def test_a_missing_list_of_faces_is_named(tmp_path):
    folder = tiny.write_older(tmp_path / "scan")
    (folder / SEMSEG).unlink()
    assert_refused(folder, SEMSEG, "missing")


def test_a_truncated_mesh_is_refused(tmp_path):
    assert_refused(tiny.write(tmp_path / "scan", tiny.released(), tiny.ply()[:-5]), PLY, "truncated")


def test_a_mesh_whose_faces_carry_no_ids_is_refused(tmp_path):
    folder = tiny.write(tmp_path / "scan", tiny.released(), tiny.ply(None))
    assert_refused(folder, PLY, "faces have no objectId", "vertex_indices")


def test_ids_that_are_no_whole_numbers_are_refused(tmp_path):
    mesh = tiny.ply(text=True).replace(b"ushort partId", b"float partId")
    assert_refused(tiny.write(tmp_path / "scan", tiny.released(), mesh), PLY, "partId", "whole number")


def test_ids_that_are_lists_by_the_header_alone_are_refused(tmp_path):
    mesh = tiny.ply(text=True).replace(b"ushort partId", b"list uchar int partId")
    assert_refused(tiny.write(tmp_path / "scan", tiny.released(), mesh), PLY, "truncated")


def test_the_mesh_of_another_scan_is_refused(tmp_path):
    folder = tiny.write_released(tmp_path / "scan", ids=tiny.IDS + 100)
    assert_refused(folder, PLY, "10 of 10 labelled faces", "objectId 101, partId 101", ANNOTATIONS)


def test_a_few_stray_ids_are_unannotated_with_a_warning(tmp_path, caplog):
    ids = np.array(tiny.IDS)
    ids[5] = (2, 1)
    scene = tiny.read_released(tmp_path, ids=ids)
    assert "face 5: objectId 2, partId 1" in caplog.text
    assert len(scene.parts["unannotated_11"].mesh.faces) == 2 and not len(scene.parts["bag_2"].mesh.faces)


def test_several_annotations_in_a_folder_are_refused(tmp_path):
    folder = tiny.write_released(tmp_path / "scan")
    shutil.copy(folder / ANNOTATIONS, folder / "scene_00001_00.annotations.json")
    assert_refused(folder, "scene_00001_00.annotations.json", ANNOTATIONS, "folder of one scan")
