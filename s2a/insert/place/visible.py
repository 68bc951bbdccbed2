"""Is an object in its place seen by who stands before its support, or hidden behind something taller?"""

from __future__ import annotations

import numpy as np

from s2a.geometry.line_of_sight import visible_distance
from s2a.geometry.mesh_ops import sample
from s2a.geometry.mesh_query import RayMesh, ray_mesh
from s2a.geometry.regions import Region
from s2a.insert.place.preferences import floor_height
from s2a.insert.place.supports import facing, nearby
from s2a.scene import Mesh, Scene

SEEN = 0.5
"""Least visible fraction of an object that is not hidden."""
EYE, AWAY, ABOVE = 1.45, 1.0, 0.1
"""Height of the eyes above the floor, their distance, and their least height over the object's middle [m]."""
AZIMUTHS = np.radians([0.0, 35.0, -35.0])
"""Directions of the eyes from the front of the support [rad]: an object is seen from two of them."""
POINTS = 60
GAP = 0.004
"""Rays start this far from the surface [m]."""


class SupportView:
    """Visibility on a level region of a part by who stands before it."""

    def __init__(self, scene: Scene, region: Region, target: str) -> None:
        self._scene, self._front = scene, facing(scene, target, region)
        self._inside, self._floor = region.kind == "inside", floor_height(scene)

    def hides(self, object: Mesh) -> bool:
        """Return True if other things hide most of an object in its place."""
        points = sample(object, POINTS, seed=0).astype(np.float64)
        middle = object.bounds.mean(axis=0).astype(np.float64)
        height = middle[2] + ABOVE if self._inside else max(self._floor + EYE, middle[2] + ABOVE)
        eyes = np.array([[*(middle[:2] + AWAY * self._turned(angle)), height] for angle in AZIMUTHS])
        low, high = np.minimum(points.min(axis=0), eyes.min(axis=0)), np.maximum(points.max(axis=0), eyes.max(axis=0))
        around = nearby(self._scene, low - 0.05, high + 0.05)
        if not len(around.faces):
            return False
        rays = ray_mesh(around.vertices, around.faces)
        return float(np.median([_visible(rays, points, eye) for eye in eyes])) < SEEN

    def _turned(self, angle: float) -> np.ndarray:
        x, y = self._front[:2]
        return np.array([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y])


def _visible(rays: RayMesh, points: np.ndarray, eye: np.ndarray) -> float:
    """Return the fraction of points [point 3] that obstacles leave visible to an eye [3]."""
    away = eye - points
    distance = np.linalg.norm(away, axis=1)
    direction = away / distance[:, None]
    seen, _ = visible_distance(rays, points + GAP * direction, direction, float(distance.max()))
    return float((seen >= distance - 2 * GAP).mean())
