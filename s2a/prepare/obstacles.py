"""What a robot could bump into, as scanned: asked with spheres."""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np

from s2a.geometry.mesh_ops import centroids, keep, merge
from s2a.geometry.mesh_query import RayMesh, nearest_faces, ray_mesh
from s2a.scene import Mesh, Scene


class Surroundings:
    """The scanned surfaces around a handle, as the robot's spheres ask them."""

    def __init__(self, scene: Scene, moving: Sequence[str], point: np.ndarray, around: float) -> None:
        """Take what lies within `around` [m] of a point [3], in plan."""
        self._still = self._gather(scene, [i for i in scene.parts if i not in moving], point, around)
        self._moving = self._gather(scene, moving, point, around)
        self._stand: tuple[np.ndarray, float] | None = None

    def with_pedestal(self, foot: np.ndarray, height: float, radius: float) -> Surroundings:
        """Return the same with the upright column [m] under a foot [3], which reaches to the floor; none of no height."""
        again = copy.copy(self)
        again._stand = (foot, radius) if height > 0.0 else None
        return again

    def hit(self, centers: np.ndarray, radii: np.ndarray, *, moving: bool) -> tuple[float, str]:
        """Return how deep spheres [sphere 3] of radii [sphere] reach into a surface [m] (0: not at all), and whose.

        Args:
            centers: [m].
            radii: [m].
            moving: whether the target counts, at the pose in which it was scanned.
        """
        worst, owner = 0.0, ""
        for tree, owners, names in (self._still, self._moving)[: 1 + moving]:
            if tree is None:
                continue
            face, gap = nearest_faces(tree, centers, reach=float(radii.max()))
            depth = np.where(face >= 0, radii - gap, 0.0)
            k = int(np.argmax(depth))
            if depth[k] > worst:
                worst, owner = float(depth[k]), names[owners[face[k]]]
        if self._stand is not None:
            foot, radius = self._stand
            beside = np.linalg.norm(centers[:, :2] - foot[:2], axis=1) - radius
            gap = np.linalg.norm(np.maximum([beside, centers[:, 2] - foot[2]], 0.0), axis=0)
            worst, owner = max((worst, owner), (float((radii - gap).max()), "its pedestal"))
        return worst, owner

    def standing_in(self, place: np.ndarray, low: float, high: float, radius: float) -> str | None:
        """Return whose surface reaches into an upright column [m] around a place (x, y), or None."""
        steps = np.arange(low, high, radius / 2)
        axis = np.concatenate([np.tile(place, (len(steps), 1)), steps[:, None]], axis=1)
        depth, owner = self.hit(axis, np.full(len(axis), radius), moving=True)
        return owner if depth > 0.0 else None

    @staticmethod
    def _gather(
        scene: Scene, parts: Sequence[str], point: np.ndarray, around: float
    ) -> tuple[RayMesh | None, np.ndarray, list[str]]:
        meshes = [_near(scene.parts[i].mesh, point, around) for i in parts]
        whole = merge(meshes)
        owners = np.repeat(np.arange(len(parts)), [len(mesh.faces) for mesh in meshes])
        return (ray_mesh(whole.vertices, whole.faces) if len(whole.faces) else None), owners, list(parts)


def _near(mesh: Mesh, point: np.ndarray, around: float) -> Mesh:
    return keep(mesh, np.linalg.norm(centroids(mesh)[:, :2] - point[:2], axis=1) < around)
