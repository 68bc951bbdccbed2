"""Furnishing that rooms of every kind share: doors, windows, wall decoration, lamps, things on the floor.

Doors and windows fill an opening of a wall, whose face is at x = 0, centred in y, metres. Ranges: leaves 0.58 to 1.11 m wide
and 1.97 to 2.11 m high (DIN 18101 by baunetzwissen.de), 40 mm thick (groneck.net); levers 1.05 m above the floor (DIN 18255 by
hewi.com; montario.de on older doors that deviate), longer than 75 mm (baunetzwissen.de), 55 to 65 mm from the leaf's edge
(kleverkey.com). Common sizes: levers 0.036 to 0.05 m before the leaf, windows, sliding doors.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from s2a.homes import clutter, fronts, grips, objects
from s2a.homes import solids as p
from s2a.homes.floor_plan import Crowded, FloorPlan
from s2a.homes.fronts import BOTTOM, LEFT, RIGHT, Palette, hinged
from s2a.homes.grips import QUARTER, upright
from s2a.homes.room import Hole
from s2a.scene.scene import Joint

GLASS: p.Color = (120, 150, 165)


def lever(rng: np.random.Generator, side: int, color: p.Color) -> p.Piece:
    """Return a lever on a plate or a rose that points along y to a side (+1 or -1)."""
    length, thick, gap = rng.uniform(0.1, 0.15), rng.uniform(0.012, 0.02), rng.uniform(0.036, 0.05)
    turn = p.rotation((0, QUARTER, 0))
    half, low = rng.uniform(0.019, 0.026), rng.uniform(0.08, 0.16)
    plate = p.box((0, 0.008), (-half, half), (-low, 0.06), color)
    shield = p.cylinder(0.026, 0.01, color).moved(turn) if p.chance(rng, 0.5) else plate
    neck = p.cylinder(0.009, gap + thick / 2, color).moved(turn)
    wide = rng.uniform(0.016, 0.026)
    rod = p.prism(p.stadium(length, wide), (gap, gap + thick), color).moved(p.at(0, side * (length / 2 - wide / 2)))
    facts = {"family": "lever", "length": length, "width": wide, "depth": thick, "clearance": gap}
    return p.Piece("handle base", shield, (p.Piece("handle", p.join(neck, rod), style="lever", facts=facts),))


def room_door(
    rng: np.random.Generator, width: float, height: float, colors: tuple[p.Color, p.Color, p.Color]
) -> p.Piece:
    """Return a door in its frame that opens into the room; colours of the frame, the leaf and the metal."""
    paint, wood, metal = colors
    half, jamb = width / 2, rng.uniform(0.05, 0.07)
    frame = [p.box((-0.1, 0.014), (y, y + jamb), (0, height), paint) for y in (-half, half - jamb)]
    head = p.box((-0.1, 0.014), (-half + jamb, half - jamb), (height - jamb, height), paint)
    size = (rng.uniform(0.036, 0.044), width - 2 * jamb - 0.01, height - jamb - 0.013)
    side = p.pick(rng, (LEFT, RIGHT))
    at_hand = rng.uniform(0.95, 1.08) - size[2] / 2
    grip = lever(rng, side[0], metal).moved(p.at(0, -side[0] * (size[1] / 2 - rng.uniform(0.055, 0.08)), at_hand))
    panel = p.pick(rng, ("slab", "slab", "framed", "grooved", "glazed"))
    shape = fronts.front(panel, size, wood, p.WOOD, rng.uniform(0.1, 0.15))
    leaf = hinged("door", shape, side, grip, angle=rng.uniform(1.3, 1.6))
    # The leaf stands 4 mm before the wall's face: its edges pass the jambs.
    return p.Piece(
        "door frame", p.join(*frame, head), (leaf.tilted(rng, 0.1).moved(p.at(0.02, 0, 0.008 + size[2] / 2)),)
    )


def sliding_door(
    rng: np.random.Generator, width: float, height: float, colors: tuple[p.Color, p.Color, p.Color]
) -> p.Piece:
    """Return a door that hangs before the wall from a rail and slides to one side of its opening."""
    paint, wood, metal = colors
    side = p.pick(rng, (-1, 1))
    wide, high = width + 0.06, height - 0.01
    low, high_end = sorted((-side * wide / 2, side * (1.5 * wide + 0.03)))
    rail = p.box((0.0, 0.05), (low, high_end), (height + 0.01, height + 0.05), metal)
    shape = fronts.front(p.pick(rng, ("slab", "framed", "grooved")), (0.036, wide, high), wood, p.WOOD, 0.12)
    grip = grips.design(rng, "bar", "rail", "square", "bow", color=metal)
    grip = replace(grip, length=rng.uniform(0.16, 0.5))
    pull = upright(grips.make(grip)).moved(p.at(0, -side * (wide / 2 - 0.06), 1.02 - high / 2))
    travel = round(rng.uniform(0.8, 0.98) * width, 4)
    joint = Joint("prismatic", (0.0, float(side), 0.0), (0.0, 0.0, 0.0), (0.0, travel))
    leaf = p.Piece("sliding door", shape, (pull,), joint)
    return p.Piece("door frame", rail, (leaf.moved(p.at(0.048, 0, 0.006 + high / 2)),))


def window(rng: np.random.Generator, width: float, height: float, paint: p.Color, metal: p.Color) -> p.Piece:
    """Return a window of one or two sashes that turn into the room, or of one that tilts; its sill is at z = 0."""
    outer = ring(width, height, 0.05, (-0.08, 0.0), paint)
    inside = width - 0.07
    tilts = inside < 0.95 and p.chance(rng, 0.3)
    if inside > 1.0 and p.chance(rng, 0.6):
        halves = ((-inside / 4 - 0.001, LEFT), (inside / 4 + 0.001, RIGHT))
        sashes = [_sash(rng, inside / 2 - 0.006, height, side, paint, metal).moved(p.at(0, y)) for y, side in halves]
    else:
        side = BOTTOM if tilts else p.pick(rng, (LEFT, RIGHT))
        sashes = [_sash(rng, inside, height, side, paint, metal)]
    return p.Piece("window frame", outer, tuple(sashes))


def _sash(
    rng: np.random.Generator, wide: float, height: float, side: tuple[int, int], paint: p.Color, metal: p.Color
) -> p.Piece:
    high, rail = height - 0.07, rng.uniform(0.055, 0.075)
    frame = ring(wide, high, rail, (-0.045, 0.0), paint).moved(p.at(0, 0, -high / 2))
    y, z = wide / 2 - rail, high / 2 - rail
    pane = p.box((-0.036, -0.026), (-y, y), (-z, z), GLASS, dropout=0.8)
    if side is BOTTOM:
        grip, limit = lever(rng, 1, metal).moved(p.at(0, 0, high / 2 - 0.04)), rng.uniform(0.15, 0.3)
    else:
        grip = upright(lever(rng, -1, metal)).moved(p.at(0, -side[0] * (wide / 2 - rail / 2), 0))
        limit = rng.uniform(1.2, 1.57)
    grip = replace(grip, surface=p.box((0, 0.006), (-0.015, 0.015), (-0.035, 0.035), metal).moved(grip.pose))
    leaf = hinged("window", p.join(frame, pane), side, grip, angle=limit)
    return leaf.moved(p.at(0.022, 0, height / 2))


def ring(width: float, height: float, bar: float, x: tuple[float, float], color: p.Color) -> p.Surface:
    """Return four boards about a rectangle whose lower edge is at z = 0, centred in y."""
    half = width / 2
    uprights = [p.box(x, (y, y + bar), (0, height), color) for y in (-half, half - bar)]
    levels = [p.box(x, (-half + bar, half - bar), (z, z + bar), color) for z in (0, height - bar)]
    return p.join(*uprights, *levels)


Holes = dict[int, list[Hole]]
CORNER = 0.16  # [m] Least distance of an opening from a corner
PAINTS: tuple[p.Color, ...] = ((236, 236, 232), (222, 214, 196), (120, 90, 62), (80, 84, 88))


def doors(plan: FloorPlan, colors: Palette, count: int) -> Holes:
    """Place doors in walls, and return the holes for them; Crowded: there is no room for one of them."""
    holes: Holes = {}
    finish = (p.pick(plan.rng, PAINTS), p.pick(plan.rng, (colors.wood, colors.paint, PAINTS[0])), colors.metal)
    for _ in range(count):
        make = sliding_door if p.chance(plan.rng, 0.12) else room_door
        size = (plan.rng.uniform(0.74, 1.05), plan.rng.uniform(2.02, 2.16))
        piece = make(plan.rng, *size, finish)
        _open_wall(plan, holes, piece, size, 0.0, plan.room.size[2] - 0.1)
    return holes


def windows(plan: FloorPlan, colors: Palette, holes: Holes, count: int) -> None:
    """Place up to so many windows in walls and add their holes."""
    paint = p.pick(plan.rng, PAINTS)
    for _ in range(count):
        low, high = plan.rng.uniform(0.8, 1.15), plan.rng.uniform(0.8, 1.35)
        size = (plan.rng.uniform(0.6, 1.6), min(high, plan.room.size[2] - low - 0.25))
        piece = window(plan.rng, *size, paint, p.pick(plan.rng, (colors.metal, PAINTS[0])))
        try:
            _open_wall(plan, holes, piece, size, low, plan.room.size[2] - 0.15)
        except Crowded:
            return


def _open_wall(
    plan: FloorPlan, holes: Holes, piece: p.Piece, size: tuple[float, float], low: float, top: float
) -> None:
    """Place what fills an opening of given width and height in some wall, its lower edge at a height."""
    for _ in range(40):
        index = plan.some_side()
        side = plan.side(index)
        half = size[0] / 2
        if side.length < size[0] + 2 * CORNER or low + size[1] > min(top, side.height - 0.1) or _is_gable(plan, index):
            continue
        y = plan.rng.uniform(half + CORNER, side.length - half - CORNER)
        hole = (y - half, y + half, low, low + size[1])
        others = holes.setdefault(index, [])
        if any(hole[0] - 0.1 < other[1] and other[0] - 0.1 < hole[1] for other in others):
            continue
        if plan.put([piece], side.pose @ p.at(0, y, low), built_in=True):
            others.append(hole)
            others.sort()
            return
    raise Crowded


def _is_gable(plan: FloorPlan, index: int) -> bool:
    """Return whether a wall ends at a slope, which would cut its openings."""
    if plan.room.slope is None:
        return False
    count = len(plan.room.sides)
    return index in ((plan.room.slope[0] + 1) % count, (plan.room.slope[0] - 1) % count)


def hang(plan: FloorPlan, count: int, work: bool = False) -> None:
    """Hang pictures, mirrors, clocks, shelves or whiteboards on the walls."""
    rng = plan.rng
    for _ in range(count):
        kind = p.pick(rng, (*("picture",) * 3, "clock", "mirror", "shelf", "whiteboard" if work else "picture"))
        z = rng.uniform(1.2, 1.5)
        if kind == "picture":
            piece = objects.picture(rng, rng.uniform(0.25, 0.9), rng.uniform(0.25, 0.7))
        elif kind == "mirror":
            piece, z = objects.mirror(rng.uniform(0.35, 0.8), rng.uniform(0.5, 1.1)), rng.uniform(0.8, 1.1)
        elif kind == "clock":
            piece, z = objects.clock(), rng.uniform(1.75, 2.0)
        elif kind == "shelf":
            piece, z = _shelf(rng), rng.uniform(1.15, 1.6)
        else:
            piece, z = objects.whiteboard(rng.uniform(0.9, 1.8), rng.uniform(0.6, 1.0)), rng.uniform(0.9, 1.1)
        plan.against([piece.moved(p.at(0, 0, z))], gap=0.001, askew=0.0)


def _shelf(rng: np.random.Generator) -> p.Piece:
    """Return a wall shelf with things on it, one object."""
    width = rng.uniform(0.4, 1.1)
    board = clutter.Board((0.02, 0.21), (0.02 - width / 2, width / 2 - 0.02), 0.0, 0.35)
    things = clutter.fill(rng, board, p.pick(rng, ("living", "bedroom", "office")), p.integer(rng, 1, 4))
    shelf = objects.wall_shelf(width)
    return p.Piece(shelf.name, shelf.surface, contents=things)


def lamps(plan: FloorPlan) -> None:
    """Hang a lamp from the ceiling where nothing is in its way."""
    width, depth, height = plan.room.size
    for _ in range(12):
        x, y = plan.rng.uniform((0.3 * width, 0.3 * depth), (0.7 * width, 0.7 * depth))
        lamp = objects.ceiling_lamp()
        if p.chance(plan.rng, 0.5) and height > 2.45:
            lamp = objects.pendant_lamp(plan.rng.uniform(0.15, 0.3), plan.rng.uniform(0.12, 0.2))
        if plan.put([lamp], p.at(x, y, height - 0.001, plan.rng.uniform(0, 90))):
            return


def floor_objects(plan: FloorPlan, kinds: Sequence[str], count: int) -> None:
    """Stand things on the floor, mostly before walls."""
    rng = plan.rng
    for _ in range(count):
        piece = _floor_thing(rng, p.pick(rng, kinds))
        points = piece.surface.vertices
        low, high = points.min(axis=0), points.max(axis=0)
        piece = piece.moved(p.at(-low[0], -(low[1] + high[1]) / 2, -low[2]))
        if p.chance(rng, 0.75):
            plan.against([piece], askew=12, gap=0.03, attempts=4)
        else:
            plan.anywhere([piece], attempts=6)


def _floor_thing(rng: np.random.Generator, kind: str) -> p.Piece:
    if kind == "plant":
        return objects.plant(rng, rng.uniform(0.5, 1.3))
    if kind == "box":
        return objects.carton((rng.uniform(0.25, 0.4), rng.uniform(0.3, 0.5), rng.uniform(0.2, 0.4)))
    makers = {"bag": objects.bag, "chair": lambda r: objects.chair(), "basket": clutter.basket, "crate": clutter.crate}
    makers |= {"shoes": objects.slippers, "can": lambda r: objects.trash_can(), "lamp": lambda r: objects.floor_lamp()}
    makers |= {"tower": _tower, "tools": clutter.tool_box, "teddy": lambda r: objects.teddy()}
    return makers[kind](rng)


def _tower(rng: np.random.Generator) -> p.Piece:
    x, y, z = rng.uniform(0.18, 0.24), rng.uniform(0.08, 0.11), rng.uniform(0.35, 0.5)
    front = p.box((x, x + 0.003), (-0.6 * y, 0.6 * y), (0.6 * z, 0.9 * z), (70, 72, 78))
    return p.Piece("computer tower", p.join(p.box((-x, x), (-y, y), (0, z), (40, 40, 44)), front))


def sockets(plan: FloorPlan) -> None:
    """Place sockets low and switches at the height of a hand on the walls."""
    rng = plan.rng
    for _ in range(p.integer(rng, 2, 5)):
        half, deep = 0.04 * p.integer(rng, 1, 2), rng.uniform(0.008, 0.012)
        plate = p.box((0, deep), (-half, half), (-0.04, 0.04), (240, 240, 236))
        switch = p.chance(rng, 0.4)
        color: p.Color = (250, 250, 248) if switch else (190, 190, 188)
        inner = p.box((deep, deep + 0.004), (-0.7 * half, 0.7 * half), (-0.03, 0.03), color)
        name, z = ("light switch", 1.05) if switch else ("power socket", 0.3)
        plan.against([p.Piece(name, p.join(plate, inner)).moved(p.at(0, 0, z))], gap=0.0005, askew=0.0)


def heater(plan: FloorPlan) -> None:
    """Place a radiator at a wall."""
    plan.against([objects.heater(plan.rng.uniform(0.5, 1.4))], gap=0.002, askew=0.0)


def rug(plan: FloorPlan, color: p.Color) -> None:
    """Lay a rug on free floor."""
    size = (plan.rng.uniform(1.0, 1.9), plan.rng.uniform(0.7, 1.3))
    plan.anywhere([objects.rug(*size, color, (206, 200, 188))], attempts=12)
