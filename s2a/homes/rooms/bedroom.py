"""A bedroom, furnished from a seed: where its furniture stands, and where a scanner would be put up.

Room frame: inner corner at the origin, x along the wall with wardrobe and chest of drawers, z up, metres. These stand before the
wall y = depth; the bed's head is at x = 0, a second chest of drawers and the window at x = width, the door is in the wall y = 0.
"""

from __future__ import annotations

import numpy as np

from s2a.homes import cloth, decor, objects, soft_furniture, storage
from s2a.homes.cabinets import Finish
from s2a.homes.furniture import room_door, window
from s2a.homes.handles import STEEL
from s2a.homes.room import EAST, NORTH, SOUTH, WEST, Hole, Room, Size, around, size_near, structure
from s2a.homes.solids import PLAIN, WOOD, Color, Piece, at

BLACK, BRASS = (44, 44, 48), (176, 142, 84)
WOODS: tuple[Color, ...] = ((196, 164, 120), (150, 112, 76), (222, 216, 204))
CLOTHS: tuple[Color, ...] = ((92, 116, 146), (146, 92, 92), (104, 128, 100), (170, 156, 136))


def bedroom(rng: np.random.Generator) -> Room:
    """Return a bedroom with eight pieces of furniture that open and more than thirty other objects."""
    size = size_near(rng, (4.7, 4.35, 2.5), (0.08, 0.08, 0.03), (0.08, 0.08, 0.05))
    _, depth, _ = size
    holes: dict[float, Hole] = {
        EAST: (depth - 2.5, depth - 1.3, 0.95, 2.25),
        SOUTH: (0.36, 1.34, 0.0, 2.1),
    }
    pieces = [
        *_articulated(rng, size),
        *structure(rng, size, holes, (216, 212, 204)),
        *_bed(rng),
        *_on_furniture(rng, size),
        *_walls(rng, size),
        *_floor(rng, size),
    ]
    return Room(tuple(pieces), _scanners(rng, size), size)


BED_Y, WARDROBE_X, DRESSER_X, TALLBOY_Y, BENCH_X = 1.5, 1.72, 3.32, 3.22, 2.64
"""Middles of bed, wardrobe, chests of drawers; front of the bench [m]."""


def _articulated(rng: np.random.Generator, size: Size) -> list[Piece]:
    """Return what opens: wardrobe, chests of drawers, nightstands, bench, door, window."""
    width, depth, _ = size
    wood = WOODS[rng.integers(len(WOODS))]
    plain = Finish((226, 224, 218), (226, 224, 218), PLAIN, BLACK)
    oak = Finish(wood, wood, WOOD, STEEL)
    dark = Finish((112, 84, 62), (122, 92, 66), WOOD, BRASS)
    turn = NORTH + rng.uniform(-1, 1)
    nights = [
        storage.nightstand(rng, drawers, oak).moved(at(0.48, y, 0, rng.uniform(-1, 1)))
        for drawers, y in ((2, BED_Y + 1.13), (1, BED_Y - 1.13))
    ]
    return [
        storage.wardrobe(rng, plain).moved(at(WARDROBE_X, depth - 0.62, 0, turn)),
        storage.chest_of_drawers(rng, 1.2, (0.24, 0.24, 0.2), 2, "bar", oak).moved(at(DRESSER_X, depth - 0.5, 0, turn)),
        storage.chest_of_drawers(rng, 0.6, (0.24, 0.22, 0.22, 0.2, 0.16), 1, "cup", dark).moved(
            at(width - 0.5, TALLBOY_Y, 0, EAST + rng.uniform(-1, 1))
        ),
        *nights,
        storage.storage_bench(rng, 1.2, "edge", dark).moved(at(BENCH_X, BED_Y, 0, rng.uniform(-1, 1))),
        room_door(rng, 0.98, 2.1).moved(at(width - 0.85, 0, 0, SOUTH)),
        window(rng, 1.2, 1.3).moved(at(width + 0.02, 1.9, 0.95, EAST)),
    ]


def _bed(rng: np.random.Generator) -> list[Piece]:
    """Return the bed, its head before the wall x = 0, and what lies on it."""
    color = CLOTHS[rng.integers(len(CLOTHS))]
    top = soft_furniture.BED_TOP
    pillows = [
        cloth.pillow((0.44, 0.68, 0.16), (236, 234, 230)).moved(around(rng, 0.36, BED_Y + side * 0.39, top, 0, 0.01))
        for side in (-1, 1)
    ]
    small = cloth.pillow((0.36, 0.36, 0.13), CLOTHS[rng.integers(len(CLOTHS))])
    return [
        soft_furniture.bed(1.6, 2.0, color).moved(at(0.03, BED_Y)),
        soft_furniture.duvet(rng, 1.6, 2.0, (206, 200, 190)).moved(at(0.03, BED_Y)),
        *pillows,
        small.moved(around(rng, 0.92, BED_Y - 0.35, top + 0.05, 20, 0.02)),
        decor.teddy().moved(around(rng, 0.95, BED_Y + 0.3, top + 0.05, -20, 0.02)),
    ]


def _on_furniture(rng: np.random.Generator, size: Size) -> list[Piece]:
    """Return what stands on nightstands and chests of drawers and lies in the wardrobe's open shelves."""
    width, depth, _ = size
    night, dresser, tallboy = 0.56, 0.8, 1.16
    low, middle, high = storage.WARDROBE_SHELVES
    y = depth - 0.62 + 0.24
    clothes = [
        cloth.clothes(rng, int(rng.integers(3, 6))).moved(around(rng, WARDROBE_X + dx, y, z, NORTH, 0.01))
        for dx, z in ((0.0, low), (0.0, middle))
    ]
    stack = decor.pile(rng, 2)
    return [
        *(objects.table_lamp().moved(at(0.22, BED_Y + dy, night)) for dy in (1.2, -1.2)),
        decor.alarm_clock().moved(around(rng, 0.4, BED_Y + 1.0, night, 15, 0.01)),
        *(book.moved(at(0.34, BED_Y - 1.02, night, 90)) for book in stack),
        *clothes,
        objects.carton((0.32, 0.4, 0.24)).moved(around(rng, WARDROBE_X, y, high, NORTH, 0.01)),
        decor.tv(0.8).moved(at(DRESSER_X - 0.1, depth - 0.3, dresser, NORTH)),
        decor.photo(rng).moved(around(rng, DRESSER_X + 0.45, depth - 0.25, dresser, NORTH - 15, 0.01)),
        decor.candle(0.1).moved(around(rng, DRESSER_X + 0.4, depth - 0.41, dresser, 0, 0.01)),
        decor.vase(rng, 0.3).moved(around(rng, width - 0.24, TALLBOY_Y + 0.12, tallboy, 0, 0.01)),
        decor.speaker(0.14, 0.24).moved(around(rng, width - 0.22, TALLBOY_Y - 0.15, tallboy, EAST, 0.01)),
    ]


def _walls(rng: np.random.Generator, size: Size) -> list[Piece]:
    """Return what hangs on walls and ceiling."""
    width, depth, height = size
    color = CLOTHS[rng.integers(len(CLOTHS))]
    shelf = at(2.15, 0, 1.45, SOUTH)
    row = [book.moved(shelf @ at(0.215, -0.42)) for book in decor.books(rng, 0.45)]
    return [
        objects.picture(rng, 0.6, 0.45).moved(at(0, BED_Y + 0.4, 1.4 + rng.uniform(-0.05, 0.05), WEST)),
        objects.picture(rng, 0.45, 0.6).moved(at(0, BED_Y - 0.4, 1.35 + rng.uniform(-0.05, 0.05), WEST)),
        decor.mirror(0.5, 1.2).moved(at(2.92, 0, 0.6, SOUTH)),
        decor.wall_shelf(0.9).moved(shelf),
        *row,
        objects.plant(rng, 0.26).moved(shelf @ at(0.11, 0.28)),
        *(cloth.curtain(rng, 0.32, 2.34, color).moved(at(width, y, 0.02, EAST)) for y in (1.9 - 0.82, 1.9 + 0.82)),
        cloth.curtain_rod(2.2).moved(at(width, 1.9, 2.38, EAST)),
        objects.heater(1.0).moved(at(width, 1.9, 0, EAST)),
        decor.pendant_lamp(0.25, 0.18).moved(at(width / 2, depth / 2, height)),
    ]


def _floor(rng: np.random.Generator, size: Size) -> list[Piece]:
    """Return what stands and lies on the floor."""
    width, depth, _ = size
    return [
        cloth.rug(1.7, 1.0, CLOTHS[rng.integers(len(CLOTHS))], (206, 200, 188)).moved(
            at(3.4, BED_Y, 0, rng.uniform(-3, 3))
        ),
        decor.slippers(rng).moved(around(rng, 2.62, 0.42, 0, 60)),
        decor.basket(0.2, 0.5).moved(around(rng, 2.05, 0.26, 0, 0)),
        objects.plant(rng, 0.9).moved(around(rng, 0.46, depth - 0.47, 0, 0)),
        objects.trash_can().moved(around(rng, width - 0.2, 0.62, 0, 0)),
        objects.bag(rng).moved(around(rng, width - 0.22, 3.85, 0.01, EAST)),
    ]


def _scanners(rng: np.random.Generator, size: Size) -> np.ndarray:
    """Return six scanner positions; the first two see wardrobe and chest of drawers from the left and from the right."""
    depth = size[1]
    places = [
        (1.0, depth - 1.35, 1.3),
        (3.1, depth - 1.6, 1.45),
        (3.45, 0.5, 1.5),
        (1.25, 0.45, 1.65),
        (2.2, depth - 1.5, 1.25),
        (3.9, 2.4, 1.6),
    ]
    return np.array(places) + rng.uniform(-0.06, 0.06, size=(6, 3))
