"""Support regions: where on a target things can stand, hang or be put inside, with outline, free area and clearance."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from scipy import ndimage
from skimage.measure import approximate_polygon, find_contours

from s2a.geometry.levels import LevelConfig, horizontal_levels, upright_planes
from s2a.geometry.planes import Plane, plane_axes
from s2a.geometry.planes import raster as covered
from s2a.geometry.rays import ray_mesh
from s2a.geometry.sight import sight
from s2a.scene import Mesh

Kind = Literal["horizontal", "vertical", "inside"]
KINDS: tuple[Kind, ...] = ("horizontal", "inside", "vertical")


@dataclass(frozen=True)
class RegionConfig:
    """How support regions are grown.

    Attributes:
        level: what is flat.
        cell: width of a cell of the grid on a region [m]; large regions have wider ones.
        cells: largest number of cells along a side.
        closing: gaps of the scan up to twice as many cells wide are closed.
        smallest: area below which a region is none [m^2].
        upright: area below which an upright region is none [m^2].
        free: room above a cell below which something stands on it [m].
        reach: what is higher above a region does not count [m].
        lift: rays start this far above the plane [m], beyond the noise of the scan.
        cover: share of a region below its own object that makes it an inside.
        wall: how far the object rises at a walled border [m].
    """

    level: LevelConfig
    cell: float
    cells: int
    closing: int
    smallest: float
    upright: float
    free: float
    reach: float
    lift: float
    cover: float
    wall: float


@dataclass(frozen=True, eq=False)
class Region:
    """A bounded flat piece of a target that can carry something.

    Attributes:
        kind: "horizontal", "vertical", or "inside" where the target's own surface is above it (a shelf's compartment).
        axes: rotation whose columns are the directions of the grid's rows and columns and the normal, shape [3 3].
        origin: corner of cell (0, 0) on the plane [m], shape [3].
        cell: width of a cell [m].
        support: which cells carry, shape [row column].
        clearances: room along the normal over each cell [m], 0 where something stands, at most the configured reach,
            shape [row column].
        walled: share of the border at which the target rises: about 1 in a basin or a tray, 0 on a table.
        smallest_room: clearance from which a cell counts as free [m].
    """

    kind: Kind
    axes: np.ndarray
    origin: np.ndarray
    cell: float
    support: np.ndarray
    clearances: np.ndarray
    walled: float
    smallest_room: float

    @property
    def normal(self) -> np.ndarray:
        """Direction away from the surface, shape [3]."""
        return self.axes[:, 2]

    @cached_property
    def center(self) -> np.ndarray:
        """Middle of the cells that carry [m], shape [3]."""
        return self.points(np.argwhere(self.support) + 0.5).mean(axis=0)

    @property
    def height(self) -> float:
        """Height of the middle above the scene's zero [m]."""
        return float(self.center[2])

    @property
    def area(self) -> float:
        """What carries [m^2]."""
        return float(self.support.sum() * self.cell**2)

    @cached_property
    def free(self) -> np.ndarray:
        """Which cells carry and have room, shape [row column]."""
        return self.support & (self.clearances >= self.smallest_room)

    @property
    def free_area(self) -> float:
        """What carries and has room [m^2]."""
        return float(self.free.sum() * self.cell**2)

    @property
    def clearance(self) -> float:
        """Median room over the free cells [m]; 0 if there are none."""
        return float(np.median(self.clearances[self.free])) if self.free.any() else 0.0

    @property
    def size(self) -> tuple[float, float]:
        """Extents along the grid's rows and columns [m]."""
        rows, columns = np.nonzero(self.support)
        return float(np.ptp(rows) + 1) * self.cell, float(np.ptp(columns) + 1) * self.cell

    @cached_property
    def outline(self) -> np.ndarray:
        """The longest border as a closed polygon on the plane [m], shape [corner 3]."""
        borders = find_contours(np.pad(self.support, 1).astype(float), 0.5)
        border = approximate_polygon(max(borders, key=len), tolerance=1.0)
        return self.points(border[:-1] - 0.5)

    def points(self, cells: np.ndarray) -> np.ndarray:
        """Return the points on the plane [m] at places of the grid [point 2], in cells, shape [point 3]."""
        return self.origin + self.cell * cells @ self.axes[:, :2].T

    def places(self, points: np.ndarray) -> np.ndarray:
        """Return where points [point 3] lie over the grid, in cells, and how far above the plane [m], shape [point 3]."""
        local = (points - self.origin) @ self.axes
        local[:, :2] /= self.cell
        return local


def support_regions(
    mesh: Mesh, config: RegionConfig, around: Mesh | None = None, kinds: tuple[Kind, ...] = KINDS
) -> list[Region]:
    """Return the regions of a target, largest first, level ones before upright ones.

    Args:
        mesh: the target's surface in the scene, looking outwards; noise of 1 to 2 mm, holes and open edges are expected.
        config: how they are grown.
        around: what else is there and takes room, the target's surface included; None: the target alone.
        kinds: the wanted ones; looking for upright ones takes longest.
    """
    if not len(mesh.faces):
        return []
    level = (
        [(plane, config.smallest) for plane in horizontal_levels(mesh, config.level)]
        if set(kinds) != {"vertical"}
        else []
    )
    upright = [(plane, config.upright) for plane in upright_planes(mesh, config.level)] if "vertical" in kinds else []
    own, whole = ray_mesh(mesh.vertices, mesh.faces), None
    if around is not None:
        whole = ray_mesh(around.vertices, around.faces)
    found = []
    for planes in (level, upright):
        some = [region for plane, area in planes for region in _split(mesh, plane, area, own, whole, config)]
        found += sorted((region for region in some if region.kind in kinds), key=lambda region: -region.area)
    return found


def _split(mesh: Mesh, plane: Plane, smallest: float, own, whole, config: RegionConfig) -> list[Region]:
    """Return the connected regions of a plane."""
    corners = mesh.vertices[mesh.faces[plane.faces]].astype(np.float64)
    axes = plane_axes(plane.normal, corners.reshape(-1, 3))
    flat = corners @ axes[:, :2]
    low, extent = flat.min(axis=(0, 1)), np.ptp(flat, axis=(0, 1))
    cell = max(config.cell, float(extent.max()) / config.cells)
    labels, count = ndimage.label(covered(flat - low, cell, config.closing))
    origin = axes[:, :2] @ low + plane.normal * plane.offset
    found = []
    for place, number in zip(ndimage.find_objects(labels), range(1, count + 1), strict=True):
        support = labels[place] == number
        if support.sum() * cell**2 >= smallest:
            corner = origin + cell * axes[:, :2] @ np.array([place[0].start, place[1].start])
            found.append(_measured(axes, corner, cell, support, own, whole, config))
    return found


def _measured(axes, origin, cell: float, support: np.ndarray, own, whole, config: RegionConfig) -> Region:
    """Return a region with its clearances, its walls and its kind."""
    normal = axes[:, 2]
    cells = np.argwhere(support)
    start = origin + cell * (cells + 0.5) @ axes[:, :2].T + config.lift * normal
    above, _ = sight(own, start, normal, config.reach)
    kind: Kind = "horizontal" if np.mean(above < config.reach) < config.cover else "inside"
    if abs(normal[2]) < 0.5:
        kind = "vertical"
    clearances = np.zeros(support.shape)
    # From behind: another thing stands here, or the target's own next board, whose underside was not scanned, is above.
    room, behind = (above, above < 0) if whole is None else sight(whole, start, normal, config.reach)
    standing = behind & (room < above - config.lift)
    clearances[support] = np.where(standing, 0.0, np.minimum(room, above))
    walled = _walled(axes, origin, cell, support, own, config)
    return Region(kind, axes, origin, cell, support, clearances, walled, config.free)


def _walled(axes, origin, cell: float, support: np.ndarray, own, config: RegionConfig) -> float:
    """Return the share of a region's border cells beyond which the target rises.

    From each border cell a level ray runs outwards, at the height that a wall has at least, as far as a wall may lie back.
    """
    solid = ndimage.binary_fill_holes(support)
    border = np.argwhere(solid & ~ndimage.binary_erosion(solid))
    slope = np.stack(np.gradient(ndimage.gaussian_filter(np.pad(solid, 2).astype(float), 1.5)), axis=-1)[2:-2, 2:-2]
    out = -slope[tuple(border.T)] @ axes[:, :2].T
    out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-9)
    start = origin + cell * (border + 0.5) @ axes[:, :2].T + config.wall * axes[:, 2]
    way, _ = sight(own, start, out, 4 * config.wall)
    return float(np.mean(way < 4 * config.wall))
