"""A kitchen, furnished from a seed: one fitted row before the wall y = depth, a table before the door's wall.

Room frame: inner corner at the origin, x along the fitted row, z up, metres. The window is at
x = width, the door in the wall y = 0.
Whoever works at the row has 1.2 m of free floor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.homes import appliances, household, kitchen_units, objects
from s2a.homes.fronts import LEFT, RIGHT, Pull, bar_pull, cup_pull, edge_pull, knob_pull
from s2a.homes.furniture import room_door, window
from s2a.homes.kitchen_units import COUNTER, FRONT_TOP
from s2a.homes.plumbing import basin, counter, faucet
from s2a.homes.room import EAST, NORTH, SOUTH, WEST, Room, Size, around, size_near, structure
from s2a.homes.solids import PLAIN, TILES, WOOD, Color, Piece, at

WIDTHS = {"drawers": 0.6, "oven": 0.6, "narrow": 0.4, "sink": 0.8, "dishwasher": 0.6}
"""Base units of the row [m]."""
START = 0.7
"""Where the row begins, right of the refrigerator [m]."""
UPPER = 1.45
"""Lower edge of the wall units [m]."""
FINISHES: tuple[tuple[Color, int], ...] = (((228, 226, 220), PLAIN), ((150, 168, 158), PLAIN), ((196, 162, 118), WOOD))


@dataclass(frozen=True)
class Row:
    """How the fitted row is arranged.

    Attributes:
        middles: x of the middle of each base unit, by name [m].
        pulls: of the wide drawers, the narrow drawers and the dishwasher.
        color: of the fronts.
        texture: texture of the fronts.
        y: of the wall behind it [m].
    """

    middles: dict[str, float]
    pulls: tuple[Pull, Pull, Pull]
    color: Color
    texture: int
    y: float

    def place(self, unit: str, z: float = 0.0, out: float = 0.0, lateral: float = 0.0, turn: float = 0.0) -> np.ndarray:
        """Return a placement at a distance from the wall and to the side of a unit's middle [m], turned by an angle [deg]."""
        return at(self.middles[unit] + lateral, self.y - out, z, NORTH + turn)


def kitchen(rng: np.random.Generator) -> Room:
    """Return a kitchen with a dozen articulated pieces of furniture and appliances and some forty other objects."""
    size = size_near(rng, (4.35, 3.45, 2.6), (0.1, 0.08, 0.05), (0.1, 0.08, 0.05))
    width, depth, _ = size
    row = _row(rng, depth)
    holes = {EAST: (depth - 2.1, depth - 0.9, 0.95, 2.25), SOUTH: (width - 1.34, width - 0.36, 0.0, 2.1)}
    pieces = [
        *_units(rng, row),
        *_openings(rng, size),
        household.bread_bin(rng).moved(row.place("narrow", COUNTER, 0.07)),
        household.lidded_bin(0.15, 0.42, (70, 72, 78)).moved(at(width - 0.19, 2.42, 0, EAST)),
        *structure(rng, size, holes, (230, 224, 206), ((176, 172, 164), TILES)),
        *_counter(row),
        *_on_counter(rng, row),
        *_open_shelves(rng, row, width),
        *_table(rng),
        *_walls(rng, row, size),
    ]
    return Room(tuple(pieces), _scanners(rng, row, size), size)


def _row(rng: np.random.Generator, depth: float) -> Row:
    """Return an arrangement: which drawers stand left of the oven, which pulls are where, which finish."""
    order = ["drawers", "oven", "narrow"] if rng.uniform() < 0.5 else ["narrow", "oven", "drawers"]
    middles, x = {}, START
    for unit in [*order, "sink", "dishwasher"]:
        middles[unit] = x + WIDTHS[unit] / 2
        x += WIDTHS[unit]
    wide, narrow = (bar_pull, cup_pull) if rng.uniform() < 0.5 else (cup_pull, knob_pull)
    color, texture = FINISHES[rng.integers(len(FINISHES))]
    return Row(middles, (wide, narrow, edge_pull if wide is bar_pull else bar_pull), color, texture, depth)


def _units(rng: np.random.Generator, row: Row) -> list[Piece]:
    """Return what is fitted and opens: base units, wall units, appliances."""
    finish = (row.color, row.texture)
    wide, narrow, washer = row.pulls
    return [
        kitchen_units.drawer_unit(rng, WIDTHS["drawers"], (0.38, 0.36, 0.26), wide, *finish).moved(
            row.place("drawers")
        ),
        appliances.oven(rng).moved(row.place("oven")),
        kitchen_units.drawer_unit(rng, WIDTHS["narrow"], (0.3, 0.25, 0.25, 0.2), narrow, *finish).moved(
            row.place("narrow")
        ),
        kitchen_units.door_unit(rng, WIDTHS["sink"], (LEFT, RIGHT), *finish).moved(row.place("sink")),
        appliances.dishwasher(rng, washer, *finish).moved(row.place("dishwasher")),
        appliances.refrigerator(rng, LEFT).moved(at(0.38, row.y - 0.01, 0, NORTH)),
        appliances.microwave(rng).moved(row.place("drawers", COUNTER, 0.03)),
        kitchen_units.wall_unit(rng, 0.6, 0.7, (LEFT,), *finish).moved(row.place("drawers", UPPER)),
        kitchen_units.wall_unit(rng, 0.8, 0.7, (LEFT, RIGHT), *finish).moved(row.place("sink", UPPER)),
        kitchen_units.wall_unit(rng, 0.6, 0.7, (RIGHT,), *finish).moved(row.place("dishwasher", UPPER)),
    ]


def _openings(rng: np.random.Generator, size: Size) -> list[Piece]:
    """Return door and window."""
    return [
        room_door(rng, 0.98, 2.1).moved(at(0.85, 0, 0, SOUTH)),
        window(rng, 1.2, 1.3).moved(at(size[0] + 0.02, 1.5, 0.95, EAST)),
    ]


def _counter(row: Row) -> list[Piece]:
    """Return the worktop with a hole for the sink, the sink in it, its faucet, the hob and the hood."""
    middle, bowl = row.middles["sink"], (0.37, 0.5, 0.18)
    hole = (0.12, 0.12 + bowl[0], middle - bowl[1] / 2, middle + bowl[1] / 2)
    end = START + sum(WIDTHS.values())
    top = counter((START, end), (0.0, 0.61), (FRONT_TOP, COUNTER), hole, (112, 104, 98), PLAIN)
    return [
        top.moved(at(0, row.y, 0, NORTH)),
        basin(bowl).moved(row.place("sink", COUNTER, 0.12 + bowl[0] / 2)),
        faucet(0.3, 0.19).moved(row.place("sink", COUNTER, 0.06)),
        appliances.hob().moved(row.place("oven", COUNTER, 0.31)),
    ]


def _on_counter(rng: np.random.Generator, row: Row) -> list[Piece]:
    """Return what stands on the worktop and on the hob."""
    hot = COUNTER + 0.0075

    def near(unit: str, z: float, out: float, lateral: float) -> np.ndarray:
        slack = rng.uniform(-0.015, 0.015, 2)
        return row.place(unit, z, out + slack[0], lateral + slack[1], rng.uniform(-12, 12))

    return [
        household.pot(0.1, 0.13).moved(near("oven", hot, 0.42, -0.14)),
        household.pan(0.12).moved(near("oven", hot, 0.2, 0.13)),
        household.jar(rng).moved(near("sink", COUNTER, 0.08, 0.35)),
        household.paper_roll(0.05, 0.22, "paper towel").moved(row.place("sink", COUNTER, 0.1, -0.338)),
        household.bottle(rng, 0.2, "soap dispenser").moved(near("sink", COUNTER, 0.06, 0.2)),
        household.dish_rack().moved(row.place("dishwasher", COUNTER, 0.3, -0.09)),
        household.kettle().moved(near("dishwasher", COUNTER, 0.38, 0.2)),
        household.knife_block().moved(near("dishwasher", COUNTER, 0.12, 0.23)),
    ]


def _open_shelves(rng: np.random.Generator, row: Row, width: float) -> list[Piece]:
    """Return a hanging and a standing open shelf, and what is in them."""
    hung = row.place("narrow", UPPER)
    stood = at(width - 0.26, row.y, 0, NORTH)
    tall, boards = 1.85, 5
    levels = [0.018 if i == 0 else i * tall / boards for i in range(boards)]
    return [
        kitchen_units.open_shelf(0.398, 0.3, 0.7, 2, row.color).moved(hung),
        *(household.jar(rng).moved(hung @ at(0.15, y, 0.018)) for y in (-0.11, 0.02, 0.13)),
        household.bowl(0.11, (214, 180, 120)).moved(hung @ at(0.15, 0.0, 0.35)),
        kitchen_units.open_shelf(0.45, 0.3, tall, boards, (196, 166, 120)).moved(stood),
        objects.carton((0.24, 0.3, 0.2)).moved(stood @ at(0.16, 0, levels[0])),
        household.pot(0.11, 0.12).moved(stood @ at(0.15, 0.03, levels[1])),
        household.bottle(rng, 0.28).moved(stood @ at(0.15, -0.13, levels[2])),
        household.bottle(rng, 0.25).moved(stood @ at(0.15, 0.0, levels[2])),
        household.jar(rng).moved(stood @ at(0.16, 0.13, levels[2])),
        household.bowl(0.12, (120, 150, 170)).moved(stood @ at(0.15, -0.05, levels[3])),
        objects.plant(rng, 0.26).moved(stood @ at(0.15, 0, levels[4])),
    ]


def _table(rng: np.random.Generator) -> list[Piece]:
    """Return the table, its chairs and what lies on it."""
    x, y, top = 2.75, 0.62, 0.75
    seats = ((x - 0.75, y, WEST), (x + 0.75, y, EAST), (x, y + 0.52, NORTH))
    fruits = [(0.045, 0.03), (-0.045, 0.03), (0.0, -0.05)]
    return [
        household.table(1.2, 0.8).moved(at(x, y, 0, SOUTH)),
        *(objects.chair().moved(around(rng, *seat[:2], 0, seat[2], 0.02)) for seat in seats),
        household.bowl(0.15, (198, 198, 190)).moved(at(x - 0.05, y, top)),
        *(household.fruit(rng).moved(at(x - 0.05 + dx, y + dy, top + 0.014)) for dx, dy in fruits),
        household.plate(0.13).moved(around(rng, x - 0.42, y, top, 0)),
        household.plate(0.13).moved(around(rng, x + 0.42, y, top, 0)),
        objects.cup(rng).moved(around(rng, x - 0.38, y + 0.24, top, 40)),
        objects.cup(rng).moved(around(rng, x + 0.38, y - 0.24, top, 200)),
        household.cutting_board().moved(around(rng, x + 0.15, y + 0.265, top, NORTH, 0.01)),
    ]


def _walls(rng: np.random.Generator, row: Row, size: Size) -> list[Piece]:
    """Return what hangs on walls and ceiling or stands before them."""
    width, depth, height = size
    return [
        appliances.extractor(height - 1.6).moved(row.place("oven", 1.6)),
        objects.heater(1.0).moved(at(width, 1.5, 0, EAST)),
        objects.picture(rng, 0.5, 0.6).moved(at(0, 1.75 + rng.uniform(-0.1, 0.1), 1.35, WEST)),
        objects.clock().moved(at(2.75 + rng.uniform(-0.2, 0.2), 0, 1.9, SOUTH)),
        objects.carton((0.3, 0.4, 0.26)).moved(around(rng, 0.22, 1.25, 0, WEST, 0.01)),
        household.mat(rng, 0.5, 0.8, "rug").moved(at(row.middles["sink"], depth - 0.98, 0, NORTH + rng.uniform(-4, 4))),
        objects.ceiling_lamp().moved(at(width / 2 - 0.6, depth / 2, height)),
        objects.ceiling_lamp().moved(at(width / 2 + 0.6, depth / 2, height)),
    ]


def _scanners(rng: np.random.Generator, row: Row, size: Size) -> np.ndarray:
    """Return six scanner positions; the first two see the row from left and right, the fifth looks into the sink."""
    front = size[1] - 0.6
    places = [
        (0.95, front - 1.05, 1.3),
        (3.4, front - 1.0, 1.45),
        (2.2, front - 1.2, 1.25),
        (1.4, 0.75, 1.5),
        (row.middles["sink"] + 0.15, front - 0.5, 1.7),
        (1.9, front - 0.8, 1.7),
    ]
    return np.array(places) + rng.uniform(-0.06, 0.06, size=(6, 3))
