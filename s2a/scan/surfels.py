"""Surfels of a mesh: points with normals, evenly spread over its surface, and the directions that they face."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

SAMPLES = 60_000  # Points drawn from a surface, in proportion to the areas of its faces
DIVISIONS = 128  # Edges of the grid's cells along the diagonal of what was scanned

_TAIL = 0.005  # fraction of the points beyond either end of an extent: strays of a reconstruction
_SEEDS = 500  # normals from which directions are searched
_LIMIT = 10  # directions at most
_MIN_FACING = 0.02  # fraction of the surface that faces a direction
_SMOOTH = 0.97  # length of the mean normal in three cells of a plane, shelf or front


@dataclass(frozen=True, eq=False)
class Surfels:
    """Points of a surface, one for each cell of a grid and side of a cube that its faces look to."""

    points: np.ndarray  # in the unit of the mesh, shape [surfel 3]
    normals: np.ndarray  # unit vectors, shape [surfel 3]
    weights: np.ndarray  # fraction of the surface, shape [surfel]; lower where normals within the cell differ
    cell: float  # edge of the grid's cells, in the unit of the mesh

    @cached_property
    def smooth(self) -> np.ndarray:
        """Surfels whose surroundings, three cells wide, face the same direction, shape [surfel]."""
        group = np.unique(_cells(self.points, self.normals, 3 * self.cell), return_inverse=True)[1]
        total = np.stack([np.bincount(group, self.weights * self.normals[:, k]) for k in range(3)], axis=1)
        length: np.ndarray = np.linalg.norm(total, axis=1) / np.bincount(group, self.weights)
        return (length > _SMOOTH)[group]

    def extent(self, direction: np.ndarray) -> tuple[float, float]:
        """Return between which coordinates along a direction [3] all but half a percent of the surface lies, at either end."""
        low, high = quantiles(self.points @ direction, self.weights, (_TAIL, 1 - _TAIL))
        return float(low), float(high)


@dataclass(frozen=True, eq=False)
class Sampled:
    """A mesh as points that are evenly spread over it."""

    points: np.ndarray  # in the unit of the mesh, shape [point 3]
    normals: np.ndarray  # unit vectors, shape [point 3]

    @cached_property
    def surfels(self) -> Surfels:
        """The surfels."""
        return surfels(self.points, self.normals)

    @cached_property
    def directions(self) -> np.ndarray:
        """The axes that much of it faces, shape [axis 3]."""
        return directions(self.surfels)

    def height(self, up: np.ndarray) -> float:
        """Return the extent along a direction [3] without strays, in the unit of the mesh."""
        low, high = np.quantile(self.points @ up, (_TAIL, 1 - _TAIL))
        return float(high - low)


def quantiles(values: np.ndarray, weights: np.ndarray, fractions: tuple[float, ...]) -> np.ndarray:
    """Return weighted quantiles of values [n] at some fractions."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return np.interp(np.array(fractions) * total[-1], total, values[order])


def sample(vertices: np.ndarray, faces: np.ndarray, count: int = SAMPLES) -> Sampled:
    """Return points evenly spread over a mesh, of vertices [vertex 3] and faces [face 3]; the same for the same mesh."""
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double_area = np.linalg.norm(normals, axis=1)
    total = np.cumsum(double_area)
    index = np.arange(count)
    face = np.minimum(np.searchsorted(total, (index + 0.5) * total[-1] / count), len(faces) - 1)
    # The R2 sequence covers the unit square evenly.
    root, along = np.sqrt((0.7548776662466927 * index) % 1), (0.5698402909980532 * index) % 1
    barycentric = np.stack([1 - root, root * (1 - along), root * along], axis=1)
    points: np.ndarray = (barycentric[:, :, None] * corners[face]).sum(axis=1)
    return Sampled(points, normals[face] / double_area[face, None])


def surfels(points: np.ndarray, normals: np.ndarray) -> Surfels:
    """Return the surfels of evenly spread points and their normals, shape [point 3] each; strays are left out."""
    low, high = np.quantile(points, [_TAIL, 1 - _TAIL], axis=0)
    cell = float(np.linalg.norm(high - low)) / DIVISIONS
    near = ((points > low - 4 * cell) & (points < high + 4 * cell)).all(axis=1)
    points, normals = points[near], normals[near]
    group, count = np.unique(_cells(points, normals, cell), return_inverse=True, return_counts=True)[1:]
    mean, facing = (
        np.stack([np.bincount(group, values[:, k]) for k in range(3)], axis=1) for values in (points, normals)
    )
    length = np.linalg.norm(facing, axis=1)
    return Surfels(mean / count[:, None], facing / np.maximum(length, 1e-9)[:, None], length / length.sum(), cell)


def directions(surface: Surfels) -> np.ndarray:
    """Return the axes that much of a surface faces, either way, and the axes square to two of them, unit, shape [axis 3]."""
    normals, weights = surface.normals, surface.weights
    total = np.cumsum(weights)
    seeds = normals[np.searchsorted(total, (np.arange(_SEEDS) + 0.5) / _SEEDS * total[-1]).clip(0, len(weights) - 1)]
    mass = (np.abs(seeds @ normals.T) > cos(10)) @ weights
    axes: list[np.ndarray] = []
    left = mass > _MIN_FACING
    while left.any() and len(axes) < _LIMIT:
        seed = int(np.argmax(np.where(left, mass, -1.0)))
        axis = _refined(surface, seeds[seed])
        left &= np.abs(seeds @ axis) < cos(15)
        left[seed] = False
        if _is_new(axis, axes, 12):
            axes.append(axis)
    for second in range(1, min(4, len(axes))):
        for first in range(second):
            axis = np.cross(axes[first], axes[second])
            length = float(np.linalg.norm(axis))
            if length > 0.7 and _is_new(axis / length, axes, 10):
                axes.append(axis / length)
    return np.array(axes).reshape(-1, 3)


def cos(degrees: float) -> float:
    """Return the cosine of an angle [deg]."""
    return float(np.cos(np.radians(degrees)))


def _refined(surface: Surfels, axis: np.ndarray) -> np.ndarray:
    """Return the mean of the normals near an axis, either way; the circle narrows."""
    for degrees in (14, 10, 8, 8, 8):
        along = surface.normals @ axis
        near = np.abs(along) > cos(degrees)
        axis = (surface.weights[near] * np.sign(along[near])) @ surface.normals[near]
        axis = axis / np.linalg.norm(axis)
    return axis


def _is_new(axis: np.ndarray, axes: list[np.ndarray], degrees: float) -> bool:
    return not axes or float(np.abs(np.array(axes) @ axis).max()) < cos(degrees)


def _cells(points: np.ndarray, normals: np.ndarray, edge: float) -> np.ndarray:
    """Return a number for the cell and the side of a cube that each point lies in and faces, shape [point]."""
    axis = np.argmax(np.abs(normals), axis=1)
    side = 2 * axis + (normals[np.arange(len(normals)), axis] > 0)
    cells = np.floor((points - points.min(axis=0)) / edge).astype(np.int64)
    return np.ravel_multi_index(tuple(cells.T), tuple(cells.max(axis=0) + 1)) * 6 + side
