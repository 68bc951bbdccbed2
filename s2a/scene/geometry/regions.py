"""Support regions of a target for standing, hanging or contained objects, with outline, free area and clearance."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from scipy import ndimage
from skimage.measure import approximate_polygon, find_contours

from s2a.core.bounds import Count, CountFromZero, Fraction, NotNegative, Positive
from s2a.scene.geometry.mesh_ops import centroids, keep, normals
from s2a.scene.geometry.occupancy import Grid, occupied_layers
from s2a.scene.geometry.planes import Plane, find_planes, plane_axes
from s2a.scene.scene import Mesh

UP = np.array([0.0, 0.0, 1.0])
# Faces whose own normal is tilted by more than 60° are excluded from the smoothing,
# which would soften the edges of steps
ROUGH = 0.5


@dataclass(frozen=True)
class PlaneConfig:
    """Detection of planar patches."""

    # largest angle between the smoothed normal of a face and the plane's direction [rad]. 15°: noise of 2 mm over
    # 3 cm tilts a smoothed normal by 4°
    max_tilt: NotNegative = 0.26
    smoothing_rounds: CountFromZero = 2  # how often normals are averaged over neighbouring faces
    # largest distance of a face's centroid from the plane [m]. Noise of a scan is 1 to 2 mm rms, the rim of a
    # sink is 8 mm high or more
    tolerance: Positive = 0.005
    # largest slope of a horizontal plane, rise per run; scanned floors are not quite level. 1.1°
    max_slope: NotNegative = 0.02
    bin_height: Positive = 0.003  # height of the slices in which horizontal planes are detected [m]
    min_area: NotNegative = 0.002  # smallest area of a plane [m^2]
    max_planes: Count = 24  # largest number of planes


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
    planes: list[Plane] = []
    while len(planes) < config.max_planes and areas[left].sum() > config.min_area:
        taken, normal, offset = _level(middle[left], areas[left], config)
        if areas[left[taken]].sum() > config.min_area:
            planes.append(Plane(normal, offset, left[taken]))
        left = left[~taken]
    return planes


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


Kind = Literal["horizontal", "vertical", "inside"]
KINDS: tuple[Kind, ...] = ("horizontal", "inside", "vertical")
# Clearance above each cell [m], and if the surface that bounds it is seen from behind, shape [row column] each
Above = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class RegionConfig:
    """Growth of support regions."""

    plane: PlaneConfig = PlaneConfig()  # detection of planar patches
    cell: Positive = 0.01  # cell size of the grid on a region [m]; large regions have larger cells
    max_cells: Count = 220  # largest number of cells along a side
    closing: CountFromZero = 2  # gaps of the scan up to twice as many cells wide are closed
    min_area: NotNegative = 0.0025  # smallest area of a horizontal region [m^2]. A soap dish
    min_vertical_area: NotNegative = 0.04  # smallest area of a vertical region [m^2]. A small poster
    min_clearance: NotNegative = 0.03  # clearance above a cell below which it is occupied [m]
    search_height: Positive = 2.0  # clearance is measured up to this height above a region [m]
    noise_height: NotNegative = 0.008  # surfaces less far above the plane belong to it: scan noise [m]
    cover_fraction: Fraction = 0.6  # fraction of a region below its own object from which its kind is "inside"
    # a border cell has a rim if the target rises within this distance, to at most twice this height [m]
    rim_distance: NotNegative = 0.025


@dataclass(frozen=True, eq=False)
class Region:
    """A bounded planar patch of a target that supports objects."""

    kind: Kind  # "horizontal", "vertical", or "inside": below another surface of the target (a shelf's compartment)
    # rotation whose columns are the directions of the grid's rows and columns and the normal, shape [3 3]
    axes: np.ndarray
    origin: np.ndarray  # corner of cell (0, 0) on the plane [m], shape [3]
    cell: float  # width of a cell [m]
    support: np.ndarray  # cells of the region, shape [row column]
    # clearance along the normal over each cell [m], 0 where occupied, at most the search height, shape [row column]
    clearances: np.ndarray
    rim_fraction: float  # fraction of the border at which the target rises: about 1 in a basin or a tray, 0 on a table
    min_clearance: float  # clearance from which a cell is free [m]

    @property
    def normal(self) -> np.ndarray:
        """Direction away from the surface, shape [3]."""
        return self.axes[:, 2]

    @cached_property
    def center(self) -> np.ndarray:
        """Centre of the cells of the region [m], shape [3]."""
        return self.points(np.argwhere(self.support) + 0.5).mean(axis=0)

    @property
    def height(self) -> float:
        """Height of the centre above the scene's zero [m]."""
        return float(self.center[2])

    @property
    def area(self) -> float:
        """Area of the region [m^2]."""
        return float(self.support.sum() * self.cell**2)

    @cached_property
    def free(self) -> np.ndarray:
        """Cells of the region with clearance, shape [row column]."""
        return self.support & (self.clearances >= self.min_clearance)

    @property
    def free_area(self) -> float:
        """Area with clearance [m^2]."""
        return float(self.free.sum() * self.cell**2)

    @property
    def clearance(self) -> float:
        """Median clearance over the free cells [m]; 0 if there are none."""
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
    mesh: Mesh, config: RegionConfig, around: Sequence[Mesh] = (), kinds: tuple[Kind, ...] = KINDS
) -> list[Region]:
    """Return the regions of a target, largest first, horizontal before vertical ones.

    Args:
        mesh: the target's surface in the scene, faces outwards; noise of 1 to 2 mm, holes and open edges are expected.
        config: growth of the regions.
        around: meshes that occupy space above the regions.
        kinds: kinds to detect; vertical ones take the most time.
    """
    if not len(mesh.faces):
        return []
    regions: list[Region] = []
    if set(kinds) != {"vertical"}:
        planes = horizontal_planes(mesh, config.plane)
        some = [region for plane in planes for region in _split(mesh, plane, config.min_area, around, config)]
        regions += sorted((region for region in some if region.kind in kinds), key=lambda region: -region.area)
    if "vertical" in kinds:
        planes = vertical_planes(mesh, config.plane)
        some = [region for plane in planes for region in _split(mesh, plane, config.min_vertical_area, around, config)]
        regions += sorted(some, key=lambda region: -region.area)
    return regions


def _split(mesh: Mesh, plane: Plane, smallest: float, around: Sequence[Mesh], config: RegionConfig) -> Iterator[Region]:
    """Yield the connected regions of a plane."""
    part = keep(Mesh(mesh.vertices, mesh.faces), plane.faces)
    axes = plane_axes(plane.normal, part.vertices[:: max(1, len(part.vertices) // 20000)].astype(np.float64))
    flat = part.vertices @ axes[:, :2]
    cell = max(config.cell, float(np.ptp(flat, axis=0).max()) / config.max_cells)
    # A margin, so that the walls around a region are on its grid too.
    margin = config.closing + 1 + int(np.ceil(config.rim_distance / cell))
    low = flat.min(axis=0) - margin * cell
    rows, columns_ = (np.ceil((flat.max(axis=0) - low) / cell).astype(int) + margin + 1).tolist()
    origin = axes[:, :2] @ low + plane.normal * plane.offset
    grid = Grid(axes, origin, cell, (rows, columns_), -1.0, 1.0, 1)
    taken = occupied_layers([part], grid)[0][0]
    taken = ndimage.binary_closing(taken, np.ones((2 * config.closing + 1,) * 2))
    labels, count = ndimage.label(taken)
    large = [i for i in range(1, count + 1) if (labels == i).sum() * cell**2 >= smallest]
    if not large:
        return
    own, others = (_above(meshes, grid, config) for meshes in ([mesh], around))
    whole = np.minimum(own[0], others[0]), np.where(own[0] <= others[0], own[1], others[1])
    for number in large:
        yield _measured(labels == number, grid, own, whole, config)


def _above(meshes: Sequence[Mesh], grid: Grid, config: RegionConfig) -> Above:
    """Return the clearance above each cell of a grid."""
    _, (down, up) = occupied_layers(meshes, replace(grid, bottom=config.noise_height, top=config.search_height))
    return np.minimum(np.minimum(down, up), config.search_height), up < down


def _measured(support: np.ndarray, grid: Grid, own: Above, whole: Above, config: RegionConfig) -> Region:
    """Return a region with its clearances, its rim and its kind."""
    (above, _), (room, behind) = own, whole
    kind: Kind = "horizontal" if np.mean(above[support] < config.search_height) < config.cover_fraction else "inside"
    if abs(grid.axes[2, 2]) < 0.5:
        kind = "vertical"
    # From behind: another object stands here, or the target's own next board, whose underside was not scanned, is above.
    standing = behind & (room < above - config.noise_height)
    clearances = np.where(support & ~standing, room, 0.0)
    solid = ndimage.binary_fill_holes(support)
    border = solid & ~ndimage.binary_erosion(solid)
    raised = (above > config.rim_distance / 3) & (above < 2 * config.rim_distance) & ~ndimage.binary_erosion(solid)
    distance = ndimage.distance_transform_edt(~raised) * grid.cell
    rim_fraction = float(np.mean(distance[border] < config.rim_distance)) if raised.any() else 0.0
    return _cropped(
        Region(kind, grid.axes, grid.origin, grid.cell, support, clearances, rim_fraction, config.min_clearance)
    )


def _cropped(region: Region) -> Region:
    """Return a region whose grid ends with it."""
    rows, columns_ = (np.flatnonzero(region.support.any(axis=axis)) for axis in (1, 0))
    part = np.s_[rows[0] : rows[-1] + 1, columns_[0] : columns_[-1] + 1]
    origin = region.points(np.array([[rows[0], columns_[0]]]))[0]
    return replace(region, origin=origin, support=region.support[part], clearances=region.clearances[part])
