"""USD's geometry as polygons: meshes, cubes, planes, and what turns about an axis: spheres, cylinders, cones, capsules."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom

AROUND, ALONG = 32, 16
"""Sides of round shapes, and rings from pole to pole of a sphere."""
_AXES = {"X": [2, 0, 1], "Y": [1, 2, 0], "Z": [0, 1, 2]}


@dataclass(frozen=True)
class Polygons:
    """Polygons in a prim's own frame.

    Attributes:
        points: shape [vertex 3], float64.
        counts: corners of each polygon, shape [polygon], int64.
        indices: vertices of the corners, one polygon after the other, int64.
        number: of each polygon among those that the prim has, shape [polygon]; holes are left out.
        left_handed: The polygons are wound clockwise.
    """

    points: np.ndarray
    counts: np.ndarray
    indices: np.ndarray
    number: np.ndarray
    left_handed: bool = False


def polygons(prim: Usd.Prim, time: Usd.TimeCode) -> Polygons | None:
    """Return the polygons of a prim; None for a kind that has none here, such as curves and points.

    Raises:
        ValueError: a mesh whose faces name vertices that do not exist.
    """
    if prim.IsA(UsdGeom.Mesh):
        return _mesh(UsdGeom.Mesh(prim), time)
    if prim.IsA(UsdGeom.Cube):
        half = float(UsdGeom.Cube(prim).GetSizeAttr().Get(time)) / 2
        corners = half * np.array([(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], dtype=np.float64)
        return _shape(corners, [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (1, 3, 7, 5), (3, 2, 6, 7), (2, 0, 4, 6)])
    if prim.IsA(UsdGeom.Plane):
        plane = UsdGeom.Plane(prim)
        x, y = float(plane.GetWidthAttr().Get(time)) / 2, float(plane.GetLengthAttr().Get(time)) / 2
        flat = np.array([(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)])
        return _shape(flat[:, _AXES[str(plane.GetAxisAttr().Get(time))]], [(0, 1, 2, 3)])
    outline = _outline(prim, time)
    if outline is None:
        return None
    axis = prim.GetAttribute("axis").Get(time) if prim.GetAttribute("axis") else "Z"
    return _turned(np.array(outline), _AXES[str(axis)])


def _mesh(mesh: UsdGeom.Mesh, time: Usd.TimeCode) -> Polygons:
    points = np.array(mesh.GetPointsAttr().Get(time) or [], dtype=np.float64).reshape(-1, 3)
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get(time) or [], dtype=np.int64)
    indices = np.array(mesh.GetFaceVertexIndicesAttr().Get(time) or [], dtype=np.int64)
    if (counts < 0).any() or counts.sum() != len(indices):
        raise ValueError(f"its faces have {counts.sum()} corners, and {len(indices)} are listed")
    if len(indices) and not 0 <= indices.min() <= indices.max() < len(points):
        raise ValueError("its faces name vertices which do not exist")
    holes = np.array(mesh.GetHoleIndicesAttr().Get(time) or [], dtype=np.int64)
    shown = ~np.isin(np.arange(len(counts)), holes)
    left = mesh.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded
    kept = np.repeat(shown, counts)
    return Polygons(points, counts[shown], indices[kept], np.flatnonzero(shown), left)


def _shape(points: np.ndarray, faces: list[tuple[int, ...]]) -> Polygons:
    counts = np.array([len(face) for face in faces])
    return Polygons(points, counts, np.array([i for face in faces for i in face]), np.arange(len(faces)))


def _outline(prim: Usd.Prim, time: Usd.TimeCode) -> list[tuple[float, float]] | None:
    """Return half of a round shape's outline, (radius, height) from below; None for a prim that is no round shape."""

    def value(name: str) -> float:
        return float(prim.GetAttribute(name).Get(time))

    kind = str(prim.GetTypeName())
    quarter = np.linspace(0, np.pi / 2, ALONG // 2 + 1)
    if kind == "Sphere":
        r = value("radius")
        return [(r * np.sin(a), -r * np.cos(a)) for a in np.linspace(0, np.pi, ALONG + 1)]
    if kind not in ("Cylinder", "Cylinder_1", "Cone", "Capsule", "Capsule_1"):
        return None
    half = value("height") / 2
    low, high = (value("radiusBottom"), value("radiusTop")) if kind.endswith("_1") else 2 * (value("radius"),)
    if kind == "Cone":
        return [(0.0, -half), (low, -half), (0.0, half)]
    if kind.startswith("Cylinder"):
        return [(0.0, -half), (low, -half), (high, half), (0.0, half)]
    below = [(low * np.sin(a), -half - low * np.cos(a)) for a in quarter]
    return below + [(high * np.cos(a), half + high * np.sin(a)) for a in quarter]


def _turned(outline: np.ndarray, axes: list[int]) -> Polygons:
    """Return an outline [ring 2] turned about an axis, its ends closed to points."""
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    radius, height = outline[:, 0], outline[:, 1]
    rings = np.stack(
        np.broadcast_arrays(np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle)), height[:, None]), axis=2
    )
    number = np.arange(len(outline) * AROUND).reshape(len(outline), AROUND)
    number[0], number[-1] = number[0, 0], number[-1, 0]
    faces: list[Any] = []
    for below, above in zip(number[:-1], number[1:], strict=True):
        quads = np.stack([below, np.roll(below, -1), np.roll(above, -1), above], axis=1).tolist()
        faces += [tuple(dict.fromkeys(quad)) for quad in quads]
    return _shape(rings.reshape(-1, 3)[:, axes], [face for face in faces if len(face) > 2])
