"""From a scan's surface to proposed parts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from s2a.annotate import joints
from s2a.annotate.annotation import Draft, Item
from s2a.annotate.handle import RELIEF, ground, resolved, standing_out
from s2a.annotate.propose.cells import CellBox, hull
from s2a.annotate.propose.config import ProposeConfig
from s2a.annotate.propose.layers import Layer, layers, spread
from s2a.annotate.propose.motion import FrontShape, Motion, motion
from s2a.annotate.propose.partition import divide
from s2a.annotate.propose.patches import ColorPatch, patches
from s2a.annotate.propose.wall_leaves import MIN_DOOR, leaves
from s2a.annotate.region import FrontRegion, GrowConfig
from s2a.annotate.surface import SplitSurface
from s2a.geometry.planes import fit_plane
from s2a.scene import Joint

SIDES = {"right": 0, "left": 1, "top": 2, "bottom": 3}
"""Index of a side in `joints.hinge_at`."""
OVERLAP = 0.5
"""Fraction of the smaller front that two proposals may share; the better one stays."""
GLAZED = 0.85
"""Fraction of a window that a laser sees at most: of a picture it sees all."""
REVEAL = 0.12
"""[m] A door's leaf lies before or behind its wall by less."""
BESIDE, WALLED = 4, 0.4
"""Cells beside a side in which a wall may stand, and the fraction of the side before which it stands."""
CENTERED, AT_SIDE = 0.1, 0.13
"""Distance of a handle from its front's middle, as a fraction of the width, and from a side [m]."""
FACING = 0.6
"""Cosine between a face of a front and its plane."""


def propose(surface: SplitSurface, config: ProposeConfig, grow: GrowConfig) -> tuple[Item, ...]:
    """Return proposed parts of a scan, best first; triangles are not split yet.

    Args:
        surface: the scan, z up, floor at 0.
        config: how fronts are proposed.
        grow: how far before and behind a plane faces belong to a front.
    """
    floor = float(np.quantile(surface.vertices[:, 2], 0.01))
    found = []
    for layer in layers(spread(surface, config.density), config):
        for patch in patches(layer, config):
            found += list(_items(surface, layer, patch, floor, config, grow))
        for box, lever in leaves(layer, floor, config):
            found += list(_leaf(surface, layer, box, lever, grow))
    return _best(surface, found)


def cut(surface: SplitSurface, items: tuple[Item, ...], grow: GrowConfig) -> Draft:
    """Return an annotation of proposed parts whose borders are cut."""
    annotation = Draft(surface, items)
    for index, item in enumerate(items):
        annotation = annotation.with_rectangle(index, item.region, grow)
    return annotation


def _items(
    surface: SplitSurface, layer: Layer, patch: ColorPatch, floor: float, config: ProposeConfig, grow: GrowConfig
) -> Iterator[Item]:
    """Yield the fronts of a patch: one for each handle."""
    if not 0 < len(patch.blobs) <= config.max_fronts:
        return
    relief = dict(zip(patch.blobs, patch.relief, strict=True))
    for box, blobs in divide(layer, patch.box, list(patch.blobs), patch.within):
        width, height = box.width * config.cell, box.height * config.cell
        low, high = config.min_front, config.max_front
        if not blobs or not (low[0] <= width <= high[0] and low[1] <= height <= high[1]):
            continue
        if patch.within[box.cells].mean() < config.min_fill:
            continue
        handle = hull(blobs)
        seen = _seen(layer, box, handle, floor)
        if not layer.sharp and not _reachable(seen):
            continue
        region = _region(surface, layer, box, grow)
        if region is None or seen.middle < config.min_middle or _recessed(layer, box):
            continue
        opens = motion(seen)
        out = max(relief[blob] for blob in blobs)
        yield Item(
            region,
            joint=_joint(region, opens),
            handle=_handle(surface, layer, region, handle),
            proposed=True,
            score=_score(out, config),
        )


def _leaf(surface: SplitSurface, layer: Layer, box: CellBox, lever: CellBox, grow: GrowConfig) -> Iterator[Item]:
    """Yield the leaf of a door or window, on its own plane: before the wall's, or behind it."""
    region = _rectangle(layer, box)
    place = region.local(surface.middles)
    mine = (np.abs(place[:, :2]) < region.size / 2).all(axis=1) & (np.abs(place[:, 2]) < REVEAL)
    mine &= surface.normals @ region.normal > FACING
    if not mine.any():
        return
    count, edges = np.histogram(place[mine, 2], np.arange(-REVEAL, REVEAL, 0.01), weights=surface.areas[mine])
    offset = float(edges[np.argmax(count)]) + 0.005
    leaf = mine & (np.abs(place[:, 2] - offset) < grow.distance)
    if surface.areas[leaf].sum() < 0.15 * region.size.prod():
        return
    if box.height * layer.cell < MIN_DOOR:  # a window: its glass and its frame, at different depths
        near, far = np.quantile(place[mine, 2], (0.05, 0.95))
        region = replace(region, center=region.center + (near + far) / 2 * region.normal)
        region = replace(region, faces=inside(surface, region, grow.thickness))
    else:
        low, high = np.quantile(place[leaf, :2], (0.01, 0.99), axis=0)
        center = region.center + region.axes @ (low + high) / 2 + offset * region.normal
        region = replace(region, center=center, size=high - low)
        region = replace(region, faces=inside(surface, region, grow.distance))
    if box.height * layer.cell >= MIN_DOOR > region.size[1]:
        return
    if layer.sharp and region.size[1] < MIN_DOOR and surface.areas[region.faces].sum() > GLAZED * region.size.prod():
        return
    opens: Motion = "left" if lever.middle[0] > box.middle[0] else "right"
    handle = _handle(surface, layer, region, lever)
    yield Item(region, joint=_joint(region, opens), handle=handle, proposed=True)


def _reachable(seen: FrontShape) -> bool:
    """Return whether a handle is in the middle or at a side of its front: elsewhere it is something else."""
    return abs(seen.x - 0.5) < CENTERED or min(seen.x, 1 - seen.x) * seen.width < AT_SIDE


def _recessed(layer: Layer, box: CellBox) -> bool:
    """Return whether walls stand before both sides of a box: it is the back of an open compartment."""
    rows = slice(max(int(box.bottom), 0), int(box.top))
    sides = [layer.wall[rows, max(int(x) - BESIDE, 0) : int(x) + BESIDE] for x in (box.left, box.right)]
    return all(side.size and side.any(axis=1).mean() > WALLED for side in sides)


def _score(relief: float, config: ProposeConfig) -> float:
    """Return how sure a front is, 0 to 1: a handle that stands out is one, a patch of another colour may be none."""
    return float(0.5 + 0.5 * np.clip(relief / (3 * config.relief), 0.0, 1.0))


def _joint(region: FrontRegion, opens: Motion) -> Joint:
    return joints.slide(region) if opens == "slide" else joints.hinge_at(region, SIDES[opens])


def _seen(layer: Layer, box: CellBox, handle: CellBox, floor: float) -> FrontShape:
    x, y = handle.middle
    return FrontShape(
        width=box.width * layer.cell,
        height=box.height * layer.cell,
        middle=float(layer.low[1] + box.middle[1] * layer.cell - floor),
        x=(x - box.left) / box.width,
        y=(y - box.bottom) / box.height,
        handle_width=handle.width * layer.cell,
        handle_height=handle.height * layer.cell,
    )


def _place(layer: Layer, column: float, row: float) -> np.ndarray:
    """Return the point of a plane at a place of its image [m], shape [3]."""
    u, v = layer.low + layer.cell * np.array([column, row])
    return np.asarray(u * layer.right + v * np.array([0.0, 0.0, 1.0]) + layer.offset * layer.normal)


def _rectangle(layer: Layer, box: CellBox) -> FrontRegion:
    """Return a box as a rectangle of a plane, without faces."""
    axes = np.stack([layer.right, np.array([0.0, 0.0, 1.0])], axis=1)
    size = np.array([box.width, box.height]) * layer.cell
    return FrontRegion(layer.normal, _place(layer, *box.middle), axes, size, np.empty(0, int))


def _region(surface: SplitSurface, layer: Layer, box: CellBox, grow: GrowConfig) -> FrontRegion | None:
    """Return a box as a region of the surface, its plane fitted to its faces and upright; None where it holds hardly any."""
    region = _rectangle(layer, box)
    faces = inside(surface, region, grow.distance)
    if surface.areas[faces].sum() < 0.3 * region.size.prod():
        return None
    normal, _ = fit_plane(surface.middles[faces], surface.areas[faces], layer.normal)
    normal = normal * [1.0, 1.0, 0.0]
    normal /= np.linalg.norm(normal)
    if normal @ layer.normal < 0.99:
        normal = layer.normal
    right = np.array([-normal[1], normal[0], 0.0])
    offset = float(np.median(surface.middles[faces] @ normal))
    center = region.center + (offset - float(region.center @ normal)) * normal
    turned = replace(region, normal=normal, center=center, axes=np.stack([right, region.axes[:, 1]], axis=1))
    return replace(turned, faces=inside(surface, turned, grow.distance))


def inside(surface: SplitSurface, region: FrontRegion, distance: float) -> np.ndarray:
    """Return the faces whose middles lie in a region's rectangle, nearer to its plane than [m], and facing as it does."""
    place = region.local(surface.middles)
    flat = (np.abs(place[:, :2]) < region.size / 2).all(axis=1) & (np.abs(place[:, 2]) < distance)
    return np.flatnonzero(flat & (surface.normals @ region.normal > FACING))


def _handle(surface: SplitSurface, layer: Layer, region: FrontRegion, handle: CellBox) -> np.ndarray:
    """Return the faces of a handle: what stands out in its box; none where it is in the colours alone, or smeared."""
    out = standing_out(surface, region)
    place = surface.middles - layer.offset * layer.normal
    u = (place @ layer.right - layer.low[0]) / layer.cell
    v = (surface.middles[:, 2] - layer.low[1]) / layer.cell
    within = (u > handle.left - 1) & (u < handle.right + 1) & (v > handle.bottom - 1) & (v < handle.top + 1)
    faces = np.flatnonzero(out & within)
    if len(faces):
        height = region.local(surface.middles[faces])[:, 2]
        faces = faces[height > ground(surface, region, faces) + RELIEF]
    return faces if resolved(surface, region, faces) else faces[:0]


def _best(surface: SplitSurface, found: list[Item]) -> tuple[Item, ...]:
    """Return proposals, best first, without those that mostly repeat a better one."""
    kept: list[Item] = []
    taken = np.zeros(len(surface.faces), bool)
    for item in sorted(found, key=lambda one: (-one.score, -len(one.region.faces))):
        areas = surface.areas[item.region.faces]
        if areas[taken[item.region.faces]].sum() <= OVERLAP * areas.sum():
            faces = item.region.faces[~taken[item.region.faces]]
            kept.append(replace(item, region=replace(item.region, faces=faces)))
            taken[item.region.faces] = True
    return tuple(kept)
