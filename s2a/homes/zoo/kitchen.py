"""Kitchen: food, and things to cook and eat with. Shapes in millimetres, at the ordinary sizes of such objects."""

import numpy as np

from s2a.homes.solids import WOOD, Surface, box, cylinder, join, lathe
from s2a.homes.zoo import shapes as p


@p.zoo_object("apple", "kitchen", "inside")  # 80 mm wide, with stem and leaf
def _apple() -> Surface:
    flesh = p.turned([(10, 3), (18, 0), (34, 16), (40, 42), (30, 64), (14, 68), (3, 60)], p.RED)
    leaf = p.put(p.plate(p.arc(1, 0, 360, 13)[:-1] * (16, 8), (0, 1.5), p.LEAF), 14, 6, 78, pitch=-20, yaw=25)
    return join(flesh, p.tube([(0, 0, 58), (1, 0, 72), (6, 2, 84)], 2.2, p.WALNUT), leaf)


@p.zoo_object("banana", "kitchen")  # 190 mm long, lying on its side
def _banana() -> Surface:
    radii = np.interp(range(16), [0, 1, 3, 8, 12, 14, 15], [5, 6, 14, 18, 15, 6, 5])
    path = np.column_stack([p.arc(105, 25, 150, 16), 0.866 * radii])
    ends = [p.tube(p.in_plane(p.arc(105, *span, 4), 2, 5), 5.5, p.WALNUT) for span in ((22, 26), (149, 154))]
    return p.settled(p.put(join(p.tube(path, radii, p.YELLOW, 6), *ends), yaw=-90), 2)


@p.zoo_object("carrot", "kitchen")  # 180 mm long with green leaves, lying
def _carrot() -> Surface:
    radii = [(-110, 2), (-80, 7), (-20, 14), (30, 18), (45, 16), (52, 6)]
    root = p.tube([(0, y, r) for y, r in radii], [r for _, r in radii], p.ORANGE, 14)
    lines = [
        p.put(p.ring(r, 1.6, p.COPPER), 0, y, r - 0.2, roll=90)
        for r, y in ((9.5, -60), (12.9, -30), (15.7, -5), (17.4, 22))
    ]
    angles = np.radians([-50, -25, 0, 25, 50])
    stalks = [
        p.tube([(0, 48, 18), (22 * np.sin(a), 78, 12), (62 * np.sin(a), 130, 8)], [3, 3, 1], p.LEAF) for a in angles
    ]
    tufts = [p.ball((20, 34, 14), p.GREEN, 22 * k * np.sin(a), 48 + 26 * k, 8) for a in angles for k in (1.6, 2.4, 3.1)]
    return p.settled(join(root, *lines, *stalks, *tufts), 3)


@p.zoo_object("loaf of bread", "kitchen")  # a loaf of bread, 280 mm long, cut three times
def _loaf() -> Surface:
    crust = p.pebble((130, 280, 95), p.BRONZE, 2.6)
    cuts = [p.pebble((100, 16, 14), p.CREAM, 2, 0, y, 83 - abs(y) / 14, yaw=25) for y in (-70, 0, 70)]
    return p.settled(join(crust, *cuts), 12)


@p.zoo_object("pizza", "kitchen")  # 300 mm wide
def _pizza() -> Surface:
    base = join(cylinder(146, 12, p.TAN, sides=40), p.put(p.ring(138, 26, p.BRONZE, 0.9), z=11))
    cheese = p.put(join(cylinder(130, 4, p.RED, sides=40), cylinder(124, 6, p.YELLOW, sides=40)), z=12)
    spots = [(0, 0)]
    spots += [(r * np.cos(a), r * np.sin(a)) for r, n in ((55, 5), (98, 9)) for a in 2 * np.pi * np.arange(n) / n]
    salami = [p.rod(19, 4, p.RED, x, y, 17, sides=16) for x, y in spots[::2]]
    basil = [p.ball((26, 13, 5), p.GREEN, x, y, 20, yaw=7 * x) for x, y in spots[1::2]]
    olives = [p.put(p.ring(6, 5, p.BLACK), 0.8 * y, -0.8 * x, 20) for x, y in spots[2::3]]
    return join(base, cheese, *salami, *basil, *olives)


@p.zoo_object("wine bottle", "kitchen")  # a bottle of 0.75 litres, 300 mm high
def _wine_bottle() -> Surface:
    glass = p.turned([(36, 0), (37, 4), (37, 180), (32, 205), (15, 232), (14, 290), (14, 298)], p.BOTTLE)
    label = join(p.rod(37.6, 80, p.CREAM, z=70), p.put(p.wrapped(p.writing("VINO", 44, p.WINE, 1), 37.4), z=110))
    emblem = p.put(p.wrapped(box((0, 1), (-18, 18), (0, 4), p.GOLD), 37.4), z=95)
    return join(glass, label, emblem, p.rod(15.6, 62, p.WINE, z=240))


@p.zoo_object("pineapple", "kitchen")  # 290 mm high with its leaves
def _pineapple() -> Surface:
    body = p.turned([(34, 0), (52, 25), (62, 75), (56, 125), (36, 155)], p.AMBER)
    radius = np.interp(range(160), [0, 25, 75, 125, 155], [34, 52, 62, 56, 36])
    spots = [(z, 30 * i + 15 * (k % 2)) for k, z in enumerate(range(14, 150, 15)) for i in range(12)]
    eyes = [
        p.put(p.ball((9, 15, 13), p.BROWN if k % 2 else p.ORANGE, radius[z] - 0.5, sides=6), 0, 0, z, yaw=a)
        for k, (z, a) in enumerate(spots)
    ]
    blade = [(0, 0), (9, 60), (22, 105), (44, 135)]
    leaves = [
        p.put(
            p.tube(
                p.in_plane([(s * x + 6, z * (1.25 - 0.3 * s)) for x, z in blade], 1), [13, 13, 8, 1], p.LEAF, 6, flat=2
            ),
            z=146,
            yaw=a + 24 * s,
        )
        for s in (0.35, 0.9, 1.5)
        for a in range(0, 360, 60)
    ]
    return join(body, *eyes, *[p.put(leaf) for leaf in leaves])


@p.zoo_object("wedge of cheese", "kitchen")  # a wedge with holes, 120 mm long and 65 mm high
def _cheese() -> Surface:
    wedge = p.plate([(70, -60), (70, 60), (-70, 0)], (0, 65), p.YELLOW)
    rind = p.plate([(70, -60), (75, -56), (75, 56), (70, 60)], (0, 65), p.ORANGE)
    side = [(-40, 26, 9), (-10, 46, 11), (10, 16, 10), (44, 40, 14), (36, 12, 7), (-22, 12, 6)]
    turn = np.degrees(np.arctan2(60, 140))
    holes = [
        p.put(p.ball((2 * s, 2.5, 2 * s), p.AMBER, x + 6, 0, z), 0, 30 * k, 0, yaw=k * turn)
        for x, z, s in side
        for k in (-1, 1)
    ]
    top = [
        p.ball((2 * s, 2 * s, 2.5), p.AMBER, x, y, 65)
        for x, y, s in ((45, -20, 12), (40, 24, 8), (5, 4, 10), (-30, -2, 6))
    ]
    return p.put(join(wedge, rind, *holes, *top), yaw=-60)


@p.zoo_object("doughnut", "kitchen")  # 90 mm wide, with pink icing and sprinkles
def _doughnut() -> Surface:
    dough, icing = p.ring(28, 34, p.BRONZE, 1.0, 16), p.put(p.ring(28, 34.5, p.PINK, 0.8, 16), z=4.5)
    spots = np.random.default_rng(4).uniform((0, 18, 0), (360, 38, 180), (60, 3))
    paints = (p.WHITE, p.BLUE, p.YELLOW, p.GREEN)
    heights = 4.2 + 0.8 * np.sqrt(17.3**2 - (spots[:, 1] - 28) ** 2)
    sprinkles = [
        p.put(p.put(box((-3, 3), (-0.9, 0.9), (0, 1.6), paints[i % 4]), r, 0, h, yaw=t), yaw=a)
        for i, ((a, r, t), h) in enumerate(zip(spots, heights, strict=True))
    ]
    return p.settled(join(dough, icing, *sprinkles), 3)


@p.zoo_object("Nutella", "kitchen", rare=True)  # a jar of 450 g, 125 mm high
def _nutella() -> Surface:
    jar = p.loft([(0, 36, 42), (4, 38, 45), (70, 38, 45), (92, 34, 38), (102, 32, 34)], p.CHOCOLATE, 32, 2.6)
    label = p.loft([(24, 38.5, 45.5), (68, 38.5, 45.5)], p.WHITE, 32, 2.6)
    name = p.put(join(p.writing("nutella", 58, p.RED, 4), p.put(box((0, 4), (-29, -22), (0, 9), p.BLACK))), 36, 0, 46)
    bread = join(p.pebble((3, 26, 20), p.TAN, 4, 38.5, -10, 25), p.pebble((3, 18, 13), p.CHOCOLATE, 4, 39.5, -10, 28))
    nuts = [p.ball((5, 11, 11), p.BRONZE, 39, y, 32) for y in (10, 20)]
    return join(
        jar, label, name, bread, *nuts, p.put(lathe([(0, 0), (37, 0), (37, 22), (35, 24), (0, 24)], p.WHITE), z=100)
    )


@p.zoo_object("frying pan with a fried egg", "kitchen")  # 260 mm wide, 440 mm long with its handle
def _frying_pan() -> Surface:
    pan = lathe([(0, 0), (105, 0), (130, 48), (126, 48), (102, 4), (0, 4)], p.DARK, sides=36)
    grip = p.pebble((26, 165, 20), p.BLACK, 4, 0, 235, 48, roll=8)
    egg = [
        p.plate(p.arc(1, 0, 360, 17)[:-1] * (48, 40) + (6, 4), (4, 9), p.WHITE),
        p.ball((32, 32, 16), p.YELLOW, 4, 6, 9),
    ]
    return join(pan, grip, p.tube([(0, 124, 38), (0, 165, 52)], 8, p.STEEL), *egg)


@p.zoo_object("cooking pot", "kitchen")  # a pot of 4 litres, 220 mm wide, with its lid
def _cooking_pot() -> Surface:
    body = lathe([(0, 0), (108, 0), (112, 6), (112, 130), (108, 130), (108, 6), (0, 6)], p.STEEL, sides=36)
    lid = p.put(p.turned([(114, 0), (114, 5), (80, 22), (10, 32)], p.SILVER, sides=36), z=130)
    knob = p.put(p.turned([(9, 0), (9, 10), (20, 18), (18, 28)], p.BLACK), z=160)
    ears = [
        p.tube([(x, s * 105, 100), (x * 0.9, s * 142, 104), (-x * 0.9, s * 142, 104), (-x, s * 105, 100)], 7, p.BLACK)
        for x in (38,)
        for s in (-1, 1)
    ]
    return join(body, lid, knob, *ears)


@p.zoo_object("electric kettle", "kitchen")  # an electric kettle of 1.7 litres, 250 mm high, its spout to the left
def _kettle() -> Surface:
    base = lathe([(0, 0), (85, 0), (85, 14), (70, 22), (0, 22)], p.BLACK)
    body = p.turned([(78, 24), (80, 40), (66, 140), (56, 205)], p.STEEL)
    lid = join(p.put(p.turned([(57, 0), (50, 14), (14, 20)], p.BLACK), z=205), p.ball((24, 24, 18), p.BLACK, z=230))
    handle = p.tube(
        p.in_plane(p.smooth([(50, 208), (100, 214), (122, 180), (118, 90), (82, 56)], 14), 0), 12, p.BLACK, flat=1.3
    )
    spout = p.put(p.loft([(0, 22, 18, 0, 0), (38, 15, 13, 0, -12), (56, 13, 8, 0, -30)], p.STEEL), 0, -48, 152)
    gauge = p.pebble((8, 16, 100), p.SKY, 5, 68, 0, 60, pitch=-8)
    return join(base, body, lid, handle, spout, gauge)


@p.zoo_object("glass of red wine", "kitchen")  # 200 mm high, half full of red wine
def _wine_glass() -> Surface:
    foot = p.turned([(36, 0), (34, 3), (8, 7), (4, 20), (4, 80), (6, 92)], p.SKY)
    bowl = lathe(
        [(0, 90), (6, 90), (28, 102), (41, 130), (39, 165), (33, 205), (31, 205), (37, 165), (38, 148), (0, 148)],
        p.SKY,
        sides=28,
    )
    wine = lathe([(0, 92), (27, 104), (41.5, 130), (41.0, 150), (0, 150)], p.WINE, sides=28)
    return join(foot, bowl, wine)


@p.zoo_object("cutting board", "kitchen", "against wall")  # 360 by 240 mm with a handle and a hole, leaning upright
def _cutting_board() -> Surface:
    board = p.pebble((20, 240, 300), p.BEECH, 12, texture=WOOD)
    grip = p.pebble((18, 70, 110), p.BEECH, 6, z=280, texture=WOOD)
    hole = p.rod(13, 24, p.WALNUT, -12, 0, 352, pitch=90)
    groove = [
        box((7, 10.8), y, z, p.BROWN)
        for y, z in (
            ((-100, 100), (22, 27)),
            ((-100, 100), (270, 275)),
            ((-100, -95), (22, 275)),
            ((95, 100), (22, 275)),
        )
    ]
    return p.settled(p.put(join(board, grip, hole, *groove), pitch=-12), 1)


@p.zoo_object("rolling pin", "kitchen")  # 420 mm long, lying
def _rolling_pin() -> Surface:
    roller = lathe([(0, -120), (26, -120), (29, -114), (29, 114), (26, 120), (0, 120)], p.BEECH, WOOD, 20)
    # On one of its sides, not on an edge between two.
    roller = p.put(p.put(roller, yaw=9), z=29, roll=90)
    grips = [
        p.put(p.turned([(7, 118), (8, 126), (14, 150), (15, 190), (9, 208)], p.RED), z=29, roll=r) for r in (-90, 90)
    ]
    return p.settled(join(roller, *grips), 0.6)


@p.zoo_object("teapot", "kitchen")  # a pot of 1 litre, 230 mm from handle to spout
def _teapot() -> Surface:
    body = p.turned([(40, 0), (44, 4), (74, 45), (70, 80), (38, 108)], p.TEAL)
    lid = join(p.put(p.turned([(38, 106), (36, 114), (8, 124)], p.CREAM)), p.ball((24, 24, 22), p.CREAM, z=132))
    spout = p.tube(
        p.in_plane(p.smooth([(60, 40), (92, 52), (104, 84), (124, 104)], 12), 0), np.linspace(20, 9, 12), p.TEAL, 14
    )
    handle = p.tube(p.in_plane(p.smooth([(-58, 92), (-104, 98), (-118, 64), (-66, 28)], 14), 0), 8, p.TEAL)
    dots = [
        p.ball((16, 16, 16), p.CREAM, 66 * np.cos(a), 66 * np.sin(a), 62) for a in np.radians([-50, -25, 0, 25, 50])
    ]
    return join(body, lid, spout, handle, *dots)


@p.zoo_object("toaster", "kitchen")  # for two slices, 190 mm high
def _toaster() -> Surface:
    case = p.pebble((180, 290, 175), p.RED, 7, z=12)
    slots = [p.put(box((-16, 16), (-105, 105), (184, 188.5), p.BLACK), x) for x in (-36, 36)]
    bread = [
        join(p.pebble((16, 125, 90), p.BRONZE, 6, x, 0, 150), p.pebble((17, 105, 78), p.CREAM, 6, x, 0, 152))
        for x in (-36, 36)
    ]
    lever = join(box((-7, 7), (144, 148), (50, 150), p.BLACK), p.pebble((44, 30, 16), p.BLACK, 4, 0, 156, 120))
    knob = p.rod(17, 16, p.SILVER, 86, 90, 52, pitch=90)
    feet = [p.rod(14, 16, p.BLACK, x, y) for x in (-55, 55) for y in (-105, 105)]
    return join(case, *slots, *bread, lever, knob, *feet, box((86, 91.5), (-110, 60), (46, 54), p.SILVER))


@p.zoo_object("kitchen knife", "kitchen", "inside")  # a chef's knife 320 mm long, lying
def _knife() -> Surface:
    blade = p.plate([(-22, -8), (-24, 60), (-14, 130), (8, 190), (11, 186), (14, 0), (14, -8)], (7, 9.5), p.SILVER)
    grip = p.pebble((26, 125, 17), p.BLACK, 5, 3, -68)
    rivets = [p.rod(4, 18, p.SILVER, 3, y, sides=12) for y in (-105, -70, -35)]
    return join(blade, grip, *rivets, p.pebble((27, 12, 18), p.STEEL, 6, 3, -8))


# A stove-top coffee maker for six cups, 220 mm high: eight-sided, its spout to the left.
@p.zoo_object("Bialetti moka", "kitchen", rare=True)
def _moka() -> Surface:
    lower = lathe([(0, 0), (50, 0), (52, 6), (39, 88), (0, 88)], p.STEEL, sides=8)
    waist = p.put(lathe([(0, 0), (42, 0), (42, 14), (0, 14)], p.SILVER, sides=24), z=88)
    upper = lathe([(0, 102), (38, 102), (52, 182), (0, 182)], p.STEEL, sides=8)
    lid = join(
        lathe([(0, 182), (53, 182), (8, 203), (0, 203)], p.SILVER, sides=8),
        p.put(p.turned([(6, 200), (10, 212), (7, 224)], p.BLACK)),
    )
    spout = p.put(p.plate([(-40, 150), (-44, 182), (-76, 184)], (-13, 13), p.STEEL, 0))
    handle = p.tube(p.in_plane([(44, 176), (98, 186), (92, 130), (82, 84)], 0), [8, 10, 10, 7], p.BLACK, 8, flat=1.2)
    valve = p.rod(6, 12, p.GOLD, 42, 18, 55, pitch=90, sides=12)
    return join(*[p.put(s, yaw=0) for s in (lower, waist, upper, lid)], spout, handle, valve)
