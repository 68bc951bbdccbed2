"""What a certificate shows: the scan, what collides, and both over each other."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np

from s2a.geometry.camera_pose import LookConfig, View, frame, front_of
from s2a.geometry.render import draw, painted
from s2a.scene import Mesh
from s2a.usd import sim_stage
from s2a.usd.visuals import hulls, visible_room

TARGET = ((230, 120, 40), (250, 170, 60), (205, 90, 60), (245, 140, 100))
"""Colours of the moving part's pieces, one after the other."""
NEAR = 1.6
"""Distance for the picture of the grasp, as a multiple of what just fits."""
OTHERS = (120, 150, 190)
"""Colour of all other pieces."""


def pictures(path: Path, part: str, look: LookConfig) -> dict[str, np.ndarray]:
    """Return images [row column 3] of a sim.usd, by their captions; none where there is nothing to see of the part.

    Args:
        path: the stage.
        part: id of the articulated part.
        look: how the images are taken.
    """
    room = sim_stage.read(path)
    body, scene = room.bodies[part], visible_room(room)
    if not len(body.visual.faces) or not scene.colliders:
        return {}
    moving = [painted(c.mesh, color) for c, color in zip(body.colliders, itertools.cycle(TARGET), strict=False)]
    others = [painted(mesh, OTHERS) for owner, _, mesh in hulls(room) if owner != part]
    view = _view(body.visual, body.visual, look)
    seen, hard = list(scene.surfaces.values()), [*moving, *others]
    near = _view(room.articulations[part].grasp.region, body.visual, replace(look, margin=NEAR))
    return {
        "the scan": draw(seen, view, look),
        "what collides; orange moves": draw(hard, view, look),
        "what collides over the scan": _mixed(seen, hard, view, look),
        "the same at the grasp": _mixed(seen, hard, near, look),
    }


def _mixed(seen: list[Mesh], hard: list[Mesh], view: View, look: LookConfig) -> np.ndarray:
    """Return a picture in which two sets of surfaces shine through each other."""
    return ((draw(seen, view, look).astype(int) + draw(hard, view, look)) // 2).astype(np.uint8)


def _view(shown: Mesh, part: Mesh, look: LookConfig) -> View:
    """Return the view of a surface from the front of the part that it belongs to."""
    front = front_of([part])
    return frame(shown.vertices, np.array([1.0, 0.0, 0.0]) if front is None else front, look)
