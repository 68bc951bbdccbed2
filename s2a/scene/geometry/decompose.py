"""Convex decomposition with the published libraries, deterministic."""

from __future__ import annotations

import coacd
import numpy as np
import vhacdx

from s2a.scene.geometry.convex import hull
from s2a.scene.scene import Mesh


def one_hull(mesh: Mesh, max_vertices: int) -> list[Mesh]:
    """Return the convex hull of a mesh as the only piece; no piece for a mesh without extent."""
    piece = hull(mesh.vertices, max_vertices)
    return [] if piece is None else [piece]


def vhacd(mesh: Mesh, hulls: int, resolution: int, max_vertices: int) -> list[Mesh]:
    """Decompose by V-HACD.

    Args:
        mesh: a surface, which may be open.
        hulls: largest number of pieces.
        resolution: number of voxels.
        max_vertices: largest number of vertices a piece.
    """
    if len(mesh.faces) < 4:
        return one_hull(mesh, max_vertices)
    found = vhacdx.compute_vhacd(
        mesh.vertices.astype(np.float64),
        np.concatenate([np.full((len(mesh.faces), 1), 3), mesh.faces], axis=1).astype(np.uint32).ravel(),
        maxConvexHulls=hulls,
        resolution=resolution,
        maxNumVerticesPerCH=64,
        asyncACD=False,
    )
    return _pieces([points for points, _ in found], max_vertices)


def coacd_default(mesh: Mesh, max_vertices: int, seed: int) -> list[Mesh]:
    """Decompose by CoACD with the library's own settings (threshold 0.05)."""
    coacd.set_log_level("error")
    found = coacd.run_coacd(coacd.Mesh(mesh.vertices.astype(np.float64), mesh.faces), seed=seed)
    return _pieces([points for points, _ in found], max_vertices)


def _pieces(clouds: list[np.ndarray], max_vertices: int) -> list[Mesh]:
    pieces = [hull(points, max_vertices) for points in clouds]
    return [piece for piece in pieces if piece is not None]
