"""Convex pieces for the immovable room, where the arm can reach it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.geometry.convex import column, cut_free
from s2a.geometry.decompose import vhacd
from s2a.geometry.surfaces import centroids, keep
from s2a.scene import Mesh, Scene
from s2a.usd.simready import Collider


@dataclass(frozen=True)
class RoomConfig:
    """Which pieces of the room are there to be bumped into.

    Attributes:
        reach: distance from the robot's shoulder axis and from the handle [m] beyond which nothing collides.
        pieces: largest number of pieces altogether.
        part_pieces: largest number of pieces of one piece of furniture.
        resolution: voxels of the decomposition.
        max_vertices: largest number of vertices of a piece.
        base_radius: radius of the upright column around the robot's base that stays free [m].
        base_height: its height [m].
    """

    reach: float
    pieces: int
    part_pieces: int
    resolution: int
    max_vertices: int
    base_radius: float
    base_height: float


def room_colliders(
    scene: Scene, parts: tuple[str, ...], base: np.ndarray, grasp: np.ndarray, swept: list[Mesh], config: RoomConfig
) -> tuple[Collider, ...]:
    """Return convex pieces of the parts near the robot; none reaches into its base column or the way of the target."""
    obstacles = [column(base, config.base_radius, config.base_height), *swept]
    found: list[Collider] = []
    for i in parts:
        near = crop(scene.parts[i].mesh, base, grasp, config.reach)
        for piece in vhacd(near, config.part_pieces, config.resolution, config.max_vertices) if len(near.faces) else []:
            free: Mesh | None = piece
            for obstacle in obstacles:
                free = None if free is None else cut_free(free, obstacle)
            if free is not None:
                found.append(Collider(i, free))
    return tuple(found[: config.pieces])


def crop(mesh: Mesh, base: np.ndarray, grasp: np.ndarray, reach: float) -> Mesh:
    """Return the faces of a mesh within reach [m] of the upright axis through the base or of the grasp point."""
    middle = centroids(mesh)
    from_axis = np.linalg.norm(middle[:, :2] - base[:2], axis=1)
    low = middle[:, 2] < base[2] + 0.33 + reach  # the Panda's shoulder is 0.333 m above its base
    return keep(mesh, (from_axis < reach) & low | (np.linalg.norm(middle - grasp, axis=1) < reach))
