"""Vertex colours: the paint of the nearest piece of furniture, wood grain, weave, light and camera noise."""

from __future__ import annotations

import numpy as np

from s2a.homes.solids import FABRIC, PLAIN, WOOD, Surface

LIGHT = np.array((0.35, 0.25, 0.9)) / np.linalg.norm((0.35, 0.25, 0.9))
"""Direction to the light in the room: ceiling lamps, and a window to one side."""


def vertex_colors(points: np.ndarray, surface: Surface, nearest: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the colour of each scanned point, shape [point 3], uint8.

    Args:
        points: in the room's frame, along which boards and threads run [m], shape [point 3].
        surface: what was scanned, in the room's frame.
        nearest: its face nearest to each point, shape [point].
        rng: where the noise comes from.
    """
    a, b, c = np.moveaxis(surface.vertices[surface.faces], 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
    # Half of the light comes from everywhere: walls are white.
    light = (0.78 + 0.22 * (normal @ LIGHT))[nearest]
    texture = surface.textures[nearest]
    grain = np.select([texture == PLAIN, texture == WOOD, texture == FABRIC], [_plain(points), _wood(points), 1.0], 1.0)
    weave = np.where(texture == FABRIC, 0.08, 0.015) * rng.normal(size=len(points))
    color = surface.colors[nearest] * (light * (grain + weave))[:, None] + rng.normal(0.0, 1.5, (len(points), 3))
    return np.clip(np.rint(color), 0, 255).astype(np.uint8)


def _plain(points: np.ndarray) -> np.ndarray:
    """Return the faint clouds of a painted surface, about 1, shape [point]."""
    x, y, z = points.T
    return 1.0 + 0.015 * np.sin(7 * x + 3 * z) * np.sin(5 * y - 4 * z + 1)


def _wood(points: np.ndarray) -> np.ndarray:
    """Return boards of 0.12 m with grain along x, about 1, shape [point]."""
    x, y, z = points.T
    board = np.floor((y + z) / 0.12)
    tone = 0.08 * np.sin(board * 12.9898)
    return 1.0 + tone + 0.06 * np.sin(260 * (y + z) + 3 * np.sin(4 * x + board) + 2 * np.sin(9 * x))
