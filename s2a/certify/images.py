"""What a certificate shows: the scan, what collides, and both over each other."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
from pxr import Usd, UsdPhysics

from s2a.geometry.orbit_camera import CameraPose, OrbitCamera, framing_pose, front_of
from s2a.geometry.render import painted, render
from s2a.scene import Mesh
from s2a.usd.stage import ROOT, open_stage, read_attribute, read_mesh
from s2a.usd.visuals import Visible, visible

TARGET = ((230, 120, 40), (250, 170, 60), (205, 90, 60), (245, 140, 100))
"""Colours of the moving part's pieces, one after the other."""
NEAR = 1.6
"""Distance for the picture of the grasp, as a multiple of what just fits."""
OTHERS = (120, 150, 190)
"""Colour of all other pieces."""


def pictures(path: Path, target: str, camera: OrbitCamera) -> dict[str, np.ndarray]:
    """Return images [row column 3] of a sim.usd, by their captions; none where there is nothing to see of the target.

    Args:
        path: the stage.
        target: id of the moving part.
        camera: intrinsics and framing of the images.
    """
    scene = visible(path)
    middle = scene.surfaces.get(target)
    if middle is None or not len(middle.faces) or not scene.colliders:
        return {}
    stage = open_stage(path)  # a prim lives no longer than its stage
    body = stage.GetPrimAtPath(f"{ROOT}/{target}")
    moving, others = _pieces(scene, body)
    view = _camera_pose(middle, middle, camera)
    seen, hard = list(scene.surfaces.values()), [*moving, *others]
    near = _camera_pose(read_mesh(body.GetChild("region")), middle, replace(camera, margin=NEAR))
    return {
        "the scan": render(seen, view, camera),
        "what collides; orange moves": render(hard, view, camera),
        "what collides over the scan": _mixed(seen, hard, view, camera),
        "the same at the grasp": _mixed(seen, hard, near, camera),
    }


def _mixed(seen: list[Mesh], hard: list[Mesh], view: CameraPose, camera: OrbitCamera) -> np.ndarray:
    """Return a picture in which two sets of surfaces shine through each other."""
    return ((render(seen, view, camera).astype(int) + render(hard, view, camera)) // 2).astype(np.uint8)


def _pieces(scene: Visible, body: Usd.Prim) -> tuple[list[Mesh], list[Mesh]]:
    """Return the pieces that stand for the parts of a body, and all others, in their colours."""
    pieces = (prim for prim in Usd.PrimRange(body) if prim.HasAPI(UsdPhysics.CollisionAPI))
    own = {read_attribute(prim, "part", str, "?") for prim in pieces}
    moving = [mesh for part, mesh in scene.colliders if part in own]
    others = [painted(mesh, OTHERS) for part, mesh in scene.colliders if part not in own]
    return [painted(mesh, color) for mesh, color in zip(moving, itertools.cycle(TARGET), strict=False)], others


def _camera_pose(shown: Mesh, part: Mesh, camera: OrbitCamera) -> CameraPose:
    """Return the view of a surface from the front of the part that it belongs to."""
    front = front_of([part])
    return framing_pose(shown.vertices, np.array([1.0, 0.0, 0.0]) if front is None else front, camera)
