"""Bathroom: personal care and hygiene. Shapes in millimetres, at the ordinary sizes of such objects."""

import numpy as np

from s2a.homes.solids import FABRIC, Surface, box, cylinder, ellipsoid, join, lathe, prism, stadium
from s2a.homes.zoo import shapes as p


@p.zoo_object("toothbrush", "bathroom", "inside")  # 190 mm long, lying with its bristles up
def _toothbrush() -> Surface:
    path, radii = [(0, -95, 4.8), (0, -60, 6), (0, -10, 5.2), (0, 40, 4), (0, 65, 4)], [4.8, 6, 5.2, 3, 3.4]
    spots = [(x, y) for x in (-4, 0, 4) for y in range(65, 94, 4)]
    tufts = [p.rod(1.7, 12, p.WHITE if y % 8 else p.BLUE, x, y, 7, sides=6) for x, y in spots]
    return p.settled(join(p.tube(path, radii, p.TEAL, 12, flat=1.25), p.pebble((14, 36, 8), p.TEAL, y=79), *tufts), 1)


@p.zoo_object("toothpaste tube", "bathroom")  # a tube of 75 ml, 170 mm long with its cap, lying flat
def _toothpaste() -> Surface:
    body = [(z, 20 + 0.06 * z, 20 - 0.135 * z, 0, 0.135 * z) for z in range(0, 141, 20)]
    stripe = [(z, 20.4 + 0.06 * z, 20.4 - 0.135 * z, 0, 0.135 * z) for z in (92, 100, 118)]
    cap = lathe([(0, -28), (13, -28), (16, 0), (0, 0)], p.RED, sides=16)
    name = p.put(p.writing("MINT", 46, p.BLUE, 3), 6, 46, 11, pitch=-90, roll=-7.5)
    return p.settled(join(p.put(join(p.loft(body, p.WHITE), p.loft(stripe, p.RED), cap), roll=-90), name), 1)


@p.zoo_object("soap dispenser", "bathroom")  # 190 mm high, with a pump
def _soap_dispenser() -> Surface:
    body = p.turned([(34, 0), (36, 8), (36, 92), (30, 115), (15, 125)], p.SKY)
    label = p.rod(36.6, 50, p.WHITE, z=25)
    neck = [p.rod(16, 14, p.DARK, z=124), p.rod(5, 50, p.STEEL, z=130), p.rod(13, 12, p.DARK, z=176)]
    spout = p.tube([(0, 0, 182), (35, 0, 182), (47, 0, 178), (51, 0, 168)], 5, p.DARK)
    return join(body, label, *neck, spout, p.put(p.wrapped(p.writing("SOAP", 44, p.BLUE, 1), 36.4), z=43))


@p.zoo_object("bar of soap in a dish", "bathroom")  # a bar of 95 mm in a dish of 135 mm
def _soap() -> Surface:
    dish = lathe([(0, 0), (45, 0), (68, 16), (64, 17), (44, 4), (0, 4)], p.SKY, squeeze=0.7)
    foam = [ellipsoid((s, s, s), p.WHITE) for s in (12, 15, 9)]
    bubbles = [p.put(f, x, y, 33) for f, x, y in zip(foam, (-12, 4, 14), (24, 30, 22), strict=True)]
    name = p.put(p.writing("SOAP", 56, p.ROSE, 1), 8, -8, 33.5, pitch=-90)
    return p.put(join(dish, p.pebble((54, 95, 30), p.PINK, 3.5, z=4), name, *bubbles), yaw=0)


@p.zoo_object("shampoo bottle", "bathroom")  # a bottle of 250 ml, 200 mm high
def _shampoo() -> Surface:
    body = p.loft([(0, 18, 32), (5, 20, 35), (140, 20, 36), (160, 15, 26), (168, 11, 11)], p.PURPLE)
    cap = p.pebble((30, 34, 34), p.WHITE, 6, z=166)
    flower = [p.ball((4, 14, 14), p.YELLOW, 19, 10 * np.cos(a), 100 + 10 * np.sin(a)) for a in np.arange(0, 6, 1.26)]
    name = p.put(p.writing("SHAMPOO", 52, p.WHITE, 4), 16, 0, 55)
    return join(body, cap, *flower, p.ball((6, 12, 12), p.ORANGE, 20, 0, 100), name)


@p.zoo_object("roll of toilet paper", "bathroom")  # a roll 100 mm high and 112 mm wide, its last sheet hanging off
def _toilet_paper() -> Surface:
    roll = lathe([(20, 0), (56, 0), (56, 100), (20, 100), (20, 0)], p.WHITE)
    core = lathe([(18, 0), (20.5, 0), (20.5, 101), (18, 101), (18, 0)], p.TAN)
    lines = [
        lathe([(r, 99.6), (r + 0.7, 99.6), (r + 0.7, 100.4), (r, 100.4), (r, 99.6)], p.SILVER) for r in (28, 36, 44, 51)
    ]
    sheet = p.plate([(56, -4), (57, 30), (64, 62), (66, 62), (59, 30), (57.5, -4)], (0.5, 99.5), p.CREAM)
    return join(roll, core, *lines, sheet)


@p.zoo_object("hair dryer", "bathroom")  # 230 mm from end to end, lying on its side
def _hair_dryer() -> Surface:
    barrel = p.put(p.turned([(30, 0), (42, 20), (44, 60), (36, 130), (30, 160)], p.PINK), 0, -80, 42, roll=-90)
    nozzle = p.put(p.loft([(0, 30, 30), (30, 24, 26), (55, 10, 32)], p.BLACK), 0, 78, 42, roll=-90)
    grille = [p.put(p.ring(r, 3, p.DARK), 0, -81, 42, roll=-90) for r in (8, 16, 24)]
    handle = p.pebble((44, 50, 150), p.PINK, 4, 20, -35, 30, pitch=90)
    switch = p.pebble((24, 14, 8), p.DARK, 4, 70, -35, 51)
    cord = p.tube([(165, -35, 28), (190, -35, 14), (215, -15, 5), (222, 20, 4)], 4, p.BLACK)
    return p.settled(join(barrel, nozzle, *grille, handle, switch, cord), 8)


@p.zoo_object("hairbrush", "bathroom")  # a paddle brush 240 mm long, lying with its bristles up
def _hairbrush() -> Surface:
    paddle = p.pebble((76, 115, 16), p.BROWN, 2.6, y=62)
    pad = p.pebble((60, 98, 10), p.ROSE, 2.6, y=62, z=10)
    spots = [(x, y) for x in range(-24, 25, 8) for y in range(20, 105, 9) if (x / 30) ** 2 + ((y - 62) / 49) ** 2 < 0.8]
    pins = [p.put(lathe([(0, 0), (1.4, 0), (1.0, 16), (0, 16)], p.BLACK, sides=6), x, y, 17) for x, y in spots]
    handle = p.tube([(0, 15, 8), (0, -20, 7), (0, -80, 8), (0, -120, 6)], [8, 6, 8, 6], p.BROWN, 14, flat=1.5)
    return p.settled(join(paddle, pad, *pins, handle), 2)


@p.zoo_object("comb", "bathroom", "inside")  # 180 mm long, lying
def _comb() -> Surface:
    spine = p.pebble((14, 180, 5), p.AMBER, 5, x=-14)
    ends = [p.pebble((42, 6, 4.5), p.AMBER, 5, x=1, y=y) for y in (-86, 86)]
    teeth = [box((-10, 21), (y, y + (2.2 if y < 0 else 1.4)), (0.7, 4), p.AMBER) for y in np.arange(-80, 81, 4.5)]
    return join(spine, *ends, *teeth)


@p.zoo_object("razor", "bathroom")  # a wet razor 145 mm long, lying
def _razor() -> Surface:
    handle = p.tube([(0, -75, 7), (0, -30, 8), (0, 20, 9), (0, 52, 15), (0, 60, 16)], [7, 8, 6.5, 5, 5], p.BLUE, 12)
    rings = [p.put(p.ring(7.6, 2, p.BLACK), 0, y, 8, roll=90) for y in range(-55, -5, 7)]
    head = p.pebble((44, 22, 9), p.NAVY, 6, 0, 66, 5, roll=25)
    blades = [p.put(box((-20, 20), (y, y + 2.4), (8, 10.5), p.SILVER), 0, 66, 5, roll=25) for y in (-7, -2, 3)]
    return p.settled(join(handle, *rings, head, *blades), 1.8)


@p.zoo_object("shaving brush", "bathroom")  # 110 mm high, standing on its handle
def _shaving_brush() -> Surface:
    handle = p.turned([(17, 0), (18, 6), (12, 26), (15, 42), (13, 52)], p.BLACK)
    collar = p.rod(13.5, 5, p.GOLD, z=50)
    hair = [p.turned([(11, 54), (17, 80), (21, 96)], p.TAN), p.turned([(17.5, 82), (20, 92), (20, 95)], p.WALNUT)]
    return join(handle, collar, *hair, p.turned([(21.3, 94), (20, 104), (12, 110), (2, 112)], p.CREAM))


def _beak() -> Surface:
    return join(p.ball((26, 26, 7), p.ORANGE, 4, 0, 3), p.ball((20, 22, 6), p.RED, 3, 0, -2))


@p.zoo_object("rubber duck", "bathroom")  # 90 mm long, facing the front
def _rubber_duck() -> Surface:
    body = join(ellipsoid((90, 70, 56), p.YELLOW, sides=24), p.pebble((34, 30, 26), p.YELLOW, 2, -36, 0, 6, pitch=-30))
    head = p.ball((48, 46, 46), p.YELLOW, 22, 0, 44, sides=24)
    beak = p.put(_beak(), 44, 0, 40)
    eyes = [p.ball((8, 8, 10), p.BLACK, 40, y, 51) for y in (-11, 11)]
    wings = [p.ball((46, 12, 28), p.AMBER, -8, y, 4, pitch=12) for y in (-34, 34)]
    return p.settled(join(body, head, beak, *eyes, *wings), 9)


@p.zoo_object("folded bath towel", "bathroom")  # a bath towel, folded to 350 by 250 mm
def _towel() -> Surface:
    fold = p.put(prism(stadium(250, 24), (-175, 175), p.TEAL, FABRIC), z=12)
    stripes = [p.put(prism(stadium(250.8, 24.8), (x, x + 14), p.WHITE, FABRIC), z=12) for x in (90, 115, 140)]
    layers = [p.put(join(fold, *stripes), 0, 6 * (i % 2), 23 * i) for i in range(4)]
    return p.settled(p.put(join(*layers), yaw=-90), 1)


@p.zoo_object("toilet brush", "bathroom", "against wall")  # 400 mm high, in its holder
def _toilet_brush() -> Surface:
    holder = p.turned([(52, 0), (54, 8), (46, 90), (44, 120)], p.WHITE)
    bristles = [p.put(p.ring(30, 12, p.SKY), z=z) for z in (118, 124)]
    stick = join(p.rod(7, 240, p.WHITE, z=115), p.turned([(7, 345), (13, 360), (13, 385), (6, 398)], p.SKY))
    return join(holder, p.put(p.turned([(42, 0), (30, 14), (8, 26)], p.SKY), z=116), *bristles, stick)


@p.zoo_object("bathroom scale", "bathroom")  # bathroom scale, 300 mm wide and 28 mm high
def _scale() -> Surface:
    feet = [p.rod(16, 8, p.BLACK, x, y) for x in (-110, 110) for y in (-110, 110)]
    pads = [p.pebble((210, 90, 3), p.SILVER, 6, 15, y, 27) for y in (-75, 75)]
    screen = join(
        p.pebble((60, 110, 4), p.BLACK, 6, -105, 0, 27), p.put(p.writing("72.4", 60, p.GREEN, 1), -90, 0, 31, pitch=-90)
    )
    return join(*feet, p.pebble((300, 300, 22), p.WHITE, 8, z=6), *pads, screen)


@p.zoo_object("perfume bottle", "bathroom")  # a flacon 105 mm high
def _perfume() -> Surface:
    glass = join(p.pebble((32, 66, 70), p.ROSE, 8, z=0), p.pebble((36, 72, 14), p.PINK, 8))
    neck = [p.rod(12, 12, p.GOLD, z=68), p.pebble((28, 28, 28), p.GOLD, 4, z=78)]
    tag = join(box((15, 16.6), (-22, 22), (24, 50), p.CREAM), p.put(p.writing("PARFUM", 38, p.GOLD, 1), 16.4, 0, 33))
    return join(glass, *neck, tag)


@p.zoo_object("wall mirror", "bathroom", "hanging")  # an oval wall mirror, 700 mm high
def _mirror() -> Surface:
    oval = p.arc(1, 0, 360, 49)[:-1] * (240, 350) + (0, 350)
    inner = (oval - (0, 350)) * (0.89, 0.92) + (0, 350)
    glints = [
        p.plate([(a, 350 + b), (a + 40, 350 + b), (a + 190, 590 + b), (a + 150, 590 + b)], (26, 28), p.WHITE, 0)
        for a, b in ((-120, -120), (-50, -190))
    ]
    return join(p.plate(oval, (0, 22), p.GOLD, 0), p.plate(inner, (20, 26), p.SKY, 0), *glints)


@p.zoo_object("towel hooks", "bathroom", "hanging")  # a board 450 mm wide with four towel hooks
def _hooks() -> Surface:
    bend = [(16, 60), (30, 60), (42, 40), (52, 24), (66, 22), (74, 34), (74, 46)]
    hook = join(p.tube([(x, 0, z) for x, z in bend], 6, p.STEEL), p.ball((18, 18, 18), p.STEEL, 74, 0, 50))
    plates = p.pebble((6, 26, 60), p.STEEL, 5, 18, 0, 20)
    return join(
        p.pebble((20, 450, 90), p.BEECH, 8, 10), *[p.put(join(hook, plates), 0, y) for y in (-160, -53, 53, 160)]
    )


@p.zoo_object("Listerine", "bathroom", rare=True)  # a mouthwash of 500 ml, 200 mm high
def _listerine() -> Surface:
    body = p.loft(
        [(0, 26, 38), (8, 29, 41), (55, 29, 41), (80, 24, 34), (105, 29, 41), (140, 27, 38), (158, 12, 14)], p.TEAL
    )
    label = p.loft([(22, 29.6, 41.6), (66, 28.4, 40.2)], p.CREAM)
    cap = p.put(lathe([(0, 0), (17, 0), (16, 36), (0, 36)], p.BLACK, sides=16), z=156)
    return join(body, label, cap, p.put(p.wrapped(p.writing("LISTERINE", 62, p.NAVY, 1), 29.3, 1.41), z=38))


@p.zoo_object("Nivea", "bathroom", rare=True)  # a tin of cream, 95 mm wide and 26 mm high
def _nivea() -> Surface:
    tin = join(
        cylinder(46, 14, p.BLUE, sides=40),
        p.put(lathe([(0, 12), (48, 12), (48, 24), (45, 26), (0, 26)], p.BLUE, sides=40)),
    )
    return join(tin, p.put(p.writing("NIVEA", 70, p.WHITE, 1), 11, 0, 25.7, pitch=-90))
