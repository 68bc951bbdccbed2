"""Convex pieces for the part that is to be opened, with the gap behind its handle free for fingers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from s2a.geometry.convex import clip, overlap, subtract
from s2a.geometry.decompose import coacd_default, one_hull, vhacd
from s2a.geometry.front import front_behind, front_coordinate, part_ways
from s2a.geometry.gap import FingerSpace, finger_space
from s2a.geometry.surfaces import merge
from s2a.scene import Mesh, Scene
from s2a.usd.simready import Collider

SWALLOWED = 2e-4
"""[m] A piece that reaches into the fingers' space by a smaller ball than this leaves it free."""


@dataclass(frozen=True)
class ColliderConfig:
    """How the target becomes convex pieces.

    Attributes:
        method: "handle" (each part on its own, the grasp region finer, the fingers' space kept free), "coacd" (the
            library's defaults on all parts fused) or "one_hull" (all parts in one convex hull; it swallows the handle).
        handle_pieces: largest number of pieces of the grasp region.
        front_pieces: largest number of pieces of each other part.
        resolution: voxels of the decomposition.
        max_vertices: largest number of vertices of a piece.
        seed: of the decomposition.
    """

    method: Literal["handle", "coacd", "one_hull"]
    handle_pieces: int
    front_pieces: int
    resolution: int
    max_vertices: int
    seed: int


@dataclass(frozen=True)
class Handle:
    """What surrounds the grasp of a part.

    Attributes:
        frame: the grasp frame's axes as columns [3 3]: z into the furniture.
        region: the grasp region, borders tidied.
        plane: the front behind it as outward normal and offset [m]; None where none was scanned.
        space: where the fingers go.
    """

    frame: np.ndarray
    region: Mesh
    plane: tuple[np.ndarray, float] | None
    space: FingerSpace

    def front(self, point: np.ndarray) -> float:
        """Return where the line through a point [3] along the frame's z meets the front: its coordinate on z [m]."""
        assert self.plane is not None
        return front_coordinate(self.plane, self.frame, point)


def find_handle(scene: Scene, target: str, frame: np.ndarray) -> tuple[Handle, dict[str, Mesh]]:
    """Return the surroundings of the grasp, and the tidied surface of every other part that moves along, by id."""
    grasped = scene.grasp_parts(target)
    region = merge([scene.parts[i].mesh for i in grasped])
    others = {i: scene.parts[i].mesh for i in (target, *scene.descendants(target)) if i not in grasped}
    plane = front_behind(others[target], region, frame) if target in others else None
    if plane is None:
        return Handle(frame, region, None, FingerSpace(None, ())), others
    others[target], region = part_ways(others[target], region, frame, plane)
    point = scene.grasp_point(target)
    space = finger_space(region, point, frame, front_coordinate(plane, frame, point))
    return Handle(frame, region, plane, space), others


def target_colliders(
    scene: Scene, target: str, handle: Handle, others: dict[str, Mesh], config: ColliderConfig
) -> tuple[Collider, ...]:
    """Return the convex pieces of a movable part and of all that moves with it."""
    if config.method != "handle":
        fused = merge([scene.parts[i].mesh for i in (target, *scene.descendants(target))])
        pieces = (
            one_hull(fused, config.max_vertices)
            if config.method == "one_hull"
            else coacd_default(fused, config.max_vertices, config.seed)
        )
        return tuple(Collider(target, piece) for piece in pieces)
    found = []
    for i, mesh in others.items():
        pieces = vhacd(mesh, config.front_pieces, config.resolution, config.max_vertices)
        found += [Collider(i, piece) for piece in flatten(pieces, handle)]
    pieces = vhacd(handle.region, config.handle_pieces, config.resolution, config.max_vertices)
    found += [Collider(scene.grasp_parts(target)[0], piece) for piece in free_fingers(pieces, handle.space)]
    return tuple(found)


def flatten(pieces: Iterable[Mesh], handle: Handle) -> list[Mesh]:
    """Cut pieces of the front that reach into the fingers' space off at the front's plane."""
    flat = []
    for piece in pieces:
        if handle.plane is not None and any(overlap(piece, box) > SWALLOWED for box in handle.space.boxes):
            piece = clip(piece, *handle.plane)
        flat.append(piece)
    return [piece for piece in flat if piece is not None]


def free_fingers(pieces: Iterable[Mesh], space: FingerSpace) -> list[Mesh]:
    """Cut the fingers' space out of pieces, which may come apart into several."""
    free = list(pieces)
    for box in space.boxes:
        parts = [subtract(piece, box) if overlap(piece, box) > SWALLOWED else [piece] for piece in free]
        free = [part for group in parts for part in group]
    return free
