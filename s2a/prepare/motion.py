"""Where a part goes when its joint moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.geometry.convex import hull, overlap
from s2a.scene import Joint, Mesh


def displace(points: np.ndarray, joint: Joint, coordinate: float) -> np.ndarray:
    """Return points [point 3] moved along a joint from its zero to a coordinate [m] or [rad]."""
    axis, origin = np.array(joint.axis), np.array(joint.origin)
    if joint.kind == "prismatic":
        return points + coordinate * axis
    return Rotation.from_rotvec(coordinate * axis).apply(points - origin) + origin


def deepest(pieces: Sequence[Mesh], others: Sequence[Mesh], joint: Joint, steps: int = 8) -> float:
    """Return the radius of the largest ball [m] that fits into both a moving piece and another, anywhere along a joint."""
    worst = 0.0
    for q in np.linspace(*joint.limits, steps):
        moved = [Mesh(displace(piece.vertices, joint, q), piece.faces) for piece in pieces]
        worst = max([worst, *(overlap(piece, other) for piece in moved for other in others)])
    return worst


def sweep(mesh: Mesh, joint: Joint, step: float = 0.2) -> list[Mesh]:
    """Return convex pieces that cover the way of a mesh from one limit of its joint to the other.

    A turn is covered in steps of at most `step` [rad], each by the hull of its two ends.
    """
    lower, upper = joint.limits
    count = 1 if joint.kind == "prismatic" else max(1, int(np.ceil((upper - lower) / step)))
    whole = hull(mesh.vertices)
    if whole is None:
        return []
    poses = [displace(whole.vertices, joint, q) for q in np.linspace(lower, upper, count + 1)]
    covers = [hull(np.concatenate(ends)) for ends in zip(poses, poses[1:], strict=False)]
    return [cover for cover in covers if cover is not None]
