"""Whether fingers fit behind a handle, and how far convex pieces are from the surface that they stand for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

from s2a.geometry.convex import box, contains, halfspaces, volume
from s2a.geometry.surfaces import sample
from s2a.scene import Mesh

FINGER_WIDTH = 0.02
"""[m] Width of a Franka finger along the handle."""
FINGER_DEPTH = 0.015
"""[m] Thickness of its tip (15.2 mm) across the handle."""
CLEARANCE = 0.002
"""[m] What fingers keep from the front; a scan is not surer than that."""
SAMPLES = 20000
"""Points by which a handle is asked."""


@dataclass(frozen=True)
class FingerSpace:
    """Where the fingers are while they hold a handle: boxes in the scene, none if the handle lies flat on the front.

    Attributes:
        behind: the space between bar and front; None if the region reaches the front there (a knob, a webbed bar).
        beside: the two spaces across the bar, from its outer face to the front.
    """

    behind: Mesh | None
    beside: tuple[Mesh, ...]

    @property
    def boxes(self) -> tuple[Mesh, ...]:
        """All spaces."""
        return self.beside if self.behind is None else (self.behind, *self.beside)


def finger_space(region: Mesh, point: np.ndarray, frame: np.ndarray, front: float) -> FingerSpace:
    """Return where the fingers go.

    Args:
        region: the grasp region as scanned, mostly open at its back.
        point: where it is grasped [m], shape [3].
        frame: grasp frame's axes as columns [3 3]: x along the region, y across, z into the furniture.
        front: coordinate along z of the front's surface behind the region [m].
    """
    local = sample(region, SAMPLES, seed=0) @ frame
    middle = point @ frame
    here = local[np.abs(local[:, 0] - middle[0]) < FINGER_WIDTH / 2]
    if len(here) < 50:
        return FingerSpace(None, ())
    (low, face), (high, back) = np.quantile(here[:, 1:], [0.01, 0.99], axis=0)
    end = front - CLEARANCE
    if end - face < 2 * CLEARANCE:
        return FingerSpace(None, ())

    def space(y: tuple[float, float], z: tuple[float, float]) -> Mesh:
        center = np.array([middle[0], np.mean(y), np.mean(z)])
        return box(frame @ center, frame, np.array([FINGER_WIDTH, y[1] - y[0], z[1] - z[0]]))

    margin = CLEARANCE / 2
    below, above = (low - margin - FINGER_DEPTH, low - margin), (high + margin, high + margin + FINGER_DEPTH)
    beside = (space(below, (face, end)), space(above, (face, end)))
    reaches_front = back - face > 0.75 * (front - face)
    return FingerSpace(None if reaches_front else space((low, high), (back + margin, end)), beside)


def gap_points(space: FingerSpace, count: int = 4000, seed: int = 0) -> np.ndarray:
    """Return about `count` points spread evenly in each box of the fingers' space [m], shape [point 3]."""
    return np.concatenate([np.empty((0, 3)), *(_fill(part, count, seed) for part in space.boxes)])


def share_inside(pieces: Sequence[Mesh], points: np.ndarray) -> float:
    """Return the share of points [point 3] that lie in any of the pieces, 0 to 1."""
    inside = np.zeros(len(points), bool)
    for piece in pieces:
        inside |= contains(piece, points)
    return float(inside.mean()) if len(points) else 0.0


def surface_distance(pieces: Sequence[Mesh], points: np.ndarray) -> np.ndarray:
    """Return the distance of points [point 3] from the surface of the union of pieces [m], shape [point].

    Inside of overlapping pieces the largest depth in any one stands for the depth in their union.
    """
    outside = np.full(len(points), np.inf)
    depth = np.full(len(points), -np.inf)
    for piece in pieces:
        planes = halfspaces(piece)
        below = (points @ planes[:, :3].T + planes[:, 3]).max(axis=1)
        depth = np.maximum(depth, -below)
        beyond = below > 0
        outside[beyond] = np.minimum(outside[beyond], _distance(piece, points[beyond]))
    return np.where(depth >= 0, depth, outside)


def _distance(piece: Mesh, points: np.ndarray) -> np.ndarray:
    """Return the distance of points outside of a piece from its surface."""
    triangles = piece.vertices[piece.faces].astype(np.float64)
    count = len(triangles)
    pairs = np.repeat(points, count, axis=0)
    closest = trimesh.triangles.closest_point(np.tile(triangles, (len(points), 1, 1)), pairs)
    return np.linalg.norm(closest - pairs, axis=1).reshape(-1, count).min(axis=1) if len(points) else np.empty(0)


def _fill(piece: Mesh, count: int, seed: int) -> np.ndarray:
    """Return about `count` points spread evenly in a piece [m], shape [point 3]."""
    low, high = piece.bounds
    tries = int(count * np.prod(high - low) / volume(piece))
    points = np.random.default_rng(seed).uniform(low, high, (tries, 3))
    return points[contains(piece, points)]
