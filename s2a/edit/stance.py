"""How a thing in a file could stand: along which of its axes it has a foot."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from s2a.edit.objects import AXES
from s2a.scene import Mesh

FOOT = 0.02
"""What is nearer to the lowest point than this share of the height belongs to the foot."""
POINTS = 20000


def feet(mesh: Mesh) -> dict[str, float]:
    """Return for each axis, "+x" to "-z", how well a thing stands with it upwards: 0 not at all, 1 on all of its outline.

    It is the area around what touches the ground as a share of the area around the whole, seen from above; 0 where the
    middle of the surface is not above what touches the ground.
    """
    points = mesh.vertices[:: max(1, len(mesh.vertices) // POINTS)].astype(np.float64)
    middle = np.average(mesh.vertices[mesh.faces].mean(axis=1), axis=0, weights=mesh.face_areas)
    return {name: round(_foot(points, middle, axis), 2) for name, axis in AXES.items()}


def _foot(points: np.ndarray, middle: np.ndarray, up: np.ndarray) -> float:
    """Return the share of the outline [point 3] on which a thing would stand."""
    level = [i for i in range(3) if not up[i]]
    height = points @ up
    low = points[height <= height.min() + FOOT * max(float(np.ptp(height)), 1e-12)]
    whole, foot = _hull(points[:, level]), _hull(low[:, level])
    if whole is None or foot is None:
        return 0.0
    inside = foot.equations[:, :2] @ middle[level] + foot.equations[:, 2] <= 0.0
    return float(foot.volume / whole.volume) if inside.all() else 0.0


def _hull(points: np.ndarray) -> ConvexHull | None:
    """Return the convex hull of points [point 2]; None if they all lie on one line."""
    try:
        return ConvexHull(points)
    except (QhullError, ValueError):
        return None
