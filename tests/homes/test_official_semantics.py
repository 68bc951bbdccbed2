"""What moves in the files of every room, and what a hand takes hold of: as the data set's own loader says.

The loader's rules, written down again here without our reader: a part is movable if the articulations name it; its
interactables are those of its descendants by label ("door.1.2" is below "frame.1") that lie deepest; a later record of a
part replaces an earlier.
"""

from __future__ import annotations

import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from few import few
from settings import load

from s2a import scan
from s2a.homes import files
from s2a.homes.capture import AnnotationConfig, annotated_joints
from s2a.homes.furnishing import HOMES, home
from s2a.homes.room import Entry, cad, catalog, clean_scene
from s2a.scan.ply_file import write_ply
from s2a.scene.scene import Joint, Mesh, Scene

NAME = "0123456789"


def by_the_loader(folder: Path) -> dict[int, dict[str, Any]]:
    """Return type, range and interactables of each movable part, by its number."""
    parts = json.loads((folder / f"{NAME}_parts.json").read_text())["data"]["annotations"]
    records = json.loads((folder / f"{NAME}_artic.json").read_text())["data"]["articulations"]
    path_of = {part["partId"]: part["label"].split(".", 1)[-1] for part in parts}
    found = {}
    for record in records:
        below = {i for i, path in path_of.items() if path.startswith(path_of[record["pid"]] + ".")}
        deepest = max((path_of[i].count(".") for i in below), default=0)
        found[record["pid"]] = {
            "type": record["type"],
            "range": (record["rangeMin"], record["rangeMax"]),
            "interactable": {i for i in below if path_of[i].count(".") == deepest},
        }
    return found


def by_our_reader(scene: Scene) -> dict[int, dict[str, Any]]:
    """Return the same of a Scene; a part without descendants is its own grasp region there, and has no interactables."""
    found = {}
    for part_id in scene.movable:
        joint = scene.joint(part_id)
        found[number(part_id)] = {
            "type": {"revolute": "rotation", "prismatic": "translation"}[joint.kind],
            "range": joint.limits,
            "interactable": {number(i) for i in scene.grasp_parts(part_id) if i != part_id},
        }
    return found


def number(part_id: str) -> int:
    """Return the number at the end of a part's id."""
    return int(part_id.rsplit("_", 1)[1])


def furnished(kind: str, seed: int) -> list[Entry]:
    """Return the parts of a virtual home."""
    return catalog(home(kind, seed).turned(0.3).pieces)


def write(folder: Path, entries: list[Entry], joints: dict[int, Joint]) -> Path:
    """Write the files of a perfect scan: the clean surfaces themselves."""
    surface, numbers = cad(entries)
    labelled = (NAME, surface.mesh, numbers, entries)
    folder.mkdir(parents=True)
    write_ply(folder / "mesh_aligned_0.05.ply", surface.mesh)
    files.write_json(folder / "segments.json", {"segIndices": list(range(len(surface.vertices)))})
    files.write_json(folder / "segments_anno.json", files.segment_groups(*labelled))
    files.write_json(folder / f"{NAME}_parts.json", files.parts_record(*labelled))
    files.write_json(folder / f"{NAME}_artic.json", files.artic_record(NAME, entries, joints))
    return folder


@pytest.mark.parametrize(("kind", "seed"), few([(kind, 3 + i) for i, kind in enumerate(HOMES)], 3))
def test_movables_types_ranges_and_interactables_are_the_loaders(kind: str, seed: int, tmp_path: Path) -> None:
    check_loader(kind, seed, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "seed"), [*itertools.product(HOMES, range(100, 110))])
def test_a_hundred_rooms_are_read_as_by_the_loader(kind: str, seed: int, tmp_path: Path) -> None:
    check_loader(kind, seed, tmp_path)


def check_loader(kind: str, seed: int, tmp_path: Path) -> None:
    """Assert that our reader, the loader's rules and the truth agree on a room's files."""
    entries = furnished(kind, seed)
    joints = annotated_joints(entries, load(AnnotationConfig, "annotator/careful"), np.random.default_rng(seed))
    folder = write(tmp_path / "scan", entries, joints)
    official = by_the_loader(folder)
    assert by_our_reader(scan.read(folder)) == official
    truth = by_our_reader(clean_scene(NAME, entries))
    assert {i: (o["type"], o["interactable"]) for i, o in official.items()} == {
        i: (t["type"], t["interactable"]) for i, t in truth.items()
    }
    for part, facts in official.items():
        lower, upper = truth[part]["range"]
        assert facts["range"][0] == lower
        assert facts["range"][1] == pytest.approx(upper, rel=0.02)
    assert len(official) >= 4
    assert len([entry for entry in entries if entry.parent is None]) >= 15


def test_without_an_annotators_errors_the_ranges_are_the_truths(tmp_path: Path) -> None:
    entries = furnished("office", 0)
    exact = {entry.number: entry.piece.joint for entry in entries if entry.piece.joint is not None}
    found = by_the_loader(write(tmp_path / "scan", entries, exact))
    assert found == by_our_reader(clean_scene(NAME, entries))


def test_a_part_without_its_articulation_does_not_move(tmp_path: Path) -> None:
    entries = furnished("office", 0)
    joints = {entry.number: entry.piece.joint for entry in entries if entry.piece.joint is not None}
    missing, *_ = joints
    folder = write(tmp_path / "scan", entries, joints)
    path = folder / f"{NAME}_artic.json"
    record = json.loads(path.read_text())
    record["data"]["articulations"] = [r for r in record["data"]["articulations"] if r["pid"] != missing]
    path.write_text(json.dumps(record))
    official = by_the_loader(folder)
    assert missing not in official
    assert by_our_reader(scan.read(folder)) == official


def test_the_loaders_own_smallest_example_reads_as_it_says(tmp_path: Path) -> None:
    """A frame, a door in it, a handle base, a handle: the handle alone is interactable."""
    vertices = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], float)
    labels = {1: "door frame.1", 3: "door.1.2", 4: "handle base.1.2.1", 5: "handle.1.2.1.1"}
    mesh = Mesh(np.tile(vertices, (4, 1)), np.arange(12).reshape(4, 3), np.zeros((12, 3)))
    annotations = [
        {"partId": i, "objectId": i, "label": label, "triIndices": [k], "vertIndices": list(range(3 * k, 3 * k + 3))}
        for k, (i, label) in enumerate(labels.items())
    ]
    joint = {"pid": 3, "type": "rotation", "origin": [0, 0, 0], "axis": [0, 0, 1], "base": [1]}
    joint |= {"rangeMin": 0.0, "rangeMax": 1.57}
    write_ply(tmp_path / "mesh_aligned_0.05.ply", mesh)
    stats = {"totalFaces": 4, "totalVertices": 12}
    files.write_json(tmp_path / f"{NAME}_parts.json", {"data": {"stats": stats, "annotations": annotations}})
    files.write_json(tmp_path / f"{NAME}_artic.json", {"data": {"articulations": [joint]}})
    expected = {3: {"type": "rotation", "range": (0.0, 1.57), "interactable": {5}}}
    assert by_the_loader(tmp_path) == expected == by_our_reader(scan.read(tmp_path))
