"""Proposed parts of a scan's surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from s2a.annotate.annotation import Draft, Item
from s2a.annotate.propose.fronts import CellBox, SeenFront, fronts, is_flap
from s2a.annotate.propose.layers import Layer, Points, ProposeConfig, floor_of, layers, spread
from s2a.annotate.propose.network import FrontNetwork, Motion, load
from s2a.annotate.region import FrontRegion, GrowConfig, hinge_at, slide
from s2a.annotate.surface import SplitSurface
from s2a.scene.geometry.planes import fit_plane
from s2a.scene.scene import Joint

SIDES = {"right": 0, "left": 1, "top": 2, "bottom": 3}
"""Index of a side in `joints.hinge_at`."""
OVERLAP = 0.5
"""Fraction of the smaller front that two proposals may share; the better one stays."""
ALIGNED = 0.6
"""Cosine between a face of a front and its plane, at least."""


def propose(
    surface: SplitSurface, config: ProposeConfig, grow: GrowConfig, network: FrontNetwork | None = None
) -> tuple[Item, ...]:
    """Return proposed parts of a scan, best first; triangles are not split yet, and handles are places.

    Args:
        surface: the scan, z up, floor at 0.
        config: how fronts are proposed.
        grow: how far before and behind a plane faces belong to a front.
        network: what sees fronts; None: the one that comes with s2a.
    """
    network = network or load()
    floor, points = floor_of(surface), spread(surface, config.density)
    found = [
        item
        for layer in layers(points, config)
        for front in fronts(layer, floor, network, config)
        if (item := _item(surface, points, layer, front, config, grow))
    ]
    return _best(surface, found)


def cut(surface: SplitSurface, items: tuple[Item, ...], grow: GrowConfig) -> Draft:
    """Return an annotation of proposed parts whose borders are cut, with handles as if their places had been clicked."""
    annotation = Draft(surface, items)
    for index, item in enumerate(items):
        annotation = annotation.with_rectangle(index, item.region, grow)
    for index, item in enumerate(items):
        annotation = annotation if item.grip is None else annotation.with_handle(index, item.grip, None)
    return annotation


def _item(
    surface: SplitSurface, points: Points, layer: Layer, front: SeenFront, config: ProposeConfig, grow: GrowConfig
) -> Item | None:
    """Return a front as a part; None where it is hardly scanned."""
    region = _region(surface, layer, front.box, grow)
    if region is None:
        return None
    tips = front.motion == ("slide", "out") and is_flap(region, points, config.density)
    joint = _joint(region, ("hinge", "bottom") if tips else front.motion)
    grip = _grip(layer, front.handle) if front.handle else None
    return Item(region, joint=joint, proposed=True, score=front.score, grip=grip)


def _grip(layer: Layer, handle: CellBox) -> np.ndarray:
    """Return the middle of a handle, as far out as it stands [m], shape [3]."""
    out = float(np.quantile(layer.ahead[handle.cells], 0.9))
    return np.asarray(_place(layer, *handle.middle) + out * layer.normal)


def _joint(region: FrontRegion, motion: Motion) -> Joint:
    if motion[0] == "slide":
        return slide(region, motion[1])
    return hinge_at(region, SIDES[motion[1]])


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
    return replace(turned, faces=inside(surface, turned, grow.thickness))


def inside(surface: SplitSurface, region: FrontRegion, distance: float) -> np.ndarray:
    """Return the faces whose middles lie in a region's rectangle, nearer to its plane than [m], and facing as it does."""
    place = region.local(surface.middles)
    flat = (np.abs(place[:, :2]) < region.size / 2).all(axis=1) & (np.abs(place[:, 2]) < distance)
    return np.flatnonzero(flat & (surface.normals @ region.normal > ALIGNED))


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
