"""A scan's triangle mesh, read from PLY in double precision and checked."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from s2a.core.errors import InputError

_log = logging.getLogger(__name__)

_MAX_SPAN = 1000.0  # [m]; beyond any room, so another unit or a damaged number
_SUSPICIOUS_SPAN = 60.0  # [m]; beyond the rooms that anybody scanned (ten metres), though there are halls
_FLOAT32_RANGE = 100.0  # [m]; from here on float32 rounds coordinates by 8 um or more


@dataclass(frozen=True)
class ScanMesh:
    """The mesh of a whole scan, vertices and faces in the order of the file, which the annotations count in.

    Attributes:
        path: the file it came from.
        vertices: [m], shape [vertex 3], float64.
        faces: vertex indices, shape [face 3], int32.
        colors: RGB, shape [vertex 3], uint8, or None.
        origin: translation [m], shape [3], float64, already taken off the vertices; 0 for a scan near its zero.
        face_numbers: the whole numbers that the file gives each face, by property, shape [face], int64; those asked for.
    """

    path: Path
    vertices: np.ndarray
    faces: np.ndarray
    colors: np.ndarray | None
    origin: np.ndarray
    face_numbers: Mapping[str, np.ndarray] = field(default_factory=dict)


def read(path: Path, face_numbers: tuple[str, ...] = ()) -> ScanMesh:
    """Read a triangle mesh from a PLY file: ASCII or binary, float or double; properties not asked for are ignored.

    A mesh that reaches further than 100 m from zero is moved, in float64, so that its smallest corner becomes zero. One that
    spans more than 60 m is taken as it is, and a warning is logged.

    Args:
        path: the file.
        face_numbers: properties of the faces that hold whole numbers and that the caller needs.

    Raises:
        InputError: the file is truncated or no PLY, holds no triangles or also other polygons, coordinates are not
            finite or span more than 1 km, a face names a vertex that does not exist, or faces lack a property.
    """
    content, elements = _load(path)
    vertices = content["vertices"].astype(np.float64)
    faces = _triangles(path, content["faces"], elements)
    _check_numbers(path, vertices, faces)
    far = np.abs(vertices).max() > _FLOAT32_RANGE
    origin = vertices.min(axis=0) if far else np.zeros(3)
    colors = _colors(path, content.get("vertex_colors"))
    numbers = {name: _face_numbers(path, elements["face"]["data"], name, len(faces)) for name in face_numbers}
    return ScanMesh(path, vertices - origin, faces.astype(np.int32), colors, origin, numbers)


def _load(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what the file holds as trimesh's arguments, and its raw elements by name."""
    from trimesh.exchange.ply import load_ply  # brings scipy: half of what starting `s2a view` of a stage would cost

    try:
        with path.open("rb") as file:
            # fix_texture would reorder vertices that have texture coordinates; annotations count in the file's order.
            content = load_ply(file, fix_texture=False, skip_materials=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path and its permissions") from error
    except Exception as error:  # trimesh lets through what damage provokes: ValueError, IndexError, KeyError ...
        raise InputError(f"{path}: truncated or not a PLY mesh ({_brief(error)}); copy or download it again") from error
    elements = content["metadata"]["_ply_raw"]
    if content.get("vertices") is None or content.get("faces") is None:
        raise InputError(f"{path}: holds no triangles; take the scan's mesh (mesh_aligned_0.05.ply), not a point cloud")
    if len(content["vertices"]) != elements["vertex"]["length"]:
        expected = elements["vertex"]["length"]
        raise InputError(f"{path}: truncated, {len(content['vertices'])} of {expected} vertices; download it again")
    return content, elements


def _triangles(path: Path, faces: np.ndarray, elements: dict[str, Any]) -> np.ndarray:
    """Return the faces [face 3] if they are all triangles and as many as the header says."""
    expected = elements["face"]["length"]
    if faces.ndim != 2 or faces.shape[1] != 3 or not _all_triangles(elements["face"]["data"]):
        raise InputError(f"{path}: has faces that are no triangles, which annotations count; take the annotated mesh")
    if len(faces) != expected:
        raise InputError(f"{path}: truncated or mixed polygons, {len(faces)} of {expected} faces; download it again")
    return faces


def _all_triangles(data: Any) -> bool:
    """Return True if every vertex list of a binary file has three entries (trimesh reads the first list's length only)."""
    if not isinstance(data, np.ndarray):  # an ASCII file, split by trimesh row by row
        return True
    lists = [data[name]["f0"] for name in data.dtype.names or () if name in ("vertex_index", "vertex_indices")]
    return all(bool((lengths == 3).all()) for lengths in lists)


def _face_numbers(path: Path, data: Any, name: str, count: int) -> np.ndarray:
    """Return a property of the faces as whole numbers, shape [face], int64."""
    known = list(data) if isinstance(data, dict) else list(data.dtype.names or ())
    if name not in known:
        raise InputError(f"{path}: faces have no {name}; properties found: {', '.join(known)}; take the annotated mesh")
    values = np.ravel(data[name])
    if values.dtype.kind not in "iu" or len(values) != count:
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


def _colors(path: Path, colors: np.ndarray | None) -> np.ndarray | None:
    """Return colors as RGB bytes [vertex 3] from bytes or from floats between 0 and 1; alpha is dropped."""
    if colors is None or colors.dtype == np.uint8:
        return None if colors is None else colors[:, :3]
    if colors.dtype.kind == "f" and np.isfinite(colors).all():
        return np.round(np.clip(colors[:, :3], 0, 1) * 255).astype(np.uint8)
    raise InputError(f"{path}: vertex colors are {colors.dtype}; possible: uchar 0 to 255, float 0 to 1")


def _brief(error: Exception) -> str:
    """Return an exception's message on one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:120]
