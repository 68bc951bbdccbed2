"""A recessed pull: a pocket in a front, which a gripper holds from within, its fingers spread against opposite walls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.scene.geometry.convex import box, subtract
from s2a.scene.geometry.handles.panel import FLUSH, facing_frame
from s2a.scene.geometry.mesh_ops import centroids, extents, keep, normals, weighted_quantile
from s2a.scene.scene import Mesh

SHALLOWEST = 0.006
"""[m] Pockets that are not so deep give no hold: a fingertip's edge is rounded, and scans are noisy."""
WALL = 0.004
"""[m] Thickness of the walls and the floor as colliders."""
FACING = 0.7
"""Of a face's normal with the front's, from which on it is the pocket's floor; less: a wall."""
AHEAD = 0.02
"""[m] How far before the front the space of the pocket is kept free."""


@dataclass(frozen=True)
class Pocket:
    """A rectangular pocket.

    Attributes:
        frame: axes as columns [3 3], square on the front: x and y along its sides, z into it.
        center: of its opening, on the front's plane [m], shape [3].
        size: of its opening along x and y [m], shape [2].
        depth: of its floor behind the front's plane [m].
    """

    frame: np.ndarray
    center: np.ndarray
    size: np.ndarray
    depth: float

    def space(self, wall: float = 0.0, floor: float = 0.0) -> Mesh:
        """Return the space within it and before it as a piece, wider by a wall [m] and deeper by a floor [m]."""
        ahead, deep = AHEAD, self.depth + floor
        size = np.array([*(self.size + 2 * wall), ahead + deep])
        return box(self.center + self.frame[:, 2] * (deep - ahead) / 2, self.frame, size)


def find_pocket(region: Mesh, frame: np.ndarray, plane: tuple[np.ndarray, float]) -> Pocket | None:
    """Return the pocket that a grasp region lines, or None where most of it is not behind the front.

    Args:
        region: the annotated surface.
        frame: its grasp frame, axes as columns: x and y along the pocket's sides, z into the furniture.
        plane: of the front, as outward normal and offset [m].
    """
    normal, offset = plane
    frame = facing_frame(frame, normal)
    middle, areas = centroids(region), region.face_areas
    behind = offset - middle @ normal
    if areas[behind > FLUSH].sum() < 0.5 * areas.sum():
        return None
    floor = (behind > FLUSH) & (normals(region) @ normal > FACING)
    if areas[floor].sum() < 0.25 * areas.sum():
        return None
    depth = weighted_quantile(behind[floor], areas[floor], 0.5)
    if depth < SHALLOWEST:
        return None
    # A scan's walls lean: half-way down they stand where the true ones do.
    deep = offset - region.vertices @ normal > 0.5 * depth
    low, high = extents(keep(region, deep[region.faces].all(axis=1)), frame[:, :2])
    center = frame[:, :2] @ (low + high) / 2 + normal * offset
    return Pocket(frame, center, high - low, depth)


def pocketed(piece: Mesh, pocket: Pocket) -> list[Mesh]:
    """Return a piece of the front without a pocket and its walls, as convex pieces."""
    return subtract(piece, pocket.space(WALL, WALL))


def pocket_hulls(pocket: Pocket) -> list[Mesh]:
    """Return walls and floor of a pocket as convex pieces."""
    deep = pocket.depth + WALL
    center = pocket.center + pocket.frame[:, 2] * deep / 2
    return subtract(box(center, pocket.frame, np.array([*(pocket.size + 2 * WALL), deep])), pocket.space())
