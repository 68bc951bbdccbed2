"""Kitchen appliances and a washing machine. Local frames: back on the wall x = 0, centred in y, front towards +x, metres."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from s2a.homes.fronts import BOTTOM, GAP, LEFT, Pull, Side, door_bar, hinged, panel
from s2a.homes.furniture import cabinet_body, drawer
from s2a.homes.handles import QUARTER, STEEL, bar, cup, edge
from s2a.homes.kitchen_units import DARK, FRONT, FRONT_TOP, PLINTH, THICK, base_body
from s2a.homes.solids import PLAIN, Color, Piece, Surface, at, box, cylinder, join, lathe, rotation

GLASS: Color = (30, 32, 36)
WHITE: Color = (232, 232, 230)
METAL: Color = (172, 174, 178)


def refrigerator(rng: np.random.Generator, side: Side, color: Color = WHITE) -> Piece:
    """Return a fridge above a freezer, 0.6 m wide, 0.65 m deep, 1.85 m high, both doors hinged at the same side."""
    deep, wide, high, thick, split = 0.65, 0.6, 1.85, 0.06, 0.68
    front = deep - thick - 0.004
    body = [board.moved(at(front, 0, 0.03)) for board in cabinet_body((front, wide, high - 0.03), 0.04, color)]
    boards = [box((0.04, front - 0.03), (-0.26, 0.26), (z, z + 0.012), METAL) for z in (0.3, 1.0, 1.3, 1.55)]
    shelf = box((0.04, front), (-0.26, 0.26), (split - 0.02, split + 0.02), color)
    foot = box((0.03, front - 0.03), (-0.28, 0.28), (0, 0.03), DARK)
    leaves = []
    for name, low, top, z in (("freezer door", 0.05, split, 0.12), ("refrigerator door", split + 0.008, high, -0.3)):
        shape = panel((thick, wide, top - low), color)
        leaf = hinged(name, shape, side, door_bar(side, wide, z, 0.34 if z < 0 else 0.26, STEEL))
        leaves.append(leaf.tilted(rng, 0.1).moved(at(deep, 0, (low + top) / 2)))
    return Piece("refrigerator", join(*body, *boards, shelf, foot), tuple(leaves))


def oven(rng: np.random.Generator, width: float = 0.6) -> Piece:
    """Return a built-in oven: four dials, a door that tips forward about its lower edge, and a drawer below it."""
    low, high, wide = 0.275, 0.735, width - GAP
    cavity = [
        board.moved(at(0.545, 0, 0.27)) for board in cabinet_body((0.515, width - 0.05, 0.46), 0.02, (60, 60, 64))
    ]
    fascia = box((0.52, FRONT), (-wide / 2, wide / 2), (high + GAP, FRONT_TOP - GAP), METAL)
    dials = [
        cylinder(0.02, 0.022, DARK).moved(at(FRONT, y, 0.8) @ rotation((0, QUARTER, 0)))
        for y in (-0.22, -0.12, 0.12, 0.22)
    ]
    display = box((FRONT, FRONT + 0.002), (-0.06, 0.06), (0.78, 0.82), GLASS, dropout=0.2)
    grip = bar(0.46, 0.018, 0.014, 0.03, 0.016).moved(at(0, 0, (high - low) / 2 - 0.05))
    leaf = hinged("oven door", _glazed((0.03, wide, high - low), (0.09, 0.07)), BOTTOM, grip)
    tall = low - PLINTH - 2 * GAP
    pull = edge(0.4).moved(at(0, 0, tall / 2))
    tray = drawer((THICK, wide, tall), (width - 0.07, tall - 0.06), pull, METAL, PLAIN)
    parts = (
        leaf.tilted(rng, 0.1).moved(at(FRONT, 0, (low + high) / 2)),
        tray.tilted(rng, 0.1).moved(at(FRONT, 0, PLINTH + GAP + tall / 2)),
    )
    return Piece("oven", join(base_body(width, WHITE, 0.03), *cavity, fascia, *dials, display), parts)


def _glazed(size: tuple[float, float, float], border: tuple[float, float], color: Color = METAL) -> Surface:
    """Return a board with a pane of dark glass let into its face; `border` is what stays around it along y and z [m]."""
    thick, y, z = size[0], size[1] / 2, size[2] / 2
    inner_y, inner_z = y - border[0], z - border[1]
    frame = [
        box((-thick, 0), (-y, y), (-z, -inner_z), color),
        box((-thick, 0), (-y, y), (inner_z, z), color),
        box((-thick, 0), (-y, -inner_y), (-inner_z, inner_z), color),
        box((-thick, 0), (inner_y, y), (-inner_z, inner_z), color),
    ]
    return join(*frame, box((-thick, -0.003), (-inner_y, inner_y), (-inner_z, inner_z), GLASS, dropout=0.3))


def dishwasher(rng: np.random.Generator, pull: Pull, color: Color, texture: int = PLAIN) -> Piece:
    """Return a dishwasher, 0.6 m wide: a strip of keys above a kitchen front that tips forward about its lower edge."""
    wide, low, high = 0.6 - GAP, 0.14, 0.8
    body = [board.moved(at(0.555, 0, 0.12)) for board in cabinet_body((0.53, 0.596, 0.735), 0.025, METAL)]
    racks = [box((0.06, 0.53), (-0.25, 0.25), (z, z + 0.02), (110, 112, 118)) for z in (0.25, 0.52)]
    plinth = box((0.02, 0.51), (-0.3, 0.3), (0, 0.12), DARK)
    fascia = box((0.535, FRONT), (-wide / 2, wide / 2), (high + 2 * GAP, FRONT_TOP - GAP), METAL)
    keys = [box((FRONT, FRONT + 0.003), (y, y + 0.02), (0.828, 0.838), DARK) for y in (0.1, 0.14, 0.18, 0.22)]
    tall = high - low
    leaf = hinged("dishwasher door", panel((0.024, wide, tall), color, texture), BOTTOM, pull(wide, tall))
    return Piece(
        "dishwasher",
        join(*body, *racks, plinth, fascia, *keys),
        (leaf.tilted(rng, 0.1).moved(at(FRONT, 0, low + tall / 2)),),
    )


def microwave(rng: np.random.Generator) -> Piece:
    """Return a microwave oven, 0.48 m wide, 0.28 m high, 0.36 m deep, standing on z = 0; its door opens to the left."""
    deep, wide, high = 0.34, 0.48, 0.28
    shell = [board.moved(at(deep - 0.026, 0, 0.01)) for board in cabinet_body((deep - 0.026, wide, high), 0.012, METAL)]
    feet = [box((x, x + 0.03), (y, y + 0.03), (0, 0.01), DARK) for x in (0.02, 0.26) for y in (-0.22, 0.19)]
    keys = join(
        box((0.02, deep - 0.026), (wide / 2 - 0.11, wide / 2 - 0.013), (0.023, high - 0.003), DARK),
        box((deep - 0.026, deep), (wide / 2 - 0.11, wide / 2), (0.01, 0.01 + high), DARK),
    )
    clock = box((deep, deep + 0.001), (wide / 2 - 0.095, wide / 2 - 0.015), (0.225, 0.265), (60, 120, 90))
    dial = cylinder(0.022, 0.018, METAL).moved(at(deep, wide / 2 - 0.055, 0.08) @ rotation((0, QUARTER, 0)))
    door = (wide - 0.11 - GAP, high - 0.008)
    grip = door_bar(LEFT, door[0], 0.0, 0.17, STEEL)
    leaf = hinged("microwave door", _glazed((0.022, *door), (0.075, 0.045)), LEFT, grip)
    leaf = leaf.tilted(rng, 0.1).moved(at(deep, -wide / 2 + door[0] / 2, 0.01 + high / 2))
    return Piece("microwave", join(*shell, *feet, keys, clock, dial), (leaf,))


def hob() -> Piece:
    """Return a glass-ceramic hob with four zones, centred on the origin, that lies on a worktop at z = 0."""
    glass = box((-0.25, 0.25), (-0.29, 0.29), (0, 0.006), GLASS)
    zones = [
        cylinder(radius, 0.007, (70, 70, 74)).moved(at(x, y))
        for x, y, radius in ((-0.11, -0.14, 0.09), (-0.11, 0.14, 0.07), (0.11, -0.14, 0.07), (0.11, 0.14, 0.1))
    ]
    return Piece("stove", join(glass, *zones))


def extractor(height: float) -> Piece:
    """Return a cooker hood, its lower edge at z = 0, with a flue of given height [m] above it."""
    slope = box((0, 0.48), (-0.3, 0.3), (0, 0.07), METAL)
    grille = box((0.05, 0.43), (-0.26, 0.26), (-0.004, 0), (90, 92, 96))
    return Piece("exhaust fan", join(slope, grille, box((0, 0.27), (-0.14, 0.14), (0.07, height), METAL)))


def washing_machine(rng: np.random.Generator) -> Piece:
    """Return a front loader, 0.6 x 0.58 x 0.85 m: a porthole hinged at the left, a soap drawer, a dial."""
    deep, wide, high, z, hole = 0.56, 0.6, 0.85, 0.42, 0.145
    shell = [board.moved(at(deep, 0, 0.02)) for board in cabinet_body((deep, wide, high - 0.02), 0.012, WHITE)]
    face = [
        box((deep - 0.02, deep), (-wide / 2, wide / 2), (0.02, z - hole), WHITE),
        box((deep - 0.02, deep), (-wide / 2, wide / 2), (z + hole, 0.71), WHITE),
        box((deep - 0.02, deep), (-0.12, wide / 2), (0.715, high), WHITE),
        *(box((deep - 0.02, deep), sorted_pair(hole * s, 0.3 * s), (z - hole, z + hole), WHITE) for s in (-1, 1)),
    ]
    drum = lathe(
        [(0, -0.4), (0.24, -0.4), (0.24, 0), (0.2, 0), (0.2, -0.02), (0.23, -0.02), (0.23, -0.39), (0, -0.39)], METAL
    )
    turn = rotation((0, QUARTER, 0))
    dial = cylinder(0.03, 0.025, METAL).moved(at(deep, 0.05, 0.78) @ turn)
    feet = [box((x, x + 0.05), (y, y + 0.05), (0, 0.02), DARK) for x in (0.03, 0.45) for y in (-0.28, 0.23)]
    body = join(*shell, *face, drum.moved(at(deep - 0.02, 0, z) @ turn), dial, *feet)
    return Piece("washing machine", body, (_porthole().moved(at(deep + 0.034, 0, z)), _soap_drawer(rng, deep)))


def _porthole() -> Piece:
    """Return a washing machine's round door: a ring about dark glass, a recessed grip at its right."""
    turn = rotation((0, QUARTER, 0))
    ring = lathe([(0.14, -0.03), (0.21, -0.03), (0.21, -0.008), (0.19, 0), (0.14, 0), (0.14, -0.03)], METAL)
    glass = lathe([(0, -0.1), (0.11, -0.08), (0.14, -0.028), (0.14, -0.014), (0, -0.01)], GLASS)
    shape = join(ring, glass).moved(turn)
    grip = cup(0.07, 0.03, 0.022, DARK).moved(at(-0.002, 0.175, 0.0) @ rotation((QUARTER, 0, 0)))
    return hinged("washing machine door", shape, LEFT, grip)


def _soap_drawer(rng: np.random.Generator, deep: float) -> Piece:
    """Return the drawer for washing powder in the upper left corner."""
    size = (0.02, 0.17, 0.12)
    pull = edge(0.1, color=DARK).moved(at(0, 0, 0.02))
    tray = drawer(size, (0.14, 0.07), pull, WHITE, PLAIN, 0.2)
    return replace(tray.tilted(rng, 0.1).moved(at(deep, -0.21, 0.775)), name="detergent drawer")


def sorted_pair(a: float, b: float) -> tuple[float, float]:
    """Return two numbers in ascending order."""
    return (a, b) if a < b else (b, a)
