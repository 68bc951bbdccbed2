"""Fewer faces for files and slow graphics: vertices that share a cell of a grid become one (Rossignac and Borrel, 1993)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from s2a.scene.scene import Mesh
from s2a.view.page.room import PagePart, PageRoom

MOVING = 0.5
"""Fraction of the faces that jointed parts may have between them, before they lose any."""
MIN_CELL, MAX_SCALE = 1e-4, 1e3
"""Bounds of the cells [m] and of their scale [m^0.5]: where the search for it begins and gives up."""
STEP = 1.05
"""Factor by which cells grow from round to round at least."""


def thinned(room: PageRoom, max_faces: int) -> PageRoom:
    """Return a room whose surfaces have so many faces at most; those that move keep theirs as long as they can."""
    moving = {i: part for i, part in room.parts.items() if part.mover is not None}
    still = {i: part for i, part in room.parts.items() if part.mover is None}
    if _count(moving) + _count(still) <= max_faces:
        return room
    moving = _fewer(moving, max(int(MOVING * max_faces), max_faces - _count(still)))
    still = _fewer(still, max_faces - _count(moving))
    return replace(room, parts={i: moving.get(i) or still[i] for i in room.parts})


def clustered(mesh: Mesh, cell: float) -> Mesh:
    """Return a mesh whose vertices are the mean of those in each cell of a grid [m], with their mean colour."""
    if not len(mesh.vertices):
        return mesh
    index = np.floor((mesh.vertices - mesh.bounds[0]) / cell).astype(np.int64)
    width = index.max(axis=0) + 1
    keys = (index[:, 0] * width[1] + index[:, 1]) * width[2] + index[:, 2]
    _, owner, size = np.unique(keys, return_inverse=True, return_counts=True)
    faces = owner[mesh.faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    colors = None if mesh.colors is None else np.rint(_means(mesh.colors, owner, size))
    return Mesh(_means(mesh.vertices, owner, size), faces, colors)


def _means(values: np.ndarray, owner: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return the mean of the values [n 3] of each owner."""
    return np.stack([np.bincount(owner, column, len(size)) for column in values.T], axis=1) / size[:, None]


def _fewer(parts: dict[str, PagePart], max_faces: int) -> dict[str, PagePart]:
    """Return parts with so many faces at most; a cell grows with the root of its part's size, so that small things last."""
    seen = {i: part.surface for i, part in parts.items() if len(part.surface.faces)}
    roots = {i: float(np.linalg.norm(np.ptp(mesh.bounds, axis=0))) ** 0.5 for i, mesh in seen.items()}
    count, found = _count(parts), parts
    scale = np.sqrt(
        sum(mesh.face_areas.sum() / max(roots[i], 1e-6) ** 2 for i, mesh in seen.items()) / max(max_faces, 1)
    )
    while count > max_faces:
        meshes = {i: clustered(mesh, max(scale * roots[i], MIN_CELL)) for i, mesh in seen.items()}
        found = {i: replace(part, surface=meshes.get(i, part.surface)) for i, part in parts.items()}
        count = _count(found)
        scale = max(scale, MIN_CELL) * max(np.sqrt(count / max(max_faces, 1)), STEP)
        if not count or scale > MAX_SCALE:
            break
    return found


def _count(parts: dict[str, PagePart]) -> int:
    return sum(len(part.surface.faces) for part in parts.values())
