"""The colours of an object's sides: a poster, a book or a box has its print in front."""

from __future__ import annotations

import numpy as np

from s2a.language.insert.axes import AXES
from s2a.scene.geometry.line_of_sight import visible_distance
from s2a.scene.geometry.mesh_query import nearest_faces, ray_mesh
from s2a.scene.scene import Mesh

GRID = 24
"""Rays along a side of the grid, at each end."""


def colour_spread(mesh: Mesh) -> dict[str, float]:
    """Return for each axis, "+x" to "-z", the spread of the colours seen from there, 0 to 255; empty without colours.

    That is the standard deviation over parallel rays from that side, as the root mean square of the channels.
    """
    if mesh.colors is None or not len(mesh.faces):
        return {}
    # In a box of size 1: files have any unit, and rays are in single precision.
    low, longest = mesh.vertices.min(axis=0), float(np.ptp(mesh.vertices, axis=0).max())
    tree = ray_mesh((mesh.vertices - low) / longest, mesh.faces)
    sides = np.ptp(mesh.vertices, axis=0).astype(np.float64) / longest
    colors = mesh.colors[mesh.faces][:, :, :3].astype(np.float64).mean(axis=1)
    return {name: _spread(colors[_seen(tree, sides, axis)]) for name, axis in AXES.items()}


def _seen(tree: object, sides: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Return the faces that rays against an axis meet first, shape [hit]."""
    up = int(np.abs(axis).argmax())
    across = [i for i in range(3) if i != up]
    middles = (np.stack(np.meshgrid(*[np.arange(GRID)] * 2), axis=-1).reshape(-1, 2) + 0.5) / GRID
    start = np.empty((len(middles), 3))
    start[:, across] = middles * sides[across]
    start[:, up] = sides[up] if axis[up] > 0 else 0.0
    start += 0.1 * axis
    reach = float(sides[up]) + 0.2
    distance, _ = visible_distance(tree, start, -axis, reach)
    hit = distance < reach
    face, _ = nearest_faces(tree, start[hit] - distance[hit, None] * axis)
    return face[face >= 0]


def _spread(colors: np.ndarray) -> float:
    """Return the standard deviation of colours [hit 3]."""
    return round(float(np.sqrt(colors.var(axis=0).mean())), 1) if len(colors) else 0.0
