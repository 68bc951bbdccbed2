"""Furniture of offices, studies and workshops.

Ranges: work surfaces 0.65 to 0.85 m high (EN 527-1 by offipedia.org); filing cabinets of one column 0.38 to 0.46 m wide and
0.64 to 0.72 m deep, of two 0.76 to 1.12 m wide (2175forals.com); stationery cupboards 1.2 to 2.1 m high, 0.9 m wide, 0.46 m
deep (m-d-international.com). Common sizes: desks 0.6 to 0.8 m deep and 1.15 to 1.8 m wide, pedestals, 0.3 m a drawer of
suspension files, roller-shutter cabinets, lockers 0.25 to 0.4 m a column, workbenches, tool cabinets.
"""

from dataclasses import replace

import numpy as np

from s2a.homes import clutter, grips, objects
from s2a.homes.casework import Cell, Column, Footing, cabinet, column
from s2a.homes.clutter import Board
from s2a.homes.floor_plan import CLEAR, measured, meet
from s2a.homes.fronts import DRAWER, OPEN, Opening, Style
from s2a.homes.solids import Color, Piece, at, box, chance, integer, join, pick, posts

# Colours of sheet steel
SHEET: tuple[Color, ...] = (
    (196, 198, 202),
    (120, 124, 130),
    (58, 60, 64),
    (70, 92, 116),
    (150, 60, 54),
    (226, 224, 218),
)


def steel(rng: np.random.Generator, style: Style) -> Style:
    """Return a style of sheet steel: thin, painted, narrow reveals."""
    color = pick(rng, SHEET)
    style = replace(style, body=color, front=color, top=color, texture=0)
    return replace(style, panel="slab", drawer_panel="slab", board=0.015, thick=0.018)


def pedestal(rng: np.random.Generator, style: Style, high: float) -> Piece:
    """Return a desk pedestal no higher than `high` [m], with two to four drawers."""
    size = rng.uniform(0.48, 0.58), rng.uniform(0.33, 0.43), rng.uniform(0.5, high)
    rows = pick(rng, ((2.2, 1.0, 1.0), (1.0, 1.0, 1.0), (2.0, 1.0), (1.0, 1.0, 1.0, 1.0), (2.0, 1.4, 0.7)))
    base = Footing("legs" if chance(rng, 0.3) else "plinth", rng.uniform(0.03, 0.07), 0.018)
    return cabinet(rng, "storage cabinet", size, (column(1.0, *((r, "drawer") for r in rows)),), style, base)


def filing(rng: np.random.Generator, style: Style) -> Piece:
    """Return a filing cabinet of two to four high drawers, one or two columns."""
    count, wide = integer(rng, 2, 4), pick(rng, (1, 1, 2))
    deep = rng.uniform(*((0.6, 0.72) if wide == 1 else (0.45, 0.55)))
    size = deep, wide * rng.uniform(0.38, 0.47), 0.05 + count * rng.uniform(0.28, 0.33)
    columns = tuple(column(1.0, *((1.0, "drawer"),) * count) for _ in range(wide))
    base = Footing("plinth", 0.04, 0.016, integer(rng, 0, 3))
    return cabinet(rng, "filing cabinet", size, columns, replace(steel(rng, style), extension=0.97), base)


def roller(rng: np.random.Generator, style: Style) -> Piece:
    """Return a cabinet with a shutter that slides up, above drawers or open shelves."""
    size = rng.uniform(0.38, 0.5), rng.uniform(0.7, 1.2), rng.uniform(1.0, 1.7)
    grip = grips.design(rng, "bar", "square", "rail", "bow", "knob")
    shutter = Cell(3.0, Opening("rise", grip=grip))
    below = pick(rng, ((), (Cell(0.8, DRAWER),), (Cell(1.0, OPEN),)))
    style = replace(steel(rng, style), thick=0.03)
    return cabinet(rng, "storage cabinet", size, (*below, shutter), style, Footing("plinth", 0.05, 0.02, 2))


def lockers(rng: np.random.Generator, style: Style) -> Piece:
    """Return lockers: one to four columns of one to four doors that turn about the same side."""
    columns, rows = integer(rng, 1, 4), integer(rng, 1, 4)
    size = rng.uniform(0.4, 0.5), columns * rng.uniform(0.25, 0.4), rng.uniform(1.5, 1.9)
    grip = grips.design(rng, "knob", "bar", "recess", "bow", "square")
    side = pick(rng, ("left", "right"))
    cells = tuple(Cell(1.0, Opening(side, grip=replace(grip, length=min(grip.length, 0.16)))) for _ in range(rows))
    style = replace(steel(rng, style), panel=pick(rng, ("slab", "slab", "grooved")))
    return cabinet(
        rng, "locker", size, (Column(1.0, cells),) * columns, style, Footing("plinth", rng.uniform(0.05, 0.12))
    )


def cupboard(rng: np.random.Generator, style: Style) -> Piece:
    """Return an office cupboard with a pair of doors, high or low, often with open shelves above."""
    size = rng.uniform(0.38, 0.46), rng.uniform(0.7, 1.2), rng.uniform(0.75, 2.0)
    doors = Cell(2.0, Opening("pair"))
    cells = (doors, Cell(1.2, OPEN, 1)) if chance(rng, 0.5) else (doors,)
    style = steel(rng, style) if chance(rng, 0.4) else style
    return cabinet(rng, "storage cabinet", size, cells, style, Footing("plinth", 0.06, 0.02, integer(rng, 0, 2)))


def wall_cupboard(rng: np.random.Generator, style: Style) -> Piece:
    """Return a cupboard that hangs on the wall, its floor 1.25 to 1.5 m high."""
    size = rng.uniform(0.3, 0.38), rng.uniform(0.4, 1.1), rng.uniform(0.35, 0.7)
    kinds = ("pair",) if size[1] > 0.65 else ("left", "right", "up")
    cell = Cell(1.0, Opening(pick(rng, kinds)))
    return cabinet(rng, "wall cabinet", size, (cell,), style, Footing("none", 0.0)).moved(
        at(0, 0, rng.uniform(1.2, 1.45))
    )


def desk(rng: np.random.Generator, style: Style, work: str = "desk") -> list[Piece]:
    """Return a desk or a workbench with a pedestal or a drawer under it, things on it, and a chair before it."""
    high, deep, wide = rng.uniform(0.69, 0.78), rng.uniform(0.6, 0.8), rng.uniform(1.15, 1.8)
    high += 0.12 if work == "workbench" else 0.0
    side = pick(rng, (-1, 1))
    top = box((0.02, deep), (-wide / 2, wide / 2), (high - 0.025, high), style.top, style.texture)
    sides = (0.01 - wide / 2, wide / 2 - 0.055)
    legs = posts((0.04, deep - 0.065), sides, (0, high - 0.025), 0.045, style.dark)
    body = Piece(work, join(top, *legs), contents=_on_desk(rng, work, (deep, wide, high), style))
    pieces = [body]
    if chance(rng, 0.75) and deep > 0.62:
        box_ = pedestal(rng, style, high - 0.07)
        long = float(np.ptp(box_.surface.vertices[:, 0]))
        pieces.append(box_.moved(at(max(0.03, deep - long - 0.01), side * (wide / 2 - 0.07 - 0.22))))
    else:
        pieces.append(_under(rng, style, (deep, high), side * (wide / 2 - 0.36)))
    seat = objects.office_chair(rng) if work == "desk" else _stool(style)
    return [*pieces, *_seated(rng, seat, pieces[1:], (deep, -side * (wide / 2 - 0.46)), side)]


def _seated(
    rng: np.random.Generator, seat: Piece, others: list[Piece], place: tuple[float, float], inwards: int
) -> list[Piece]:
    """Return a seat before a desk where no drawer opens into it; none if there is no such place."""
    taken = measured(others, 0.0)
    for _ in range(8):
        # Away from the desk's leg.
        x, y = place[0] + rng.uniform(0.02, 0.14), place[1] + inwards * rng.uniform(0.0, 0.12)
        there = seat.moved(at(x, y, 0, 180 + rng.uniform(-25, 25)))
        boxes = measured([there], 0.0).filled
        if not meet(boxes, taken.swept, CLEAR) and not meet(boxes, taken.filled, 0.0):
            return [there]
    return []


def _on_desk(rng: np.random.Generator, work: str, size: tuple[float, float, float], style: Style) -> tuple[Piece, ...]:
    """Return what stands on a desk: a screen, a keyboard and a mouse, things."""
    deep, wide, high = size
    if work == "workbench":
        board = Board((0.06, deep - 0.06), (-wide / 2 + 0.05, wide / 2 - 0.05), high, 0.5)
        return clutter.fill(rng, board, "tools", integer(rng, 2, 6))
    y = rng.uniform(-0.15, 0.15)
    screen = [
        objects.monitor().moved(at(0.2, y, high)),
        objects.keyboard().moved(at(deep - 0.17, y, high, rng.uniform(-3, 3))),
        objects.mouse().moved(at(deep - 0.16, y - 0.33, high + 0.031)),
    ]
    left = Board((0.05, deep - 0.05), (y + 0.36, wide / 2 - 0.04), high, 0.5)
    right = Board((0.05, deep - 0.3), (0.04 - wide / 2, y - 0.36), high, 0.5)
    return (*screen, *clutter.fill(rng, left, style.top_theme, 4), *clutter.fill(rng, right, style.top_theme, 2))


def _under(rng: np.random.Generator, style: Style, size: tuple[float, float], y: float) -> Piece:
    deep, high = size
    wide, tall = rng.uniform(0.4, 0.56), rng.uniform(0.1, 0.15)
    drawer = Cell(1.0, DRAWER)
    piece = cabinet(rng, "desk drawer", (deep - 0.12, wide, tall), (drawer,), style, Footing("none", 0.0))
    return piece.moved(at(0.1, y, high - 0.026 - tall))


def _stool(style: Style) -> Piece:
    legs = posts((-0.15, 0.12), (-0.15, 0.12), (0, 0.57), 0.03, style.dark)
    return Piece("stool", join(*legs, box((-0.18, 0.18), (-0.18, 0.18), (0.57, 0.6), style.top, style.texture)))


def tool_cabinet(rng: np.random.Generator, style: Style) -> Piece:
    """Return a cabinet of many flat steel drawers, 0.5 to 1.1 m wide, with long handles."""
    size = rng.uniform(0.4, 0.6), rng.uniform(0.5, 1.1), rng.uniform(0.7, 1.1)
    rows = [rng.uniform(1.0, 1.4) * (1.0 + (i < 2)) for i in range(integer(rng, 4, 7))]
    grip = grips.design(rng, "edge", "bar", "rail", "square")
    style = replace(steel(rng, style), grip=replace(grip, length=max(grip.length, 0.25)))
    cells = column(1.0, *((r, "drawer") for r in rows))
    return cabinet(rng, "tool cabinet", size, (cells,), style, Footing("plinth", 0.08, 0.03, integer(rng, 1, 4)))
