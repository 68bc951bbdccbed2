"""Bathroom fixtures and furniture. Local frames: back on the wall x = 0, centred in y, z up, front towards +x, metres."""

from __future__ import annotations

import numpy as np

from s2a.homes.fronts import GAP, LEFT, RIGHT, Pull, door_edge, door_knob, hinged, lid, panel
from s2a.homes.furniture import cabinet_body, drawer
from s2a.homes.kitchen_units import BOARD, DARK, THICK
from s2a.homes.plumbing import CHROME, pipe
from s2a.homes.solids import PLAIN, Color, Piece, Surface, at, box, cylinder, join, lathe, painted

CERAMIC: Color = (240, 240, 238)
MIRROR: Color = (150, 164, 172)
VANITY_DEPTH, VANITY_TOP = 0.48, 0.86
"""Depth of a vanity's body, and height of the top on it [m]."""


def toilet() -> Piece:
    """Return a close-coupled toilet, 0.68 m deep, seat at 0.42 m: pan, seat, cistern with a button, and a lid that turns up."""
    squeeze, middle, half = 0.75, 0.43, 0.24
    outside = [(0.11, 0), (0.13, 0.02), (0.14, 0.16), (half - 0.01, 0.34), (half - 0.01, 0.4)]
    inside = [(half - 0.06, 0.4), (half - 0.08, 0.3), (0.06, 0.17), (0, 0.16)]
    pan = lathe([(0, 0), *outside, *inside], CERAMIC, squeeze=squeeze)
    ring = [(half - 0.06, 0.402), (half, 0.402), (half, 0.42), (half - 0.06, 0.42), (half - 0.06, 0.402)]
    body = [
        pan.moved(at(middle, 0)),
        box((0.0, 0.3), (-0.1, 0.1), (0, 0.38), CERAMIC),
        box((0.0, 0.165), (-0.19, 0.19), (0.38, 0.78), CERAMIC),
        box((0.0, 0.172), (-0.195, 0.195), (0.78, 0.8), CERAMIC),
        cylinder(0.025, 0.006, CHROME).moved(at(0.085, 0, 0.8)),
    ]
    seat = Piece("toilet seat", lathe(ring, (250, 250, 248), squeeze=squeeze).moved(at(middle, 0)))
    disc = lathe([(0, -0.018), (half, -0.018), (half, -0.006), (half - 0.015, 0), (0, 0)], CERAMIC, squeeze=squeeze)
    return Piece("toilet", join(*body), (seat, lid("toilet lid", disc).moved(at(middle, 0, 0.44))))


def bathtub(length: float, width: float = 0.75) -> Piece:
    """Return a bathtub along y in its panelled surround, 0.57 m high: an open tub with sloping ends."""
    high, rim, y = 0.57, 0.07, length / 2
    surround = [
        box((width - 0.02, width), (-y, y), (0, high - 0.03), CERAMIC),
        *(box((0, width), (s, s + 0.02), (0, high - 0.03), CERAMIC) for s in (-y, y - 0.02)),
    ]
    return Piece("bathtub", join(*surround, _tub((width, length), rim, high)))


def _tub(size: tuple[float, float], rim: float, high: float) -> Surface:
    """Return rim, sloping walls and floor of a tub as one closed sheet, 30 mm thick at the rim."""
    width, length = size

    def ring(inset: float, end: float, z: float) -> list[tuple[float, float, float]]:
        x, y = (inset, width - inset), length / 2 - end
        return [(x[0], -y, z), (x[1], -y, z), (x[1], y, z), (x[0], y, z)]

    rings = [
        ring(0, 0, high - 0.03),
        ring(0, 0, high),
        ring(rim, rim, high),
        ring(rim + 0.06, rim + 0.16, 0.15),
        ring(rim + 0.05, rim + 0.15, 0.12),
        ring(rim - 0.02, rim - 0.02, high - 0.03),
    ]
    faces = [(12, 13, 14), (12, 14, 15), (16, 18, 17), (16, 19, 18)]  # its floor from above and from below
    for i in (0, 1, 2, 4, 5):
        for j in range(4):
            a, b = 4 * i + j, 4 * i + (j + 1) % 4
            c, d = (b + 4) % 24, (a + 4) % 24
            faces += [(a, b, c), (a, c, d)]
    return painted(np.array([corner for corners in rings for corner in corners]), faces, CERAMIC)


def bath_screen(length: float, height: float) -> Piece:
    """Return a glass screen along y that stands on a bathtub's rim at z = 0, a metal profile at its end y = 0."""
    glass = box((-0.004, 0.004), (0.02, length), (0, height), (170, 196, 200), dropout=0.85)
    return Piece("shower screen", join(box((-0.012, 0.012), (0, 0.02), (0, height), CHROME), glass))


def shower(height: float) -> Piece:
    """Return a hand shower on a rail: its mixer at z = 0 before the wall x = 0, its head at a height above [m]."""
    mixer = box((0.02, 0.07), (-0.12, 0.12), (-0.02, 0.025), CHROME)
    knobs = [cylinder(0.024, 0.05, CHROME).moved(at(0.045, y, -0.025)) for y in (-0.1, 0.1)]
    spout = pipe([(0.045, 0, -0.01), (0.15, 0, -0.01), (0.16, 0, -0.04)], 0.014)
    rail = pipe([(0.0, 0, 0.3), (0.05, 0, 0.3), (0.05, 0, height), (0, 0, height)], 0.01)
    head = pipe([(0.05, 0.02, height - 0.05), (0.18, 0.02, height)], 0.012)
    rose = cylinder(0.055, 0.02, CHROME).moved(at(0.2, 0.02, height - 0.015))
    inlets = [pipe([(0, y, 0), (0.03, y, 0)], 0.014) for y in (-0.075, 0.075)]
    return Piece("shower head", join(mixer, *knobs, spout, rail, head, rose, *inlets))


def vanity(rng: np.random.Generator, width: float, pull: Pull, color: Color, texture: int = PLAIN) -> Piece:
    """Return a vanity without its top: one door below the basin at the left, two drawers at the right, on a plinth."""
    deep, low, half, split = VANITY_DEPTH - THICK - 0.001, 0.12, width / 2, width / 2 - 0.4
    boards = [
        board.moved(at(deep, 0, low))
        for board in cabinet_body((deep, width, VANITY_TOP - 0.03 - low), BOARD, color)[:4]
    ]
    middle = box((BOARD, deep), (split - BOARD / 2, split + BOARD / 2), (low, VANITY_TOP - 0.03), color)
    plinth = box((0.02, deep - 0.04), (-half, half), (0, low), DARK)
    tall = VANITY_TOP - 0.03 - low - 2 * GAP
    wide = split + half - GAP
    grip = door_knob(LEFT, wide, tall / 2 - 0.07)
    leaf = hinged("door", panel((THICK, wide, tall), color, texture), LEFT, grip).tilted(rng, 0.15)
    parts = [leaf.moved(at(VANITY_DEPTH, (split - half) / 2, low + GAP + tall / 2))]
    high = (tall - GAP) / 2
    for z in (low + GAP + high / 2, low + 2 * GAP + 1.5 * high):
        front = drawer((THICK, 0.4 - GAP, high), (0.33, high - 0.08), pull(0.396, high), color, texture, 0.31)
        parts.append(front.tilted(rng, 0.15).moved(at(VANITY_DEPTH, split + 0.2, z)))
    return Piece("bathroom cabinet", join(*boards, middle, plinth), tuple(parts))


def mirror_cabinet(rng: np.random.Generator, width: float, height: float) -> Piece:
    """Return a shallow wall cabinet, its floor at z = 0, with two mirrored doors that are pulled by their edges."""
    deep, wide, tall = 0.13, width / 2 - 0.006, height - GAP
    body = [board.moved(at(deep, 0)) for board in cabinet_body((deep, width, height), 0.014, CERAMIC)]
    shelf = box((0.014, deep - 0.01), (0.014 - width / 2, width / 2 - 0.014), (height / 2, height / 2 + 0.006), MIRROR)
    leaves = []
    for side in (LEFT, RIGHT):
        board = panel((0.016, wide, tall), CERAMIC)
        glass = box(
            (0, 0.006), (0.02 - wide / 2, wide / 2 - 0.02), (0.02 - tall / 2, tall / 2 - 0.02), MIRROR, dropout=0.5
        )
        grip = door_edge(side, wide, 0.08 - tall / 2 + 0.1, 0.16)
        leaf = hinged("mirror", join(board, glass), side, grip).tilted(rng, 0.05)
        leaves.append(leaf.moved(at(deep + 0.017, side[0] * width / 4, height / 2)))
    return Piece("mirror cabinet", join(*body, shelf), tuple(leaves))
