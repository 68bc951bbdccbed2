"""A living room, furnished from a seed: where its furniture stands, and where a scanner would be put up.

Room frame: inner corner at the origin, x along the wall with sideboard and tall cabinet, z up, metres. These stand before the
wall y = depth; the television is at x = 0 and the sofa faces it; a chest of drawers, a bench and the window are at x = width; the
door is in the wall y = 0.
"""

from __future__ import annotations

import numpy as np

from s2a.homes import cloth, decor, objects, soft_furniture, storage
from s2a.homes.cabinets import Finish
from s2a.homes.furniture import room_door, window
from s2a.homes.handles import STEEL
from s2a.homes.room import EAST, NORTH, SOUTH, Hole, Room, Size, around, size_near, structure
from s2a.homes.solids import PLAIN, WOOD, Color, Piece, at, rotation

BLACK, BRASS = (44, 44, 48), (176, 142, 84)
WOODS: tuple[Color, ...] = ((158, 118, 80), (188, 152, 108), (120, 88, 64))
CLOTHS: tuple[Color, ...] = ((112, 118, 124), (76, 100, 124), (150, 128, 104), (96, 118, 92))
ACCENTS: tuple[Color, ...] = ((204, 156, 60), (176, 84, 64), (70, 120, 130), (222, 212, 192))


def living_room(rng: np.random.Generator) -> Room:
    """Return a living room with eight pieces of furniture that open and more than forty other objects."""
    size = size_near(rng, (5.4, 4.7, 2.5), (0.08, 0.08, 0.03), (0.08, 0.08, 0.05))
    _, depth, _ = size
    holes: dict[float, Hole] = {
        EAST: (depth - WINDOW_Y - 0.6, depth - WINDOW_Y + 0.6, 0.95, 2.25),
        SOUTH: (0.36, 1.34, 0.0, 2.1),
    }
    pieces = [
        *_articulated(rng, size),
        *structure(rng, size, holes, (222, 216, 202)),
        *_seats(rng),
        *_coffee_table(rng),
        *_television(rng),
        *_on_furniture(rng, size),
        *_walls(rng, size),
        *_floor(rng, size),
    ]
    return Room(tuple(pieces), _scanners(rng, size), size)


SIDEBOARD_X, CABINET_X, TV_Y, CHEST_Y, WINDOW_Y, SOFA_X = 1.75, 3.5, 1.95, 1.8, 3.3, 2.62
"""Middles of furniture along its wall; front of the sofa [m]."""


def _articulated(rng: np.random.Generator, size: Size) -> list[Piece]:
    """Return what opens: sideboard, tall cabinet, TV stand, chest of drawers, bench, side table, door, window."""
    width, depth, _ = size
    wood = WOODS[rng.integers(len(WOODS))]
    oak = Finish(wood, wood, WOOD, BLACK)
    white = Finish((228, 226, 220), (228, 226, 220), PLAIN, STEEL)
    green = Finish((84, 104, 96), (84, 104, 96), PLAIN, BRASS)
    yaw = rng.uniform(-1, 1, 5)
    return [
        storage.sideboard(rng, oak).moved(at(SIDEBOARD_X, depth - 0.49, 0, NORTH + yaw[0])),
        storage.tall_cabinet(rng, white).moved(at(CABINET_X, depth - 0.44, 0, NORTH + yaw[1])),
        storage.tv_stand(rng, oak).moved(at(0.5, TV_Y, 0, yaw[2])),
        storage.chest_of_drawers(rng, 0.8, (0.26, 0.24, 0.22), 1, "cup", green).moved(
            at(width - 0.5, CHEST_Y, 0, EAST + yaw[3])
        ),
        storage.storage_bench(rng, 1.1, "bar", white).moved(at(width - 0.57, WINDOW_Y, 0, EAST + yaw[4])),
        storage.nightstand(rng, 1, oak, "side table").moved(at(SOFA_X + 0.08, TV_Y - 1.28, 0, EAST)),
        room_door(rng, 0.98, 2.1).moved(at(width - 0.85, 0, 0, SOUTH)),
        window(rng, 1.2, 1.3).moved(at(width + 0.02, WINDOW_Y, 0.95, EAST)),
    ]


def _seats(rng: np.random.Generator) -> list[Piece]:
    """Return the sofa with pillows and a blanket over its arm, and the armchair."""
    color = CLOTHS[rng.integers(len(CLOTHS))]
    sofa = at(SOFA_X, TV_Y, 0, EAST + rng.uniform(-1, 1))
    leaning = rotation((0, 1.15, 0))
    pillows = [
        cloth.pillow((0.42, 0.42, 0.13), ACCENTS[rng.integers(len(ACCENTS))]).moved(
            sofa @ at(-0.4, y + rng.uniform(-0.03, 0.03), 0.66) @ leaning
        )
        for y in (-0.55, 0.04, 0.56)
    ]
    throw = cloth.drape(rng, 0.5, 0.18, 0.14, ACCENTS[rng.integers(len(ACCENTS))], 0.02)
    chair = soft_furniture.armchair(CLOTHS[rng.integers(len(CLOTHS))])
    return [
        soft_furniture.sofa(2.0, 2, color).moved(sofa),
        *pillows,
        Piece("blanket", throw).moved(sofa @ at(-0.7, -0.91, 0.602)),
        chair.moved(around(rng, 0.98, 1.03, 0, SOUTH, 0.01)),
    ]


def _coffee_table(rng: np.random.Generator) -> list[Piece]:
    """Return the rug, the low table on it and what lies on the table."""
    x, top = 2.03, 0.429
    return [
        cloth.rug(1.9, 1.3, ACCENTS[rng.integers(len(ACCENTS))], (96, 84, 76)).moved(
            at(x - 0.05, TV_Y, 0, rng.uniform(-2, 2))
        ),
        decor.coffee_table(1.0, 0.55).moved(at(x, TV_Y, 0.008, rng.uniform(-2, 2))),
        decor.bowl(rng).moved(around(rng, x, TV_Y, top, 0)),
        decor.remote_control().moved(around(rng, x - 0.05, TV_Y + 0.3, top, 30)),
        objects.cup(rng).moved(around(rng, x + 0.1, TV_Y - 0.25, top, rng.uniform(0, 360), 0.02)),
        *(piece.moved(at(x - 0.04, TV_Y - 0.38, top, 80)) for piece in decor.pile(rng, 2)),
    ]


def _television(rng: np.random.Generator) -> list[Piece]:
    """Return the television, what is connected to it and two loudspeakers on the floor."""
    return [
        decor.tv(1.4).moved(at(0.28, TV_Y, 0.5, rng.uniform(-1, 1))),
        decor.console(rng).moved(around(rng, 0.42, TV_Y - 0.04, 0.3, 0, 0.01)),
        decor.console(rng).moved(around(rng, 0.42, TV_Y + 0.05, 0.118, 0, 0.01)),
        *(decor.speaker(0.22, 0.95).moved(around(rng, 0.4, TV_Y + y, 0, -0.1 * y, 0.01)) for y in (-1.06, 1.06)),
    ]


def _on_furniture(rng: np.random.Generator, size: Size) -> list[Piece]:
    """Return what stands on sideboard, chest, bench and side table and in the tall cabinet's shelves."""
    width, depth, _ = size
    low, middle, high = storage.CABINET_SHELVES
    y = depth - 0.27
    shelves = [
        piece.moved(at(CABINET_X - 0.4, y, z) @ at(0, 0, 0, NORTH))
        for z, long in ((low, 0.5), (middle, 0.75), (high, 0.4))
        for piece in decor.books(rng, long)
    ]
    return [
        *shelves,
        objects.plant(rng, 0.24).moved(at(CABINET_X + 0.28, y + 0.06, low)),
        decor.photo(rng).moved(around(rng, CABINET_X + 0.15, y - 0.02, high, NORTH, 0.01)),
        objects.table_lamp().moved(around(rng, SIDEBOARD_X - 0.6, y, 0.78, 0)),
        decor.vase(rng, 0.34).moved(around(rng, SIDEBOARD_X + 0.55, y, 0.78, 0)),
        decor.photo(rng).moved(around(rng, SIDEBOARD_X - 0.2, y, 0.78, NORTH + 12, 0.02)),
        decor.bowl(rng, fruit=False).moved(around(rng, SIDEBOARD_X + 0.15, y - 0.03, 0.78, 0)),
        decor.candle(0.14).moved(around(rng, width - 0.25, CHEST_Y - 0.25, 0.84, 0)),
        *(piece.moved(at(width - 0.25, CHEST_Y + 0.18, 0.84, 70)) for piece in decor.pile(rng, 3)),
        objects.cup(rng).moved(around(rng, SOFA_X + 0.2, TV_Y - 1.2, 0.56, 40, 0.01)),
        objects.table_lamp().moved(at(SOFA_X + 0.37, TV_Y - 1.33, 0.56)),
    ]


def _walls(rng: np.random.Generator, size: Size) -> list[Piece]:
    """Return what hangs on walls and ceiling."""
    width, depth, height = size
    color = CLOTHS[rng.integers(len(CLOTHS))]
    shelf = at(0.75, 0, 1.5, SOUTH)
    return [
        objects.picture(rng, 0.9, 0.6).moved(at(SIDEBOARD_X, depth, 1.4 + rng.uniform(-0.05, 0.05), NORTH)),
        objects.picture(rng, 0.45, 0.6).moved(at(1.75, 0, 1.35 + rng.uniform(-0.05, 0.05), SOUTH)),
        objects.picture(rng, 0.45, 0.6).moved(at(2.35, 0, 1.35 + rng.uniform(-0.05, 0.05), SOUTH)),
        decor.mirror(0.7, 0.9).moved(at(width, CHEST_Y, 1.15, EAST)),
        objects.clock().moved(at(3.4, 0, 1.9, SOUTH)),
        decor.wall_shelf(0.9).moved(shelf),
        *(book.moved(shelf @ at(0.215, -0.4)) for book in decor.books(rng, 0.4)),
        decor.candle(0.12).moved(shelf @ at(0.11, 0.2)),
        *(cloth.curtain(rng, 0.32, 2.34, color).moved(at(width, WINDOW_Y + y, 0.02, EAST)) for y in (-0.82, 0.82)),
        cloth.curtain_rod(2.1).moved(at(width, WINDOW_Y, 2.38, EAST)),
        objects.heater(0.9).moved(at(3.45, 0, 0, SOUTH)),
        decor.pendant_lamp(0.25, 0.2).moved(at(2.1, TV_Y + 0.3, height)),
    ]


def _floor(rng: np.random.Generator, size: Size) -> list[Piece]:
    """Return what stands on the floor."""
    width, depth, _ = size
    return [
        objects.plant(rng, 1.15).moved(around(rng, 0.47, depth - 0.5, 0, 0)),
        soft_furniture.footstool(ACCENTS[rng.integers(len(ACCENTS))]).moved(around(rng, 4.6, depth - 0.35, 0, 0)),
        decor.floor_lamp().moved(around(rng, 3.55, 0.55, 0, 0)),
        decor.basket(0.15, 0.36).moved(around(rng, 2.79, depth - 0.25, 0, 0, 0.01)),
        objects.bag(rng).moved(around(rng, width - 0.25, 1.1, 0.01, EAST)),
    ]


def _scanners(rng: np.random.Generator, size: Size) -> np.ndarray:
    """Return six scanner positions; the first two see sideboard and tall cabinet from the left and from the right."""
    depth = size[1]
    places = [
        (1.25, depth - 1.45, 1.35),
        (2.75, depth - 1.25, 1.45),
        (4.25, 2.75, 1.5),
        (4.3, 1.05, 1.6),
        (1.2, 1.4, 1.3),
        (2.4, 3.2, 1.65),
    ]
    return np.array(places) + rng.uniform(-0.06, 0.06, size=(6, 3))
