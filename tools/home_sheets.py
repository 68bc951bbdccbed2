"""Render contact sheets of varied homes, without scanning them: rooms from above, or handles close up.

python tools/home_sheets.py rooms sheet.png --count 40
python tools/home_sheets.py handles sheet.png --count 100
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from s2a import config
from s2a.geometry.orbit_camera import CameraPose, OrbitCamera, framing_pose
from s2a.geometry.render import render
from s2a.scene import Mesh
from s2a.synth.catalog import Entry, catalog
from s2a.synth.homes import HOMES, home
from s2a.synth.room import Room

TILES = {"rooms": (640, 480), "handles": (200, 150)}
"""Size of an image [pixel]."""
CAPTION = 16
COLUMNS = {"rooms": 3, "handles": 10}
DISTANCE = 0.75
"""[m] Of the camera from a handle."""


def main(kind: str, out: Path, count: int, first: int) -> None:
    """Render a sheet of so many rooms or handles, beginning with a seed."""
    camera = config.load(OrbitCamera, config.compose("view")["camera"])
    camera = replace(camera, width=TILES[kind][0], height=TILES[kind][1], samples=2)
    names = list(HOMES)
    tiles = []
    for i in range(count):
        name, seed = names[i % len(names)], first + i // len(names)
        room = home(name, seed)
        image = above(room, camera) if kind == "rooms" else handle(room, i, camera)
        tiles.append((f"{name} {seed}", image) if kind == "rooms" else image)
    _sheet(tiles, COLUMNS[kind], TILES[kind]).save(out)
    print(f"{out}: {count} {kind}, seeds from {first}")


def above(room: Room, camera: OrbitCamera) -> np.ndarray:
    """Render a room without its ceiling; walls are seen from within alone."""
    meshes = [mesh for entry in catalog(room.pieces) if (mesh := _inner(entry)) is not None]
    points = np.concatenate([mesh.vertices for mesh in meshes])
    pose = framing_pose(points, np.array((0.35, -1.0, 0.0)), replace(camera, elevation=0.95))
    return render(meshes, pose, camera)


def handle(room: Room, number: int, camera: OrbitCamera) -> tuple[str, np.ndarray]:
    """Render one handle of a room with the front that it is on, and name its family."""
    entries = catalog(room.pieces)
    handles = [entry for entry in entries if entry.piece.style is not None]
    chosen = handles[(7 * number) % len(handles)].piece
    middle = chosen.surface.vertices.mean(axis=0)
    front = chosen.pose[:3, 0]
    eye = middle + DISTANCE * front + 0.35 * np.cross(front, (0, 0, 1)) + (0, 0, 0.25)
    camera = replace(camera, backface_culling=False, fov=0.7)
    image = render([entry.piece.surface.mesh for entry in entries], CameraPose(tuple(eye), tuple(middle)), camera)
    return f"{chosen.facts.get('family', chosen.style)} {1e3 * chosen.size.max():.0f} mm", image


def _inner(entry: Entry) -> Mesh | None:
    """Return what is drawn of a part: nothing of ceilings, of walls the face towards the room."""
    mesh = entry.piece.surface.mesh
    if entry.piece.name in ("ceiling", "ceiling lamp"):
        return None
    if entry.piece.name != "wall":
        return mesh
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    inwards = np.cross(b - a, c - a) @ entry.piece.pose[:3, 0] > 0
    return Mesh(mesh.vertices, mesh.faces[inwards], mesh.colors)


def _sheet(tiles: list[tuple[str, np.ndarray]], columns: int, size: tuple[int, int]) -> Image.Image:
    """Return images with their names in rows."""
    rows = -(-len(tiles) // columns)
    sheet = Image.new("RGB", (columns * size[0], rows * (size[1] + CAPTION)), "white")
    font = ImageFont.load_default(12)
    for i, (name, image) in enumerate(tiles):
        corner = i % columns * size[0], i // columns * (size[1] + CAPTION)
        sheet.paste(Image.fromarray(image), corner)
        ImageDraw.Draw(sheet).text((corner[0] + size[0] // 2, corner[1] + size[1]), name, "black", font, anchor="ma")
    return sheet


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=TILES)
    parser.add_argument("out", type=Path)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    args = parser.parse_args()
    main(args.kind, args.out, args.count, args.first)
