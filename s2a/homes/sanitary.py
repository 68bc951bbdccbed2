"""Furniture and fixtures of bathrooms and laundries.

Ranges: vanity units 0.61 to 1.52 m wide, 0.79 to 0.9 m high, 0.43 to 0.61 m deep (thelovelypoppy.com); washing machines 0.595
to 0.6 m wide, 0.84 to 0.85 m high, 0.4 to 0.7 m deep (inthewash.co.uk, washgeek.com). Common sizes: mirror cabinets, tall
cupboards, portholes of 0.26 to 0.31 m hinged at the left, toilets, bathtubs.
"""

from dataclasses import replace

import numpy as np

from s2a.homes import fronts, grips
from s2a.homes import solids as p
from s2a.homes.casework import Cell, Column, Footing, cabinet
from s2a.homes.fronts import DRAWER, LEFT, OPEN, RIGHT, Opening, Style, cabinet_body, hinged, lid
from s2a.homes.grips import QUARTER, cup, edge
from s2a.homes.household import CHROME, basin, counter, faucet
from s2a.homes.kitchen import STEEL, WHITE
from s2a.scene.scene import Joint

CERAMIC: p.Color = (240, 240, 238)


def toilet() -> p.Piece:
    """Return a close-coupled toilet, 0.68 m deep, seat at 0.42 m: pan, seat, cistern with a button, and a lid that turns up."""
    squeeze, middle, half = 0.75, 0.43, 0.24
    outside = [(0.11, 0), (0.13, 0.02), (0.14, 0.16), (half - 0.01, 0.34), (half - 0.01, 0.4)]
    inside = [(half - 0.06, 0.4), (half - 0.08, 0.3), (0.06, 0.17), (0, 0.16)]
    pan = p.lathe([(0, 0), *outside, *inside], CERAMIC, squeeze=squeeze)
    ring = [(half - 0.06, 0.402), (half, 0.402), (half, 0.42), (half - 0.06, 0.42), (half - 0.06, 0.402)]
    body = [
        pan.moved(p.at(middle, 0)),
        p.box((0.0, 0.3), (-0.1, 0.1), (0, 0.38), CERAMIC),
        p.box((0.0, 0.165), (-0.19, 0.19), (0.38, 0.78), CERAMIC),
        p.box((0.0, 0.172), (-0.195, 0.195), (0.78, 0.8), CERAMIC),
        p.cylinder(0.025, 0.006, CHROME).moved(p.at(0.085, 0, 0.8)),
    ]
    seat = p.Piece("toilet seat", p.lathe(ring, (250, 250, 248), squeeze=squeeze).moved(p.at(middle, 0)))
    disc = p.lathe([(0, -0.018), (half, -0.018), (half, -0.006), (half - 0.015, 0), (0, 0)], CERAMIC, squeeze=squeeze)
    return p.Piece("toilet", p.join(*body), (seat, lid("toilet lid", disc).moved(p.at(middle, 0, 0.44))))


def bathtub(length: float, width: float = 0.75) -> p.Piece:
    """Return a bathtub along y in its panelled surround, 0.57 m high: an open tub with sloping ends."""
    high, rim, y = 0.57, 0.07, length / 2
    front = p.box((width - 0.02, width), (-y, y), (0, high - 0.03), CERAMIC)
    ends = [p.box((0, width), (s, s + 0.02), (0, high - 0.03), CERAMIC) for s in (-y, y - 0.02)]
    return p.Piece("bathtub", p.join(front, *ends, _tub((width, length), rim, high)))


def _tub(size: tuple[float, float], rim: float, high: float) -> p.Surface:
    """Return rim, sloping walls and floor of a tub as one closed sheet, 30 mm thick at the rim."""
    width, length = size

    def ring(inset: float, end: float, z: float) -> list[tuple[float, float, float]]:
        x, y = (inset, width - inset), length / 2 - end
        return [(x[0], -y, z), (x[1], -y, z), (x[1], y, z), (x[0], y, z)]

    rings = [
        ring(0, 0, high - 0.03),
        ring(0, 0, high),
        ring(rim, rim, high),
        ring(rim + 0.06, rim + 0.16, 0.15),
        ring(rim + 0.05, rim + 0.15, 0.12),
        ring(rim - 0.02, rim - 0.02, high - 0.03),
    ]
    faces = [(12, 13, 14), (12, 14, 15), (16, 18, 17), (16, 19, 18)]  # its floor from above and from below
    for i in (0, 1, 2, 4, 5):
        for j in range(4):
            a, b = 4 * i + j, 4 * i + (j + 1) % 4
            c, d = (b + 4) % 24, (a + 4) % 24
            faces += [(a, b, c), (a, c, d)]
    return p.painted(np.array([corner for corners in rings for corner in corners]), faces, CERAMIC)


def vanity(rng: np.random.Generator, style: Style) -> list[p.Piece]:
    """Return a vanity unit with its top, a basin and a tap; drawers or doors under the basin, drawers beside it."""
    width, depth, top = rng.uniform(0.6, 1.5), rng.uniform(0.44, 0.52), rng.uniform(0.79, 0.9)
    bowl = (0.28, min(0.46, width - 0.16), 0.12)
    hung = p.chance(rng, 0.5)
    below = Cell(1.0, Opening("pair" if width > 0.75 else "left"), 0)
    side = Column(0.6, tuple(Cell(1.0, DRAWER) for _ in range(p.integer(rng, 2, 3))))
    columns = (side, Column(1.0, (below,))) if width > 0.95 else (Column(1.0, (below,)),)
    # Between the basin's middle and that of the column below it.
    y = width / 2 - width / (1.6 if len(columns) > 1 else 1.0) / 2
    low = rng.uniform(0.25, 0.35) if hung else rng.uniform(0.06, 0.15)
    base = Footing("none" if hung else "plinth", low, open_top=True)
    thick = rng.uniform(0.015, 0.04)
    style = replace(style, theme="toiletries")
    body = cabinet(rng, "bathroom cabinet", (depth, width, top - thick), columns, style, base)
    hole = (0.09, 0.09 + bowl[0], y - bowl[1] / 2, y + bowl[1] / 2)
    x, z = (0, depth + 0.015), (top - thick, top)
    plate = counter((-width / 2, width / 2), x, z, hole, (226, 226, 222), 0, "bathroom counter")
    sunk = basin(bowl, CERAMIC).moved(p.at(0.09 + bowl[0] / 2, y, top))
    return [body, plate, sunk, faucet(0.2, 0.14).moved(p.at(0.045, y, top))]


def mirror_cabinet(rng: np.random.Generator, style: Style) -> p.Piece:
    """Return a mirror cabinet with one to three doors, its floor 1.15 to 1.3 m high."""
    width = rng.uniform(0.45, 1.2)
    count = max(1, round(width / 0.45))
    grip = grips.design(rng, "edge", "knob", "none", "bar")
    grip = replace(grip, length=min(grip.length, 0.2))
    sides = ["left" if i % 2 else "right" for i in range(count)]
    doors = tuple(Column(1.0, (Cell(1.0, Opening(side, "mirror", "mirror", grip), 1),)) for side in sides)
    size = rng.uniform(0.12, 0.18), width, rng.uniform(0.55, 0.8)
    piece = cabinet(rng, "mirror cabinet", size, doors, replace(style, theme="toiletries"), Footing("none", 0.0))
    return piece.moved(p.at(0, 0, rng.uniform(1.15, 1.3)))


def tall_cupboard(rng: np.random.Generator, style: Style) -> p.Piece:
    """Return a tall narrow cupboard with doors, a drawer or an open compartment between them."""
    size = rng.uniform(0.3, 0.4), rng.uniform(0.3, 0.5), rng.uniform(1.4, 1.95)
    side = p.pick(rng, ("left", "right"))
    between = p.pick(rng, ((), (Cell(0.25, DRAWER),), (Cell(0.4, OPEN, 0),)))
    cells = (Cell(1.0, Opening(side)), *between, Cell(0.9, Opening(side)))
    return cabinet(rng, "storage cabinet", size, cells, style, Footing("plinth", rng.uniform(0.05, 0.12)))


def washer(rng: np.random.Generator, name: str = "washing machine") -> p.Piece:
    """Return a front loader: a porthole hinged at the left or right, a detergent drawer, a dial."""
    deep, wide, high = rng.uniform(0.46, 0.62), 0.597, rng.uniform(0.84, 0.85)
    hole, z, split = rng.uniform(0.13, 0.155), rng.uniform(0.4, 0.46), high - 0.135
    color = p.pick(rng, (WHITE, WHITE, (90, 92, 96)))
    shell = [board.moved(p.at(deep, 0, 0.02)) for board in cabinet_body((deep, wide, high - 0.02), 0.012, color)]
    half, drawer = wide / 2, -0.12
    boards = [
        ((-half, half), (0.02, z - hole)),
        ((-half, half), (z + hole, split - 0.005)),
        ((drawer, half), (split, high)),
    ]
    boards += [(beside, (z - hole, z + hole)) for beside in ((-half, -hole), (hole, half))]
    face = [p.box((deep - 0.02, deep), *spans, color) for spans in boards]
    turn = p.rotation((0, QUARTER, 0))
    reach = deep - 0.09
    inside = [(0.2, 0), (0.2, -0.02), (0.23, -0.02), (0.23, 0.01 - reach), (0, 0.01 - reach)]
    drum = [(0, -reach), (0.24, -reach), (0.24, 0), *inside]
    dial = p.cylinder(rng.uniform(0.022, 0.035), 0.025, STEEL).moved(
        p.at(deep, rng.uniform(0.0, 0.15), high - 0.07) @ turn
    )
    feet = p.posts((0.03, deep - 0.09), (-0.28, 0.23), (0, 0.02), 0.05, (40, 40, 44))
    body = p.join(*shell, *face, p.lathe(drum, STEEL).moved(p.at(deep - 0.02, 0, z) @ turn), dial, *feet)
    tray = _soap_drawer(rng.uniform(0.16, 0.24)).moved(p.at(deep, -0.206, high - 0.0675))
    return p.Piece(name, body, (_porthole(rng, hole).moved(p.at(deep + 0.034, 0, z)), tray))


def _porthole(rng: np.random.Generator, hole: float) -> p.Piece:
    """Return the round door of a front loader about a hole of given radius [m], with a grip across from its hinge."""
    outer, side = hole + rng.uniform(0.045, 0.065), p.pick(rng, (LEFT, LEFT, RIGHT))
    turn = p.rotation((0, QUARTER, 0))
    low, rim = (hole - 0.005, -0.03), [(outer, -0.03), (outer, -0.008), (outer - 0.02, 0), (hole - 0.005, 0)]
    ring = p.lathe([low, *rim, low], STEEL)
    bulge = [(0, -0.09), (hole - 0.04, -0.07), (hole - 0.006, -0.028), (hole - 0.006, -0.014), (0, -0.01)]
    glass = p.lathe(bulge, fronts.DARK_GLASS)
    high = rng.uniform(0.024, 0.034)
    grip = cup(rng.uniform(0.06, 0.1), high, rng.uniform(0.018, 0.026), (60, 60, 64))
    grip = grip.moved(p.at(-0.002, -side[0] * (outer - 0.018 - high / 2), 0.0) @ p.rotation((-side[0] * QUARTER, 0, 0)))
    return hinged("washing machine door", p.join(ring, glass).moved(turn), side, grip, angle=rng.uniform(1.4, 1.57))


def _soap_drawer(travel: float) -> p.Piece:
    shape = p.join(
        p.box((-0.02, 0), (-0.078, 0.078), (-0.05, 0.05), WHITE),
        p.box((-travel - 0.04, -0.02), (-0.065, 0.065), (-0.045, 0.03), (180, 190, 200)),
    )
    joint = Joint("prismatic", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, round(travel, 4)))
    return p.Piece("detergent drawer", shape, (edge(0.1, color=(60, 60, 64)).moved(p.at(0, 0, 0.02)),), joint)
