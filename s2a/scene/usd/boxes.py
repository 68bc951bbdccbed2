"""Upright boxes around points: the shape of a part in the descriptive flavour."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from s2a.scene.scene import Vec3
from s2a.scene.usd.hull import hull

WORTH_TURNING = 0.98
"""Largest footprint of a turned box as a fraction of the axis-aligned one: round objects need no direction."""


@dataclass(frozen=True)
class Box:
    """A box that stands upright.

    Attributes:
        center: [m], scene coordinates.
        size: length of its sides [m]; the third is vertical.
        yaw: rotation of its first side about z from the scene's x axis [rad], in -pi/4 to pi/4.
    """

    center: Vec3
    size: Vec3
    yaw: float


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
