"""Preferences among the free places of a region: surroundings, and the habits of people."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from s2a.core.bounds import NotNegative, Positive
from s2a.language.insert.place.supports import is_floor, nearby, target_mesh
from s2a.scene.geometry.mesh_query import ray_mesh, visible_distance
from s2a.scene.geometry.regions import Region
from s2a.scene.scene import Joint, Scene

SIDES = ((-1, 0), (1, 0), (0, -1), (0, 1))
"""Directions on a region's grid."""
BACKED = 0.5
"""Share of the rays over a side of a region that must meet something for the side to be backed."""
HEIGHTS = (0.05, 0.15, 0.25)
"""Of these rays above the region [m]."""
SPREAD = 9
"""Of these rays along a side."""
TALLEST = 1.7
"""Height of furniture over which people hang things [m]."""
THIN, OFF = 0.2, 0.12
"""What hangs on a wall is at most this deep, and its back at most this far from it [m]."""


@dataclass(frozen=True)
class PreferenceConfig:
    """Where people put things.

    Attributes:
        back_weight: weight of a place at the back or at a closed side of a support, before a wall.
        back_distance: distance from there over which that weight decays [m].
        backed_reach: a side of a support is closed if something rises within this distance beyond it [m].
        backed_clearance: clearance beyond this does not improve a placement on such a support [m].
        hang_heights: lowest and highest middle of what hangs on a wall, above the floor [m].
        hang_weight: weight of that height.
        above_gap: gap between what hangs and the furniture below it [m].
        view_distance: what is nearer than this before a wall hides what hangs there [m].
        view_weight: weight of a free view.
    """

    back_weight: NotNegative
    back_distance: Positive
    backed_reach: NotNegative
    backed_clearance: Positive
    hang_heights: tuple[Positive, Positive]
    hang_weight: NotNegative
    above_gap: NotNegative
    view_distance: NotNegative
    view_weight: NotNegative


@dataclass(frozen=True)
class Preferences:
    """Preferences among the placements of one object on one region.

    Attributes:
        against: Prefer placements with the object's back against something.
        near: points of the requested neighbour [m], shape [point 3], or None.
        backed: for each of `SIDES`, True if a wall or the like rises beyond it.
        aim: least and largest height of the middle of what hangs [m], scene coordinates.
    """

    against: bool
    near: np.ndarray | None
    backed: tuple[bool, ...]
    aim: tuple[float, float]


def preferences(
    scene: Scene, region: Region, target: str, against: bool, near: str | None, height: float, config: PreferenceConfig
) -> Preferences:
    """Return the preferences for an object of a height [m] on a region of a target, near a part if one is named."""
    points = None if near is None else target_mesh(scene, near).vertices
    if region.kind == "vertical":
        return Preferences(False, points, (False,) * 4, _aim(scene, region, target, points, height, config))
    return Preferences(against, points, _backed(scene, region, config.backed_reach), (0.0, 0.0))


def floor_height(scene: Scene) -> float:
    """Return the height of the floor [m]: of the part of that name, else of the lowest point."""
    parts = [part for part in scene.parts.values() if len(part.mesh.vertices)]
    floors = [part.mesh for i, part in scene.parts.items() if is_floor(scene, i) and len(part.mesh.vertices)]
    if floors:
        return float(np.median(np.concatenate([mesh.vertices[:, 2] for mesh in floors])))
    return min((float(part.mesh.bounds[0, 2]) for part in parts), default=0.0)


def hung_on(scene: Scene, region: Region, target: str) -> list[str]:
    """Return the ids of the parts that hang on an upright region."""
    floor, found = floor_height(scene), []
    rows, columns = region.support.shape
    for part_id, part in scene.parts.items():
        if (
            part_id == target
            or part.parent is not None
            or isinstance(part.motion, Joint)
            or not len(part.mesh.vertices)
        ):
            continue
        local = region.places(part.mesh.bounds.mean(axis=0)[None])[0]
        away = (part.mesh.vertices - region.origin) @ region.normal
        over = 0 <= local[0] < rows and 0 <= local[1] < columns
        if over and abs(away.min()) < OFF and np.ptp(away) < THIN and part.mesh.bounds[0, 2] > floor + 0.7:
            found.append(part_id)
    return found


def closeness(cells: tuple[int, int], pad: int, region: Region, wanted: Preferences, decay: float) -> np.ndarray:
    """Return for every cell of a padded grid how near it is to the wished neighbour: 1 at it, fading to 0.

    On a wall only the way along it counts: what is near the sofa hangs above it.

    Args:
        cells: rows and columns of the grid.
        pad: cells added on each side of the region.
        region: the region.
        wanted: the preferences.
        decay: distance over which it fades [m].
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
    found = np.full(len(places), np.inf)
    for (row, column), closed in zip(SIDES, wanted.backed, strict=True):
        if not closed:
            continue
        axis, sign = (0, row) if row else (1, column)
        reach = (local[:, axis] * sign).max() / region.cell
        border = high[axis] if sign > 0 else -low[axis]
        found = np.minimum(found, np.abs(border - (places[:, axis] + 0.5) * sign - reach) * region.cell)
    return found


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
    hidden = np.pad(region.support & (region.clearances < config.view_distance), pad)
    some = cells[:: max(1, len(cells) // 200)]
    behind = np.zeros(len(places))
    for cell in some:
        behind += hidden[tuple((places + cell).T)]
    return np.asarray(-config.hang_weight * np.minimum(off / 0.3, 3.0) - config.view_weight * behind / len(some))


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
    asked = ray_mesh(mesh.vertices, mesh.faces)
    return tuple(_closed(asked, region, low, high, side, reach) for side in SIDES)


def _closed(
    asked: object, region: Region, low: np.ndarray, high: np.ndarray, side: tuple[int, int], reach: float
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
    seen, _ = visible_distance(asked, starts, outward, reach + 0.05)
    return bool((seen < reach + 0.05).mean() >= BACKED)
