"""Is there any place at all for a small object that a prompt allows? Every surface is tried, on a grid, without a search.

The surfaces are found by rays down through the whole room, and what is free and carried is told by placement_checks.py; neither
knows of the code that places. Whether a prompt's relations hold is told by the check that insertion uses, too.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from placement_checks import _blocked, _carried, _free
from triangle_queries import Obstacles, spread

from s2a.language.grammar import Relation
from s2a.language.insert.wish_check import met
from s2a.scene.scene import Mesh, Scene

STEP, AROUND = 0.03, 1.0
"""Spacing of the grid, and how far around the things that a prompt names it reaches [m]."""
LEVEL = 0.8
"""Least upward component of the normal of what may carry."""
BOARDS = 10
"""Surfaces below each other that are looked at."""
ABOVE = 0.008
"""Gap to what carries [m]: over the noise of a scan, and below what still counts as carried."""


def any_place(scene: Scene, object: Mesh, relations: Sequence[Relation]) -> list[float] | None:
    """Return the first place of an object's foot [m] at which it is free, carried, and as a prompt has it; None if there is none.

    Args:
        scene: the room.
        object: upright, its foot's middle at the origin, in metres.
        relations: of the prompt.
    """
    room = Obstacles(scene)
    for foot in _surfaces(scene, room, relations):
        there = Mesh(object.vertices + (foot + [0.0, 0.0, ABOVE]).astype(np.float32), object.faces)
        if not all(met(scene, there, one) for one in relations):
            continue
        points = spread(there, 2000)
        carried = _carried(room, points, False)
        if carried["carried"] and carried["inside_support"] and _free(room, there, points)["free"]:
            if not _blocked(scene, there, None):
                return foot.round(3).tolist()
    return None


def _surfaces(scene: Scene, room: Obstacles, relations: Sequence[Relation]) -> np.ndarray:
    """Return points on all level surfaces near what a prompt names [m], shape [point 3]."""
    named = {i for one in relations for ids in one.part_ids for i in ids if scene.parts[i].label.lower() != "floor"}
    bounds = np.array([scene.parts[i].mesh.bounds for i in named if len(scene.parts[i].mesh.vertices)])
    if not len(bounds):
        bounds = np.array([[room.vertices.min(axis=0), room.vertices.max(axis=0)]])
    low, high = bounds[:, 0].min(axis=0) - AROUND, bounds[:, 1].max(axis=0) + AROUND
    x, y = (np.arange(low[i], high[i], STEP) for i in (0, 1))
    start = np.stack(
        [*(each.ravel() for each in np.meshgrid(x, y)), np.full(len(x) * len(y), room.vertices[:, 2].max())], 1
    )
    down, found = np.array([0.0, 0.0, -1.0]), []
    for _ in range(BOARDS):
        distance, face = room.cast(start, np.tile(down, (len(start), 1)), 10.0)
        start = (start + distance[:, None] * down)[face >= 0]
        a, b, c = (room.vertices[room.faces[face[face >= 0], i]].astype(float) for i in range(3))
        normal = np.cross(b - a, c - a)
        up = normal[:, 2] > LEVEL * np.linalg.norm(normal, axis=1)
        found.append(start[up])
        start = start + 0.001 * down
    return np.concatenate(found)
