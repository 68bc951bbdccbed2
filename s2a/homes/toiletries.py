"""Small things of bathrooms. Local frames: standing on z = 0, front towards +x, metres."""

from __future__ import annotations

import numpy as np

from s2a.homes.handles import QUARTER
from s2a.homes.household import BLACK, BRIGHT, WHITE
from s2a.homes.plumbing import CHROME, pipe
from s2a.homes.solids import FABRIC, WOOD, Piece, at, box, cylinder, ellipsoid, join, lathe, rotation


def toilet_paper() -> Piece:
    """Return a roll of toilet paper on a holder; the wall is at x = 0, the roll's axis at z = 0."""
    sheet = box((0.121, 0.124), (-0.05, 0.05), (-0.12, 0.0), WHITE)
    roll = cylinder(0.055, 0.1, WHITE, FABRIC).moved(at(0.07, -0.05) @ rotation((-QUARTER, 0, 0)))
    rod = pipe([(0.0, -0.08, 0.02), (0.07, -0.08, 0.02), (0.07, -0.08, 0), (0.07, 0.06, 0)], 0.007)
    return Piece("toilet paper", join(roll, rod, sheet))


def toilet_brush() -> Piece:
    """Return a toilet brush in its stand."""
    stand = lathe([(0, 0), (0.05, 0), (0.05, 0.13), (0.044, 0.13), (0.044, 0.006), (0, 0.006)], WHITE)
    return Piece("toilet brush", join(stand, cylinder(0.009, 0.38, CHROME), cylinder(0.036, 0.1, WHITE)))


def scale() -> Piece:
    """Return a bathroom scale with its display."""
    plate = box((-0.15, 0.15), (-0.15, 0.15), (0.008, 0.03), BLACK)
    feet = [cylinder(0.02, 0.008, WHITE).moved(at(x, y)) for x in (-0.11, 0.11) for y in (-0.11, 0.11)]
    return Piece("bathroom scale", join(plate, *feet, box((0.08, 0.13), (-0.04, 0.04), (0.03, 0.032), (130, 150, 140))))


def slippers(rng: np.random.Generator) -> Piece:
    """Return a pair of slippers with their toes towards +x."""
    color, shapes = BRIGHT[rng.integers(len(BRIGHT))], []
    for y in (-0.06, 0.06):
        sole = box((-0.13, 0.13), (-0.045, 0.045), (0, 0.02), BLACK)
        toe = ellipsoid((0.16, 0.088, 0.07), color, FABRIC).moved(at(0.05, 0, 0.036))
        shapes.append(join(sole, toe).moved(at(0, y, 0, rng.uniform(-4, 4))))
    return Piece("slippers", join(*shapes))


def stool() -> Piece:
    """Return a round wooden stool, 0.42 m high."""
    legs = [
        pipe([(x, y, 0), (0.7 * x, 0.7 * y, 0.4)], 0.014, (196, 160, 112)) for x in (-0.1, 0.1) for y in (-0.1, 0.1)
    ]
    seat = cylinder(0.15, 0.03, (196, 160, 112), WOOD).moved(at(0, 0, 0.39))
    return Piece("stool", join(*legs, seat))


def toothbrush_cup(rng: np.random.Generator) -> Piece:
    """Return a beaker with two toothbrushes."""
    beaker = lathe([(0, 0), (0.034, 0), (0.038, 0.1), (0.034, 0.1), (0.03, 0.006), (0, 0.006)], (206, 222, 224))
    brushes = []
    for tilt in (0.25, -0.2):
        color = BRIGHT[rng.integers(len(BRIGHT))]
        stick = box((-0.004, 0.004), (-0.005, 0.005), (0, 0.19), color)
        head = box((0.004, 0.014), (-0.006, 0.006), (0.16, 0.19), WHITE)
        brushes.append(join(stick, head).moved(at(-0.1 * tilt, 0, 0.012) @ rotation((0, tilt, 0))))
    return Piece("cup", join(beaker, *brushes))


def tissue_box(rng: np.random.Generator) -> Piece:
    """Return a box of tissues with one drawn out."""
    carton = box((-0.06, 0.06), (-0.115, 0.115), (0, 0.08), BRIGHT[rng.integers(len(BRIGHT))])
    tissue = lathe([(0.045, 0.08), (0.01, 0.13), (0, 0.08)], WHITE, FABRIC, sides=7, squeeze=1.5)
    return Piece("tissue box", join(carton, tissue))


def wall_lamp(width: float) -> Piece:
    """Return a lamp, long along y, on a plate at the wall x = 0."""
    tube = cylinder(0.03, width, (250, 248, 238)).moved(at(0.08, -width / 2) @ rotation((-QUARTER, 0, 0)))
    return Piece(
        "wall lamp",
        join(
            box((0, 0.02), (-0.06, 0.06), (-0.03, 0.03), CHROME),
            tube,
            box((0.02, 0.06), (-0.02, 0.02), (-0.01, 0.01), CHROME),
        ),
    )
