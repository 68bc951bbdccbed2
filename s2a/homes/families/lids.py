"""Furniture that opens upwards: trunks, storage benches, bins, laundry baskets; all common sizes.

Trunks 0.6 to 1.3 m wide, 0.38 to 0.55 m deep, 0.38 to 0.55 m high; bins 0.2 to 0.36 m across, 0.28 to 0.7 m high. Backs at x = 0.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from s2a.homes import clutter, grips
from s2a.homes.clutter import Board
from s2a.homes.draw import chance, integer, pick, uniform
from s2a.homes.fittings import Style
from s2a.homes.fronts import lid, open_box
from s2a.homes.solids import FABRIC, Color, Piece, at, box, join, lathe


def trunk(rng: np.random.Generator, style: Style, name: str = "trunk") -> Piece:
    """Return a trunk or bench whose lid turns up about its back edge by 70 to 95 degrees."""
    size = uniform(rng, (0.38, 0.55)), uniform(rng, (0.6, 1.3)), uniform(rng, (0.38, 0.55))
    return _chest(rng, style, size, name, uniform(rng, (0.02, 0.04)))


def hamper(rng: np.random.Generator, style: Style) -> Piece:
    """Return a laundry hamper with a lid."""
    size = uniform(rng, (0.32, 0.42)), uniform(rng, (0.36, 0.6)), uniform(rng, (0.5, 0.68))
    woven = replace(style, body=(188, 158, 116), front=(176, 144, 98), texture=FABRIC)
    return _chest(rng, woven, size, "laundry basket", uniform(rng, (0.014, 0.02)))


def _chest(rng: np.random.Generator, style: Style, size: tuple[float, float, float], name: str, thick: float) -> Piece:
    """Return an open box with a lid that stands over its front by 15 mm, pulled there or at its front edge."""
    deep, wide, high = size
    rise = 0.003
    body = open_box((deep, wide, high - thick - rise), style.board, *style.paint).moved(at(deep / 2, 0))
    angle = float(np.radians(uniform(rng, (70, 92))))
    # In the frame of an upright front whose upper edge is hinged: x is up, z is back.
    board = box((-deep / 2, deep / 2 + 0.015), (-wide / 2, wide / 2), (-thick, 0), style.front, style.texture)
    cover = lid("lid", board, *_lid_grips(rng, style, deep, wide), angle=angle)
    inside = Board(
        (style.board, deep - style.board),
        (-wide / 2 + style.board, wide / 2 - style.board),
        style.board,
        high - thick - 0.04,
    )
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
    radius, high = uniform(rng, (0.1, 0.18)), uniform(rng, (0.28, 0.7))
    color: Color = pick(rng, ((196, 198, 200), (60, 62, 66), (230, 228, 220), (150, 52, 48)))
    wall, top = 0.006, high - 0.035
    body = lathe([(0, 0), (radius, 0), (radius, top), (radius - wall, top), (radius - wall, wall), (0, wall)], color)
    pedal = box((radius - 0.01, radius + 0.04), (-0.03, 0.03), (0.01, 0.022), (40, 40, 44))
    cover = lathe([(0, -0.03), (radius, -0.03), (radius, -0.012), (0.8 * radius, 0), (0, 0)], color)
    handles: tuple[Piece, ...] = ()
    if chance(rng, 0.6):
        knob = grips.make(grips.design(rng, "knob", "bow").fitted(radius))
        handles = (knob.moved(at(0, 0, -0.45 * radius)),)
    cover_piece = lid("trash can lid", cover, *handles, angle=uniform(rng, (1.2, 1.5)))
    whole = Piece("trash can", join(body, pedal), (cover_piece.moved(at(0, 0, high - 0.003)),))
    return whole.moved(at(radius, 0))
