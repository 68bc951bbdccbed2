"""Render contact sheets of virtual homes, without scanning them: rooms from above, or handles close up.

python tools/home_sheets.py rooms sheet.png --count 40
python tools/home_sheets.py handles sheet.png --count 100
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import sheet

from s2a.core import config
from s2a.homes.furnishing import HOMES, home
from s2a.homes.room import Entry, Room, catalog
from s2a.homes.solids import Piece
from s2a.scene.geometry.camera import CameraPose, OrbitCamera, framing_pose
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.mesh_query import first_hits, ray_mesh
from s2a.scene.geometry.render import render
from s2a.scene.scene import Mesh

TILES = {"rooms": (400, 300), "handles": (200, 150)}
"""Size of an image [pixel]."""
CAPTION = 16
COLUMNS = {"rooms": 5, "handles": 10}
PLACES = (
    (0.75, 0.35, 0.25),
    (0.75, -0.35, 0.25),
    (0.6, 0.0, 0.5),
    (0.35, 0.2, 0.15),
    (0.35, -0.2, 0.15),
    (0.2, 0.0, 0.3),
)
"""Before, beside and above a handle, where a camera is tried [m]."""


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
    print(f"{sheet.write(tiles, out, COLUMNS[kind], CAPTION)}, {count} {kind}, seeds from {first}")


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
    eye, middle = _view(chosen, merge([entry.piece.surface.mesh for entry in entries]))
    close = replace(camera, backface_culling=False, fov=0.7)
    image = render([entry.piece.surface.mesh for entry in entries], CameraPose(tuple(eye), tuple(middle)), close)
    return f"{chosen.facts.get('family', chosen.style)} {1e3 * chosen.size.max():.0f} mm", image


def _view(handle: Piece, room: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Return of the places around a handle the one that most of it is seen from, and the handle's middle [m], shape [3] each."""
    middle, front = handle.surface.vertices.mean(axis=0), handle.pose[:3, 0]
    # A handle on a lid faces up: beside it is any horizontal direction.
    aside = np.cross(front, (0, 0, 1) if abs(front[2]) < 0.8 else (1, 0, 0))
    seen, mesh = [], ray_mesh(room.vertices, room.faces)
    eyes = [middle + far * front + side * aside + (0, 0, up) for far, side, up in PLACES]
    for eye in eyes:
        rays = handle.surface.vertices - eye
        far = np.linalg.norm(rays, axis=1)
        hits = first_hits(mesh, np.broadcast_to(eye, rays.shape), rays / far[:, None])
        seen.append(np.mean(hits > far - 0.005))
    return eyes[int(np.argmax(seen))], middle


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


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=TILES)
    parser.add_argument("out", type=Path)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    args = parser.parse_args()
    main(args.kind, args.out, args.count, args.first)
