"""What every furnished room has: walls with openings, floor and ceiling, places for a scanner.

Room frame: inner corner at the origin, x along the width, y along the depth, z up, metres.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from s2a.synth.solids import PLAIN, WOOD, Color, Piece, Surface, at, box, join, rotation, translation

NORTH, SOUTH, WEST, EAST = -90.0, 90.0, 0.0, 180.0
"""Yaw [deg] of what stands before the wall y = depth, y = 0, x = 0, x = width and faces the room."""
Hole = tuple[float, float, float, float]
"""Opening of a wall, in the wall's frame: y from, y to, z from, z to [m]."""


@dataclass(frozen=True)
class Room:
    """A furnished room, and from where it is scanned.

    Attributes:
        pieces: objects, the articulated ones first.
        scanners: positions of the scanner, the most important first [m], shape [pose 3].
        size: inner width, depth and height [m].
        yaw: rotation of the room about z against the scene [rad].
    """

    pieces: tuple[Piece, ...]
    scanners: np.ndarray
    size: tuple[float, float, float]
    yaw: float = 0.0

    def turned(self, yaw: float) -> Room:
        """Return the room at a yaw [rad], its smallest inner corner moved to the origin of the scene."""
        width, depth, _ = self.size
        turn = rotation((0.0, 0.0, yaw))
        corners = np.array([(0, 0, 0), (width, 0, 0), (0, depth, 0), (width, depth, 0)]) @ turn[:3, :3].T
        move = translation(-corners.min(axis=0)) @ turn
        scanners = self.scanners @ move[:3, :3].T + move[:3, 3]
        return replace(self, pieces=tuple(p.moved(move) for p in self.pieces), scanners=scanners, yaw=yaw)


def around(rng: np.random.Generator, x: float, y: float, z: float, yaw: float, slack: float = 0.03) -> np.ndarray:
    """Return a placement near a place [m] and yaw [deg], as things stand in real rooms."""
    return at(x + rng.uniform(-slack, slack), y + rng.uniform(-slack, slack), z, yaw + rng.uniform(-300, 300) * slack)


def wall(length: float, height: float, hole: Hole | None, color: Color) -> Surface:
    """Return a wall along y, 0.1 m thick, its face at x = 0, with a hole [m].

    WEST's y is the room's y; NORTH's is its x; EAST's runs from (width, depth) back to the corner; SOUTH's from (width, 0) back.
    """
    if hole is None:
        return box((-0.1, 0), (-0.1, length + 0.1), (-0.1, height + 0.1), color)
    left, right, low, high = hole
    rest = [
        box((-0.1, 0), (-0.1, left), (-0.1, height + 0.1), color),
        box((-0.1, 0), (right, length + 0.1), (-0.1, height + 0.1), color),
        box((-0.1, 0), (left, right), (high, height + 0.1), color),
    ]
    return join(*rest, box((-0.1, 0), (left, right), (-0.1, low), color)) if low > 0 else join(*rest)


def shell(
    rng: np.random.Generator,
    size: tuple[float, float, float],
    holes: Mapping[float, Hole],
    paint: Color = (224, 220, 208),
    ground: tuple[Color, int] = ((164, 134, 100), WOOD),
) -> list[Piece]:
    """Return walls, floor and ceiling of a room.

    Args:
        rng: varies the paint a little.
        size: inner width, depth and height [m].
        holes: the opening of a wall, by the wall's yaw (NORTH, SOUTH, WEST, EAST); see `wall`.
        paint: of the walls.
        ground: colour and texture of the floor.
    """
    width, depth, height = size
    red, green, blue = (np.array(paint) + rng.integers(-8, 9, 3)).tolist()
    color = (red, green, blue)
    walls = [
        wall(depth, height, holes.get(WEST), color).moved(at(0, 0, 0, WEST)),
        wall(width, height, holes.get(NORTH), color).moved(at(0, depth, 0, NORTH)),
        wall(depth, height, holes.get(EAST), color).moved(at(width, depth, 0, EAST)),
        wall(width, height, holes.get(SOUTH), color).moved(at(width, 0, 0, SOUTH)),
    ]
    slab = ((-0.1, width + 0.1), (-0.1, depth + 0.1))
    floor = Piece("floor", box(*slab, (-0.1, 0), *ground))
    ceiling = Piece("ceiling", box(*slab, (height, height + 0.1), (240, 240, 236), PLAIN))
    return [*(Piece("wall", surface) for surface in walls), floor, ceiling]
