"""Bedroom: comfort and decor. Shapes in millimetres, at the ordinary sizes of such objects."""

import numpy as np

from s2a.homes.solids import FABRIC, WOOD, Surface, box, cylinder, ellipsoid, join, lathe, prism, stadium
from s2a.homes.zoo import shapes as p


@p.zoo_object("pillow", "bedroom")  # 600 by 400 mm, 130 mm thick: its corners pinched
def _pillow() -> Surface:
    cloth = p.pebble((400, 600, 150), p.WHITE, 4, texture=FABRIC, sides=48)
    x, y, z = cloth.vertices.T
    edge = np.clip(np.maximum(abs(x) / 200, abs(y) / 300), 0, 1)
    cloth.vertices[:, 2] = 75 + (z - 75) * (1 - 0.55 * edge**3)
    cloth.vertices[:, :2] *= 1 + 0.10 * np.clip(abs(x * y) / 60000, 0, 1)[:, None]
    stripes = [p.pebble((330, 12, 9), p.BLUE, 6, 0, y, 141 - 0.00028 * y * y) for y in (-200, -170, 170, 200)]
    return p.settled(join(cloth, *stripes), 12)


@p.zoo_object("folded woollen blanket", "bedroom", "inside")  # a chequered woollen blanket, folded to 500 by 350 mm
def _blanket() -> Surface:
    fold = p.put(prism(stadium(350, 42), (-250, 250), p.RED, FABRIC), z=21)
    down = [p.put(prism(stadium(351, 43), (x, x + 34), p.NAVY, FABRIC), z=21) for x in (-200, -70, 60, 190)]
    across = [box((-250.5, 250.5), (y, y + 22), (-0.3, 42.6), p.CREAM, FABRIC) for y in (-110, -20, 70)]
    fringe = [p.rod(4, 34, p.CREAM, 248, y, 8, pitch=90, sides=6) for y in range(-160, 165, 12)]
    return p.settled(p.put(join(*[p.put(join(fold, *down, *across, *fringe), z=41 * i) for i in range(3)]), yaw=0), 1)


@p.zoo_object("teddy bear", "bedroom")  # sitting, 300 mm high
def _teddy() -> Surface:
    body = p.ball((130, 150, 170), p.BRONZE, 0, 0, 85, texture=FABRIC, sides=20)
    head = p.ball((125, 140, 125), p.BRONZE, 8, 0, 210, texture=FABRIC, sides=20)
    ears = [
        p.put(join(ellipsoid((26, 54, 54), p.BRONZE, FABRIC), p.ball((22, 34, 34), p.TAN, 5)), 5, s * 58, 264)
        for s in (-1, 1)
    ]
    legs = [p.ball((140, 62, 62), p.BRONZE, 80, s * 62, 30, yaw=s * 18, texture=FABRIC, sides=16) for s in (-1, 1)]
    soles = [p.ball((14, 44, 44), p.TAN, 144, s * 82, 31, yaw=s * 18) for s in (-1, 1)]
    arms = [
        p.ball((56, 52, 120), p.BRONZE, 30, s * 78, 118, roll=s * 38, pitch=-30, texture=FABRIC, sides=16)
        for s in (-1, 1)
    ]
    snout = join(p.ball((50, 62, 48), p.TAN, 62, 0, 195), p.ball((16, 24, 17), p.BLACK, 86, 0, 204))
    eyes = [p.ball((10, 14, 14), p.BLACK, 64, s * 28, 228) for s in (-1, 1)]
    bow = [p.ball((22, 52, 32), p.RED, 62, s * 26, 152, roll=s * 12) for s in (-1, 1)]
    bow += [p.ball((24, 18, 18), p.RED, 66, 0, 152)]
    return p.settled(join(body, head, *ears, *legs, *soles, *arms, snout, *eyes, *bow), 6)


@p.zoo_object("alarm clock", "bedroom")  # with two bells, 165 mm high
def _alarm_clock() -> Surface:
    case = p.put(join(cylinder(58, 44, p.RED, sides=36), p.rod(50, 46, p.WHITE, sides=36)), -22, 0, 78, pitch=90)
    marks = [p.put(box((24, 26), (-2, 2), (36, 46), p.BLACK), 0, 0, 78, roll=a) for a in range(0, 360, 30)]
    hands = [p.put(box((24, 27), (-2.5, 2.5), (-4, n), p.BLACK), 0, 0, 78, roll=a) for a, n in ((-60, 38), (55, 26))]
    bells = [p.put(p.put(p.turned([(29, 0), (26, 14), (6, 24)], p.GOLD), z=66), 0, 0, 78, roll=a) for a in (-36, 36)]
    stems = [p.put(p.rod(4, 24, p.STEEL, z=50), 0, 0, 78, roll=a) for a in (-36, 36)]
    feet = [
        p.put(p.scaled(lathe([(0, -74), (6, -74), (8, -50), (0, -50)], p.GOLD), 3, 1, 1), 0, 0, 66, roll=a)
        for a in (-28, 28)
    ]
    hammer = join(box((-3, 3), (-3, 3), (130, 156), p.STEEL), p.ball((14, 30, 12), p.STEEL, z=156))
    return p.settled(join(case, *marks, *hands, *bells, *stems, *feet, hammer), 4)


@p.zoo_object("pair of slippers", "bedroom")  # a pair, 270 mm long
def _slippers() -> Surface:
    outline = np.concatenate([p.arc(1, 0, 180, 15) * (42, 60) + (0, 72), p.arc(1, 180, 360, 15) * (36, 50) - (0, 84)])
    sole = join(p.plate(outline, (0, 16), p.WALNUT), p.plate(0.93 * outline, (15, 22), p.CREAM))
    upper = p.settled(p.ball((92, 150, 104), p.BLUE, z=52, texture=FABRIC, sides=20), 50)
    cuff = p.put(p.ring(1, 0.3, p.WHITE, sides=8), z=0)
    fur = p.put(p.scaled(cuff, 40, 18, 44), 0, 8, 28, roll=62)
    slipper = p.put(join(sole, p.put(upper, 0, 70, 16), fur), yaw=-90)
    return join(p.put(slipper, 0, -52, yaw=6), p.put(slipper, -8, 52, yaw=-4))


@p.zoo_object("hot-water bottle", "bedroom")  # 330 mm long, lying flat
def _hot_water_bottle() -> Surface:
    body = p.pebble((250, 195, 44), p.RED, 3.4, 20)
    ribs = [p.pebble((170, 7, 5), p.WINE, 4, 20, y, 41.5 - 0.0014 * y * y) for y in range(-60, 61, 20)]
    neck = p.put(
        p.loft([(0, 22, 55), (24, 18, 30), (62, 16, 24), (70, 20, 34), (76, 20, 34)], p.RED), -88, 0, 22, pitch=-90
    )
    plug = p.pebble((32, 30, 26), p.BLACK, 4, -174, 0, 10)
    return p.settled(join(body, *ribs, neck, plug), 4)


@p.zoo_object("straw hat", "bedroom")  # 360 mm wide, 110 mm high
def _straw_hat() -> Surface:
    brim = lathe([(80, 0), (180, 4), (180, 9), (80, 8), (80, 0)], p.STRAW, FABRIC, 44)
    crown = p.turned([(88, 2), (86, 60), (74, 98), (30, 108)], p.STRAW, FABRIC, 36)
    band = lathe([(88, 8), (90, 8), (88.5, 38), (86, 38), (88, 8)], p.RED, sides=36)
    weave = [p.put(p.ring(r, 4, p.AMBER, sides=6), z=8 + 0.01 * (r - 80)) for r in (110, 135, 158)]
    bow = [p.ball((8, 46, 26), p.RED, 30, 86, 27 + s * 12, yaw=70, roll=s * 25) for s in (-1, 1)]
    return p.settled(join(brim, crown, band, *weave, *bow), 0.5)


@p.zoo_object("laundry basket", "bedroom", "against wall")  # woven, 450 mm high and 380 mm wide, clothes on top
def _laundry_basket() -> Surface:
    wall = lathe([(0, 0), (160, 0), (190, 420), (178, 420), (150, 12), (0, 12)], p.TAN, sides=36)
    hoops = [
        p.put(p.ring(160 + 30 * z / 420, 13, p.BROWN if k % 2 else p.BEECH, sides=6), z=z)
        for k, z in enumerate(range(20, 421, 40))
    ]
    staves = [p.put(p.tube([(162, 0, 4), (193, 0, 416)], 6, p.BROWN, 6), yaw=a) for a in range(0, 360, 15)]
    ears = [p.put(p.tube(p.in_plane(p.arc(55, 0, 180, 11) + (0, 415), 1), 9, p.BROWN), 0, s * 188, 0) for s in (-1, 1)]
    paints = ((60, -40, p.BLUE), (-60, 50, p.WHITE), (40, 70, p.ROSE), (-50, -60, p.TEAL), (0, 0, p.YELLOW))
    clothes = [p.ball((210, 170, 120), c, x, y, 395, yaw=x, roll=12, texture=FABRIC) for x, y, c in paints]
    return join(wall, *hoops, *staves, *ears, *clothes)


@p.zoo_object("reading glasses", "bedroom")  # reading glasses 140 mm wide, lying with the temples open
def _glasses() -> Surface:
    rims = [p.put(p.scaled(p.put(p.ring(1, 0.17, p.WALNUT), pitch=90), 22, 24, 19), 0, y, 21) for y in (-35, 35)]
    lenses = [p.put(p.plate(p.arc(1, 0, 360, 25)[:-1] * (23, 18), (-1, 1), p.SKY, 0), 0, y, 21) for y in (-35, 35)]
    bridge = p.tube(p.in_plane(p.arc(13, 20, 160, 9) * (1, 0.7) + (0, 22), 0), 3, p.WALNUT)
    temples = [
        p.tube(
            [(0, s * 58, 27), (-4, s * 70, 29), (-95, s * 72, 29), (-118, s * 71, 18), (-140, s * 70, 3)], 3, p.WALNUT
        )
        for s in (-1, 1)
    ]
    return p.settled(join(*rims, *lenses, bridge, *temples), 0.5)


@p.zoo_object("coat hanger", "bedroom", "hanging")  # 420 mm wide, of wood
def _coat_hanger() -> Surface:
    arms = p.smooth([(-210, 0), (-190, 12), (-60, 78), (0, 92), (60, 78), (190, 12), (210, 0)], 31)
    hook = np.concatenate([[(0, 92), (0, 132)], p.arc(26, -90, 190, 17) + (0, 162)])
    bar = p.tube([(0, -170, 18), (0, 170, 18)], 6, p.TAN)
    return join(p.tube(p.in_plane(arms, 0), 10, p.BEECH, flat=1.1), bar, p.tube(p.in_plane(hook, 0), 3, p.STEEL))


@p.zoo_object("bedside lamp", "bedroom")  # a bedside lamp, 420 mm high
def _lamp() -> Surface:
    foot = p.turned([(70, 0), (68, 10), (22, 26), (34, 80), (62, 130), (40, 190), (12, 220), (10, 260)], p.TEAL)
    shade = lathe([(150, 235), (95, 415), (92, 415), (146, 235), (150, 235)], p.CREAM, sides=32)
    bulb = p.ball((60, 60, 80), p.YELLOW, z=290)
    trims = [
        lathe([(r, z), (r, z + 8), (r - 6, z + 8), (r - 6, z), (r, z)], p.GOLD, sides=32)
        for r, z in ((151.5, 235), (98, 407))
    ]
    spokes = [p.put(box((-94, 94), (-2, 2), (396, 400), p.STEEL), yaw=a) for a in (0, 60, 120)]
    return join(foot, shade, bulb, *trims, *spokes, cylinder(5, 405, p.STEEL))


@p.zoo_object("candle", "bedroom")  # a thick candle on a saucer, 150 mm high with its flame
def _candle() -> Surface:
    dish = lathe([(0, 0), (48, 0), (66, 14), (62, 15), (44, 6), (0, 6)], p.GOLD)
    wax = p.put(p.turned([(36, 0), (36, 92), (33, 98)], p.CREAM), z=5)
    drips = [
        p.ball((10, 12, n), p.WHITE, 35 * np.cos(a), 35 * np.sin(a), 100 - n / 2.2)
        for a, n in ((0.2, 50), (0.9, 30), (-0.7, 40))
    ]
    flame = p.put(p.turned([(3, 0), (9, 12), (7, 24), (1, 42)], p.ORANGE), z=112)
    ear = p.put(p.ring(15, 6, p.GOLD), 0, 74, 20, roll=90, yaw=90)
    return join(
        dish,
        wax,
        *drips,
        p.rod(1.5, 14, p.BLACK, z=100),
        flame,
        p.put(p.turned([(1, 0), (5, 9), (1, 22)], p.YELLOW), 6, 0, 114),
        ear,
    )


@p.zoo_object("jewellery box", "bedroom")  # 220 mm wide with its lid up, pearls and rings inside
def _jewellery_box() -> Surface:
    wood = [
        box((-80, 80), (-110, 110), (0, 12), p.WALNUT),
        *[box((x, x + 8), (-110, 110), (0, 80), p.WALNUT) for x in (-80, 72)],
        *[box((-80, 80), (y, y + 8), (0, 80), p.WALNUT) for y in (-110, 102)],
    ]
    velvet = box((-72, 72), (-102, 102), (12, 56), p.WINE, FABRIC)
    lid = p.put(
        join(box((0, 12), (-110, 110), (0, 160), p.WALNUT), box((12, 13), (-95, 95), (14, 146), p.SKY)),
        -80,
        0,
        80,
        pitch=-18,
    )
    pearls = [p.ball((13, 13, 13), p.WHITE, 40 * np.cos(a), 60 * np.sin(a) + 20, 60) for a in np.arange(0, 6.2, 0.26)]
    gems = [
        p.put(join(p.put(p.ring(13, 4, p.GOLD), roll=90), p.ball((12, 12, 12), c, z=16)), x, y, 66, yaw=60)
        for x, y, c in ((10, -70, p.RED), (-30, -62, p.TEAL), (0, 24, p.BLUE))
    ]
    clasp = box((80, 84), (-14, 14), (52, 76), p.GOLD)
    return join(*wood, velvet, lid, *pearls, *gems, clasp)


@p.zoo_object("photo frame", "bedroom")  # for a photo of 130 by 180 mm, leaning on its stand: a house under the sun
def _photo_frame() -> Surface:
    frame = box((0, 16), (-90, 90), (0, 225), p.WALNUT, WOOD)
    sky, ground = box((15, 17), (-68, 68), (22, 203), p.SKY), box((15, 17.6), (-68, 68), (22, 80), p.GREEN)
    house = box((15, 18.2), (-40, 20), (60, 110), p.CREAM)
    roof = p.plate([(-50, 110), (30, 110), (-10, 150)], (15, 18.2), p.RED, 0)
    sun = p.plate(p.arc(17, 0, 360, 21)[:-1] + (42, 172), (15, 18.2), p.YELLOW, 0)
    door = box((15, 18.8), (-18, -2), (60, 90), p.BROWN)
    stand = p.put(box((-5, 0), (-30, 30), (0, 150), p.BLACK), -100, 0, 0, pitch=24)
    return p.settled(join(p.put(join(frame, sky, ground, house, roof, sun, door), pitch=-12), stand), 3)


@p.zoo_object("piggy bank", "bedroom")  # 170 mm long
def _piggy_bank() -> Surface:
    body = p.ball((160, 120, 115), p.PINK, z=72, sides=24)
    snout = join(p.rod(22, 20, p.PINK, 70, 0, 72, pitch=90), *[p.ball((4, 8, 12), p.ROSE, 91, y, 73) for y in (-8, 8)])
    eyes = [p.ball((8, 10, 12), p.BLACK, 66, y, 98) for y in (-22, 22)]
    ears = [
        p.put(lathe([(0, 0), (17, 0), (2, 36), (0, 36)], p.ROSE, sides=8), 40, y, 116, pitch=25, roll=-y * 0.5)
        for y in (-30, 30)
    ]
    legs = [p.put(lathe([(0, 0), (17, 0), (20, 40), (0, 40)], p.PINK), x, y) for x in (-42, 42) for y in (-32, 32)]
    slot = box((-22, 22), (-3, 3), (124, 131), p.BLACK)
    coin = p.rod(17, 3, p.GOLD, 0, 1.5, 136, roll=90)
    tail = p.tube([(-78 - 4 * t, 9 * np.cos(2 * t), 80 + 9 * np.sin(2 * t)) for t in np.linspace(0, 4, 24)], 4, p.ROSE)
    return join(body, snout, *eyes, *ears, *legs, slot, coin, tail)


@p.zoo_object("make-up mirror", "bedroom")  # a round mirror on a foot, 380 mm high
def _vanity_mirror() -> Surface:
    foot = p.turned([(75, 0), (74, 10), (20, 22), (9, 40), (8, 120), (10, 128)], p.GOLD)
    fork = p.tube(p.in_plane(p.arc(128, 180, 360, 21) + (0, 250), 0), 6, p.GOLD)
    disc = join(cylinder(118, 14, p.GOLD, sides=44), p.rod(106, 16, p.SKY, sides=44))
    glints = [
        p.plate([(a, b), (a + 22, b), (a + 92, b + 110), (a + 70, b + 110)], (16, 17.5), p.WHITE, 0)
        for a, b in ((-70, -60), (-30, -66))
    ]
    tilted = p.put(join(p.put(disc, pitch=90), *glints), -7, 0, 250, pitch=-10)
    return join(foot, fork, tilted, *[p.ball((16, 20, 16), p.GOLD, 0, y, 250) for y in (-126, 126)])


@p.zoo_object("lava lamp", "bedroom")  # 370 mm high
def _lava_lamp() -> Surface:
    foot = lathe([(0, 0), (58, 0), (36, 55), (48, 105), (0, 105)], p.SILVER, sides=28)
    glass = lathe([(0, 105), (48, 105), (50, 130), (26, 320), (0, 320)], p.PURPLE, sides=28)
    cap = lathe([(0, 318), (28, 318), (16, 368), (0, 370)], p.SILVER, sides=28)
    spots = ((150, 0.1, 52), (185, 0.9, 34), (205, -0.6, 40), (240, 0.3, 32), (262, 1.3, 20), (290, -0.1, 24))
    blobs = [
        p.ball(
            (s * 0.4, s * 0.9, s),
            p.ORANGE,
            (53 - 0.13 * (z - 110)) * np.cos(a) - 2,
            (53 - 0.13 * (z - 110)) * np.sin(a),
            z,
            yaw=np.degrees(a),
        )
        for z, a, s in spots
    ]
    return join(foot, glass, cap, *blobs)


@p.zoo_object("vase of tulips", "bedroom")  # a vase of seven tulips, 380 mm high
def _tulips() -> Surface:
    vase = p.turned([(40, 0), (46, 8), (58, 70), (36, 140), (46, 175)], p.SKY)
    parts = [vase]
    paints = (p.RED, p.YELLOW, p.ROSE, p.ORANGE, p.RED, p.PURPLE, p.YELLOW)
    for i, color in enumerate(paints):
        lean, turn = (0, 0) if i == 0 else (16 + 5 * (i % 2), 60 * i)
        bloom = join(
            p.put(p.turned([(6, 0), (22, 18), (24, 34), (16, 54)], color), z=300 + 12 * (i % 3)),
            cylinder(3.5, 310, p.LEAF, sides=8),
        )
        leaf = p.ball((5, 26, 150), p.GREEN, 10, 0, 190, pitch=10)
        parts.append(p.put(p.put(join(p.put(bloom, z=-120), p.put(leaf, z=-120)), pitch=lean), 0, 0, 120, yaw=turn))
    return join(*parts)


@p.zoo_object("dreamcatcher", "bedroom", "hanging", rare=True)  # hanging, 480 mm high with its feathers
def _dreamcatcher() -> Surface:
    hoop = p.put(p.ring(90, 10, p.BROWN), 0, 0, 360, pitch=90)
    knots = [
        (r * np.cos(a), 360 + r * np.sin(a))
        for r in (88, 62, 38, 18)
        for a in np.radians(np.arange(0, 360, 36) + (18 if r in (62, 18) else 0))
    ]
    web = [
        p.tube(
            [(0, *knots[10 * i + k]), (0, *knots[10 * (i + 1) + (k - s + (0 if i != 1 else 1)) % 10])], 1.6, p.CREAM, 5
        )
        for i in range(3)
        for k in range(10)
        for s in (0, 1)
    ]
    beads = [p.ball((12, 13, 13), c, 0, *knots[k]) for k, c in ((12, p.TEAL), (17, p.RED), (24, p.TEAL), (29, p.RED))]
    feather = p.plate([(0, 0), (14, -40), (13, -90), (0, -120), (-13, -90), (-14, -40)], (-1.5, 1.5), p.WHITE, 0)
    tip = p.plate([(13.5, -80), (13, -90), (0, -122), (-13, -90), (-13.5, -80)], (-2.2, 2.2), p.TEAL, 0)
    strings = []
    for y, top, drop in ((-66, 302, 60), (0, 272, 120), (66, 302, 60)):
        lower = top - drop
        strings += [p.tube([(0, y, top), (0, y, lower - 110)], 1.6, p.BROWN, 5), p.put(join(feather, tip), 0, y, lower)]
        strings += [p.ball((13, 14, 14), p.RED, 0, y, lower + 8)]
    return join(hoop, *web, *beads, *strings, p.put(p.ring(12, 3, p.BROWN), 0, 0, 463, pitch=90))


@p.zoo_object("matryoshka", "bedroom", rare=True)  # 160 mm high
def _matryoshka() -> Surface:
    body = p.turned([(38, 0), (42, 6), (46, 50), (34, 92), (30, 100)], p.RED)
    head = p.turned([(30, 98), (33, 122), (26, 146), (6, 158)], p.YELLOW)
    face = p.ball((16, 44, 42), p.CREAM, 26, 0, 124)
    hair = [p.ball((12, 22, 12), p.BROWN, 31, s * 9, 141, roll=-s * 20) for s in (-1, 1)]
    eyes = [p.ball((4, 5, 6), p.BLACK, 33.5, s * 8, 127) for s in (-1, 1)]
    cheeks = [p.ball((4, 8, 8), p.PINK, 32, s * 13, 117) for s in (-1, 1)]
    mouth, shawl = p.ball((4, 9, 4), p.RED, 33.5, 0, 112), p.put(p.ring(31, 9, p.GREEN), z=99)
    apron = p.ball((26, 62, 76), p.WHITE, 34, 0, 48)
    petals = [p.ball((4, 15, 15), p.ROSE, 46.5, 12 * np.cos(a), 50 + 12 * np.sin(a)) for a in np.arange(0, 6, 1.257)]
    leaves = [p.ball((4, 20, 9), p.LEAF, 43, s * 20, 30, roll=s * 30) for s in (-1, 1)]
    return join(
        body,
        head,
        face,
        *hair,
        *eyes,
        *cheeks,
        mouth,
        shawl,
        apron,
        *petals,
        *leaves,
        p.ball((6, 12, 12), p.YELLOW, 47, 0, 50),
    )
