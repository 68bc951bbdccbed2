"""Images of a validation report: the scan, the colliders, and both over each other."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np

from s2a.scan.visuals import hulls, visible_room
from s2a.scene.geometry.mesh_ops import painted
from s2a.scene.geometry.orbit_camera import CameraPose, OrbitCamera, framing_pose, front_of
from s2a.scene.geometry.render import render
from s2a.scene.scene import Mesh
from s2a.scene.usd import sim_stage

TARGET = ((230, 120, 40), (250, 170, 60), (205, 90, 60), (245, 140, 100))
"""Colours of the moving part's colliders, one after the other."""
NEAR = 1.6
"""Distance for the image of the grasp, as a multiple of what just fits."""
OTHERS = (120, 150, 190)
"""Colour of all other colliders."""


def images(path: Path, part: str, camera: OrbitCamera) -> dict[str, np.ndarray]:
    """Return images [row column 3] of a sim.usd, by their captions; none where there is nothing to see of the part.

    Args:
        path: the stage.
        part: id of the articulated part.
        camera: intrinsics and framing of the images.
    """
    room = sim_stage.read(path)
    body, scene = room.bodies[part], visible_room(room)
    if not len(body.visual.faces) or not scene.colliders:
        return {}
    moving = [painted(c.mesh, color) for c, color in zip(body.colliders, itertools.cycle(TARGET), strict=False)]
    others = [painted(mesh, OTHERS) for owner, _, mesh in hulls(room) if owner != part]
    view = _camera_pose(body.visual, body.visual, camera)
    seen, hard = list(scene.surfaces.values()), [*moving, *others]
    near = _camera_pose(room.articulations[part].grasp.region, body.visual, replace(camera, margin=NEAR))
    return {
        "the scan": render(seen, view, camera),
        "what collides; orange moves": render(hard, view, camera),
        "what collides over the scan": _mixed(seen, hard, view, camera),
        "the same at the grasp": _mixed(seen, hard, near, camera),
    }


def _mixed(seen: list[Mesh], hard: list[Mesh], view: CameraPose, camera: OrbitCamera) -> np.ndarray:
    """Return an image of two sets of surfaces, blended."""
    return ((render(seen, view, camera).astype(int) + render(hard, view, camera)) // 2).astype(np.uint8)


def _camera_pose(shown: Mesh, part: Mesh, camera: OrbitCamera) -> CameraPose:
    """Return the camera pose that frames a surface from the front of its part."""
    front = front_of([part])
    return framing_pose(shown.vertices, np.array([1.0, 0.0, 0.0]) if front is None else front, camera)
