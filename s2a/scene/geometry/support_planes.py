"""Planar patches of a noisy surface on which objects can stand or hang."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.core.ranges import Count, CountFromZero, NotNegative, Positive
from s2a.scene.geometry.mesh_ops import centroids, normals
from s2a.scene.geometry.planes import Plane, find_planes
from s2a.scene.scene import Mesh

UP = np.array([0.0, 0.0, 1.0])
ROUGH = 0.5
"""Faces whose own normal is tilted by more than 60° are excluded from the smoothing, which would soften the edges of steps."""


@dataclass(frozen=True)
class PlaneConfig:
    """Detection of planar patches.

    Attributes:
        max_tilt: largest angle between the smoothed normal of a face and the plane's direction [rad].
        smoothing_rounds: how often normals are averaged over neighbouring faces.
        tolerance: largest distance of a face's centroid from the plane [m].
        max_slope: largest slope of a horizontal plane, rise per run; scanned floors are not quite level.
        bin_height: height of the slices in which horizontal planes are detected [m].
        min_area: smallest area of a plane [m^2].
        max_planes: largest number of planes.
    """

    max_tilt: NotNegative
    smoothing_rounds: CountFromZero
    tolerance: Positive
    max_slope: NotNegative
    bin_height: Positive
    min_area: NotNegative
    max_planes: Count


def smoothed_normals(mesh: Mesh, direction: np.ndarray, rounds: int) -> np.ndarray:
    """Return each face's normal averaged over its neighbours, shape [face 3]; zero for faces with another direction.

    Only faces that look roughly along `direction` are averaged, so that a step of the surface keeps its edge.
    """
    facing = normals(mesh)
    chosen = np.flatnonzero(facing @ direction > ROUGH)
    faces, field = mesh.faces[chosen], facing[chosen] * mesh.face_areas[chosen, None]
    for _ in range(rounds):
        at_vertex = np.stack(
            [np.bincount(faces.ravel(), np.repeat(axis, 3), len(mesh.vertices)) for axis in field.T], axis=1
        )
        field = at_vertex[faces].sum(axis=1)
    smooth = np.zeros(mesh.faces.shape)
    length = np.sqrt(np.einsum("ij,ij->i", field, field))[:, None]
    smooth[chosen] = np.divide(field, length, out=np.zeros(field.shape), where=length > 0)
    return smooth


def horizontal_planes(mesh: Mesh, config: PlaneConfig) -> list[Plane]:
    """Return the horizontal planes of a surface that face up, in the order of their detection.

    The most common height is taken first, a slightly sloping plane is fitted to it, and its faces leave the search:
    the basin, the rim and the counter of a sink come one by one.
    """
    faces_up = smoothed_normals(mesh, UP, config.smoothing_rounds) @ UP > np.cos(config.max_tilt)
    left = np.flatnonzero(faces_up & (mesh.face_areas > 0))
    middle, areas = centroids(mesh), mesh.face_areas
    found: list[Plane] = []
    while len(found) < config.max_planes and areas[left].sum() > config.min_area:
        taken, normal, offset = _level(middle[left], areas[left], config)
        if areas[left[taken]].sum() > config.min_area:
            found.append(Plane(normal, offset, left[taken]))
        left = left[~taken]
    return found


def vertical_planes(mesh: Mesh, config: PlaneConfig) -> list[Plane]:
    """Return the vertical planes of a surface, largest first."""
    upright = np.abs(normals(mesh)[:, 2]) < 0.5
    if not upright.any():
        return []
    chosen = np.flatnonzero(upright)
    part = Mesh(mesh.vertices, mesh.faces[chosen])
    planes = find_planes(part, config.tolerance, config.min_area, config.max_planes)
    level = [plane for plane in planes if abs(plane.normal[2]) < np.sin(config.max_tilt)]
    return [Plane(plane.normal, plane.offset, chosen[plane.faces]) for plane in level]


def _level(middle: np.ndarray, areas: np.ndarray, config: PlaneConfig) -> tuple[np.ndarray, np.ndarray, float]:
    """Return which faces belong to the most common height, shape [face], with the normal and offset of their plane."""
    heights = middle[:, 2]
    slices = ((heights - heights.min()) / config.bin_height).astype(int)
    area = np.convolve(np.bincount(slices, areas), [0.5, 1.0, 0.5], mode="same")
    top = heights.min() + (np.argmax(area) + 0.5) * config.bin_height
    taken = np.abs(heights - top) < config.tolerance
    normal, offset = UP, float(top)
    for _ in range(3):
        if taken.sum() < 4:
            break
        normal, offset = _fit_level(middle[taken], areas[taken], config.max_slope)
        taken = np.abs(middle @ normal - offset) < config.tolerance
    return (taken if taken.any() else slices == np.argmax(area)), normal, offset


def _fit_level(points: np.ndarray, weights: np.ndarray, slope: float) -> tuple[np.ndarray, float]:
    """Return normal and offset of the nearly horizontal plane that fits points best; its slope is limited."""
    center = np.average(points, axis=0, weights=weights)
    flat = points - center
    # A floor of one tilt: what is smaller than a few centimetres gets none, by a pull equal to 2 cm of spread.
    spread = (flat[:, :2] * weights[:, None]).T @ flat[:, :2] + np.eye(2) * weights.sum() * 0.02**2
    tilt = np.linalg.solve(spread, (flat[:, :2] * weights[:, None]).T @ flat[:, 2])
    tilt *= min(1.0, slope / max(float(np.linalg.norm(tilt)), 1e-9))
    normal = np.array([-tilt[0], -tilt[1], 1.0])
    normal /= np.linalg.norm(normal)
    return normal, float(normal @ center)
