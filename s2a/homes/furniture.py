"""Furniture that opens: drawer cabinets, hinged doors, windows. Local frames: front towards +x, z up, metres.

The main cabinet has the dimensions of the "Sektion" drawer cabinet that robot-learning benchmarks use; it is built from numbers.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from s2a.homes.handles import QUARTER, bar, knob, lever, upright
from s2a.homes.solids import PLAIN, WOOD, Color, Piece, Surface, at, box, join
from s2a.scene.scene import Joint

WHITE, BLACK = (226, 224, 218), (42, 42, 45)


def drawer(
    size: tuple[float, float, float],
    tray: tuple[float, float],
    handle: Piece,
    color: Color,
    texture: int,
    travel: float = 0.4,
) -> Piece:
    """Return a drawer: its panel ends at x = 0, its tray lies behind, centred in y and z.

    Args:
        size: of the panel along x, y, z [m].
        tray: outer width and height of the tray [m]; it is as deep as its joint is long, plus 0.11 m.
        handle: what it is pulled by.
        color: of the panel.
        texture: texture of the panel.
        travel: how far it comes out [m].
    """
    thick, width, height = (size[0], size[1] / 2, size[2] / 2)
    y, z, back = tray[0] / 2, tray[1] / 2, -thick - travel - 0.1117
    wood = (205, 186, 150)
    walls = [
        box((-thick, 0), (-width, width), (-height, height), color, texture),
        box((back, -thick), (-y, -y + 0.004), (-z, z), wood),
        box((back, -thick), (y - 0.004, y), (-z, z), wood),
        box((back, back + 0.004), (-y, y), (-z, z), wood),
        box((back, -thick), (-y, y), (-z, -z + 0.002), wood),
    ]
    joint = Joint("prismatic", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, travel))
    return Piece("drawer", join(*walls), (handle,), joint)


def door(size: tuple[float, float, float], hinge: int, handle: Piece, color: Color, texture: int = PLAIN) -> Piece:
    """Return a hinged door: its panel ends at x = 0, centred in y and z; positive angles open it towards +x.

    Args:
        size: of the panel along x, y, z [m].
        hinge: side of the hinge along y, +1 or -1.
        handle: what it is pulled by, already in place.
        color: of the panel.
        texture: texture of the panel.
    """
    thick, width, height = size[0], size[1] / 2, size[2] / 2
    panel = box((-thick, 0), (-width, width), (-height, height), color, texture)
    origin = (-thick / 2, hinge * (width - 0.0058), 0.0)
    return Piece("door", panel, (handle,), Joint("revolute", (0.0, 0.0, float(hinge)), origin, (0.0, QUARTER)))


def cabinet_body(size: tuple[float, float, float], wall: float, color: Color, texture: int = PLAIN) -> list[Surface]:
    """Return five panels of a box that is open towards +x: its front edge is at x = 0, its floor at z = 0."""
    deep, half, high = size[0], size[1] / 2, size[2]
    return [
        box((-deep, -deep + wall), (-half, half), (0, high), color, texture),
        box((-deep, 0), (-half, -half + wall), (0, high), color, texture),
        box((-deep, 0), (half - wall, half), (0, high), color, texture),
        box((-deep, 0), (-half, half), (0, wall), color, texture),
        box((-deep, 0), (-half, half), (high - wall, high), color, texture),
    ]


def main_cabinet(rng: np.random.Generator) -> Piece:
    """Return the Sektion drawer cabinet: two drawers above two doors, its middle over the origin, 19 mm above the floor.

    Its own frame lies 0.4 m above the floor; heights below are written in that frame, as published.
    """
    body, top = (232, 229, 222), (168, 132, 92)
    panels = cabinet_body((0.61, 0.762, 0.762), 0.019, body)[:4]
    shell = [panel.moved(at(0.305, 0, 0.019)) for panel in panels]
    rails = [box(x, (-0.362, 0.362), (0.755, 0.782), body) for x in ((-0.292, -0.265), (0.2715, 0.2985))]
    counter = box((-0.2848, 0.3248), (-0.381, 0.381), (0.782, 0.802), top, WOOD)
    plinth = box((-0.28, 0.25), (-0.36, 0.36), (0.0, 0.019), BLACK)
    grip = bar(0.1682, 0.0238, 0.0142, 0.0239, 0.035).moved(at(0, 0, 0.0095))
    front = drawer((0.019, 0.7588, 0.1238), (0.6992, 0.0858), grip, WHITE, PLAIN)
    drawers = [front.tilted(rng).moved(at(0.3247, 0, 0.4 + z)) for z in (0.18795, 0.3172)]
    doors = []
    for side in (1, -1):
        pull = knob(0.015, 0.0265).moved(at(0, -side * 0.15, 0.19))
        leaf = door((0.02, 0.381, 0.508), side, pull, WHITE).tilted(rng)
        doors.append(leaf.moved(at(0.3262, side * 0.191, 0.4 - 0.12973)))
    return Piece("cabinet", join(*shell, *rails, counter, plinth), (*drawers, *doors))


def pedestal(rng: np.random.Generator) -> Piece:
    """Return a desk pedestal, 0.42 m wide and 0.56 m high, with three drawers and slim bars; its back is at x = -0.58."""
    grey = (196, 198, 202)
    body = join(*cabinet_body((0.56, 0.42, 0.56), 0.016, grey))
    grip = bar(0.128, 0.014, 0.012, 0.022, 0.012, BLACK)
    fronts = []
    for height, z in ((0.14, 0.095), (0.14, 0.24), (0.23, 0.43)):
        front = drawer(
            (0.018, 0.414, height), (0.36, height - 0.04), grip.moved(at(0, 0, height / 2 - 0.04)), grey, PLAIN
        )
        fronts.append(front.tilted(rng, 0.3).moved(at(0.02, 0, z)))
    return Piece("storage cabinet", body, tuple(fronts)).moved(at(0, 0, 0.02))


def wall_cupboard(rng: np.random.Generator) -> Piece:
    """Return a cupboard, 0.8 m wide and 0.6 m high, with a left and a right door and upright bars; its back is at x = -0.34."""
    wood = (176, 140, 100)
    body = join(*cabinet_body((0.32, 0.8, 0.6), 0.018, wood, WOOD))
    leaves = []
    for side in (1, -1):
        pull = upright(bar(0.14, 0.014, 0.012, 0.024, 0.012)).moved(at(0, -side * 0.15, -0.15))
        leaf = door((0.018, 0.395, 0.592), side, pull, (214, 196, 160), WOOD).tilted(rng)
        leaves.append(leaf.moved(at(0.021, side * 0.2, 0.3)))
    return Piece("wall cabinet", body, tuple(leaves))


def room_door(rng: np.random.Generator, width: float, height: float) -> Piece:
    """Return a door in a frame that fills a wall's opening of given width and height; the wall's face is at x = 0."""
    paint, leaf_color = (236, 236, 232), (150, 112, 74)
    half = width / 2
    jambs = [box((-0.1, 0.015), (y, y + 0.06), (0, height), paint) for y in (-half, half - 0.06)]
    head = box((-0.1, 0.015), (-half, half), (height - 0.06, height), paint)
    size = (0.04, width - 0.13, height - 0.075)
    grip = lever(0.125, 1).moved(at(0, -(size[1] / 2 - 0.06), 1.05 - size[2] / 2))
    # The hinges' pins are in the front's plane: about an axis inside the leaf, its edge would turn into the jamb.
    swing = Joint("revolute", (0.0, 0.0, 1.0), (0.0, size[1] / 2, 0.0), (0.0, QUARTER))
    leaf = replace(door(size, 1, grip, leaf_color, WOOD), joint=swing).tilted(rng, 0.3)
    return Piece("door frame", join(*jambs, head), (leaf.moved(at(0.004, 0, 0.008 + size[2] / 2)),))


def window(rng: np.random.Generator, width: float, height: float) -> Piece:
    """Return a window that fills a wall's opening: a frame, one glazed sash that opens into the room, a lever; face at x = 0."""
    paint = (240, 240, 238)
    outer = _ring(width, height, 0.05, (-0.08, 0.0), paint)
    inner = _ring(width - 0.07, height - 0.07, 0.065, (-0.04, 0.018), paint)
    pane = box(
        (-0.02, -0.012), (-width / 2 + 0.09, width / 2 - 0.09), (0.09, height - 0.09), (120, 150, 165), dropout=0.8
    )
    pane = pane.moved(at(0, 0, -height / 2))
    sash = join(inner.moved(at(0, 0, 0.035 - height / 2)), pane)
    grip = upright(lever(0.12, -1)).moved(at(0.018, -(width / 2 - 0.066), 0))
    joint = Joint("revolute", (0.0, 0.0, 1.0), (0.0, width / 2 - 0.04, 0.0), (0.0, QUARTER))
    leaf = Piece("window", sash, (grip,), joint).tilted(rng, 0.3).moved(at(0, 0, height / 2))
    return Piece("window frame", outer, (leaf,))


def _ring(width: float, height: float, bar_width: float, x: tuple[float, float], color: Color) -> Surface:
    """Return four bars around a rectangle whose lower edge is at z = 0, centred in y."""
    half = width / 2
    uprights = [box(x, (y, y + bar_width), (0, height), color) for y in (-half, half - bar_width)]
    levels = [box(x, (-half + bar_width, half - bar_width), (z, z + bar_width), color) for z in (0, height - bar_width)]
    return join(*uprights, *levels)
