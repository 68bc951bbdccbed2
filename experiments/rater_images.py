"""Images of insertions for raters who must not know the method: before and after, wide and close."""

from __future__ import annotations

import hashlib
import json
import random
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from s2a.core import config
from s2a.language.insert.describe import RoomState
from s2a.language.insert.review import wide_and_close
from s2a.language.insert.settings import Inserted
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.render import CameraPose, OrbitCamera, render
from s2a.scene.scene import Scene


def rater_images(room: RoomState, name: str, done: dict[str, Inserted | None], folder: Path) -> None:
    """Render before and after, wide and close, for each method under a letter of its own."""
    folder.mkdir(parents=True, exist_ok=True)
    key_file = folder / "key.json"
    key = json.loads(key_file.read_text()) if key_file.exists() else {}
    letters = ["A", "B"]
    random.Random(name).shuffle(letters)
    camera = config.load(OrbitCamera, config.compose("view", ["camera=near"])["camera"])
    camera = replace(camera, width=640, height=480, samples=1)  # a thousand images, of which each takes a second
    for letter, (method, inserted) in zip(letters, sorted(done.items()), strict=False):
        key[f"{name}_{letter}"] = method
        if inserted is None:
            continue
        before = merge([part.mesh for part in room.scene.parts.values()])
        after = merge([before, inserted.part.mesh])
        views = [_camera_pose(inserted, distance) for distance in (3.0, 0.9)]
        rows = [np.concatenate([render([mesh], view, camera) for view in views], axis=1) for mesh in (before, after)]
        Image.fromarray(np.concatenate(rows, axis=0)).save(folder / f"{name}_{letter}.png")
    key_file.write_text(json.dumps(dict(sorted(key.items())), indent=1) + "\n")


def rater_image(scene: Scene, inserted: Inserted, name: str, method: str, folder: Path) -> None:
    """Render an object in its place, wide and close, from where it is seen; the file's name hides the method.

    Args:
        scene: the room without the object.
        inserted: the object in its place.
        name: of the object and the room.
        method: goes into the folder's key_METHOD.json.
        folder: receives the image.
    """
    folder.mkdir(parents=True, exist_ok=True)
    image = f"{name}_{hashlib.sha256(f'{name} {method}'.encode()).hexdigest()[:4]}"
    after = Scene(scene.name, {**scene.parts, inserted.placement.part_id: inserted.part}, scene.origin)
    camera = config.load(OrbitCamera, config.compose("view", ["camera=near"])["camera"])
    camera = replace(camera, width=440, height=330, samples=1, backface_culling=False)
    views = wide_and_close(inserted, after, replace(camera, margin=9.0))
    room = merge([part.mesh for part in after.parts.values()])
    Image.fromarray(np.concatenate([render([room], view, camera) for view in views], axis=1)).save(
        folder / f"{image}.png"
    )
    key_file = folder / f"key_{method}.json"
    key = json.loads(key_file.read_text()) if key_file.exists() else {}
    key[image] = {"method": method, "label": inserted.placement.label, "carrier": inserted.candidate.target}
    key_file.write_text(json.dumps(dict(sorted(key.items())), indent=1) + "\n")


def _camera_pose(inserted: Inserted, distance: float) -> CameraPose:
    """Return a camera pose on an object from the room, a little from above and to the side [m]."""
    bounds = inserted.part.mesh.bounds
    middle, size = bounds.mean(axis=0), float(np.linalg.norm(np.ptp(bounds, axis=0)))
    x, y, z, w = inserted.candidate.pose.quaternion
    front = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + z * w)])
    angle = np.arctan2(front[1], front[0]) + 0.5
    away = np.array([np.cos(angle), np.sin(angle), 0.55])
    eye = middle + (distance * 0.6 + size) * away / np.linalg.norm(away)
    return CameraPose(tuple(eye), tuple(middle))
