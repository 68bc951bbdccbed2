"""Fronts that open: panels hinged at any side, lids, and what they are pulled by. Local frames: front at x = 0, z up, metres."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from s2a.homes.handles import QUARTER, STEEL, bar, cup, edge, knob, upright
from s2a.homes.solids import PLAIN, Color, Piece, Surface, at, box, join, rotation
from s2a.scene.scene import Joint

Side = tuple[int, int]
LEFT, RIGHT, TOP, BOTTOM = (-1, 0), (1, 0), (0, 1), (0, -1)
"""Where a front has its hinge: signs along y and z; left and right as seen by who stands before it."""
Pull = Callable[[float, float], Piece]
"""Returns a handle on a front of given width and height [m], in the frame of the front's middle."""

GAP = 0.004
"""Between two fronts, and between a front and a worktop [m]; fitters leave 3 to 4 mm."""


def panel(size: tuple[float, float, float], color: Color, texture: int = PLAIN, dropout: float = 0.0) -> Surface:
    """Return a board of given thickness, width and height [m], its front at x = 0, centred in y and z."""
    thick, width, height = size
    return box((-thick, 0), (-width / 2, width / 2), (-height / 2, height / 2), color, texture, dropout)


def hinged(name: str, shape: Surface, side: Side, *parts: Piece, angle: float = QUARTER) -> Piece:
    """Return a front that turns about its own front edge, towards +x for positive angles.

    An overlay hinge comes to the same: on its whole way no point of the front leaves its outline sideways.

    Args:
        name: what it is called.
        shape: its surface, its face at x = 0, centred in y and z.
        side: where the hinge is: LEFT, RIGHT, TOP or BOTTOM.
        parts: what belongs to it, already in place: its handle.
        angle: how far it opens [rad].
    """
    outward = np.array((0.0, *side))
    origin = outward * np.abs(shape.vertices).max(axis=0)
    axis = np.cross((1.0, 0.0, 0.0), outward)
    return Piece(name, shape, parts, Joint("revolute", tuple(axis), tuple(origin), (0.0, angle)))


def lid(name: str, shape: Surface, *parts: Piece, angle: float = QUARTER) -> Piece:
    """Return a lid that turns up about its edge at -x; its upper face is at z = 0, centred in x and y.

    Its parts are in the frame of an upright front whose upper edge has the hinge.
    """
    stand_up = rotation((0.0, QUARTER, 0.0))
    return hinged(name, shape.moved(stand_up), TOP, *parts, angle=angle).moved(np.linalg.inv(stand_up))


def bar_pull(width: float, height: float) -> Piece:
    """Return a level bar: in the middle of a low front, near the upper edge of a high one; 26 mm behind it are free."""
    grip = bar(round(min(0.55 * width, 0.32), 3), 0.014, 0.012, 0.026, 0.012)
    return grip.moved(at(0, 0, max(0.0, height / 2 - 0.055)))


def cup_pull(width: float, height: float) -> Piece:
    """Return a cup pull, 28 mm deep, in the middle of a low front, near the upper edge of a high one."""
    return cup(0.1, 0.038, 0.028).moved(at(0, 0, max(0.019, height / 2 - 0.045)))


def knob_pull(width: float, height: float) -> Piece:
    """Return a knob, 28 mm deep, in the middle of a low front, near the upper edge of a high one."""
    return knob(0.015, 0.028).moved(at(0, 0, max(0.0, height / 2 - 0.055)))


def edge_pull(width: float, height: float) -> Piece:
    """Return a profile that stands out 20 mm from a front's upper edge."""
    return edge(round(0.6 * width, 3)).moved(at(0, 0, height / 2))


def door_knob(side: Side, width: float, z: float) -> Piece:
    """Return a knob at a height z [m] on a door of given width [m], 45 mm from the edge across from its hinge."""
    return knob(0.016, 0.028).moved(at(0, -side[0] * (width / 2 - 0.045), z))


def door_bar(side: Side, width: float, z: float, length: float = 0.2, color: Color = STEEL) -> Piece:
    """Return an upright bar about a height z [m] on a door of given width [m], 45 mm from the edge across from its hinge."""
    return upright(bar(length, 0.014, 0.012, 0.028, 0.012, color)).moved(at(0, -side[0] * (width / 2 - 0.045), z))


def door_edge(side: Side, width: float, z: float, length: float = 0.24) -> Piece:
    """Return an upright profile about a height z [m] on the edge of a door across from its hinge."""
    turned = edge(length).moved(rotation((side[0] * QUARTER, 0.0, 0.0)))
    return turned.moved(at(0, -side[0] * width / 2, z))


def open_box(size: tuple[float, float, float], wall: float, color: Color, texture: int = PLAIN) -> Surface:
    """Return a box that is open above: its floor at z = 0, centred in x and y, with walls of given thickness [m]."""
    x, y, z = size[0] / 2, size[1] / 2, size[2]
    walls = [
        box((-x, x), (-y, y), (0, wall), color, texture),
        box((-x, -x + wall), (-y, y), (wall, z), color, texture),
        box((x - wall, x), (-y, y), (wall, z), color, texture),
        box((-x + wall, x - wall), (-y, -y + wall), (wall, z), color, texture),
        box((-x + wall, x - wall), (y - wall, y), (wall, z), color, texture),
    ]
    return join(*walls)
