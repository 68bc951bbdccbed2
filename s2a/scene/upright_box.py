"""Upright box of smallest footprint around points."""

import math
from dataclasses import dataclass

import numpy as np

from s2a.scene.scene import Vec3

# Directions whose extreme points discard most of the others before the hull is built (Akl and Toussaint, 1978): few for many
# points, more for those left
DIRECTIONS = (8, 32)
FLAT = 1e-12  # Turns of less than this fraction of the squared extent are straight: rounding of collinear points


def hull(points: np.ndarray) -> np.ndarray | None:
    """Return the convex hull of points [n 2] as indices, counterclockwise; None if all points lie on one line."""
    if len(points) < 3:
        return None
    points = points.astype(np.float64)
    candidates = np.arange(len(points))
    for directions in DIRECTIONS:
        x, y = points[candidates].T.copy()
        candidates = candidates[_outside_inner_polygon(x, y, directions)]
    order = candidates[np.lexsort((points[candidates, 1], points[candidates, 0]))]
    tolerance = FLAT * float(np.square(np.ptp(points, axis=0)).sum())
    lower, upper = _chain(points, order, tolerance), _chain(points, order[::-1], tolerance)
    outline = np.array([*lower[:-1], *upper[:-1]])
    return outline if len(outline) > 2 else None


def _outside_inner_polygon(x: np.ndarray, y: np.ndarray, directions: int) -> np.ndarray:
    """Return the indices of the points, of their coordinates [n] each, not strictly inside the polygon of the extreme ones."""
    angles = np.arange(directions) * (2.0 * np.pi / directions)
    extremes = list(dict.fromkeys(int((np.cos(a) * x + np.sin(a) * y).argmax()) for a in angles))
    inner = np.ones(len(x), bool)
    for start, end in zip(extremes, [*extremes[1:], extremes[0]], strict=True):
        inner &= (x[end] - x[start]) * (y - y[start]) - (y[end] - y[start]) * (x - x[start]) > 0.0
    return np.flatnonzero(~inner)


def _chain(points: np.ndarray, order: np.ndarray, tolerance: float) -> list[int]:
    """Return one half of the hull of points in lexicographic order (Andrew's monotone chain), both ends included."""
    chain: list[int] = []
    coordinates = points[order].tolist()
    corners: list[list[float]] = []
    for index, (x, y) in zip(order.tolist(), coordinates, strict=True):
        while len(chain) > 1 and _cross(corners[-2], corners[-1], x, y) <= tolerance:
            chain.pop()
            corners.pop()
        chain.append(index)
        corners.append([x, y])
    return chain


def _cross(a: list[float], b: list[float], x: float, y: float) -> float:
    """Return twice the signed area of the triangle a, b, (x, y): positive where the path turns left."""
    return (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])


# Largest footprint of a turned box as a fraction of the axis-aligned one: round objects need no direction
WORTH_TURNING = 0.98


@dataclass(frozen=True)
class Box:
    """A box that stands upright."""

    center: Vec3  # [m], scene coordinates
    size: Vec3  # length of its sides [m]; the third is vertical
    yaw: float  # rotation of its first side about z from the scene's x axis [rad], in -pi/4 to pi/4


def upright_box(points: np.ndarray) -> Box:
    """Return the upright box of smallest footprint around points [n 3] (m; n at least 1)."""
    low, high = points.min(axis=0).astype(float), points.max(axis=0).astype(float)
    yaw = _best_yaw(points[:, :2], footprint=float(np.prod((high - low)[:2])))
    if yaw != 0.0:
        turned = points[:, :2].astype(float) @ _turn(-yaw).T
        low[:2], high[:2] = turned.min(axis=0), turned.max(axis=0)
    middle = 0.5 * (low + high)
    middle[:2] = _turn(yaw) @ middle[:2]
    return Box(tuple(middle.tolist()), tuple((high - low).tolist()), yaw)


def silhouette(points: np.ndarray) -> np.ndarray:
    """Return the points, of those given [n 3], that their upright box depends on: hull from above, lowest, highest.

    The box of several parts follows from their few silhouettes, instead of their many points.
    """
    outline = hull(points[:, :2])
    return points if outline is None else points[[*outline, points[:, 2].argmin(), points[:, 2].argmax()]]


def _best_yaw(points: np.ndarray, footprint: float) -> float:
    """Return the yaw of the smallest rectangle around points [n 2]; 0 if none is clearly smaller than the footprint.

    One side of the smallest rectangle lies along an edge of the convex hull (Freeman and Shapira, 1975).
    """
    corners = hull(points)
    if corners is None:
        return 0.0
    outline = points[corners].astype(float)
    edges = np.roll(outline, -1, axis=0) - outline
    quarter = 0.5 * math.pi
    yaws = (np.arctan2(edges[:, 1], edges[:, 0]) + 0.5 * quarter) % quarter - 0.5 * quarter
    areas = [float(np.prod(np.ptp(outline @ _turn(-yaw).T, axis=0))) for yaw in yaws]
    best = int(np.argmin(areas))
    return float(yaws[best]) if areas[best] <= WORTH_TURNING * footprint else 0.0


def _turn(angle: float) -> np.ndarray:
    """Rotation of the plane by an angle [rad], shape [2 2]."""
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
