"""Cabinets of any size from columns of cells: drawers, doors, flaps, shelves.

Local frame: back at x = 0, centred in y, floor at z = 0, metres. One builder makes kitchen units, wardrobes,
chests, lockers and the like: a family (`s2a.homes.storage` and its like) only draws its numbers.
Fronts lie before the cabinet body (full overlay), as wide as their cells but for the gaps between them.
"""

from dataclasses import dataclass, replace

import numpy as np

from s2a.homes import clutter, fronts, grips
from s2a.homes.clutter import Board
from s2a.homes.fronts import BOTTOM, LEFT, RIGHT, TOP, Opening, Side, Style, cabinet_body, hinged
from s2a.homes.grips import GripDesign, upright
from s2a.homes.solids import Piece, Surface, at, box, chance, integer, join, posts
from s2a.scene.scene import Joint

HANDLE_HEIGHT = 1.05  # [m] Height above the floor at which handles of doors are put if the door reaches there
Grips = tuple[tuple[Piece, ...], fronts.Pocket | None]


def level_grips(rng: np.random.Generator, grip: GripDesign, wide: float, high: float, place: float) -> Grips:
    """Return the handles of a drawer: one in its middle, or, on some wide ones, two."""
    if grip.family == "none" or high < 0.05:
        return (), None
    grip = replace(grip.fitted(0.8 * wide), width=min(grip.width, 0.6 * high))
    if grip.family == "knob":
        grip = grip.fitted(0.5 * high)
    if grip.family == "edge":
        return (grips.make(grip).moved(at(0, 0, high / 2)),), None
    z = place * max(0.0, high / 2 - 0.035 - grip.width / 2)
    if grip.family == "recess":
        return (grips.make(grip).moved(at(0, 0, z)),), _pocket(grip, 0.0, z)
    if wide > 0.75 and grip.length < 0.3 * wide and chance(rng, 0.3):
        return tuple(grips.make(grip).moved(at(0, y, z)) for y in (-0.28 * wide, 0.28 * wide)), None
    return (grips.make(grip).moved(at(0, 0, z)),), None


def door_grips(grip: GripDesign, side: Side, size: fronts.Size, height: float, inset: float) -> Grips:
    """Return the upright handle of a door whose middle is at a height above the floor [m]."""
    _, wide, high = size
    if grip.family == "none":
        return (), None
    grip = grip.fitted(0.45 * high)
    reach = max(0.0, high / 2 - grip.length / 2 - 0.04)
    z = float(np.clip(HANDLE_HEIGHT - height, -reach, reach))
    free = -side[0] * wide / 2
    turned = upright(grips.make(grip)) if grip.family != "cup" else grips.make(grip)
    if grip.family == "edge":
        turned = grips.make(grip).moved(_roll(side[0] * np.pi / 2))
        return (turned.moved(at(0, free, z)),), None
    y = free + side[0] * max(min(inset, wide / 3), grip.width / 2 + 0.012)
    if grip.family == "recess":
        return (turned.moved(at(0, y, z)),), _pocket(replace(grip, length=grip.width, width=grip.length), y, z)
    return (turned.moved(at(0, y, z)),), None


def flap_grips(grip: GripDesign, side: Side, size: fronts.Size) -> Grips:
    """Return the handle of a flap near the edge across from its hinge."""
    _, wide, high = size
    if grip.family == "none":
        return (), None
    grip = replace(grip.fitted(0.7 * wide), width=min(grip.width, 0.5 * high))
    if grip.family == "edge":
        turn = np.eye(4) if side is BOTTOM else _roll(np.pi)
        return (grips.make(grip).moved(turn).moved(at(0, 0, -side[1] * high / 2)),), None
    z = -side[1] * max(0.0, high / 2 - 0.03 - grip.width / 2)
    return (grips.make(grip).moved(at(0, 0, z)),), _pocket(grip, 0.0, z) if grip.family == "recess" else None


def _pocket(grip: GripDesign, y: float, z: float) -> fronts.Pocket:
    """Return the hole of a front that a recessed pull lines."""
    half, up = grip.length / 2 + 0.0003, grip.width / 2 + 0.0003
    return (y - half, y + half, z - up, z + up)


def _roll(angle: float) -> np.ndarray:
    turn = np.eye(4)
    turn[1:3, 1:3] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return turn


# Where a leaf has its hinge, by its kind; left and right as seen by who stands before it
SIDES: dict[str, Side] = {"left": LEFT, "right": RIGHT, "up": TOP, "down": BOTTOM}
ASKEW = 0.0004  # [m] Farthest that a corner of a front hangs out of place
Span = tuple[float, float]


def close(rng: np.random.Generator, opening: Opening, y: Span, z: Span, depth: float, style: Style) -> list[Piece]:
    """Return the fronts of a cell, in the cabinet's frame.

    Args:
        rng: how askew they hang, and what is in a drawer.
        opening: their kind.
        y: the cell from right to left, gaps included [m].
        z: from below, gaps included [m].
        depth: of the cabinet: where its fronts' faces lie [m].
        style: materials and handles.
    """
    if opening.kind == "open":
        return []
    if opening.kind == "pair":
        middle = (y[0] + y[1]) / 2
        halves = ((y[0], middle), "left"), ((middle, y[1]), "right")
        return [f for span, kind in halves for f in close(rng, replace(opening, kind=kind), span, z, depth, style)]
    drawer = opening.kind == "drawer"
    level = opening.kind in ("drawer", "up", "down", "rise", "fixed")
    grip = opening.grip or (style.grip if level else style.door_grip)
    wide = y[1] - y[0] - style.gap - (0.0 if level else grip.rim)
    high = z[1] - z[0] - style.gap - (grip.rim if level else 0.0)
    size = (opening.thick or style.thick, wide, high)
    aside = 0.0 if level else SIDES[opening.kind][0] * grip.rim / 2
    centre = at(depth, sum(y) / 2 + aside, sum(z) / 2 - (grip.rim / 2 if level else 0.0))
    if drawer:
        front = _drawer(rng, opening, size, depth, grip, style)
    elif opening.kind == "rise":
        return _shutter(opening, size, grip, style, centre)
    elif opening.kind == "fixed":
        return [Piece("panel", _panel(opening, size, style, None, style.panel)).moved(centre)]
    else:
        front = _leaf(opening, size, grip, style, centre[2, 3])
    tilt = float(np.degrees(ASKEW / (max(size[1:]) / 2)))
    return [front.tilted(rng, tilt).moved(centre)]


def _drawer(
    rng: np.random.Generator, opening: Opening, size: fronts.Size, depth: float, grip: GripDesign, style: Style
) -> Piece:
    """Return a drawer: panel, tray, handles, and what lies in it."""
    thick, wide, high = size
    handles, pocket = level_grips(rng, grip, wide, high, style.place)
    length = depth - thick - style.board - 0.014
    across, up = wide - 0.06, max(0.03, min(high - 0.05, 0.3))
    limit = opening.limit or round(style.extension * length, 4)
    shape = join(_panel(opening, size, style, pocket, style.drawer_panel), _tray(thick, length, across, up))
    inside = Board(
        (-thick - length + 0.01, -thick - 0.01), (-across / 2 + 0.008, across / 2 - 0.008), 0.002 - up / 2, up
    )
    things = clutter.fill(rng, inside, style.drawer_theme, integer(rng, 0, 4))
    joint = Joint("prismatic", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, min(limit, length)))
    facts = {"soft_close": style.soft_close}
    return Piece(opening.name or "drawer", shape, handles, joint, contents=things, facts=facts)


def _tray(thick: float, length: float, across: float, up: float) -> Surface:
    wood, back, y, z = (205, 186, 150), -thick - length, across / 2, up / 2
    return join(
        box((back, -thick), (-y, -y + 0.006), (-z, z), wood),
        box((back, -thick), (y - 0.006, y), (-z, z), wood),
        box((back, back + 0.006), (-y, y), (-z, z), wood),
        box((back, -thick), (-y, y), (-z, -z + 0.002), wood),
    )


def _leaf(opening: Opening, size: fronts.Size, grip: GripDesign, style: Style, height: float) -> Piece:
    side = SIDES[opening.kind]
    if side[0]:
        handles, pocket = door_grips(grip, side, size, height, style.inset)
    else:
        handles, pocket = flap_grips(grip, side, size)
    shape = _panel(opening, size, style, pocket, style.panel)
    name = opening.name or ("door" if side[0] else "flap")
    limit = opening.limit or (style.angle if side[0] else min(style.angle, 1.5))
    facts = {"soft_close": style.soft_close}
    return replace(hinged(name, shape, side, *handles, angle=limit), facts=facts)


def _shutter(opening: Opening, size: fronts.Size, grip: GripDesign, style: Style, centre: np.ndarray) -> list[Piece]:
    """Return a fixed upper half, and behind its plane a lower half that slides up."""
    thick, wide, high = size
    low, up = 0.55 * high, 0.45 * high - style.gap
    fixed = Piece("panel", fronts.front(style.panel, (0.5 * thick, wide, up), style.front, style.texture, style.frame))
    handles, _ = flap_grips(replace(grip, clearance=min(grip.clearance, 0.02)), TOP, (thick, wide, low))
    shape = fronts.front(
        "grooved", (0.35 * thick, wide - 2 * style.board - 0.008, low), style.front, style.texture, 0.0
    )
    behind = at(-0.5 * thick - 0.002, 0)
    # The handle must stay below the fixed half.
    limit = min(up, low - grip.width - 0.06)
    joint = Joint("prismatic", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, round(limit, 4)))
    moving = Piece(opening.name or "shutter", shape.moved(behind), tuple(h.moved(behind) for h in handles), joint)
    return [fixed.moved(centre @ at(0, 0, (high - up) / 2)), moving.moved(centre @ at(0, 0, (low - high) / 2))]


def _panel(opening: Opening, size: fronts.Size, style: Style, pocket: fronts.Pocket | None, panel: str) -> Surface:
    """Return the panel of a front, with a pocket for a recessed pull where it has one."""
    color = opening.color or style.front
    if pocket is not None:
        return fronts.pocketed(size, pocket, 0.0135, color, style.texture)
    return fronts.front(opening.panel or panel, size, color, style.texture, style.frame)


@dataclass(frozen=True)
class Cell:
    """One compartment of a column."""

    weight: float  # its height, relative to those of the column's other cells
    opening: Opening  # what closes it
    shelves: int | None = None  # boards inside; None: as many as usual for its height


@dataclass(frozen=True)
class Column:
    """Cells one above the other, from below."""

    weight: float  # its width, relative to those of the cabinet's other columns
    cells: tuple[Cell, ...]  # from below


@dataclass(frozen=True)
class Footing:
    """The base and the top board of a cabinet."""

    kind: str  # "plinth", "legs" or "none"
    height: float  # of plinth or legs [m]
    cap: float = 0.0  # thickness of a top board that covers the fronts [m]; 0: none
    clutter: int = 0  # number of objects that stand on it
    open_top: bool = False  # The cabinet body is open above, as under a sink


def column(weight: float, *cells: tuple[float, str]) -> Column:
    """Return a column of plain cells, each given by its weight in the height and its kind."""
    return Column(weight, tuple(Cell(height, Opening(kind)) for height, kind in cells))


def cabinet(
    rng: np.random.Generator,
    name: str,
    size: tuple[float, float, float],
    columns: tuple[Column, ...] | tuple[Cell, ...],
    style: Style,
    base: Footing,
) -> Piece:
    """Return a cabinet with its fronts, and with what stands in and on it.

    Args:
        rng: how askew its fronts hang, and what is in it.
        name: what it is called.
        size: depth with fronts but without handles, width and height [m].
        columns: from right to left, as y grows; of a single column its cells alone.
        style: materials, handles, reveals.
        base: what carries and covers it.
    """
    depth, width, height = size
    deep, span = depth - style.thick - 0.002, (base.height, height - base.cap)
    cells = tuple(c for c in columns if isinstance(c, Cell))
    parts = (Column(1.0, cells),) if cells else tuple(c for c in columns if isinstance(c, Column))
    edges = np.cumsum([0.0, *(c.weight for c in parts)]) / sum(c.weight for c in parts) * width - width / 2
    shell = cabinet_body((deep, width, span[1] - span[0]), style.board, *style.paint)
    boards = [board.moved(at(deep, 0, span[0])) for board in (shell[:4] if base.open_top else shell)]
    boards += [box((0, deep), (y - style.board / 2, y + style.board / 2), span, *style.paint) for y in edges[1:-1]]
    boards += _base(size, style, base)
    fronts: list[Piece] = []
    contents: list[Piece] = []
    for left, right, each in zip(edges[:-1], edges[1:], parts, strict=True):
        inner = (left + style.board * (0.5 + (left == edges[0])), right - style.board * (0.5 + (right == edges[-1])))
        for z, cell, divided in _levels(each, span):
            # The lowest board lies within its cell, those between cells half in each.
            floor = z[0] + style.board * (1.0 if z[0] == span[0] else 0.5)
            inside = Board((style.board, deep), inner, floor, z[1] - style.board - floor)
            fronts += close(rng, cell.opening, (left, right), z, depth, style)
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


def _base(size: tuple[float, float, float], style: Style, base: Footing) -> list[Surface]:
    depth, half, height = size[0], size[1] / 2, size[2]
    boards = []
    if base.cap:
        boards.append(box((0, depth + 0.004), (-half, half), (height - base.cap, height), style.top, style.texture))
    if base.kind == "plinth":
        boards.append(box((0.02, depth - 0.05), (-half + 0.001, half - 0.001), (0, base.height), style.dark))
    elif base.kind == "legs":
        wide = min(0.045, size[1] / 8)
        x, y = (0.02, depth - style.thick - 0.03 - wide), (0.02 - half, half - 0.02 - wide)
        boards += posts(x, y, (0, base.height), wide, style.dark)
    return boards
