"""Convex hull of points in the plane, with NumPy alone: SciPy would double the size of the base installation."""

from __future__ import annotations

import numpy as np

DIRECTIONS = 32
"""Directions whose extreme points discard most of the others before the hull is built (Akl and Toussaint, 1978)."""
FLAT = 1e-12
"""Turns of less than this fraction of the squared extent are straight: rounding of collinear points."""


def hull(points: np.ndarray) -> np.ndarray | None:
    """Return the convex hull of points [n 2] as indices, counterclockwise; None if all points lie on one line."""
    if len(points) < 3:
        return None
    points = points.astype(np.float64)
    candidates = _outside_inner_polygon(points)
    order = candidates[np.lexsort((points[candidates, 1], points[candidates, 0]))]
    tolerance = FLAT * float(np.square(np.ptp(points, axis=0)).sum())
    lower, upper = _chain(points, order, tolerance), _chain(points, order[::-1], tolerance)
    outline = np.array([*lower[:-1], *upper[:-1]])
    return outline if len(outline) > 2 else None


def _outside_inner_polygon(points: np.ndarray) -> np.ndarray:
    """Return the indices of the points that are not strictly inside the polygon of the extreme points."""
    angles = np.arange(DIRECTIONS) * (2.0 * np.pi / DIRECTIONS)
    extremes = np.stack([(points @ np.array([np.cos(a), np.sin(a)])).argmax() for a in angles])
    corners = points[list(dict.fromkeys(extremes.tolist()))]
    inner = np.ones(len(points), bool)
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        (dx, dy), (x, y) = end - start, (points - start).T
        inner &= dx * y - dy * x > 0.0
    return np.flatnonzero(~inner)


def _chain(points: np.ndarray, order: np.ndarray, tolerance: float) -> list[int]:
    """Return one half of the hull of points in lexicographic order (Andrew's monotone chain), both ends included."""
    chain: list[int] = []
    coordinates = points[order].tolist()
    kept: list[list[float]] = []
    for index, (x, y) in zip(order.tolist(), coordinates, strict=True):
        while len(chain) > 1 and _turn(kept[-2], kept[-1], x, y) <= tolerance:
            chain.pop()
            kept.pop()
        chain.append(index)
        kept.append([x, y])
    return chain


def _turn(a: list[float], b: list[float], x: float, y: float) -> float:
    """Return twice the signed area of the triangle a, b, (x, y): positive where the path turns left."""
    return (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])
