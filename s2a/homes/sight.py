"""Colours of a coarse surface: the true point seen through each of its points.

A handle that is missing in the mesh of a phone is in its texture, on the front behind it.
"""

from __future__ import annotations

import numpy as np

from s2a.scene.geometry.mesh_query import RayMesh, first_hits

MAX_ATTEMPTS = 4
"""Nearest cameras that are tried for each point."""
CHUNK = 100_000
"""Points that are asked for at once."""
NEAR = 0.09
"""[m] Farther before or behind a point, what a camera sees is something else."""


def sighted(mesh: RayMesh, points: np.ndarray, normals: np.ndarray, cameras: np.ndarray) -> np.ndarray:
    """Return for each point what the nearest camera sees in its direction, shape [point 3] [m]; itself where none sees it.

    Args:
        mesh: the true room.
        points: of the coarse surface, in the frame of the mesh [m], shape [point 3].
        normals: of that surface towards free space, shape [point 3].
        cameras: where pictures were taken, in the same frame [m], shape [camera 3].
    """
    parts = [slice(i, i + CHUNK) for i in range(0, len(points), CHUNK)]
    return np.concatenate([_sighted(mesh, points[some], normals[some], cameras) for some in parts])


def _sighted(mesh: RayMesh, points: np.ndarray, normals: np.ndarray, cameras: np.ndarray) -> np.ndarray:
    found, open_ = points.astype(np.float64).copy(), np.ones(len(points), bool)
    rays = cameras[None].astype(np.float32) - points[:, None].astype(np.float32)
    far = np.linalg.norm(rays, axis=2)
    facing = np.einsum("pci,pi->pc", rays, normals.astype(np.float32)) / far
    # Pictures from close by and straight ahead are sharpest.
    order = np.argsort(far / np.clip(facing, 0.05, 1.0), axis=1)[:, :MAX_ATTEMPTS]
    for rank in range(order.shape[1]):
        some = np.flatnonzero(open_)
        if not len(some):
            break
        eyes, reach = cameras[order[some, rank]], far[some, order[some, rank]]
        ahead = (points[some] - eyes) / reach[:, None]
        hits = first_hits(mesh, eyes, ahead)
        good = np.abs(hits - reach) < NEAR
        found[some[good]] = eyes[good] + hits[good, None] * ahead[good]
        open_[some[good]] = False
    return found


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return unit normals of vertices, weighted by area, shape [vertex 3]."""
    a, b, c = np.moveaxis(vertices[faces].astype(np.float64), 1, 0)
    cross = np.cross(b - a, c - a)
    total = np.stack([np.bincount(faces.ravel(), np.repeat(cross[:, i], 3), len(vertices)) for i in range(3)], axis=1)
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)
