"""Convex hulls of the static room."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from s2a.cache import pack, recall, unpack
from s2a.geometry.convex import cut_free, volume
from s2a.geometry.decompose import one_hull, vhacd
from s2a.geometry.planes import find_planes, slabs
from s2a.geometry.simplify import is_structure
from s2a.ranges import AtLeast, Count, NotNegative, Positive
from s2a.scene import Mesh, Part
from s2a.usd.sim_scene import Collider


@dataclass(frozen=True)
class RoomConfig:
    """How the static room becomes convex hulls.

    Attributes:
        part_hulls: largest number of hulls of one part.
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
        min_volume: what is left of a hull after cutting counts from this volume on [m^3].
    """

    part_hulls: Count
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
    min_volume: NotNegative


def part_hulls(part: Part, config: RoomConfig) -> tuple[Collider, ...]:
    """Return the convex hulls of a part of the static room, from the cache where they were made before; part "" owns them."""
    structure = is_structure(part.label, config.structure_labels)
    hulls = unpack(
        recall("room", [part.mesh, repr((structure, config))], lambda: pack(_hulls(part.mesh, structure, config)))
    )
    return tuple(Collider("", hull, structure) for hull in hulls)


def cut_out(
    colliders: Sequence[Collider], obstacles: Sequence[Mesh], min_volume: float
) -> tuple[tuple[Collider, ...], tuple[str, ...]]:
    """Cut colliders free of obstacles; return them with the ids of the parts of which something was cut off."""
    found: list[Collider] = []
    trimmed: dict[str, None] = {}
    for collider in colliders:
        left = cut_all(collider.mesh, obstacles, min_volume)
        if left is not collider.mesh:
            trimmed[collider.part] = None
        if left is not None:
            found.append(Collider(collider.part, left, collider.structure))
    return tuple(found), tuple(trimmed)


def cut_all(hull: Mesh, obstacles: Sequence[Mesh], min_volume: float = 0.0) -> Mesh | None:
    """Return the largest part of a hull that is free of all obstacles, or None if less than `min_volume` [m^3] is left."""
    left: Mesh | None = hull
    for obstacle in obstacles:
        left = None if left is None else cut_free(left, obstacle)
    return left if left is hull or (left is not None and volume(left) >= min_volume) else None


def _hulls(mesh: Mesh, structure: bool, config: RoomConfig) -> list[Mesh]:
    """Return thin boxes for a wall, hulls for anything else."""
    if not structure and np.linalg.norm(np.ptp(mesh.bounds, axis=0)) < config.min_decomposed_size:
        return one_hull(mesh, config.max_vertices)
    if not structure:
        return vhacd(mesh, config.part_hulls, config.resolution, config.max_vertices)
    planes = find_planes(mesh, config.flatness, min_area=20 * config.cell**2, count=6)
    boxes = [slabs(mesh, p, config.cell, closing=3, thickness=config.thickness, count=config.boxes) for p in planes]
    return [box for group in boxes for box in group]
