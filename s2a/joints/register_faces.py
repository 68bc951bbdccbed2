"""The faces of the closed scan that move with a part: its front, and what stands before it."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from s2a.joints.register_change import CHANGED, Patch
from s2a.joints.register_check import near_box
from s2a.joints.register_search import ROOM
from s2a.joints.register_surface import Cloud, OrientedMesh, match
from s2a.scene.articulation import transform
from s2a.scene.scene import Joint

NEAR = 0.007
"""[m] A face that moves lies as near to the open scan, once it has moved."""
ALIKE = 0.6
"""Cosine between its normal and that of the open scan, at least."""
STILL = 0.004
"""[m] A face that is as near to the open scan where it was has not moved."""
CELL = 0.006
"""[m] Width of the cells in which the outline of the front is filled."""
GAP = 4
"""Cells that are bridged there."""
NEXT = 0.02
"""[m] Sides of a front are not farther from its outline."""
BEFORE, SUNK, BEHIND = 0.09, 0.04, 0.07
"""[m] How far what belongs to the part stands before its front; lies behind it within its outline, such as the panes of a window;
and behind it on its sides."""


def moving_faces(joint: Joint, patch: Patch, closed: OrientedMesh, opened: OrientedMesh) -> np.ndarray:
    """Return the indices of the closed scan's faces that move with a part, ascending.

    Args:
        joint: as fitted.
        patch: of its front.
        closed: the closed scan, all of it.
        opened: the open scan in the closed one's frame, all of it.
    """
    near = np.flatnonzero(near_box(closed.centroids, patch, ROOM))
    cloud = Cloud(closed.centroids[near], closed.normals[near], near)
    stays = match(cloud, opened, CHANGED)
    moves = match(cloud.moved(transform(joint, joint.limits[1])), opened, NEAR)
    explained = (moves.alike > ALIKE) & ((stays.gap > STILL) | (stays.alike < 0.3)) & (moves.gap < stays.gap)
    height = (cloud.points - patch.centre) @ patch.normal
    layer = (height > -SUNK) & (height < BEFORE)
    flat = (np.abs(height) < 2 * CELL) & (cloud.normals @ patch.normal > 0.7)
    across = np.linalg.svd(patch.normal[None])[2][1:]
    cells = np.floor((cloud.points - patch.centre) @ across.T / CELL).astype(int)
    cells -= cells.min(axis=0) - GAP - 1
    inside = _outline(cells, explained & layer)[tuple(cells.T)] & layer
    # Sides of a thick door lie beyond its outline; what both scans show of them has moved for certain.
    deep = (height > -BEHIND) & (height < BEFORE)
    sides = explained & deep & (stays.gap >= CHANGED) & near_box(cloud.points, patch, NEXT)
    return near[(inside & (explained | flat | (stays.gap > STILL))) | sides]


def _outline(cells: np.ndarray, marked: np.ndarray) -> np.ndarray:
    """Return the filled outline of marked points on a grid, its largest connected piece."""
    grid = np.zeros(cells.max(axis=0) + GAP + 2, bool)
    grid[tuple(cells[marked].T)] = True
    grid = ndimage.binary_closing(grid, np.ones((3, 3)), iterations=GAP)
    grid = ndimage.binary_opening(ndimage.binary_fill_holes(grid), np.ones((3, 3)))
    labels, count = ndimage.label(grid)
    if not count:
        return grid
    sizes = ndimage.sum_labels(grid, labels, np.arange(1, count + 1))
    return labels == 1 + int(np.argmax(sizes))
