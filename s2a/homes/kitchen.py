"""Fitted kitchens: units, worktops, islands, and appliances as cabinets with glazed or thick doors.

Ranges: units 0.15 to 1.2 m wide (coleccionplanta29.com, sizes in the UK), of which 0.3 to 1.0 m are drawn; upper face of the
worktop 0.87 to 1.0 m high, worktop 20 to 40 mm thick, base units 0.56 to 0.6 m deep, plinth 0.15 m (the same source); wall units
0.5 to 0.6 m above the worktop (house-forum.com, on IKEA Metod); dishwashers 0.46 and 0.61 m wide (engineerfix.com), free-standing
fridges 0.54 to 0.65 m wide, 0.55 to 0.7 m deep and 0.85 to 2.1 m high (kitchprep.com, enchantedhomeschoolingmom.net). Common
sizes: plinths from 0.08 m, wall units 0.32 to 0.38 m deep and 0.5 to 0.9 m high, islands, stools, heights of drawers, ovens 0.6 m
wide, microwaves, handles of oven doors. EN 1116, which sets such sizes, was not opened.
"""

from dataclasses import dataclass, replace

import numpy as np

from s2a.homes import grips, household
from s2a.homes.casework import Cell, Column, Footing, cabinet
from s2a.homes.fronts import DRAWER, Opening, Style
from s2a.homes.household import basin, counter, faucet
from s2a.homes.solids import WOOD, Color, Piece, at, box, chance, cylinder, integer, join, pick, posts


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
