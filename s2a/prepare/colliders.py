"""Convex pieces for the part that is to be opened, with the gap behind its handle free for fingers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from s2a.geometry.decompose import coacd_default, one_hull, vhacd
from s2a.geometry.surfaces import merge
from s2a.scene import Scene
from s2a.usd.simready import Collider


@dataclass(frozen=True)
class ColliderConfig:
    """How the target becomes convex pieces.

    Attributes:
        method: "handle" (each part on its own, the grasp region finer), "coacd" (the library's defaults on all parts fused)
            or "one_hull" (all parts in one convex hull; for comparison: it swallows the handle).
        handle_hulls: largest number of pieces of the grasp region.
        front_hulls: largest number of pieces of the rest.
        resolution: voxels of the decomposition.
        max_vertices: largest number of vertices of a piece.
        seed: of the decomposition.
    """

    method: Literal["handle", "coacd", "one_hull"]
    handle_hulls: int
    front_hulls: int
    resolution: int
    max_vertices: int
    seed: int


def target_colliders(scene: Scene, target: str, config: ColliderConfig) -> tuple[Collider, ...]:
    """Return the convex pieces of a movable part and of all that moves with it."""
    members = (target, *scene.descendants(target))
    if config.method != "handle":
        fused = merge([scene.parts[i].mesh for i in members])
        if config.method == "one_hull":
            pieces = one_hull(fused, config.max_vertices)
        else:
            pieces = coacd_default(fused, config.max_vertices, config.seed)
        return tuple(Collider(target, piece) for piece in pieces)
    grasped = scene.grasp_parts(target)
    found = []
    for i in members:
        count = config.handle_hulls if i in grasped else config.front_hulls
        pieces = vhacd(scene.parts[i].mesh, count, config.resolution, config.max_vertices)
        found += [Collider(i, piece) for piece in pieces]
    return tuple(found)
