"""Cloth and soft furniture: pillows, blankets, rugs, folded clothes, beds, sofas. On z = 0, front towards +x, metres."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from s2a.homes.solids import FABRIC, WOOD, Color, Piece, Surface, at, box, ellipsoid, join, painted, rotation


def cushion(size: tuple[float, float, float], color: Color, square: float = 5.0, flat: float = 2.4) -> Surface:
    """Return a stuffed cushion about the origin.

    Args:
        size: full extents [m].
        color: of the cloth.
        square: exponent of the outline seen from above; 2 is an ellipse, more is a rectangle with rounder or sharper corners.
        flat: exponent of its section; 2 is an ellipse, more is a slab.
    """
    ball = ellipsoid((2.0, 2.0, 2.0), color, FABRIC, sides=32)
    x, y, z = np.abs(ball.vertices).T
    norm = ((x**square + y**square) ** (flat / square) + z**flat) ** (1 / flat)
    return replace(ball, vertices=ball.vertices / norm[:, None] * np.array(size) / 2)


def sheet(points: np.ndarray, thickness: float, color: Color) -> Surface:
    """Return a thick cloth whose outer side runs through a grid of points.

    Args:
        points: [m], shape [row column 3]; the outer side is the one from which rows, then columns turn counter-clockwise.
        thickness: how far the inner side lies behind [m].
        color: of the cloth.
    """
    rows, columns = points.shape[:2]
    normal = np.cross(np.gradient(points, axis=0), np.gradient(points, axis=1))
    inner = points - thickness * normal / np.linalg.norm(normal, axis=2, keepdims=True)
    index, count = np.arange(rows * columns).reshape(rows, columns), rows * columns
    a, b, c, d = (i.ravel() for i in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    outer = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    rim = np.concatenate([index[:, 0], index[-1, 1:], index[-2::-1, -1], index[0, -2::-1]])
    here, after = rim[:-1], rim[1:]
    hem = [np.stack([here, here + count, after + count], axis=1), np.stack([here, after + count, after], axis=1)]
    faces = np.concatenate([outer, outer[:, ::-1] + count, *hem])
    return painted(np.concatenate([points.reshape(-1, 3), inner.reshape(-1, 3)]), faces, color, FABRIC)


def pillow(size: tuple[float, float, float], color: Color) -> Piece:
    """Return a pillow that lies on z = 0; its size is along x, y, z [m]."""
    return Piece("pillow", cushion(size, color).moved(at(0, 0, size[2] / 2)))


def drape(
    rng: np.random.Generator, length: float, width: float, fall: float, color: Color, thickness: float = 0.03
) -> Surface:
    """Return a cloth that lies on z = 0 along x and falls over both sides, with soft folds.

    Args:
        rng: where the folds are.
        length: along x, from x = 0 [m].
        width: of what it lies on, along y [m].
        fall: how far each side hangs down [m].
        color: of the cloth.
        thickness: of the cloth, which lies outside of what it covers [m].
    """
    half, phase = width / 2 + thickness + 0.004, rng.uniform(0, 2 * np.pi, 3)
    x, s = np.meshgrid(np.linspace(0, length, 33), np.linspace(-half - fall, half + fall, 49), indexing="ij")
    hanging = np.clip(np.abs(s) - half, 0, None)
    folds = 0.012 * (1 + np.sin(9 * x + phase[0] + np.sign(s))) * hanging / fall
    swell = 0.004 * (1 + np.sin(4 * x + phase[1]) * np.sin(5 * s + phase[2])) * (hanging == 0)
    y = np.sign(s) * (np.minimum(np.abs(s), half) + folds)
    return sheet(np.stack([x, y, thickness + 0.002 + swell - hanging], axis=-1), thickness, color)


def rug(length: float, width: float, color: Color, border: Color) -> Piece:
    """Return a rug 8 mm thick, long along y, with a border."""
    x, y, hem = width / 2, length / 2, 0.12
    inner = box((hem - x, x - hem), (hem - y, y - hem), (0, 0.008), color, FABRIC)
    sides = [box(span, (-y, y), (0, 0.008), border, FABRIC) for span in ((-x, hem - x), (x - hem, x))]
    ends = [box((hem - x, x - hem), span, (0, 0.008), border, FABRIC) for span in ((-y, hem - y), (y - hem, y))]
    return Piece("rug", join(inner, *sides, *ends))


def clothes(rng: np.random.Generator, count: int) -> Piece:
    """Return a pile of folded clothes, 0.26 m deep, 0.3 m wide and 4 cm high each."""
    layers = []
    for i in range(count):
        red, green, blue = rng.integers(60, 220, 3).tolist()
        layer = cushion((0.26, 0.3, 0.042), (red, green, blue), 9.0, 4.0)
        layers.append(layer.moved(at(0, rng.uniform(-0.008, 0.008), 0.021 + 0.04 * i, rng.uniform(-3, 3))))
    return Piece("clothes", join(*layers))


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


def _legs(x: tuple[float, float], y: float, height: float) -> list[Surface]:
    """Return four square legs 5 cm thick about +-y at two depths [m]."""
    return [box((a - 0.025, a + 0.025), (b - 0.025, b + 0.025), (0, height), OAK, WOOD) for a in x for b in (-y, y)]
