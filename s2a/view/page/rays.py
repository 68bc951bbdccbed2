"""Which part a ray from the camera meets first."""

from __future__ import annotations

import numpy as np

from s2a.scene.scene import Mesh
from s2a.view.page.room import Coordinates, PagePart

PARALLEL = 1e-15
"""[m^2] A triangle of which a ray sees less is not met."""


def pick(at: Coordinates, origin: np.ndarray, direction: np.ndarray) -> str | None:
    """Return the id of the part that a ray meets first, with the joints where they stand, or None.

    The still room is not shown from behind, and not met from there either. Of the boxes of a description, which hold each
    other, it is the smallest one that the ray meets.

    Args:
        at: the room, and its joints' coordinates.
        origin: where the ray begins [m], scene coordinates, shape [3].
        direction: where it leads, shape [3].
    """
    nearest, found = np.inf, None
    backs = {mover: np.linalg.inv(at.pose(mover)) for mover in {part.mover for part in at.room.parts.values()}}
    for part_id, part in at.room.parts.items():
        limit = np.inf if at.room.boxes else nearest
        distance = _distance(part, backs[part.mover], origin, direction, limit)
        rank = float(part.surface.face_areas.sum()) if at.room.boxes and distance < np.inf else distance
        if rank < nearest:
            nearest, found = rank, part_id
    return found


def _distance(part: PagePart, back: np.ndarray, origin: np.ndarray, direction: np.ndarray, nearest: float) -> float:
    """Return how far along a ray [multiple of its direction] the surface of a part is; inf where it misses it."""
    if not len(part.surface.faces):
        return np.inf
    start, way = back[:3, :3] @ origin + back[:3, 3], back[:3, :3] @ direction
    if _enters(part.surface.bounds, start, way) >= nearest:
        return np.inf
    return first_face(part.surface, start, way, part.mover is not None)[0]


def _enters(box: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> float:
    """Return where a ray enters a box [2 3], 0 if it begins in it; inf where it misses it."""
    safe = np.where(direction == 0.0, 1e-30, direction)
    ends = np.sort((box - origin) / safe, axis=0)
    enter, leave = max(ends[0].max(), 0.0), ends[1].min()
    return float(enter) if enter <= leave else np.inf


def first_face(mesh: Mesh, origin: np.ndarray, direction: np.ndarray, both_sides: bool) -> tuple[float, int]:
    """Return where a ray meets a mesh first, and the face (Moeller and Trumbore, 1997); inf and -1 where it does not.

    Args:
        mesh: what is met.
        origin: where the ray begins [m], shape [3].
        direction: where it leads, shape [3]; the distance is a multiple of it.
        both_sides: Faces are met from behind, too.
    """
    corner = mesh.vertices[mesh.faces[:, 0]]
    one, other = mesh.vertices[mesh.faces[:, 1]] - corner, mesh.vertices[mesh.faces[:, 2]] - corner
    across = np.cross(direction, other)
    size = np.einsum("ij,ij->i", one, across)
    seen = np.flatnonzero((np.abs(size) if both_sides else size) > PARALLEL)
    one, other, across, size = one[seen], other[seen], across[seen], size[seen]
    offset = origin - corner[seen]
    turned = np.cross(offset, one)
    u, v = np.einsum("ij,ij->i", offset, across) / size, turned @ direction / size
    along = np.einsum("ij,ij->i", other, turned) / size
    inside = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (along > 0.0)
    if not inside.any():
        return np.inf, -1
    nearest = np.flatnonzero(inside)[np.argmin(along[inside])]
    return float(along[nearest]), int(seen[nearest])
