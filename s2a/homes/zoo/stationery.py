"""Stationery: what one writes and draws with. Shapes in millimetres, at the ordinary sizes of such objects."""

from __future__ import annotations

import numpy as np

from s2a.homes.solids import Surface, box, cylinder, ellipsoid, join, lathe
from s2a.homes.zoo import paint as p
from s2a.homes.zoo.shapes import pebble, plate, put, ring, scaled, settled, wrapped, writing
from s2a.homes.zoo.zoo_object import ZooObject, zoo_object


def _upright_pencil(color: tuple[int, int, int]) -> Surface:
    """A sharpened pencil 180 mm long, its point up."""
    parts = [lathe([(0, 12), (3.7, 12), (3.7, 160), (0, 160)], color, sides=6)]
    parts += [lathe([(0, 160), (3.7, 160), (1.2, 174), (0, 174)], p.TAN, sides=6)]
    parts += [lathe([(0, 174), (1.2, 174), (0.1, 180), (0, 180)], p.BLACK, sides=6)]
    return join(
        *parts,
        lathe([(0, 6), (3.9, 6), (3.9, 14), (0, 14)], p.GOLD),
        lathe([(0, 0), (3.6, 0), (3.6, 7), (0, 7)], p.PINK),
    )


def _pencil() -> Surface:
    """180 mm long, lying on one of its six sides."""
    return settled(put(_upright_pencil(p.YELLOW), 0, -90, 0, roll=-90), 0.75)


def _pen() -> Surface:
    """A ballpoint pen 140 mm long, lying."""
    body = [
        lathe([(0, -70), (0.5, -70), (3, -58), (5, -50), (5, 0), (0, 0)], p.BLACK, sides=12),
        lathe([(0, 0), (5.4, 0), (5, 62), (0, 62)], p.BLUE, sides=12),
        lathe([(0, 62), (2.6, 62), (2.6, 72), (0, 72)], p.SILVER, sides=12),
        lathe([(0, -1.5), (5.6, -1.5), (5.6, 1.5), (0, 1.5)], p.GOLD, sides=12),
    ]
    clip = join(box((5, 8), (-1.8, 1.8), (52, 56), p.SILVER), box((7, 8.2), (-1.8, 1.8), (18, 56), p.SILVER))
    return settled(put(put(join(*body, clip), yaw=15), roll=-90), 0.75)


def _eraser() -> Surface:
    """60 mm long, in its paper sleeve."""
    sleeve = [box((-12, 12), (y, y + 14), (-0.4, 13.4), c) for y, c in ((-12, p.BLUE), (2, p.WHITE), (16, p.BLACK))]
    return settled(join(put(pebble((23, 64, 13), p.WHITE, 7)), *sleeve), 0)


def _ruler() -> Surface:
    """310 mm long with a scale of 30 cm."""
    marks = [
        box((7 if i % 10 else 0, 16), (y, y + 0.9), (2.9, 3.5), p.BLACK)
        for i, y in enumerate(np.arange(-150, 151, 5).tolist())
    ]
    digits = [
        put(writing(str(n), 4.5 + 4 * (n > 9), p.BLACK, 0.6), -2, 10 * n - 150, 2.9, pitch=-90) for n in range(0, 31, 5)
    ]
    return join(box((-18, 18), (-155, 155), (0, 3), p.YELLOW), *marks, *digits)


def _scissors() -> Surface:
    """180 mm long, lying open."""
    blade = plate([(-7, 0), (7, -6), (8, 40), (0, 105), (-5, 60)], (0, 3), p.SILVER)
    shank = plate([(-7, 4), (7, 4), (2, -34), (-12, -30)], (-1, 5), p.RED)
    bow = scaled(ring(1, 0.34, p.RED, sides=10), 19, 28, 16)
    half = join(blade, shank, put(bow, -16, -52, 2.6))
    other = put(half, z=3, pitch=180)
    return settled(join(put(half, yaw=-15), put(other, z=2, yaw=15), put(cylinder(5, 9, p.STEEL), z=-1)), 0.5)


def _pencil_cup() -> Surface:
    """A cup of pens, 190 mm high."""
    mug = lathe([(0, 0), (40, 0), (40, 100), (36, 100), (36, 4), (0, 4)], p.TEAL, sides=28)
    bands = [put(ring(40, 3, p.WHITE), z=z) for z in (14, 86)]
    leans = ((-12, 9, p.YELLOW), (12, 4, p.RED), (2, -11, p.GREEN), (-3, -3, p.BLUE), (9, 12, p.ORANGE))
    pencils = [put(_upright_pencil(c), y, -x, 6, pitch=0.9 * y, roll=x) for x, y, c in leans]
    rule = put(box((-1.5, 1.5), (-12, 12), (0, 190), p.BEECH), -18, 6, 5, roll=4)
    return join(mug, *bands, *pencils, rule)


def _highlighter() -> Surface:
    """A text marker 125 mm long, lying, its cap off."""
    body = put(pebble((22, 78, 15), p.LIME, 5), 0, -20)
    neck = put(lathe([(0, 0), (6, 0), (5, 14), (0, 14)], p.BLACK), 0, 17, 7.5, roll=-90)
    tip = plate([(-3.5, 30), (3.5, 30), (3.5, 37), (-3.5, 42)], (5, 10), p.LIME)
    cap = put(join(put(pebble((22, 44, 15), p.LIME, 5)), box((-3, 3), (-18, 22), (14, 17), p.BLACK)), 40, 5, 0, yaw=35)
    return settled(join(body, neck, tip, box((-11.3, 11.3), (-40, -8), (-0.1, 15.2), p.BLACK), cap), 0)


def _set_square() -> Surface:
    """A triangle with a long side of 160 mm, lying."""
    corners = np.array([(0, 80), (0, -80), (-80, 0)], float)
    inner = (corners - (-30, 0)) * 0.42 + (-30, 0)
    parts = [plate([corners[i], corners[(i + 1) % 3], inner[(i + 1) % 3], inner[i]], (0, 2.5), p.SKY) for i in range(3)]
    marks = [
        box((-9 if i % 5 == 0 else -5, -0.5), (y, y + 0.8), (2.4, 3), p.NAVY)
        for i, y in enumerate(np.arange(-70, 71, 4).tolist())
    ]
    return join(*parts, *marks, put(writing("0   5   10", 56, p.NAVY, 0.6), -10.5, 0, 2.5, pitch=-90))


def _glue() -> Surface:
    """A glue stick, 100 mm high, its cap beside it."""
    body = [
        cylinder(13, 16, p.RED),
        put(cylinder(12.5, 56, p.YELLOW), z=16),
        put(cylinder(11.5, 10, p.WHITE), z=72),
        put(cylinder(9, 20, p.CREAM), z=80),
    ]
    name = put(wrapped(writing("GLUE", 21, p.RED, 1), 12.3), z=38)
    return join(*body, name, put(lathe([(0, 0), (13.5, 0), (12.5, 30), (0, 30)], p.RED), 8, 34))


def _magnifier() -> Surface:
    """A magnifying glass 200 mm long, lying."""
    lens = join(put(ellipsoid((82, 82, 8), p.SKY, sides=32), 0, 55, 4.7), put(ring(42, 9, p.GOLD), 0, 55, 4.7))
    handle = put(
        lathe([(0, 0), (6, 0), (9, 20), (7, 40), (10, 85), (6, 92), (0, 92)], p.WALNUT, sides=16), 0, -5, 10.5, roll=90
    )
    glint = put(plate([(-14, -16), (-8, -20), (12, 18), (6, 20)], (0, 1), p.WHITE), 0, 55, 8)
    return settled(join(lens, handle, put(cylinder(6, 22, p.GOLD), 0, 13, 8, roll=90), glint), 0.9)


def objects() -> list[ZooObject]:
    """Return the objects of this module."""
    return [
        zoo_object("pencil", "stationery", _pencil()),
        zoo_object("ballpoint pen", "stationery", _pen()),
        zoo_object("eraser", "stationery", _eraser()),
        zoo_object("ruler", "stationery", _ruler()),
        zoo_object("scissors", "stationery", _scissors(), "inside"),
        zoo_object("cup of pencils", "stationery", _pencil_cup()),
        zoo_object("highlighter", "stationery", _highlighter()),
        zoo_object("set square", "stationery", _set_square()),
        zoo_object("glue stick", "stationery", _glue()),
        zoo_object("magnifying glass", "stationery", _magnifier()),
    ]
