"""What a scan of a closed drawer cannot show: the open box behind its front."""

from __future__ import annotations

import numpy as np

from s2a.geometry.convex import box
from s2a.prepare.pose import extents, opening_direction, widest
from s2a.scene import Joint, Mesh, Scene

WALL = 0.006
"""[m] Thickness of a drawer box's sides and bottom."""
INSET = 0.015
"""[m] How far its sides stay behind the edges of the front: the slides lie there."""
FRONT = 0.02
"""[m] Thickness of the front, behind which the box begins."""
HEIGHT = 0.7
"""Height of the box as a share of the front's."""
SHALLOWEST = 0.05
"""[m] A box that is less deep is not worth adding."""


def drawer_box(scene: Scene, target: str) -> list[Mesh]:
    """Return bottom, two sides and back of a drawer's box as convex pieces, at the pose in which it was scanned.

    It is as deep as the joint's range, but ends inside the carcass. None for a part that turns or opens upwards.
    """
    joint, front = scene.joint(target), scene.parts[target].mesh
    inwards = -opening_direction(joint, front.bounds.mean(axis=0))
    if joint.kind != "prismatic" or abs(inwards[2]) > 0.5:
        return []
    up = np.array([0.0, 0.0, 1.0]) - inwards[2] * inwards
    up /= np.linalg.norm(up)
    frame = np.stack([np.cross(up, inwards), up, inwards], axis=1)
    low, high = extents(front, frame)
    start = low[2] + FRONT
    depth = min(_range(joint), _carcass_end(scene, target, inwards) - WALL - start)
    width, height = high[0] - low[0] - 2 * INSET, HEIGHT * (high[1] - low[1])
    if depth < SHALLOWEST or min(width, height) < SHALLOWEST / 2:
        return []
    left, bottom = low[0] + INSET, low[1] + (high[1] - low[1] - height) / 2
    # Lower corner and size of each wall along the frame's axes: sideways, up, inwards.
    walls = [
        ((left, bottom, start), (width, WALL, depth)),
        ((left, bottom, start + depth - WALL), (width, height, WALL)),
    ]
    walls += [((x, bottom, start), (WALL, height, depth)) for x in (left, left + width - WALL)]
    return [box(frame @ (np.array(at) + np.array(size) / 2), frame, np.array(size)) for at, size in walls]


def _range(joint: Joint) -> float:
    return abs(widest(joint))


def _carcass_end(scene: Scene, target: str, inwards: np.ndarray) -> float:
    """Return how far inwards the target's furniture was scanned [m]; without limit where it belongs to none."""
    root = scene.root(target)
    mesh = scene.parts[root].mesh
    return float((mesh.vertices @ inwards).max()) if root != target and len(mesh.vertices) else np.inf
