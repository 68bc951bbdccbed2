"""From a click or a dragged rectangle on the screen to places of the scan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.annotate.region import FrontRegion
from s2a.scene.mesh import Mesh
from s2a.view.page.rays import first_face

FAR = 3.5
"""[m] From farther away a wide front is not faced: rooms end."""
MIN_COSINE = 0.05
"""Of a ray with a front's normal; at less, the front is seen from its edge."""
GRID = np.linspace(0.1, 0.9, 7)
"""Fractions of a rectangle's sides at which is asked what it shows."""


@dataclass(frozen=True)
class CameraView:
    """A camera.

    Attributes:
        position: [m], shape [3].
        rotation: from its axes (right, down, forwards) to the scene's, shape [3 3].
        fov: vertical field of view [rad].
        aspect: width by height of the image.
    """

    position: np.ndarray
    rotation: np.ndarray
    fov: float
    aspect: float

    def ray(self, x: float, y: float) -> np.ndarray:
        """Return the direction through a place of the image, from 0, 0 at the top left to 1, 1, shape [3]."""
        half = np.tan(self.fov / 2)
        local = np.array([(2 * x - 1) * half * self.aspect, (2 * y - 1) * half, 1.0])
        return np.asarray(self.rotation @ (local / np.linalg.norm(local)))


def place(mesh: Mesh, origin: np.ndarray, direction: np.ndarray) -> tuple[int, np.ndarray] | None:
    """Return the face that a ray meets first, from its front, and where [m], shape [3]; None where it meets none."""
    distance, face = first_face(mesh, origin, direction, both_sides=False)
    return None if face < 0 else (face, origin + distance * direction)


def corners(
    view: CameraView, low: tuple[float, float], high: tuple[float, float], region: FrontRegion
) -> np.ndarray | None:
    """Return where the corners of a rectangle of the image lie on a front's plane [m] [4 3]; None if it is seen from its edge.

    Args:
        view: the camera.
        low: the rectangle's top left corner in the image, 0 to 1.
        high: its bottom right corner.
        region: the front.
    """
    found = []
    for x, y in ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])):
        ray = view.ray(x, y)
        against = float(ray @ region.normal)
        if abs(against) < MIN_COSINE:
            return None
        found.append(view.position + ray * float((region.center - view.position) @ region.normal) / against)
    return np.array(found)


def seen(view: CameraView, mesh: Mesh, low: tuple[float, float], high: tuple[float, float]) -> np.ndarray:
    """Return the faces that are seen on a grid of places within a rectangle of the image, that at its middle first."""
    grid = np.array([(x, y) for x in GRID for y in GRID])
    places = np.array(low) + grid[np.argsort(np.abs(grid - 0.5).max(axis=1), kind="stable")] * np.subtract(high, low)
    found = [place(mesh, view.position, view.ray(x, y)) for x, y in places]
    return np.array([face for face, _ in filter(None, found)], dtype=int)


def facing(region: FrontRegion, fov: float) -> tuple[np.ndarray, np.ndarray]:
    """Return where a camera stands that sees a front straight on with some room around it, and what it aims at [m], [3] each."""
    distance = 0.9 * float(region.size.max()) / np.tan(fov / 2) + 0.2
    return region.center + min(distance, FAR) * region.normal, region.center
