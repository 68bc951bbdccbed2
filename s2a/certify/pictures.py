"""What a certificate shows: the scan, what collides, and both over each other."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from s2a.geometry.look import LookConfig, View, frame, front_of
from s2a.geometry.picture import draw, painted
from s2a.scene import Mesh
from s2a.usd.stage import open_stage, read_mesh
from s2a.usd.visible import Visible, visible

TARGET = ((230, 120, 40), (250, 170, 60), (205, 90, 60), (245, 140, 100))
"""Colours of the moving part's pieces, one after the other."""
NEAR = 1.6
"""Distance for the picture of the grasp, as a multiple of what just fits."""
OTHERS = (120, 150, 190)
"""Colour of all other pieces."""


def pictures(path: Path, target: str, look: LookConfig) -> dict[str, np.ndarray]:
    """Return images [row column 3] of a sim.usd, by their captions; none where there is nothing to see of the target.

    Args:
        path: the stage.
        target: id of the moving part.
        look: how the pictures are taken.
    """
    scene = visible(path)
    middle = scene.surfaces.get(target)
    if middle is None or not len(middle.faces) or not scene.colliders:
        return {}
    moving, others = _pieces(scene, target)
    view = _view(middle, middle, look)
    seen, hard = list(scene.surfaces.values()), [*moving, *others]
    stage = open_stage(path)  # a prim lives no longer than its stage
    region = read_mesh(stage.GetPrimAtPath(f"/scene/{target}/region"))
    near = _view(region, middle, replace(look, margin=NEAR))
    return {
        "the scan": draw(seen, view, look),
        "what collides; orange moves": draw(hard, view, look),
        "what collides over the scan": _mixed(seen, hard, view, look),
        "the same at the grasp": _mixed(seen, hard, near, look),
    }


def _mixed(seen: list[Mesh], hard: list[Mesh], view: View, look: LookConfig) -> np.ndarray:
    """Return a picture in which two sets of surfaces shine through each other."""
    return ((draw(seen, view, look).astype(int) + draw(hard, view, look)) // 2).astype(np.uint8)


def _pieces(scene: Visible, target: str) -> tuple[list[Mesh], list[Mesh]]:
    """Return the target's pieces and all others, in their colours; the target's are those within its bounds."""
    inside = scene.surfaces[target].bounds + [[-0.01] * 3, [0.01] * 3]
    moving: list[Mesh] = []
    others: list[Mesh] = []
    for _, mesh in scene.colliders:
        middle = mesh.bounds.mean(axis=0)
        own = bool(((middle > inside[0]) & (middle < inside[1])).all())
        color = TARGET[len(moving) % len(TARGET)] if own else OTHERS
        (moving if own else others).append(painted(mesh, color))
    return moving, others


def _view(shown: Mesh, part: Mesh, look: LookConfig) -> View:
    """Return the view of a surface from the front of the part that it belongs to."""
    front = front_of([part])
    return frame(shown.vertices, np.array([1.0, 0.0, 0.0]) if front is None else front, look)
