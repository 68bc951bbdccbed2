"""How close convex pieces are to the surface that they stand for, and points in the room that they should leave to fingers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh

from s2a.scene.geometry.convex import contains, halfspaces, volume
from s2a.scene.geometry.front_panel import FingerSpace
from s2a.scene.scene import Mesh


def gap_points(space: FingerSpace, count: int = 4000, seed: int = 0) -> np.ndarray:
    """Return about `count` points spread evenly in each box of the fingers' space [m], shape [point 3]."""
    return np.concatenate([np.empty((0, 3)), *(_fill(part, count, seed) for part in space.boxes)])


def surface_distance(pieces: Sequence[Mesh], points: np.ndarray) -> np.ndarray:
    """Return the distance of points [point 3] from the surface of the union of pieces [m], shape [point].

    Inside of overlapping pieces the maximum depth in any one stands for the depth in their union.
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
    samples = int(count * np.prod(high - low) / volume(piece))
    points = np.random.default_rng(seed).uniform(low, high, (samples, 3))
    return points[contains(piece, points)]
