"""What a robot can collide with in a scan: the surfaces around a handle, and the pedestal that it stands on."""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np

from s2a.robot.collision import Penetration
from s2a.scene.geometry.mesh_query import Forest, nearest_meshes
from s2a.scene.scene import Mesh, Scene


class Obstacles:
    """The scanned surfaces around a point, and a pedestal.

    Attributes:
        surface: all of them as one, for rays.
    """

    def __init__(self, scene: Scene, moving: Sequence[str], point: np.ndarray, query_radius: float) -> None:
        """Take the parts that reach within `query_radius` [m] of a point [3] in plan; `moving` are the ids of those that open."""
        parts = [i for i in scene.parts if _reaches(scene.parts[i].mesh, point[:2], query_radius)]
        self.surface = Forest([scene.parts[i].mesh for i in parts])
        self._static = _Parts(scene, [i for i in parts if i not in moving])
        self._moving = _Parts(scene, [i for i in parts if i in moving])
        self._pedestal: tuple[np.ndarray, float] | None = None

    def with_pedestal(self, foot: np.ndarray, height: float, radius: float) -> Obstacles:
        """Return the same with the upright column [m] under a foot [3], which reaches to the floor; none of no height."""
        again = copy.copy(self)
        again._pedestal = (foot, radius) if height > 0.0 else None
        return again

    def penetration(self, centers: np.ndarray, radii: np.ndarray, *, moving: bool) -> Penetration:
        """Return how deep spheres [sphere 3] of radii [sphere] reach into a surface [m] (0: not at all), and which part's.

        Args:
            centers: [m].
            radii: [m].
            moving: the target counts too, in its scanned pose.
        """
        found = [self._static.penetration(centers, radii)]
        if moving:
            found.append(self._moving.penetration(centers, radii))
        if self._pedestal is not None:
            foot, radius = self._pedestal
            beside = np.linalg.norm(centers[:, :2] - foot[:2], axis=1) - radius
            gap = np.linalg.norm(np.maximum([beside, centers[:, 2] - foot[2]], 0.0), axis=0)
            found.append((float((radii - gap).max()), "its pedestal"))
        return max((0.0, ""), *found, key=lambda hit: hit[0])

    def standing_in(self, place: np.ndarray, low: float, high: float, radius: float) -> str | None:
        """Return whose surface reaches into an upright column [m] around a place (x, y), or None."""
        steps = np.arange(low, high, radius / 2)
        axis = np.concatenate([np.tile(place, (len(steps), 1)), steps[:, None]], axis=1)
        depth, owner = self.penetration(axis, np.full(len(axis), radius), moving=True)
        return owner if depth > 0.0 else None


class _Parts:
    """Some parts of a scene; their search trees are built once for all parts that are to be opened."""

    def __init__(self, scene: Scene, ids: Sequence[str]) -> None:
        self._ids = ids
        self._forest = Forest([scene.parts[i].mesh for i in ids])

    def penetration(self, centers: np.ndarray, radii: np.ndarray) -> Penetration:
        """Return how deep spheres [sphere 3] of radii [sphere] reach into a surface [m], and whose."""
        if not self._ids or not len(centers):
            return 0.0, ""
        index, gap = nearest_meshes(self._forest, centers, reach=float(radii.max()))
        depth = np.where(index >= 0, radii - gap, 0.0)
        k = int(np.argmax(depth))
        return (float(depth[k]), self._ids[index[k]]) if depth[k] > 0.0 else (0.0, "")


def _reaches(mesh: Mesh, place: np.ndarray, radius: float) -> bool:
    """Return True if the bounding box of a surface meets the square of half this width [m] around a place (x, y)."""
    if not len(mesh.faces):
        return False
    return bool((mesh.bounds[0, :2] <= place + radius).all() and (mesh.bounds[1, :2] >= place - radius).all())
