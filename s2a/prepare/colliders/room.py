"""Convex hulls of the static room."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from s2a.core.cache import recall
from s2a.core.ranges import AtLeast, Count, NotNegative, Positive
from s2a.prepare.colliders.level_top import LevelTop
from s2a.scene.geometry.convex import APART, MARGIN, clip, cut_free, overlap, volume
from s2a.scene.geometry.decompose import one_hull, vhacd
from s2a.scene.geometry.planes import find_planes, slabs
from s2a.scene.geometry.simplify import is_structure
from s2a.scene.mesh import pack, unpack
from s2a.scene.scene import Mesh, Part
from s2a.scene.usd.sim_scene import Collider

THIN = 0.1
"""Thickness of a hull as a fraction of its width below which it is cut in layers."""
THINNEST = 0.002
"""[m] A thinner layer is not worth a collider."""


@dataclass(frozen=True)
class RoomConfig:
    """How the static room becomes convex hulls.

    Attributes:
        part_hulls: largest number of hulls of one part.
        furniture_hulls: the same of one around a moving part of no furniture: furniture that is not annotated as that.
        min_decomposed_size: parts whose bounding box has a shorter diagonal [m] become one hull.
        resolution: voxels of the decomposition.
        max_vertices: largest number of vertices of a hull.
        structure_labels: words that make a label one of a wall, floor or ceiling; those become thin boxes.
        flatness: largest distance of a wall's surface from its box [m].
        cell: width of the cells of which a wall's boxes are made [m].
        boxes: largest number of boxes of each plane of a wall.
        thickness: of those boxes [m].
        base_radius: radius of the upright column around a robot's base that stays free [m].
        base_height: its height [m].
        clearance: what stays free around the paths of the articulated parts [m].
        cut_hulls: largest number of hulls into which a cut takes one apart.
        min_volume: what is left of a hull after cutting counts from this volume on [m^3].
        min_cut_volume: the same for each hull but the largest into which it is taken apart [m^3].
    """

    part_hulls: Count
    furniture_hulls: Count
    min_decomposed_size: NotNegative
    resolution: Count
    max_vertices: Annotated[int, AtLeast(4)]
    structure_labels: tuple[str, ...]
    flatness: Positive
    cell: Positive
    boxes: Count
    thickness: Positive
    base_radius: NotNegative
    base_height: NotNegative
    clearance: NotNegative
    cut_hulls: Count
    min_volume: NotNegative
    min_cut_volume: NotNegative


def part_hulls(part: Part, config: RoomConfig) -> tuple[Collider, ...]:
    """Return the convex hulls of a part of the static room, from the cache where they were made before; part "" owns them."""
    structure = is_structure(part.label, config.structure_labels)
    hulls = unpack(
        recall("room", [part.mesh, repr((structure, config))], lambda: pack(_hulls(part.mesh, structure, config)))
    )
    return tuple(Collider("", hull, structure) for hull in hulls)


def cut_out(
    colliders: Sequence[Collider], obstacles: Sequence[Mesh], config: RoomConfig
) -> tuple[tuple[Collider, ...], tuple[str, ...]]:
    """Cut colliders free of obstacles; return them with the ids of the parts of which something was cut off."""
    found: list[Collider] = []
    trimmed: dict[str, None] = {}
    for collider in colliders:
        left = cut_all(collider.mesh, obstacles, config.cut_hulls, config.min_volume, config.min_cut_volume)
        if not any(piece is collider.mesh for piece in left):
            trimmed[collider.part] = None
        found += [Collider(collider.part, piece, collider.structure) for piece in left]
    return tuple(found), tuple(trimmed)


def below_tops(colliders: Sequence[Collider], tops: Sequence[LevelTop], config: RoomConfig) -> list[Collider]:
    """Cut colliders free of the layers of their own part's level tops."""
    found: list[Collider] = []
    for collider in colliders:
        layers = [hull for top in tops if top.part == collider.part for hull in top.layer]
        found += cut_out([collider], layers, config)[0]
    return found


def cut_all(
    hull: Mesh, obstacles: Sequence[Mesh], count: int = 1, min_volume: float = 0.0, min_cut_volume: float = 0.0
) -> list[Mesh]:
    """Return the largest convex parts of a hull that are free of all obstacles, the hull itself where it is free of them.

    Args:
        hull: what is cut.
        obstacles: convex hulls that nothing of it may reach into.
        count: largest number of parts.
        min_volume: none is left of a cut hull whose largest part is smaller [m^3].
        min_cut_volume: the same for each of its other parts.
    """
    hit = [obstacle for obstacle in obstacles if overlap(hull, obstacle) > APART]
    if not hit:
        return [hull]
    left = _layers(hull, hit) if count > 1 else [hull]
    for obstacle in hit:
        parts = [part for piece in left for part in cut_free(piece, obstacle, count, min_cut_volume)]
        left = parts if len(parts) <= count else sorted(parts, key=volume, reverse=True)[:count]
    left = sorted(left, key=volume, reverse=True)
    return [part for k, part in enumerate(left) if volume(part) >= (min_cut_volume if k else min_volume)]


def _layers(hull: Mesh, obstacles: Sequence[Mesh]) -> list[Mesh]:
    """Split a thin hull, such as a floor's, below the obstacles that only graze it, so that it gets no hole there."""
    _, _, axes = np.linalg.svd(hull.vertices - hull.vertices.mean(axis=0), full_matrices=False)
    *_, width, thickness = np.ptp(hull.vertices @ axes.T, axis=0)
    if thickness > THIN * width:
        return [hull]
    found = [hull]
    for up in (axes[2], -axes[2]):
        above = np.array([(obstacle.vertices @ up).min() for obstacle in obstacles]) - MARGIN
        grazing = above[above > (hull.vertices @ up).min() + THINNEST]
        if len(grazing):
            split = (clip(hull, up, grazing.min()), clip(hull, -up, -grazing.min()))
            found = max(found, [part for part in split if part is not None], key=len)
    return found


def _hulls(mesh: Mesh, structure: bool, config: RoomConfig) -> list[Mesh]:
    """Return thin boxes for a wall, hulls for anything else."""
    if not structure and np.linalg.norm(np.ptp(mesh.bounds, axis=0)) < config.min_decomposed_size:
        return one_hull(mesh, config.max_vertices)
    if not structure:
        return vhacd(mesh, config.part_hulls, config.resolution, config.max_vertices)
    planes = find_planes(mesh, config.flatness, min_area=20 * config.cell**2, count=6)
    boxes = [slabs(mesh, p, config.cell, closing=3, thickness=config.thickness, count=config.boxes) for p in planes]
    return [box for group in boxes for box in group]
