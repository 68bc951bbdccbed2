"""Cloth and cushions: pillows, blankets, curtains, rugs, folded clothes. Local frames: on z = 0, front towards +x, metres."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from s2a.homes.handles import STEEL
from s2a.homes.solids import FABRIC, Color, Piece, Surface, at, box, cylinder, ellipsoid, join, painted, rotation


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


def curtain(rng: np.random.Generator, width: float, height: float, color: Color) -> Piece:
    """Return a curtain in folds that hangs down to z = 0 before a wall at x = 0, centred in y."""
    y, z = np.meshgrid(np.linspace(-width / 2, width / 2, 49), np.linspace(0, height, 5), indexing="ij")
    folds = 0.024 * np.sin(2 * np.pi * np.round(width / 0.11) * (y / width + rng.uniform()))
    x = 0.105 + folds * (1.0 - 0.3 * z / height)
    return Piece("curtain", sheet(np.stack([x, y, z], axis=-1), 0.012, color))


def curtain_rod(length: float) -> Piece:
    """Return a rod along y, 28 mm thick, held before a wall at x = 0; its middle is at z = 0."""
    rod = cylinder(0.014, length, STEEL).moved(at(0.1, length / 2) @ rotation((np.pi / 2, 0, 0)))
    ends = [ellipsoid((0.05, 0.05, 0.05), STEEL).moved(at(0.1, y)) for y in (-length / 2, length / 2)]
    arms = [box((0, 0.1), (y - 0.008, y + 0.008), (-0.008, 0.008), STEEL) for y in (-0.45 * length, 0.45 * length)]
    return Piece("curtain rod", join(rod, *ends, *arms))


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
