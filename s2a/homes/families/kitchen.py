"""Units of fitted kitchens, worktops, islands.

Ranges: units 0.15 to 1.2 m wide (coleccionplanta29.com, sizes in the UK), of which 0.3 to 1.0 m are drawn. Common sizes:
islands, stools, heights of drawers.
"""

from __future__ import annotations

import numpy as np

from s2a.homes import household
from s2a.homes.casework import CabinetBase, Cell, Column, cabinet
from s2a.homes.draw import chance, integer, pick, uniform
from s2a.homes.families.fitted import Fitted
from s2a.homes.families.kitchen_appliances import oven_door
from s2a.homes.fittings import Opening, Style
from s2a.homes.plumbing import basin, counter, faucet
from s2a.homes.solids import WOOD, Color, Piece, at, box, join


def drawers(rng: np.random.Generator, width: float, sizes: Fitted, style: Style) -> Piece:
    """Return a base unit with two to five drawers."""
    heights = pick(rng, ((2, 2, 1), (3, 2), (1, 1, 1, 1), (2, 1.5, 1, 1), (1.4, 1, 1), (1, 1, 1, 1, 1)))
    return _unit(rng, width, sizes, style, tuple(Cell(float(h), Opening("drawer")) for h in heights))


def cupboard(rng: np.random.Generator, width: float, sizes: Fitted, style: Style) -> Piece:
    """Return a base unit with one or two doors, often under a drawer."""
    doors = Opening("pair" if width > 0.62 else pick(rng, ("left", "right")))
    cells = (Cell(3.0, doors, 1), *((Cell(1.0, Opening("drawer")),) if chance(rng, 0.5) else ()))
    return _unit(rng, width, sizes, style, cells)


def sink_unit(rng: np.random.Generator, width: float, sizes: Fitted, style: Style) -> Piece:
    """Return a base unit that is open above, for a sink, with one or two doors."""
    doors = Opening("pair" if width > 0.65 else pick(rng, ("left", "right")))
    base = CabinetBase("plinth", sizes.plinth, open_top=True)
    return cabinet(
        rng, "kitchen cabinet", (sizes.depth, width, sizes.top), (Column(1.0, (Cell(1.0, doors, 0),)),), style, base
    )


def _unit(rng: np.random.Generator, width: float, sizes: Fitted, style: Style, cells: tuple[Cell, ...]) -> Piece:
    size = (sizes.depth, width, sizes.top)
    return cabinet(rng, "kitchen cabinet", size, (Column(1.0, cells),), style, CabinetBase("plinth", sizes.plinth))


def wall_unit(rng: np.random.Generator, width: float, sizes: Fitted, style: Style) -> Piece:
    """Return a wall unit in its place above the floor: doors, a flap that lifts, or open."""
    kinds = ("pair", "pair", "open") if width > 0.62 else ("left", "right", "left", "right", "up", "open")
    high, deep = sizes.wall
    piece = cabinet(
        rng,
        "kitchen cabinet",
        (deep, width, high),
        (Column(1.0, (Cell(1.0, Opening(pick(rng, kinds)), integer(rng, 1, 2)),)),),
        style,
        CabinetBase("none", 0.0),
    )
    return piece.moved(at(0, 0, sizes.upper))


def tall_unit(rng: np.random.Generator, width: float, sizes: Fitted, style: Style) -> Piece:
    """Return a tall larder unit, or one with an oven and a microwave built in."""
    side = pick(rng, ("left", "right"))
    high = sizes.upper + sizes.wall[0]
    larder = (Cell(1.1, Opening(side)), Cell(1.0, Opening(side)))
    ovens = (
        Cell(0.35, Opening("drawer")),
        Cell(0.35, Opening("drawer")),
        Cell(0.6, oven_door(rng)),
        Cell(0.42, Opening("up")),
        Cell(0.4, Opening(side)),
    )
    cells = ovens if width > 0.55 and chance(rng, 0.5) else larder
    return cabinet(
        rng,
        "kitchen cabinet",
        (sizes.depth, width, high),
        (Column(1.0, cells),),
        style,
        CabinetBase("plinth", sizes.plinth),
    )


def worktop(
    span: tuple[float, float], sizes: Fitted, sink: tuple[float, float] | None, color: Color, texture: int
) -> list[Piece]:
    """Return a worktop along y, and a sink with its tap where one is wanted.

    Args:
        span: from y to y [m].
        sizes: of the kitchen.
        sink: middle and width of the bowl [m], or None.
        color: of the worktop.
        texture: of the same.
    """
    z = (sizes.top, sizes.top + sizes.counter)
    x = (0.0, sizes.depth + 0.025)
    if sink is None:
        return [Piece("kitchen counter", box(x, span, z, color, texture))]
    middle, wide = sink
    bowl = (0.36, wide, 0.16)
    hole = (0.12, 0.12 + bowl[0], middle - wide / 2, middle + wide / 2)
    top = counter(span, x, z, hole, color, texture)
    return [
        top,
        basin(bowl).moved(at(0.12 + bowl[0] / 2, middle, z[1])),
        faucet(0.28, 0.18).moved(at(0.06, middle, z[1])),
    ]


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
    bowl = household.bowl(0.14, (190, 180, 160)).moved(at(0.25, uniform(rng, (-0.3, 0.3)), z[1] + 0.0005))
    return [*units, Piece("kitchen counter", join(top)), *stools[: integer(rng, 0, count)], bowl]


def _stool(style: Style) -> Piece:
    """Return a bar stool 0.65 m high."""
    legs = [box((x, x + 0.025), (y, y + 0.025), (0, 0.62), style.dark) for x in (-0.15, 0.125) for y in (-0.15, 0.125)]
    return Piece("stool", join(*legs, box((-0.17, 0.17), (-0.17, 0.17), (0.62, 0.65), style.top, WOOD)))
