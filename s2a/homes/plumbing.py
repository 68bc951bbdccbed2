"""Pipes, faucets and basins of kitchens and bathrooms. Local frames: standing on z = 0, front towards +x, metres."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from s2a.homes.fronts import open_box
from s2a.homes.grips import STEEL
from s2a.homes.solids import Color, Piece, Surface, at, box, cylinder, ellipsoid, join, rotation, translation

Point = tuple[float, float, float]
CHROME: Color = (186, 188, 192)


def pipe(points: list[Point], radius: float, color: Color = CHROME, sides: int = 12) -> Surface:
    """Return a round pipe along a line of points [m], with a ball at every bend."""
    solids = []
    for start, end in pairwise(points):
        along = np.subtract(end, start)
        length = float(np.linalg.norm(along))
        solids.append(cylinder(radius, length, color, sides=sides).moved(translation(start) @ _towards(along / length)))
    for x, y, z in points[1:-1]:
        solids.append(ellipsoid((2 * radius,) * 3, color, sides=sides).moved(at(x, y, z)))
    return join(*solids)


def _towards(direction: np.ndarray) -> np.ndarray:
    """Return a rotation that takes z to a unit direction, shape [4 4]."""
    across = np.cross((0.0, 0.0, 1.0), direction)
    sine = float(np.linalg.norm(across))
    if sine < 1e-9:
        return rotation((np.pi if direction[2] < 0 else 0.0, 0.0, 0.0))
    return rotation(across / sine * np.arctan2(sine, direction[2]))


def faucet(height: float, reach: float, name: str = "faucet") -> Piece:
    """Return a mixer tap on a base: a pipe that rises to a height, bends over and reaches forward [m], and its lever."""
    arch = [
        (reach / 2 - reach / 2 * float(np.cos(a)), 0.0, height - reach / 2 + reach / 2 * float(np.sin(a)))
        for a in np.linspace(0, np.pi, 7)
    ]
    spout = pipe([(0, 0, 0.03), *arch, (reach, 0, height - reach / 2 - 0.03)], 0.012)
    lever = pipe([(0, -0.02, 0.07), (0, -0.05, 0.075), (0.01, -0.115, 0.1)], 0.008)
    return Piece(name, join(cylinder(0.026, 0.09, CHROME), spout, lever))


def basin(size: tuple[float, float, float], color: Color = STEEL, rim: float = 0.02, lip: float = 0.004) -> Piece:
    """Return a sink to be let into a hole of its outer width: an open bowl whose rim lies on the counter at z = 0.

    Args:
        size: outer extents of the bowl along x, y and down [m].
        color: of everything.
        rim: how far the rim lies over the counter's edge [m].
        lip: how far it rises above the counter [m].
    """
    deep, wide, down = size
    x, y, wall = deep / 2, wide / 2, 0.006
    bowl = open_box((deep, wide, down + lip), wall, color).moved(at(0, 0, -down))
    frame = [
        box((-x - rim, x + rim), (-y - rim, -y), (0, lip), color),
        box((-x - rim, x + rim), (y, y + rim), (0, lip), color),
        box((-x - rim, -x), (-y, y), (0, lip), color),
        box((x, x + rim), (-y, y), (0, lip), color),
    ]
    drain = cylinder(0.032, 0.004, (90, 92, 96)).moved(at(0, 0, wall - down))
    return Piece("sink", join(bowl, *frame, drain))


def counter(
    y: tuple[float, float],
    x: tuple[float, float],
    z: tuple[float, float],
    hole: tuple[float, float, float, float],
    color: Color,
    texture: int,
    name: str = "kitchen counter",
) -> Piece:
    """Return a worktop along y as four boards around a hole (x from, x to, y from, y to) [m]: nothing closes the hole."""
    near, far, left, right = hole
    boards = [
        box(x, (y[0], left), z, color, texture),
        box(x, (right, y[1]), z, color, texture),
        box((x[0], near), (left, right), z, color, texture),
        box((far, x[1]), (left, right), z, color, texture),
    ]
    return Piece(name, join(*boards))
