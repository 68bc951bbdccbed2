"""Beds, seats and tables.

Ranges: mattresses 0.8 to 1.8 m by 1.8 to 2.2 m (bedsizes.biz, European sizes); sofas 1.5 to 2.3 m wide (thespruce.com: two
and three seats); dining tables 0.71 to 0.76 m high, 0.76 to 1.02 m deep, 0.76 to 2.44 m long (thesize.net, opplehouse.com);
coffee tables 0.40 to 0.46 m high (thesize.net). Common sizes: heights of beds, widths of coffee tables, a chair every 0.6 m.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from s2a.homes import clutter, objects
from s2a.homes.casework import CabinetBase, Cell, Column, cabinet
from s2a.homes.clutter import Board
from s2a.homes.draw import chance, integer, pick, uniform
from s2a.homes.fronts import Opening, Style
from s2a.homes.solids import FABRIC, Color, Piece, at, box, join


def bed(rng: np.random.Generator, style: Style, color: Color) -> tuple[list[Piece], float, set[int]]:
    """Return a bed with its head at x = 0, pillows and a blanket, its half width [m], and its sides without drawers."""
    wide = pick(rng, (0.9, 1.0, 1.2, 1.4, 1.6, 1.8)) * uniform(rng, (0.98, 1.02))
    long = uniform(rng, (1.9, 2.1))
    if chance(rng, 0.55):
        sides = pick(rng, ((-1,), (1,), (-1, 1)))
        return _box_bed(rng, style, color, (wide, long), sides), wide / 2 + 0.04, {-1, 1} - set(sides)
    top, count = objects.BED_TOP, 1 + (wide > 1.3)
    pillows = _pillows(rng, wide, count, top, 0.32)
    pieces = [objects.bed(wide, long, color), objects.duvet(rng, wide, long, _light(rng)), *pillows]
    return pieces, wide / 2 + 0.08, {-1, 1}


def _box_bed(
    rng: np.random.Generator, style: Style, color: Color, size: tuple[float, float], sides: tuple[int, ...]
) -> list[Piece]:
    """Return a bed of given width and length [m] on a box with drawers that come out at some of its sides (+1, -1)."""
    wide, long = size
    high, half, head = uniform(rng, (0.26, 0.34)), wide / 2 + 0.02, 0.06
    drawers = Column(1.0, (Cell(1.0, Opening("drawer")),))
    count, deep, middle = integer(rng, 2, 3), min(half - 0.01, 0.62), head + long / 2
    style = replace(style, drawer_theme="linen", theme="nothing", top_theme="nothing")
    chests = [
        cabinet(rng, "bed frame", (deep, long, high), (drawers,) * count, style, CabinetBase("plinth", 0.03)).moved(
            at(middle, side * (half - deep), 0, 90 * side)
        )
        for side in sides
    ]
    inner = half - deep
    spans = [(side * inner, side * half) for side in {-1, 1} - set(sides)] + [(-inner, inner)]
    boards = [
        box((head, head + long), (min(y), max(y)), (0.03, high), *style.paint) for y in spans if abs(y[1] - y[0]) > 0.02
    ]
    board = box((0, head - 0.004), (-half, half), (0, high + uniform(rng, (0.35, 0.7))), color, FABRIC)
    mattress = objects.cushion((long - 0.02, wide, 0.2), (232, 230, 226), 24.0, 9.0).moved(at(middle, 0, high + 0.104))
    top = high + 0.206
    blanket = objects.cushion((0.62 * long, wide - 0.04, 0.06), _light(rng), 20.0, 9.0)
    cover = Piece("blanket", blanket.moved(at(head + 0.66 * long, 0, top + 0.03)))
    return [
        Piece("bed", join(board, *boards, mattress)),
        *chests,
        cover,
        *_pillows(rng, wide, 1 + (wide > 1.3), top, 0.3),
    ]


def _pillows(rng: np.random.Generator, wide: float, count: int, top: float, x: float) -> list[Piece]:
    """Return pillows side by side at the head of a bed."""
    each = wide / count
    size = (0.4, min(0.7, each - 0.08), uniform(rng, (0.1, 0.16)))
    return [
        objects.pillow(size, _light(rng)).moved(at(x, (i + 0.5) * each - wide / 2, top + 0.002, uniform(rng, (-3, 3))))
        for i in range(count)
    ]


def _light(rng: np.random.Generator) -> Color:
    red, green, blue = rng.integers(120, 240, 3).tolist()
    return (red, green, blue)


def sofa(rng: np.random.Generator, color: Color) -> tuple[Piece, float]:
    """Return a sofa with its back at x = 0, and its width [m]."""
    width = uniform(rng, (1.5, 2.3))
    return objects.sofa(width, max(2, round((width - 0.36) / 0.75)), color).moved(at(0.9, 0)), width


def dining(rng: np.random.Generator, style: Style) -> list[Piece]:
    """Return a dining table about the origin, long along y, with chairs and what stands on it."""
    high, deep, long = uniform(rng, (0.71, 0.76)), uniform(rng, (0.76, 1.0)), uniform(rng, (0.9, 2.0))
    x, y = deep / 2, long / 2
    top = box((-x, x), (-y, y), (high - 0.03, high), style.top, style.texture)
    legs = [
        box((a, a + 0.06), (b, b + 0.06), (0, high - 0.03), style.top, style.texture)
        for a in (0.03 - x, x - 0.09)
        for b in (0.03 - y, y - 0.09)
    ]
    things = clutter.fill(
        rng, Board((-x + 0.05, x - 0.05), (-y + 0.05, y - 0.05), high, 0.5), style.top_theme, integer(rng, 1, 7)
    )
    table = Piece("table", join(top, *legs), contents=things)
    seats = max(1, int((long - 0.1) / 0.58))
    places = (np.arange(seats) + 0.5) / seats * (long - 0.1) - (long - 0.1) / 2
    chairs = [
        objects.chair().moved(
            at(side * (x + uniform(rng, (0.16, 0.3))), b, 0, 180 * (side > 0) + uniform(rng, (-6, 6)))
        )
        for side in (-1, 1)
        for b in places
        if chance(rng, 0.85)
    ]
    return [table, *chairs]


def coffee_table(rng: np.random.Generator, style: Style) -> list[Piece]:
    """Return a low table about the origin, some with a drawer, and what stands on it."""
    high, deep, wide = uniform(rng, (0.4, 0.46)), uniform(rng, (0.45, 0.7)), uniform(rng, (0.6, 1.2))
    if chance(rng, 0.5):
        cells = (Cell(1.0, Opening("open"), 0), Cell(0.9, Opening("drawer")))
        count = 1 + (wide > 0.9)
        base = CabinetBase("legs", 0.1, 0.02, integer(rng, 0, 3))
        piece = cabinet(
            rng,
            "coffee table",
            (deep, wide, high),
            (Column(1.0, cells),) * count,
            replace(style, theme="nothing", top_theme="bedroom"),
            base,
        )
        return [piece.moved(at(-deep / 2, 0))]
    body = objects.coffee_table(wide, deep)
    board = Board((0.03 - deep / 2, deep / 2 - 0.03), (0.03 - wide / 2, wide / 2 - 0.03), 0.42, 0.4)
    return [replace(body, contents=clutter.fill(rng, board, "bedroom", integer(rng, 1, 4)))]
