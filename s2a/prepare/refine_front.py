"""What one scan tells of a moving part's front: its plane and its sides, each with the uncertainty that the scan leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.prepare.refine_plane import fitted_plane, inner, spread
from s2a.prepare.refine_sides import Faces, FrontSide, find_sides
from s2a.scan.evidence.front import FLAT, Front, panel
from s2a.scene.geometry.mesh_ops import centroids, normals

NEAR = 0.015
"""[m] Faces farther from the plane are no part of it: panels in a frame, mouldings, handles."""
RECTANGLE = 0.9
"""Fill of its rectangle from which a front has straight sides; an ellipse fills 0.79."""


@dataclass(frozen=True)
class Seen:
    """A front as the scan shows it.

    Attributes:
        normal: unit, outwards, shape [3].
        center: a point of the plane, in the middle [m], shape [3].
        tilt: covariance of the normal's directions in the plane [rad^2], shape [3 3], of rank 2.
        height: standard deviation of the plane's place [m].
        sides: the four sides; empty for a round front.
        thickness: of the part behind the plane, as far as it is seen [m].
    """

    normal: np.ndarray
    center: np.ndarray
    tilt: np.ndarray
    height: float
    sides: tuple[FrontSide, ...]
    thickness: float

    def sigma(self, direction: np.ndarray) -> float:
        """Return the standard deviation of the angle between the normal and a unit direction in the plane [3] [rad]."""
        return float(np.sqrt(direction @ self.tilt @ direction))


def seen_front(faces: Faces, part: str, front: Front) -> Seen | None:
    """Return what the scan tells of the front of a moving part, or None where it is too small to tell anything."""
    mesh = panel(faces.surface.scene, part)
    if not mesh.face_areas.any():
        return None
    normal, center, axes = _start(centroids(mesh), normals(mesh), mesh.face_areas.astype(float), front)
    points, facing, area = spread(mesh)
    for _ in range(3):
        height = (points - center) @ normal
        plane = (np.abs(height) < NEAR) & (np.abs(facing @ normal) > 0.8)
        if not plane.any():
            return None
        flat, height = (points[plane] - center) @ axes, height[plane]
        within = inner(flat)
        fitted = fitted_plane(flat[within], height[within], area)
        if fitted is None:
            return None
        (offset, *slope), covariance = fitted
        center = center + offset * normal
        normal = normal - axes @ np.array(slope)
        normal /= np.linalg.norm(normal)
        axes = _upright(axes, normal)
    tilt = axes @ covariance[1:, 1:] @ axes.T
    sides: tuple[FrontSide, ...] = ()
    if front.fill > RECTANGLE:
        sides = find_sides(faces, part, normal, center, axes, float(np.linalg.norm(front.size)))
    return Seen(normal, center, tilt, float(np.sqrt(covariance[0, 0])), sides, front.thickness)


def _upright(axes: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return the directions [3 2] turned into the plane across a normal."""
    axes = axes - np.outer(normal, normal @ axes)
    return axes / np.linalg.norm(axes, axis=0)


def _start(
    points: np.ndarray, facing: np.ndarray, areas: np.ndarray, front: Front
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return normal, centre and axes of the plane with most of a part's area near it.

    The largest plane of a window may run obliquely through its frame and its pane; what its faces look at does not.
    """
    found = []
    like = facing @ front.normal
    mean = np.average(facing[like > 0.9], axis=0, weights=areas[like > 0.9]) if (like > 0.9).any() else front.normal
    for normal in (front.normal, mean / np.linalg.norm(mean)):
        height = (points - front.center) @ normal
        levels = np.arange(-0.05, 0.05, 0.002)
        near = np.abs(height[:, None] - levels) < FLAT
        area = areas @ near
        best = float(np.mean(levels[area >= area.max() * (1 - 1e-9)]))
        found.append((float(area.max()), normal, front.center + best * normal))
    _, normal, center = max(found, key=lambda item: item[0])
    return normal, center, _upright(front.axes, normal)
