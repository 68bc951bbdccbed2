"""Storage furniture: wardrobes, chests, TV benches, shelves; sliding doors; trunks, bins and baskets with lids.

Ranges: wardrobes 0.6 to 2.5 m wide, 0.55 to 0.65 m deep, 1.8 to 2.4 m high (choicewardrobe.co.uk), hinged doors 0.4 to 0.7 m
wide (almara.com.au); two sliding doors 0.9 to 2.4 m wide, three 1.35 to 3.6 m (almara.com.au), 0.54 to 0.7 m deep
(slidingdoorwardrobe.uk, joycekitchens.com.au); TV benches 1.0 to 1.5 m wide and wider, 0.35 to 0.5 m deep, 0.4 to 0.65 m high
(omnisizes.com, marvinbucknell.co.uk, home-and-garden.pro). Chests 0.4 to 1.6 m wide, 0.38 to 0.5 m deep and 0.55 to 1.3 m high
are common sizes around two that were opened (IKEA Malm: 0.80 x 0.48 x 0.78 m, robotics-handbook.net; 0.80 x 1.23 m, 1010uzu.com).
Common sizes: nightstands, sideboards, vitrines, shelves, shoe cabinets, an overlap of sliding doors of 20 to 50 mm, trunks 0.6 to
1.3 m wide, 0.38 to 0.55 m deep and high, bins 0.2 to 0.36 m across and 0.28 to 0.7 m high. Backs at x = 0. Doors of the rear
track have recessed pulls, past which those of the front track slide.
"""

from dataclasses import replace

import numpy as np

from s2a.homes import clutter, fronts, grips
from s2a.homes.casework import Cell, Column, Footing, cabinet, column, door_grips
from s2a.homes.clutter import Board
from s2a.homes.fronts import DRAWER, OPEN, Opening, Style, lid, open_box
from s2a.homes.solids import FABRIC, Color, Piece, at, box, chance, integer, join, lathe, pick
from s2a.scene.scene import Joint

CAP = (0.016, 0.03)  # Thickness of a top board [m]


def _base(rng: np.random.Generator, legs: tuple[float, float] = (0.06, 0.2), things: int = 4) -> Footing:
    on_legs = chance(rng, 0.5)
    height = rng.uniform(*(legs if on_legs else (0.04, 0.1)))
    return Footing("legs" if on_legs else "plinth", height, rng.uniform(*CAP), integer(rng, 0, things))


def _rows(rng: np.random.Generator, count: int) -> tuple[tuple[float, str], ...]:
    """Return drawers one above the other, often lower ones higher, from below."""
    lowest = rng.uniform(1.0, 1.5)
    return tuple((float(s), "drawer") for s in np.linspace(lowest, 1.0, count))


def chest(rng: np.random.Generator, style: Style) -> Piece:
    """Return a chest of one to three columns of drawers."""
    width, depth, height = rng.uniform(0.4, 1.6), rng.uniform(0.38, 0.5), rng.uniform(0.55, 1.3)
    columns = 1 + (width > 0.8) * int(chance(rng, 0.75)) + (width > 1.4)
    count = max(2, round(height / rng.uniform(0.17, 0.3)))
    each = tuple(column(1.0, *_rows(rng, count)) for _ in range(columns))
    return cabinet(rng, "chest of drawers", (depth, width, height), each, style, _base(rng))


def nightstand(rng: np.random.Generator, style: Style) -> Piece:
    """Return a nightstand: one to three drawers, or a drawer or a door with an open compartment."""
    size = rng.uniform(0.34, 0.46), rng.uniform(0.36, 0.6), rng.uniform(0.42, 0.68)
    door = (1.2, pick(rng, ("left", "right")))
    shelves = ((1.3, "open"), (1.0, "drawer")), ((1.0, "drawer"), (0.9, "open"))
    plans = (_rows(rng, integer(rng, 1, 3)), *shelves, (door, (0.7, "drawer")))
    return cabinet(rng, "nightstand", size, (column(1.0, *pick(rng, plans)),), style, _base(rng, (0.08, 0.25), 2))


def sideboard(rng: np.random.Generator, style: Style) -> Piece:
    """Return a low cabinet with doors and drawers in two to four columns."""
    size = rng.uniform(0.36, 0.5), rng.uniform(1.0, 2.2), rng.uniform(0.65, 0.95)
    count = max(2, round(size[1] / rng.uniform(0.42, 0.6)))
    each = [_mixed(rng) for _ in range(count)]
    each[integer(rng, 0, count - 1)] = column(1.0, *_rows(rng, integer(rng, 3, 4)))
    return cabinet(rng, "sideboard", size, tuple(each), style, _base(rng, (0.1, 0.22)))


def _mixed(rng: np.random.Generator) -> Column:
    """Return a column with a door, a drawer above a door, an open shelf, or drawers."""
    door = (2.5, pick(rng, ("left", "right")))
    weight = rng.uniform(0.9, 1.2)
    return column(weight, *pick(rng, ((door,), (door, (1.0, "drawer")), ((1.0, "open"),), _rows(rng, 3))))


def tv_bench(rng: np.random.Generator, style: Style) -> Piece:
    """Return a low bench with drawers, flaps and open compartments."""
    size = rng.uniform(0.36, 0.5), rng.uniform(0.9, 2.2), rng.uniform(0.4, 0.62)
    count = max(2, round(size[1] / rng.uniform(0.45, 0.7)))
    kinds = (((1.0, "drawer"),), ((1.0, "down"),), ((1.0, "open"),), ((1.0, "drawer"), (0.8, "open")), ((1.0, "up"),))
    each = [column(rng.uniform(0.9, 1.2), *pick(rng, kinds)) for _ in range(count)]
    each[0] = column(1.0, (1.0, "drawer"))
    base = replace(_base(rng, (0.06, 0.16)), clutter=integer(rng, 0, 2))
    return cabinet(rng, "tv stand", size, tuple(each), style, base)


def vitrine(rng: np.random.Generator, style: Style) -> Piece:
    """Return a tall cabinet with glazed doors above drawers or wooden doors."""
    size = rng.uniform(0.34, 0.45), rng.uniform(0.5, 1.1), rng.uniform(1.4, 2.05)
    kind = "pair" if size[1] > 0.65 else pick(rng, ("left", "right"))
    glass = Cell(rng.uniform(2.0, 3.0), Opening(kind, panel="glazed"))
    below = pick(rng, ((Cell(1.0, Opening(kind, panel="framed")),), (Cell(0.5, DRAWER), Cell(0.5, DRAWER))))
    return cabinet(rng, "cabinet", size, (*below, glass), style, _base(rng, (0.05, 0.15), 1))


def shelf(rng: np.random.Generator, style: Style) -> Piece:
    """Return open shelves in one to four columns, with drawers or doors as inserts in some cells."""
    size = rng.uniform(0.28, 0.4), rng.uniform(0.45, 1.6), rng.uniform(0.8, 2.1)
    columns, rows = max(1, round(size[1] / 0.42)), max(2, round(size[2] / 0.38))
    inserts = ("open", "open", "open", "drawer", "left", "right")
    cells = [tuple(Cell(1.0, Opening(pick(rng, inserts)), 0) for _ in range(rows)) for _ in range(columns)]
    each = tuple(Column(1.0, column) for column in cells)
    name = "bookshelf" if style.theme == "office" else "shelf"
    return cabinet(rng, name, size, each, style, Footing("plinth", rng.uniform(0.04, 0.08), 0.0, integer(rng, 0, 2)))


def wardrobe(rng: np.random.Generator, style: Style) -> Piece:
    """Return a wardrobe with hinged doors, inner drawers, open compartments, mirrors."""
    size = rng.uniform(0.55, 0.65), rng.uniform(0.6, 2.5), rng.uniform(1.8, 2.36)
    count = max(1, round(size[1] / rng.uniform(0.42, 0.6)))
    each = []
    for i in range(count):
        door = Opening("left" if i % 2 == 0 else "right", panel="mirror" if chance(rng, 0.12) else None)
        drawers = tuple(Cell(0.5, DRAWER) for _ in range(integer(rng, 1, 3)))
        whole = (Cell(1.0, door),)
        kinds = (whole, whole, (*drawers, Cell(3.2, door)), (*drawers, Cell(2.5, OPEN, 2)))
        each.append(Column(1.0, pick(rng, kinds)))
    base = Footing("plinth", rng.uniform(0.04, 0.1), 0.0, integer(rng, 0, 1))
    return cabinet(rng, "wardrobe", size, tuple(each), style, base)


def hall_cabinet(rng: np.random.Generator, style: Style) -> Piece:
    """Return a shallow shoe cabinet whose flaps tip forward (0.17 to 0.35 m deep), or one with doors."""
    size = rng.uniform(0.24, 0.36), rng.uniform(0.5, 1.2), rng.uniform(0.6, 1.25)
    tip = tuple(Cell(1.0, Opening("down", limit=rng.uniform(0.6, 0.9)), 0) for _ in range(integer(rng, 2, 3)))
    plain = (Cell(2.6, Opening("pair" if size[1] > 0.7 else "left"), 2), Cell(0.7, DRAWER))
    cells = tip if chance(rng, 0.5) else plain
    count = max(1, round(size[1] / 0.7)) if cells is tip else 1
    return cabinet(rng, "shoe cabinet", size, (Column(1.0, cells),) * count, style, _base(rng, (0.05, 0.15), 3))


PLAY = 0.008  # Between the tracks, and between doors and cabinet body [m]


def sliding_wardrobe(rng: np.random.Generator, style: Style) -> Piece:
    """Return a wardrobe with two or three doors that slide past each other."""
    size = rng.uniform(0.6, 0.68), rng.uniform(1.2, 2.6), rng.uniform(1.9, 2.36)
    count = 3 if size[1] > 1.9 and chance(rng, 0.6) else 2
    base = Footing("plinth", rng.uniform(0.04, 0.08))
    deep = size[0] - 2 * (style.thick + PLAY)
    inside = tuple(Column(1.0, (Cell(1.0, OPEN, integer(rng, 1, 4)),)) for _ in range(count))
    body = cabinet(rng, "wardrobe", (deep + style.thick + 0.002, *size[1:]), inside, style, base)
    overlap = rng.uniform(0.02, 0.05)
    wide, high = (size[1] + (count - 1) * overlap) / count, size[2] - base.height - 2 * PLAY
    doors = []
    for i in range(count):
        ahead = i % 2 == 1
        # The outer doors slide inwards; the one in the middle to either side.
        towards = 1 if i == 0 else -1 if i == count - 1 else pick(rng, (-1, 1))
        front = _door(rng, (style.thick, wide, high), -towards, ahead, style, base.height + PLAY + high / 2)
        x = size[0] if ahead else size[0] - style.thick - PLAY
        y = -size[1] / 2 + wide / 2 + i * (wide - overlap)
        doors.append(front.moved(at(x, y, base.height + PLAY + high / 2)))
    return replace(body, children=tuple(doors))


def _door(rng: np.random.Generator, size: fronts.Size, edge: int, ahead: bool, style: Style, height: float) -> Piece:
    """Return a door whose handle is near its edge at y = edge * width / 2 and that slides the other way."""
    grip = grips.design(rng, *(("bar", "rail", "square", "recess") if ahead else ("recess",)), color=style.grip.color)
    # A leaf that is hinged at the other edge has its handle here.
    handles, pocket = door_grips(grip, (-edge, 0), size, height, rng.uniform(0.04, 0.07))
    plain = fronts.front(pick(rng, ("slab", "mirror", "grooved")), size, style.front, style.texture, style.frame)
    shape = plain if pocket is None else fronts.pocketed(size, pocket, 0.0135, style.front, style.texture)
    travel = round(rng.uniform(0.75, 0.9) * size[1], 4)
    joint = Joint("prismatic", (0.0, float(-edge), 0.0), (0.0, 0.0, 0.0), (0.0, travel))
    return Piece("sliding door", shape, handles, joint)


def trunk(rng: np.random.Generator, style: Style, name: str = "trunk") -> Piece:
    """Return a trunk or bench whose lid turns up about its back edge by 70 to 95 degrees."""
    size = rng.uniform(0.38, 0.55), rng.uniform(0.6, 1.3), rng.uniform(0.38, 0.55)
    return _chest(rng, style, size, name, rng.uniform(0.02, 0.04))


def hamper(rng: np.random.Generator, style: Style) -> Piece:
    """Return a laundry hamper with a lid."""
    size = rng.uniform(0.32, 0.42), rng.uniform(0.36, 0.6), rng.uniform(0.5, 0.68)
    woven = replace(style, body=(188, 158, 116), front=(176, 144, 98), texture=FABRIC)
    return _chest(rng, woven, size, "laundry basket", rng.uniform(0.014, 0.02))


def _chest(rng: np.random.Generator, style: Style, size: tuple[float, float, float], name: str, thick: float) -> Piece:
    """Return an open box with a lid that stands over its front by 15 mm, pulled there or at its front edge."""
    deep, wide, high = size
    rise = 0.003
    body = open_box((deep, wide, high - thick - rise), style.board, *style.paint).moved(at(deep / 2, 0))
    angle = float(np.radians(rng.uniform(70, 92)))
    # In the frame of an upright front whose upper edge is hinged: x is up, z is back.
    board = box((-deep / 2, deep / 2 + 0.015), (-wide / 2, wide / 2), (-thick, 0), style.front, style.texture)
    cover = lid("lid", board, *_lid_grips(rng, style, deep, wide), angle=angle)
    wall = style.board
    inside = Board((wall, deep - wall), (-wide / 2 + wall, wide / 2 - wall), wall, high - thick - 0.04)
    things = clutter.fill(rng, inside, style.theme, integer(rng, 0, 4))
    return Piece(name, body, (cover.moved(at(deep / 2, 0, high)),), contents=things)


def _lid_grips(rng: np.random.Generator, style: Style, deep: float, wide: float) -> tuple[Piece, ...]:
    """Return a handle on top of a lid, near its front edge."""
    family = style.grip.family if style.grip.family in ("bar", "rail", "square", "bow", "knob", "strap") else "bow"
    if chance(rng, 0.1):
        return ()
    grip = grips.design(rng, family, color=style.grip.color).fitted(0.5 * wide)
    return (grips.make(grip).moved(at(0, 0, -deep / 2 + 0.02 + grip.width / 2)),)


def bin_(rng: np.random.Generator) -> Piece:
    """Return a round waste bin with a lid that turns up, and a pedal or a knob."""
    radius, high = rng.uniform(0.1, 0.18), rng.uniform(0.28, 0.7)
    color: Color = pick(rng, ((196, 198, 200), (60, 62, 66), (230, 228, 220), (150, 52, 48)))
    wall, top = 0.006, high - 0.035
    body = lathe([(0, 0), (radius, 0), (radius, top), (radius - wall, top), (radius - wall, wall), (0, wall)], color)
    pedal = box((radius - 0.01, radius + 0.04), (-0.03, 0.03), (0.01, 0.022), (40, 40, 44))
    cover = lathe([(0, -0.03), (radius, -0.03), (radius, -0.012), (0.8 * radius, 0), (0, 0)], color)
    handles: tuple[Piece, ...] = ()
    if chance(rng, 0.6):
        knob = grips.make(grips.design(rng, "knob", "bow").fitted(radius))
        handles = (knob.moved(at(0, 0, -0.45 * radius)),)
    cover_piece = lid("trash can lid", cover, *handles, angle=rng.uniform(1.2, 1.5))
    whole = Piece("trash can", join(body, pedal), (cover_piece.moved(at(0, 0, high - 0.003)),))
    return whole.moved(at(radius, 0))
