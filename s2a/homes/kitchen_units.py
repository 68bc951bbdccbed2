"""Fitted kitchen cabinets. Local frames: back on the wall x = 0, centred in y, z above the floor, front towards +x, metres.

Sizes are those of fitted kitchens (EN 1116): fronts from 0.10 to 0.86 m, worktop at 0.90 m, base units 0.58 m deep.
"""

from __future__ import annotations

import numpy as np

from s2a.homes.fronts import GAP, Pull, Side, door_bar, door_knob, hinged, panel
from s2a.homes.furniture import cabinet_body, drawer
from s2a.homes.solids import PLAIN, WOOD, Color, Piece, Surface, at, box, join

DARK: Color = (52, 52, 56)
FRONT = 0.58
"""Distance from the wall to the face of the base units' fronts [m]."""
PLINTH, FRONT_TOP, COUNTER = 0.1, 0.86, 0.9
"""Upper edges of the plinth, of the base units' carcasses, and of the worktop [m]."""
BOARD, THICK = 0.018, 0.019
"""Thickness of cabinet body boards and of fronts [m]."""


def base_body(width: float, color: Color, thick: float = THICK) -> Surface:
    """Return a base unit without its fronts of given thickness: open in front and, under the worktop, above; on a plinth."""
    deep, half = FRONT - thick - 0.001, width / 2
    boards = cabinet_body((deep, width, FRONT_TOP - PLINTH), BOARD, color)[:4]
    rail = box((deep - 0.05, deep), (-half + BOARD, half - BOARD), (FRONT_TOP - BOARD, FRONT_TOP), color)
    plinth = box((0.02, deep - 0.05), (-half, half), (0, PLINTH), DARK)
    return join(*(board.moved(at(deep, 0, PLINTH)) for board in boards), rail, plinth)


def drawer_unit(
    rng: np.random.Generator, width: float, heights: tuple[float, ...], pull: Pull, color: Color, texture: int = PLAIN
) -> Piece:
    """Return a base unit with drawers, given by the relative heights of their fronts from below."""
    free = FRONT_TOP - PLINTH - (len(heights) + 1) * GAP
    drawers, z = [], PLINTH + GAP
    for share in heights:
        high = free * share / sum(heights)
        size = (THICK, width - GAP, high)
        front = drawer(size, (width - 0.066, high - 0.07), pull(size[1], high), color, texture)
        drawers.append(front.tilted(rng, 0.15).moved(at(FRONT, 0, z + high / 2)))
        z += high + GAP
    return Piece("kitchen cabinet", base_body(width, color), tuple(drawers))


def door_unit(rng: np.random.Generator, width: float, leaves: tuple[Side, ...], color: Color, texture: int) -> Piece:
    """Return a base unit with one door for each of the given hinges, knobs near their upper edges."""
    high, wide = FRONT_TOP - PLINTH - 2 * GAP, width / len(leaves) - GAP
    doors = []
    for i, side in enumerate(leaves):
        leaf = hinged("door", panel((THICK, wide, high), color, texture), side, door_knob(side, wide, high / 2 - 0.07))
        y = (i + 0.5) * width / len(leaves) - width / 2
        doors.append(leaf.tilted(rng, 0.15).moved(at(FRONT, y, (PLINTH + FRONT_TOP) / 2)))
    return Piece("kitchen cabinet", base_body(width, color), tuple(doors))


def wall_unit(
    rng: np.random.Generator, width: float, height: float, leaves: tuple[Side, ...], color: Color, texture: int = PLAIN
) -> Piece:
    """Return a wall unit, 0.35 m deep, its floor at z = 0, with one door for each of the given hinges and upright bars."""
    deep, wide = 0.33, width / len(leaves) - GAP
    body = join(
        *(board.moved(at(deep, 0)) for board in cabinet_body((deep, width, height), BOARD, color)), _shelf(width)
    )
    doors = []
    for i, side in enumerate(leaves):
        grip = door_bar(side, wide, 0.15 - height / 2, 0.18)
        leaf = hinged("door", panel((THICK, wide, height - GAP), color, texture), side, grip)
        y = (i + 0.5) * width / len(leaves) - width / 2
        doors.append(leaf.tilted(rng, 0.15).moved(at(deep + THICK + 0.001, y, height / 2)))
    return Piece("kitchen cabinet", body, tuple(doors))


def _shelf(width: float) -> Surface:
    """Return the board inside a wall unit."""
    half = width / 2 - BOARD
    return box((BOARD, 0.31), (-half, half), (0.34, 0.355), (230, 228, 222))


def open_shelf(width: float, depth: float, height: float, boards: int, color: Color) -> Piece:
    """Return a shelf without doors; board i of `boards` lies i / boards of its height above z = 0, a cover on top."""
    sides = cabinet_body((depth, width, height), BOARD, color, WOOD)
    half = width / 2 - BOARD
    levels = [
        box((BOARD, depth), (-half, half), (z - BOARD, z), color, WOOD)
        for z in (i * height / boards for i in range(1, boards))
    ]
    return Piece("shelf", join(*(side.moved(at(depth, 0)) for side in sides), *levels))


def tall_unit(rng: np.random.Generator, size: tuple[float, float, float], side: Side, color: Color) -> Piece:
    """Return a tall cupboard of given depth, width and height [m] with an upper and a lower door, upright bars, on a plinth."""
    deep, width, height = size
    body = join(*(board.moved(at(deep, 0, 0.08)) for board in cabinet_body((deep, width, height - 0.08), BOARD, color)))
    plinth = box((0.02, deep - 0.03), (-width / 2, width / 2), (0, 0.08), DARK)
    leaves, middle = [], 0.08 + 0.45 * (height - 0.08)
    for low, high, grip in ((0.08, middle, 0.3), (middle, height, -0.3)):
        tall = high - low - GAP
        pull = door_bar(side, width - GAP, grip * tall, 0.2)
        leaf = hinged("door", panel((THICK, width - GAP, tall), color), side, pull)
        leaves.append(leaf.tilted(rng, 0.1).moved(at(deep + THICK + 0.001, 0, (low + high) / 2)))
    return Piece("storage cabinet", join(body, plinth), tuple(leaves))
