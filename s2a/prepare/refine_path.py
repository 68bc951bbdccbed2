"""The path of a part through the rest of the scan: points of its front, and a grid of distances around its closed pose."""

from __future__ import annotations

import numpy as np

from s2a.prepare.refine_loss import PartPath
from s2a.prepare.refine_sides import Faces
from s2a.scene.articulation import open_limit
from s2a.scene.geometry.mesh_ops import centroids, keep, normals, sample
from s2a.scene.geometry.mesh_query import nearest_faces, ray_mesh
from s2a.scene.scene import Mesh

CELL = 0.015
"""[m] Width of a cell of the grid."""
AROUND = 0.06
"""[m] The grid reaches this far beyond the front: what is hit there tells of the joint, what lies farther of the room."""
REACH = 0.03
"""[m] Farther behind a surface there may be another object's back."""
POINTS = 100
"""Points of a front that are followed."""
STEPS = (0.03, 0.1, 0.2, 0.4, 0.7, 1.0)
"""Fractions of the range at which they are looked at."""
SLACK = 0.004
"""[m] Twice a laser scan's noise, or the gap around a front."""
MOST = 400_000
"""Cells of a grid; larger parts get wider cells."""


def path(faces: Faces, part: str, number: int, weight: float) -> PartPath | None:
    """Return the path of a part, or None where nothing lies around it.

    Args:
        faces: of the room.
        part: id of a part that moves.
        number: of its joint.
        weight: of the mean squared depth [1/m^2].
    """
    surface, scene, joint = faces.surface, faces.surface.scene, faces.surface.scene.joint(part)
    own = scene.parts[part].mesh
    if not own.face_areas.any() or not open_limit(joint):
        return None
    low, high = own.bounds
    low, high = low - AROUND, high + AROUND
    near = faces.near(low - REACH, high + REACH)
    rest = keep(Mesh(surface.mesh.vertices, surface.mesh.faces), near[~faces.own(part, near)])
    if len(rest.faces) < 20:
        return None
    cell = max(CELL, float((np.prod(high - low) / MOST) ** (1 / 3)))
    counts = np.ceil((high - low) / cell).astype(int) + 1
    places = low + cell * np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 3)
    distance = _distance(rest, surface.winding, places).reshape(counts)
    points = sample(own, POINTS, 0)
    slack = SLACK + np.maximum(0.0, -_distance(rest, surface.winding, points))
    return PartPath(number, points, slack, open_limit(joint) * np.array(STEPS), low, cell, distance, weight)


def _distance(rest: Mesh, winding: float, places: np.ndarray) -> np.ndarray:
    """Return the distance of places [place 3] to a surface [m], negative straight behind it, at most REACH, shape [place]."""
    tree = ray_mesh(rest.vertices, rest.faces)
    face, gap = nearest_faces(tree, places, REACH)
    found = np.full(len(places), REACH)
    near = face >= 0
    away = places[near] - centroids(rest)[face[near]]
    height = winding * np.einsum("ij,ij->i", away, normals(rest)[face[near]])
    behind = (height < 0) & (gap[near] < -height + 1e-3)
    found[near] = np.where(behind, -gap[near], gap[near])
    return found
