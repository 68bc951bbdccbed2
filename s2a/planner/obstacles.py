"""What an arm and the object in its gripper can run into in a room: all collision hulls, without simulating."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import trimesh

from s2a.scene.geometry.convex import contains
from s2a.scene.geometry.mesh_query import first_hits, nearest_faces, nearest_faces_of_solids, ray_mesh
from s2a.scene.scene import Mesh
from s2a.scene.usd.sim_scene import SimRoom, in_scene

RADIUS = 2.0
"""[m] About the object: what is farther away is out of every arm's reach."""
INSIDE = 0.3
"""[m] Up to which depth a center within a hull is noticed."""
HELD_RADIUS = 0.005
"""[m] Clearance of the held object's surface."""

FINEST, MOST = 0.015, 120
"""[m] Between points on the held object's surface at least, and how many there are, about, on a large one."""
COVERED = 1e-3
"""[m] Deeper within one of its hulls no point is needed."""


class RoomHulls:
    """The hulls of a room around a point, but for the object that is picked.

    Attributes:
        names: ids of the parts they stand for.
    """

    def __init__(self, room: SimRoom, without: Collection[str], about: np.ndarray, extra: Mesh | None = None) -> None:
        """Take the hulls near a point [3]; `extra` is a further one, such as a pedestal."""
        self._meshes: list[Mesh] = []
        self.names: list[str] = []
        for body in (*room.bodies.values(), *room.free.values()):
            if body.id not in without:
                for collider in body.colliders:
                    self._add(Mesh(in_scene(body, collider.mesh), collider.mesh.faces), collider.part, about)
        for collider in room.static_colliders:
            self._add(collider.mesh, collider.part, about)
        if extra is not None:
            self._add(extra, "pedestal", about)
        faces, first = [], 0
        for mesh in self._meshes:
            faces.append(np.asarray(mesh.faces) + first)
            first += len(mesh.vertices)
        self._vertices = np.concatenate([np.asarray(m.vertices, float) for m in self._meshes])
        self._faces = np.concatenate(faces)
        corners = self._vertices[self._faces]
        self._corner = corners[:, 0]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self._normal = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
        self._owner = np.repeat(np.arange(len(self._meshes)), [len(m.faces) for m in self._meshes])
        self._tree = ray_mesh(self._vertices, self._faces)

    def _add(self, mesh: Mesh, part: str, about: np.ndarray) -> None:
        points = np.asarray(mesh.vertices, float)
        low, high = points.min(axis=0), points.max(axis=0)
        if (np.linalg.norm(np.clip(about, low, high) - about) <= RADIUS) and len(mesh.faces):
            self._meshes.append(Mesh(points, mesh.faces))
            self.names.append(part)

    def hulls_of(self, part: str) -> list[Mesh]:
        """Return the hulls that stand for a part."""
        return [mesh for mesh, name in zip(self._meshes, self.names, strict=True) if name == part]

    def depth(self, centers: np.ndarray, radii: np.ndarray) -> np.ndarray:
        """Return how deep spheres [... sphere 3] of radii [sphere] reach into the hulls [m], shape [...]; 0 where they are clear.

        A center within a convex hull is as far behind the plane of the nearest face as from the face; one outside is before that
        plane or, past an edge, in it.
        """
        shape = centers.shape[:-1]
        flat = centers.reshape(-1, 3)
        face, gap = nearest_faces_of_solids(self._tree, flat, float(radii.max()), INSIDE)
        before = np.einsum("pi,pi->p", flat - self._corner[face], self._normal[face])
        behind = before < -0.5 * gap
        reached = np.broadcast_to(radii, shape).ravel() + np.where(behind, gap, -gap)
        depth = np.where(face >= 0, reached, 0.0)
        return np.clip(depth.reshape(shape), 0.0, None).max(axis=-1)

    def below(self, points: np.ndarray) -> tuple[np.ndarray, list[str]]:
        """Return the heights of the first surfaces below points [point 3] [m], -inf for none, and the parts they are of."""
        drop = first_hits(self._tree, points, np.broadcast_to([0.0, 0.0, -1.0], points.shape))
        hit = np.isfinite(drop)
        face, _ = nearest_faces(self._tree, points - np.where(hit, drop, 0.0)[:, None] * [0.0, 0.0, 1.0])
        return np.where(hit, points[:, 2] - drop, -np.inf), [self.names[k] for k in self._owner[face]]


def surface_points(hulls: Sequence[Mesh]) -> np.ndarray:
    """Return points all over the union of hulls [point 3], its corners and edges too, for a body that is tested as small spheres.

    Random points left out the corners, by which a wide object was torn from the gripper as it passed a headboard.
    """
    meshes = [trimesh.convex.convex_hull(np.asarray(h.vertices, float)) for h in hulls]
    apart = max(FINEST, float(np.sqrt(sum(mesh.area for mesh in meshes) / MOST)))
    finer = [trimesh.remesh.subdivide_to_size(m.vertices, m.faces, apart, max_iter=20)[0] for m in meshes]
    points = np.concatenate([*(mesh.vertices for mesh in meshes), *finer])
    # Of those that lie in the same cell, one; corners come first.
    _, first = np.unique(np.floor(points / (apart / 2)).astype(int), axis=0, return_index=True)
    points = points[np.sort(first)]
    return points[~np.any([contains(hull, points, -COVERED) for hull in hulls], axis=0)]
