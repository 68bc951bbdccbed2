"""Kitchen: what one cooks and eats with. Shapes in millimetres, at the ordinary sizes of such objects."""

from __future__ import annotations

import numpy as np

from s2a.homes.solids import WOOD, Surface, box, cylinder, ellipsoid, join, lathe
from s2a.homes.zoo import paint as p
from s2a.homes.zoo.shapes import arc, in_plane, loft, pebble, plate, put, settled, smooth, tube, turned
from s2a.homes.zoo.zoo_object import ZooObject, zoo_object


def _frying_pan() -> Surface:
    """260 mm wide, 440 mm long with its handle."""
    pan = lathe([(0, 0), (105, 0), (130, 48), (126, 48), (102, 4), (0, 4)], p.DARK, sides=36)
    grip = put(pebble((26, 165, 20), p.BLACK, 4), 0, 235, 48, roll=8)
    egg = [
        plate(arc(1, 0, 360, 17)[:-1] * (48, 40) + (6, 4), (4, 9), p.WHITE),
        put(ellipsoid((32, 32, 16), p.YELLOW), 4, 6, 9),
    ]
    return join(pan, grip, tube([(0, 124, 38), (0, 165, 52)], 8, p.STEEL), *egg)


def _cooking_pot() -> Surface:
    """A pot of 4 litres, 220 mm wide, with its lid."""
    body = lathe([(0, 0), (108, 0), (112, 6), (112, 130), (108, 130), (108, 6), (0, 6)], p.STEEL, sides=36)
    lid = put(turned([(114, 0), (114, 5), (80, 22), (10, 32)], p.SILVER, sides=36), z=130)
    knob = put(turned([(9, 0), (9, 10), (20, 18), (18, 28)], p.BLACK), z=160)
    ears = [
        tube([(x, s * 105, 100), (x * 0.9, s * 142, 104), (-x * 0.9, s * 142, 104), (-x, s * 105, 100)], 7, p.BLACK)
        for x in (38,)
        for s in (-1, 1)
    ]
    return join(body, lid, knob, *ears)


def _kettle() -> Surface:
    """An electric kettle of 1.7 litres, 250 mm high, its spout to the left."""
    base = lathe([(0, 0), (85, 0), (85, 14), (70, 22), (0, 22)], p.BLACK)
    body = turned([(78, 24), (80, 40), (66, 140), (56, 205)], p.STEEL)
    lid = join(put(turned([(57, 0), (50, 14), (14, 20)], p.BLACK), z=205), put(ellipsoid((24, 24, 18), p.BLACK), z=230))
    handle = tube(
        in_plane(smooth([(50, 208), (100, 214), (122, 180), (118, 90), (82, 56)], 14), 0), 12, p.BLACK, flat=1.3
    )
    spout = put(loft([(0, 22, 18, 0, 0), (38, 15, 13, 0, -12), (56, 13, 8, 0, -30)], p.STEEL), 0, -48, 152)
    gauge = put(pebble((8, 16, 100), p.SKY, 5), 68, 0, 60, pitch=-8)
    return join(base, body, lid, handle, spout, gauge)


def _wine_glass() -> Surface:
    """200 mm high, half full of red wine."""
    foot = turned([(36, 0), (34, 3), (8, 7), (4, 20), (4, 80), (6, 92)], p.SKY)
    bowl = lathe(
        [(0, 90), (6, 90), (28, 102), (41, 130), (39, 165), (33, 205), (31, 205), (37, 165), (38, 148), (0, 148)],
        p.SKY,
        sides=28,
    )
    wine = lathe([(0, 92), (27, 104), (41.5, 130), (41.0, 150), (0, 150)], p.WINE, sides=28)
    return join(foot, bowl, wine)


def _cutting_board() -> Surface:
    """360 by 240 mm with a handle and a hole, leaning upright."""
    board = put(pebble((20, 240, 300), p.BEECH, 12, WOOD))
    grip = put(pebble((18, 70, 110), p.BEECH, 6, WOOD), z=280)
    hole = put(cylinder(13, 24, p.WALNUT), -12, 0, 352, pitch=90)
    groove = [
        box((7, 10.8), y, z, p.BROWN)
        for y, z in (
            ((-100, 100), (22, 27)),
            ((-100, 100), (270, 275)),
            ((-100, -95), (22, 275)),
            ((95, 100), (22, 275)),
        )
    ]
    return settled(put(join(board, grip, hole, *groove), pitch=-12), 1)


def _rolling_pin() -> Surface:
    """420 mm long, lying."""
    roller = lathe([(0, -120), (26, -120), (29, -114), (29, 114), (26, 120), (0, 120)], p.BEECH, WOOD, 20)
    # On one of its sides, not on an edge between two.
    roller = put(put(roller, yaw=9), z=29, roll=90)
    grips = [put(turned([(7, 118), (8, 126), (14, 150), (15, 190), (9, 208)], p.RED), z=29, roll=r) for r in (-90, 90)]
    return settled(join(roller, *grips), 0.6)


def _teapot() -> Surface:
    """A pot of 1 litre, 230 mm from handle to spout."""
    body = turned([(40, 0), (44, 4), (74, 45), (70, 80), (38, 108)], p.TEAL)
    lid = join(put(turned([(38, 106), (36, 114), (8, 124)], p.CREAM)), put(ellipsoid((24, 24, 22), p.CREAM), z=132))
    spout = tube(
        in_plane(smooth([(60, 40), (92, 52), (104, 84), (124, 104)], 12), 0), np.linspace(20, 9, 12), p.TEAL, 14
    )
    handle = tube(in_plane(smooth([(-58, 92), (-104, 98), (-118, 64), (-66, 28)], 14), 0), 8, p.TEAL)
    dots = [
        put(ellipsoid((16, 16, 16), p.CREAM), 66 * np.cos(a), 66 * np.sin(a), 62)
        for a in np.radians([-50, -25, 0, 25, 50])
    ]
    return join(body, lid, spout, handle, *dots)


def _toaster() -> Surface:
    """For two slices, 190 mm high."""
    case = put(pebble((180, 290, 175), p.RED, 7), z=12)
    slots = [put(box((-16, 16), (-105, 105), (184, 188.5), p.BLACK), x) for x in (-36, 36)]
    bread = [
        join(put(pebble((16, 125, 90), p.BRONZE, 6), x, 0, 150), put(pebble((17, 105, 78), p.CREAM, 6), x, 0, 152))
        for x in (-36, 36)
    ]
    lever = join(box((-7, 7), (144, 148), (50, 150), p.BLACK), put(pebble((44, 30, 16), p.BLACK, 4), 0, 156, 120))
    knob = put(cylinder(17, 16, p.SILVER), 86, 90, 52, pitch=90)
    feet = [put(cylinder(14, 16, p.BLACK), x, y) for x in (-55, 55) for y in (-105, 105)]
    return join(case, *slots, *bread, lever, knob, *feet, box((86, 91.5), (-110, 60), (46, 54), p.SILVER))


def _knife() -> Surface:
    """A chef's knife 320 mm long, lying."""
    blade = plate([(-22, -8), (-24, 60), (-14, 130), (8, 190), (11, 186), (14, 0), (14, -8)], (7, 9.5), p.SILVER)
    grip = put(pebble((26, 125, 17), p.BLACK, 5), 3, -68)
    rivets = [put(cylinder(4, 18, p.SILVER, sides=12), 3, y) for y in (-105, -70, -35)]
    return join(blade, grip, *rivets, put(pebble((27, 12, 18), p.STEEL, 6), 3, -8))


def _moka() -> Surface:
    """A stove-top coffee maker for six cups, 220 mm high: eight-sided, its spout to the left."""
    lower = lathe([(0, 0), (50, 0), (52, 6), (39, 88), (0, 88)], p.STEEL, sides=8)
    waist = put(lathe([(0, 0), (42, 0), (42, 14), (0, 14)], p.SILVER, sides=24), z=88)
    upper = lathe([(0, 102), (38, 102), (52, 182), (0, 182)], p.STEEL, sides=8)
    lid = join(
        lathe([(0, 182), (53, 182), (8, 203), (0, 203)], p.SILVER, sides=8),
        put(turned([(6, 200), (10, 212), (7, 224)], p.BLACK)),
    )
    spout = put(plate([(-40, 150), (-44, 182), (-76, 184)], (-13, 13), p.STEEL, 0))
    handle = tube(in_plane([(44, 176), (98, 186), (92, 130), (82, 84)], 0), [8, 10, 10, 7], p.BLACK, 8, flat=1.2)
    valve = put(cylinder(6, 12, p.GOLD, sides=12), 42, 18, 55, pitch=90)
    return join(*[put(s, yaw=0) for s in (lower, waist, upper, lid)], spout, handle, valve)


def objects() -> list[ZooObject]:
    """Return the objects of this module."""
    return [
        zoo_object("frying pan with a fried egg", "kitchen", _frying_pan()),
        zoo_object("cooking pot", "kitchen", _cooking_pot()),
        zoo_object("electric kettle", "kitchen", _kettle()),
        zoo_object("glass of red wine", "kitchen", _wine_glass()),
        zoo_object("cutting board", "kitchen", _cutting_board(), "against wall"),
        zoo_object("rolling pin", "kitchen", _rolling_pin()),
        zoo_object("teapot", "kitchen", _teapot()),
        zoo_object("toaster", "kitchen", _toaster()),
        zoo_object("kitchen knife", "kitchen", _knife(), "inside"),
        zoo_object("Bialetti moka", "kitchen", _moka(), rare=True),
    ]
