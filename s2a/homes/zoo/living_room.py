"""Living room: on the wall, for the evening, ornaments, games. Shapes in millimetres, at the ordinary sizes of such objects."""

from itertools import product

import numpy as np

from s2a.homes.solids import WOOD, Surface, box, cylinder, ellipsoid, join, lathe, posts
from s2a.homes.zoo import shapes as p

ROUND = range(0, 360, 30)


@p.zoo_object("framed painting", "living room", "hanging")  # a framed landscape, 600 by 450 mm
def _image() -> Surface:
    frame = join(box((0, 24), (-300, 300), (0, 450), p.GOLD), box((0, 26), (-262, 262), (38, 412), p.WHITE))
    ridge = [(230, 150), (150, 190), (40, 170), (-60, 150), (-150, 190), (-230, 170)]
    hill = np.array([(-230, 70), (230, 70), *ridge])
    peaks = [
        p.plate([(a - 120, 150), (a + 120, 150), (a, top)], (25, 28.5), p.NAVY, 0) for a, top in ((-90, 310), (70, 345))
    ]
    snow = [
        p.plate([(a - 30, top - 40), (a, top - 52), (a + 30, top - 40), (a, top)], (25, 29), p.WHITE, 0)
        for a, top in ((-90, 310), (70, 345))
    ]
    sun = p.plate(p.arc(30, 0, 360, 25)[:-1] + (170, 330), (25, 28), p.YELLOW, 0)
    return join(
        frame, box((25, 27.4), (-230, 230), (70, 380), p.SKY), sun, *peaks, *snow, p.plate(hill, (25, 30), p.GREEN, 0)
    )


@p.zoo_object("wall clock", "living room", "hanging")  # 300 mm wide, at ten past ten
def _wall_clock() -> Surface:
    case = p.put(join(cylinder(150, 32, p.BLACK, sides=48), cylinder(134, 34, p.WHITE, sides=48)), 0, 0, 150, pitch=90)
    widths = [(a, 5 if a % 90 == 0 else 2.5) for a in ROUND]
    marks = [p.put(box((34, 36), (-w, w), (108, 126), p.BLACK), 0, 0, 150, roll=a) for a, w in widths]
    hands = [
        p.put(box((35, 38), (-w, w), (-18, n), c), 0, 0, 150, roll=-a)
        for a, n, w, c in ((-55, 66, 5, p.BLACK), (60, 98, 4, p.BLACK), (180, 90, 1.5, p.RED))
    ]
    return join(case, *marks, *hands, p.rod(9, 40, p.RED, 0, 0, 150, pitch=90))


@p.zoo_object("bowl of oranges", "living room")  # a bowl of oranges, 280 mm wide
def _orange_bowl() -> Surface:
    bowl = lathe(
        [(0, 0), (60, 0), (62, 8), (118, 50), (140, 90), (134, 90), (112, 54), (50, 14), (0, 14)], p.NAVY, sides=36
    )
    spots = [(70 * np.cos(a), 70 * np.sin(a), 82) for a in np.radians(range(0, 360, 60))]
    spots += [(36 * np.cos(a), 36 * np.sin(a), 136) for a in np.radians((30, 150, 270))]
    fruit = join(ellipsoid((78, 78, 74), p.ORANGE, sides=20), p.ball((8, 8, 5), p.LEAF, z=36))
    leaf = p.ball((40, 18, 4), p.LEAF, 28, 0, 176, pitch=-20)
    return join(bowl, *[p.put(fruit, *spot, roll=12 * (i % 3)) for i, spot in enumerate([*spots, (0, 0, 60)])], leaf)


@p.zoo_object("stack of books", "living room")  # five books in a stack, 150 mm high
def _books() -> Surface:
    parts, z = [], 0.0
    paints = (p.NAVY, p.RED, p.GREEN, p.AMBER, p.PURPLE)
    for i, (high, wide, color) in enumerate(zip((38, 26, 34, 22, 28), (250, 236, 220, 205, 190), paints, strict=True)):
        x, y = 0.36 * wide, wide / 2
        covers = [box((-x, x), (-y, y), span, color) for span in ((0, 3), (high - 3, high))]
        covers += [box((x - 3, x), (-y, y), (0, high), color)]
        pages = box((-x + 4, x - 3), (-y + 4, y - 4), (3, high - 3), p.CREAM)
        title = [box((x, x + 0.8), (-0.5 * y, 0.4 * y), (0.4 * high, 0.6 * high), p.GOLD)]
        title += [box((x, x + 0.8), (s, s + 4), (0, high), p.GOLD) for s in (-0.8 * y, 0.74 * y)]
        parts.append(p.put(join(*covers, pages, *title), z=z, yaw=(0, 6, -5, 9, -7)[i] + 180 * (i == 3)))
        z += high
    return join(*parts)


@p.zoo_object("lantern", "living room")  # a lantern with a candle inside, 330 mm high
def _lantern() -> Surface:
    floor = [p.put(box((-75, 75), (-75, 75), (z, z + 14), p.BLACK)) for z in (0, 190)]
    pillars = [box((x - 7, x + 7), (y - 7, y + 7), (10, 195), p.BLACK) for x in (-63, 63) for y in (-63, 63)]
    bars = [
        p.put(join(box((60, 66), (-63, 63), (97, 103), p.BLACK), box((60, 66), (-3, 3), (14, 190), p.BLACK)), yaw=a)
        for a in (0, 90, 180, 270)
    ]
    roof = p.put(lathe([(0, 0), (112, 0), (30, 56), (30, 72), (0, 72)], p.BLACK, sides=4), z=202, yaw=45)
    candle = [p.rod(30, 80, p.CREAM, z=14), p.put(p.turned([(3, 0), (11, 14), (1, 42)], p.ORANGE), z=96)]
    return join(*floor, *pillars, *bars, roof, *candle, p.put(p.ring(34, 7, p.GOLD), 0, 0, 300, pitch=90))


@p.zoo_object("record player", "living room")  # 420 mm wide
def _record_player() -> Surface:
    case = join(
        p.pebble((350, 420, 90), p.BROWN, 12, z=12, texture=WOOD),
        *[p.rod(20, 14, p.BLACK, x, y) for x in (-130, 130) for y in (-165, 165)],
    )
    disc = p.put(join(cylinder(152, 8, p.SILVER, sides=40), cylinder(148, 12, p.BLACK, sides=40)), 0, -40, 101)
    grooves = [p.put(p.ring(r, 2, p.DARK, sides=6), 0, -40, 113.2) for r in (70, 92, 112, 132)]
    label = p.put(join(cylinder(48, 2, p.RED), cylinder(4, 14, p.SILVER)), 0, -40, 112)
    pivot = p.put(join(cylinder(26, 20, p.DARK), cylinder(12, 34, p.SILVER)), -110, 160, 100)
    arm = p.tube([(-140, 166, 128), (-110, 160, 128), (40, 140, 124), (84, 72, 120)], 5, p.SILVER)
    head = p.pebble((44, 22, 12), p.BLACK, 5, 88, 64, 114, yaw=-52)
    return join(
        case, disc, *grooves, label, pivot, arm, head, *[p.rod(13, 12, p.SILVER, x, 170, 100) for x in (90, 130)]
    )


@p.zoo_object("wreath", "living room", "hanging")  # a wreath of fir with red berries and a bow, 350 mm wide
def _wreath() -> Surface:
    rng = np.random.default_rng(1)
    hoop = p.put(p.ring(130, 52, p.LEAF, 0.7, 8), 32, 0, 175, pitch=90)
    twigs = []
    for a in np.arange(0, 360, 5):
        place, color = (36 + rng.uniform(-4, 16), rng.uniform(-12, 12), 138), p.GREEN if a % 10 else p.LEAF
        needle = p.ball((12, 16, 76), color, *place, roll=rng.uniform(25, 75), sides=6)
        twigs.append(p.put(needle, 0, 0, 175, roll=float(a)))
    berries = [
        p.ball((18, 18, 18), p.RED, 62, 130 * np.sin(a) + s, 175 + 130 * np.cos(a) + t)
        for a in np.radians(range(20, 360, 45))
        for s, t in ((0, 0), (16, 6), (4, 17))
    ]
    bow = [p.ball((26, 86, 54), p.RED, 66, s * 44, 52, roll=s * 14) for s in (-1, 1)]
    bow += [p.ball((36, 30, 30), p.WINE, 72, 0, 50)]
    tails = [
        p.put(
            p.plate([(-14, 0), (14, 0), (18, -90), (0, -76), (-18, -90)], (0, 4), p.RED, 0), 64, s * 14, 46, roll=s * 16
        )
        for s in (-1, 1)
    ]
    return join(hoop, *twigs, *berries, *bow, *tails)


# A soprano ukulele, 530 mm long, leaning against the wall.
@p.zoo_object("ukulele", "living room", "against wall", rare=True)
def _ukulele() -> Surface:
    side = p.smooth([(0, 0), (60, 6), (82, 60), (70, 105), (50, 130), (60, 175), (52, 215), (20, 232), (0, 234)], 30)
    outline = np.concatenate([side, side[-2:0:-1] * (-1, 1)])
    body = join(
        p.plate(outline, (0, 60), p.BROWN, 0), p.plate((outline - (0, 117)) * 0.96 + (0, 117), (59, 62), p.AMBER, 0)
    )
    hole = p.put(join(cylinder(27, 2, p.WALNUT), cylinder(23, 3, p.BLACK)), 61, 0, 146, pitch=90)
    neck = join(p.pebble((26, 38, 250), p.BROWN, 6, 48, 0, 205), box((60, 66), (-18, 18), (180, 440), p.BLACK))
    frets = [box((66, 67.2), (-18, 18), (z, z + 2), p.SILVER) for z in np.linspace(215, 425, 10)]
    head = p.plate([(-20, 440), (20, 440), (30, 520), (12, 530), (-12, 530), (-30, 520)], (46, 60), p.BROWN, 0)
    pegs = [
        join(p.rod(4, 26, p.SILVER, 50, s * 38, z, roll=90 * s), p.pebble((8, 16, 14), p.WHITE, 4, 50, s * 42, z - 7))
        for s in (-1, 1)
        for z in (470, 502)
    ]
    bridge = box((61, 68), (-34, 34), (62, 74), p.WALNUT)
    strings = [p.tube([(69, y, 68), (69, 0.9 * y, 440)], 0.8, p.WHITE, 5) for y in (-13, -4.5, 4.5, 13)]
    return p.settled(p.put(join(body, hole, neck, *frets, head, *pegs, bridge, *strings), pitch=-14), 4)


@p.zoo_object("Chinese vase", "living room")  # a blue and white vase, 320 mm high
def _vase() -> Surface:
    body = p.turned([(55, 0), (60, 10), (100, 150), (90, 220), (40, 270), (38, 290), (52, 318)], p.WHITE, sides=32)
    bands = [p.put(p.ring(r, 6, p.BLUE), z=z) for r, z in ((61, 18), (41, 262), (51, 316), (91.5, 218))]
    petals = [p.put(p.ball((8, 34, 34), p.BLUE, 97), z=150, yaw=a) for a in ROUND]
    leaves = [p.put(p.ball((8, 16, 40), p.NAVY, r), z=z, yaw=a + 15) for a in ROUND for r, z in ((93, 110), (96, 190))]
    return join(body, *bands, *petals, *leaves, p.rod(44, 2, p.NAVY, z=318))


@p.zoo_object("potted cactus", "living room")  # in a pot, 260 mm high, with two arms and a flower
def _cactus() -> Surface:
    pot = join(
        lathe([(0, 0), (48, 0), (60, 78), (0, 78)], p.TERRACOTTA),
        lathe([(0, 76), (68, 76), (70, 98), (58, 98), (56, 90), (0, 90)], p.TERRACOTTA),
    )

    def stem(path: list[tuple[float, float]], r: float) -> Surface:
        """A round-ended stem with spines in rows."""
        line = p.in_plane(p.smooth(path, 12), 0)
        ribs = [
            p.tube(line + (0.86 * r * np.cos(a), 0.86 * r * np.sin(a) * (len(path) < 3), 0), 0.22 * r, p.GREEN, 6)
            for a in np.radians(ROUND)
        ]
        return join(p.tube(line, r, p.LEAF, 14), *ribs, p.ball((2.1 * r,) * 3, p.LEAF, *line[-1]))

    arms = [stem([(0, z), (s * 62, z + 4), (s * 66, z + 52)], 15) for s, z in ((-1, 150), (1, 172))]
    spots = [
        (p.put(p.put(box((0, 9), (-0.7, 0.7), (-0.7, 0.7), p.WHITE), 33, pitch=0), z=z, yaw=a))
        for z in range(104, 226, 16)
        for a in ROUND
    ]
    flower = [p.put(p.ball((26, 14, 12), p.ROSE, 12, pitch=-25), z=258, yaw=a) for a in ROUND[::2]]
    return join(pot, stem([(0, 85), (0, 225)], 33), *arms, *spots, *flower, p.ball((14, 14, 14), p.YELLOW, z=264))


@p.zoo_object("candelabra", "living room")  # for five candles, 400 mm high
def _candelabra() -> Surface:
    foot = p.turned([(75, 0), (72, 10), (22, 24), (10, 50), (16, 70), (8, 100), (8, 240)], p.GOLD)
    arms = [
        p.tube(p.in_plane(p.smooth([(0, 140), (0.6 * r, 130), (r, 165), (r, z)], 16), 0), 6, p.GOLD)
        for r, z in ((70, 225), (140, 225), (-70, 225), (-140, 225))
    ]
    places = [(y, 225 if y else 240) for y in (-140, -70, 0, 70, 140)]
    cups = [p.put(lathe([(0, 0), (10, 0), (24, 12), (0, 14)], p.GOLD), 0, y, z) for y, z in places]
    wax = [p.rod(10, 110, p.CREAM, 0, y, z + 12) for y, z in places]
    flames = [p.put(p.turned([(2, 0), (7, 10), (1, 30)], p.ORANGE), 0, y, z + 124) for y, z in places]
    return join(foot, *arms, *cups, *wax, *flames)


@p.zoo_object("hourglass", "living room")  # 180 mm high
def _hourglass() -> Surface:
    ends = [p.rod(46, 12, p.WALNUT, z=z) for z in (0, 168)]
    pillars = [
        p.put(p.put(p.turned([(5, 10), (7, 40), (4, 90), (7, 140), (5, 170)], p.WALNUT), 38), yaw=a)
        for a in (60, 180, 300)
    ]
    glass = p.turned([(10, 12), (30, 26), (30, 55), (3, 90), (30, 125), (30, 154), (10, 168)], p.SKY)
    sand = [
        lathe([(0, 14), (30.6, 26), (30.6, 44), (8, 62), (0, 64)], p.AMBER),
        p.turned([(3.5, 90), (23, 115), (30.8, 126), (30.5, 130)], p.AMBER),
    ]
    return join(*ends, *pillars, glass, *sand)


@p.zoo_object("model sailing boat", "living room")  # a model on its stand, 420 mm high
def _sailing_boat() -> Surface:
    hull = p.loft([(0, 10, 90), (18, 30, 135, 0, 4), (44, 38, 160, 0, 10), (56, 38, 172, 0, 16)], p.RED)
    deck, stripe = (
        p.put(p.loft([(0, 34, 166, 0, 16), (3, 34, 166, 0, 16)], p.BEECH), z=56),
        p.loft([(40, 37.6, 158.5, 0, 9), (47, 39, 163.5, 0, 11.5)], p.WHITE),
    )
    mast, boom = p.rod(4, 330, p.BROWN, 0, 10, 56), p.tube([(0, 10, 84), (0, -140, 90)], 3, p.BROWN)
    sails = [
        p.plate([(4, 96), (-134, 100), (4, 370)], (-1.5, 1.5), p.WHITE, 0),
        p.plate([(18, 84), (176, 66), (16, 340)], (-1.5, 1.5), p.CREAM, 0),
    ]
    stripes = [
        p.plate(
            [(4, z), (-134 + (z - 100) * 0.52, z), (-134 + (z - 80) * 0.52, z + 20), (4, z + 20)], (-2, 2), p.BLUE, 0
        )
        for z in (140, 190)
    ]
    flag = p.plate([(10, 386), (-30, 376), (10, 366)], (-1, 1), p.RED, 0)
    stand = [box((-44, 44), (y, y + 14), (-34, 14), p.WALNUT) for y in (-70, 60)]
    stand += [box((-50, 50), (-110, 110), (-44, -32), p.WALNUT)]
    return join(
        hull, deck, stripe, mast, boom, *sails, *stripes, flag, *stand, p.pebble((36, 80, 22), p.WHITE, 5, 0, -60, 56)
    )


@p.zoo_object("trophy", "living room")  # a cup on a plinth, 300 mm high
def _trophy() -> Surface:
    plinth = join(box((-50, 50), (-50, 50), (0, 60), p.WALNUT), box((50, 51.5), (-34, 34), (16, 44), p.GOLD))
    cup = p.turned([(40, 60), (36, 68), (10, 84), (8, 120), (14, 132), (58, 180), (66, 240), (72, 290)], p.GOLD)
    ears = [
        p.tube(p.in_plane(p.smooth([(s * 66, 270), (s * 112, 272), (s * 108, 210), (s * 40, 158)], 16), 0), 6, p.GOLD)
        for s in (-1, 1)
    ]
    angles = zip((26, 11) * 5, np.radians(np.arange(0, 360, 36)), strict=True)
    star = [(r * np.sin(a), r * np.cos(a)) for r, a in angles]
    return join(plinth, cup, *ears, p.put(p.plate(star, (0, 8), p.RED, 0), 60, 0, 232), p.rod(64, 2, p.AMBER, z=289))


@p.zoo_object("bonsai", "living room")  # a small tree in a tray, 300 mm high
def _bonsai() -> Surface:
    feet = posts((-60, 40), (-95, 75), (0, 20), 20, p.NAVY)
    tray = join(p.pebble((150, 230, 50), p.NAVY, 6, z=8), p.pebble((138, 216, 8), p.WALNUT, 6, z=54), *feet)
    path = p.smooth([(0, -10, 55), (6, 26, 105), (0, -6, 160), (0, 14, 215), (0, 8, 240)], 20)
    trunk = p.tube(path, np.linspace(20, 7, 20), p.BROWN, 12)
    boughs = [
        p.tube([(0, y0, z0), (x, y, z)], 6, p.BROWN, 8)
        for x, y, z, y0, z0 in ((10, 84, 158, 14, 125), (-6, -80, 190, -4, 165), (30, -30, 215, 4, 185))
    ]
    crowns = ((10, 92, 166, 120), (-6, -86, 200, 120), (0, 10, 258, 150), (34, -28, 224, 90), (-30, 36, 214, 90))
    pads = [p.ball((0.8 * s, s, 0.42 * s), p.LEAF, x, y, z, sides=10) for x, y, z, s in crowns]
    tufts = []
    for (x, y, z, s), a in product(crowns, np.radians(range(0, 360, 60))):
        place = (x + 0.26 * s * np.cos(a), y + 0.33 * s * np.sin(a), z + 0.06 * s)
        tufts.append(p.ball((0.4 * s, 0.4 * s, 0.3 * s), p.GREEN, *place, sides=8))
    return join(tray, trunk, *boughs, *pads, *tufts)


def _land(shore: np.ndarray) -> Surface:
    """A continent from its shore (latitude, longitude) [rad], a thick skin over the globe that is fanned from its middle."""
    middle = shore.mean(axis=0)
    n = len(shore)
    fine = np.concatenate([np.linspace(shore[i], shore[(i + 1) % n], 5)[:-1] for i in range(n)])
    shells = []
    for share in (0.01, 0.25, 0.5, 0.75, 1.0):
        lat, lon = (middle + share * (fine - middle)).T
        shells.append(np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=1))
    rings = [127.5 * s for s in shells] + [119 * s for s in shells[::-1]]
    return p.skin(np.array(rings), False, p.GREEN)


@p.zoo_object("globe", "living room")  # an earth globe on a stand, 380 mm high
def _globe() -> Surface:
    north = [(40, -5), (60, 10), (68, 40), (70, 90), (60, 140)]
    lands = [
        [(20, -15), (32, 5), (20, 35), (5, 42), (-30, 25), (-33, 18), (0, 10), (5, -8)],
        [*north, (40, 120), (20, 105), (12, 78), (25, 60), (32, 40), (42, 28)],
        [(68, -160), (70, -95), (50, -60), (30, -80), (18, -96), (32, -115), (55, -130)],
        [(10, -75), (5, -52), (-8, -36), (-40, -62), (-53, -70), (-18, -72)],
        [(-14, 130), (-12, 142), (-28, 153), (-38, 145), (-33, 116), (-22, 115)],
    ]
    green = [_land(np.radians(np.array(land, float))) for land in lands]
    earth = join(ellipsoid((250, 250, 250), p.BLUE, sides=32), *green)
    tilted = p.put(join(earth, p.rod(4, 276, p.GOLD, z=-138)), z=235, yaw=-20, roll=23)
    arm = p.put(p.tube(p.in_plane(p.arc(138, -90, 90, 25), 0), 6, p.GOLD), z=235, roll=23)
    foot = p.turned([(85, 0), (82, 12), (24, 26), (12, 50), (16, 100)], p.WALNUT)
    return join(tilted, arm, foot)


@p.zoo_object("chessboard", "living room")  # a board of 400 mm with men in play
def _chess() -> Surface:
    spans, squares = [(48 * i - 192, 48 * i - 144) for i in range(8)], product(range(8), range(8))
    paints = (p.WALNUT, p.CREAM)
    fields = [box(spans[i], spans[j], (17, 20.5), paints[(i + j) % 2]) for i, j in squares]

    def pawn(color: tuple[int, int, int]) -> Surface:
        return join(p.turned([(15, 0), (14, 8), (6, 18), (6, 34)], color, sides=14), p.ball((19, 19, 19), color, z=40))

    def king(color: tuple[int, int, int]) -> Surface:
        cross = join(box((-2.5, 2.5), (-2.5, 2.5), (80, 98), color), box((-2.5, 2.5), (-8, 8), (86, 91), color))
        return join(
            p.turned([(18, 0), (17, 10), (8, 24), (8, 58), (14, 62), (10, 66), (15, 82)], color, sides=14), cross
        )

    def rook(color: tuple[int, int, int]) -> Surface:
        teeth = [p.put(box((7, 14), (-4, 4), (50, 58), color), yaw=a) for a in ROUND[::2]]
        return join(p.turned([(17, 0), (16, 9), (10, 20), (10, 38), (15, 42), (15, 51)], color, sides=14), *teeth)

    places = [(pawn, 1, j) for j in (0, 1, 3, 5, 6, 7)] + [(pawn, 2, 2), (pawn, 3, 4)]
    places += [(king, 0, 4), (rook, 0, 0), (rook, 0, 7), (king, 0, 3)]
    men = [p.put(man(p.BLACK), 48 * i - 168, 48 * j - 168, 20) for man, i, j in places]
    men += [p.put(man(p.IVORY), 168 - 48 * i, 168 - 48 * j, 20) for man, i, j in places]
    return join(box((-205, 205), (-205, 205), (0, 19), p.BROWN), *fields, *men)


def _sheet(outer: np.ndarray, inner: np.ndarray) -> Surface:
    """A closed shell between two grids of points [row column 3]."""
    rings = np.concatenate([outer, inner[:, ::-1]], axis=1)
    return p.skin(rings, False, p.SKY)


@p.zoo_object("snow globe", "living room")  # 100 mm high: a snowman and a fir in a glass ball that is cut open in front
def _snow_globe() -> Surface:
    foot = lathe([(0, 0), (42, 0), (44, 8), (34, 30), (0, 30)], p.RED)
    plaque = p.put(box((0, 2), (-16, 16), (0, 10), p.GOLD), 38, 0, 10, pitch=-20)
    angles = np.radians(np.linspace(-45, 90, 14))
    section = [(42 * np.cos(a), 62 + 42 * np.sin(a)) for a in angles]
    shell = np.array(
        [[(r * np.cos(t), r * np.sin(t), z) for r, z in section] for t in np.radians(np.linspace(75, 285, 22))]
    )
    inner = shell * (0.96, 0.96, 1) + (0, 0, 0)
    glass = _sheet(shell, inner)
    snow = lathe([(0, 28), (33, 28), (38, 38), (20, 42), (0, 43)], p.WHITE)
    man = [p.ball((s, s, s), p.WHITE, 8, -9, z) for s, z in ((24, 50), (17, 66), (12, 78))]
    hat = join(p.rod(8, 2, p.BLACK, 8, -9, 83), p.rod(5, 8, p.BLACK, 8, -9, 84))
    face = [p.ball((8, 2.5, 2.5), p.ORANGE, 16, -9, 77)]
    face += [p.ball((2, 2, 2), p.BLACK, 13.5, -9 + s, 80) for s in (-2.5, 2.5)]
    fir = [
        p.put(lathe([(0, 0), (r, 0), (1, r * 1.5), (0, r * 1.5)], p.GREEN, sides=10), -2, 14, z)
        for r, z in ((15, 44), (12, 56), (8, 68))
    ]
    flakes = [
        p.ball((3, 3, 3), p.WHITE, *spot)
        for spot in ((-24, -14, 80), (-26, 6, 88), (-20, 24, 76), (-30, -2, 70), (-10, -22, 88))
    ]
    return join(foot, plaque, glass, snow, *man, hat, *face, *fir, *flakes)


# A goldfish in a round bowl whose glass is left away in front, 220 mm high.
@p.zoo_object("goldfish bowl", "living room")
def _fish_bowl() -> Surface:
    section = [(45, 0), (85, 20), (115, 70), (120, 110), (105, 165), (80, 200), (92, 212)]
    curve = p.smooth(section, 22)
    wall = np.array(
        [[(r * np.cos(t), r * np.sin(t), z) for r, z in curve] for t in np.radians(np.linspace(62, 298, 30))]
    )
    glass = _sheet(wall, wall * (0.97, 0.97, 1))
    base = join(
        lathe([(0, 0), (45, 0), (85, 20), (102, 44), (80, 52), (0, 54)], p.STRAW),
        lathe([(0, -0.5), (50, -0.5), (50, 3), (0, 3)], p.SKY),
    )
    stones = [
        p.ball((24, 20, 16), c, 70 * np.cos(a), 70 * np.sin(a), 52)
        for a, c in ((0.2, p.WHITE), (-0.5, p.GREY), (0.8, p.BROWN), (-1.1, p.SILVER))
    ]
    fish = join(
        ellipsoid((34, 86, 46), p.ORANGE, sides=20),
        p.put(p.plate([(0, 0), (-38, 30), (-28, 0), (-38, -30)], (-4, 4), p.ORANGE, 0), 0, -32),
        p.put(p.plate([(-24, 0), (18, 0), (-8, 24)], (-3, 3), p.RED, 0), 0, 0, 18),
    )
    eyes = [p.ball((5, 10, 10), p.WHITE, 13, 24, 6), p.ball((4, 5, 5), p.BLACK, 15.5, 25, 6)]
    weed = [
        p.tube([(x, y, 50), (x, y + 10, 90), (x, y - 6, 130), (x, y + 6, z)], [6, 8, 6, 2], p.LEAF, 6)
        for x, y, z in ((-30, 60, 175), (-46, 40, 155), (-40, 76, 140), (-40, -64, 150))
    ]
    bubbles = [p.ball((8, 8, 8), p.WHITE, 10, 62, z) for z in (118, 134, 150)]
    return join(glass, base, *stones, p.put(join(fish, *eyes), 16, 0, 106), *weed, *bubbles)


@p.zoo_object("Rubik's cube", "living room", rare=True)  # 57 mm wide, its upper layer turned
def _rubiks_cube() -> Surface:
    faces = ((0, p.RED), (90, p.BLUE), (180, p.ORANGE), (270, p.GREEN))
    mixed = (p.RED, p.WHITE, p.BLUE, p.YELLOW, p.GREEN, p.ORANGE, p.RED, p.BLUE, p.WHITE)
    spans = [(19 * j - 27.2, 19 * j - 10.8) for j in range(3)]
    layers = []
    for k in range(3):
        core = p.pebble((57, 57, 18.6), p.BLACK, 14, z=19.2 * k)
        tiles = []
        for (i, (a, c)), j in product(enumerate(faces), range(3)):
            color = c if k < 1 else mixed[(i * 2 + 3 * k + 4 * j) % 9]
            tiles.append(p.put(box((28, 29), spans[j], (19.2 * k + 1.4, 19.2 * k + 17.4), color), yaw=a))
        layers.append(p.put(join(core, *tiles), yaw=0 if k < 2 else 24))
    top = []
    for i, j in product(range(3), range(3)):
        color = mixed[(i + 4 * j + 1) % 9] if (i + j) % 2 else p.WHITE
        top.append(p.put(box(spans[i], spans[j], (56.5, 57.6), color), yaw=24))
    return join(*layers, *top)
