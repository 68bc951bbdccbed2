"""Cutting a scan's mesh into one mesh a part."""

from __future__ import annotations

import numpy as np

from s2a.scan.ply import ScanMesh
from s2a.scene.scene import Mesh


def cut(surface: ScanMesh, owner: np.ndarray, count: int) -> list[Mesh]:
    """Cut a surface into the meshes of parts 0 to count - 1; vertices on a border go to both sides.

    Args:
        surface: the whole scan.
        owner: the part of each face, shape [face], integers; -1 for none.
        count: number of parts; one that owns nothing gets an empty mesh.

    Returns:
        Meshes that keep the order of the scan's faces and vertices.
    """
    by_owner = np.argsort(owner, kind="stable")
    borders = np.searchsorted(owner[by_owner], np.arange(count + 1))
    return [_piece(surface, by_owner[borders[i] : borders[i + 1]]) for i in range(count)]


def _piece(surface: ScanMesh, chosen: np.ndarray) -> Mesh:
    """Return the mesh of some faces and of the vertices they use."""
    faces = surface.faces[chosen]
    if not len(faces):
        return Mesh(np.empty((0, 3)), faces, None if surface.colors is None else np.empty((0, 3)))
    # A table over the range of vertices in use is several times faster here than np.unique, which sorts.
    low = faces.min()
    used = np.zeros(faces.max() - low + 1, dtype=bool)
    used[faces - low] = True
    new_number = np.cumsum(used) - 1
    old = np.flatnonzero(used) + low
    colors = None if surface.colors is None else surface.colors[old]
    return Mesh(surface.vertices[old], new_number[faces - low], colors)
