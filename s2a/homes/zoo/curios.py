"""Living room: globes, bowls and games. Shapes in millimetres, at the ordinary sizes of such objects."""

from __future__ import annotations

import numpy as np

from s2a.homes.solids import Surface, box, cylinder, ellipsoid, join, lathe
from s2a.homes.zoo import paint as p
from s2a.homes.zoo.shapes import arc, in_plane, pebble, plate, put, skin, smooth, tube, turned
from s2a.homes.zoo.zoo_object import ZooObject, zoo_object

ROUND = range(0, 360, 30)


def _globe() -> Surface:
    """An earth globe on a stand, 380 mm high."""
    lands = [
        [(20, -15), (32, 5), (20, 35), (5, 42), (-30, 25), (-33, 18), (0, 10), (5, -8)],
        [
            (40, -5),
            (60, 10),
            (68, 40),
            (70, 90),
            (60, 140),
            (40, 120),
            (20, 105),
            (12, 78),
            (25, 60),
            (32, 40),
            (42, 28),
        ],
        [(68, -160), (70, -95), (50, -60), (30, -80), (18, -96), (32, -115), (55, -130)],
        [(10, -75), (5, -52), (-8, -36), (-40, -62), (-53, -70), (-18, -72)],
        [(-14, 130), (-12, 142), (-28, 153), (-38, 145), (-33, 116), (-22, 115)],
    ]
    ball = join(
        ellipsoid((250, 250, 250), p.BLUE, sides=32), *[_land(np.radians(np.array(land, float))) for land in lands]
    )
    tilted = put(join(ball, put(cylinder(4, 276, p.GOLD), z=-138)), z=235, yaw=-20, roll=23)
    arm = put(tube(in_plane(arc(138, -90, 90, 25), 0), 6, p.GOLD), z=235, roll=23)
    foot = turned([(85, 0), (82, 12), (24, 26), (12, 50), (16, 100)], p.WALNUT)
    return join(tilted, arm, foot)


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
    return skin(np.array(rings), False, p.GREEN)


def _chess() -> Surface:
    """A board of 400 mm with men in play."""
    fields = [
        box(
            (48 * i - 192, 48 * i - 144), (48 * j - 192, 48 * j - 144), (17, 20.5), p.CREAM if (i + j) % 2 else p.WALNUT
        )
        for i in range(8)
        for j in range(8)
    ]

    def pawn(color: tuple[int, int, int]) -> Surface:
        return join(
            turned([(15, 0), (14, 8), (6, 18), (6, 34)], color, sides=14), put(ellipsoid((19, 19, 19), color), z=40)
        )

    def king(color: tuple[int, int, int]) -> Surface:
        cross = join(box((-2.5, 2.5), (-2.5, 2.5), (80, 98), color), box((-2.5, 2.5), (-8, 8), (86, 91), color))
        return join(turned([(18, 0), (17, 10), (8, 24), (8, 58), (14, 62), (10, 66), (15, 82)], color, sides=14), cross)

    def rook(color: tuple[int, int, int]) -> Surface:
        teeth = [put(box((7, 14), (-4, 4), (50, 58), color), yaw=a) for a in ROUND[::2]]
        return join(turned([(17, 0), (16, 9), (10, 20), (10, 38), (15, 42), (15, 51)], color, sides=14), *teeth)

    places = [(pawn, 1, j) for j in (0, 1, 3, 5, 6, 7)] + [
        (pawn, 2, 2),
        (pawn, 3, 4),
        (king, 0, 4),
        (rook, 0, 0),
        (rook, 0, 7),
        (king, 0, 3),
    ]
    men = [put(man(p.BLACK), 48 * i - 168, 48 * j - 168, 20) for man, i, j in places]
    men += [put(man(p.IVORY), 168 - 48 * i, 168 - 48 * j, 20) for man, i, j in places]
    return join(box((-205, 205), (-205, 205), (0, 19), p.BROWN), *fields, *men)


def _snow_globe() -> Surface:
    """100 mm high: a snowman and a fir in a glass ball that is cut open in front."""
    foot = lathe([(0, 0), (42, 0), (44, 8), (34, 30), (0, 30)], p.RED)
    plaque = put(box((0, 2), (-16, 16), (0, 10), p.GOLD), 38, 0, 10, pitch=-20)
    angles = np.radians(np.linspace(-45, 90, 14))
    section = [(42 * np.cos(a), 62 + 42 * np.sin(a)) for a in angles]
    shell = np.array(
        [[(r * np.cos(t), r * np.sin(t), z) for r, z in section] for t in np.radians(np.linspace(75, 285, 22))]
    )
    inner = shell * (0.96, 0.96, 1) + (0, 0, 0)
    glass = _sheet(shell, inner)
    snow = lathe([(0, 28), (33, 28), (38, 38), (20, 42), (0, 43)], p.WHITE)
    man = [put(ellipsoid((s, s, s), p.WHITE), 8, -9, z) for s, z in ((24, 50), (17, 66), (12, 78))]
    hat = join(put(cylinder(8, 2, p.BLACK), 8, -9, 83), put(cylinder(5, 8, p.BLACK), 8, -9, 84))
    face = [put(ellipsoid((8, 2.5, 2.5), p.ORANGE), 16, -9, 77)] + [
        put(ellipsoid((2, 2, 2), p.BLACK), 13.5, -9 + s, 80) for s in (-2.5, 2.5)
    ]
    fir = [
        put(lathe([(0, 0), (r, 0), (1, r * 1.5), (0, r * 1.5)], p.GREEN, sides=10), -2, 14, z)
        for r, z in ((15, 44), (12, 56), (8, 68))
    ]
    flakes = [
        put(ellipsoid((3, 3, 3), p.WHITE), *spot)
        for spot in ((-24, -14, 80), (-26, 6, 88), (-20, 24, 76), (-30, -2, 70), (-10, -22, 88))
    ]
    return join(foot, plaque, glass, snow, *man, hat, *face, *fir, *flakes)


def _sheet(outer: np.ndarray, inner: np.ndarray) -> Surface:
    """A closed shell between two grids of points [row column 3]."""
    rings = np.concatenate([outer, inner[:, ::-1]], axis=1)
    return skin(rings, False, p.SKY)


def _fish_bowl() -> Surface:
    """A goldfish in a round bowl whose glass is left away in front, 220 mm high."""
    section = [(45, 0), (85, 20), (115, 70), (120, 110), (105, 165), (80, 200), (92, 212)]
    curve = smooth(section, 22)
    wall = np.array(
        [[(r * np.cos(t), r * np.sin(t), z) for r, z in curve] for t in np.radians(np.linspace(62, 298, 30))]
    )
    glass = _sheet(wall, wall * (0.97, 0.97, 1))
    base = join(
        lathe([(0, 0), (45, 0), (85, 20), (102, 44), (80, 52), (0, 54)], p.STRAW),
        lathe([(0, -0.5), (50, -0.5), (50, 3), (0, 3)], p.SKY),
    )
    stones = [
        put(ellipsoid((24, 20, 16), c), 70 * np.cos(a), 70 * np.sin(a), 52)
        for a, c in ((0.2, p.WHITE), (-0.5, p.GREY), (0.8, p.BROWN), (-1.1, p.SILVER))
    ]
    fish = join(
        ellipsoid((34, 86, 46), p.ORANGE, sides=20),
        put(plate([(0, 0), (-38, 30), (-28, 0), (-38, -30)], (-4, 4), p.ORANGE, 0), 0, -32),
        put(plate([(-24, 0), (18, 0), (-8, 24)], (-3, 3), p.RED, 0), 0, 0, 18),
    )
    eyes = [put(ellipsoid((5, 10, 10), p.WHITE), 13, 24, 6), put(ellipsoid((4, 5, 5), p.BLACK), 15.5, 25, 6)]
    weed = [
        tube([(x, y, 50), (x, y + 10, 90), (x, y - 6, 130), (x, y + 6, z)], [6, 8, 6, 2], p.LEAF, 6)
        for x, y, z in ((-30, 60, 175), (-46, 40, 155), (-40, 76, 140), (-40, -64, 150))
    ]
    bubbles = [put(ellipsoid((8, 8, 8), p.WHITE), 10, 62, z) for z in (118, 134, 150)]
    return join(glass, base, *stones, put(join(fish, *eyes), 16, 0, 106), *weed, *bubbles)


def _rubiks_cube() -> Surface:
    """57 mm wide, its upper layer turned."""
    faces = ((0, p.RED), (90, p.BLUE), (180, p.ORANGE), (270, p.GREEN))
    mixed = (p.RED, p.WHITE, p.BLUE, p.YELLOW, p.GREEN, p.ORANGE, p.RED, p.BLUE, p.WHITE)
    layers = []
    for k in range(3):
        core = put(pebble((57, 57, 18.6), p.BLACK, 14), z=19.2 * k)
        tiles = [
            put(
                box(
                    (28, 29),
                    (19 * j - 27.2, 19 * j - 10.8),
                    (19.2 * k + 1.4, 19.2 * k + 17.4),
                    c if k < 1 else mixed[(i * 2 + 3 * k + 4 * j) % 9],
                ),
                yaw=a,
            )
            for i, (a, c) in enumerate(faces)
            for j in range(3)
        ]
        layers.append(put(join(core, *tiles), yaw=0 if k < 2 else 24))
    top = [
        put(
            box(
                (19 * i - 27.2, 19 * i - 10.8),
                (19 * j - 27.2, 19 * j - 10.8),
                (56.5, 57.6),
                mixed[(i + 4 * j + 1) % 9] if (i + j) % 2 else p.WHITE,
            ),
            yaw=24,
        )
        for i in range(3)
        for j in range(3)
    ]
    return join(*layers, *top)


def objects() -> list[ZooObject]:
    """Return the objects of this module."""
    return [
        zoo_object("globe", "living room", _globe()),
        zoo_object("chessboard", "living room", _chess()),
        zoo_object("snow globe", "living room", _snow_globe()),
        zoo_object("goldfish bowl", "living room", _fish_bowl()),
        zoo_object("Rubik's cube", "living room", _rubiks_cube(), rare=True),
    ]
