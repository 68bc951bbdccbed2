"""A bathroom, furnished from a seed: vanity, cupboard and washing machine before the wall y = depth, the bathtub across.

Room frame: inner corner at the origin, x along the vanity, z up, metres. The door is in the wall y = 0 beside the bathtub, the
window at x = width, the toilet at x = 0.
"""

from __future__ import annotations

import numpy as np

from s2a.homes import appliances, household, kitchen_units, objects, sanitary, toiletries
from s2a.homes.fronts import LEFT, RIGHT, bar_pull, cup_pull, knob_pull
from s2a.homes.furniture import room_door, window
from s2a.homes.plumbing import basin, counter, faucet
from s2a.homes.room import EAST, NORTH, SOUTH, WEST, Room, Size, around, size_near, structure
from s2a.homes.sanitary import CERAMIC, VANITY_TOP
from s2a.homes.solids import PLAIN, TILES, WOOD, Color, Piece, at

VANITY = 1.36
"""x of the vanity's middle [m]; it is 1 m wide."""
DOOR = (0.76, 0.88, 2.05)
"""x of the door's middle, width and height of its opening [m]."""
TUB = 0.57
"""Height of the bathtub's rim [m]."""
FINISHES: tuple[tuple[Color, int], ...] = (((150, 114, 82), WOOD), ((232, 230, 226), PLAIN), ((96, 116, 128), PLAIN))


def bathroom(rng: np.random.Generator) -> Room:
    """Return a bathroom with nine pieces of furniture that open and some thirty other objects."""
    size = size_near(rng, (3.42, 2.82, 2.5), (0.06, 0.06, 0.05), (0.06, 0.06, 0.05))
    width, depth, _ = size
    left, right = width - DOOR[0] - DOOR[1] / 2, width - DOOR[0] + DOOR[1] / 2
    holes = {EAST: (depth - 1.9, depth - 1.3, 1.25, 2.05), SOUTH: (left, right, 0.0, DOOR[2])}
    pieces = [
        *_articulated(rng, size),
        *structure(rng, size, holes, (214, 222, 222), ((140, 146, 150), TILES)),
        *_washbasin(rng, size),
        *_bath(rng, size),
        *_toilet_corner(rng, size),
        *_laundry(rng, size),
        *_walls(rng, size),
    ]
    return Room(tuple(pieces), _scanners(rng), size)


def _articulated(rng: np.random.Generator, size: Size) -> list[Piece]:
    """Return what opens."""
    width, depth, _ = size
    color, texture = FINISHES[rng.integers(len(FINISHES))]
    pull = (cup_pull, bar_pull, knob_pull)[rng.integers(3)]
    side = (LEFT, RIGHT)[rng.integers(2)]
    return [
        sanitary.vanity(rng, 1.0, pull, color, texture).moved(at(VANITY, depth, 0, NORTH)),
        sanitary.mirror_cabinet(rng, 0.9, 0.65).moved(at(VANITY, depth, 1.25, NORTH)),
        kitchen_units.tall_unit(rng, (0.33, 0.4, 1.8), side, color).moved(at(2.12, depth, 0, NORTH)),
        appliances.washing_machine(rng).moved(at(width - 0.38, depth - 0.02, 0, NORTH)),
        sanitary.toilet().moved(at(0.005, 1.74, 0, WEST)),
        household.laundry_basket(rng).moved(at(1.43, 0.23, 0, SOUTH)),
        household.lidded_bin(0.12, 0.28, (196, 198, 200)).moved(at(0.5, depth - 0.16, 0, NORTH)),
        room_door(rng, *DOOR[1:]).moved(at(DOOR[0], 0, 0, SOUTH)),
        window(rng, 0.6, 0.8).moved(at(width + 0.02, 1.6, 1.25, EAST)),
    ]


def _washbasin(rng: np.random.Generator, size: Size) -> list[Piece]:
    """Return the vanity's top with a hole, the basin in it, its faucet, and what stands there."""
    bowl, middle = (0.32, 0.46, 0.14), -0.2
    hole = (0.1, 0.1 + bowl[0], middle - bowl[1] / 2, middle + bowl[1] / 2)
    top = counter(
        (-0.5, 0.5), (0.0, 0.5), (VANITY_TOP - 0.03, VANITY_TOP), hole, (84, 84, 88), PLAIN, "bathroom counter"
    )

    def place(out: float, lateral: float, turn: float = 0.0) -> np.ndarray:
        return at(VANITY + lateral, size[1] - out, VANITY_TOP, NORTH + turn)

    return [
        top.moved(at(VANITY, size[1], 0, NORTH)),
        basin(bowl, CERAMIC).moved(place(0.1 + bowl[0] / 2, middle)),
        faucet(0.22, 0.15).moved(place(0.05, middle)),
        household.bottle(rng, 0.18, "soap dispenser").moved(place(0.12, 0.11)),
        toiletries.toothbrush_cup(rng).moved(place(0.1, 0.2, rng.uniform(0, 360))),
        toiletries.tissue_box(rng).moved(place(0.3 + rng.uniform(-0.02, 0.02), 0.36, rng.uniform(-15, 15))),
        objects.plant(rng, 0.22).moved(place(0.14, 0.4)),
    ]


def _bath(rng: np.random.Generator, size: Size) -> list[Piece]:
    """Return the bathtub in its corner, the shower above it, its screen, bottles on its rim, the mat before it."""
    width = size[0]
    return [
        sanitary.bathtub(1.7).moved(at(width - 0.855, 0.002, 0, SOUTH)),
        sanitary.bath_screen(0.8, 1.4).moved(at(width - 0.01, 0.715, TUB, SOUTH)),
        sanitary.shower(1.2).moved(at(width, 0.375, 0.75, EAST)),
        *(
            household.bottle(rng, rng.uniform(0.15, 0.2), "shampoo bottle").moved(at(width - x, 0.04, TUB))
            for x in (0.5, 0.6, 0.72)
        ),
        household.mat(rng, 0.5, 0.8, "bath mat").moved(around(rng, width - 1.1, 1.08, 0, SOUTH, 0.015)),
        toiletries.slippers(rng).moved(around(rng, width - 1.75, 0.98, 0, 70, 0.02)),
        toiletries.stool().moved(at(0.26, 1.12)),
        household.towel_stack(rng, 2).moved(at(0.26, 1.12, 0.42, 90)),
    ]


def _toilet_corner(rng: np.random.Generator, size: Size) -> list[Piece]:
    """Return what is near the toilet."""
    rail = at(0.07, 1.13, 1.25, WEST)
    return [
        toiletries.toilet_paper().moved(at(0, 1.36, 0.72, WEST)),
        toiletries.toilet_brush().moved(around(rng, 0.1, 2.08, 0, 0, 0.02)),
        toiletries.scale().moved(around(rng, 0.21, 2.42, 0, WEST, 0.01)),
        household.towel_rail(0.5).moved(rail),
        household.hanging_towel(rng, 0.36, 0.62).moved(rail),
        objects.picture(rng, 0.4, 0.5).moved(at(0, 1.74, 1.45, WEST)),
    ]


def _laundry(rng: np.random.Generator, size: Size) -> list[Piece]:
    """Return what is on and above the washing machine."""
    x, depth = size[0] - 0.38, size[1]
    hung = at(x, depth, 1.45, NORTH)
    return [
        household.bottle(rng, 0.27, "detergent").moved(around(rng, x - 0.18, depth - 0.3, 0.85, NORTH, 0.02)),
        household.towel_stack(rng, 3).moved(around(rng, x + 0.1, depth - 0.28, 0.85, NORTH, 0.015)),
        kitchen_units.open_shelf(0.6, 0.26, 0.6, 2, (196, 166, 120)).moved(hung),
        household.towel_stack(rng, 2).moved(hung @ at(0.15, -0.115, 0.018)),
        household.bottle(rng, 0.2).moved(hung @ at(0.13, 0.12, 0.018)),
        household.bottle(rng, 0.22).moved(hung @ at(0.13, 0.2, 0.018)),
        objects.carton((0.18, 0.25, 0.16)).moved(hung @ at(0.13, 0.05, 0.3)),
    ]


def _walls(rng: np.random.Generator, size: Size) -> list[Piece]:
    """Return what hangs on walls and ceiling."""
    width, depth, height = size
    rail = at(0.55, depth - 0.07, 1.25, NORTH)
    return [
        objects.heater(0.5).moved(at(width, 1.62, 0, EAST)),
        toiletries.wall_lamp(0.5).moved(at(VANITY, depth, 2.05, NORTH)),
        household.towel_rail(0.2).moved(rail),
        household.hanging_towel(rng, 0.14, 0.35).moved(rail),
        objects.ceiling_lamp().moved(at(width / 2, depth / 2, height)),
    ]


def _scanners(rng: np.random.Generator) -> np.ndarray:
    """Return six scanner positions; the first two see the vanity from left and right, the fourth looks into basin and toilet."""
    places = [
        (0.95, 1.28, 1.35),
        (2.2, 1.4, 1.5),
        (2.75, 1.5, 1.25),
        (1.2, 1.8, 1.7),
        (1.55, 1.0, 1.65),
        (0.85, 0.95, 1.5),
    ]
    return np.array(places) + rng.uniform(-0.05, 0.05, size=(6, 3))
