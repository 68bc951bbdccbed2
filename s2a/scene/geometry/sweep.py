"""Swept volumes: the space that a part passes through when its joint moves."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from s2a.scene.articulation import displace
from s2a.scene.geometry.convex import hull, overlap
from s2a.scene.scene import Joint, Mesh


def deepest(hulls: Sequence[Mesh], others: Sequence[Mesh], joint: Joint, steps: int = 8) -> float:
    """Return the radius of the largest ball [m] that fits into both a moving piece and another, anywhere along a joint."""
    worst = 0.0
    for q in np.linspace(*joint.limits, steps):
        moved = [Mesh(displace(piece.vertices, joint, q), piece.faces) for piece in hulls]
        worst = max([worst, *(overlap(piece, other) for piece in moved for other in others)])
    return worst


def sweep(mesh: Mesh, joint: Joint, clearance: float = 0.0, step: float = 0.2) -> list[Mesh]:
    """Return convex hulls that cover the swept volume of a mesh between the limits of its joint.

    A turn is covered in steps of at most `step` [rad], each by the hull of its two ends and of where their tangents meet:
    the arc between lies inside.

    Args:
        mesh: the moving mesh.
        joint: its joint.
        clearance: margin around the swept volume [m].
        step: angle of one section [rad].
    """
    lower, upper = joint.limits
    count = 1 if joint.kind == "prismatic" else max(1, int(np.ceil((upper - lower) / step)))
    whole = hull(mesh.vertices)
    if whole is None:
        return []
    stops = np.linspace(lower, upper, count + 1)
    covers = [hull(grown(_cover(whole.vertices, joint, a, b), clearance)) for a, b in pairwise(stops)]
    return [cover for cover in covers if cover is not None]


def _cover(points: np.ndarray, joint: Joint, start: float, end: float) -> np.ndarray:
    """Return points whose hull holds the paths of points [point 3] between two joint coordinates [m] or [rad]."""
    ends = [displace(points, joint, start), displace(points, joint, end)]
    if joint.kind == "prismatic":
        return np.concatenate(ends)
    middle, axis, origin = displace(points, joint, (start + end) / 2), np.array(joint.axis), np.array(joint.origin)
    arms = middle - origin - ((middle - origin) @ axis)[:, None] * axis
    return np.concatenate([*ends, middle + (1.0 / np.cos((end - start) / 2) - 1.0) * arms])


def grown(points: np.ndarray, by: float) -> np.ndarray:
    """Return the corners of cubes around points [point 3] that reach `by` [m] to each side; the points where it is 0."""
    if by <= 0.0:
        return points
    corners = by * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    return (points[:, None] + corners).reshape(-1, 3)
