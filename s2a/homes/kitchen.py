"""Fitted kitchens and their appliances, as cabinets with glazed or thick doors; fixtures of bathrooms and laundries.

Ranges: units 0.15 to 1.2 m wide (coleccionplanta29.com, sizes in the UK), of which 0.3 to 1.0 m are drawn; upper face of the
worktop 0.87 to 1.0 m high, worktop 20 to 40 mm thick, base units 0.56 to 0.6 m deep, plinth 0.15 m (the same source); wall units
0.5 to 0.6 m above the worktop (house-forum.com, on IKEA Metod); dishwashers 0.46 and 0.61 m wide (engineerfix.com),
free-standing fridges 0.54 to 0.65 m wide, 0.55 to 0.7 m deep and 0.85 to 2.1 m high (kitchprep.com,
enchantedhomeschoolingmom.net); vanity units 0.61 to 1.52 m wide, 0.79 to 0.9 m high, 0.43 to 0.61 m deep (thelovelypoppy.com);
washing machines 0.595 to 0.6 m wide, 0.84 to 0.85 m high, 0.4 to 0.7 m deep (inthewash.co.uk, washgeek.com). Common sizes:
plinths from 0.08 m, wall units 0.32 to 0.38 m deep and 0.5 to 0.9 m high, islands, stools, heights of drawers, ovens 0.6 m wide,
microwaves, handles of oven doors, mirror cabinets, tall cupboards, portholes of 0.26 to 0.31 m hinged at the left, toilets,
bathtubs. EN 1116, which sets such sizes, was not opened.
"""

from dataclasses import dataclass, replace

import numpy as np

from s2a.homes import fronts, grips, household
from s2a.homes.casework import Cell, Column, Footing, cabinet
from s2a.homes.fronts import DRAWER, LEFT, OPEN, RIGHT, Opening, Style, cabinet_body, hinged, lid
from s2a.homes.grips import QUARTER, cup, edge
from s2a.homes.household import CHROME, basin, counter, faucet
from s2a.homes.solids import (
    WOOD,
    Color,
    Piece,
    Surface,
    at,
    box,
    chance,
    cylinder,
    integer,
    join,
    lathe,
    painted,
    pick,
    posts,
    rotation,
)
from s2a.scene.scene import Joint


@dataclass(frozen=True)
class Fitted:
    """What all units of one kitchen have in common [m]."""

    depth: float  # of the base units with fronts
    plinth: float  # its height
    top: float  # lower face of the worktop
    counter: float  # thickness of the worktop
    upper: float  # lower edge of the wall units
    wall: tuple[float, float]  # height and depth of the wall units


def fitted(rng: np.random.Generator) -> Fitted:
    """Return the drawn sizes of a kitchen."""
    top, thick = rng.uniform(0.85, 0.93), rng.uniform(0.02, 0.04)
    upper = top + thick + rng.uniform(0.5, 0.6)
    wall = rng.uniform(0.5, min(0.9, 2.25 - upper)), rng.uniform(0.32, 0.38)
    return Fitted(rng.uniform(0.56, 0.6), rng.uniform(0.08, 0.16), top, thick, upper, wall)


STEEL: Color = (172, 174, 178)
WHITE: Color = (232, 232, 230)
GLASS: Color = (30, 32, 36)


def oven_door(rng: np.random.Generator) -> Opening:
    """Return the glazed door of an oven that tips forward, with a long bar."""
    grip = replace(grips.design(rng, "rail", "bar", "square", color=STEEL), length=rng.uniform(0.38, 0.5))
    return Opening("down", "oven door", "window", grip, 0.03, rng.uniform(1.35, 1.55), pick(rng, (STEEL, WHITE, GLASS)))


def oven(rng: np.random.Generator, width: float, sizes: Fitted, style: Style) -> Piece:
    """Return an oven under the worktop: a panel with dials, the door, a drawer below it."""
    panel = Cell(0.7, Opening("fixed", color=STEEL))
    cells = (Cell(1.0, Opening("drawer", color=STEEL)), Cell(3.6, oven_door(rng), 1), panel)
    plain = replace(style, panel="slab", theme="nothing", thick=max(style.thick, 0.02))
    return cabinet(rng, "oven", (sizes.depth, width, sizes.top), cells, plain, Footing("plinth", sizes.plinth))


def dishwasher(rng: np.random.Generator, width: float, sizes: Fitted, style: Style) -> Piece:
    """Return a dishwasher behind a kitchen front, 0.45 or 0.6 m wide."""
    door = Cell(6.0, Opening("down", "dishwasher door", limit=rng.uniform(1.4, 1.57)), 1)
    cells = (door, Cell(0.8, Opening("fixed", color=STEEL)))
    plain = replace(style, theme="nothing", panel="slab")
    return cabinet(rng, "dishwasher", (sizes.depth, width, sizes.top), cells, plain, Footing("plinth", sizes.plinth))


def fridge(rng: np.random.Generator, style: Style) -> Piece:
    """Return a free-standing fridge: one door, a freezer above or below, or drawers of a freezer."""
    size = rng.uniform(0.58, 0.7), rng.uniform(0.54, 0.65), rng.uniform(1.45, 2.02)
    side, color = pick(rng, ("left", "right")), pick(rng, (WHITE, STEEL, (60, 62, 66), (170, 60, 54)))
    metal = pick(rng, (STEEL, (60, 60, 64), color))
    grip = grips.design(rng, "rail", "bar", "square", "bow", "edge", "recess", color=metal)
    grip = replace(grip, length=max(grip.length, 0.16))
    main = Opening(side, "refrigerator door", "slab", grip, rng.uniform(0.045, 0.07), color=color)
    cold = replace(main, name="freezer door")
    below = (Cell(0.8, cold, 1), Cell(rng.uniform(1.0, 1.6), main, 3))
    above = (Cell(rng.uniform(1.6, 2.2), main, 3), Cell(0.9, cold, 0))
    plain = replace(style, body=color, texture=0, theme="kitchen", thick=0.07, board=0.035, dark=(50, 50, 54))
    cells = pick(rng, (below, above, (Cell(1.0, main, 4),)))
    return cabinet(rng, "refrigerator", size, cells, replace(plain, top_theme="nothing"), Footing("plinth", 0.04))


def microwave(rng: np.random.Generator) -> Piece:
    """Return a microwave oven that stands on z = 0: its door opens to the left, keys at its right."""
    deep, wide, high = rng.uniform(0.3, 0.4), rng.uniform(0.44, 0.54), rng.uniform(0.25, 0.31)
    color = pick(rng, (STEEL, WHITE, (60, 62, 66)))
    base = small_style(color)
    grip = grips.design(rng, "rail", "bar", "square", "bow", color=STEEL)
    door = Opening("left", "microwave door", "window", grip, 0.022, rng.uniform(1.4, 1.6), color)
    keys = Opening("fixed", panel="slab", color=(52, 52, 56))
    columns = Column(3.2, (Cell(1.0, door, 0),)), Column(1.0, (Cell(1.0, keys, 0),))
    return cabinet(rng, "microwave", (deep, wide, high), columns, base, Footing("legs", 0.012))


def small_style(color: Color) -> Style:
    """Return the style of a small appliance: thin sheets, nothing in it."""
    grip = grips.GripDesign("bar", 0.15, 0.012, 0.01, 0.026, 2.0, 24, STEEL)
    looks = (color, color, color, (50, 50, 54), 0, "slab", "slab", grip, grip)
    return Style(*looks, 0.022, 0.012, 0.004, 0.04, 0.5, 0.03, 1.5, 0.8, False, *("nothing",) * 3)


def drawers(rng: np.random.Generator, width: float, sizes: Fitted, style: Style) -> Piece:
    """Return a base unit with two to five drawers."""
    heights = pick(rng, ((2, 2, 1), (3, 2), (1, 1, 1, 1), (2, 1.5, 1, 1), (1.4, 1, 1), (1, 1, 1, 1, 1)))
    return _unit(rng, width, sizes, style, tuple(Cell(float(h), DRAWER) for h in heights))


def cupboard(rng: np.random.Generator, width: float, sizes: Fitted, style: Style) -> Piece:
    """Return a base unit with one or two doors, often under a drawer."""
    doors = Opening("pair" if width > 0.62 else pick(rng, ("left", "right")))
    cells = (Cell(3.0, doors, 1), *((Cell(1.0, DRAWER),) if chance(rng, 0.5) else ()))
    return _unit(rng, width, sizes, style, cells)


def sink_unit(rng: np.random.Generator, width: float, sizes: Fitted, style: Style) -> Piece:
    """Return a base unit that is open above, for a sink, with one or two doors."""
    doors = Opening("pair" if width > 0.65 else pick(rng, ("left", "right")))
    base = Footing("plinth", sizes.plinth, open_top=True)
    return cabinet(rng, "kitchen cabinet", (sizes.depth, width, sizes.top), (Cell(1.0, doors, 0),), style, base)


def _unit(rng: np.random.Generator, width: float, sizes: Fitted, style: Style, cells: tuple[Cell, ...]) -> Piece:
    size = (sizes.depth, width, sizes.top)
    return cabinet(rng, "kitchen cabinet", size, cells, style, Footing("plinth", sizes.plinth))


def wall_unit(rng: np.random.Generator, width: float, sizes: Fitted, style: Style) -> Piece:
    """Return a wall unit in its place above the floor: doors, a flap that lifts, or open."""
    kinds = ("pair", "pair", "open") if width > 0.62 else ("left", "right", "left", "right", "up", "open")
    high, deep = sizes.wall
    cells = (Cell(1.0, Opening(pick(rng, kinds)), integer(rng, 1, 2)),)
    return cabinet(rng, "kitchen cabinet", (deep, width, high), cells, style, Footing("none", 0.0)).moved(
        at(0, 0, sizes.upper)
    )


def tall_unit(rng: np.random.Generator, width: float, sizes: Fitted, style: Style) -> Piece:
    """Return a tall larder unit, or one with an oven and a microwave built in."""
    side = pick(rng, ("left", "right"))
    high = sizes.upper + sizes.wall[0]
    larder = (Cell(1.1, Opening(side)), Cell(1.0, Opening(side)))
    upper = (Cell(0.6, oven_door(rng)), Cell(0.42, Opening("up")), Cell(0.4, Opening(side)))
    ovens = (Cell(0.35, DRAWER), Cell(0.35, DRAWER), *upper)
    cells = ovens if width > 0.55 and chance(rng, 0.5) else larder
    return cabinet(rng, "kitchen cabinet", (sizes.depth, width, high), cells, style, Footing("plinth", sizes.plinth))


def worktop(
    span: tuple[float, float], sizes: Fitted, sink: tuple[float, float] | None, color: Color, texture: int
) -> list[Piece]:
    """Return a worktop along y, and a sink with its tap where one is wanted.

    `span`: from y to y [m]; `sink`: middle and width of the bowl [m], or None.
    """
    z = (sizes.top, sizes.top + sizes.counter)
    x = (0.0, sizes.depth + 0.025)
    if sink is None:
        return [Piece("kitchen counter", box(x, span, z, color, texture))]
    middle, wide = sink
    bowl = (0.36, wide, 0.16)
    hole = (0.12, 0.12 + bowl[0], middle - wide / 2, middle + wide / 2)
    top = counter(span, x, z, hole, color, texture)
    sunk = basin(bowl).moved(at(0.12 + bowl[0] / 2, middle, z[1]))
    return [top, sunk, faucet(0.28, 0.18).moved(at(0.06, middle, z[1]))]


def island(rng: np.random.Generator, sizes: Fitted, style: Style, length: float) -> list[Piece]:
    """Return an island: base units in a row under a worktop that stands over at the back for stools."""
    count = max(2, round(length / 0.6))
    edges = np.linspace(-length / 2, length / 2, count + 1)
    units = [
        pick(rng, (drawers, cupboard))(rng, length / count, sizes, style).moved(at(0.0, (a + b) / 2))
        for a, b in zip(edges[:-1], edges[1:], strict=True)
    ]
    z = (sizes.top, sizes.top + sizes.counter)
    top = box((-0.28, sizes.depth + 0.025), (-length / 2 - 0.02, length / 2 + 0.02), z, style.top, style.texture)
    stools = [_stool(style).moved(at(-0.3, y)) for y in edges[:-1] + length / count / 2]
    bowl = household.bowl(0.14, (190, 180, 160)).moved(at(0.25, rng.uniform(-0.3, 0.3), z[1] + 0.0005))
    return [*units, Piece("kitchen counter", join(top)), *stools[: integer(rng, 0, count)], bowl]


def _stool(style: Style) -> Piece:
    legs = posts((-0.15, 0.125), (-0.15, 0.125), (0, 0.62), 0.025, style.dark)
    return Piece("stool", join(*legs, box((-0.17, 0.17), (-0.17, 0.17), (0.62, 0.65), style.top, WOOD)))


def hob() -> Piece:
    """Return a glass-ceramic hob with four zones, centred on the origin, that lies on a worktop at z = 0."""
    glass = box((-0.25, 0.25), (-0.29, 0.29), (0, 0.006), GLASS)
    zones = [
        cylinder(radius, 0.007, (70, 70, 74)).moved(at(x, y))
        for x, y, radius in ((-0.11, -0.14, 0.09), (-0.11, 0.14, 0.07), (0.11, -0.14, 0.07), (0.11, 0.14, 0.1))
    ]
    return Piece("stove", join(glass, *zones))


def extractor(height: float) -> Piece:
    """Return a cooker hood, its lower edge at z = 0, with a flue of given height [m] above it."""
    slope = box((0, 0.48), (-0.3, 0.3), (0, 0.07), STEEL)
    grille = box((0.05, 0.43), (-0.26, 0.26), (-0.004, 0), (90, 92, 96))
    return Piece("exhaust fan", join(slope, grille, box((0, 0.27), (-0.14, 0.14), (0.07, height), STEEL)))


CERAMIC: Color = (240, 240, 238)


def toilet() -> Piece:
    """Return a close-coupled toilet, 0.68 m deep, seat at 0.42 m: pan, seat, cistern with a button, and a lid that turns up."""
    squeeze, middle, half = 0.75, 0.43, 0.24
    outside = [(0.11, 0), (0.13, 0.02), (0.14, 0.16), (half - 0.01, 0.34), (half - 0.01, 0.4)]
    inside = [(half - 0.06, 0.4), (half - 0.08, 0.3), (0.06, 0.17), (0, 0.16)]
    pan = lathe([(0, 0), *outside, *inside], CERAMIC, squeeze=squeeze)
    ring = [(half - 0.06, 0.402), (half, 0.402), (half, 0.42), (half - 0.06, 0.42), (half - 0.06, 0.402)]
    body = [
        pan.moved(at(middle, 0)),
        box((0.0, 0.3), (-0.1, 0.1), (0, 0.38), CERAMIC),
        box((0.0, 0.165), (-0.19, 0.19), (0.38, 0.78), CERAMIC),
        box((0.0, 0.172), (-0.195, 0.195), (0.78, 0.8), CERAMIC),
        cylinder(0.025, 0.006, CHROME).moved(at(0.085, 0, 0.8)),
    ]
    seat = Piece("toilet seat", lathe(ring, (250, 250, 248), squeeze=squeeze).moved(at(middle, 0)))
    disc = lathe([(0, -0.018), (half, -0.018), (half, -0.006), (half - 0.015, 0), (0, 0)], CERAMIC, squeeze=squeeze)
    return Piece("toilet", join(*body), (seat, lid("toilet lid", disc).moved(at(middle, 0, 0.44))))


def bathtub(length: float, width: float = 0.75) -> Piece:
    """Return a bathtub along y in its panelled surround, 0.57 m high: an open tub with sloping ends."""
    high, rim, y = 0.57, 0.07, length / 2
    front = box((width - 0.02, width), (-y, y), (0, high - 0.03), CERAMIC)
    ends = [box((0, width), (s, s + 0.02), (0, high - 0.03), CERAMIC) for s in (-y, y - 0.02)]
    return Piece("bathtub", join(front, *ends, _tub((width, length), rim, high)))


def _tub(size: tuple[float, float], rim: float, high: float) -> Surface:
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
    return painted(np.array([corner for corners in rings for corner in corners]), faces, CERAMIC)


def vanity(rng: np.random.Generator, style: Style) -> list[Piece]:
    """Return a vanity unit with its top, a basin and a tap; drawers or doors under the basin, drawers beside it."""
    width, depth, top = rng.uniform(0.6, 1.5), rng.uniform(0.44, 0.52), rng.uniform(0.79, 0.9)
    bowl = (0.28, min(0.46, width - 0.16), 0.12)
    hung = chance(rng, 0.5)
    below = Cell(1.0, Opening("pair" if width > 0.75 else "left"), 0)
    side = Column(0.6, tuple(Cell(1.0, DRAWER) for _ in range(integer(rng, 2, 3))))
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
    sunk = basin(bowl, CERAMIC).moved(at(0.09 + bowl[0] / 2, y, top))
    return [body, plate, sunk, faucet(0.2, 0.14).moved(at(0.045, y, top))]


def mirror_cabinet(rng: np.random.Generator, style: Style) -> Piece:
    """Return a mirror cabinet with one to three doors, its floor 1.15 to 1.3 m high."""
    width = rng.uniform(0.45, 1.2)
    count = max(1, round(width / 0.45))
    grip = grips.design(rng, "edge", "knob", "none", "bar")
    grip = replace(grip, length=min(grip.length, 0.2))
    sides = ["left" if i % 2 else "right" for i in range(count)]
    doors = tuple(Column(1.0, (Cell(1.0, Opening(side, "mirror", "mirror", grip), 1),)) for side in sides)
    size = rng.uniform(0.12, 0.18), width, rng.uniform(0.55, 0.8)
    piece = cabinet(rng, "mirror cabinet", size, doors, replace(style, theme="toiletries"), Footing("none", 0.0))
    return piece.moved(at(0, 0, rng.uniform(1.15, 1.3)))


def tall_cupboard(rng: np.random.Generator, style: Style) -> Piece:
    """Return a tall narrow cupboard with doors, a drawer or an open compartment between them."""
    size = rng.uniform(0.3, 0.4), rng.uniform(0.3, 0.5), rng.uniform(1.4, 1.95)
    side = pick(rng, ("left", "right"))
    between = pick(rng, ((), (Cell(0.25, DRAWER),), (Cell(0.4, OPEN, 0),)))
    cells = (Cell(1.0, Opening(side)), *between, Cell(0.9, Opening(side)))
    return cabinet(rng, "storage cabinet", size, cells, style, Footing("plinth", rng.uniform(0.05, 0.12)))


def washer(rng: np.random.Generator, name: str = "washing machine") -> Piece:
    """Return a front loader: a porthole hinged at the left or right, a detergent drawer, a dial."""
    deep, wide, high = rng.uniform(0.46, 0.62), 0.597, rng.uniform(0.84, 0.85)
    hole, z, split = rng.uniform(0.13, 0.155), rng.uniform(0.4, 0.46), high - 0.135
    color = pick(rng, (WHITE, WHITE, (90, 92, 96)))
    shell = [board.moved(at(deep, 0, 0.02)) for board in cabinet_body((deep, wide, high - 0.02), 0.012, color)]
    half, drawer = wide / 2, -0.12
    boards = [
        ((-half, half), (0.02, z - hole)),
        ((-half, half), (z + hole, split - 0.005)),
        ((drawer, half), (split, high)),
    ]
    boards += [(beside, (z - hole, z + hole)) for beside in ((-half, -hole), (hole, half))]
    face = [box((deep - 0.02, deep), *spans, color) for spans in boards]
    turn = rotation((0, QUARTER, 0))
    reach = deep - 0.09
    inside = [(0.2, 0), (0.2, -0.02), (0.23, -0.02), (0.23, 0.01 - reach), (0, 0.01 - reach)]
    drum = [(0, -reach), (0.24, -reach), (0.24, 0), *inside]
    dial = cylinder(rng.uniform(0.022, 0.035), 0.025, STEEL).moved(at(deep, rng.uniform(0.0, 0.15), high - 0.07) @ turn)
    feet = posts((0.03, deep - 0.09), (-0.28, 0.23), (0, 0.02), 0.05, (40, 40, 44))
    body = join(*shell, *face, lathe(drum, STEEL).moved(at(deep - 0.02, 0, z) @ turn), dial, *feet)
    tray = _soap_drawer(rng.uniform(0.16, 0.24)).moved(at(deep, -0.206, high - 0.0675))
    return Piece(name, body, (_porthole(rng, hole).moved(at(deep + 0.034, 0, z)), tray))


def _porthole(rng: np.random.Generator, hole: float) -> Piece:
    """Return the round door of a front loader about a hole of given radius [m], with a grip across from its hinge."""
    outer, side = hole + rng.uniform(0.045, 0.065), pick(rng, (LEFT, LEFT, RIGHT))
    turn = rotation((0, QUARTER, 0))
    low, rim = (hole - 0.005, -0.03), [(outer, -0.03), (outer, -0.008), (outer - 0.02, 0), (hole - 0.005, 0)]
    ring = lathe([low, *rim, low], STEEL)
    bulge = [(0, -0.09), (hole - 0.04, -0.07), (hole - 0.006, -0.028), (hole - 0.006, -0.014), (0, -0.01)]
    glass = lathe(bulge, fronts.DARK_GLASS)
    high = rng.uniform(0.024, 0.034)
    grip = cup(rng.uniform(0.06, 0.1), high, rng.uniform(0.018, 0.026), (60, 60, 64))
    grip = grip.moved(at(-0.002, -side[0] * (outer - 0.018 - high / 2), 0.0) @ rotation((-side[0] * QUARTER, 0, 0)))
    return hinged("washing machine door", join(ring, glass).moved(turn), side, grip, angle=rng.uniform(1.4, 1.57))


def _soap_drawer(travel: float) -> Piece:
    shape = join(
        box((-0.02, 0), (-0.078, 0.078), (-0.05, 0.05), WHITE),
        box((-travel - 0.04, -0.02), (-0.065, 0.065), (-0.045, 0.03), (180, 190, 200)),
    )
    joint = Joint("prismatic", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, round(travel, 4)))
    return Piece("detergent drawer", shape, (edge(0.1, color=(60, 60, 64)).moved(at(0, 0, 0.02)),), joint)
