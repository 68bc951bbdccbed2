"""Kitchen appliances as cabinets with glazed or thick doors. Local frames as in `s2a.homes.families`.

Ranges: dishwashers 0.46 and 0.61 m wide (engineerfix.com), free-standing fridges 0.54 to 0.65 m wide, 0.55 to 0.7 m deep and
0.85 to 2.1 m high (kitchprep.com, enchantedhomeschoolingmom.net). Common sizes: ovens 0.6 m wide, microwaves, handles of oven
doors.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from s2a.homes import grips
from s2a.homes.casework import CabinetBase, Cell, Column, cabinet
from s2a.homes.draw import pick, uniform
from s2a.homes.families.fitted import Fitted
from s2a.homes.fittings import Opening, Style
from s2a.homes.solids import Color, Piece

STEEL: Color = (172, 174, 178)
WHITE: Color = (232, 232, 230)
GLASS: Color = (30, 32, 36)


def oven_door(rng: np.random.Generator) -> Opening:
    """Return the glazed door of an oven that tips forward, with a long bar."""
    grip = replace(grips.design(rng, "rail", "bar", "square", color=STEEL), length=uniform(rng, (0.38, 0.5)))
    return Opening(
        "down", "oven door", "window", grip, 0.03, uniform(rng, (1.35, 1.55)), pick(rng, (STEEL, WHITE, GLASS))
    )


def oven(rng: np.random.Generator, width: float, sizes: Fitted, style: Style) -> Piece:
    """Return an oven under the worktop: a panel with dials, the door, a drawer below it."""
    cells = (
        Cell(1.0, Opening("drawer", color=STEEL)),
        Cell(3.6, oven_door(rng), 1),
        Cell(0.7, Opening("fixed", color=STEEL)),
    )
    plain = replace(style, panel="slab", theme="nothing", thick=max(style.thick, 0.02))
    return cabinet(
        rng, "oven", (sizes.depth, width, sizes.top), (Column(1.0, cells),), plain, CabinetBase("plinth", sizes.plinth)
    )


def dishwasher(rng: np.random.Generator, width: float, sizes: Fitted, style: Style) -> Piece:
    """Return a dishwasher behind a kitchen front, 0.45 or 0.6 m wide."""
    cells = (
        Cell(6.0, Opening("down", "dishwasher door", limit=uniform(rng, (1.4, 1.57))), 1),
        Cell(0.8, Opening("fixed", color=STEEL)),
    )
    plain = replace(style, theme="nothing", panel="slab")
    return cabinet(
        rng,
        "dishwasher",
        (sizes.depth, width, sizes.top),
        (Column(1.0, cells),),
        plain,
        CabinetBase("plinth", sizes.plinth),
    )


def fridge(rng: np.random.Generator, style: Style) -> Piece:
    """Return a free-standing fridge: one door, a freezer above or below, or drawers of a freezer."""
    size = uniform(rng, (0.58, 0.7)), uniform(rng, (0.54, 0.65)), uniform(rng, (1.45, 2.02))
    side, color = pick(rng, ("left", "right")), pick(rng, (WHITE, STEEL, (60, 62, 66), (170, 60, 54)))
    grip = grips.design(
        rng, "rail", "bar", "square", "bow", "edge", "recess", color=pick(rng, (STEEL, (60, 60, 64), color))
    )
    grip = replace(grip, length=max(grip.length, 0.16))
    main = Opening(side, "refrigerator door", "slab", grip, uniform(rng, (0.045, 0.07)), color=color)
    cold = replace(main, name="freezer door")
    below = (Cell(0.8, cold, 1), Cell(uniform(rng, (1.0, 1.6)), main, 3))
    above = (Cell(uniform(rng, (1.6, 2.2)), main, 3), Cell(0.9, cold, 0))
    plain = replace(
        style, body=color, texture=0, theme="kitchen", thick=0.07, board=0.035, dark=(50, 50, 54), top_theme="nothing"
    )
    return cabinet(
        rng,
        "refrigerator",
        size,
        (Column(1.0, pick(rng, (below, above, (Cell(1.0, main, 4),)))),),
        plain,
        CabinetBase("plinth", 0.04),
    )


def microwave(rng: np.random.Generator) -> Piece:
    """Return a microwave oven that stands on z = 0: its door opens to the left, keys at its right."""
    deep, wide, high = uniform(rng, (0.3, 0.4)), uniform(rng, (0.44, 0.54)), uniform(rng, (0.25, 0.31))
    color = pick(rng, (STEEL, WHITE, (60, 62, 66)))
    base = small_style(color)
    grip = grips.design(rng, "rail", "bar", "square", "bow", color=STEEL)
    door = Opening("left", "microwave door", "window", grip, 0.022, uniform(rng, (1.4, 1.6)), color)
    keys = Opening("fixed", panel="slab", color=(52, 52, 56))
    columns = Column(3.2, (Cell(1.0, door, 0),)), Column(1.0, (Cell(1.0, keys, 0),))
    return cabinet(rng, "microwave", (deep, wide, high), columns, base, CabinetBase("legs", 0.012))


def small_style(color: Color) -> Style:
    """Return the style of a small appliance: thin sheets, nothing in it."""
    grip = grips.GripDesign("bar", 0.15, 0.012, 0.01, 0.026, 2.0, 24, STEEL)
    return Style(
        color,
        color,
        color,
        (50, 50, 54),
        0,
        "slab",
        "slab",
        grip,
        grip,
        0.022,
        0.012,
        0.004,
        0.04,
        0.5,
        0.03,
        1.5,
        0.8,
        False,
        "nothing",
        "nothing",
        "nothing",
    )
