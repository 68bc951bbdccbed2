"""Things that stand, hang and lie about in living rooms, bedrooms, offices. Local frames: on z = 0, front towards +x, metres."""

from dataclasses import replace

import numpy as np

from s2a.homes import solids
from s2a.homes import solids as p

BLACK, GREY, STEEL, WHITE = (38, 38, 42), (120, 122, 126), (168, 170, 174), (235, 235, 232)
CLOTH: tuple[p.Color, ...] = ((52, 74, 110), (120, 44, 48), (64, 96, 72), (90, 90, 96))
SPINES: list[p.Color] = [(150, 40, 40), (36, 70, 120), (40, 100, 70), (200, 160, 60), (90, 60, 110), (220, 214, 200)]


def office_chair(rng: np.random.Generator) -> p.Piece:
    """Return a swivel chair on a five-armed base, its back rest towards -x."""
    cloth = solids.pick(rng, CLOTH)
    arms = [p.box((0.03, 0.3), (-0.02, 0.02), (0.06, 0.1), BLACK).moved(p.at(0, 0, 0, 72 * i)) for i in range(5)]
    wheels = [
        p.ellipsoid((0.06, 0.04, 0.06), BLACK).moved(p.at(0, 0, 0, 72 * i) @ p.at(0.29, 0, 0.03)) for i in range(5)
    ]
    column = p.cylinder(0.03, 0.36, BLACK).moved(p.at(0, 0, 0.06))
    seat = p.box((-0.23, 0.25), (-0.24, 0.24), (0.42, 0.5), cloth, p.FABRIC)
    back = p.box((-0.04, 0.04), (-0.22, 0.22), (0.12, 0.62), cloth, p.FABRIC)
    back = back.moved(p.at(-0.24, 0, 0.46) @ p.rotation((0, -0.15, 0)))
    spine = p.box((-0.3, -0.2), (-0.03, 0.03), (0.42, 0.75), BLACK)
    return p.Piece("office chair", p.join(*arms, *wheels, column, seat, back, spine))


def chair() -> p.Piece:
    """Return a wooden four-legged chair, its back rest towards -x."""
    wood = (150, 104, 62)
    legs = p.posts((-0.21, 0.17), (-0.2, 0.165), (0, 0.44), 0.035, wood, p.WOOD)
    back = [p.box((-0.21, -0.175), (y, y + 0.035), (0.44, 0.88), wood, p.WOOD) for y in (-0.2, 0.165)]
    slats = [p.box((-0.205, -0.18), (-0.17, 0.17), (z, z + 0.07), wood, p.WOOD) for z in (0.58, 0.7, 0.81)]
    return p.Piece(
        "chair", p.join(p.box((-0.22, 0.22), (-0.21, 0.21), (0.44, 0.465), wood, p.WOOD), *legs, *back, *slats)
    )


def book(rng: np.random.Generator, standing: bool = True) -> tuple[p.Piece, float]:
    """Return a book and how much width it takes along y [m]: upright with its spine at x = 0, or lying."""
    thick, tall, deep = rng.uniform(0.018, 0.05), rng.uniform(0.19, 0.27), rng.uniform(0.13, 0.19)
    color = solids.pick(rng, SPINES)
    cover = p.box((-deep, 0), (-thick / 2, thick / 2), (0, tall), color)
    y = (-thick / 2 + 0.003, thick / 2 - 0.003)
    pages = p.box((-deep - 0.001, -0.004), y, (0.003, tall + 0.001), (238, 232, 214))
    shape = p.join(cover, pages)
    if not standing:
        shape = shape.moved(p.at(deep / 2, -tall / 2, thick / 2) @ p.rotation((-np.pi / 2, 0, 0)))
    return p.Piece("book", shape), thick if standing else tall


def monitor() -> p.Piece:
    """Return a 27-inch monitor on a foot, its dark screen towards +x."""
    foot = p.box((-0.11, 0.09), (-0.13, 0.13), (0, 0.012), BLACK)
    neck = p.box((-0.06, -0.035), (-0.03, 0.03), (0.012, 0.3), BLACK)
    case = p.box((-0.035, 0.0), (-0.31, 0.31), (0.13, 0.49), BLACK)
    screen = p.box((0.0, 0.002), (-0.3, 0.3), (0.14, 0.48), (24, 28, 40), dropout=0.25)
    return p.Piece("monitor", p.join(foot, neck, case, screen))


def keyboard() -> p.Piece:
    """Return a keyboard, long along y."""
    rows = [p.box((x, x + 0.017), (-0.2, 0.2), (0.018, 0.024), (70, 70, 76)) for x in np.arange(-0.06, 0.05, 0.021)]
    return p.Piece("keyboard", p.join(p.box((-0.07, 0.07), (-0.22, 0.22), (0, 0.018), BLACK), *rows))


def mouse() -> p.Piece:
    """Return a computer mouse."""
    return p.Piece("mouse", p.ellipsoid((0.11, 0.062, 0.07), BLACK).moved(p.at(0, 0, 0.004)))


def cup(rng: np.random.Generator) -> p.Piece:
    """Return a mug with an ear towards -x."""
    color = solids.pick(rng, SPINES)
    body = p.lathe([(0, 0), (0.042, 0), (0.042, 0.095), (0.037, 0.095), (0.037, 0.006), (0, 0.006)], color)
    ear = [p.box((-0.072, -0.04), (-0.007, 0.007), (z, z + 0.012), color) for z in (0.02, 0.066)]
    return p.Piece("cup", p.join(body, *ear, p.box((-0.074, -0.062), (-0.007, 0.007), (0.02, 0.078), color)))


def trash_can() -> p.Piece:
    """Return an open waste bin."""
    profile = [(0.0, 0.0), (0.11, 0.0), (0.14, 0.32), (0.132, 0.32), (0.104, 0.008), (0.0, 0.008)]
    return p.Piece("trash can", p.lathe(profile, (60, 62, 66)))


def plant(rng: np.random.Generator, height: float) -> p.Piece:
    """Return a pot with a leafy plant of given height [m]."""
    size = 0.3 * height
    outside, low = [(0, 0), (0.35 * size, 0), (0.5 * size, size), (0.45 * size, size)], 0.9 * size
    leaves: list[p.Surface] = [
        p.cylinder(0.01 + 0.01 * height, 0.45 * height, (96, 76, 50)).moved(p.at(0, 0, size * 0.85))
    ]
    for i in range(26):
        length = height * rng.uniform(0.25, 0.42)
        green = (52 + int(rng.integers(30)), 118 + int(rng.integers(40)), 52)
        leaf = p.ellipsoid((length, 0.4 * length, 0.012), green, sides=8)
        pitch = rng.uniform(-1.2, 0.3)
        turn = p.rotation((0, 0, 2.4 * i)) @ p.rotation((0, pitch, 0)) @ p.at(0.45 * length, 0)
        leaves.append(leaf.moved(p.at(0, 0, size + height * rng.uniform(0.1, 0.42)) @ turn))
    return p.Piece("plant", p.join(p.lathe([*outside, (0.44 * size, low), (0, low)], (176, 96, 64)), *leaves))


def carton(size: tuple[float, float, float]) -> p.Piece:
    """Return a closed cardboard box with a strip of tape."""
    x, y, z = size[0] / 2, size[1] / 2, size[2]
    tape = p.box((-x, x), (-0.024, 0.024), (z, z + 0.001), (206, 186, 140))
    return p.Piece("box", p.join(p.box((-x, x), (-y, y), (0, z), (172, 132, 86), p.FABRIC), tape))


def picture(rng: np.random.Generator, width: float, height: float) -> p.Piece:
    """Return a framed picture with its back at x = 0; its lower edge is at z = 0."""
    frame = p.box((0, 0.02), (-width / 2, width / 2), (0, height), (60, 44, 30), p.WOOD)
    colors = rng.integers(60, 230, size=(12, 3))
    cells = []
    for i, (red, green, blue) in enumerate(colors.tolist()):
        y = -width / 2 + 0.04 + (i % 4) * (width - 0.08) / 4
        z = 0.04 + (i // 4) * (height - 0.08) / 3
        cell = ((y, y + (width - 0.08) / 4), (z, z + (height - 0.08) / 3))
        cells.append(p.box((0.015, 0.0215), *cell, (red, green, blue)))
    return p.Piece("picture", p.join(frame, *cells))


def whiteboard(width: float, height: float) -> p.Piece:
    """Return a whiteboard with a pen tray; its back is at x = 0."""
    panel = p.box((0, 0.018), (-width / 2, width / 2), (0, height), (244, 245, 246))
    rims = [p.box((0, 0.024), (y, y + 0.02), (0, height), STEEL) for y in (-width / 2, width / 2 - 0.02)]
    tray = p.box((0, 0.07), (-0.3, 0.3), (-0.015, 0.0), STEEL)
    return p.Piece("whiteboard", p.join(panel, *rims, tray))


def clock() -> p.Piece:
    """Return a round wall clock with its back at x = 0."""
    face = p.join(p.cylinder(0.15, 0.03, BLACK), p.cylinder(0.135, 0.032, WHITE))
    hands = p.join(
        p.box((-0.004, 0.1), (-0.004, 0.004), (0.032, 0.036), BLACK),
        p.box((-0.004, 0.004), (0.0, 0.07), (0.032, 0.036), BLACK),
    )
    return p.Piece("clock", p.join(face, hands).moved(p.rotation((0, np.pi / 2, 0))))


def heater(width: float) -> p.Piece:
    """Return a ribbed radiator 0.1 m deep and 0.55 m high; its back is at x = 0."""
    ribs = [
        p.box((0.03, 0.1), (y, y + 0.035), (0.12, 0.66), WHITE) for y in np.arange(-width / 2, width / 2 - 0.03, 0.05)
    ]
    return p.Piece("heater", p.join(p.box((0.045, 0.085), (-width / 2, width / 2), (0.14, 0.64), WHITE), *ribs))


def ceiling_lamp() -> p.Piece:
    """Return a flat square lamp that hangs below z = 0."""
    return p.Piece("ceiling lamp", p.box((-0.3, 0.3), (-0.3, 0.3), (-0.06, 0), (250, 248, 236)))


def bag(rng: np.random.Generator) -> p.Piece:
    """Return a backpack that stands on the floor."""
    cloth = solids.pick(rng, CLOTH)
    body = p.ellipsoid((0.24, 0.34, 0.5), cloth, p.FABRIC).moved(p.at(0, 0, 0.24))
    return p.Piece(
        "backpack", p.join(body, p.ellipsoid((0.12, 0.26, 0.24), cloth, p.FABRIC).moved(p.at(0.11, 0, 0.15)))
    )


def paper_stack(rng: np.random.Generator) -> p.Piece:
    """Return a pile of paper."""
    layers = [p.box((-0.105, 0.105), (-0.148, 0.148), (0.008 * i, 0.008 * (i + 1)), WHITE, p.PLAIN) for i in range(4)]
    return p.Piece("paper", p.join(*(layer.moved(p.at(0, 0, 0, rng.uniform(-8, 8))) for layer in layers)))


def cushion(size: tuple[float, float, float], color: p.Color, square: float = 5.0, flat: float = 2.4) -> p.Surface:
    """Return a stuffed cushion about the origin.

    Args:
        size: full extents [m].
        color: of the cloth.
        square: exponent of the outline seen from above; 2 is an ellipse, more is a rectangle with rounder or sharper corners.
        flat: exponent of its section; 2 is an ellipse, more is a slab.
    """
    ball = p.ellipsoid((2.0, 2.0, 2.0), color, p.FABRIC, sides=32)
    x, y, z = np.abs(ball.vertices).T
    norm = ((x**square + y**square) ** (flat / square) + z**flat) ** (1 / flat)
    return replace(ball, vertices=ball.vertices / norm[:, None] * np.array(size) / 2)


def pillow(size: tuple[float, float, float], color: p.Color) -> p.Piece:
    """Return a pillow that lies on z = 0; its size is along x, y, z [m]."""
    return p.Piece("pillow", cushion(size, color).moved(p.at(0, 0, size[2] / 2)))


def rug(length: float, width: float, color: p.Color, border: p.Color) -> p.Piece:
    """Return a rug 8 mm thick, long along y, with a border."""
    x, y, hem = width / 2, length / 2, 0.12
    inner = p.box((hem - x, x - hem), (hem - y, y - hem), (0, 0.008), color, p.FABRIC)
    sides = [p.box(span, (-y, y), (0, 0.008), border, p.FABRIC) for span in ((-x, hem - x), (x - hem, x))]
    ends = [p.box((hem - x, x - hem), span, (0, 0.008), border, p.FABRIC) for span in ((-y, hem - y), (y - hem, y))]
    return p.Piece("rug", p.join(inner, *sides, *ends))


def clothes(rng: np.random.Generator, count: int) -> p.Piece:
    """Return a pile of folded clothes, 0.26 m deep, 0.3 m wide and 4 cm high each."""
    layers = []
    for i in range(count):
        layer = cushion((0.26, 0.3, 0.042), solids.random_color(rng, 60, 220), 9.0, 4.0)
        layers.append(layer.moved(p.at(0, rng.uniform(-0.008, 0.008), 0.021 + 0.04 * i, rng.uniform(-3, 3))))
    return p.Piece("clothes", p.join(*layers))


OAK, SHADE = (170, 130, 88), (238, 226, 196)


def wall_shelf(width: float) -> p.Piece:
    """Return a board 0.22 m deep on two brackets; its back is at x = 0, its upper face at z = 0."""
    arms = [p.box((0, 0.18), (y - 0.01, y + 0.01), (-0.05, -0.025), STEEL) for y in (-0.35 * width, 0.35 * width)]
    return p.Piece("shelf", p.join(p.box((0, 0.22), (-width / 2, width / 2), (-0.025, 0), OAK, p.WOOD), *arms))


def pile(rng: np.random.Generator, count: int) -> list[p.Piece]:
    """Return books that lie on each other, the lowest on z = 0."""
    stack, z = [], 0.0
    for _ in range(count):
        piece, _ = book(rng, standing=False)
        stack.append(piece.moved(p.at(0, 0, z, rng.uniform(-12, 12))))
        z += float(np.ptp(piece.surface.vertices[:, 2])) + 0.0005
    return stack


def tv(diagonal: float) -> p.Piece:
    """Return a flat television on two feet; its diagonal is in metres."""
    width, height = 0.872 * diagonal + 0.02, 0.49 * diagonal + 0.03
    case = p.box((-0.035, 0.0), (-width / 2, width / 2), (0.06, 0.06 + height), BLACK)
    screen = p.box(
        (0.0, 0.002), (0.01 - width / 2, width / 2 - 0.01), (0.08, 0.05 + height), (22, 26, 36), dropout=0.25
    )
    feet = [p.box((-0.13, 0.1), (y - 0.012, y + 0.012), (0, 0.062), BLACK) for y in (-0.36 * width, 0.36 * width)]
    return p.Piece("tv", p.join(case, screen, *feet))


def mirror(width: float, height: float) -> p.Piece:
    """Return a framed mirror that hangs with its back at x = 0; a laser gets hardly anything back from it."""
    half, wood = width / 2, (120, 88, 56)
    sides = [p.box((0, 0.03), (y, y + 0.03), (0, height), wood, p.WOOD) for y in (-half, half - 0.03)]
    ends = [p.box((0, 0.03), (-half + 0.03, half - 0.03), (z, z + 0.03), wood, p.WOOD) for z in (0, height - 0.03)]
    glass = p.box((0.002, 0.016), (-half + 0.03, half - 0.03), (0.03, height - 0.03), (190, 204, 210), dropout=0.7)
    return p.Piece("mirror", p.join(*sides, *ends, glass))


def bowl(rng: np.random.Generator, fruit: bool = True) -> p.Piece:
    """Return a bowl 0.26 m across, with fruit in it."""
    profile = [(0, 0), (0.06, 0), (0.13, 0.08), (0.124, 0.08), (0.055, 0.008), (0, 0.008)]
    colors: tuple[p.Color, ...] = ((200, 60, 40), (226, 150, 40), (120, 160, 60))
    places = [p.at(0.045 * np.cos(2.1 * i), 0.045 * np.sin(2.1 * i), 0.055 + 0.002 * rng.uniform()) for i in range(3)]
    balls = [p.ellipsoid((0.075, 0.075, 0.075), colors[i]).moved(places[i]) for i in range(3)]
    return p.Piece("bowl", p.join(p.lathe(profile, (210, 206, 196)), *(balls if fruit else [])))


def candle(height: float) -> p.Piece:
    """Return a thick candle on a dish."""
    wax = p.cylinder(0.035, height, (236, 222, 190)).moved(p.at(0, 0, 0.01))
    wick = p.cylinder(0.002, 0.012, BLACK).moved(p.at(0, 0, height + 0.01))
    return p.Piece("candle", p.join(p.cylinder(0.06, 0.01, STEEL), wax, wick))


def alarm_clock() -> p.Piece:
    """Return an alarm clock with a dark face towards +x."""
    case = p.box((-0.05, 0), (-0.065, 0.065), (0, 0.08), (200, 60, 50))
    return p.Piece("alarm clock", p.join(case, p.box((0, 0.002), (-0.055, 0.055), (0.012, 0.068), (24, 30, 28))))


def photo(rng: np.random.Generator) -> p.Piece:
    """Return a framed photograph that leans on its strut."""
    image = solids.random_color(rng, 70, 220)
    paper = p.box((0, 0.0015), (-0.062, 0.062), (0.018, 0.202), image)
    frame = p.join(p.box((-0.012, 0), (-0.08, 0.08), (0, 0.22), OAK, p.WOOD), paper)
    strut = p.box((-0.06, -0.052), (-0.02, 0.02), (0, 0.16), BLACK).moved(p.rotation((0, 0.12, 0)) @ p.at(0, 0, 0.004))
    return p.Piece("picture", p.join(frame.moved(p.rotation((0, -0.2, 0)) @ p.at(0, 0, 0.003)), strut))


def floor_lamp() -> p.Piece:
    """Return a standing lamp 1.6 m high with a cylindrical shade."""
    shade = p.lathe([(0.19, 1.28), (0.15, 1.58), (0.144, 1.58), (0.184, 1.28), (0.19, 1.28)], SHADE, p.FABRIC)
    hub = p.join(
        *(p.box((-0.15, 0.15), (-0.003, 0.003), (1.55, 1.556), STEEL).moved(p.at(0, 0, 0, y)) for y in (0, 90))
    )
    return p.Piece("floor lamp", p.join(p.cylinder(0.14, 0.02, STEEL), p.cylinder(0.012, 1.56, STEEL), shade, hub))


def pendant_lamp(drop: float, radius: float = 0.22) -> p.Piece:
    """Return a lamp that hangs from the ceiling z = 0 on a cord of given length [m], with a paper globe."""
    globe = p.ellipsoid((2 * radius, 2 * radius, 1.7 * radius), SHADE, p.FABRIC, sides=20)
    globe = globe.moved(p.at(0, 0, -drop - 0.8 * radius))
    cord = p.cylinder(0.004, drop, WHITE).moved(p.at(0, 0, -drop))
    return p.Piece("ceiling lamp", p.join(p.cylinder(0.05, 0.025, WHITE).moved(p.at(0, 0, -0.025)), cord, globe))


def slippers(rng: np.random.Generator) -> p.Piece:
    """Return a pair of slippers, their toes towards +x."""
    color = solids.random_color(rng, 60, 180)
    shoes = []
    for y in (-0.06, 0.06):
        sole = p.ellipsoid((0.27, 0.1, 0.03), color, p.FABRIC).moved(p.at(0, y, 0.015, rng.uniform(-8, 8)))
        shoes += [sole, p.ellipsoid((0.13, 0.1, 0.09), color, p.FABRIC).moved(p.at(0.06, y, 0.045))]
    return p.Piece("shoes", p.join(*shoes))


def teddy() -> p.Piece:
    """Return a teddy bear that sits, 0.36 m high."""
    fur, light = (150, 104, 62), (206, 172, 126)
    sizes_places = [
        ((0.17, 0.2, 0.2), (0, 0, 0.1), fur),
        ((0.15, 0.16, 0.15), (0.01, 0, 0.255), fur),
        ((0.07, 0.08, 0.06), (0.075, 0, 0.24), light),
        *(((0.04, 0.07, 0.07), (0, y, 0.33), fur) for y in (-0.06, 0.06)),
        *(((0.16, 0.08, 0.08), (0.12, y, 0.045), fur) for y in (-0.07, 0.07)),
        *(((0.12, 0.06, 0.07), (0.05, y, 0.15), fur) for y in (-0.11, 0.11)),
    ]
    parts = [p.ellipsoid(size, color, p.FABRIC).moved(p.at(*place)) for size, place, color in sizes_places]
    return p.Piece("teddy bear", p.join(*parts))
