"""Made-up furniture, scanned roughly."""

from __future__ import annotations

from functools import cache

import numpy as np

from s2a.scene.geometry.convex import box
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Mesh, Part, Scene


def sheet(x: tuple[float, float], y: tuple[float, float], height: float, step: float = 0.012, seed: int = 0) -> Mesh:
    """Return a rough level surface that looks up, with noise of 1.5 mm."""
    xs, ys = np.arange(x[0], x[1] + step / 2, step), np.arange(y[0], y[1] + step / 2, step)
    a, b = np.meshgrid(xs, ys, indexing="ij")
    z = height + np.random.default_rng(seed).normal(scale=0.0015, size=a.shape)
    index = np.arange(a.size).reshape(a.shape)
    p, q, r, s = (i.ravel() for i in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    return Mesh(
        np.stack([a, b, z], -1).reshape(-1, 3), np.concatenate([np.stack([p, q, r], 1), np.stack([p, r, s], 1)])
    )


def frame(outer: float, inner: float, height: float, seed: int = 1) -> Mesh:
    """Return a rough square frame around the origin, from its inner to its outer half width."""
    bars = [((-outer, outer), (inner, outer)), ((-outer, outer), (-outer, -inner))]
    bars += [((inner, outer), (-inner, inner)), ((-outer, -inner), (-inner, inner))]
    return merge([sheet(x, y, height, seed=seed + i) for i, (x, y) in enumerate(bars)])


def walls(half: float, low: float, high: float) -> Mesh:
    """Return four upright sheets around the origin that look inwards."""
    found = []
    for turn in range(4):
        c, s = np.cos(turn * np.pi / 2), np.sin(turn * np.pi / 2)
        corners = np.array([(half, -half, low), (half, half, low), (half, half, high), (half, -half, high)])
        found.append(Mesh(corners @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]), [(0, 2, 1), (0, 3, 2)]))
    return merge(found)


def sink() -> Mesh:
    """Return a counter at 0.85 m with a sink: a rim 12 mm higher and 30 mm wide, and a basin 0.15 m deep."""
    basin, rim = sheet((-0.2, 0.2), (-0.2, 0.2), 0.70), frame(0.235, 0.2, 0.862)
    return merge([basin, walls(0.2, 0.70, 0.862), rim, frame(0.6, 0.24, 0.85, seed=9)])


def block(x: float, y: float, z: float) -> Mesh:
    """Return a box that stands on z = 0."""
    return box(np.array([0, 0, z / 2]), np.eye(3), np.array([x, y, z]))


def at(mesh: Mesh, *place: float) -> Mesh:
    return Mesh(mesh.vertices + np.array(place), mesh.faces)


@cache
def table() -> Scene:
    """A table of 1.2 x 0.6 m with a crate and a tray without rim on it, in a room."""
    parts = {
        "floor_1": Part("floor", sheet((-2, 3), (-2, 2.6), 0.0, 0.05)),
        "table_2": Part("table", sheet((0, 1.2), (0, 0.6), 0.74)),
        "crate_3": Part("crate", at(block(0.3, 0.3, 0.3), 0.25, 0.3, 0.742)),
    }
    return Scene("room", parts)
