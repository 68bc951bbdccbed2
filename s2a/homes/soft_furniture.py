"""Beds and seats: bed, sofa, armchair, footstool. Local frames: standing on z = 0, front towards +x, metres."""

from __future__ import annotations

import numpy as np

from s2a.homes.cloth import cushion, drape
from s2a.homes.solids import FABRIC, WOOD, Color, Piece, Surface, at, box, cylinder, join, rotation

OAK, SHEET = (176, 138, 96), (232, 230, 226)
BED_TOP = 0.5
"""Height of a mattress' upper face [m]."""


def bed(width: float, length: float, cloth: Color) -> Piece:
    """Return a bed with an upholstered headboard at x = 0 and its foot towards +x; the frame is 60 mm wider than its mattress.

    Args:
        width: of the mattress, along y [m].
        length: of the mattress, along x [m].
        cloth: colour of the headboard.
    """
    half, foot = width / 2 + 0.03, 0.06 + length + 0.03
    legs = _legs((0.08, foot - 0.08), half - 0.07, 0.16)
    rails = [box((0.06, foot), (y, y + 0.025), (0.16, 0.36), OAK, WOOD) for y in (-half, half - 0.025)]
    ends = [box((x, x + 0.025), (-half + 0.025, half - 0.025), (0.16, 0.36), OAK, WOOD) for x in (0.06, foot - 0.025)]
    slats = box((0.085, foot - 0.025), (-half + 0.025, half - 0.025), (0.22, 0.25), OAK, WOOD)
    mattress = cushion((length, width, BED_TOP - 0.25), SHEET, 24.0, 9.0)
    head = [
        cushion((0.06, (2 * half - 0.02) / 3, 0.62), cloth, 6.0, 6.0).moved(at(0.065, y, 0.76))
        for y in np.linspace(-1, 1, 3) * (2 * half) / 3
    ]
    board = box((0, 0.06), (-half, half), (0.05, 1.08), cloth, FABRIC)
    middle = at(0.075 + length / 2, 0, (BED_TOP + 0.25) / 2)
    return Piece("bed", join(board, *head, *legs, *rails, *ends, slats, mattress.moved(middle)))


def duvet(rng: np.random.Generator, width: float, length: float, color: Color) -> Piece:
    """Return a blanket over the lower three quarters of a bed, in the bed's frame; see `bed`."""
    cloth = drape(rng, 0.68 * length, width, 0.2, color, 0.035)
    return Piece("blanket", cloth.moved(at(0.06 + 0.31 * length, 0, BED_TOP)))


def sofa(width: float, seats: int, cloth: Color, name: str = "sofa") -> Piece:
    """Return a sofa 0.9 m deep and 0.82 m high with a cushion to sit on and one to lean on for each seat.

    Its back is at x = -0.9; the seats are 0.44 m high, the arms 0.6 m high and 0.18 m wide.
    """
    half, arm = width / 2, 0.18
    base = box((-0.88, -0.02), (-half + arm, half - arm), (0.12, 0.28), cloth, FABRIC)
    rest = box((-0.9, -0.72), (-half + arm, half - arm), (0.12, 0.74), cloth, FABRIC)
    arms = [
        cushion((0.9, arm, 0.48), cloth, 14.0, 10.0).moved(at(-0.45, side * (half - arm / 2), 0.36)) for side in (-1, 1)
    ]
    each = (width - 2 * arm) / seats
    middles = [-half + arm + each * (i + 0.5) for i in range(seats)]
    seat = cushion((0.74, each - 0.006, 0.17), cloth, 14.0, 4.0)
    lean = cushion((0.2, each - 0.012, 0.44), cloth, 8.0, 6.0).moved(rotation((0, -0.2, 0)))
    soft = [part for y in middles for part in (seat.moved(at(-0.36, y, 0.36)), lean.moved(at(-0.63, y, 0.62)))]
    return Piece(name, join(base, rest, *arms, *soft, *_legs((-0.84, -0.08), half - 0.09, 0.12)))


def armchair(cloth: Color) -> Piece:
    """Return an armchair, 0.95 m wide and 0.9 m deep; its back is at x = -0.9."""
    return sofa(0.95, 1, cloth, "armchair")


def footstool(cloth: Color) -> Piece:
    """Return a round padded stool, 0.46 m across and 0.42 m high."""
    pad = cushion((0.46, 0.46, 0.2), cloth, 2.0, 5.0).moved(at(0, 0, 0.32))
    return Piece("stool", join(cylinder(0.2, 0.23, OAK, WOOD), pad))


def _legs(x: tuple[float, float], y: float, height: float) -> list[Surface]:
    """Return four square legs 5 cm thick about +-y at two depths [m]."""
    return [box((a - 0.025, a + 0.025), (b - 0.025, b + 0.025), (0, height), OAK, WOOD) for a in x for b in (-y, y)]
