"""Stationery, and other things of a desk. Shapes in millimetres, at the ordinary sizes of such objects."""

import numpy as np

from s2a.homes.solids import Surface, box, cylinder, join, lathe
from s2a.homes.zoo import shapes as p


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


@p.zoo_object("pencil", "stationery")  # 180 mm long, lying on one of its six sides
def _pencil() -> Surface:
    return p.settled(p.put(_upright_pencil(p.YELLOW), 0, -90, 0, roll=-90), 0.75)


@p.zoo_object("ballpoint pen", "stationery")  # a ballpoint pen 140 mm long, lying
def _pen() -> Surface:
    body = [
        lathe([(0, -70), (0.5, -70), (3, -58), (5, -50), (5, 0), (0, 0)], p.BLACK, sides=12),
        lathe([(0, 0), (5.4, 0), (5, 62), (0, 62)], p.BLUE, sides=12),
        lathe([(0, 62), (2.6, 62), (2.6, 72), (0, 72)], p.SILVER, sides=12),
        lathe([(0, -1.5), (5.6, -1.5), (5.6, 1.5), (0, 1.5)], p.GOLD, sides=12),
    ]
    clip = join(box((5, 8), (-1.8, 1.8), (52, 56), p.SILVER), box((7, 8.2), (-1.8, 1.8), (18, 56), p.SILVER))
    return p.settled(p.put(p.put(join(*body, clip), yaw=15), roll=-90), 0.75)


@p.zoo_object("eraser", "stationery")  # 60 mm long, in its paper sleeve
def _eraser() -> Surface:
    sleeve = [box((-12, 12), (y, y + 14), (-0.4, 13.4), c) for y, c in ((-12, p.BLUE), (2, p.WHITE), (16, p.BLACK))]
    return p.settled(join(p.pebble((23, 64, 13), p.WHITE, 7), *sleeve), 0)


@p.zoo_object("ruler", "stationery")  # 310 mm long with a scale of 30 cm
def _ruler() -> Surface:
    marks = [
        box((7 if i % 10 else 0, 16), (y, y + 0.9), (2.9, 3.5), p.BLACK)
        for i, y in enumerate(np.arange(-150, 151, 5).tolist())
    ]
    digits = [
        p.put(p.writing(str(n), 4.5 + 4 * (n > 9), p.BLACK, 0.6), -2, 10 * n - 150, 2.9, pitch=-90)
        for n in range(0, 31, 5)
    ]
    return join(box((-18, 18), (-155, 155), (0, 3), p.YELLOW), *marks, *digits)


@p.zoo_object("scissors", "stationery", "inside")  # 180 mm long, lying open
def _scissors() -> Surface:
    blade = p.plate([(-7, 0), (7, -6), (8, 40), (0, 105), (-5, 60)], (0, 3), p.SILVER)
    shank = p.plate([(-7, 4), (7, 4), (2, -34), (-12, -30)], (-1, 5), p.RED)
    bow = p.scaled(p.ring(1, 0.34, p.RED, sides=10), 19, 28, 16)
    half = join(blade, shank, p.put(bow, -16, -52, 2.6))
    other = p.put(half, z=3, pitch=180)
    return p.settled(join(p.put(half, yaw=-15), p.put(other, z=2, yaw=15), p.rod(5, 9, p.STEEL, z=-1)), 0.5)


@p.zoo_object("cup of pencils", "stationery")  # a cup of pens, 190 mm high
def _pencil_cup() -> Surface:
    mug = lathe([(0, 0), (40, 0), (40, 100), (36, 100), (36, 4), (0, 4)], p.TEAL, sides=28)
    bands = [p.put(p.ring(40, 3, p.WHITE), z=z) for z in (14, 86)]
    leans = ((-12, 9, p.YELLOW), (12, 4, p.RED), (2, -11, p.GREEN), (-3, -3, p.BLUE), (9, 12, p.ORANGE))
    pencils = [p.put(_upright_pencil(c), y, -x, 6, pitch=0.9 * y, roll=x) for x, y, c in leans]
    rule = p.put(box((-1.5, 1.5), (-12, 12), (0, 190), p.BEECH), -18, 6, 5, roll=4)
    return join(mug, *bands, *pencils, rule)


@p.zoo_object("highlighter", "stationery")  # a text marker 125 mm long, lying, its cap off
def _highlighter() -> Surface:
    body = p.pebble((22, 78, 15), p.LIME, 5, 0, -20)
    neck = p.put(lathe([(0, 0), (6, 0), (5, 14), (0, 14)], p.BLACK), 0, 17, 7.5, roll=-90)
    tip = p.plate([(-3.5, 30), (3.5, 30), (3.5, 37), (-3.5, 42)], (5, 10), p.LIME)
    cap = p.put(join(p.pebble((22, 44, 15), p.LIME, 5), box((-3, 3), (-18, 22), (14, 17), p.BLACK)), 40, 5, 0, yaw=35)
    return p.settled(join(body, neck, tip, box((-11.3, 11.3), (-40, -8), (-0.1, 15.2), p.BLACK), cap), 0)


@p.zoo_object("set square", "stationery")  # a triangle with a long side of 160 mm, lying
def _set_square() -> Surface:
    corners = np.array([(0, 80), (0, -80), (-80, 0)], float)
    inner = (corners - (-30, 0)) * 0.42 + (-30, 0)
    parts = [
        p.plate([corners[i], corners[(i + 1) % 3], inner[(i + 1) % 3], inner[i]], (0, 2.5), p.SKY) for i in range(3)
    ]
    marks = [
        box((-9 if i % 5 == 0 else -5, -0.5), (y, y + 0.8), (2.4, 3), p.NAVY)
        for i, y in enumerate(np.arange(-70, 71, 4).tolist())
    ]
    return join(*parts, *marks, p.put(p.writing("0   5   10", 56, p.NAVY, 0.6), -10.5, 0, 2.5, pitch=-90))


@p.zoo_object("glue stick", "stationery")  # a glue stick, 100 mm high, its cap beside it
def _glue() -> Surface:
    body = [
        cylinder(13, 16, p.RED),
        p.rod(12.5, 56, p.YELLOW, z=16),
        p.rod(11.5, 10, p.WHITE, z=72),
        p.rod(9, 20, p.CREAM, z=80),
    ]
    name = p.put(p.wrapped(p.writing("GLUE", 21, p.RED, 1), 12.3), z=38)
    return join(*body, name, p.put(lathe([(0, 0), (13.5, 0), (12.5, 30), (0, 30)], p.RED), 8, 34))


@p.zoo_object("magnifying glass", "stationery")  # a magnifying glass 200 mm long, lying
def _magnifier() -> Surface:
    lens = join(p.ball((82, 82, 8), p.SKY, 0, 55, 4.7, sides=32), p.put(p.ring(42, 9, p.GOLD), 0, 55, 4.7))
    handle = p.put(
        lathe([(0, 0), (6, 0), (9, 20), (7, 40), (10, 85), (6, 92), (0, 92)], p.WALNUT, sides=16), 0, -5, 10.5, roll=90
    )
    glint = p.put(p.plate([(-14, -16), (-8, -20), (12, 18), (6, 20)], (0, 1), p.WHITE), 0, 55, 8)
    return p.settled(join(lens, handle, p.rod(6, 22, p.GOLD, 0, 13, 8, roll=90), glint), 0.9)


@p.zoo_object("stapler", "stationery")  # 140 mm long, 60 mm high, its mouth towards the front
def _stapler() -> Surface:
    base = p.pebble((140, 36, 10), p.BLACK, 6)
    magazine = p.put(box((-62, 66), (-8, 8), (0, 11), p.STEEL), 0, 0, 17, pitch=-6)
    arm = p.pebble((136, 28, 20), p.RED, 5, 0, 0, 30, pitch=-9)
    hinge = p.pebble((34, 30, 46), p.RED, 4, -50, 0, 4)
    return p.settled(join(base, magazine, arm, hinge, p.put(box((36, 56), (-9, 9), (9, 11.5), p.SILVER))), 0.5)


@p.zoo_object("tape dispenser", "stationery")  # a desk tape dispenser, 150 mm long
def _tape() -> Surface:
    side = np.array([(-75, 0), (78, 0), (80, 40), (62, 44), (48, 20), (10, 12), (-8, 12), (-56, 46), (-72, 42)])
    cheeks = [p.plate(side * (1, 1), span, p.NAVY, 1) for span in ((-32, -22), (22, 32))]
    floor = box((-72, 76), (-32, 32), (0, 20), p.NAVY)
    roll = p.put(lathe([(22, -10), (38, -10), (38, 10), (22, 10), (22, -10)], p.AMBER, sides=32), -26, 0, 54, roll=90)
    hub = p.put(lathe([(0, -23), (21, -23), (21, 23), (0, 23)], p.WHITE, sides=24), -26, 0, 54, roll=90)
    strip = p.put(box((-92, 0), (-10, 10), (-0.8, 0.8), p.AMBER), 72, 0, 44, pitch=26)
    teeth = join(box((60, 80), (-32, 32), (18, 41), p.NAVY), box((74, 84), (-14, 14), (40, 44), p.SILVER))
    return join(floor, *cheeks, roll, hub, p.put(strip), teeth)


@p.zoo_object("spiral notebook", "stationery")  # a spiral notebook A5, lying
def _notebook() -> Surface:
    cover = [box((-105, 105), (-70, 74), z, p.TEAL) for z in ((0, 1.5), (13, 15))]
    pages = box((-103, 103), (-68, 72), (1.5, 13), p.CREAM)
    coils = [p.put(p.ring(9, 2.2, p.DARK, sides=6), x, -72, 10.2, pitch=90) for x in np.arange(-98, 100, 9).tolist()]
    label = join(
        box((-60, -10), (-35, 45), (15, 15.6), p.WHITE),
        p.put(p.writing("NOTES", 60, p.NAVY, 0.6), -28, 5, 15.3, pitch=-90),
    )
    return p.settled(join(*cover, pages, *coils, label), 1)


@p.zoo_object("paper clip", "stationery", "inside")  # 33 mm long, lying
def _paper_clip() -> Surface:
    loops = [
        (-4.5, -6),
        (-4.5, 10),
        *(p.arc(4.5, 180, 0, 11) + (0, 10)),
        (4.5, -11),
        *(p.arc(3.7, 0, -180, 11) + (0.8, -11)),
    ]
    loops += [(-2.9, 7), *(p.arc(2.7, 180, 0, 9) + (-0.2, 7)), (2.5, -7)]
    return p.settled(p.put(p.tube(p.in_plane(loops, 2, 0.6), 0.6, p.BLUE, 6), yaw=-60), 0.1)


@p.zoo_object("calculator", "stationery")  # 150 mm long, lying
def _calculator() -> Surface:
    case = p.pebble((150, 82, 14), p.DARK, 8)
    screen = join(
        box((-62, -34), (-32, 32), (13, 14.6), p.SCREEN),
        p.put(p.writing("3.1415", 46, p.BLACK, 0.5), -42, 6, 14.5, pitch=-90),
    )
    keys = [
        p.pebble((13, 14, 5), c, 6, x, y, 12.6)
        for i, x in enumerate((-18, 0, 18, 36, 54))
        for y, c in ((-27, p.RED if i == 0 else p.WHITE), (-9, p.WHITE), (9, p.WHITE), (27, p.ORANGE))
    ]
    return p.settled(join(case, screen, *keys), 0.5)


@p.zoo_object("envelope", "stationery")  # a letter 220 by 110 mm with a stamp, lying
def _envelope() -> Surface:
    paper = box((-55, 55), (-110, 110), (0, 3), p.CREAM)
    flap = [p.put(p.tube([(-54, s * 109, 3), (8, 0, 3)], 0.9, p.TAN, 6)) for s in (-1, 1)]
    seal = p.rod(13, 3, p.RED, 6, 0, 2.5)
    edge = [
        box((-55.5, 55.5), (y, y + 9), (0.6, 2.4), p.RED if k % 2 else p.BLUE) for k, y in ((0, -110.5), (1, 101.5))
    ]
    stripes = [
        box((x, x + 1.2), (y, y + 12), (0.3, 2.7), (p.RED, p.BLUE)[k % 2])
        for x in (-55.6, 54.4)
        for k, y in enumerate(np.arange(-105, 100, 18).tolist())
    ]
    return join(paper, *flap, seal, *edge, *stripes)


@p.zoo_object("desk calendar", "stationery")  # a calendar that stands like a tent, 170 mm wide
def _desk_calendar() -> Surface:
    page = join(box((0, 1.5), (-85, 85), (0, 140), p.WHITE), box((1, 2.4), (-85, 85), (104, 140), p.RED))
    days = [
        p.put(
            p.writing(str(i + 1), 5 + 4 * (i > 8), p.RED if i % 7 == 6 else p.BLACK, 0.7),
            1.5,
            -66 + 22 * (i % 7),
            84 - 18 * (i // 7),
        )
        for i in range(31)
    ]
    front = p.put(join(page, *days, p.put(p.writing("MAY", 52, p.WHITE, 1), 2, 0, 114)), 42, pitch=-17)
    back = p.put(box((-1.5, 0), (-85, 85), (0, 140), p.TAN), -42, pitch=17)
    coils = [p.put(p.ring(6, 2, p.DARK, sides=6), 0, y, 136, roll=90) for y in range(-78, 80, 12)]
    return join(front, back, *coils, box((-42, 42), (-85, 85), (0, 1.5), p.TAN))


# A ring binder for A4, 320 mm high, standing, its spine to the front.
@p.zoo_object("ring binder", "stationery", "inside")
def _binder() -> Surface:
    cover = [box((-285, 0), (y, y + 3), (0, 320), p.BLUE) for y in (-38, 35)]
    cover += [box((-3, 0), (-38, 38), (0, 320), p.BLUE)]
    paper = box((-272, -30), (-33, 22), (6, 303), p.WHITE)
    label = join(
        box((0, 0.8), (-26, 26), (150, 290), p.WHITE),
        *[box((0.5, 1.2), (-20, 20), (z, z + 3), p.GREY) for z in (190, 205, 220)],
    )
    hole = p.put(join(p.ring(15, 5, p.SILVER), cylinder(14, 1, p.BLACK)), 0, 0, 70, pitch=90)
    return join(*cover, paper, label, hole, p.put(p.writing("TAX", 40, p.BLACK, 1), 0.5, 0, 250))


# A block of sticky notes, 76 mm square, the first sheet curling up.
@p.zoo_object("Post-it notes", "stationery", rare=True)
def _post_it() -> Surface:
    block = [box((-38, 38), (-38, 38), (4 * i, 4 * i + 4), c) for i, c in enumerate((p.PINK, p.LIME, p.SKY, p.YELLOW))]
    curl = [(-38, 16), (0, 16.4), (20, 19), (34, 26), (33.6, 26.6), (19.5, 19.8), (0, 17.2), (-38, 16.8)]
    strips = [p.plate([curl[i], curl[i + 1], curl[6 - i], curl[7 - i]], (-38, 38), p.YELLOW, 1) for i in range(3)]
    return join(*block, *strips, p.put(p.writing("TO DO", 54, p.BLUE, 0.8), -8, 0, 16.8, pitch=-91))


@p.zoo_object("abacus", "stationery", rare=True)  # 240 mm wide, standing, ten beads on each of seven rods
def _abacus() -> Surface:
    frame = [box((-12, 12), (y, y + 12), (0, 200), p.BROWN) for y in (-120, 108)]
    frame += [box((-12, 12), (-120, 120), z, p.BROWN) for z in ((14, 26), (188, 200))]
    feet = [p.pebble((90, 18, 16), p.BROWN, 6, 0, y) for y in (-114, 114)]
    paints = (p.RED, p.ORANGE, p.YELLOW, p.GREEN, p.TEAL, p.BLUE, p.PURPLE)
    rods, bead = [p.tube([(0, -110, 40 + 22 * k), (0, 110, 40 + 22 * k)], 2, p.STEEL, 6) for k in range(7)], {}
    for k, color in enumerate(paints):
        for i in range(10):
            shift = 0 if i < (3, 7, 5, 8, 2, 6, 4)[k] else 60
            bead[k, i] = p.ball((19, 13.5, 19), color, 0, -99 + 14 * i + shift, 172 - 22 * k)
    return join(*frame, *feet, *rods, *bead.values())
