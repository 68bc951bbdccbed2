"""Interiors that a scan of a closed part cannot show: the box behind a front, the back and sides of its furniture."""

from __future__ import annotations

import numpy as np

from s2a.prepare.target import Target
from s2a.scene.articulation import open_limit, opening_direction
from s2a.scene.geometry.convex import box
from s2a.scene.geometry.mesh_ops import extents, sample
from s2a.scene.scene import Mesh

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
FLATTEST, DEEPEST = 0.2, 0.8
"""[m] What is less deep is the frame of a door or window; what is deeper is no plain box but an L of cabinets, or a table."""
NEAR = 0.02
"""[m] A wall counts as scanned, and an end of the furniture as seen, where its surface is so near."""
SEEN = 0.5
"""Share of a wall above which it was scanned, and of an end's length below which there is none."""
CELL = 0.05
"""[m] Grain in which both are counted."""


def drawer_box(target: Target) -> list[Mesh]:
    """Return bottom, two sides and back of a drawer's box as convex hulls, at the pose in which it was scanned.

    It is as deep as the joint's range, but ends inside the cabinet, unless of that no more than a frame was scanned: what
    slides out so far is so deep. None for a part that turns or opens upwards, or whose front was not scanned.
    """
    joint, front = target.joint, target.front
    inwards = -opening_direction(joint, front.bounds.mean(axis=0))
    if joint.kind != "prismatic" or abs(inwards[2]) > 0.5 or not front.face_areas.any():
        return []
    up = np.array([0.0, 0.0, 1.0]) - inwards[2] * inwards
    up /= np.linalg.norm(up)
    frame = np.stack([np.cross(up, inwards), up, inwards], axis=1)
    low, high = extents(front, frame)
    start = low[2] + FRONT
    behind = _cabinet_end(target.cabinet, inwards) - WALL - start
    depth = min(abs(open_limit(joint)), behind if behind > FLATTEST else np.inf)
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


def _cabinet_end(cabinet: Mesh, inwards: np.ndarray) -> float:
    """Return how far inwards furniture was scanned [m]; without limit where there is none."""
    return float((cabinet.vertices @ inwards).max()) if len(cabinet.vertices) else np.inf


def cabinet_walls(surface: Mesh, target: Target) -> list[Mesh]:
    """Return the back and the sides of furniture that were not scanned, as convex hulls.

    A wall is added where the scan shows that the furniture ends there, along half of its length or more, and less than half
    of the wall itself. None for furniture that is no plain box, or whose doors open upwards.

    Args:
        surface: of the furniture, without what moves.
        target: a part of it that moves; it is at the front.
    """
    inwards = -opening_direction(target.joint, target.point)
    inwards = np.array([*inwards[:2], 0.0])
    if not surface.face_areas.any() or np.linalg.norm(inwards) < 0.7:
        return []
    inwards /= np.linalg.norm(inwards)
    frame = np.stack([np.cross([0.0, 0.0, 1.0], inwards), [0.0, 0.0, 1.0], inwards], axis=1)
    low, high = extents(surface, frame)
    if not FLATTEST < high[2] - low[2] < DEEPEST:
        return []
    points = sample(surface, int(4 * surface.face_areas.sum() / CELL**2), 0) @ frame
    found = []
    for normal, side in ((0, 0), (0, 1), (2, 1)):  # left and right of the front, and the back
        at = (low, high)[side][normal]
        close = points[np.abs(points[:, normal] - at) < NEAR]
        spans = [k for k in range(3) if k != normal]
        ends = max(_filled(close[:, [k]], low[[k]], high[[k]]) for k in spans)
        if ends >= SEEN > _filled(close[:, spans], low[spans], high[spans]):
            first, last = low.copy(), high.copy()
            first[normal], last[normal] = (at - WALL, at) if side else (at, at + WALL)
            found.append(box(frame @ ((first + last) / 2), frame, last - first))
    return found


def _filled(points: np.ndarray, low: np.ndarray, high: np.ndarray) -> float:
    """Return the share of the cells between two corners [axis] in which points [point axis] lie."""
    shape = np.maximum(np.ceil((high - low) / CELL).astype(int), 1)
    cells = np.clip(((points - low) / CELL).astype(int), 0, shape - 1)
    return len(np.unique(cells, axis=0)) / float(shape.prod()) if len(points) else 0.0
