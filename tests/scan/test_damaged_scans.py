"""Damaged scans: each is refused in one line that names the file, the place and the value, and what belongs there."""

from __future__ import annotations

import shutil
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import tiny_scan
from tiny_scan import ARTIC, PARTS, PLY, assert_refused

from s2a.commands.cli import main

Files = dict[str, Any]


def part(number: int) -> Callable[[Files], dict[str, Any]]:
    """Return how to find a part's record."""
    return lambda files: next(p for p in files[PARTS]["data"]["annotations"] if p["partId"] == number)


def joint(files: Files) -> dict[str, Any]:
    return files[ARTIC]["data"]["articulations"][0]


def stats(files: Files) -> dict[str, Any]:
    return files[PARTS]["data"]["stats"]


def top(name: str) -> Callable[[Files], dict[str, Any]]:
    """Return how to find the top level of a file."""
    return lambda files: files[name]


def data(name: str) -> Callable[[Files], dict[str, Any]]:
    """Return how to find the `data` of a file."""
    return lambda files: files[name]["data"]


def group(files: Files) -> dict[str, Any]:
    return files["segments_anno.json"]["segGroups"][1]


REMOVED = object()

# Where in which record, the key, the damaged value (or REMOVED), and words that the message must contain.
WRONG_VALUES = {
    "face out of range": (part(5), "triIndices", [5, 10], (PARTS, "part 5", "triIndices", "10", "10 faces")),
    "face negative": (part(5), "triIndices", [-1], (PARTS, "part 5", "triIndices", "-1")),
    "vertex out of range": (part(4), "vertIndices", [3, 12], (PARTS, "part 4", "vertIndices", "12 vertices")),
    "faces are a string": (part(5), "triIndices", "0 1 2", (PARTS, "part 5", "triIndices", "'0 1 2'", "list")),
    "faces are fractions": (part(5), "triIndices", [0.5, 1.5], (PARTS, "part 5", "triIndices", "list of whole")),
    "faces hold a string": (part(5), "triIndices", [1, "2"], (PARTS, "part 5", "triIndices", "list of whole")),
    "faces are truths": (part(5), "triIndices", [True, False], (PARTS, "part 5", "triIndices", "list of whole")),
    "faces are nested": (part(5), "triIndices", [[1, 2], [3]], (PARTS, "part 5", "triIndices", "list of whole")),
    "faces are beyond any integer": (part(5), "triIndices", [10**30], (PARTS, "part 5", "triIndices")),
    "label is a number": (part(5), "label", 7, (PARTS, "annotation 3", "label", "7", "string")),
    "label is missing": (part(5), "label", REMOVED, (PARTS, "annotation 3", "label", "missing", "partId")),
    "part number is a string": (part(5), "partId", "5", (PARTS, "annotation 3", "partId", "'5'", "whole number")),
    "part number is a truth": (part(5), "partId", True, (PARTS, "annotation 3", "partId", "True")),
    "part number is negative": (part(5), "partId", -5, (PARTS, "annotation 3", "partId", "-5")),
    "part number twice": (part(5), "partId", 4, (PARTS, "part 4", "partId", "handle.1.2.1.1", "handle base.1.2.1")),
    "mass is zero": (part(3), "mass", 0, (PARTS, "part 3", "door.1.2", "mass", "kilograms")),
    "mass is a string": (part(3), "mass", "12 kg", (PARTS, "part 3", "mass", "12 kg", "number")),
    "another mesh by its faces": (stats, "totalFaces", 11, (PARTS, "totalFaces", "11", PLY, "has 10")),
    "another mesh by its vertices": (stats, "totalVertices", 13, (PARTS, "totalVertices", "13", PLY, "has 12")),
    "statistics are a list": (data(PARTS), "stats", [10, 12], (PARTS, "stats", "[10, 12]", "object")),
    "parts without data": (top(PARTS), "data", REMOVED, (PARTS, "data", "missing")),
    "parts are an object": (data(PARTS), "annotations", {"1": {}}, (PARTS, "annotations", "list of objects")),
    "a part is a number": (data(PARTS), "annotations", [3], (PARTS, "annotations", "list of objects")),
    "articulations are missing": (data(ARTIC), "articulations", REMOVED, (ARTIC, "articulations", "missing")),
    "axis is zero": (joint, "axis", [0, 0, 0], (ARTIC, "part 3", "door.1.2", "axis", "[0, 0, 0]")),
    "axis is not a number": (joint, "axis", [0, float("nan"), 1], (ARTIC, "part 3", "axis", "nan", "finite")),
    "axis is endless": (joint, "axis", [1e308, 1e308, 1e308], (ARTIC, "part 3", "axis")),
    "axis has two numbers": (joint, "axis", [0, 1], (ARTIC, "part 3", "axis", "[0, 1]", "three")),
    "axis is a string": (joint, "axis", "z", (ARTIC, "part 3", "axis", "'z'", "three")),
    "origin is missing": (joint, "origin", REMOVED, (ARTIC, "part 3", "origin", "missing")),
    "origin is infinite": (joint, "origin", [0, 0, float("inf")], (ARTIC, "part 3", "origin", "inf", "finite")),
    "range is not a number": (joint, "rangeMax", float("nan"), (ARTIC, "part 3", "rangeMax", "nan", "finite")),
    "range is a string": (joint, "rangeMin", "0", (ARTIC, "part 3", "rangeMin", "'0'", "number")),
    "range is beyond any number": (joint, "rangeMax", 10**400, (ARTIC, "part 3", "rangeMax")),
    "range runs backwards": (joint, "rangeMin", 1.6, (ARTIC, "part 3", "rangeMin", "1.6", "rangeMax", "1.57")),
    "kind is unknown": (joint, "type", "screw", (ARTIC, "part 3", "type", "'screw'", "rotation, translation")),
    "kind is a number": (joint, "type", 1, (ARTIC, "part 3", "type", "1", "string")),
    "moving part is not there": (joint, "pid", 9, (ARTIC, "articulation 0", "pid", "9", "partId", "1 to 5")),
    "part stands on itself": (joint, "base", [3], (ARTIC, "base", "cycle", "3 'door.1.2' -> 3")),
    "base is a string": (joint, "base", "1", (ARTIC, "part 3", "base", "'1'", "list of whole")),
    "segments of another mesh": (
        top("segments.json"),
        "segIndices",
        [0, 1],
        ("segments.json", "segIndices", "2", "12"),
    ),
    "segments are a string": (
        top("segments.json"),
        "segIndices",
        "0",
        ("segments.json", "segIndices", "list of whole"),
    ),
    "group of vertices not there": (group, "segments", [12], ("segments_anno.json", "office chair", "segments", "12")),
    "group is a string": (group, "segments", "all", ("segments_anno.json", "office chair", "segments", "'all'")),
    "groups are missing": (top("segments_anno.json"), "segGroups", REMOVED, ("segments_anno.json", "segGroups")),
}


@pytest.mark.parametrize("case", WRONG_VALUES)
def test_a_wrong_value_is_refused(tmp_path, case):
    find, key, value, words = WRONG_VALUES[case]
    files = tiny_scan.contents()
    record = find(files)
    if value is REMOVED:
        del record[key]
    else:
        record[key] = value
    assert_refused(tiny_scan.write(tmp_path / "scan", files), *words)


def test_parts_that_stand_on_each_other_are_refused(tmp_path):
    files = tiny_scan.contents()
    files[ARTIC]["data"]["articulations"].append(joint(files) | {"pid": 5, "base": [3]})
    joint(files)["base"] = [1, 5]
    assert_refused(tiny_scan.write(tmp_path / "scan", files), ARTIC, "base", "cycle", "3 'door.1.2'", "5 'handle")


def test_a_group_of_an_unknown_segment_is_refused(tmp_path):
    files = tiny_scan.contents()
    files["segments.json"]["segIndices"] = [100] * 12
    group(files)["segments"] = [101]
    files["segments_anno.json"]["segGroups"][0]["segments"] = [100]
    assert_refused(tiny_scan.write(tmp_path / "scan", files), "segments_anno.json", "office chair", "segments", "101")


@pytest.mark.parametrize("name", [PARTS, ARTIC, "segments.json", "segments_anno.json"])
@pytest.mark.parametrize("damage", ["truncated", "empty", "a list", "not text"])
def test_a_damaged_json_file_is_refused(tmp_path, name, damage):
    file = tiny_scan.write(tmp_path / "scan") / name
    whole = file.read_bytes()
    file.write_bytes({"truncated": whole[:-20], "empty": b"", "a list": b"[1]", "not text": b'{"\xff\xfe": 1}'}[damage])
    assert_refused(file.parent, name, "object" if damage == "a list" else "download")


def test_endlessly_nested_json_is_refused(tmp_path):
    file = tiny_scan.write(tmp_path / "scan") / ARTIC
    file.write_text("[" * 100_000)
    assert_refused(file.parent, ARTIC)


def test_a_folder_that_does_not_exist_is_refused(tmp_path):
    assert_refused(tmp_path / "scam", "scam", "does not exist", "folder of one scan")


def test_a_file_in_place_of_the_folder_is_refused(tmp_path):
    assert_refused(tiny_scan.write(tmp_path / "scan") / PARTS, PARTS, "is a file", "folder")


def test_an_empty_folder_is_refused(tmp_path):
    (tmp_path / "scan").mkdir()
    assert_refused(tmp_path / "scan", "scan", "_parts.json is missing", "found: nothing")


def test_a_folder_of_scans_is_refused_with_their_names(tmp_path):
    tiny_scan.write(tmp_path / "scans" / "kitchen")
    tiny_scan.write(tmp_path / "scans" / "office")
    assert_refused(tmp_path / "scans", "subfolders", "kitchen, office")


def test_several_scans_in_a_folder_are_refused(tmp_path):
    folder = tiny_scan.write(tmp_path / "scan")
    shutil.copy(folder / PARTS, folder / "ffffffffff_parts.json")
    assert_refused(folder, "2 scans", PARTS, "ffffffffff_parts.json")


@pytest.mark.parametrize("name", [PARTS, ARTIC, PLY, "segments.json", "segments_anno.json"])
def test_a_missing_file_is_named(tmp_path, name):
    folder = tiny_scan.write(tmp_path / "scan")
    (folder / name).unlink()
    assert_refused(folder, name.replace(tiny_scan.NAME, "<scene>") if name == PARTS else name, "missing")


def test_the_articulations_of_another_scan_are_not_taken(tmp_path):
    folder = tiny_scan.write(tmp_path / "scan")
    (folder / ARTIC).rename(folder / "ffffffffff_artic.json")
    assert_refused(folder, ARTIC, "missing")


def test_exporting_damaged_scans_exits_with_2_in_one_line_and_leaves_earlier_outputs_alone(
    tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)  # the command line sets it
    good, bad, out = tiny_scan.write(tmp_path / "good"), tmp_path / "bad", tmp_path / "out"
    assert main(["export", f"scan={good}", f"out={out}"]) == 0
    earlier = {file.name: file.read_bytes() for file in out.iterdir()}
    assert earlier
    capsys.readouterr()
    assert_export_refused(tiny_scan.write(bad, mesh=tiny_scan.ply()[:-5]), out, capsys)
    for find, key, value, _ in WRONG_VALUES.values():
        files = tiny_scan.contents()
        find(files)[key] = None if value is REMOVED else value
        assert_export_refused(tiny_scan.write(bad, files), out, capsys)
    assert_export_refused(tmp_path / "nowhere", tmp_path / "new", capsys)
    assert {file.name: file.read_bytes() for file in out.iterdir()} == earlier
    assert not (tmp_path / "new").exists()


def assert_export_refused(folder: Path, out: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Check that `s2a export` of a folder exits with 2 and says why in one line."""
    assert main(["export", f"scan={folder}", f"out={out}"]) == 2
    printed = capsys.readouterr()
    assert printed.out == "" and printed.err.count("\n") == 1 and str(folder) in printed.err, printed.err
