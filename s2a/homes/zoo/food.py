"""Kitchen: food. Shapes in millimetres, at the ordinary sizes of such objects."""

from __future__ import annotations

import numpy as np

from s2a.homes.solids import Surface, box, cylinder, ellipsoid, join, lathe
from s2a.homes.zoo import paint as p
from s2a.homes.zoo.shapes import arc, in_plane, loft, pebble, plate, put, ring, settled, tube, turned, wrapped, writing
from s2a.homes.zoo.zoo_object import ZooObject, zoo_object


def _apple() -> Surface:
    """80 mm wide, with stem and leaf."""
    flesh = turned([(10, 3), (18, 0), (34, 16), (40, 42), (30, 64), (14, 68), (3, 60)], p.RED)
    leaf = put(plate(arc(1, 0, 360, 13)[:-1] * (16, 8), (0, 1.5), p.LEAF), 14, 6, 78, pitch=-20, yaw=25)
    return join(flesh, tube([(0, 0, 58), (1, 0, 72), (6, 2, 84)], 2.2, p.WALNUT), leaf)


def _banana() -> Surface:
    """190 mm long, lying on its side."""
    radii = np.interp(range(16), [0, 1, 3, 8, 12, 14, 15], [5, 6, 14, 18, 15, 6, 5])
    path = np.column_stack([arc(105, 25, 150, 16), 0.866 * radii])
    ends = [tube(in_plane(arc(105, *span, 4), 2, 5), 5.5, p.WALNUT) for span in ((22, 26), (149, 154))]
    return settled(put(join(tube(path, radii, p.YELLOW, 6), *ends), yaw=-90), 2)


def _carrot() -> Surface:
    """180 mm long with green leaves, lying."""
    radii = [(-110, 2), (-80, 7), (-20, 14), (30, 18), (45, 16), (52, 6)]
    root = tube([(0, y, r) for y, r in radii], [r for _, r in radii], p.ORANGE, 14)
    lines = [
        put(ring(r, 1.6, p.COPPER), 0, y, r - 0.2, roll=90)
        for r, y in ((9.5, -60), (12.9, -30), (15.7, -5), (17.4, 22))
    ]
    angles = np.radians([-50, -25, 0, 25, 50])
    stalks = [
        tube([(0, 48, 18), (22 * np.sin(a), 78, 12), (62 * np.sin(a), 130, 8)], [3, 3, 1], p.LEAF) for a in angles
    ]
    tufts = [
        put(ellipsoid((20, 34, 14), p.GREEN), 22 * k * np.sin(a), 48 + 26 * k, 8)
        for a in angles
        for k in (1.6, 2.4, 3.1)
    ]
    return settled(join(root, *lines, *stalks, *tufts), 3)


def _loaf() -> Surface:
    """A loaf of bread, 280 mm long, cut three times."""
    crust = put(pebble((130, 280, 95), p.BRONZE, 2.6))
    cuts = [put(pebble((100, 16, 14), p.CREAM, 2), 0, y, 83 - abs(y) / 14, yaw=25) for y in (-70, 0, 70)]
    return settled(join(crust, *cuts), 12)


def _pizza() -> Surface:
    """300 mm wide."""
    base = join(cylinder(146, 12, p.TAN, sides=40), put(ring(138, 26, p.BRONZE, 0.9), z=11))
    cheese = put(join(cylinder(130, 4, p.RED, sides=40), cylinder(124, 6, p.YELLOW, sides=40)), z=12)
    spots = [(0, 0)] + [
        (r * np.cos(a), r * np.sin(a)) for r, n in ((55, 5), (98, 9)) for a in 2 * np.pi * np.arange(n) / n
    ]
    salami = [put(cylinder(19, 4, p.RED, sides=16), x, y, 17) for x, y in spots[::2]]
    basil = [put(ellipsoid((26, 13, 5), p.GREEN), x, y, 20, yaw=7 * x) for x, y in spots[1::2]]
    olives = [put(ring(6, 5, p.BLACK), 0.8 * y, -0.8 * x, 20) for x, y in spots[2::3]]
    return join(base, cheese, *salami, *basil, *olives)


def _wine_bottle() -> Surface:
    """A bottle of 0.75 litres, 300 mm high."""
    glass = turned([(36, 0), (37, 4), (37, 180), (32, 205), (15, 232), (14, 290), (14, 298)], p.BOTTLE)
    label = join(put(cylinder(37.6, 80, p.CREAM), z=70), put(wrapped(writing("VINO", 44, p.WINE, 1), 37.4), z=110))
    emblem = put(wrapped(box((0, 1), (-18, 18), (0, 4), p.GOLD), 37.4), z=95)
    return join(glass, label, emblem, put(cylinder(15.6, 62, p.WINE), z=240))


def _pineapple() -> Surface:
    """290 mm high with its leaves."""
    body = turned([(34, 0), (52, 25), (62, 75), (56, 125), (36, 155)], p.AMBER)
    radius = np.interp(range(160), [0, 25, 75, 125, 155], [34, 52, 62, 56, 36])
    spots = [(z, 30 * i + 15 * (k % 2)) for k, z in enumerate(range(14, 150, 15)) for i in range(12)]
    eyes = [
        put(put(ellipsoid((9, 15, 13), p.BROWN if k % 2 else p.ORANGE, sides=6), radius[z] - 0.5), 0, 0, z, yaw=a)
        for k, (z, a) in enumerate(spots)
    ]
    blade = [(0, 0), (9, 60), (22, 105), (44, 135)]
    leaves = [
        put(
            tube(in_plane([(s * x + 6, z * (1.25 - 0.3 * s)) for x, z in blade], 1), [13, 13, 8, 1], p.LEAF, 6, flat=2),
            z=146,
            yaw=a + 24 * s,
        )
        for s in (0.35, 0.9, 1.5)
        for a in range(0, 360, 60)
    ]
    return join(body, *eyes, *[put(leaf) for leaf in leaves])


def _cheese() -> Surface:
    """A wedge with holes, 120 mm long and 65 mm high."""
    wedge = plate([(70, -60), (70, 60), (-70, 0)], (0, 65), p.YELLOW)
    rind = plate([(70, -60), (75, -56), (75, 56), (70, 60)], (0, 65), p.ORANGE)
    side = [(-40, 26, 9), (-10, 46, 11), (10, 16, 10), (44, 40, 14), (36, 12, 7), (-22, 12, 6)]
    turn = np.degrees(np.arctan2(60, 140))
    holes = [
        put(put(ellipsoid((2 * s, 2.5, 2 * s), p.AMBER), x + 6, 0, z), 0, 30 * k, 0, yaw=k * turn)
        for x, z, s in side
        for k in (-1, 1)
    ]
    top = [
        put(ellipsoid((2 * s, 2 * s, 2.5), p.AMBER), x, y, 65)
        for x, y, s in ((45, -20, 12), (40, 24, 8), (5, 4, 10), (-30, -2, 6))
    ]
    return put(join(wedge, rind, *holes, *top), yaw=-60)


def _doughnut() -> Surface:
    """90 mm wide, with pink icing and sprinkles."""
    dough, icing = ring(28, 34, p.BRONZE, 1.0, 16), put(ring(28, 34.5, p.PINK, 0.8, 16), z=4.5)
    spots = np.random.default_rng(4).uniform((0, 18, 0), (360, 38, 180), (60, 3))
    paints = (p.WHITE, p.BLUE, p.YELLOW, p.GREEN)
    heights = 4.2 + 0.8 * np.sqrt(17.3**2 - (spots[:, 1] - 28) ** 2)
    sprinkles = [
        put(put(box((-3, 3), (-0.9, 0.9), (0, 1.6), paints[i % 4]), r, 0, h, yaw=t), yaw=a)
        for i, ((a, r, t), h) in enumerate(zip(spots, heights, strict=True))
    ]
    return settled(join(dough, icing, *sprinkles), 3)


def _nutella() -> Surface:
    """A jar of 450 g, 125 mm high."""
    jar = loft([(0, 36, 42), (4, 38, 45), (70, 38, 45), (92, 34, 38), (102, 32, 34)], p.CHOCOLATE, 32, 2.6)
    label = loft([(24, 38.5, 45.5), (68, 38.5, 45.5)], p.WHITE, 32, 2.6)
    name = put(join(writing("nutella", 58, p.RED, 4), put(box((0, 4), (-29, -22), (0, 9), p.BLACK))), 36, 0, 46)
    bread = join(
        put(pebble((3, 26, 20), p.TAN, 4), 38.5, -10, 25), put(pebble((3, 18, 13), p.CHOCOLATE, 4), 39.5, -10, 28)
    )
    nuts = [put(ellipsoid((5, 11, 11), p.BRONZE), 39, y, 32) for y in (10, 20)]
    return join(
        jar, label, name, bread, *nuts, put(lathe([(0, 0), (37, 0), (37, 22), (35, 24), (0, 24)], p.WHITE), z=100)
    )


def objects() -> list[ZooObject]:
    """Return the objects of this module."""
    return [
        zoo_object("apple", "kitchen", _apple(), "inside"),
        zoo_object("banana", "kitchen", _banana()),
        zoo_object("carrot", "kitchen", _carrot()),
        zoo_object("loaf of bread", "kitchen", _loaf()),
        zoo_object("pizza", "kitchen", _pizza()),
        zoo_object("wine bottle", "kitchen", _wine_bottle()),
        zoo_object("pineapple", "kitchen", _pineapple()),
        zoo_object("wedge of cheese", "kitchen", _cheese()),
        zoo_object("doughnut", "kitchen", _doughnut()),
        zoo_object("Nutella", "kitchen", _nutella(), rare=True),
    ]
