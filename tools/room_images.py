"""Render docs/rooms.png: a scan of every virtual room from above, and one piece of furniture in it from inside.

    python tools/room_images.py runs/rooms docs/rooms.png

The first argument is a folder for the scans, which takes those that are there and makes the others, half a minute each.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import sheet

from s2a.core import config
from s2a.homes.commands.sample import run
from s2a.homes.rooms import ROOMS
from s2a.homes.sample import SampleConfig
from s2a.scan.visuals import Visible, visible
from s2a.scene.geometry.camera import CameraPose, OrbitCamera, framing_pose, front_of, render

TILE, CAPTION, COLUMNS = (480, 360), 22, 3
"""Size of an image and height of the name below it [pixel]; images in a row."""
ABOVE = {"width": TILE[0], "height": TILE[1], "samples": 3, "elevation": 0.8, "margin": 1.02}
INSIDE = ("bedroom", "wardrobe", 2.1)
"""Room, piece of furniture, and distance from which it is drawn [m]."""


def main(scans: Path, out: Path) -> None:
    """Render all rooms and one interior view."""
    camera = replace(config.load(OrbitCamera, config.compose("view")["camera"]), **ABOVE)
    seen = {room: visible(_scan(room, scans)) for room in ROOMS}
    tiles = [(room.replace("_", " "), above(scene, camera)) for room, scene in seen.items()]
    room, furniture, distance = INSIDE
    tiles.append((f"{furniture} of the {room}", _inside(seen[room], furniture, distance, camera)))
    print(f"{sheet.write(tiles, out, COLUMNS, CAPTION)}, {len(ROOMS)} rooms")


def _scan(room: str, scans: Path) -> Path:
    """Return the folder of a room's scan; make it if it is not there."""
    folder = scans / room
    if not folder.exists():
        print(run(config.load(SampleConfig, config.compose("sample", [f"room={room}", f"out={folder}"]))))
    return folder


def above(scene: Visible, camera: OrbitCamera) -> np.ndarray:
    """Render a scan, seen towards the corner of the room at which most of what opens stands."""
    meshes = list(scene.surfaces.values())
    front = front_of([scene.surfaces[part] for part in scene.jointed])
    assert front is not None, "every virtual room has parts that move"
    return render(meshes, framing_pose(np.concatenate([mesh.vertices for mesh in meshes]), front, camera), camera)


def _inside(scene: Visible, furniture: str, distance: float, camera: OrbitCamera) -> np.ndarray:
    """Render the first piece of furniture of a kind as someone sees it who stands before it, a little to its left."""
    meshes = list(scene.surfaces.values())
    (chosen, *_) = [mesh for part, mesh in scene.surfaces.items() if part.startswith(furniture)]
    low, high = chosen.bounds + [[-0.05], [0.05]]
    jointed = [scene.surfaces[part] for part in scene.jointed]
    front = front_of([mesh for mesh in jointed if (mesh.bounds[0] > low).all() and (mesh.bounds[1] < high).all()])
    assert front is not None, "the furniture has fronts that open"
    middle = chosen.bounds.mean(axis=0)
    eye = middle + distance * front + 0.3 * distance * np.cross(front, (0.0, 0.0, 1.0))
    view = CameraPose((eye[0], eye[1], 1.55), (middle[0], middle[1], 1.0))
    return render(meshes, view, replace(camera, fov=1.05, backface_culling=False))


def folder_and_image(doc: str | None) -> tuple[Path, Path]:
    """Return the arguments of a tool that reads a folder and writes an image."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("image", type=Path)
    args = parser.parse_args()
    return args.folder, args.image


if __name__ == "__main__":
    main(*folder_and_image(__doc__))
