"""Room doors and windows that fill an opening of a wall; the wall's face is at x = 0, the opening is centred in y, metres.

Ranges: leaves 0.58 to 1.11 m wide and 1.97 to 2.11 m high (DIN 18101 by baunetzwissen.de), 40 mm thick (groneck.net); levers
1.05 m above the floor (DIN 18255 by hewi.com; montario.de on older doors that deviate), longer than 75 mm (baunetzwissen.de),
55 to 65 mm from the leaf's edge (kleverkey.com). Common sizes: levers 0.036 to 0.05 m before the leaf, windows, sliding
doors.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from s2a.homes import fronts, grips
from s2a.homes.draw import chance, pick, uniform
from s2a.homes.fronts import BOTTOM, LEFT, RIGHT, hinged
from s2a.homes.grips import QUARTER, upright
from s2a.homes.solids import WOOD, Color, Piece, Surface, at, box, cylinder, join, prism, rotation, stadium
from s2a.scene.scene import Joint

GLASS: Color = (120, 150, 165)


def lever(rng: np.random.Generator, side: int, color: Color) -> Piece:
    """Return a lever on a plate or a rose that points along y to a side (+1 or -1)."""
    length, thick, gap = uniform(rng, (0.1, 0.15)), uniform(rng, (0.012, 0.02)), uniform(rng, (0.036, 0.05))
    turn = rotation((0, QUARTER, 0))
    half, low = uniform(rng, (0.019, 0.026)), uniform(rng, (0.08, 0.16))
    plate = box((0, 0.008), (-half, half), (-low, 0.06), color)
    shield = cylinder(0.026, 0.01, color).moved(turn) if chance(rng, 0.5) else plate
    neck = cylinder(0.009, gap + thick / 2, color).moved(turn)
    wide = uniform(rng, (0.016, 0.026))
    rod = prism(stadium(length, wide), (gap, gap + thick), color).moved(at(0, side * (length / 2 - wide / 2)))
    facts = {"family": "lever", "length": length, "width": wide, "depth": thick, "clearance": gap}
    return Piece("handle base", shield, (Piece("handle", join(neck, rod), style="lever", facts=facts),))


def room_door(rng: np.random.Generator, width: float, height: float, colors: tuple[Color, Color, Color]) -> Piece:
    """Return a door in its frame that opens into the room; colours of the frame, the leaf and the metal."""
    paint, wood, metal = colors
    half, jamb = width / 2, uniform(rng, (0.05, 0.07))
    frame = [box((-0.1, 0.014), (y, y + jamb), (0, height), paint) for y in (-half, half - jamb)]
    head = box((-0.1, 0.014), (-half + jamb, half - jamb), (height - jamb, height), paint)
    size = (uniform(rng, (0.036, 0.044)), width - 2 * jamb - 0.01, height - jamb - 0.013)
    side = pick(rng, (LEFT, RIGHT))
    at_hand = uniform(rng, (0.95, 1.08)) - size[2] / 2
    grip = lever(rng, side[0], metal).moved(at(0, -side[0] * (size[1] / 2 - uniform(rng, (0.055, 0.08))), at_hand))
    panel = pick(rng, ("slab", "slab", "framed", "grooved", "glazed"))
    shape = fronts.front(panel, size, wood, WOOD, uniform(rng, (0.1, 0.15)))
    leaf = hinged("door", shape, side, grip, angle=uniform(rng, (1.3, 1.6)))
    # The leaf stands 4 mm before the wall's face: its edges pass the jambs.
    return Piece("door frame", join(*frame, head), (leaf.tilted(rng, 0.1).moved(at(0.02, 0, 0.008 + size[2] / 2)),))


def sliding_door(rng: np.random.Generator, width: float, height: float, colors: tuple[Color, Color, Color]) -> Piece:
    """Return a door that hangs before the wall from a rail and slides to one side of its opening."""
    paint, wood, metal = colors
    side = pick(rng, (-1, 1))
    wide, high = width + 0.06, height - 0.01
    rail = box(
        (0.0, 0.05), sorted_pair(-side * wide / 2, side * (1.5 * wide + 0.03)), (height + 0.01, height + 0.05), metal
    )
    shape = fronts.front(pick(rng, ("slab", "framed", "grooved")), (0.036, wide, high), wood, WOOD, 0.12)
    grip = grips.design(rng, "bar", "rail", "square", "bow", color=metal)
    grip = replace(grip, length=uniform(rng, (0.16, 0.5)))
    pull = upright(grips.make(grip)).moved(at(0, -side * (wide / 2 - 0.06), 1.02 - high / 2))
    joint = Joint(
        "prismatic", (0.0, float(side), 0.0), (0.0, 0.0, 0.0), (0.0, round(uniform(rng, (0.8, 0.98)) * width, 4))
    )
    leaf = Piece("sliding door", shape, (pull,), joint)
    return Piece("door frame", rail, (leaf.moved(at(0.048, 0, 0.006 + high / 2)),))


def sorted_pair(a: float, b: float) -> tuple[float, float]:
    """Return two numbers in ascending order."""
    return (a, b) if a < b else (b, a)


def window(rng: np.random.Generator, width: float, height: float, paint: Color, metal: Color) -> Piece:
    """Return a window of one or two sashes that turn into the room, or of one that tilts; its sill is at z = 0."""
    outer = ring(width, height, 0.05, (-0.08, 0.0), paint)
    inside = width - 0.07
    tilts = inside < 0.95 and chance(rng, 0.3)
    if inside > 1.0 and chance(rng, 0.6):
        halves = ((-inside / 4 - 0.001, LEFT), (inside / 4 + 0.001, RIGHT))
        sashes = [_sash(rng, inside / 2 - 0.006, height, side, paint, metal).moved(at(0, y)) for y, side in halves]
    else:
        side = BOTTOM if tilts else pick(rng, (LEFT, RIGHT))
        sashes = [_sash(rng, inside, height, side, paint, metal)]
    return Piece("window frame", outer, tuple(sashes))


def _sash(
    rng: np.random.Generator, wide: float, height: float, side: tuple[int, int], paint: Color, metal: Color
) -> Piece:
    """Return a glazed sash with its lever."""
    high, rail = height - 0.07, uniform(rng, (0.055, 0.075))
    frame = ring(wide, high, rail, (-0.045, 0.0), paint).moved(at(0, 0, -high / 2))
    pane = box(
        (-0.036, -0.026), (-wide / 2 + rail, wide / 2 - rail), (-high / 2 + rail, high / 2 - rail), GLASS, dropout=0.8
    )
    if side is BOTTOM:
        grip, limit = lever(rng, 1, metal).moved(at(0, 0, high / 2 - 0.04)), uniform(rng, (0.15, 0.3))
    else:
        grip = upright(lever(rng, -1, metal)).moved(at(0, -side[0] * (wide / 2 - rail / 2), 0))
        limit = uniform(rng, (1.2, 1.57))
    grip = replace(grip, surface=box((0, 0.006), (-0.015, 0.015), (-0.035, 0.035), metal).moved(grip.pose))
    leaf = hinged("window", join(frame, pane), side, grip, angle=limit)
    return leaf.moved(at(0.022, 0, height / 2))


def ring(width: float, height: float, bar: float, x: tuple[float, float], color: Color) -> Surface:
    """Return four boards about a rectangle whose lower edge is at z = 0, centred in y."""
    half = width / 2
    uprights = [box(x, (y, y + bar), (0, height), color) for y in (-half, half - bar)]
    levels = [box(x, (-half + bar, half - bar), (z, z + bar), color) for z in (0, height - bar)]
    return join(*uprights, *levels)
