"""Bedroom: comfort. Shapes in millimetres, at the ordinary sizes of such objects."""

from __future__ import annotations

import numpy as np

from s2a.homes.solids import FABRIC, Surface, box, cylinder, ellipsoid, join, lathe, prism, stadium
from s2a.homes.zoo import paint as p
from s2a.homes.zoo.shapes import arc, in_plane, loft, pebble, plate, put, ring, scaled, settled, smooth, tube, turned
from s2a.homes.zoo.zoo_object import ZooObject, zoo_object


def _pillow() -> Surface:
    """600 by 400 mm, 130 mm thick: its corners pinched."""
    cloth = pebble((400, 600, 150), p.WHITE, 4, FABRIC, 48)
    x, y, z = cloth.vertices.T
    edge = np.clip(np.maximum(abs(x) / 200, abs(y) / 300), 0, 1)
    cloth.vertices[:, 2] = 75 + (z - 75) * (1 - 0.55 * edge**3)
    cloth.vertices[:, :2] *= 1 + 0.10 * np.clip(abs(x * y) / 60000, 0, 1)[:, None]
    stripes = [put(pebble((330, 12, 9), p.BLUE, 6), 0, y, 141 - 0.00028 * y * y) for y in (-200, -170, 170, 200)]
    return settled(join(cloth, *stripes), 12)


def _blanket() -> Surface:
    """A chequered woollen blanket, folded to 500 by 350 mm."""
    fold = put(prism(stadium(350, 42), (-250, 250), p.RED, FABRIC), z=21)
    down = [put(prism(stadium(351, 43), (x, x + 34), p.NAVY, FABRIC), z=21) for x in (-200, -70, 60, 190)]
    across = [box((-250.5, 250.5), (y, y + 22), (-0.3, 42.6), p.CREAM, FABRIC) for y in (-110, -20, 70)]
    fringe = [put(cylinder(4, 34, p.CREAM, sides=6), 248, y, 8, pitch=90) for y in range(-160, 165, 12)]
    return settled(put(join(*[put(join(fold, *down, *across, *fringe), z=41 * i) for i in range(3)]), yaw=0), 1)


def _teddy() -> Surface:
    """Sitting, 300 mm high."""
    body = put(ellipsoid((130, 150, 170), p.BRONZE, FABRIC, 20), 0, 0, 85)
    head = put(ellipsoid((125, 140, 125), p.BRONZE, FABRIC, 20), 8, 0, 210)
    ears = [
        put(join(ellipsoid((26, 54, 54), p.BRONZE, FABRIC), put(ellipsoid((22, 34, 34), p.TAN), 5)), 5, s * 58, 264)
        for s in (-1, 1)
    ]
    legs = [put(ellipsoid((140, 62, 62), p.BRONZE, FABRIC, 16), 80, s * 62, 30, yaw=s * 18) for s in (-1, 1)]
    soles = [put(ellipsoid((14, 44, 44), p.TAN), 144, s * 82, 31, yaw=s * 18) for s in (-1, 1)]
    arms = [
        put(ellipsoid((56, 52, 120), p.BRONZE, FABRIC, 16), 30, s * 78, 118, roll=s * 38, pitch=-30) for s in (-1, 1)
    ]
    snout = join(put(ellipsoid((50, 62, 48), p.TAN), 62, 0, 195), put(ellipsoid((16, 24, 17), p.BLACK), 86, 0, 204))
    eyes = [put(ellipsoid((10, 14, 14), p.BLACK), 64, s * 28, 228) for s in (-1, 1)]
    bow = [put(ellipsoid((22, 52, 32), p.RED), 62, s * 26, 152, roll=s * 12) for s in (-1, 1)] + [
        put(ellipsoid((24, 18, 18), p.RED), 66, 0, 152)
    ]
    return settled(join(body, head, *ears, *legs, *soles, *arms, snout, *eyes, *bow), 6)


def _alarm_clock() -> Surface:
    """With two bells, 165 mm high."""
    case = put(join(cylinder(58, 44, p.RED, sides=36), put(cylinder(50, 46, p.WHITE, sides=36))), -22, 0, 78, pitch=90)
    marks = [put(box((24, 26), (-2, 2), (36, 46), p.BLACK), 0, 0, 78, roll=a) for a in range(0, 360, 30)]
    hands = [put(box((24, 27), (-2.5, 2.5), (-4, n), p.BLACK), 0, 0, 78, roll=a) for a, n in ((-60, 38), (55, 26))]
    bells = [put(put(turned([(29, 0), (26, 14), (6, 24)], p.GOLD), z=66), 0, 0, 78, roll=a) for a in (-36, 36)]
    stems = [put(put(cylinder(4, 24, p.STEEL), z=50), 0, 0, 78, roll=a) for a in (-36, 36)]
    feet = [
        put(scaled(lathe([(0, -74), (6, -74), (8, -50), (0, -50)], p.GOLD), 3, 1, 1), 0, 0, 66, roll=a)
        for a in (-28, 28)
    ]
    hammer = join(box((-3, 3), (-3, 3), (130, 156), p.STEEL), put(ellipsoid((14, 30, 12), p.STEEL), z=156))
    return settled(join(case, *marks, *hands, *bells, *stems, *feet, hammer), 4)


def _slippers() -> Surface:
    """A pair, 270 mm long."""
    outline = np.concatenate([arc(1, 0, 180, 15) * (42, 60) + (0, 72), arc(1, 180, 360, 15) * (36, 50) - (0, 84)])
    sole = join(plate(outline, (0, 16), p.WALNUT), plate(0.93 * outline, (15, 22), p.CREAM))
    upper = settled(put(ellipsoid((92, 150, 104), p.BLUE, FABRIC, 20), z=52), 50)
    cuff = put(ring(1, 0.3, p.WHITE, sides=8), z=0)
    fur = put(scaled(cuff, 40, 18, 44), 0, 8, 28, roll=62)
    slipper = put(join(sole, put(upper, 0, 70, 16), fur), yaw=-90)
    return join(put(slipper, 0, -52, yaw=6), put(slipper, -8, 52, yaw=-4))


def _hot_water_bottle() -> Surface:
    """330 mm long, lying flat."""
    body = put(pebble((250, 195, 44), p.RED, 3.4), 20)
    ribs = [put(pebble((170, 7, 5), p.WINE, 4), 20, y, 41.5 - 0.0014 * y * y) for y in range(-60, 61, 20)]
    neck = put(
        loft([(0, 22, 55), (24, 18, 30), (62, 16, 24), (70, 20, 34), (76, 20, 34)], p.RED), -88, 0, 22, pitch=-90
    )
    plug = put(pebble((32, 30, 26), p.BLACK, 4), -174, 0, 10)
    return settled(join(body, *ribs, neck, plug), 4)


def _straw_hat() -> Surface:
    """360 mm wide, 110 mm high."""
    brim = lathe([(80, 0), (180, 4), (180, 9), (80, 8), (80, 0)], p.STRAW, FABRIC, 44)
    crown = turned([(88, 2), (86, 60), (74, 98), (30, 108)], p.STRAW, FABRIC, 36)
    band = lathe([(88, 8), (90, 8), (88.5, 38), (86, 38), (88, 8)], p.RED, sides=36)
    weave = [put(ring(r, 4, p.AMBER, sides=6), z=8 + 0.01 * (r - 80)) for r in (110, 135, 158)]
    bow = [put(ellipsoid((8, 46, 26), p.RED), 30, 86, 27 + s * 12, yaw=70, roll=s * 25) for s in (-1, 1)]
    return settled(join(brim, crown, band, *weave, *bow), 0.5)


def _laundry_basket() -> Surface:
    """Woven, 450 mm high and 380 mm wide, clothes on top."""
    wall = lathe([(0, 0), (160, 0), (190, 420), (178, 420), (150, 12), (0, 12)], p.TAN, sides=36)
    hoops = [
        put(ring(160 + 30 * z / 420, 13, p.BROWN if k % 2 else p.BEECH, sides=6), z=z)
        for k, z in enumerate(range(20, 421, 40))
    ]
    staves = [put(tube([(162, 0, 4), (193, 0, 416)], 6, p.BROWN, 6), yaw=a) for a in range(0, 360, 15)]
    ears = [put(tube(in_plane(arc(55, 0, 180, 11) + (0, 415), 1), 9, p.BROWN), 0, s * 188, 0) for s in (-1, 1)]
    paints = ((60, -40, p.BLUE), (-60, 50, p.WHITE), (40, 70, p.ROSE), (-50, -60, p.TEAL), (0, 0, p.YELLOW))
    clothes = [put(ellipsoid((210, 170, 120), c, FABRIC), x, y, 395, yaw=x, roll=12) for x, y, c in paints]
    return join(wall, *hoops, *staves, *ears, *clothes)


def _glasses() -> Surface:
    """Reading glasses 140 mm wide, lying with the temples open."""
    rims = [put(scaled(put(ring(1, 0.17, p.WALNUT), pitch=90), 22, 24, 19), 0, y, 21) for y in (-35, 35)]
    lenses = [put(plate(arc(1, 0, 360, 25)[:-1] * (23, 18), (-1, 1), p.SKY, 0), 0, y, 21) for y in (-35, 35)]
    bridge = tube(in_plane(arc(13, 20, 160, 9) * (1, 0.7) + (0, 22), 0), 3, p.WALNUT)
    temples = [
        tube([(0, s * 58, 27), (-4, s * 70, 29), (-95, s * 72, 29), (-118, s * 71, 18), (-140, s * 70, 3)], 3, p.WALNUT)
        for s in (-1, 1)
    ]
    return settled(join(*rims, *lenses, bridge, *temples), 0.5)


def _coat_hanger() -> Surface:
    """420 mm wide, of wood."""
    arms = smooth([(-210, 0), (-190, 12), (-60, 78), (0, 92), (60, 78), (190, 12), (210, 0)], 31)
    hook = np.concatenate([[(0, 92), (0, 132)], arc(26, -90, 190, 17) + (0, 162)])
    bar = tube([(0, -170, 18), (0, 170, 18)], 6, p.TAN)
    return join(tube(in_plane(arms, 0), 10, p.BEECH, flat=1.1), bar, tube(in_plane(hook, 0), 3, p.STEEL))


def objects() -> list[ZooObject]:
    """Return the objects of this module."""
    return [
        zoo_object("pillow", "bedroom", _pillow()),
        zoo_object("folded woollen blanket", "bedroom", _blanket(), "inside"),
        zoo_object("teddy bear", "bedroom", _teddy()),
        zoo_object("alarm clock", "bedroom", _alarm_clock()),
        zoo_object("pair of slippers", "bedroom", _slippers()),
        zoo_object("hot-water bottle", "bedroom", _hot_water_bottle()),
        zoo_object("straw hat", "bedroom", _straw_hat()),
        zoo_object("laundry basket", "bedroom", _laundry_basket(), "against wall"),
        zoo_object("reading glasses", "bedroom", _glasses()),
        zoo_object("coat hanger", "bedroom", _coat_hanger(), "hanging"),
    ]
