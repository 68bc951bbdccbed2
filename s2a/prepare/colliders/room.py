"""Convex pieces for the immovable room, where the arm can reach it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated

import numpy as np

from s2a.cache import pack, recall, unpack
from s2a.geometry.convex import column, cut_free, volume
from s2a.geometry.decompose import one_hull, vhacd
from s2a.geometry.mesh_ops import centroids, keep
from s2a.geometry.planes import find_planes, slabs
from s2a.geometry.simplify import is_shell
from s2a.progress import track
from s2a.ranges import AtLeast, Count, CountFromZero, NotNegative, Positive
from s2a.scene import Mesh, Scene, Vec3
from s2a.usd.sim_scene import Collider

GAP = 0.002
"""[m] Between a pedestal and the robot's base."""
UNEVEN = 0.01
"""[m] A scanned floor may rise by so much under the robot's base."""


@dataclass(frozen=True)
class RoomConfig:
    """Which pieces of the room are there to be bumped into.

    Attributes:
        reach: distance from the robot's shoulder and from the handle [m] beyond which nothing collides.
        pieces: largest number of pieces altogether; walls and floor first, then the nearest parts.
        part_pieces: largest number of pieces of one piece of furniture.
        small: parts whose bounding box has a shorter diagonal [m] become one hull.
        resolution: voxels of its decomposition.
        max_vertices: largest number of vertices of a piece.
        shell_labels: words that make a label one of a wall, floor or ceiling; those become thin boxes.
        flatness: largest distance of a wall's surface from its box [m].
        cell: grain of those boxes [m].
        thickness: of those boxes [m].
        base_radius: radius of the upright column around the robot's base that stays free [m].
        base_height: its height [m].
        clearance: what stays free around the way of the target [m].
        crumb: what is left of a piece after cutting counts from this volume on [m^3].
    """

    reach: Positive
    pieces: CountFromZero
    part_pieces: Count
    small: NotNegative
    resolution: Count
    max_vertices: Annotated[int, AtLeast(4)]
    shell_labels: tuple[str, ...]
    flatness: Positive
    cell: Positive
    thickness: Positive
    base_radius: NotNegative
    base_height: NotNegative
    clearance: NotNegative
    crumb: NotNegative


def room_colliders(
    scene: Scene,
    parts: Sequence[str],
    base: Vec3,
    grasp: Vec3,
    swept: Sequence[Mesh],
    config: RoomConfig,
    shoulder_height: float,
) -> tuple[tuple[Collider, ...], tuple[str, ...]]:
    """Return convex pieces of the parts near the robot, and the ids of the parts of which something was cut off.

    None reaches into the column above the robot's base or into the way of the target: what would, is cut off.

    Args:
        scene: the room.
        parts: ids of its immovable parts.
        base: where the robot stands [m].
        grasp: where it takes hold [m].
        swept: convex pieces that cover the way of the target, and what has to stay free around it.
        config: how many, how fine.
        shoulder_height: of the robot above its base [m].
    """
    foot, held = np.array(base), np.array(grasp)
    shoulder = foot + [0.0, 0.0, shoulder_height]
    obstacles = [column(foot + [0, 0, UNEVEN], config.base_radius, config.base_height - UNEVEN), *swept]
    near = {i: _within_reach(scene.parts[i].mesh, shoulder, held, config.reach) for i in parts}
    near = {i: mesh for i, mesh in near.items() if len(mesh.faces)}
    flat = {i: is_shell(scene.parts[i].label, config.shell_labels) for i in parts}
    # Walls and floor are few boxes, which no clutter may crowd out.
    order = sorted(near, key=lambda i: (not flat[i], _distance(near[i], shoulder, held)))
    found: list[Collider] = []
    trimmed: list[str] = []
    for i in track(order, "room colliders"):
        if len(found) >= config.pieces:
            break
        made = partial(_packed_pieces, near[i], flat[i], config)
        pieces = unpack(recall("room", [near[i], repr((flat[i], config))], made))
        free = [cut_all(piece, obstacles, config.crumb) for piece in pieces]
        found += [Collider(i, piece) for piece in free if piece is not None]
        trimmed += [i] if any(cut is not piece for cut, piece in zip(free, pieces, strict=True)) else []
    return tuple(found[: config.pieces]), tuple(trimmed)


def pedestal(base: Vec3, height: float, radius: float) -> list[Mesh]:
    """Return what a robot stands on: an upright column under its base [m], just not touching it; nothing on the floor."""
    return [column(np.array(base) - [0.0, 0.0, height], radius, height - GAP)] if height > GAP else []


def cut_all(piece: Mesh, obstacles: Sequence[Mesh], crumb: float = 0.0) -> Mesh | None:
    """Return the largest part of a piece that is free of all obstacles, or None if less than `crumb` [m^3] is left of it."""
    left: Mesh | None = piece
    for obstacle in obstacles:
        left = None if left is None else cut_free(left, obstacle)
    return left if left is piece or (left is not None and volume(left) >= crumb) else None


def _packed_pieces(mesh: Mesh, is_flat: bool, config: RoomConfig) -> dict[str, np.ndarray]:
    return pack(_pieces(mesh, is_flat, config))


def _pieces(mesh: Mesh, is_flat: bool, config: RoomConfig) -> list[Mesh]:
    """Return thin boxes for a wall, hulls for anything else."""
    if not is_flat and np.linalg.norm(np.ptp(mesh.bounds, axis=0)) < config.small:
        return one_hull(mesh, config.max_vertices)
    if not is_flat:
        return vhacd(mesh, config.part_pieces, config.resolution, config.max_vertices)
    planes = find_planes(mesh, config.flatness, min_area=20 * config.cell**2, count=6)
    boxes = [slabs(mesh, plane, config.cell, closing=3, thickness=config.thickness, count=4) for plane in planes]
    return [box for group in boxes for box in group]


def _within_reach(mesh: Mesh, shoulder: np.ndarray, grasp: np.ndarray, reach: float) -> Mesh:
    """Return the faces of a mesh within reach [m] of the shoulder, in plan (floors count), or of the grasp point."""
    middle = centroids(mesh)
    in_plan = np.linalg.norm(middle[:, :2] - shoulder[:2], axis=1) < reach
    low = middle[:, 2] < shoulder[2] + reach
    return keep(mesh, in_plan & low | (np.linalg.norm(middle - grasp, axis=1) < reach))


def _distance(mesh: Mesh, shoulder: np.ndarray, grasp: np.ndarray) -> float:
    """Return how near the box around a mesh comes to the shoulder or the grasp point [m]."""
    low, high = mesh.bounds
    return min(float(np.linalg.norm(p - np.clip(p, low, high))) for p in (shoulder, grasp))
