"""What one scan tells of a moving part's front: its plane and its sides, each with the uncertainty that the scan leaves.

A scan's noise is shared by neighbouring points (`conf/synth`: over 30 mrad, 5 cm at 1.6 m), so a plane is fitted to the mean
heights of cells, and their scatter tells how well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.diff.refine_sides import Faces, FrontSide, find_sides
from s2a.evidence.front import FLAT, Front, panel
from s2a.geometry.mesh_ops import centroids, normals

CELL = 0.05
"""[m] Largest width of the cells whose mean heights are fitted."""
SHARED = 0.1
"""[m] Cells this wide have noise of their own: twice the length over which the scanners' noise is shared."""
NEAR = 0.015
"""[m] Faces farther from the plane are no part of it: panels in a frame, mouldings, handles."""
MIN_SCATTER = 0.0004
"""[m] A cell's height is not known better, however well the cells of a small front agree."""
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
    points, facing, areas = centroids(mesh), normals(mesh), mesh.face_areas.astype(float)
    normal, center, axes = _start(points, facing, areas, front)
    for _ in range(3):
        height = (points - center) @ normal
        flat = (np.abs(height) < NEAR) & (np.abs(facing @ normal) > 0.8) & (areas > 0)
        fitted = _plane((points[flat] - center) @ axes, height[flat], areas[flat])
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


def _plane(flat: np.ndarray, height: np.ndarray, areas: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Return offset and slopes of the plane through cells' mean heights, robustly, and their covariance [3 3].

    Args:
        flat: places in the plane [m], shape [face 2].
        height: over it [m], shape [face].
        areas: of the faces [m^2], shape [face].
    """
    if len(flat) < 12:
        return None
    cell = float(np.clip(np.ptp(flat, axis=0).min() / 3.0, 0.015, CELL))
    index = np.unique(np.floor(flat / cell).astype(int), axis=0, return_inverse=True)[1].ravel()
    total = np.bincount(index, areas)
    mean = np.stack([np.bincount(index, areas * v) for v in (*flat.T, height)], axis=1) / total[:, None]
    filled = np.minimum(1.0, total / np.median(total))
    keep = filled > 0.2
    if keep.sum() < 5:
        return None
    design = np.column_stack([np.ones(keep.sum()), mean[keep, :2]])
    target, filled, weight = mean[keep, 2], filled[keep], filled[keep]
    for _ in range(10):
        solution = np.linalg.lstsq(design * np.sqrt(weight)[:, None], target * np.sqrt(weight), rcond=None)[0]
        residual = target - design @ solution
        scatter = max(MIN_SCATTER, 1.4826 * float(np.median(np.abs(residual))))
        weight = filled / (1.0 + (residual / (2.0 * scatter)) ** 2)
    # Smaller cells share their noise with neighbours.
    factor = (SHARED / cell) ** 2
    information = (design * weight[:, None]).T @ design
    return solution, factor * scatter**2 * np.linalg.pinv(information)
