"""The coarse search for a pose: occupied cells in layers over a region, correlated with the object's.

The object's turned copies slide over the grid of a region. A place is possible where no layer of the object meets an occupied
cell of the same layer and where the cells it touches carry. What remains is ranked; exact tests follow
(`s2a.language.insert.poses`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import fft, ndimage

from s2a.core.bounds import Count, Fraction, NotNegative, Numbers, Positive
from s2a.language.insert.fit import SweptVolume, fill
from s2a.language.insert.supports import BASIN, floor_height, nearby, over, target_mesh
from s2a.scene.geometry.mesh_ops import sample
from s2a.scene.geometry.mesh_query import kept_ray_mesh, visible_distance
from s2a.scene.geometry.occupancy import Grid, distinct_cells, mask_of, occupied_layers
from s2a.scene.geometry.regions import Region
from s2a.scene.scene import Joint, Mesh, Scene

SIDES = ((-1, 0), (1, 0), (0, -1), (0, 1))  # Directions on a region's grid
BACKED = 0.5  # Share of the rays over a side of a region that must meet something for the side to be backed
HEIGHTS = (0.05, 0.15, 0.25)  # Of these rays above the region [m]
SPREAD = 9  # Of these rays along a side
TALLEST = 1.7  # Height of furniture over which people hang things [m]
MARK_DEPTH, MARKED = 0.05, 75.0  # Depth of a wall's surface [m], and from which difference of RGB something is on it
THIN, OFF = 0.2, 0.12  # What hangs on a wall is at most this deep, and its back at most this far from it [m]


@dataclass(frozen=True)
class PreferenceConfig:
    """Where people put things.

    Attributes:
        back_weight: weight of a place at the back or at a closed side of a support, before a wall.
        back_distance: distance from there over which that weight decays [m].
        backed_reach: a side of a support is closed if something rises within this distance beyond it [m].
        backed_clearance: clearance beyond this does not improve a placement on such a support [m].
        hang_heights: lowest and highest middle of what hangs on a wall, above the floor [m]. Eye level of people who
            stand.
        hang_weight: weight of that height.
        above_gap: gap between what hangs and the furniture below it [m].
        view_distance: what is nearer than this before a wall hides what hangs there [m]. The depth of a chest of
            drawers with its gap to the wall.
        view_weight: weight of a free view.
    """

    back_weight: NotNegative = 0.6
    back_distance: Positive = 0.15
    backed_reach: NotNegative = 0.2
    backed_clearance: Positive = 0.04
    hang_heights: tuple[Positive, Positive] = (1.45, 1.6)
    hang_weight: NotNegative = 2.0
    above_gap: NotNegative = 0.15
    view_distance: NotNegative = 0.6
    view_weight: NotNegative = 1.5


@dataclass(frozen=True)
class Preferences:
    """Preferences among the placements of one object on one region."""

    against: bool  # Prefer placements with the object's back against something
    near: np.ndarray | None  # points of the requested neighbour [m], shape [point 3], or None
    backed: tuple[bool, ...]  # for each of `SIDES`, True if a wall or the like rises beyond it
    aim: tuple[float, float]  # least and largest height of the middle of what hangs [m], scene coordinates
    marked: np.ndarray | None = (
        None  # cells of a wall that something without depth is on, shape [row column]; None: unknown
    )


def preferences(
    scene: Scene, region: Region, target: str, against: bool, near: str | None, height: float, config: PreferenceConfig
) -> Preferences:
    """Return the preferences for an object of a height [m] on a region of a target, near a part if one is named."""
    points = None if near is None else target_mesh(scene, near).vertices
    if region.kind == "vertical":
        aim = _aim(scene, region, target, points, height, config)
        return Preferences(False, points, (False,) * 4, aim, _marked(target_mesh(scene, target), region))
    return Preferences(against, points, _backed(scene, region, config.backed_reach), (0.0, 0.0))


def hung_on(scene: Scene, region: Region, target: str) -> list[str]:
    """Return the ids of the parts that hang on an upright region."""
    floor, ids = floor_height(scene), []
    for part_id, part in scene.parts.items():
        if (
            part_id == target
            or part.parent is not None
            or isinstance(part.motion, Joint)
            or not len(part.mesh.vertices)
        ):
            continue
        away = (part.mesh.vertices - region.origin) @ region.normal
        close = abs(away.min()) < OFF and np.ptp(away) < THIN
        if close and over(region, part.mesh.bounds.mean(axis=0)) and part.mesh.bounds[0, 2] > floor + 0.7:
            ids.append(part_id)
    return ids


def closeness(cells: tuple[int, int], pad: int, region: Region, wanted: Preferences, decay: float) -> np.ndarray:
    """Return for every cell of a padded grid how near it is to the wished neighbour: 1 at it, fading to 0.

    On a wall only the way along it counts: what is near the sofa hangs above it.

    `decay`: distance over which it fades [m].
    """
    if wanted.near is None:
        return np.zeros(cells)
    near = np.floor(region.places(wanted.near)[:, :2]).astype(int) + pad
    if region.kind == "vertical":
        # A neighbour's middle draws, not its whole width: what belongs to a sofa hangs over its middle.
        middle = int(np.clip((near[:, 0].min() + near[:, 0].max()) // 2, 0, cells[0] - 1))
        away = np.abs(np.arange(cells[0]) - middle) * region.cell
        return np.broadcast_to(np.exp(-away / decay)[:, None], cells).copy()
    near = np.unique(np.clip(near, 0, np.array(cells) - 1), axis=0)
    free = np.ones(cells, bool)
    free[tuple(near.T)] = False
    return np.exp(-ndimage.distance_transform_edt(free) * region.cell / decay)


def at_the_back(places: np.ndarray, local: np.ndarray, region: Region, pad: int, wanted: Preferences) -> np.ndarray:
    """Return the distance of an object from the nearest closed side of a region [m], shape [place]; inf if none is.

    Args:
        places: cells of the object's origin on the padded grid, shape [place 2].
        local: the object's points in the region's frame [m], shape [point 3].
        region: the region.
        pad: cells added on each side of it.
        wanted: the preferences.
    """
    filled = np.argwhere(region.support)
    low, high = filled.min(axis=0) + pad, filled.max(axis=0) + pad + 1
    distance = np.full(len(places), np.inf)
    for (row, column), closed in zip(SIDES, wanted.backed, strict=True):
        if not closed:
            continue
        axis, sign = (0, row) if row else (1, column)
        reach = (local[:, axis] * sign).max() / region.cell
        border = high[axis] if sign > 0 else -low[axis]
        distance = np.minimum(distance, np.abs(border - (places[:, axis] + 0.5) * sign - reach) * region.cell)
    return distance


def hanging_score(
    places: np.ndarray, cells: np.ndarray, local: np.ndarray, region: Region, pad: int, wanted: Preferences,
    config: PreferenceConfig,
) -> np.ndarray:  # fmt: skip
    """Return how well an object hangs at each place on a wall: at eye level, seen from the room; shape [place].

    Args:
        places: cells of the object's origin on the padded grid, shape [place 2].
        cells: the object's cells, relative to its origin, shape [cell 2].
        local: its points in the region's frame [m], shape [point 3].
        region: the upright region.
        pad: cells added on each side of it.
        wanted: the preferences.
        config: weights.
    """
    middle = (local[:, :2].min(axis=0) + local[:, :2].max(axis=0)) / 2
    heights = region.points(places - pad + 0.5 + middle / region.cell)[:, 2]
    low, high = wanted.aim
    off = np.maximum(low - heights, 0.0) + np.maximum(heights - high, 0.0)
    hidden = region.support & (region.clearances < config.view_distance)
    hidden = np.pad(hidden if wanted.marked is None else hidden | wanted.marked, pad)
    some = cells[:: max(1, len(cells) // 200)]
    behind = np.zeros(len(places))
    for cell in some:
        behind += hidden[tuple((places + cell).T)]
    return np.asarray(-config.hang_weight * np.minimum(off / 0.3, 3.0) - config.view_weight * behind / len(some))


def _marked(mesh: Mesh, region: Region) -> np.ndarray | None:
    """Return the cells of an upright region whose colour is not most of the wall's: a poster, a window, a screen."""
    if mesh.colors is None:
        return None
    cells = region.places(mesh.vertices.astype(float))
    row, column = np.floor(cells[:, :2]).astype(int).T
    rows, columns = region.support.shape
    own = (np.abs(cells[:, 2]) <= MARK_DEPTH) & (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    if not own.any():
        return None
    index, colors = (row * columns + column)[own], mesh.colors[own].astype(float)
    count = np.bincount(index, minlength=rows * columns).reshape(rows, columns)
    total = [np.bincount(index, channel, rows * columns).reshape(rows, columns) for channel in colors.T]
    near = ndimage.distance_transform_edt(count == 0, return_distances=False, return_indices=True)
    mean = (np.stack(total, axis=2) / np.maximum(count, 1)[..., None])[tuple(near)]
    away = np.linalg.norm(mean - np.median(mean[region.support], axis=0), axis=2)
    marked = region.support & (ndimage.median_filter(away, 3) > MARKED)
    return marked if marked[region.support].mean() < 0.5 else None  # else no colour is the wall's


def _aim(
    scene: Scene, region: Region, target: str, near: np.ndarray | None, height: float, config: PreferenceConfig
) -> tuple[float, float]:
    """Return the heights between which the middle of an object of a height [m] should hang, scene coordinates.

    That is at eye level; among other hung things at theirs; and always above the furniture that it is to be near.
    """
    floor = floor_height(scene)
    low, high = floor + config.hang_heights[0], floor + config.hang_heights[1]
    others = [float(scene.parts[i].mesh.bounds.mean(axis=0)[2]) for i in hung_on(scene, region, target)]
    level = [other for other in others if low - 0.2 <= other <= high + 0.2]
    if level:
        middle = float(np.median(level))
        low, high = middle - 0.05, middle + 0.05
    # What is to be near a wardrobe hangs beside it.
    if near is not None and float(near[:, 2].min()) < floor + 0.7 and float(near[:, 2].max()) < floor + TALLEST:
        least = float(near[:, 2].max()) + config.above_gap + height / 2
        low, high = max(low, least), max(high, least)
    return low, high


def _backed(scene: Scene, region: Region, reach: float) -> tuple[bool, ...]:
    """Return for each of `SIDES` of a level region, True if something rises beyond it."""
    cells = np.argwhere(region.support)
    low, high = cells.min(axis=0), cells.max(axis=0) + 1
    corners = region.points(np.array([low, high, (low[0], high[1]), (high[0], low[1])]))
    margin = np.array([reach, reach, 0.0])
    mesh = nearby(scene, corners.min(axis=0) - margin, corners.max(axis=0) + margin + (0, 0, HEIGHTS[-1] + 0.05))
    if not len(mesh.faces):
        return (False,) * 4
    tree = kept_ray_mesh(mesh)
    return tuple(_closed(tree, region, low, high, side, reach) for side in SIDES)


def _closed(
    tree: object, region: Region, low: np.ndarray, high: np.ndarray, side: tuple[int, int], reach: float
) -> bool:
    """Return True if rays from the border of a region outwards mostly meet something."""
    axis = 0 if side[0] else 1
    along = np.linspace(low[1 - axis], high[1 - axis], SPREAD + 2)[1:-1]
    cells = np.empty((SPREAD, 2))
    cells[:, 1 - axis] = along
    cells[:, axis] = high[axis] if side[axis] > 0 else low[axis]
    outward = region.axes[:, axis] * side[axis]
    # A little inside: the border of a scan ends where the wall begins, or behind that.
    start = region.points(cells) - 0.05 * outward
    starts = np.concatenate([start + height * region.normal for height in HEIGHTS])
    seen, _ = visible_distance(tree, starts, outward, reach + 0.05)
    return bool((seen < reach + 0.05).mean() >= BACKED)


@dataclass(frozen=True, kw_only=True)
class SearchConfig:
    """Search on the occupancy grid.

    Attributes:
        turns: yaws to test, relative to the facing direction of the region [deg].
        layers: number of occupancy layers between the region and the top of the object.
        contact_height: points lower than this above the lowest one touch the support [m].
        samples: points sampled on the object's surface.
        min_supported_fraction: smallest fraction of the touching cells that must be supported.
        margin: clearance kept around the object [m].
        max_useful_clearance: clearance beyond this does not improve a placement [m].
        max_overhang: largest fraction of the object, seen from above, that is beyond its support.
        max_placements: placements ranked per yaw.
        clearance_weight: weight of the clearance around the object.
        facing_weight: weight of the facing direction.
        neighbour_weight: weight of the distance to the requested neighbour.
        backing_weight: weight of a back that is against something, for relation "against".
        neighbour_distance: distance over which the neighbour's weight decays [m].
        habits: where people put things.
    """

    turns: Numbers = (0.0, 10.0, -10.0, 25.0, -25.0, 45.0, -45.0, 90.0, -90.0, 180.0)
    layers: Count = 5
    contact_height: NotNegative = 0.008
    samples: Count = 4000
    min_supported_fraction: Fraction = 0.96
    margin: NotNegative
    max_useful_clearance: Positive = 0.12
    max_overhang: Fraction = 0.15
    max_placements: Count = 2000
    clearance_weight: float = 1.0
    facing_weight: float = 0.3
    neighbour_weight: float = 1.5
    backing_weight: float = 1.5
    neighbour_distance: Positive = 0.25
    habits: PreferenceConfig = PreferenceConfig()


@dataclass(frozen=True)
class OccupancyGrid:
    """The padded occupancy grid over a region."""

    pad: int  # cells added on each side of the region
    carries: np.ndarray  # supported cells with clearance, shape [row column]
    layers: np.ndarray  # occupied cells by layer, shape [layer row column]
    edges: np.ndarray  # heights of the layers' borders above the region [m], shape [layer + 1]
    beyond: np.ndarray  # cells beyond the outline of the region, over which objects would overhang, shape [row column]


def occupancy_grid(
    region: Region,
    radius: float,
    height: float,
    obstacles: Sequence[Mesh],
    volumes: list[SweptVolume],
    config: SearchConfig,
) -> OccupancyGrid:
    """Return the grid for an object of a radius and height [m] among obstacles and the swept volumes of doors and drawers."""
    pad = int(np.ceil(radius / region.cell)) + 2
    carries = np.pad(region.free, pad)
    edges = np.linspace(config.contact_height, max(height, 2 * config.contact_height), config.layers + 1)
    origin = region.points(np.array([[-pad, -pad]]))[0]
    raster = Grid(region.axes, origin, region.cell, carries.shape, edges[0], edges[-1], config.layers)
    layers, _ = occupied_layers(obstacles, raster)
    for volume in volumes:
        fill(layers, edges, region, pad, volume, config.contact_height)
    grow = max(1, round(config.margin / region.cell))
    grown = np.stack([ndimage.binary_dilation(layer, iterations=grow) for layer in layers])
    # What stands at the border hides it from the scanner: the outline counts, and a cell of tolerance.
    outline = ndimage.binary_dilation(ndimage.binary_fill_holes(np.pad(region.support, pad)))
    # What is in a basin may reach over its rim.
    beyond = ~outline & (region.rim_fraction <= BASIN)
    return OccupancyGrid(pad, carries, grown, edges, beyond)


Keep = Callable[[np.ndarray], np.ndarray]  # A filter of places [m], shape [place 3] -> shape [place]
BACK_FIRST = 0.6  # Weight of the neighbour of what stands against something: its back comes first


@dataclass(frozen=True)
class GridCandidate:
    """A placement on the grid."""

    score: float  # the higher, the better
    turn: float  # yaw relative to the facing direction [rad]
    place: np.ndarray  # cell of the object's origin, shape [2]
    room: float  # distance from the nearest obstacle or edge [m]


def grid_candidates(
    grid: OccupancyGrid,
    region: Region,
    object: Mesh,
    base: np.ndarray,
    preferences: Preferences,
    config: SearchConfig,
    keep: Keep | None = None,
) -> list[GridCandidate]:
    """Return possible places, best first.

    Args:
        grid: occupancy grid of the region.
        region: where the object goes.
        object: in its own frame.
        base: rotation from the object's frame to the region's at turn 0, shape [3 3].
        preferences: what makes a placement better.
        config: turns and weights.
        keep: of points [m], shape [place 3], those that a wish allows, shape [place]; None for all.
    """
    shape = tuple(fft.next_fast_len(n, real=True) for n in grid.carries.shape)
    spectra = fft.rfft2(np.stack([~grid.carries, *grid.layers, grid.beyond]).astype(np.float32), shape)
    room = _room(grid) * region.cell
    nearness = closeness(grid.carries.shape, grid.pad, region, preferences, config.neighbour_distance)
    points = np.concatenate([sample(object, config.samples, seed=0), object.vertices])
    turns = np.radians(config.turns) if region.kind != "vertical" else np.zeros(1)
    candidates: list[GridCandidate] = []
    for turn in turns:
        c, s = np.cos(turn), np.sin(turn)
        local = points @ (base @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])).T
        local[:, 2] -= local[:, 2].min()
        prints = _prints(local, region.cell, grid, config)
        possible = _possible(spectra, prints, shape, grid.carries.shape, config)
        places = np.argwhere(possible)
        places = places[:: max(1, len(places) // config.max_placements)]
        if keep is not None and len(places):
            places = places[keep(region.points(places - grid.pad + 0.5))]
        if not len(places):
            continue
        free = _lowest(room, places, distinct_cells(np.concatenate(prints)))
        score = _scores(places, free, prints, local, grid, region, base, turn, preferences, config)
        score = score + config.neighbour_weight * nearness[tuple(places.T)] * (
            BACK_FIRST if preferences.against else 1.0
        )
        best = np.argsort(-score, kind="stable")[: config.max_placements // 4]
        candidates += [
            GridCandidate(float(score[i]), float(turn), places[i] - grid.pad + 0.5, float(free[i])) for i in best
        ]
    return sorted(candidates, key=lambda one: -one.score)


def _scores(
    places: np.ndarray,
    free: np.ndarray,
    prints: list[np.ndarray],
    local: np.ndarray,
    grid: OccupancyGrid,
    region: Region,
    base: np.ndarray,
    turn: float,
    wanted: Preferences,
    config: SearchConfig,
) -> np.ndarray:
    """Return how good places are but for the wished neighbour, shape [place]; `free` is their clearance [m]."""
    habits = config.habits
    useful = habits.backed_clearance if any(wanted.backed) else config.max_useful_clearance
    clearance = config.clearance_weight * np.minimum(free, useful) / useful
    if region.kind == "vertical":
        cells = distinct_cells(np.concatenate(prints))
        return clearance + hanging_score(places, cells, local, region, grid.pad, wanted, habits)
    away = at_the_back(places, local, region, grid.pad, wanted)
    if wanted.against:
        walls = np.asarray(grid.layers[grid.layers.shape[0] // 2 :].any(axis=0))
        backing = config.backing_weight * _back(walls, places, local, region, base, turn)
        return 0.2 * clearance + backing - 0.01 * config.facing_weight * abs(turn)
    at_back = habits.back_weight * np.exp(-away / habits.back_distance)
    return np.asarray(clearance + at_back + config.facing_weight * np.cos(turn))


def _prints(local: np.ndarray, cell: float, grid: OccupancyGrid, config: SearchConfig) -> list[np.ndarray]:
    """Return the cells of an object, relative to its origin: those it stands on, then those of each layer, [cell 2] each."""
    # The touching points of a noisy or curved bottom lie within `touch` of the lowest one.
    picked = [local[:, 2] < config.contact_height]
    picked += [
        (local[:, 2] >= low) & (local[:, 2] <= high) for low, high in zip(grid.edges, grid.edges[1:], strict=False)
    ]
    picked[1] |= picked[0]
    cells = np.floor(local[:, :2] / cell + 0.5).astype(int)
    return [_filled(cells[some]) for some in picked]


def _filled(cells: np.ndarray) -> np.ndarray:
    """Return cells [cell 2] with those that they enclose: a box is not put over what it would swallow."""
    if not len(cells):
        return cells
    there, low = mask_of(cells)
    return np.asarray(np.argwhere(ndimage.binary_fill_holes(there)) + low)


def _possible(
    spectra: np.ndarray, prints: list[np.ndarray], fast: tuple[int, ...], shape: tuple[int, ...], config: SearchConfig
) -> np.ndarray:
    """Return the places at which the object meets nothing and stands on cells that carry, shape [row column]."""
    kernels = np.zeros((len(prints), *fast), np.float32)
    for kernel, cells in zip(kernels, prints, strict=True):
        kernel[tuple(cells.T)] = 1.0  # negative indices wrap around, as the transform does
    turned = np.conj(fft.rfft2(kernels))
    hanging = fft.irfft2(spectra[0] * turned[0], fast)[: shape[0], : shape[1]]
    hits = fft.irfft2((spectra[1:-1] * turned[1:]).sum(axis=0), fast)[: shape[0], : shape[1]]
    possible = (hits < 0.5) & (hanging < (1.0 - config.min_supported_fraction) * len(prints[0]) + 0.5)
    cells = distinct_cells(np.concatenate(prints))
    outline = np.zeros(fast, np.float32)
    outline[tuple(cells.T)] = 1.0
    over = fft.irfft2(spectra[-1] * np.conj(fft.rfft2(outline)), fast)[: shape[0], : shape[1]]
    possible &= over < config.max_overhang * len(cells) + 0.5
    low, high = np.maximum(0, -cells.min(axis=0)), np.minimum(shape, shape - cells.max(axis=0))
    inner = np.zeros_like(possible)
    inner[low[0] : max(high[0], 0), low[1] : max(high[1], 0)] = True
    return possible & inner


def _room(grid: OccupancyGrid) -> np.ndarray:
    """Return every cell's distance to the nearest obstacle, or to the border of what carries, in cells."""
    return ndimage.distance_transform_edt(np.pad(grid.carries & ~grid.layers.any(axis=0), 1))[1:-1, 1:-1]


def _lowest(field: np.ndarray, places: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return the lowest value of a field under an object's cells at each place, shape [place]."""
    lowest = np.full(len(places), np.inf)
    solid = np.zeros(np.ptp(cells, axis=0) + 3, bool)
    solid[tuple((cells - cells.min(axis=0) + 1).T)] = True
    rim = np.argwhere(solid & ~ndimage.binary_erosion(ndimage.binary_fill_holes(solid))) + cells.min(axis=0) - 1
    for cell in rim:
        np.minimum(lowest, field[tuple((places + cell).T)], out=lowest)
    return lowest


def _back(
    walls: np.ndarray, places: np.ndarray, local: np.ndarray, region: Region, base: np.ndarray, turn: float
) -> np.ndarray:
    """Return for each place which share of the strip behind the object something stands in, shape [place]."""
    forward = (base @ np.array([np.cos(turn), np.sin(turn), 0.0]))[:2]
    side = np.array([-forward[1], forward[0]])
    along, across = local[:, :2] @ forward, local[:, :2] @ side
    width = np.arange(across.min(), across.max(), region.cell)
    seen = np.zeros((len(places), len(width)), bool)
    for behind in np.arange(1.0, 4.0) * region.cell:
        strip = (along.min() - behind) * forward + width[:, None] * side
        cells = places[:, None] + np.floor(strip / region.cell + 0.5).astype(int)
        cells = np.clip(cells, 0, np.array(walls.shape) - 1)
        seen |= walls[cells[..., 0], cells[..., 1]]
    return seen.mean(axis=1)
