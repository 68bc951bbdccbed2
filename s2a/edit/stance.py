"""How a thing in a file could stand: along which of its axes it has a foot, and how broad."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from s2a.edit.objects import AXES
from s2a.scene import Mesh

FOOT = 0.02
"""What is nearer to the lowest point than this share of the longest side belongs to the foot: few things lie quite flat."""
POINTS = 20000


def feet(mesh: Mesh) -> dict[str, float]:
    """Return for each axis, "+x" to "-z", how far a thing that stands with it upwards can be tilted before it falls.

    As a share of a right angle: 0 does not stand at all, a cube has 0.5, a thin plate almost 1. Weight is where the surface is.
    """
    points = mesh.vertices[:: max(1, len(mesh.vertices) // POINTS)].astype(np.float64)
    middle = np.average(mesh.vertices[mesh.faces].mean(axis=1), axis=0, weights=mesh.face_areas)
    return {name: round(_tilt(points, middle, axis), 2) for name, axis in AXES.items()}


def _tilt(points: np.ndarray, middle: np.ndarray, up: np.ndarray) -> float:
    """Return how far a thing of some points [point 3] tilts before it falls, as a share of a right angle."""
    level = [i for i in range(3) if not up[i]]
    height = points @ up
    low = points[height <= height.min() + FOOT * max(float(np.ptp(points, axis=0).max()), 1e-12)]
    foot = _hull(low[:, level])
    if foot is None:
        return 0.0
    edge = -float((foot.equations[:, :2] @ middle[level] + foot.equations[:, 2]).max())
    return max(0.0, float(np.arctan2(edge, middle @ up - height.min()) / (np.pi / 2)))


def _hull(points: np.ndarray) -> ConvexHull | None:
    """Return the convex hull of points [point 2]; None if they all lie on one line."""
    try:
        return ConvexHull(points)
    except (QhullError, ValueError):
        return None
