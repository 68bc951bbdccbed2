"""Faces that several parts of an Articulate3D annotation list: the reader gives them to the deepest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from s2a.scan import fields, folder, labels


@dataclass(frozen=True)
class Overlap:
    """Faces that two parts list of which neither belongs to the other.

    Attributes:
        parts: their ids.
        faces: number of faces that both list.
        fraction: the same, as a fraction of the smaller part's faces.
    """

    parts: tuple[str, str]
    faces: int
    fraction: float


def read(path: Path) -> list[Overlap]:
    """Return the overlaps of the scan in a folder, most faces first; none for a scan of another format.

    Raises:
        InputError: the folder holds a damaged annotation.
    """
    if not folder.is_articulate3d(path):
        return []
    records = fields.load(folder.find(path).parts).record("data").records("annotations", "annotation")
    names = {record.integer("partId"): record.text("label") for record in records}
    # Artefacts and parts that could not be annotated are no parts of the scene.
    names = {number: name for number, name in names.items() if not (labels.is_removed(name) or labels.is_split(name))}
    listed = {
        record.integer("partId"): np.unique(record.integers("triIndices"))
        for record in records
        if record.has("triIndices") and record.integer("partId") in names
    }
    return find(names, listed)


def find(names: Mapping[int, str], listed: Mapping[int, np.ndarray]) -> list[Overlap]:
    """Return the overlaps of parts, most faces first.

    Args:
        names: label of every part by its number.
        listed: its faces, each once, shape [n], integers.
    """
    parent_of = labels.parents(names)
    numbers = np.repeat(list(listed), [len(faces) for faces in listed.values()])
    faces = np.concatenate([*listed.values(), np.empty(0, np.int64)])
    order = np.argsort(faces, kind="stable")
    faces, numbers = faces[order], numbers[order]
    counts: dict[tuple[int, int], int] = {}
    for ahead in range(1, len(listed)):
        same = faces[ahead:] == faces[:-ahead]
        if not same.any():
            break
        pairs = np.sort(np.stack([numbers[:-ahead][same], numbers[ahead:][same]], axis=1), axis=1)
        for (a, b), count in zip(*np.unique(pairs, axis=0, return_counts=True), strict=True):
            counts[int(a), int(b)] = counts.get((int(a), int(b)), 0) + int(count)
    ids = {number: labels.part_id(labels.split(name)[0], number) for number, name in names.items()}
    found = [
        Overlap((ids[a], ids[b]), count, count / min(len(listed[a]), len(listed[b])))
        for (a, b), count in counts.items()
        if not (_above(a, b, parent_of) or _above(b, a, parent_of))
    ]
    return sorted(found, key=lambda overlap: -overlap.faces)


def _above(upper: int, lower: int, parent_of: Mapping[int, int | None]) -> bool:
    """Return True if a part is an ancestor of another."""
    parent = parent_of[lower]
    while parent is not None and parent != upper:
        parent = parent_of[parent]
    return parent == upper
