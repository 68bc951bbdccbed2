"""A scan's triangle mesh, read from PLY in double precision and checked."""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from s2a.core.color_space import fractions
from s2a.core.errors import InputError
from s2a.scan import ply_file
from s2a.scan.ply_file import Element, Lists

_log = logging.getLogger(__name__)

_MAX_SPAN = 1000.0  # [m]; beyond any room, so another unit or a damaged number
_SUSPICIOUS_SPAN = 60.0  # [m]; beyond the rooms that anybody scanned (ten metres), though there are halls
_COLORS: tuple[tuple[str, ...], ...] = (
    ("red", "green", "blue"),
    ("r", "g", "b"),
    ("diffuse_red", "diffuse_green", "diffuse_blue"),
    ("gray",) * 3,
    ("grey",) * 3,
)
_FLOAT32_RANGE = 100.0  # [m]; from here on float32 rounds coordinates by 8 um or more


@dataclass(frozen=True)
class ScanMesh:
    """The mesh of a whole scan, vertices and faces in the order of the file, which the annotations count in."""

    path: Path  # the file it came from
    vertices: np.ndarray  # [m], shape [vertex 3], float64
    faces: np.ndarray  # vertex indices, shape [face 3], int32
    colors: np.ndarray | None  # RGB, shape [vertex 3], uint8, or None
    # translation [m], shape [3], float64, already taken off the vertices; 0 for a scan near its zero
    origin: np.ndarray
    # the whole numbers that the file gives each face, by property, shape [face], int64; those asked for
    face_numbers: Mapping[str, np.ndarray] = field(default_factory=dict)


def read(path: Path, face_numbers: tuple[str, ...] = ()) -> ScanMesh:
    """Read a triangle mesh from a PLY file: ASCII or binary, float or double; properties not asked for are ignored.

    A mesh that reaches further than 100 m from zero is moved, in float64, so that its smallest corner becomes zero. One that
    spans more than 60 m is taken as it is, and a warning is logged.

    `face_numbers`: properties of the faces that hold whole numbers and that the caller needs.

    Raises:
        InputError: the file is truncated or no PLY, holds no triangles or also other polygons, coordinates are not
            finite or span more than 1 km, a face names a vertex that does not exist, or faces lack a property.
    """
    elements = ply_file.read(path).elements
    vertex, face = elements.get("vertex"), elements.get("face")
    if vertex is None or face is None or not vertex.count or not face.count or not set("xyz") <= set(vertex.columns):
        raise InputError(f"{path}: holds no triangles; take the scan's mesh (mesh_aligned_0.05.ply), not a point cloud")
    lists = corner_lists(face)
    if lists is None or (lists.counts != 3).any():
        raise InputError(f"{path}: has faces that are no triangles, which annotations count; take the annotated mesh")
    vertices, faces = coordinates(vertex), lists.values.astype(np.int64).reshape(-1, 3)
    _check_numbers(path, vertices, faces)
    far = np.abs(vertices).max() > _FLOAT32_RANGE
    origin = vertices.min(axis=0) if far else np.zeros(3)
    given = color_levels(path, vertex)
    colors = None if given is None else np.round(given).astype(np.uint8)
    numbers = {name: _face_numbers(path, face, name) for name in face_numbers}
    return ScanMesh(path, vertices - origin, faces.astype(np.int32), colors, origin, numbers)


def coordinates(vertex: Element) -> np.ndarray:
    """Return the positions of vertices, shape [vertex 3], float64."""
    return np.stack([vertex.columns[axis].astype(np.float64) for axis in "xyz"], axis=1)


def corner_lists(face: Element) -> Lists | None:
    """Return the vertices of faces; None where no property lists them."""
    names = ["vertex_indices", "vertex_index", *face.lists]
    lists = next((face.lists[name] for name in names if name in face.lists), None)
    if lists is None or lists.values.dtype.kind in "iu":
        return lists
    whole = np.isfinite(lists.values).all() and (lists.values % 1 == 0).all()
    return Lists(lists.counts, lists.values.astype(np.int64)) if whole else None


def color_levels(path: Path, element: Element) -> np.ndarray | None:
    """Return the colours of vertices or faces as sRGB levels, 0 to 255, float64, shape [row 3]; None where there are none.

    Raises:
        InputError: numbers that are no colours.
    """
    names = next((names for names in _COLORS if set(names) <= set(element.columns)), None)
    if names is None:
        return None
    kinds = {element.columns[name].dtype for name in names}
    raw = np.stack([element.columns[name] for name in names], axis=1)
    kind, largest = raw.dtype, raw.max(initial=0)
    if kinds == {np.dtype(np.uint8)}:
        return raw.astype(np.float64)
    if len(kinds) == 1 and kind.itemsize > 1 and np.isfinite(raw).all() and raw.min(initial=0) >= 0:
        values = raw.astype(np.float64)
        if kind.kind == "f" and largest <= 255:
            return fractions(values) * 255
        if largest <= 255:
            _log.warning("%s: colours of type %s reach %d, and are taken for levels of 255", path, kind, largest)
            return values
        if kind.itemsize == 2:
            return values * (255 / np.iinfo(kind).max)
    raise InputError(
        f"{path}: vertex colors are {', '.join(map(str, kinds))} up to {largest:g}; possible: uchar, ushort, float 0 to 1"
    )


def _face_numbers(path: Path, face: Element, name: str) -> np.ndarray:
    """Return a property of the faces as whole numbers, shape [face], int64."""
    columns = {key.lower(): column for key, column in face.columns.items()}
    if name.lower() not in columns:
        present = ", ".join([*face.lists, *columns])
        raise InputError(f"{path}: faces have no {name}; properties found: {present}; take the annotated mesh")
    values = columns[name.lower()]
    if values.dtype.kind not in "iu":
        raise InputError(
            f"{path}: {name} of the faces is not one whole number each (ushort, int ...); take the scan's own"
        )
    return values.astype(np.int64)


def _check_numbers(path: Path, vertices: np.ndarray, faces: np.ndarray) -> None:
    """Raise an InputError if a coordinate or a vertex index cannot be right."""
    bad = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if len(bad):
        raise InputError(
            f"{path}: vertex {bad[0]} is {vertices[bad[0]].tolist()}, not finite ({len(bad)} such); download it again"
        )
    span = np.ptp(vertices, axis=0).max()
    if span > _MAX_SPAN:
        raise InputError(
            f"{path}: vertices span {span:.6g} m; is it in millimetres, or damaged? metres of one room are expected"
        )
    if span > _SUSPICIOUS_SPAN:
        _log.warning("%s: spans %.6g m; is it in centimetres or millimetres? metres are expected", path, span)
    if not 0 <= faces.min() <= faces.max() < len(vertices):
        raise InputError(
            f"{path}: faces name vertices {faces.min()} to {faces.max()} of {len(vertices)}; take an undamaged file"
        )
