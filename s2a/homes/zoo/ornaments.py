"""Living room: ornaments. Shapes in millimetres, at the ordinary sizes of such objects."""

from __future__ import annotations

import numpy as np

from s2a.homes.solids import Surface, box, cylinder, ellipsoid, join, lathe
from s2a.homes.zoo import paint as p
from s2a.homes.zoo.shapes import in_plane, loft, pebble, plate, put, ring, smooth, tube, turned
from s2a.homes.zoo.zoo_object import ZooObject, zoo_object

ROUND = range(0, 360, 30)


def _vase() -> Surface:
    """A blue and white vase, 320 mm high."""
    body = turned([(55, 0), (60, 10), (100, 150), (90, 220), (40, 270), (38, 290), (52, 318)], p.WHITE, sides=32)
    bands = [put(ring(r, 6, p.BLUE), z=z) for r, z in ((61, 18), (41, 262), (51, 316), (91.5, 218))]
    petals = [put(put(ellipsoid((8, 34, 34), p.BLUE), 97), z=150, yaw=a) for a in ROUND]
    leaves = [
        put(put(ellipsoid((8, 16, 40), p.NAVY), r), z=z, yaw=a + 15) for a in ROUND for r, z in ((93, 110), (96, 190))
    ]
    return join(body, *bands, *petals, *leaves, put(cylinder(44, 2, p.NAVY), z=318))


def _cactus() -> Surface:
    """In a pot, 260 mm high, with two arms and a flower."""
    pot = join(
        lathe([(0, 0), (48, 0), (60, 78), (0, 78)], p.TERRACOTTA),
        lathe([(0, 76), (68, 76), (70, 98), (58, 98), (56, 90), (0, 90)], p.TERRACOTTA),
    )

    def stem(path: list[tuple[float, float]], r: float) -> Surface:
        """A round-ended stem with spines in rows."""
        line = in_plane(smooth(path, 12), 0)
        ribs = [
            tube(line + (0.86 * r * np.cos(a), 0.86 * r * np.sin(a) * (len(path) < 3), 0), 0.22 * r, p.GREEN, 6)
            for a in np.radians(ROUND)
        ]
        return join(tube(line, r, p.LEAF, 14), *ribs, put(ellipsoid((2.1 * r,) * 3, p.LEAF), *line[-1]))

    arms = [stem([(0, z), (s * 62, z + 4), (s * 66, z + 52)], 15) for s, z in ((-1, 150), (1, 172))]
    spots = [
        (put(put(box((0, 9), (-0.7, 0.7), (-0.7, 0.7), p.WHITE), 33, pitch=0), z=z, yaw=a))
        for z in range(104, 226, 16)
        for a in ROUND
    ]
    flower = [put(put(ellipsoid((26, 14, 12), p.ROSE), 12, pitch=-25), z=258, yaw=a) for a in ROUND[::2]]
    return join(
        pot, stem([(0, 85), (0, 225)], 33), *arms, *spots, *flower, put(ellipsoid((14, 14, 14), p.YELLOW), z=264)
    )


def _candelabra() -> Surface:
    """For five candles, 400 mm high."""
    foot = turned([(75, 0), (72, 10), (22, 24), (10, 50), (16, 70), (8, 100), (8, 240)], p.GOLD)
    arms = [
        tube(in_plane(smooth([(0, 140), (0.6 * r, 130), (r, 165), (r, z)], 16), 0), 6, p.GOLD)
        for r, z in ((70, 225), (140, 225), (-70, 225), (-140, 225))
    ]
    places = [(y, 225 if y else 240) for y in (-140, -70, 0, 70, 140)]
    cups = [put(lathe([(0, 0), (10, 0), (24, 12), (0, 14)], p.GOLD), 0, y, z) for y, z in places]
    wax = [put(cylinder(10, 110, p.CREAM), 0, y, z + 12) for y, z in places]
    flames = [put(turned([(2, 0), (7, 10), (1, 30)], p.ORANGE), 0, y, z + 124) for y, z in places]
    return join(foot, *arms, *cups, *wax, *flames)


def _hourglass() -> Surface:
    """180 mm high."""
    ends = [put(cylinder(46, 12, p.WALNUT), z=z) for z in (0, 168)]
    posts = [
        put(put(turned([(5, 10), (7, 40), (4, 90), (7, 140), (5, 170)], p.WALNUT), 38), yaw=a) for a in (60, 180, 300)
    ]
    glass = turned([(10, 12), (30, 26), (30, 55), (3, 90), (30, 125), (30, 154), (10, 168)], p.SKY)
    sand = [
        lathe([(0, 14), (30.6, 26), (30.6, 44), (8, 62), (0, 64)], p.AMBER),
        turned([(3.5, 90), (23, 115), (30.8, 126), (30.5, 130)], p.AMBER),
    ]
    return join(*ends, *posts, glass, *sand)


def _sailing_boat() -> Surface:
    """A model on its stand, 420 mm high."""
    hull = loft([(0, 10, 90), (18, 30, 135, 0, 4), (44, 38, 160, 0, 10), (56, 38, 172, 0, 16)], p.RED)
    deck, stripe = (
        put(loft([(0, 34, 166, 0, 16), (3, 34, 166, 0, 16)], p.BEECH), z=56),
        loft([(40, 37.6, 158.5, 0, 9), (47, 39, 163.5, 0, 11.5)], p.WHITE),
    )
    mast, boom = put(cylinder(4, 330, p.BROWN), 0, 10, 56), tube([(0, 10, 84), (0, -140, 90)], 3, p.BROWN)
    sails = [
        plate([(4, 96), (-134, 100), (4, 370)], (-1.5, 1.5), p.WHITE, 0),
        plate([(18, 84), (176, 66), (16, 340)], (-1.5, 1.5), p.CREAM, 0),
    ]
    stripes = [
        plate([(4, z), (-134 + (z - 100) * 0.52, z), (-134 + (z - 80) * 0.52, z + 20), (4, z + 20)], (-2, 2), p.BLUE, 0)
        for z in (140, 190)
    ]
    flag = plate([(10, 386), (-30, 376), (10, 366)], (-1, 1), p.RED, 0)
    stand = [box((-44, 44), (y, y + 14), (-34, 14), p.WALNUT) for y in (-70, 60)] + [
        box((-50, 50), (-110, 110), (-44, -32), p.WALNUT)
    ]
    return join(
        hull,
        deck,
        stripe,
        mast,
        boom,
        *sails,
        *stripes,
        flag,
        *stand,
        put(pebble((36, 80, 22), p.WHITE, 5), 0, -60, 56),
    )


def _trophy() -> Surface:
    """A cup on a plinth, 300 mm high."""
    plinth = join(box((-50, 50), (-50, 50), (0, 60), p.WALNUT), box((50, 51.5), (-34, 34), (16, 44), p.GOLD))
    cup = turned([(40, 60), (36, 68), (10, 84), (8, 120), (14, 132), (58, 180), (66, 240), (72, 290)], p.GOLD)
    ears = [
        tube(in_plane(smooth([(s * 66, 270), (s * 112, 272), (s * 108, 210), (s * 40, 158)], 16), 0), 6, p.GOLD)
        for s in (-1, 1)
    ]
    star = [
        (r * np.sin(a), r * np.cos(a))
        for k, a in enumerate(np.radians(np.arange(0, 360, 36)))
        for r in ((26, 11)[k % 2],)
    ]
    return join(
        plinth, cup, *ears, put(plate(star, (0, 8), p.RED, 0), 60, 0, 232), put(cylinder(64, 2, p.AMBER), z=289)
    )


def _bonsai() -> Surface:
    """A small tree in a tray, 300 mm high."""
    tray = join(
        put(pebble((150, 230, 50), p.NAVY, 6), z=8),
        put(pebble((138, 216, 8), p.WALNUT, 6), z=54),
        *[box((x, x + 20), (y, y + 20), (0, 20), p.NAVY) for x in (-60, 40) for y in (-95, 75)],
    )
    trunk = tube(
        smooth([(0, -10, 55), (6, 26, 105), (0, -6, 160), (0, 14, 215), (0, 8, 240)], 20),
        np.linspace(20, 7, 20),
        p.BROWN,
        12,
    )
    boughs = [
        tube([(0, y0, z0), (x, y, z)], 6, p.BROWN, 8)
        for x, y, z, y0, z0 in ((10, 84, 158, 14, 125), (-6, -80, 190, -4, 165), (30, -30, 215, 4, 185))
    ]
    crowns = ((10, 92, 166, 120), (-6, -86, 200, 120), (0, 10, 258, 150), (34, -28, 224, 90), (-30, 36, 214, 90))
    pads = [put(ellipsoid((0.8 * s, s, 0.42 * s), p.LEAF, sides=10), x, y, z) for x, y, z, s in crowns]
    tufts = [
        put(
            ellipsoid((0.4 * s, 0.4 * s, 0.3 * s), p.GREEN, sides=8),
            x + 0.26 * s * np.cos(a),
            y + 0.33 * s * np.sin(a),
            z + 0.06 * s,
        )
        for x, y, z, s in crowns
        for a in np.radians(range(0, 360, 60))
    ]
    return join(tray, trunk, *boughs, *pads, *tufts)


def objects() -> list[ZooObject]:
    """Return the objects of this module."""
    return [
        zoo_object("Chinese vase", "living room", _vase()),
        zoo_object("potted cactus", "living room", _cactus()),
        zoo_object("candelabra", "living room", _candelabra()),
        zoo_object("hourglass", "living room", _hourglass()),
        zoo_object("model sailing boat", "living room", _sailing_boat()),
        zoo_object("trophy", "living room", _trophy()),
        zoo_object("bonsai", "living room", _bonsai()),
    ]
