"""The annotated parts of an Articulate3D scan: their labels, their faces, and which of them owns a face."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from s2a.scan import fields
from s2a.scan.fields import Record
from s2a.scan.ply import ScanMesh
from s2a.scene.scene import MAX_MASS

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class AnnotatedPart:
    """One annotated part.

    Attributes:
        label: name and index path as annotated ("handle base.1.2.1").
        faces: indices into the scan's faces, shape [n], int64; may be empty.
        mass: [kg], or None where it is not annotated.
    """

    label: str
    faces: np.ndarray
    mass: float | None


def read(path: Path, surface: ScanMesh) -> dict[int, AnnotatedPart]:
    """Read the parts of a scan from its `_parts.json`, by number, in the order of the file.

    Raises:
        InputError: the file was made for another mesh, two parts share a number, an index is out of range, wrong types.
    """
    data = fields.load(path).record("data")
    _check_mesh(data, surface)
    found: dict[int, AnnotatedPart] = {}
    for record in data.records("annotations", "annotation"):
        number, label = record.integer("partId"), record.text("label")
        named = Record(record.values, f"{path}, part {number} {label!r}")
        if number in found:
            named.refuse("partId", f"part {found[number].label!r} has it already; every part needs a number of its own")
        found[number] = AnnotatedPart(label, _faces(named, surface), _mass(named))
        if not len(found[number].faces):
            _log.warning("%s has no faces; kept as an empty part", named.where)
    return found


def owners(parts: Mapping[int, AnnotatedPart], depth: Mapping[int, int], face_count: int) -> np.ndarray:
    """Return for each face the position of the part that owns it, or -1, shape [face], int32.

    Where several parts list a face, the deepest wins (a handle's faces may be listed with its door's), then the last.
    """
    owner = np.full(face_count, -1, dtype=np.int32)
    for position, number in sorted(enumerate(parts), key=lambda item: depth[item[1]]):
        owner[parts[number].faces] = position
    return owner


def _check_mesh(data: Record, surface: ScanMesh) -> None:
    """Raise an InputError if the parts were annotated on another mesh, as far as its statistics tell."""
    if not data.has("stats"):
        return
    stats = data.record("stats")
    for key, count in (("totalFaces", len(surface.faces)), ("totalVertices", len(surface.vertices))):
        if stats.has(key) and stats.values[key] != count:
            stats.refuse(key, f"{surface.path} has {count}; take the mesh that was annotated")


def _faces(record: Record, surface: ScanMesh) -> np.ndarray:
    """Return the faces of a part: those listed, or where none are, those whose three vertices are all listed."""
    vertices = np.empty(0, dtype=np.int64)
    if record.has("vertIndices"):
        vertices = record.indices("vertIndices", len(surface.vertices), "vertices")
    if record.has("triIndices") or not record.has("vertIndices"):
        faces = record.indices("triIndices", len(surface.faces), "faces")
        if len(faces) or not len(vertices):
            return faces
    inside = np.zeros(len(surface.vertices), dtype=bool)
    inside[vertices] = True
    return np.flatnonzero(inside[surface.faces].all(axis=1))


def _mass(record: Record) -> float | None:
    """Return a part's mass [kg], or None where it is not annotated."""
    if not record.has("mass"):
        return None
    mass = record.number("mass")
    if not 0 < mass <= MAX_MASS:
        record.refuse(
            "mass", f"kilograms above 0, up to {MAX_MASS:g}, belong here; leave the key out where it is unknown"
        )
    return mass
