"""Beds, seats and tables.

Ranges: mattresses 0.8 to 1.8 m by 1.8 to 2.2 m (bedsizes.biz, European sizes); sofas 1.5 to 2.3 m wide (thespruce.com: two
and three seats); dining tables 0.71 to 0.76 m high, 0.76 to 1.02 m deep, 0.76 to 2.44 m long (thesize.net, opplehouse.com);
coffee tables 0.40 to 0.46 m high (thesize.net). Common sizes: heights of beds, widths of coffee tables, a chair every 0.6 m.
"""

from dataclasses import replace

import numpy as np

from s2a.homes import clutter, objects, solids
from s2a.homes import solids as p
from s2a.homes.casework import Cell, Column, Footing, cabinet
from s2a.homes.clutter import Board
from s2a.homes.fronts import DRAWER, OPEN, Style

OAK, SHEET = (176, 138, 96), (232, 230, 226)
BED_TOP = 0.5  # [m] Height of a mattress' upper face


def bed(rng: np.random.Generator, style: Style, color: p.Color) -> tuple[list[p.Piece], float, set[int]]:
    """Return a bed with its head at x = 0, pillows and a blanket, its half width [m], and its sides without drawers."""
    wide = p.pick(rng, (0.9, 1.0, 1.2, 1.4, 1.6, 1.8)) * rng.uniform(0.98, 1.02)
    long = rng.uniform(1.9, 2.1)
    if p.chance(rng, 0.55):
        sides = p.pick(rng, ((-1,), (1,), (-1, 1)))
        return _box_bed(rng, style, color, (wide, long), sides), wide / 2 + 0.04, {-1, 1} - set(sides)
    top, count = BED_TOP, 1 + (wide > 1.3)
    pillows = _pillows(rng, wide, count, top, 0.32)
    pieces = [_framed_bed(wide, long, color), _duvet(rng, wide, long, solids.random_color(rng, 120, 240)), *pillows]
    return pieces, wide / 2 + 0.08, {-1, 1}


def _box_bed(
    rng: np.random.Generator, style: Style, color: p.Color, size: tuple[float, float], sides: tuple[int, ...]
) -> list[p.Piece]:
    """Return a bed of given width and length [m] on a box with drawers that come out at some of its sides (+1, -1)."""
    wide, long = size
    high, half, head = rng.uniform(0.26, 0.34), wide / 2 + 0.02, 0.06
    drawers = Column(1.0, (Cell(1.0, DRAWER),))
    count, deep, middle = p.integer(rng, 2, 3), min(half - 0.01, 0.62), head + long / 2
    style = replace(style, drawer_theme="linen", theme="nothing", top_theme="nothing")
    chests = []
    for side in sides:
        chest = cabinet(rng, "bed frame", (deep, long, high), (drawers,) * count, style, Footing("plinth", 0.03))
        chests.append(chest.moved(p.at(middle, side * (half - deep), 0, 90 * side)))
    inner = half - deep
    spans = [(side * inner, side * half) for side in {-1, 1} - set(sides)] + [(-inner, inner)]
    boards = [
        p.box((head, head + long), (min(y), max(y)), (0.03, high), *style.paint)
        for y in spans
        if abs(y[1] - y[0]) > 0.02
    ]
    board = p.box((0, head - 0.004), (-half, half), (0, high + rng.uniform(0.35, 0.7)), color, p.FABRIC)
    mattress = objects.cushion((long - 0.02, wide, 0.2), SHEET, 24.0, 9.0).moved(p.at(middle, 0, high + 0.104))
    top = high + 0.206
    blanket = objects.cushion((0.62 * long, wide - 0.04, 0.06), solids.random_color(rng, 120, 240), 20.0, 9.0)
    cover = p.Piece("blanket", blanket.moved(p.at(head + 0.66 * long, 0, top + 0.03)))
    pillows = _pillows(rng, wide, 1 + (wide > 1.3), top, 0.3)
    return [p.Piece("bed", p.join(board, *boards, mattress)), *chests, cover, *pillows]


def _pillows(rng: np.random.Generator, wide: float, count: int, top: float, x: float) -> list[p.Piece]:
    each = wide / count
    size = (0.4, min(0.7, each - 0.08), rng.uniform(0.1, 0.16))
    return [
        objects.pillow(size, solids.random_color(rng, 120, 240)).moved(
            p.at(x, (i + 0.5) * each - wide / 2, top + 0.002, rng.uniform(-3, 3))
        )
        for i in range(count)
    ]


def _framed_bed(width: float, length: float, cloth: p.Color) -> p.Piece:
    """Return a bed with an upholstered headboard at x = 0; its frame is 60 mm wider than its mattress [m]."""
    half, foot = width / 2 + 0.03, 0.06 + length + 0.03
    legs = _legs((0.08, foot - 0.08), half - 0.07, 0.16)
    rails = [p.box((0.06, foot), (y, y + 0.025), (0.16, 0.36), OAK, p.WOOD) for y in (-half, half - 0.025)]
    ends = [
        p.box((x, x + 0.025), (-half + 0.025, half - 0.025), (0.16, 0.36), OAK, p.WOOD) for x in (0.06, foot - 0.025)
    ]
    slats = p.box((0.085, foot - 0.025), (-half + 0.025, half - 0.025), (0.22, 0.25), OAK, p.WOOD)
    mattress = objects.cushion((length, width, BED_TOP - 0.25), SHEET, 24.0, 9.0)
    head = [
        objects.cushion((0.06, (2 * half - 0.02) / 3, 0.62), cloth, 6.0, 6.0).moved(p.at(0.065, y, 0.76))
        for y in np.linspace(-1, 1, 3) * (2 * half) / 3
    ]
    board = p.box((0, 0.06), (-half, half), (0.05, 1.08), cloth, p.FABRIC)
    middle = p.at(0.075 + length / 2, 0, (BED_TOP + 0.25) / 2)
    return p.Piece("bed", p.join(board, *head, *legs, *rails, *ends, slats, mattress.moved(middle)))


def _duvet(rng: np.random.Generator, width: float, length: float, color: p.Color) -> p.Piece:
    """Return a thick blanket over the lower three quarters of a bed, which falls over both sides with soft folds."""
    long, thickness, fall = 0.68 * length, 0.035, 0.2
    half, phase = width / 2 + thickness + 0.004, rng.uniform(0, 2 * np.pi, 3)
    x, s = np.meshgrid(np.linspace(0, long, 33), np.linspace(-half - fall, half + fall, 49), indexing="ij")
    hanging = np.clip(np.abs(s) - half, 0, None)
    folds = 0.012 * (1 + np.sin(9 * x + phase[0] + np.sign(s))) * hanging / fall
    swell = 0.004 * (1 + np.sin(4 * x + phase[1]) * np.sin(5 * s + phase[2])) * (hanging == 0)
    y = np.sign(s) * (np.minimum(np.abs(s), half) + folds)
    cloth = _sheet(np.stack([x, y, thickness + 0.002 + swell - hanging], axis=-1), thickness, color)
    return p.Piece("blanket", cloth.moved(p.at(0.06 + 0.31 * length, 0, BED_TOP)))


def _sheet(points: np.ndarray, thickness: float, color: p.Color) -> p.Surface:
    """Return a cloth whose outer side runs through a grid of points [row column 3], rows before columns counter-clockwise."""
    rows, columns = points.shape[:2]
    normal = np.cross(np.gradient(points, axis=0), np.gradient(points, axis=1))
    inner = points - thickness * normal / np.linalg.norm(normal, axis=2, keepdims=True)
    index, count = np.arange(rows * columns).reshape(rows, columns), rows * columns
    a, b, c, d = (i.ravel() for i in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    outer = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    rim = np.concatenate([index[:, 0], index[-1, 1:], index[-2::-1, -1], index[0, -2::-1]])
    here, after = rim[:-1], rim[1:]
    hem = [np.stack([here, here + count, after + count], axis=1), np.stack([here, after + count, after], axis=1)]
    faces = np.concatenate([outer, outer[:, ::-1] + count, *hem])
    return p.painted(np.concatenate([points.reshape(-1, 3), inner.reshape(-1, 3)]), faces, color, p.FABRIC)


def _sofa(width: float, seats: int, cloth: p.Color, name: str = "sofa") -> p.Piece:
    """Return a sofa 0.9 m deep and 0.82 m high with a cushion to sit on and one to lean on for each seat.

    Its back is at x = -0.9; the seats are 0.44 m high, the arms 0.6 m high and 0.18 m wide.
    """
    half, arm = width / 2, 0.18
    base = p.box((-0.88, -0.02), (-half + arm, half - arm), (0.12, 0.28), cloth, p.FABRIC)
    rest = p.box((-0.9, -0.72), (-half + arm, half - arm), (0.12, 0.74), cloth, p.FABRIC)
    arms = [
        objects.cushion((0.9, arm, 0.48), cloth, 14.0, 10.0).moved(p.at(-0.45, side * (half - arm / 2), 0.36))
        for side in (-1, 1)
    ]
    each = (width - 2 * arm) / seats
    middles = [-half + arm + each * (i + 0.5) for i in range(seats)]
    seat = objects.cushion((0.74, each - 0.006, 0.17), cloth, 14.0, 4.0)
    lean = objects.cushion((0.2, each - 0.012, 0.44), cloth, 8.0, 6.0).moved(p.rotation((0, -0.2, 0)))
    soft = [part for y in middles for part in (seat.moved(p.at(-0.36, y, 0.36)), lean.moved(p.at(-0.63, y, 0.62)))]
    return p.Piece(name, p.join(base, rest, *arms, *soft, *_legs((-0.84, -0.08), half - 0.09, 0.12)))


def armchair(cloth: p.Color) -> p.Piece:
    """Return an armchair, 0.95 m wide and 0.9 m deep; its back is at x = -0.9."""
    return _sofa(0.95, 1, cloth, "armchair")


def _legs(x: tuple[float, float], y: float, height: float) -> list[p.Surface]:
    """Return four square legs 5 cm thick about +-y at two depths [m]."""
    return [p.box((a - 0.025, a + 0.025), (b - 0.025, b + 0.025), (0, height), OAK, p.WOOD) for a in x for b in (-y, y)]


def sofa(rng: np.random.Generator, color: p.Color) -> tuple[p.Piece, float]:
    """Return a sofa with its back at x = 0, and its width [m]."""
    width = rng.uniform(1.5, 2.3)
    return _sofa(width, max(2, round((width - 0.36) / 0.75)), color).moved(p.at(0.9, 0)), width


def dining(rng: np.random.Generator, style: Style) -> list[p.Piece]:
    """Return a dining table about the origin, long along y, with chairs and what stands on it."""
    high, deep, long = rng.uniform(0.71, 0.76), rng.uniform(0.76, 1.0), rng.uniform(0.9, 2.0)
    x, y = deep / 2, long / 2
    top = p.box((-x, x), (-y, y), (high - 0.03, high), style.top, style.texture)
    legs = p.posts((0.03 - x, x - 0.09), (0.03 - y, y - 0.09), (0, high - 0.03), 0.06, style.top, style.texture)
    board = Board((-x + 0.05, x - 0.05), (-y + 0.05, y - 0.05), high, 0.5)
    things = clutter.fill(rng, board, style.top_theme, p.integer(rng, 1, 7))
    table = p.Piece("table", p.join(top, *legs), contents=things)
    seats = max(1, int((long - 0.1) / 0.58))
    places = (np.arange(seats) + 0.5) / seats * (long - 0.1) - (long - 0.1) / 2
    chairs = [
        objects.chair().moved(p.at(side * (x + rng.uniform(0.16, 0.3)), b, 0, 180 * (side > 0) + rng.uniform(-6, 6)))
        for side in (-1, 1)
        for b in places
        if p.chance(rng, 0.85)
    ]
    return [table, *chairs]


def coffee_table(rng: np.random.Generator, style: Style) -> list[p.Piece]:
    """Return a low table about the origin, some with a drawer, and what stands on it."""
    high, deep, wide = rng.uniform(0.4, 0.46), rng.uniform(0.45, 0.7), rng.uniform(0.6, 1.2)
    if p.chance(rng, 0.5):
        cells = (Cell(1.0, OPEN, 0), Cell(0.9, DRAWER))
        count = 1 + (wide > 0.9)
        base = Footing("legs", 0.1, 0.02, p.integer(rng, 0, 3))
        style = replace(style, theme="nothing", top_theme="bedroom")
        piece = cabinet(rng, "coffee table", (deep, wide, high), (Column(1.0, cells),) * count, style, base)
        return [piece.moved(p.at(-deep / 2, 0))]
    x, y = deep / 2, wide / 2
    legs = p.posts((-x, x - 0.05), (-y, y - 0.05), (0, 0.39), 0.05, objects.OAK, p.WOOD)
    shelf = p.box((-x + 0.02, x - 0.02), (-y + 0.02, y - 0.02), (0.14, 0.16), objects.OAK, p.WOOD)
    body = p.Piece("coffee table", p.join(*legs, shelf, p.box((-x, x), (-y, y), (0.39, 0.42), objects.OAK, p.WOOD)))
    board = Board((0.03 - deep / 2, deep / 2 - 0.03), (0.03 - wide / 2, wide / 2 - 0.03), 0.42, 0.4)
    return [replace(body, contents=clutter.fill(rng, board, "bedroom", p.integer(rng, 1, 4)))]
