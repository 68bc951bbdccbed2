"""The tops of level supports: flat boxes over all of their extent, on which whatever stands there stands without steps.

Convex hulls of a scanned table follow its surface to a voxel: where two of them meet is a step of some millimetres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from s2a.core.ranges import Count, CountFromZero, Fraction, Positive
from s2a.scene.geometry.convex import contains
from s2a.scene.geometry.mesh_ops import centroids, normals
from s2a.scene.geometry.planes import TILT, Plane, slabs
from s2a.scene.scene import Mesh

GRID = 5
"""Points along each side of an object's outline below which a top is looked for."""
INSIDE = 1e-3
"""[m] Below the top, for those points."""


@dataclass(frozen=True)
class TopConfig:
    """How a level top is found.

    Attributes:
        band: largest distance of its faces from where an object stands on it [m].
        unevenness: largest distance from its height of `level_fraction` of it [m]; a bed has no level top.
        level_fraction: of its area.
        cell: width of the cells of which its boxes are made [m].
        closing: holes of up to twice as many cells are closed.
        boxes: largest number of boxes.
        headroom: what hulls of the support reach above the top is cut off up to this height [m].
    """

    band: Positive
    unevenness: Positive
    level_fraction: Fraction
    cell: Positive
    closing: CountFromZero
    boxes: Count
    headroom: Positive


@dataclass(frozen=True, eq=False)
class LevelTop:
    """The level top of a support.

    Attributes:
        part: id of the support.
        height: of the top [m].
        boxes: that end there, scene coordinates.
        layer: what the support's other hulls leave to them, convex hulls, scene coordinates.
    """

    part: str
    height: float
    boxes: tuple[Mesh, ...]
    layer: tuple[Mesh, ...]

    def carries(self, low: np.ndarray, high: np.ndarray) -> bool:
        """Return True if there is a box below each of the points of an outline from `low` to `high` [2]."""
        sides = [np.linspace(low[k], high[k], GRID) for k in range(2)]
        points = np.stack(np.meshgrid(*sides, [self.height - INSIDE], indexing="ij"), axis=-1).reshape(-1, 3)
        return bool(np.any([contains(each, points) for each in self.boxes], axis=0).all())


def level_top(part: str, mesh: Mesh, ground: float, thickness: float, config: TopConfig) -> LevelTop | None:
    """Return the top of a support at the height where an object was found to stand; None where that is not level.

    Args:
        part: id of the support.
        mesh: its surface.
        ground: height [m].
        thickness: of the boxes [m].
        config: how.
    """
    height, areas = centroids(mesh)[:, 2], mesh.face_areas
    near = np.flatnonzero((np.abs(height - ground) < config.band) & (normals(mesh)[:, 2] > TILT) & (areas > 0))
    if not len(near):
        return None
    middle = _median(height[near], areas[near])
    flat = near[np.abs(height[near] - middle) <= config.unevenness]
    if areas[flat].sum() < config.level_fraction * areas[near].sum():
        return None
    plane = Plane(np.array([0.0, 0.0, 1.0]), middle, flat)
    boxes = slabs(mesh, plane, config.cell, config.closing, thickness, config.boxes)
    layer = tuple(_raised(each, middle - thickness / 2, config.headroom) for each in boxes)
    return LevelTop(part, middle, tuple(boxes), layer)


def reused(tops: Sequence[LevelTop], part: str, ground: float, band: float) -> LevelTop | None:
    """Return the top of a part that was found before at nearly this height [m]."""
    return next((top for top in tops if top.part == part and abs(top.height - ground) < band), None)


def _raised(hull: Mesh, above: float, height: float) -> Mesh:
    """Return a hull whose vertices above some height are raised [m]."""
    return Mesh(hull.vertices + np.where(hull.vertices[:, 2:] > above, [0.0, 0.0, height], 0.0), hull.faces)


def _median(values: np.ndarray, weights: np.ndarray) -> float:
    """Return the weighted median."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, total[-1] / 2)])
