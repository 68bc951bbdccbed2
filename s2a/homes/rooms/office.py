"""An office, furnished from a seed: where its furniture stands, and where a scanner would be put up.

Room frame: inner corner at the origin, x along the wall with the main cabinet, z up, metres. The main cabinet stands before the
wall y = depth, with floor free in front of it for a robot; desk and window are at x = width, the door is in the wall y = 0.
"""

from __future__ import annotations

import numpy as np

from s2a.homes import objects
from s2a.homes.furniture import main_cabinet, pedestal, room_door, wall_cupboard, window
from s2a.homes.room import EAST, NORTH, SOUTH, WEST, Hole, Room, Size, around, size_near, structure
from s2a.homes.solids import Piece, at, rotation


def office(rng: np.random.Generator) -> Room:
    """Return an office with five articulated pieces of furniture and more than forty other objects."""
    size = size_near(rng, (4.9, 3.7, 3.0), (0.1, 0.1, 0.05), (0.1, 0.1, 0.05))
    pieces = [
        *_articulated(rng, size),
        *structure(rng, size, _holes(size)),
        *_bookshelf(rng, size),
        *_desk(rng, size),
        *_walls(rng, size),
        *_floor(rng, size),
    ]
    return Room(tuple(pieces), _scanners(rng, size), size)


def _holes(size: Size) -> dict[float, Hole]:
    """Return the walls' openings: the window to the east, the door to the south."""
    width, depth, _ = size
    return {EAST: (depth - 2.1, depth - 0.9, 0.95, 2.25), SOUTH: (width - 1.34, width - 0.36, 0.0, 2.1)}


def _cabinet_x(width: float) -> float:
    """Return where along its wall the main cabinet stands [m]."""
    return 0.47 * width


def _articulated(rng: np.random.Generator, size: Size) -> list[Piece]:
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


def _bookshelf(rng: np.random.Generator, size: Size) -> list[Piece]:
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


def _desk(rng: np.random.Generator, size: Size) -> list[Piece]:
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
        objects.monitor().moved(around(rng, edge + 0.52, 1.45, top, EAST)),
        objects.keyboard().moved(around(rng, edge + 0.2, 1.45, top, EAST, 0.01)),
        objects.mouse().moved(around(rng, edge + 0.2, 1.12, top, EAST, 0.01)),
        objects.cup(rng).moved(around(rng, edge + 0.25, 1.84, top, rng.uniform(0, 360))),
        objects.table_lamp().moved(around(rng, edge + 0.5, 2.03, top, EAST)),
        objects.paper_stack(rng).moved(around(rng, edge + 0.2, 0.85, top, EAST)),
        *stack,
        objects.office_chair(rng).moved(around(rng, edge - 0.42, 1.5, 0, rng.uniform(-25, 25), 0.05)),
        objects.heater(1.0).moved(at(size[0], 1.5, 0, EAST)),
    ]


def _walls(rng: np.random.Generator, size: Size) -> list[Piece]:
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


def _floor(rng: np.random.Generator, size: Size) -> list[Piece]:
    """Return what stands on the floor and on the main cabinet."""
    width, depth, _ = size
    x, y, top = _cabinet_x(width), depth - 0.33, 0.802
    return [
        objects.carton((0.3, 0.22, 0.18)).moved(around(rng, x - 0.18, y - 0.02, top, NORTH)),
        objects.plant(rng, 0.4).moved(around(rng, x + 0.22, y + 0.05, top, NORTH)),
        objects.cup(rng).moved(around(rng, x + 0.06, y - 0.1, top, rng.uniform(0, 360))),
        objects.carton((0.4, 0.5, 0.35)).moved(around(rng, 3.5, depth - 0.3, 0, NORTH)),
        objects.carton((0.3, 0.34, 0.24)).moved(around(rng, 3.5, depth - 0.28, 0.35, NORTH)),
        objects.plant(rng, 1.15).moved(around(rng, 0.4, 1.75, 0, 0)),
        objects.bag(rng).moved(around(rng, 0.3, 2.5, 0, WEST)),
        objects.chair().moved(around(rng, 2.05, 0.36, 0, SOUTH)),
        objects.trash_can().moved(around(rng, 3.65, 0.26, 0, 0)),
    ]


def _scanners(rng: np.random.Generator, size: Size) -> np.ndarray:
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
