"""Faces that two unrelated parts list."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import tiny_scan

from s2a.scan.formats import articulate3d
from s2a.scan.formats.articulate3d import Overlap

LABELS = {1: "cabinet.1", 2: "drawer.1.1", 3: "handle.1.1.1", 4: "floor.2", 5: "rug.2.1"}


def test_faces_of_unrelated_parts_are_counted_and_those_of_ancestors_are_not() -> None:
    listed = {1: [0, 1, 2, 3], 2: [2, 3, 4, 5], 3: [4, 5, 0], 4: [5, 6, 7, 2], 5: [7, 5]}
    found = articulate3d.overlaps(LABELS, {number: np.array(faces) for number, faces in listed.items()})
    # Floor and drawer share 2 and 5 (of 4 each); 5 is in the handle and the rug as well, 2 in the cabinet.
    assert found[0] == Overlap(("drawer_2", "floor_4"), 2, 0.5)
    assert sorted((o.parts, o.faces) for o in found[1:]) == [
        (("cabinet_1", "floor_4"), 1),
        (("drawer_2", "rug_5"), 1),
        (("handle_3", "floor_4"), 1),
        (("handle_3", "rug_5"), 1),
    ]


def test_an_overlap_is_read_from_the_files_and_other_formats_have_none(tmp_path: Path) -> None:
    files = tiny_scan.contents()
    files[tiny_scan.PARTS]["data"]["annotations"].append(tiny_scan.annotation(9, "floor.4", [2, 7]))
    assert articulate3d.read_overlaps(tiny_scan.write(tmp_path / "scan", files)) == [
        Overlap(("door_3", "floor_9"), 1, 0.5)
    ]
    (tmp_path / "bare").mkdir()
    assert articulate3d.read_overlaps(tmp_path / "bare") == []
