"""The sides of a front: where its faces stop being annotated as its own.

A logistic regression of the label on the place, as borders are ragged: annotators err by some faces, to either side alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.scan.evidence.surface import ScanSurface
from s2a.scan.evidence.sweep import moved_parts
from s2a.scene.geometry.mesh_ops import centroids

BAND = 0.03
"""[m] To each side of an edge faces tell where it is: two standard deviations of a hasty annotator's border, and the gap."""
FEW = 10
"""Faces from which on they tell anything."""
BIN = 0.03
"""[m] Sections of a border in which its farthest face is looked for."""
HEAVIEST = 4.0
"""Times the mean area: a face weighs no more, for it is one annotation."""
STEEP = 20.0
"""[1/m] Logits per metre across a border; less is a mixture over more than the band."""
SPREAD = 2.0
"""Variance of labels over that of independent ones: neighbouring faces share a nearest place; checked against true sides."""
END = 0.005
"""[m] Standard deviation of the place of a side that is only known from where own faces end."""
SKEW = 0.1
"""[rad] A border that runs more askew, or may do so, is none."""
BORDER = 0.003
"""[m] Standard deviation of a fitted side's place, besides what its fit says: rounded edges, gaps, edge pulls."""


class Faces:
    """The faces of a scanned room, measured once.

    Attributes:
        surface: the room.
        middles: of the faces [m], shape [face 3].
        areas: of the faces [m^2], shape [face].
    """

    def __init__(self, surface: ScanSurface) -> None:
        """Measure them."""
        self.surface = surface
        self.middles = centroids(surface.mesh)
        self.areas = surface.mesh.face_areas

    def own(self, part: str, faces: np.ndarray) -> np.ndarray:
        """Return which of some faces [face] move with a part, shape [face]."""
        ids = [self.surface.ids.index(i) for i in moved_parts(self.surface.scene, part)]
        return np.isin(self.surface.owner[faces], ids)

    def near(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Return the faces whose middles lie in a box with these corners [m], shape [face]."""
        found = np.arange(len(self.middles))
        for axis in range(3):
            place = self.middles[found, axis]
            found = found[(place >= low[axis]) & (place <= high[axis])]
        return found


@dataclass(frozen=True)
class FrontSide:
    """A straight side of a front.

    Attributes:
        outward: unit direction in the front's plane, across the side, out of the front, shape [3].
        along: unit direction of the side, shape [3].
        middle: a point on it, in the middle [m], shape [3].
        sigma: standard deviation of its place [m].
        angle: standard deviation of its direction in the plane [rad]; inf where it is not told.
    """

    outward: np.ndarray
    along: np.ndarray
    middle: np.ndarray
    sigma: float
    angle: float


def find_sides(
    faces: Faces, part: str, normal: np.ndarray, center: np.ndarray, axes: np.ndarray, extent: float
) -> tuple[FrontSide, ...]:
    """Return the four sides of a front that is a rectangle; none where too few faces are its own.

    Args:
        faces: of the room.
        part: id of the part.
        normal: of its front, shape [3].
        center: of the front [m], shape [3].
        axes: directions of its sides, as columns, shape [3 2].
        extent: length of its diagonal [m].
    """
    reach = extent / 2 + 2 * BAND
    near = faces.near(center - reach, center + reach)
    near = near[np.abs((faces.middles[near] - center) @ normal) < BAND]
    place, mine, weights = (faces.middles[near] - center) @ axes, faces.own(part, near), faces.areas[near]
    found: list[FrontSide] = []
    if mine.sum() < FEW:
        return ()
    for k in (0, 1):
        for sign in (-1.0, 1.0):
            border = sign * np.quantile(sign * place[mine, k], 0.98)
            half = np.quantile(np.abs(place[mine, 1 - k]), 0.98)
            band = (np.abs(place[:, k] - border) < BAND) & (np.abs(place[:, 1 - k]) < half - 0.01)
            x, t = sign * (place[band, k] - border), place[band, 1 - k]
            offset, slope, sigma, angle = _border(x, t, mine[band], weights[band])
            outward, along = sign * axes[:, k], axes[:, 1 - k]
            point = center + axes[:, k] * (border + sign * offset)
            # Where the border runs outwards by `slope` per metre along.
            found.append(
                FrontSide(
                    outward - slope * along,
                    along + slope * outward,
                    point,
                    float(np.hypot(sigma, BORDER)),
                    angle,
                )
            )
    return tuple(found)


def _border(x: np.ndarray, t: np.ndarray, mine: np.ndarray, areas: np.ndarray) -> tuple[float, float, float, float]:
    """Return where a border between own and other faces runs: place at t = 0, slope, and the standard deviations of both.

    Args:
        x: place across the border, outwards [m], shape [face].
        t: place along it [m], shape [face].
        mine: which faces are the front's own, shape [face].
        areas: of the faces, shape [face].
    """
    if mine.sum() < FEW or np.ptp(t) < BIN:
        return 0.0, 0.0, BAND / 2, np.inf
    last = _last(x[mine], t[mine])
    if (~mine).sum() < FEW:  # nothing beside it: the surface ends
        return last, 0.0, END, np.inf
    weight = np.minimum(areas / areas.mean(), HEAVIEST)
    scale = np.array([1.0, 0.01, max(0.01, float(np.std(t)))])
    design = np.column_stack([np.ones(len(x)), x, t]) / scale
    solution = np.array([0.0, -1.0, 0.0])
    ridge = np.diag([1e-3, 1e-2, 1e-3])
    for _ in range(40):
        chance = 1.0 / (1.0 + np.exp(-np.clip(design @ solution, -30, 30)))
        gradient = design.T @ (weight * (mine - chance)) - ridge @ (solution - [0.0, -1.0, 0.0])
        curvature = (design * (weight * chance * (1 - chance))[:, None]).T @ design + ridge
        step = np.linalg.solve(curvature, gradient)
        solution = solution + step / max(1.0, float(np.abs(step).max()))
    constant, across, along = solution / scale
    if across > -STEEP:  # own and other faces are mixed over more than the band: no border
        return last, 0.0, BAND / 2, np.inf
    covariance = np.linalg.inv(curvature) / np.outer(scale, scale) * SPREAD
    # place = -(constant + along t) / across
    offset, slope = -constant / across, -along / across
    sigma = float(np.sqrt(covariance[0, 0])) / abs(across)
    angle = float(np.sqrt(covariance[2, 2])) / abs(across)
    if offset < -BAND or abs(slope) > SKEW or angle > SKEW:
        return last, 0.0, END, np.inf
    return min(float(offset), last), float(slope), sigma, angle


def _last(x: np.ndarray, t: np.ndarray) -> float:
    """Return how far own faces reach outwards, typically along a border [m]: the median of the farthest in each 3 cm."""
    index = np.unique(np.floor(t / BIN), return_inverse=True)[1]
    farthest = np.full(index.max() + 1, -np.inf)
    np.maximum.at(farthest, index, x)
    return float(np.median(farthest))
