"""Living room: on the wall, for the evening. Shapes in millimetres, at the ordinary sizes of such objects."""

from __future__ import annotations

import numpy as np

from s2a.homes.solids import WOOD, Surface, box, cylinder, ellipsoid, join, lathe
from s2a.homes.zoo import shapes as p
from s2a.homes.zoo.shapes import ZooObject, arc, pebble, plate, put, ring, settled, smooth, tube, turned, zoo_object

ROUND = range(0, 360, 30)


def _image() -> Surface:
    """A framed landscape, 600 by 450 mm."""
    frame = join(box((0, 24), (-300, 300), (0, 450), p.GOLD), box((0, 26), (-262, 262), (38, 412), p.WHITE))
    hill = np.concatenate(
        [[(-230, 70)], [(230, 70)], [(230, 150), (150, 190), (40, 170), (-60, 150), (-150, 190), (-230, 170)]]
    )
    peaks = [
        plate([(a - 120, 150), (a + 120, 150), (a, top)], (25, 28.5), p.NAVY, 0) for a, top in ((-90, 310), (70, 345))
    ]
    snow = [
        plate([(a - 30, top - 40), (a, top - 52), (a + 30, top - 40), (a, top)], (25, 29), p.WHITE, 0)
        for a, top in ((-90, 310), (70, 345))
    ]
    sun = plate(arc(30, 0, 360, 25)[:-1] + (170, 330), (25, 28), p.YELLOW, 0)
    return join(
        frame, box((25, 27.4), (-230, 230), (70, 380), p.SKY), sun, *peaks, *snow, plate(hill, (25, 30), p.GREEN, 0)
    )


def _wall_clock() -> Surface:
    """300 mm wide, at ten past ten."""
    case = put(join(cylinder(150, 32, p.BLACK, sides=48), cylinder(134, 34, p.WHITE, sides=48)), 0, 0, 150, pitch=90)
    marks = [
        put(box((34, 36), (-w, w), (108, 126), p.BLACK), 0, 0, 150, roll=a)
        for a in ROUND
        for w in (5 if a % 90 == 0 else 2.5,)
    ]
    hands = [
        put(box((35, 38), (-w, w), (-18, n), c), 0, 0, 150, roll=-a)
        for a, n, w, c in ((-55, 66, 5, p.BLACK), (60, 98, 4, p.BLACK), (180, 90, 1.5, p.RED))
    ]
    return join(case, *marks, *hands, put(cylinder(9, 40, p.RED), 0, 0, 150, pitch=90))


def _orange_bowl() -> Surface:
    """A bowl of oranges, 280 mm wide."""
    bowl = lathe(
        [(0, 0), (60, 0), (62, 8), (118, 50), (140, 90), (134, 90), (112, 54), (50, 14), (0, 14)], p.NAVY, sides=36
    )
    spots = [(70 * np.cos(a), 70 * np.sin(a), 82) for a in np.radians(range(0, 360, 60))] + [
        (36 * np.cos(a), 36 * np.sin(a), 136) for a in np.radians((30, 150, 270))
    ]
    fruit = join(ellipsoid((78, 78, 74), p.ORANGE, sides=20), put(ellipsoid((8, 8, 5), p.LEAF), z=36))
    leaf = put(ellipsoid((40, 18, 4), p.LEAF), 28, 0, 176, pitch=-20)
    return join(bowl, *[put(fruit, *spot, roll=12 * (i % 3)) for i, spot in enumerate([*spots, (0, 0, 60)])], leaf)


def _books() -> Surface:
    """Five books in a stack, 150 mm high."""
    parts, z = [], 0.0
    paints = (p.NAVY, p.RED, p.GREEN, p.AMBER, p.PURPLE)
    for i, (high, wide, color) in enumerate(zip((38, 26, 34, 22, 28), (250, 236, 220, 205, 190), paints, strict=True)):
        x, y = 0.36 * wide, wide / 2
        covers = [box((-x, x), (-y, y), span, color) for span in ((0, 3), (high - 3, high))] + [
            box((x - 3, x), (-y, y), (0, high), color)
        ]
        pages = box((-x + 4, x - 3), (-y + 4, y - 4), (3, high - 3), p.CREAM)
        title = [box((x, x + 0.8), (-0.5 * y, 0.4 * y), (0.4 * high, 0.6 * high), p.GOLD)] + [
            box((x, x + 0.8), (s, s + 4), (0, high), p.GOLD) for s in (-0.8 * y, 0.74 * y)
        ]
        parts.append(put(join(*covers, pages, *title), z=z, yaw=(0, 6, -5, 9, -7)[i] + 180 * (i == 3)))
        z += high
    return join(*parts)


def _lantern() -> Surface:
    """A lantern with a candle inside, 330 mm high."""
    floor = [put(box((-75, 75), (-75, 75), (z, z + 14), p.BLACK)) for z in (0, 190)]
    posts = [box((x - 7, x + 7), (y - 7, y + 7), (10, 195), p.BLACK) for x in (-63, 63) for y in (-63, 63)]
    bars = [
        put(join(box((60, 66), (-63, 63), (97, 103), p.BLACK), box((60, 66), (-3, 3), (14, 190), p.BLACK)), yaw=a)
        for a in (0, 90, 180, 270)
    ]
    roof = put(lathe([(0, 0), (112, 0), (30, 56), (30, 72), (0, 72)], p.BLACK, sides=4), z=202, yaw=45)
    candle = [put(cylinder(30, 80, p.CREAM), z=14), put(turned([(3, 0), (11, 14), (1, 42)], p.ORANGE), z=96)]
    return join(*floor, *posts, *bars, roof, *candle, put(ring(34, 7, p.GOLD), 0, 0, 300, pitch=90))


def _record_player() -> Surface:
    """420 mm wide."""
    case = join(
        put(pebble((350, 420, 90), p.BROWN, 12, WOOD), z=12),
        *[put(cylinder(20, 14, p.BLACK), x, y) for x in (-130, 130) for y in (-165, 165)],
    )
    disc = put(join(cylinder(152, 8, p.SILVER, sides=40), cylinder(148, 12, p.BLACK, sides=40)), 0, -40, 101)
    grooves = [put(ring(r, 2, p.DARK, sides=6), 0, -40, 113.2) for r in (70, 92, 112, 132)]
    label = put(join(cylinder(48, 2, p.RED), cylinder(4, 14, p.SILVER)), 0, -40, 112)
    pivot = put(join(cylinder(26, 20, p.DARK), cylinder(12, 34, p.SILVER)), -110, 160, 100)
    arm = tube([(-140, 166, 128), (-110, 160, 128), (40, 140, 124), (84, 72, 120)], 5, p.SILVER)
    head = put(pebble((44, 22, 12), p.BLACK, 5), 88, 64, 114, yaw=-52)
    return join(
        case,
        disc,
        *grooves,
        label,
        pivot,
        arm,
        head,
        *[put(cylinder(13, 12, p.SILVER), x, 170, 100) for x in (90, 130)],
    )


def _wreath() -> Surface:
    """A wreath of fir with red berries and a bow, 350 mm wide."""
    rng = np.random.default_rng(1)
    hoop = put(ring(130, 52, p.LEAF, 0.7, 8), 32, 0, 175, pitch=90)
    twigs = []
    for a in np.arange(0, 360, 5):
        needle = put(
            ellipsoid((12, 16, 76), p.GREEN if a % 10 else p.LEAF, sides=6),
            36 + rng.uniform(-4, 16),
            rng.uniform(-12, 12),
            138,
            roll=rng.uniform(25, 75),
        )
        twigs.append(put(needle, 0, 0, 175, roll=float(a)))
    berries = [
        put(ellipsoid((18, 18, 18), p.RED), 62, 130 * np.sin(a) + s, 175 + 130 * np.cos(a) + t)
        for a in np.radians(range(20, 360, 45))
        for s, t in ((0, 0), (16, 6), (4, 17))
    ]
    bow = [put(ellipsoid((26, 86, 54), p.RED), 66, s * 44, 52, roll=s * 14) for s in (-1, 1)] + [
        put(ellipsoid((36, 30, 30), p.WINE), 72, 0, 50)
    ]
    tails = [
        put(plate([(-14, 0), (14, 0), (18, -90), (0, -76), (-18, -90)], (0, 4), p.RED, 0), 64, s * 14, 46, roll=s * 16)
        for s in (-1, 1)
    ]
    return join(hoop, *twigs, *berries, *bow, *tails)


def _ukulele() -> Surface:
    """A soprano ukulele, 530 mm long, leaning against the wall."""
    side = smooth([(0, 0), (60, 6), (82, 60), (70, 105), (50, 130), (60, 175), (52, 215), (20, 232), (0, 234)], 30)
    outline = np.concatenate([side, side[-2:0:-1] * (-1, 1)])
    body = join(
        plate(outline, (0, 60), p.BROWN, 0), plate((outline - (0, 117)) * 0.96 + (0, 117), (59, 62), p.AMBER, 0)
    )
    hole = put(join(cylinder(27, 2, p.WALNUT), cylinder(23, 3, p.BLACK)), 61, 0, 146, pitch=90)
    neck = join(put(pebble((26, 38, 250), p.BROWN, 6), 48, 0, 205), box((60, 66), (-18, 18), (180, 440), p.BLACK))
    frets = [box((66, 67.2), (-18, 18), (z, z + 2), p.SILVER) for z in np.linspace(215, 425, 10)]
    head = plate([(-20, 440), (20, 440), (30, 520), (12, 530), (-12, 530), (-30, 520)], (46, 60), p.BROWN, 0)
    pegs = [
        join(
            put(cylinder(4, 26, p.SILVER), 50, s * 38, z, roll=90 * s),
            put(pebble((8, 16, 14), p.WHITE, 4), 50, s * 42, z - 7),
        )
        for s in (-1, 1)
        for z in (470, 502)
    ]
    bridge = box((61, 68), (-34, 34), (62, 74), p.WALNUT)
    strings = [tube([(69, y, 68), (69, 0.9 * y, 440)], 0.8, p.WHITE, 5) for y in (-13, -4.5, 4.5, 13)]
    return settled(put(join(body, hole, neck, *frets, head, *pegs, bridge, *strings), pitch=-14), 4)


def objects() -> list[ZooObject]:
    """Return the objects of this module."""
    return [
        zoo_object("framed painting", "living room", _image(), "hanging"),
        zoo_object("wall clock", "living room", _wall_clock(), "hanging"),
        zoo_object("bowl of oranges", "living room", _orange_bowl()),
        zoo_object("stack of books", "living room", _books()),
        zoo_object("lantern", "living room", _lantern()),
        zoo_object("record player", "living room", _record_player()),
        zoo_object("wreath", "living room", _wreath(), "hanging"),
        zoo_object("ukulele", "living room", _ukulele(), "against wall", rare=True),
    ]
