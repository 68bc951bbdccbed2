"""A furnished room: walls with openings, floor and ceiling, places for a scanner.

Room frame: inner corner at the origin, x along the width, y along the depth, z up, metres.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from s2a.homes.solids import PLAIN, WOOD, Color, Piece, Surface, at, box, join, rotation, translation

NORTH, SOUTH, WEST, EAST = -90.0, 90.0, 0.0, 180.0
"""Yaw [deg] of what stands before the wall y = depth, y = 0, x = 0, x = width and faces the room."""
Size = tuple[float, float, float]
"""Inner width, depth and height of a room [m]."""
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
    size: Size
    yaw: float = 0.0

    def turned(self, yaw: float) -> Room:
        """Return the room at a yaw [rad], its smallest inner corner moved to the origin of the scene."""
        width, depth, _ = self.size
        turn = rotation((0.0, 0.0, yaw))
        corners = np.array([(0, 0, 0), (width, 0, 0), (0, depth, 0), (width, depth, 0)]) @ turn[:3, :3].T
        move = translation(-corners.min(axis=0)) @ turn
        scanners = self.scanners @ move[:3, :3].T + move[:3, 3]
        return replace(self, pieces=tuple(p.moved(move) for p in self.pieces), scanners=scanners, yaw=yaw)


def size_near(rng: np.random.Generator, mean: Size, below: Size, above: Size) -> Size:
    """Return the size of a room, at most so far below and above a mean [m]."""
    width, depth, height = (m + rng.uniform(-b, a) for m, b, a in zip(mean, below, above, strict=True))
    return width, depth, height


def around(rng: np.random.Generator, x: float, y: float, z: float, yaw: float, slack: float = 0.03) -> np.ndarray:
    """Return a placement near a place [m] and yaw [deg], as things stand in real rooms."""
    return at(x + rng.uniform(-slack, slack), y + rng.uniform(-slack, slack), z, yaw + rng.uniform(-300, 300) * slack)


def wall(
    length: float, height: float, holes: tuple[Hole, ...], color: Color, ends: tuple[float, float] = (0.1, 0.1)
) -> Surface:
    """Return a wall along y, 0.1 m thick, its face at x = 0, with holes beside each other [m].

    WEST's y is the room's y; NORTH's is its x; EAST's runs from (width, depth) back to the corner; SOUTH's from (width, 0) back.

    Args:
        length: along y, without its ends.
        height: up to the ceiling.
        holes: in the order of their y.
        color: of its paint.
        ends: how far it goes on beyond y = 0 and y = length, into the corners of the room.
    """
    slab, top = (-0.1, 0.0), height + 0.1
    edges = [-ends[0], *(y for hole in holes for y in hole[:2]), length + ends[1]]
    rest = [box(slab, y, (-0.1, top), color) for y in zip(edges[::2], edges[1::2], strict=True)]
    rest += [box(slab, (left, right), (high, top), color) for left, right, _, high in holes]
    return join(*rest, *(box(slab, (left, right), (-0.1, low), color) for left, right, low, _ in holes if low > 0))


def structure(
    rng: np.random.Generator,
    size: Size,
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
        wall(depth, height, _holes(holes, WEST), color).moved(at(0, 0, 0, WEST)),
        wall(width, height, _holes(holes, NORTH), color).moved(at(0, depth, 0, NORTH)),
        wall(depth, height, _holes(holes, EAST), color).moved(at(width, depth, 0, EAST)),
        wall(width, height, _holes(holes, SOUTH), color).moved(at(width, 0, 0, SOUTH)),
    ]
    slab = ((-0.1, width + 0.1), (-0.1, depth + 0.1))
    floor = Piece("floor", box(*slab, (-0.1, 0), *ground))
    ceiling = Piece("ceiling", box(*slab, (height, height + 0.1), (240, 240, 236), PLAIN))
    return [*(Piece("wall", surface) for surface in walls), floor, ceiling]


def _holes(holes: Mapping[float, Hole], yaw: float) -> tuple[Hole, ...]:
    """Return the opening of a wall, if it has one."""
    return (holes[yaw],) if yaw in holes else ()
