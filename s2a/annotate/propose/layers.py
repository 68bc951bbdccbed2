"""Upright planes of a room, each as an image: colours, heights and where there is any surface."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.ndimage import gaussian_filter1d, median_filter

from s2a.annotate.surface import SplitSurface
from s2a.core.bounds import Fraction, Positive
from s2a.scene.geometry.occupancy import connected_cells


@dataclass(frozen=True, kw_only=True)
class ProposeConfig:
    """How fronts are proposed.

    Attributes:
        min_score: probability from which on a front is proposed.
    """

    cell: Positive = 0.01  # width of the cells of a plane's image [m]. The network was trained with this
    density: Positive = 40000.0  # points that stand for a surface, per m^2. Four points in a cell
    # points this near to a plane belong to it [m], more on meshes coarser than FINE. A phone's mesh waves by 5 mm
    layer: Positive = 0.015
    min_layer: Positive = 0.03  # smallest area of a plane [m^2]
    # smallest width and height of a front [m]. 1 % of virtual fronts are smaller (docs/virtual_homes.md)
    min_front: tuple[Positive, Positive] = (0.16, 0.08)
    min_score: Fraction


# [m] Median edge of the coarsest meshes for which `layer` holds, those of phones;
# longer ones smear planes by as much more
FINE = 0.03
UPRIGHT = 0.35  # Largest vertical component of an upright face's normal: scans are rough
BINS = 360  # Of the azimuths of normals
DIRECTIONS = 12  # Azimuths at most; rooms have four, and furniture stands askew
APART = np.radians(12.0)  # Between two azimuths
MIN_PEAK = 0.02  # Fraction of the upright area that looks along an azimuth
FACING = 0.85  # Cosine between a face of a plane and its normal
STEP = 0.004  # [m] Bins of the offsets along an azimuth
AHEAD = 0.09  # [m] A handle stands out by less
WALL = 0.1  # [m] The sides of an open compartment stand out of its back by more, a door's frame by less
BACKGROUND = 0.13  # [m] A handle is narrower than half of this
CONNECTED = 0.02  # [m] Cells in which points lie beside each other
# [m] A framed door's panel lies deeper than its stiles and rails by more, also where a mesh has smeared it, and by the others
# where panels of a rough mesh hang together; width and height of a panel at least, and of none. Doors are up to 0.6 m wide
DEEPER, PANEL, FRAMED = (0.003, 0.0045, 0.006), (0.08, 0.12), (0.5, 1.2)
UPRIGHT_PANEL = 0.7  # Height over width of a door's panel, at least: those of drawers lie
FILLED = 0.6  # Fraction of its rectangle that a panel fills, at least
# By which each door beyond two makes a row surer; fewer than so many stay less sure than a whole: they need a label
LONG, MANY = 0.1, 5
# [m] Two stiles between the panels of a row: one is 5 to 9 cm wide; and how much panels of a row are alike, at least: the height
# that they share, and their widths
STILES, ALIKE = (0.03, 0.25), (0.75, 0.5)


@dataclass(frozen=True, eq=False)
class Points:
    """Points spread evenly over a surface."""

    place: np.ndarray  # [m], shape [point 3]
    normal: np.ndarray  # of their faces, shape [point 3]
    color: np.ndarray  # RGB, shape [point 3]

    def __getitem__(self, chosen: np.ndarray | slice) -> Points:
        return Points(self.place[chosen], self.normal[chosen], self.color[chosen])


@dataclass(frozen=True, eq=False)
class Layer:
    """A plane of the room and its image; a cell's place is `low + cell * (column, row)`, rows upwards."""

    normal: np.ndarray  # horizontal, into the room, shape [3]
    right: np.ndarray  # level direction in the plane, to the right as seen from the room, shape [3]
    offset: float  # normal.x on the plane [m]
    low: np.ndarray  # place of cell 0, 0: along `right`, and the height over zero [m], shape [2]
    cell: float  # width of a cell [m]
    color: np.ndarray  # RGB of the surface near the plane, shape [row column 3]; NaN where there is none
    height: np.ndarray  # of that surface over the plane [m], shape [row column]; NaN where there is none
    # height of what stands out over the plane [m], at most AHEAD, shape [row column]; 0 where nothing does
    ahead: np.ndarray
    relief: np.ndarray  # `ahead` over its median around [m], shape [row column]
    wall: np.ndarray  # upright surface across the plane stands out by WALL and more, shape [row column]


def spread(surface: SplitSurface, density: float, seed: int = 0) -> Points:
    """Return points on the upright faces of a surface, and on what sticks out of them."""
    random = np.random.default_rng(seed)
    some = np.flatnonzero((np.abs(surface.normals[:, 2]) < 0.95) & (surface.areas > 0))
    count = random.poisson(surface.areas[some] * density)
    faces = np.repeat(some, count)
    u, v = np.sort(random.random((2, len(faces))), axis=0)
    weights = np.stack([u, v - u, 1 - v], axis=1)
    corners = surface.faces[faces]
    place = np.einsum("pk,pkd->pd", weights, surface.vertices[corners])
    return Points(place, surface.normals[faces], np.einsum("pk,pkd->pd", weights, surface.colors[corners]))


def layer_of(surface: SplitSurface, layer: float) -> float:
    """Return how near to a plane points belong to it [m]: farther where the mesh is coarse."""
    a, b = surface.vertices[surface.faces[:, :2]].swapaxes(0, 1)
    edge = float(np.median(np.linalg.norm(b - a, axis=1))) if len(surface.faces) else 0.0
    return layer + max(edge - FINE, 0.0)


def floor_of(surface: SplitSurface) -> float:
    """Return the height of the floor of a scan [m]: some of it lies lower, by noise."""
    return float(np.quantile(surface.vertices[:, 2], 0.01))


def azimuths(points: Points) -> list[float]:
    """Return the azimuths to which most upright surface looks [rad], most first."""
    upright = np.abs(points.normal[:, 2]) < UPRIGHT
    angle = np.arctan2(points.normal[upright, 1], points.normal[upright, 0])
    if not len(angle):
        return []
    count = np.bincount(((angle + np.pi) / (2 * np.pi) * BINS).astype(int) % BINS, minlength=BINS).astype(float)
    smooth = gaussian_filter1d(count, 2.0, mode="wrap")
    angle.sort()
    peaks: list[float] = []
    for index in np.argsort(-smooth):
        peak = (index + 0.5) / BINS * 2 * np.pi - np.pi
        around = _between(angle, peak - APART / 2, peak + APART / 2)
        if len(around) < MIN_PEAK * len(angle) or len(peaks) >= DIRECTIONS:
            break
        if all(abs(_turn(peak - other)) > APART for other in peaks):
            peaks.append(peak + float(np.median(_turn(around - peak))))
    return peaks


def _between(angles: np.ndarray, low: float, high: float) -> np.ndarray:
    """Return those of sorted angles in (-pi, pi] that lie between two others [rad], on the circle."""
    turns = 2 * np.pi * np.arange(-1, 2)[:, None] + [low, high]
    return np.concatenate([angles[slice(*np.searchsorted(angles, ends))] for ends in turns])


def layers(points: Points, config: ProposeConfig) -> Iterator[Layer]:
    """Yield the upright planes of a room with enough area."""
    for azimuth in azimuths(points):
        normal = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        offset = points.place @ normal
        # In the order of their offsets, so that what is near to a plane is a slice, which copies nothing.
        order = np.argsort(offset)
        offset, ordered = offset[order], points[order]
        flat = ordered.normal @ normal > FACING
        peaks = np.array(_peaks(offset[flat], config))
        for peak in peaks:
            near = slice(*np.searchsorted(offset, [peak - 2 * AHEAD, peak + 2 * AHEAD]))
            around, facing = ordered[near], flat[near]
            places = around.place[facing & (np.abs(offset[near] - peak) < 2 * config.layer)]
            for level in _levelled(places, normal, peak, peaks[peaks != peak], config):
                yield _image(around, facing, *level, config)


def _levelled(
    places: np.ndarray, normal: np.ndarray, offset: float, others: np.ndarray, config: ProposeConfig, again: bool = True
) -> Iterator[tuple[np.ndarray, float, np.ndarray]]:
    """Yield normal, offset [m] and corners [m] (low, high: along the plane, and upwards) of each connected piece of a plane.

    Furniture is not quite parallel, and a scan drifts: over two metres the heights over one common plane differ by 2 cm. What
    a piece leaves, and none of the `others` takes [m], is looked at `again`: a door lies 2 cm before its wall, which is ten
    times as large and hides it.
    """
    right = np.array([-normal[1], normal[0], 0.0])
    u, height = places @ right, places @ normal - offset
    piece = connected_cells(np.floor(np.stack([u, places[:, 2]], axis=1) / CONNECTED).astype(int))
    for number in np.flatnonzero(np.bincount(piece) >= config.min_layer * config.density):
        mine = piece == number
        line = _line(u[mine], height[mine], config.layer / 2)
        turned = normal - line[0] * right
        turned /= np.linalg.norm(turned)
        along = np.array([-turned[1], turned[0], 0.0])
        flat = np.abs(height[mine] - np.polyval(line, u[mine])) < config.layer
        if flat.sum() < config.min_layer * config.density:
            continue
        best = places[mine][flat]
        place = np.stack([best @ along, best[:, 2]], axis=1)
        yield turned, float(np.median(best @ turned)), np.stack([place.min(axis=0), place.max(axis=0)])
        rest = places[mine][~flat]
        rest = rest[(np.abs((rest @ normal)[:, None] - others) > config.layer).all(axis=1)]
        if again and len(rest) >= config.min_layer * config.density:
            yield from _levelled(rest, normal, offset, others, config, again=False)


def _line(x: np.ndarray, y: np.ndarray, near: float) -> np.ndarray:
    """Return slope and offset of a straight line through most points; x, y [m], shape [point]."""
    line = np.array([0.0, float(np.median(y))])
    for reach in (2 * near, near, near):
        inlier = np.abs(y - np.polyval(line, x)) < reach
        if inlier.sum() > 10 and np.ptp(x[inlier]) > 0.1:
            line = np.polyfit(x[inlier], y[inlier], 1)
    return line


def _peaks(offsets: np.ndarray, config: ProposeConfig) -> list[float]:
    """Return the offsets at which planes lie [m]: where more surface lies than beside them."""
    if not len(offsets):
        return []
    low = offsets.min()
    count = np.bincount(((offsets - low) / STEP).astype(int)).astype(float)
    smooth = gaussian_filter1d(np.pad(count, 3), config.layer / 2 / STEP)
    top = np.flatnonzero((smooth[1:-1] >= smooth[:-2]) & (smooth[1:-1] > smooth[2:])) + 1
    peaks = low + (top - 3 + 0.5) * STEP
    order = np.argsort(-smooth[top])
    chosen: list[float] = []
    for index in order:
        around = np.abs(offsets - peaks[index]) < config.layer
        if around.sum() < config.min_layer * config.density:
            continue
        if all(abs(peaks[index] - other) > config.layer for other in chosen):
            chosen.append(float(np.median(offsets[around])))
    return chosen


def _image(
    points: Points, flat: np.ndarray, normal: np.ndarray, offset: float, corners: np.ndarray, config: ProposeConfig
) -> Layer:
    right = np.array([-normal[1], normal[0], 0.0])
    low = corners[0] - 2 * config.cell
    size = np.ceil((corners[1] - low) / config.cell).astype(int) + 3
    columns = np.floor((points.place @ right - low[0]) / config.cell).astype(int)
    rows = np.floor((points.place[:, 2] - low[1]) / config.cell).astype(int)
    within = np.flatnonzero((columns >= 0) & (columns < size[0]) & (rows >= 0) & (rows < size[1]))
    key, points = rows[within] * size[0] + columns[within], points[within]
    height, facing = points.place @ normal - offset, points.normal @ normal
    mine = flat[within] & (np.abs(height) < config.layer)
    shape = (size[1], size[0])
    count = np.bincount(key[mine], minlength=size.prod())
    sums = [np.bincount(key[mine], value[mine], size.prod()) for value in (*points.color.T, height)]
    with np.errstate(invalid="ignore"):
        color, mean = np.stack(sums[:3], axis=1) / count[:, None], sums[3] / count
    ahead = np.zeros(size.prod())
    out = (height > 0) & (height < AHEAD) & (facing > -0.3)
    np.maximum.at(ahead, key[out], height[out])
    across = (np.abs(facing) < 0.5) & (height > WALL)
    wall = np.bincount(key[across], minlength=size.prod()) > 0
    color, ahead = color.reshape(*shape, 3), ahead.reshape(shape)
    window = int(round(BACKGROUND / config.cell))
    relief = ahead - median_filter(ahead, size=window, mode="nearest")
    return Layer(
        normal, right, offset, low, config.cell, color, mean.reshape(shape), ahead, relief, wall.reshape(shape)
    )


def framed_rows(layer: Layer) -> Iterator[tuple[np.ndarray, float]]:
    """Yield left, bottom, right, top of each door of a row of framed ones [cell], shape [door 4], and how sure the row is.

    A door's panel is a rectangle that lies deeper than the stiles and rails around it. Two doors meet in the middle between their
    panels, and the sides of a row are as far from its panels. One alone is no evidence: an oven's window, a picture. Sure is what
    panels fill of their rectangles, and LONG more for each door beyond two: from 1 on, a row needs no other evidence.
    """
    seen = ~np.isnan(layer.height)
    solid = ndimage.binary_closing(np.pad(seen, 3), np.ones((5, 5)))[3:-3, 3:-3]
    weight, height = (ndimage.gaussian_filter(x, 1.5) for x in (seen.astype(float), np.where(seen, layer.height, 0.0)))
    height = np.where(solid, height / np.maximum(weight, 1e-6), -1.0)  # what is beyond the plane does not stand out
    wide, high = (int(round(size / layer.cell)) for size in FRAMED)
    around = np.minimum(ndimage.grey_closing(height, (1, wide)), ndimage.grey_closing(height, (high, 1)))
    for deeper in DEEPER:
        labels, _ = ndimage.label(ndimage.binary_opening(solid & (around - height > deeper), np.ones((5, 5))))
        panels = []
        for number, (rows, columns) in enumerate(ndimage.find_objects(labels), 1):
            size = np.array([columns.stop - columns.start, rows.stop - rows.start])
            filled = float((labels[rows, columns] == number).mean())
            if (size * layer.cell >= PANEL).all() and filled >= FILLED:
                panels.append(np.array([columns.start, rows.start, columns.stop, rows.stop, filled]))
        yield from _rows(sorted(panels, key=lambda panel: float(panel[0])), layer.cell)


def _rows(panels: list[np.ndarray], cell: float) -> Iterator[tuple[np.ndarray, float]]:
    """Yield the doors of each row of panels (left, bottom, right, top [cell], fraction filled), sorted; as `framed_rows` does."""
    while panels:
        row = [panels.pop(0)]
        for panel in panels:
            if _next(row[-1], panel, cell):
                row.append(panel)
        panels = [panel for panel in panels if not any(panel is one for one in row)]
        if len(row) > 1 and np.median([one[3] - one[1] for one in row]) > UPRIGHT_PANEL * np.median(
            [one[2] - one[0] for one in row]
        ):
            left, bottom, right, top, filled = np.array(row).T
            stile = float(np.median(left[1:] - right[:-1])) / 2
            sides = np.array([left[0] - stile, *(left[1:] + right[:-1]) / 2, right[-1] + stile])
            ends = np.full((2, len(row)), [[np.median(bottom) - stile], [np.median(top) + stile]])
            sure = float(filled.mean()) + LONG * (len(row) - 2)
            yield (
                np.stack([sides[:-1], ends[0], sides[1:], ends[1]], axis=1),
                sure if len(row) >= MANY else min(sure, 0.95),
            )


def _next(one: np.ndarray, other: np.ndarray, cell: float) -> bool:
    """Return whether a panel (left, bottom, right, top [cell]) stands beside another in a row of doors, to its right."""
    shared, both = min(one[3], other[3]) - max(one[1], other[1]), max(one[3], other[3]) - min(one[1], other[1])
    widths = sorted((one[2] - one[0], other[2] - other[0]))
    beside = STILES[0] < (other[0] - one[2]) * cell < STILES[1]
    return bool(beside and shared >= ALIKE[0] * both and widths[0] >= ALIKE[1] * widths[1])


def _turn(angle: np.ndarray | float) -> np.ndarray:
    """Return angles between -pi and pi."""
    return np.asarray((np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi)
