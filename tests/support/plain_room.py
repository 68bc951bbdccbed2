"""A floor and a wall-high board of small triangles that looks along +x, with painted fronts and a scanned bar."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from s2a.scan.folder import MESH
from s2a.scan.ply_file import write_ply
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Mesh

CELL = 0.02
BOARD = (1.6, 0.9)
"""[m] Along y from -0.8 and along z from 0."""
BAR = np.array([0.035, -0.4, 0.7])
"""Middle of the bar."""
LEFT, RIGHT = (60, 60, 140), (150, 90, 40)
"""Colours of the board for y below and above 0."""


def grid(corner: np.ndarray, along: np.ndarray, up: np.ndarray, size: tuple[float, float], color) -> Mesh:
    """Return a rectangle of triangles that looks along `along` x `up`; color: RGB, or a function of the points."""
    u, v = (np.linspace(0, length, round(length / CELL) + 1) for length in size)
    points = corner + u[:, None, None] * along + v[None, :, None] * up
    index = np.arange(len(u) * len(v)).reshape(len(u), len(v))
    a, b, c, d = (index[i, j].ravel() for i, j in ((np.s_[:-1], np.s_[:-1]), (np.s_[1:], np.s_[:-1]),
                  (np.s_[1:], np.s_[1:]), (np.s_[:-1], np.s_[1:])))  # fmt: skip
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    flat = points.reshape(-1, 3)
    return Mesh(flat, faces, color(flat) if callable(color) else np.tile(np.array(color, np.uint8), (len(flat), 1)))


def room() -> Mesh:
    y, z = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    x = np.array([1.0, 0.0, 0.0])
    board = grid(
        np.array([0.0, -0.8, 0.0]), y, z, BOARD, lambda p: np.where(p[:, 1:2] < -0.001, LEFT, RIGHT).astype(np.uint8)
    )
    bar = grid(BAR - 0.06 * y - 0.01 * z, y, z, (0.12, 0.02), (200, 200, 200))
    posts = [grid(BAR + s * 0.05 * y - [0.035, 0.01, 0.01], x, z, (0.035, 0.02), (200, 200, 200)) for s in (-1, 1)]
    floor = grid(np.array([0.0, -0.8, 0.0]), x, y, (2.0, 1.6), (120, 120, 120))
    return merge([board, merge([bar, *posts]), floor])


def write(folder: Path) -> Path:
    """Write the room as a scan without annotation."""
    folder.mkdir(parents=True)
    write_ply(folder / MESH, room())
    return folder


def face_at(mesh: Mesh, point: tuple[float, float, float]) -> int:
    """Return the face whose middle is nearest to a point."""
    return int(np.argmin(np.linalg.norm(mesh.vertices[mesh.faces].mean(axis=1) - np.array(point), axis=1)))
