"""A texture as colours of vertices, as a room's parts carry them: they are rendered, weighed and simulated alike."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from s2a.scan.bake import bake
from s2a.scan.mesh_files import from_trimesh

COARSEST, FINEST, STEP = 8.0, 512.0, 1.5
"""Parts of an object's longest side down to which triangles' edges are split: the first, the last, and from one to the next."""


def textured(path: Path, shape: trimesh.Trimesh, budget: int) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return the vertices [vertex 3], triangles [face 3] and colours [vertex 3], uint8, of a shape with a texture.

    Triangles are split where the texture shows more than the colours of their corners, as finely as the budget allows.

    Args:
        path: the file, for warnings.
        shape: as trimesh reads it.
        budget: largest number of triangles.

    Returns:
        None if it has no texture coordinates or no image, or more triangles than the budget.
    """
    source = from_trimesh(path, shape, np.eye(4))
    if np.isnan(source.uv).all() or all(material.texture is None for material in source.materials):
        return None
    side = float(np.ptp(source.vertices, axis=0).max())
    found, parts = bake(source, np.inf), float(COARSEST)
    while len(found.faces) <= budget and parts <= FINEST:
        finer = bake(source, side / parts)
        if len(finer.faces) > budget:
            break
        found, parts = finer, parts * STEP
    return None if len(found.faces) > budget else (found.vertices, found.faces, found.colors)
