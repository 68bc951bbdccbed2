"""Beds, seats and tables; furniture of offices, studies and workshops.

Ranges: mattresses 0.8 to 1.8 m by 1.8 to 2.2 m (bedsizes.biz, European sizes); sofas 1.5 to 2.3 m wide (thespruce.com: two and
three seats); dining tables 0.71 to 0.76 m high, 0.76 to 1.02 m deep, 0.76 to 2.44 m long (thesize.net, opplehouse.com); coffee
tables 0.40 to 0.46 m high (thesize.net); work surfaces 0.65 to 0.85 m high (EN 527-1 by offipedia.org); filing cabinets of one
column 0.38 to 0.46 m wide and 0.64 to 0.72 m deep, of two 0.76 to 1.12 m wide (2175forals.com); stationery cupboards 1.2 to 2.1
m high, 0.9 m wide, 0.46 m deep (m-d-international.com). Common sizes: heights of beds, widths of coffee tables, a chair every
0.6 m, desks 0.6 to 0.8 m deep and 1.15 to 1.8 m wide, pedestals, 0.3 m a drawer of suspension files, roller-shutter cabinets,
lockers 0.25 to 0.4 m a column, workbenches, tool cabinets.
"""

from dataclasses import replace

import numpy as np

from s2a.homes import clutter, grips, objects
from s2a.homes.casework import Cell, Column, Footing, cabinet, column
from s2a.homes.clutter import Board
from s2a.homes.floor_plan import CLEAR, measured, meet
from s2a.homes.fronts import DRAWER, OPEN, Opening, Style
from s2a.homes.solids import (
    FABRIC,
    WOOD,
    Color,
    Piece,
    Surface,
    at,
    box,
    chance,
    integer,
    join,
    painted,
    pick,
    posts,
    random_color,
    rotation,
)

OAK, SHEET = (176, 138, 96), (232, 230, 226)
BED_TOP = 0.5  # [m] Height of a mattress' upper face


def bed(rng: np.random.Generator, style: Style, color: Color) -> tuple[list[Piece], float, set[int]]:
    """Return a bed with its head at x = 0, pillows and a blanket, its half width [m], and its sides without drawers."""
    wide = pick(rng, (0.9, 1.0, 1.2, 1.4, 1.6, 1.8)) * rng.uniform(0.98, 1.02)
    long = rng.uniform(1.9, 2.1)
    if chance(rng, 0.55):
        sides = pick(rng, ((-1,), (1,), (-1, 1)))
        return _box_bed(rng, style, color, (wide, long), sides), wide / 2 + 0.04, {-1, 1} - set(sides)
    top, count = BED_TOP, 1 + (wide > 1.3)
    pillows = _pillows(rng, wide, count, top, 0.32)
    pieces = [_framed_bed(wide, long, color), _duvet(rng, wide, long, random_color(rng, 120, 240)), *pillows]
    return pieces, wide / 2 + 0.08, {-1, 1}


def _box_bed(
    rng: np.random.Generator, style: Style, color: Color, size: tuple[float, float], sides: tuple[int, ...]
) -> list[Piece]:
    """Return a bed of given width and length [m] on a box with drawers that come out at some of its sides (+1, -1)."""
    wide, long = size
    high, half, head = rng.uniform(0.26, 0.34), wide / 2 + 0.02, 0.06
    drawers = Column(1.0, (Cell(1.0, DRAWER),))
    count, deep, middle = integer(rng, 2, 3), min(half - 0.01, 0.62), head + long / 2
    style = replace(style, drawer_theme="linen", theme="nothing", top_theme="nothing")
    chests = []
    for side in sides:
        chest = cabinet(rng, "bed frame", (deep, long, high), (drawers,) * count, style, Footing("plinth", 0.03))
        chests.append(chest.moved(at(middle, side * (half - deep), 0, 90 * side)))
    inner = half - deep
    spans = [(side * inner, side * half) for side in {-1, 1} - set(sides)] + [(-inner, inner)]
    boards = [
        box((head, head + long), (min(y), max(y)), (0.03, high), *style.paint) for y in spans if abs(y[1] - y[0]) > 0.02
    ]
    board = box((0, head - 0.004), (-half, half), (0, high + rng.uniform(0.35, 0.7)), color, FABRIC)
    mattress = objects.cushion((long - 0.02, wide, 0.2), SHEET, 24.0, 9.0).moved(at(middle, 0, high + 0.104))
    top = high + 0.206
    blanket = objects.cushion((0.62 * long, wide - 0.04, 0.06), random_color(rng, 120, 240), 20.0, 9.0)
    cover = Piece("blanket", blanket.moved(at(head + 0.66 * long, 0, top + 0.03)))
    pillows = _pillows(rng, wide, 1 + (wide > 1.3), top, 0.3)
    return [Piece("bed", join(board, *boards, mattress)), *chests, cover, *pillows]


def _pillows(rng: np.random.Generator, wide: float, count: int, top: float, x: float) -> list[Piece]:
    each = wide / count
    size = (0.4, min(0.7, each - 0.08), rng.uniform(0.1, 0.16))
    return [
        objects.pillow(size, random_color(rng, 120, 240)).moved(
            at(x, (i + 0.5) * each - wide / 2, top + 0.002, rng.uniform(-3, 3))
        )
        for i in range(count)
    ]


def _framed_bed(width: float, length: float, cloth: Color) -> Piece:
    """Return a bed with an upholstered headboard at x = 0; its frame is 60 mm wider than its mattress [m]."""
    half, foot = width / 2 + 0.03, 0.06 + length + 0.03
    legs = _legs((0.08, foot - 0.08), half - 0.07, 0.16)
    rails = [box((0.06, foot), (y, y + 0.025), (0.16, 0.36), OAK, WOOD) for y in (-half, half - 0.025)]
    ends = [box((x, x + 0.025), (-half + 0.025, half - 0.025), (0.16, 0.36), OAK, WOOD) for x in (0.06, foot - 0.025)]
    slats = box((0.085, foot - 0.025), (-half + 0.025, half - 0.025), (0.22, 0.25), OAK, WOOD)
    mattress = objects.cushion((length, width, BED_TOP - 0.25), SHEET, 24.0, 9.0)
    head = [
        objects.cushion((0.06, (2 * half - 0.02) / 3, 0.62), cloth, 6.0, 6.0).moved(at(0.065, y, 0.76))
        for y in np.linspace(-1, 1, 3) * (2 * half) / 3
    ]
    board = box((0, 0.06), (-half, half), (0.05, 1.08), cloth, FABRIC)
    middle = at(0.075 + length / 2, 0, (BED_TOP + 0.25) / 2)
    return Piece("bed", join(board, *head, *legs, *rails, *ends, slats, mattress.moved(middle)))


def _duvet(rng: np.random.Generator, width: float, length: float, color: Color) -> Piece:
    """Return a thick blanket over the lower three quarters of a bed, which falls over both sides with soft folds."""
    long, thickness, fall = 0.68 * length, 0.035, 0.2
    half, phase = width / 2 + thickness + 0.004, rng.uniform(0, 2 * np.pi, 3)
    x, s = np.meshgrid(np.linspace(0, long, 33), np.linspace(-half - fall, half + fall, 49), indexing="ij")
    hanging = np.clip(np.abs(s) - half, 0, None)
    folds = 0.012 * (1 + np.sin(9 * x + phase[0] + np.sign(s))) * hanging / fall
    swell = 0.004 * (1 + np.sin(4 * x + phase[1]) * np.sin(5 * s + phase[2])) * (hanging == 0)
    y = np.sign(s) * (np.minimum(np.abs(s), half) + folds)
    cloth = _sheet(np.stack([x, y, thickness + 0.002 + swell - hanging], axis=-1), thickness, color)
    return Piece("blanket", cloth.moved(at(0.06 + 0.31 * length, 0, BED_TOP)))


def _sheet(points: np.ndarray, thickness: float, color: Color) -> Surface:
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
    return painted(np.concatenate([points.reshape(-1, 3), inner.reshape(-1, 3)]), faces, color, FABRIC)


def _sofa(width: float, seats: int, cloth: Color, name: str = "sofa") -> Piece:
    """Return a sofa 0.9 m deep and 0.82 m high with a cushion to sit on and one to lean on for each seat.

    Its back is at x = -0.9; the seats are 0.44 m high, the arms 0.6 m high and 0.18 m wide.
    """
    half, arm = width / 2, 0.18
    base = box((-0.88, -0.02), (-half + arm, half - arm), (0.12, 0.28), cloth, FABRIC)
    rest = box((-0.9, -0.72), (-half + arm, half - arm), (0.12, 0.74), cloth, FABRIC)
    arms = [
        objects.cushion((0.9, arm, 0.48), cloth, 14.0, 10.0).moved(at(-0.45, side * (half - arm / 2), 0.36))
        for side in (-1, 1)
    ]
    each = (width - 2 * arm) / seats
    middles = [-half + arm + each * (i + 0.5) for i in range(seats)]
    seat = objects.cushion((0.74, each - 0.006, 0.17), cloth, 14.0, 4.0)
    lean = objects.cushion((0.2, each - 0.012, 0.44), cloth, 8.0, 6.0).moved(rotation((0, -0.2, 0)))
    soft = [part for y in middles for part in (seat.moved(at(-0.36, y, 0.36)), lean.moved(at(-0.63, y, 0.62)))]
    return Piece(name, join(base, rest, *arms, *soft, *_legs((-0.84, -0.08), half - 0.09, 0.12)))


def armchair(cloth: Color) -> Piece:
    """Return an armchair, 0.95 m wide and 0.9 m deep; its back is at x = -0.9."""
    return _sofa(0.95, 1, cloth, "armchair")


def _legs(x: tuple[float, float], y: float, height: float) -> list[Surface]:
    """Return four square legs 5 cm thick about +-y at two depths [m]."""
    return [box((a - 0.025, a + 0.025), (b - 0.025, b + 0.025), (0, height), OAK, WOOD) for a in x for b in (-y, y)]


def sofa(rng: np.random.Generator, color: Color) -> tuple[Piece, float]:
    """Return a sofa with its back at x = 0, and its width [m]."""
    width = rng.uniform(1.5, 2.3)
    return _sofa(width, max(2, round((width - 0.36) / 0.75)), color).moved(at(0.9, 0)), width


def dining(rng: np.random.Generator, style: Style) -> list[Piece]:
    """Return a dining table about the origin, long along y, with chairs and what stands on it."""
    high, deep, long = rng.uniform(0.71, 0.76), rng.uniform(0.76, 1.0), rng.uniform(0.9, 2.0)
    x, y = deep / 2, long / 2
    top = box((-x, x), (-y, y), (high - 0.03, high), style.top, style.texture)
    legs = posts((0.03 - x, x - 0.09), (0.03 - y, y - 0.09), (0, high - 0.03), 0.06, style.top, style.texture)
    board = Board((-x + 0.05, x - 0.05), (-y + 0.05, y - 0.05), high, 0.5)
    things = clutter.fill(rng, board, style.top_theme, integer(rng, 1, 7))
    table = Piece("table", join(top, *legs), contents=things)
    seats = max(1, int((long - 0.1) / 0.58))
    places = (np.arange(seats) + 0.5) / seats * (long - 0.1) - (long - 0.1) / 2
    chairs = [
        objects.chair().moved(at(side * (x + rng.uniform(0.16, 0.3)), b, 0, 180 * (side > 0) + rng.uniform(-6, 6)))
        for side in (-1, 1)
        for b in places
        if chance(rng, 0.85)
    ]
    return [table, *chairs]


def coffee_table(rng: np.random.Generator, style: Style) -> list[Piece]:
    """Return a low table about the origin, some with a drawer, and what stands on it."""
    high, deep, wide = rng.uniform(0.4, 0.46), rng.uniform(0.45, 0.7), rng.uniform(0.6, 1.2)
    if chance(rng, 0.5):
        cells = (Cell(1.0, OPEN, 0), Cell(0.9, DRAWER))
        count = 1 + (wide > 0.9)
        base = Footing("legs", 0.1, 0.02, integer(rng, 0, 3))
        style = replace(style, theme="nothing", top_theme="bedroom")
        piece = cabinet(rng, "coffee table", (deep, wide, high), (Column(1.0, cells),) * count, style, base)
        return [piece.moved(at(-deep / 2, 0))]
    x, y = deep / 2, wide / 2
    legs = posts((-x, x - 0.05), (-y, y - 0.05), (0, 0.39), 0.05, objects.OAK, WOOD)
    shelf = box((-x + 0.02, x - 0.02), (-y + 0.02, y - 0.02), (0.14, 0.16), objects.OAK, WOOD)
    body = Piece("coffee table", join(*legs, shelf, box((-x, x), (-y, y), (0.39, 0.42), objects.OAK, WOOD)))
    board = Board((0.03 - deep / 2, deep / 2 - 0.03), (0.03 - wide / 2, wide / 2 - 0.03), 0.42, 0.4)
    return [replace(body, contents=clutter.fill(rng, board, "bedroom", integer(rng, 1, 4)))]


# Colours of sheet steel
STEELS: tuple[Color, ...] = (
    (196, 198, 202),
    (120, 124, 130),
    (58, 60, 64),
    (70, 92, 116),
    (150, 60, 54),
    (226, 224, 218),
)


def steel(rng: np.random.Generator, style: Style) -> Style:
    """Return a style of sheet steel: thin, painted, narrow reveals."""
    color = pick(rng, STEELS)
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
