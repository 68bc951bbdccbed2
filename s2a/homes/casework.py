"""Cabinets of any size from columns of cells: drawers, doors, flaps, shelves.

Local frame: back at x = 0, centred in y, floor at z = 0, metres. One builder makes kitchen units, wardrobes,
chests, lockers and the like: a family (`s2a.homes.families`) only draws its numbers.
Fronts lie before the cabinet body (full overlay), as wide as their cells but for the gaps between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.homes import clutter, leaves
from s2a.homes.clutter import Board
from s2a.homes.draw import chance, integer
from s2a.homes.fronts import cabinet_body
from s2a.homes.solids import Piece, Surface, at, box, join
from s2a.homes.styles import Opening, Style


@dataclass(frozen=True)
class Cell:
    """One compartment of a column.

    Attributes:
        weight: its height, relative to those of the column's other cells.
        opening: what closes it.
        shelves: boards inside; None: as many as usual for its height.
    """

    weight: float
    opening: Opening
    shelves: int | None = None


@dataclass(frozen=True)
class Column:
    """Cells one above the other, from below.

    Attributes:
        weight: its width, relative to those of the cabinet's other columns.
        cells: from below.
    """

    weight: float
    cells: tuple[Cell, ...]


@dataclass(frozen=True)
class CabinetBase:
    """The base and the top board of a cabinet.

    Attributes:
        kind: "plinth", "legs" or "none".
        height: of plinth or legs [m].
        cap: thickness of a top board that covers the fronts [m]; 0: none.
        clutter: number of objects that stand on it.
        open_top: The cabinet body is open above, as under a sink.
    """

    kind: str
    height: float
    cap: float = 0.0
    clutter: int = 0
    open_top: bool = False


def column(weight: float, *cells: tuple[float, str]) -> Column:
    """Return a column of plain cells, each given by its weight in the height and its kind."""
    return Column(weight, tuple(Cell(height, Opening(kind)) for height, kind in cells))


def cabinet(
    rng: np.random.Generator,
    name: str,
    size: tuple[float, float, float],
    columns: tuple[Column, ...],
    style: Style,
    base: CabinetBase,
) -> Piece:
    """Return a cabinet with its fronts, and with what stands in and on it.

    Args:
        rng: how askew its fronts hang, and what is in it.
        name: what it is called.
        size: depth with fronts but without handles, width and height [m].
        columns: from right to left, as y grows.
        style: materials, handles, reveals.
        base: what carries and covers it.
    """
    depth, width, height = size
    deep, span = depth - style.thick - 0.002, (base.height, height - base.cap)
    edges = np.cumsum([0.0, *(c.weight for c in columns)]) / sum(c.weight for c in columns) * width - width / 2
    shell = cabinet_body((deep, width, span[1] - span[0]), style.board, *style.paint)
    boards = [board.moved(at(deep, 0, span[0])) for board in (shell[:4] if base.open_top else shell)]
    boards += [box((0, deep), (y - style.board / 2, y + style.board / 2), span, *style.paint) for y in edges[1:-1]]
    boards += _base(size, style, base)
    fronts: list[Piece] = []
    contents: list[Piece] = []
    for left, right, each in zip(edges[:-1], edges[1:], columns, strict=True):
        inner = (left + style.board * (0.5 + (left == edges[0])), right - style.board * (0.5 + (right == edges[-1])))
        for z, cell, divided in _levels(each, span):
            # The lowest board lies within its cell, those between cells half in each.
            floor = z[0] + style.board * (1.0 if z[0] == span[0] else 0.5)
            inside = Board((style.board, deep), inner, floor, z[1] - style.board - floor)
            fronts += leaves.close(rng, cell.opening, (left, right), z, depth, style)
            shelves, things = _interior(rng, cell, inside, style)
            boards += shelves
            contents += things
            if divided:
                boards.append(box((0.0, deep), inner, (z[1] - style.board / 2, z[1] + style.board / 2), *style.paint))
    top = Board((0.03, depth - 0.03), (-width / 2 + 0.03, width / 2 - 0.03), height, 0.6)
    contents += clutter.fill(rng, top, style.top_theme, base.clutter)
    return Piece(name, join(*boards), tuple(fronts), contents=tuple(contents))


def _levels(each: Column, span: tuple[float, float]) -> list[tuple[tuple[float, float], Cell, bool]]:
    """Return each cell's lower and upper end [m], and whether a board lies between it and the next one above."""
    cuts = np.cumsum([0.0, *(cell.weight for cell in each.cells)])
    cuts = span[0] + cuts / cuts[-1] * (span[1] - span[0])
    levels = []
    for i, cell in enumerate(each.cells):
        above = each.cells[i + 1] if i + 1 < len(each.cells) else None
        drawers = above is not None and {cell.opening.kind, above.opening.kind} == {"drawer"}
        levels.append(((float(cuts[i]), float(cuts[i + 1])), cell, above is not None and not drawers))
    return levels


def _interior(
    rng: np.random.Generator, cell: Cell, inside: Board, style: Style
) -> tuple[list[Surface], tuple[Piece, ...]]:
    """Return the shelves of a cell without drawers, and what stands on them."""
    if cell.opening.kind == "drawer":
        return [], ()
    count = cell.shelves if cell.shelves is not None else int(inside.headroom / 0.36)
    step, front = inside.headroom / (count + 1), inside.x[1] - 0.02
    surfaces = [
        box((inside.x[0], front), inside.y, (inside.z + i * step - 0.016, inside.z + i * step), *style.paint)
        for i in range(1, count + 1)
    ]
    things: tuple[Piece, ...] = ()
    for i in range(count + 1):
        if chance(rng, 0.85 if cell.opening.kind == "open" else 0.4):
            level = Board((inside.x[0], front), inside.y, inside.z + i * step, step - 0.02)
            things += clutter.fill(rng, level, style.theme, integer(rng, 1, 4))
    return surfaces, things


def _base(size: tuple[float, float, float], style: Style, base: CabinetBase) -> list[Surface]:
    """Return plinth or legs, and the top board."""
    depth, half, height = size[0], size[1] / 2, size[2]
    boards = []
    if base.cap:
        boards.append(box((0, depth + 0.004), (-half, half), (height - base.cap, height), style.top, style.texture))
    if base.kind == "plinth":
        boards.append(box((0.02, depth - 0.05), (-half + 0.001, half - 0.001), (0, base.height), style.dark))
    elif base.kind == "legs":
        wide = min(0.045, size[1] / 8)
        boards += [
            box((x, x + wide), (y, y + wide), (0, base.height), style.dark)
            for x in (0.02, depth - style.thick - 0.03 - wide)
            for y in (0.02 - half, half - 0.02 - wide)
        ]
    return boards
