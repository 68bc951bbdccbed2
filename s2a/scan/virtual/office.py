"""An office, furnished from a seed: where its furniture stands, and where a scanner would be put up.

Room frame: inner corner at the origin, x along the wall with the main cabinet, z up, metres. The main cabinet stands before the
wall y = depth, with floor free in front of it for a robot; desk and window are at x = width, the door is in the wall y = 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from s2a.scan.virtual import objects
from s2a.scan.virtual.furniture import main_cabinet, pedestal, room_door, wall_cupboard, window
from s2a.scan.virtual.solids import PLAIN, WOOD, Color, Piece, Surface, at, box, join, rotation, translation

NORTH, SOUTH, WEST, EAST = -90.0, 90.0, 0.0, 180.0
"""Yaw [deg] of what stands before the wall y = depth, y = 0, x = 0, x = width and faces the room."""


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


def office(rng: np.random.Generator) -> Room:
    """Return an office with five articulated pieces of furniture and more than forty other objects."""
    width, depth, height = 4.9 + rng.uniform(-0.1, 0.1), 3.7 + rng.uniform(-0.1, 0.1), 3.0 + rng.uniform(-0.05, 0.05)
    size = (width, depth, height)
    pieces = [
        *_articulated(rng, size),
        *_shell(rng, size),
        *_bookshelf(rng, size),
        *_desk(rng, size),
        *_walls(rng, size),
        *_floor(rng, size),
    ]
    return Room(tuple(pieces), _scanners(rng, size), size)


def _around(rng: np.random.Generator, x: float, y: float, z: float, yaw: float, slack: float = 0.03) -> np.ndarray:
    """Return a placement near a place [m] and yaw [deg], as things stand in real rooms."""
    return at(x + rng.uniform(-slack, slack), y + rng.uniform(-slack, slack), z, yaw + rng.uniform(-300, 300) * slack)


def _cabinet_x(width: float) -> float:
    """Return where along its wall the main cabinet stands [m]."""
    return 0.47 * width


def _articulated(rng: np.random.Generator, size: tuple[float, float, float]) -> list[Piece]:
    """Return what opens: door, main cabinet, desk pedestal, wall cupboard, window."""
    width, depth, _ = size
    cabinet = at(_cabinet_x(width) + rng.uniform(-0.05, 0.05), depth - 0.33, 0, NORTH + rng.uniform(-1.5, 1.5))
    return [
        room_door(rng, 0.98, 2.1).moved(at(0.85, 0, 0, SOUTH)),
        main_cabinet(rng).moved(cabinet),
        pedestal(rng).moved(at(width - 0.84, 0.88, 0, EAST + rng.uniform(-2, 2))),
        wall_cupboard(rng).moved(
            at(3.5 + rng.uniform(-0.08, 0.08), depth - 0.322, 1.4 + rng.uniform(-0.05, 0.05), NORTH)
        ),
        window(rng, 1.2, 1.3).moved(at(width + 0.02, 1.5, 0.95, EAST)),
    ]


def _wall(length: float, height: float, hole: tuple[float, float, float, float] | None, color: Color) -> Surface:
    """Return a wall along y, 0.1 m thick, its face at x = 0, with a hole (y from, y to, z from, z to) [m]."""
    if hole is None:
        return box((-0.1, 0), (-0.1, length + 0.1), (-0.1, height + 0.1), color)
    left, right, low, high = hole
    rest = [
        box((-0.1, 0), (-0.1, left), (-0.1, height + 0.1), color),
        box((-0.1, 0), (right, length + 0.1), (-0.1, height + 0.1), color),
        box((-0.1, 0), (left, right), (high, height + 0.1), color),
    ]
    return join(*rest, box((-0.1, 0), (left, right), (-0.1, low), color)) if low > 0 else join(*rest)


def _shell(rng: np.random.Generator, size: tuple[float, float, float]) -> list[Piece]:
    """Return walls, floor and ceiling."""
    width, depth, height = size
    red, green, blue = (np.array((224, 220, 208)) + rng.integers(-8, 9, 3)).tolist()
    paint = (red, green, blue)
    walls = [
        _wall(depth, height, None, paint).moved(at(0, 0, 0, WEST)),
        _wall(width, height, None, paint).moved(at(0, depth, 0, NORTH)),
        _wall(depth, height, (depth - 2.1, depth - 0.9, 0.95, 2.25), paint).moved(at(width, depth, 0, EAST)),
        _wall(width, height, (width - 1.34, width - 0.36, 0.0, 2.1), paint).moved(at(width, 0, 0, SOUTH)),
    ]
    slab = ((-0.1, width + 0.1), (-0.1, depth + 0.1))
    floor = Piece("floor", box(*slab, (-0.1, 0), (164, 134, 100), WOOD))
    ceiling = Piece("ceiling", box(*slab, (height, height + 0.1), (240, 240, 236), PLAIN))
    return [*(Piece("wall", wall) for wall in walls), floor, ceiling]


def _bookshelf(rng: np.random.Generator, size: tuple[float, float, float]) -> list[Piece]:
    """Return a shelf before the wall y = depth with books, a plant and a box in it."""
    height, shelves, wide = 1.85, 5, 0.9
    place = at(0.62, size[1] - 0.31, 0, NORTH + rng.uniform(-1, 1))
    things = [objects.bookshelf(wide, height, shelves)]
    for level in (1, 2, 3):
        y, board = -wide / 2 + 0.03 + rng.uniform(0, 0.1), objects.shelf_height(level, height, shelves)
        for _ in range(rng.integers(4, 7)):
            piece, thick = objects.book(rng)
            lean = rotation((rng.uniform(-0.02, 0.02), 0, 0))
            things.append(piece.moved(at(-0.05 - rng.uniform(0, 0.04), y + thick / 2, board + 0.001) @ lean))
            y += thick + rng.uniform(0.001, 0.006)
    things.append(objects.carton((0.22, 0.3, 0.2)).moved(at(-0.15, 0.2, objects.shelf_height(1, height, shelves))))
    things.append(objects.plant(rng, 0.28).moved(at(-0.15, 0.25, objects.shelf_height(3, height, shelves))))
    return [thing.moved(place) for thing in things]


def _desk(rng: np.random.Generator, size: tuple[float, float, float]) -> list[Piece]:
    """Return the desk before the window, what lies on it, and its chair."""
    edge, top = size[0] - 0.88, 0.74
    stack, y = [], rng.uniform(0.72, 0.78)
    z = top
    for _ in range(3):
        piece, _ = objects.book(rng, standing=False)
        stack.append(piece.moved(at(edge + 0.45, y, z, EAST + rng.uniform(-15, 15))))
        z += float(np.ptp(piece.surface.vertices[:, 2]))
    return [
        objects.desk(1.6).moved(at(edge, 1.4, 0, EAST)),
        objects.monitor().moved(_around(rng, edge + 0.52, 1.45, top, EAST)),
        objects.keyboard().moved(_around(rng, edge + 0.2, 1.45, top, EAST, 0.01)),
        objects.mouse().moved(_around(rng, edge + 0.2, 1.12, top, EAST, 0.01)),
        objects.cup(rng).moved(_around(rng, edge + 0.25, 1.84, top, rng.uniform(0, 360))),
        objects.table_lamp().moved(_around(rng, edge + 0.5, 2.03, top, EAST)),
        objects.paper_stack(rng).moved(_around(rng, edge + 0.2, 0.85, top, EAST)),
        *stack,
        objects.office_chair(rng).moved(_around(rng, edge - 0.42, 1.5, 0, rng.uniform(-25, 25), 0.05)),
        objects.heater(1.0).moved(at(size[0], 1.5, 0, EAST)),
    ]


def _walls(rng: np.random.Generator, size: tuple[float, float, float]) -> list[Piece]:
    """Return what hangs on walls and ceiling."""
    width, depth, height = size
    return [
        objects.picture(rng, 0.7, 0.5).moved(at(_cabinet_x(width), depth, 1.45 + rng.uniform(-0.05, 0.05), NORTH)),
        objects.picture(rng, 0.5, 0.65).moved(at(0, 0.62 * depth + rng.uniform(-0.1, 0.1), 1.3, WEST)),
        objects.whiteboard(1.3, 0.9).moved(at(2.7 + rng.uniform(-0.1, 0.1), 0, 1.0, SOUTH)),
        objects.clock().moved(at(1.75, 0, 2.3, SOUTH)),
        objects.ceiling_lamp().moved(at(width / 2, depth / 2, height)),
        objects.ceiling_lamp().moved(at(width / 2 - 1.2, depth / 2, height)),
    ]


def _floor(rng: np.random.Generator, size: tuple[float, float, float]) -> list[Piece]:
    """Return what stands on the floor and on the main cabinet."""
    width, depth, _ = size
    x, y, top = _cabinet_x(width), depth - 0.33, 0.802
    return [
        objects.carton((0.3, 0.22, 0.18)).moved(_around(rng, x - 0.18, y - 0.02, top, NORTH)),
        objects.plant(rng, 0.4).moved(_around(rng, x + 0.22, y + 0.05, top, NORTH)),
        objects.cup(rng).moved(_around(rng, x + 0.06, y - 0.1, top, rng.uniform(0, 360))),
        objects.carton((0.4, 0.5, 0.35)).moved(_around(rng, 3.5, depth - 0.3, 0, NORTH)),
        objects.carton((0.3, 0.34, 0.24)).moved(_around(rng, 3.5, depth - 0.28, 0.35, NORTH)),
        objects.plant(rng, 1.15).moved(_around(rng, 0.4, 1.75, 0, 0)),
        objects.bag(rng).moved(_around(rng, 0.3, 2.5, 0, WEST)),
        objects.chair().moved(_around(rng, 2.05, 0.36, 0, SOUTH)),
        objects.trash_can().moved(_around(rng, 3.65, 0.26, 0, 0)),
    ]


def _scanners(rng: np.random.Generator, size: tuple[float, float, float]) -> np.ndarray:
    """Return six scanner positions; the first two see the main cabinet's front from the left and from the right."""
    x, front = _cabinet_x(size[0]), size[1] - 0.68
    places = [
        (x - 0.95, front - 0.95, 1.3),
        (x + 0.8, front - 0.85, 1.5),
        (2.95, 0.8, 1.25),
        (0.8, 0.95, 1.5),
        (x + 0.05, 1.35, 1.65),
        (1.55, 1.6, 1.2),
    ]
    return np.array(places) + rng.uniform(-0.06, 0.06, size=(6, 3))
