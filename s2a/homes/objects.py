"""Things that stand, hang and lie about in living rooms, bedrooms, offices. Local frames: on z = 0, front towards +x, metres."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from s2a.homes.solids import (
    FABRIC,
    PLAIN,
    WOOD,
    Color,
    Piece,
    Surface,
    at,
    box,
    cylinder,
    ellipsoid,
    join,
    lathe,
    painted,
    rotation,
)

BLACK, GREY, STEEL, WHITE = (38, 38, 42), (120, 122, 126), (168, 170, 174), (235, 235, 232)
CLOTH: tuple[Color, ...] = ((52, 74, 110), (120, 44, 48), (64, 96, 72), (90, 90, 96))
SPINES: tuple[Color, ...] = (
    (150, 40, 40),
    (36, 70, 120),
    (40, 100, 70),
    (200, 160, 60),
    (90, 60, 110),
    (220, 214, 200),
)


def office_chair(rng: np.random.Generator) -> Piece:
    """Return a swivel chair on a five-armed base, its back rest towards -x."""
    cloth = CLOTH[rng.integers(len(CLOTH))]
    arms = [box((0.03, 0.3), (-0.02, 0.02), (0.06, 0.1), BLACK).moved(at(0, 0, 0, 72 * i)) for i in range(5)]
    wheels = [ellipsoid((0.06, 0.04, 0.06), BLACK).moved(at(0, 0, 0, 72 * i) @ at(0.29, 0, 0.03)) for i in range(5)]
    column = cylinder(0.03, 0.36, BLACK).moved(at(0, 0, 0.06))
    seat = box((-0.23, 0.25), (-0.24, 0.24), (0.42, 0.5), cloth, FABRIC)
    back = box((-0.04, 0.04), (-0.22, 0.22), (0.12, 0.62), cloth, FABRIC).moved(
        at(-0.24, 0, 0.46) @ rotation((0, -0.15, 0))
    )
    spine = box((-0.3, -0.2), (-0.03, 0.03), (0.42, 0.75), BLACK)
    return Piece("office chair", join(*arms, *wheels, column, seat, back, spine))


def chair() -> Piece:
    """Return a wooden four-legged chair, its back rest towards -x."""
    wood = (150, 104, 62)
    legs = [box((x, x + 0.035), (y, y + 0.035), (0, 0.44), wood, WOOD) for x in (-0.21, 0.17) for y in (-0.2, 0.165)]
    posts = [box((-0.21, -0.175), (y, y + 0.035), (0.44, 0.88), wood, WOOD) for y in (-0.2, 0.165)]
    slats = [box((-0.205, -0.18), (-0.17, 0.17), (z, z + 0.07), wood, WOOD) for z in (0.58, 0.7, 0.81)]
    return Piece("chair", join(box((-0.22, 0.22), (-0.21, 0.21), (0.44, 0.465), wood, WOOD), *legs, *posts, *slats))


def book(rng: np.random.Generator, standing: bool = True) -> tuple[Piece, float]:
    """Return a book and how much width it takes along y [m]: upright with its spine at x = 0, or lying."""
    thick, tall, deep = rng.uniform(0.018, 0.05), rng.uniform(0.19, 0.27), rng.uniform(0.13, 0.19)
    color = SPINES[rng.integers(len(SPINES))]
    cover = box((-deep, 0), (-thick / 2, thick / 2), (0, tall), color)
    pages = box(
        (-deep - 0.001, -0.004), (-thick / 2 + 0.003, thick / 2 - 0.003), (0.003, tall + 0.001), (238, 232, 214)
    )
    shape = join(cover, pages)
    if not standing:
        shape = shape.moved(at(deep / 2, -tall / 2, thick / 2) @ rotation((-np.pi / 2, 0, 0)))
    return Piece("book", shape), thick if standing else tall


def monitor() -> Piece:
    """Return a 27-inch monitor on a foot, its dark screen towards +x."""
    foot = box((-0.11, 0.09), (-0.13, 0.13), (0, 0.012), BLACK)
    neck = box((-0.06, -0.035), (-0.03, 0.03), (0.012, 0.3), BLACK)
    case = box((-0.035, 0.0), (-0.31, 0.31), (0.13, 0.49), BLACK)
    screen = box((0.0, 0.002), (-0.3, 0.3), (0.14, 0.48), (24, 28, 40), dropout=0.25)
    return Piece("monitor", join(foot, neck, case, screen))


def keyboard() -> Piece:
    """Return a keyboard, long along y."""
    rows = [box((x, x + 0.017), (-0.2, 0.2), (0.018, 0.024), (70, 70, 76)) for x in np.arange(-0.06, 0.05, 0.021)]
    return Piece("keyboard", join(box((-0.07, 0.07), (-0.22, 0.22), (0, 0.018), BLACK), *rows))


def mouse() -> Piece:
    """Return a computer mouse."""
    return Piece("mouse", ellipsoid((0.11, 0.062, 0.07), BLACK).moved(at(0, 0, 0.004)))


def cup(rng: np.random.Generator) -> Piece:
    """Return a mug with an ear towards -x."""
    color = SPINES[rng.integers(len(SPINES))]
    body = lathe([(0, 0), (0.042, 0), (0.042, 0.095), (0.037, 0.095), (0.037, 0.006), (0, 0.006)], color)
    ear = [box((-0.072, -0.04), (-0.007, 0.007), (z, z + 0.012), color) for z in (0.02, 0.066)]
    return Piece("cup", join(body, *ear, box((-0.074, -0.062), (-0.007, 0.007), (0.02, 0.078), color)))


def table_lamp() -> Piece:
    """Return a desk lamp with a cone-shaped shade."""
    shade = lathe([(0.11, 0.3), (0.06, 0.44), (0.05, 0.44), (0.1, 0.3), (0.11, 0.3)], (236, 214, 160))
    return Piece(
        "table lamp", join(cylinder(0.08, 0.02, STEEL), cylinder(0.009, 0.42, STEEL).moved(at(0, 0, 0.02)), shade)
    )


def trash_can() -> Piece:
    """Return an open waste bin."""
    profile = [(0.0, 0.0), (0.11, 0.0), (0.14, 0.32), (0.132, 0.32), (0.104, 0.008), (0.0, 0.008)]
    return Piece("trash can", lathe(profile, (60, 62, 66)))


def plant(rng: np.random.Generator, height: float) -> Piece:
    """Return a pot with a leafy plant of given height [m]."""
    size = 0.3 * height
    profile = [
        (0, 0),
        (0.35 * size, 0),
        (0.5 * size, size),
        (0.45 * size, size),
        (0.44 * size, 0.9 * size),
        (0, 0.9 * size),
    ]
    leaves: list[Surface] = [cylinder(0.01 + 0.01 * height, 0.45 * height, (96, 76, 50)).moved(at(0, 0, size * 0.85))]
    for i in range(26):
        length = height * rng.uniform(0.25, 0.42)
        leaf = ellipsoid(
            (length, 0.4 * length, 0.012), (52 + int(rng.integers(30)), 118 + int(rng.integers(40)), 52), sides=8
        )
        pitch = rng.uniform(-1.2, 0.3)
        turn = rotation((0, 0, 2.4 * i)) @ rotation((0, pitch, 0)) @ at(0.45 * length, 0)
        leaves.append(leaf.moved(at(0, 0, size + height * rng.uniform(0.1, 0.42)) @ turn))
    return Piece("plant", join(lathe(profile, (176, 96, 64)), *leaves))


def carton(size: tuple[float, float, float]) -> Piece:
    """Return a closed cardboard box with a strip of tape."""
    x, y, z = size[0] / 2, size[1] / 2, size[2]
    tape = box((-x, x), (-0.024, 0.024), (z, z + 0.001), (206, 186, 140))
    return Piece("box", join(box((-x, x), (-y, y), (0, z), (172, 132, 86), FABRIC), tape))


def picture(rng: np.random.Generator, width: float, height: float) -> Piece:
    """Return a framed picture with its back at x = 0; its lower edge is at z = 0."""
    frame = box((0, 0.02), (-width / 2, width / 2), (0, height), (60, 44, 30), WOOD)
    colors = rng.integers(60, 230, size=(12, 3))
    cells = []
    for i, (red, green, blue) in enumerate(colors.tolist()):
        y = -width / 2 + 0.04 + (i % 4) * (width - 0.08) / 4
        z = 0.04 + (i // 4) * (height - 0.08) / 3
        cell = ((y, y + (width - 0.08) / 4), (z, z + (height - 0.08) / 3))
        cells.append(box((0.015, 0.0215), *cell, (red, green, blue)))
    return Piece("picture", join(frame, *cells))


def whiteboard(width: float, height: float) -> Piece:
    """Return a whiteboard with a pen tray; its back is at x = 0."""
    panel = box((0, 0.018), (-width / 2, width / 2), (0, height), (244, 245, 246))
    rims = [box((0, 0.024), (y, y + 0.02), (0, height), STEEL) for y in (-width / 2, width / 2 - 0.02)]
    tray = box((0, 0.07), (-0.3, 0.3), (-0.015, 0.0), STEEL)
    return Piece("whiteboard", join(panel, *rims, tray))


def clock() -> Piece:
    """Return a round wall clock with its back at x = 0."""
    face = join(cylinder(0.15, 0.03, BLACK), cylinder(0.135, 0.032, WHITE))
    hands = join(
        box((-0.004, 0.1), (-0.004, 0.004), (0.032, 0.036), BLACK),
        box((-0.004, 0.004), (0.0, 0.07), (0.032, 0.036), BLACK),
    )
    return Piece("clock", join(face, hands).moved(rotation((0, np.pi / 2, 0))))


def heater(width: float) -> Piece:
    """Return a ribbed radiator 0.1 m deep and 0.55 m high; its back is at x = 0."""
    ribs = [
        box((0.03, 0.1), (y, y + 0.035), (0.12, 0.66), WHITE) for y in np.arange(-width / 2, width / 2 - 0.03, 0.05)
    ]
    return Piece("heater", join(box((0.045, 0.085), (-width / 2, width / 2), (0.14, 0.64), WHITE), *ribs))


def ceiling_lamp() -> Piece:
    """Return a flat square lamp that hangs below z = 0."""
    return Piece("ceiling lamp", box((-0.3, 0.3), (-0.3, 0.3), (-0.06, 0), (250, 248, 236)))


def bag(rng: np.random.Generator) -> Piece:
    """Return a backpack that stands on the floor."""
    cloth = CLOTH[rng.integers(len(CLOTH))]
    body = ellipsoid((0.24, 0.34, 0.5), cloth, FABRIC).moved(at(0, 0, 0.24))
    return Piece("backpack", join(body, ellipsoid((0.12, 0.26, 0.24), cloth, FABRIC).moved(at(0.11, 0, 0.15))))


def paper_stack(rng: np.random.Generator) -> Piece:
    """Return a pile of paper."""
    sheets = [
        box((-0.105, 0.105), (-0.148, 0.148), (0.008 * i, 0.008 * (i + 1)), WHITE, PLAIN).moved(
            at(0, 0, 0, rng.uniform(-8, 8))
        )
        for i in range(4)
    ]
    return Piece("paper", join(*sheets))


def cushion(size: tuple[float, float, float], color: Color, square: float = 5.0, flat: float = 2.4) -> Surface:
    """Return a stuffed cushion about the origin.

    Args:
        size: full extents [m].
        color: of the cloth.
        square: exponent of the outline seen from above; 2 is an ellipse, more is a rectangle with rounder or sharper corners.
        flat: exponent of its section; 2 is an ellipse, more is a slab.
    """
    ball = ellipsoid((2.0, 2.0, 2.0), color, FABRIC, sides=32)
    x, y, z = np.abs(ball.vertices).T
    norm = ((x**square + y**square) ** (flat / square) + z**flat) ** (1 / flat)
    return replace(ball, vertices=ball.vertices / norm[:, None] * np.array(size) / 2)


def sheet(points: np.ndarray, thickness: float, color: Color) -> Surface:
    """Return a thick cloth whose outer side runs through a grid of points.

    Args:
        points: [m], shape [row column 3]; the outer side is the one from which rows, then columns turn counter-clockwise.
        thickness: how far the inner side lies behind [m].
        color: of the cloth.
    """
    rows, columns = points.shape[:2]
    normal = np.cross(np.gradient(points, axis=0), np.gradient(points, axis=1))
    inner = points - thickness * normal / np.linalg.norm(normal, axis=2, keepdims=True)
    index, count = np.arange(rows * columns).reshape(rows, columns), rows * columns
    a, b, c, d = (i.ravel() for i in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    outer = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    rim = np.concatenate([index[:, 0], index[-1, 1:], index[-2::-1, -1], index[0, -2::-1]])
    here, after = rim[:-1], rim[1:]
    hem = [np.stack([here, here + count, after + count], axis=1), np.stack([here, after + count, after], axis=1)]
    faces = np.concatenate([outer, outer[:, ::-1] + count, *hem])
    return painted(np.concatenate([points.reshape(-1, 3), inner.reshape(-1, 3)]), faces, color, FABRIC)


def pillow(size: tuple[float, float, float], color: Color) -> Piece:
    """Return a pillow that lies on z = 0; its size is along x, y, z [m]."""
    return Piece("pillow", cushion(size, color).moved(at(0, 0, size[2] / 2)))


def drape(
    rng: np.random.Generator, length: float, width: float, fall: float, color: Color, thickness: float = 0.03
) -> Surface:
    """Return a cloth that lies on z = 0 along x and falls over both sides, with soft folds.

    Args:
        rng: where the folds are.
        length: along x, from x = 0 [m].
        width: of what it lies on, along y [m].
        fall: how far each side hangs down [m].
        color: of the cloth.
        thickness: of the cloth, which lies outside of what it covers [m].
    """
    half, phase = width / 2 + thickness + 0.004, rng.uniform(0, 2 * np.pi, 3)
    x, s = np.meshgrid(np.linspace(0, length, 33), np.linspace(-half - fall, half + fall, 49), indexing="ij")
    hanging = np.clip(np.abs(s) - half, 0, None)
    folds = 0.012 * (1 + np.sin(9 * x + phase[0] + np.sign(s))) * hanging / fall
    swell = 0.004 * (1 + np.sin(4 * x + phase[1]) * np.sin(5 * s + phase[2])) * (hanging == 0)
    y = np.sign(s) * (np.minimum(np.abs(s), half) + folds)
    return sheet(np.stack([x, y, thickness + 0.002 + swell - hanging], axis=-1), thickness, color)


def rug(length: float, width: float, color: Color, border: Color) -> Piece:
    """Return a rug 8 mm thick, long along y, with a border."""
    x, y, hem = width / 2, length / 2, 0.12
    inner = box((hem - x, x - hem), (hem - y, y - hem), (0, 0.008), color, FABRIC)
    sides = [box(span, (-y, y), (0, 0.008), border, FABRIC) for span in ((-x, hem - x), (x - hem, x))]
    ends = [box((hem - x, x - hem), span, (0, 0.008), border, FABRIC) for span in ((-y, hem - y), (y - hem, y))]
    return Piece("rug", join(inner, *sides, *ends))


def clothes(rng: np.random.Generator, count: int) -> Piece:
    """Return a pile of folded clothes, 0.26 m deep, 0.3 m wide and 4 cm high each."""
    layers = []
    for i in range(count):
        red, green, blue = rng.integers(60, 220, 3).tolist()
        layer = cushion((0.26, 0.3, 0.042), (red, green, blue), 9.0, 4.0)
        layers.append(layer.moved(at(0, rng.uniform(-0.008, 0.008), 0.021 + 0.04 * i, rng.uniform(-3, 3))))
    return Piece("clothes", join(*layers))


BED_OAK, SHEET = (176, 138, 96), (232, 230, 226)
BED_TOP = 0.5
"""Height of a mattress' upper face [m]."""


def bed(width: float, length: float, cloth: Color) -> Piece:
    """Return a bed with an upholstered headboard at x = 0 and its foot towards +x; the frame is 60 mm wider than its mattress.

    Args:
        width: of the mattress, along y [m].
        length: of the mattress, along x [m].
        cloth: colour of the headboard.
    """
    half, foot = width / 2 + 0.03, 0.06 + length + 0.03
    legs = _legs((0.08, foot - 0.08), half - 0.07, 0.16)
    rails = [box((0.06, foot), (y, y + 0.025), (0.16, 0.36), BED_OAK, WOOD) for y in (-half, half - 0.025)]
    ends = [
        box((x, x + 0.025), (-half + 0.025, half - 0.025), (0.16, 0.36), BED_OAK, WOOD) for x in (0.06, foot - 0.025)
    ]
    slats = box((0.085, foot - 0.025), (-half + 0.025, half - 0.025), (0.22, 0.25), BED_OAK, WOOD)
    mattress = cushion((length, width, BED_TOP - 0.25), SHEET, 24.0, 9.0)
    head = [
        cushion((0.06, (2 * half - 0.02) / 3, 0.62), cloth, 6.0, 6.0).moved(at(0.065, y, 0.76))
        for y in np.linspace(-1, 1, 3) * (2 * half) / 3
    ]
    board = box((0, 0.06), (-half, half), (0.05, 1.08), cloth, FABRIC)
    middle = at(0.075 + length / 2, 0, (BED_TOP + 0.25) / 2)
    return Piece("bed", join(board, *head, *legs, *rails, *ends, slats, mattress.moved(middle)))


def duvet(rng: np.random.Generator, width: float, length: float, color: Color) -> Piece:
    """Return a blanket over the lower three quarters of a bed, in the bed's frame; see `bed`."""
    cloth = drape(rng, 0.68 * length, width, 0.2, color, 0.035)
    return Piece("blanket", cloth.moved(at(0.06 + 0.31 * length, 0, BED_TOP)))


def sofa(width: float, seats: int, cloth: Color, name: str = "sofa") -> Piece:
    """Return a sofa 0.9 m deep and 0.82 m high with a cushion to sit on and one to lean on for each seat.

    Its back is at x = -0.9; the seats are 0.44 m high, the arms 0.6 m high and 0.18 m wide.
    """
    half, arm = width / 2, 0.18
    base = box((-0.88, -0.02), (-half + arm, half - arm), (0.12, 0.28), cloth, FABRIC)
    rest = box((-0.9, -0.72), (-half + arm, half - arm), (0.12, 0.74), cloth, FABRIC)
    arms = [
        cushion((0.9, arm, 0.48), cloth, 14.0, 10.0).moved(at(-0.45, side * (half - arm / 2), 0.36)) for side in (-1, 1)
    ]
    each = (width - 2 * arm) / seats
    middles = [-half + arm + each * (i + 0.5) for i in range(seats)]
    seat = cushion((0.74, each - 0.006, 0.17), cloth, 14.0, 4.0)
    lean = cushion((0.2, each - 0.012, 0.44), cloth, 8.0, 6.0).moved(rotation((0, -0.2, 0)))
    soft = [part for y in middles for part in (seat.moved(at(-0.36, y, 0.36)), lean.moved(at(-0.63, y, 0.62)))]
    return Piece(name, join(base, rest, *arms, *soft, *_legs((-0.84, -0.08), half - 0.09, 0.12)))


def armchair(cloth: Color) -> Piece:
    """Return an armchair, 0.95 m wide and 0.9 m deep; its back is at x = -0.9."""
    return sofa(0.95, 1, cloth, "armchair")


def _legs(x: tuple[float, float], y: float, height: float) -> list[Surface]:
    """Return four square legs 5 cm thick about +-y at two depths [m]."""
    return [box((a - 0.025, a + 0.025), (b - 0.025, b + 0.025), (0, height), BED_OAK, WOOD) for a in x for b in (-y, y)]


OAK, SHADE = (170, 130, 88), (238, 226, 196)
LYING = rotation((0, np.pi / 2, 0))
"""Turns what stands on z = 0 so that it sticks out of the plane x = 0."""


def coffee_table(width: float, depth: float) -> Piece:
    """Return a low table, 0.42 m high, with a shelf under its top."""
    x, y = depth / 2, width / 2
    legs = [box((a, a + 0.05), (b, b + 0.05), (0, 0.39), OAK, WOOD) for a in (-x, x - 0.05) for b in (-y, y - 0.05)]
    shelf = box((-x + 0.02, x - 0.02), (-y + 0.02, y - 0.02), (0.14, 0.16), OAK, WOOD)
    return Piece("coffee table", join(*legs, shelf, box((-x, x), (-y, y), (0.39, 0.42), OAK, WOOD)))


def wall_shelf(width: float) -> Piece:
    """Return a board 0.22 m deep on two brackets; its back is at x = 0, its upper face at z = 0."""
    arms = [box((0, 0.18), (y - 0.01, y + 0.01), (-0.05, -0.025), STEEL) for y in (-0.35 * width, 0.35 * width)]
    return Piece("shelf", join(box((0, 0.22), (-width / 2, width / 2), (-0.025, 0), OAK, WOOD), *arms))


def pile(rng: np.random.Generator, count: int) -> list[Piece]:
    """Return books that lie on each other, the lowest on z = 0."""
    stack, z = [], 0.0
    for _ in range(count):
        piece, _ = book(rng, standing=False)
        stack.append(piece.moved(at(0, 0, z, rng.uniform(-12, 12))))
        z += float(np.ptp(piece.surface.vertices[:, 2])) + 0.0005
    return stack


def tv(diagonal: float) -> Piece:
    """Return a flat television on two feet; its diagonal is in metres."""
    width, height = 0.872 * diagonal + 0.02, 0.49 * diagonal + 0.03
    case = box((-0.035, 0.0), (-width / 2, width / 2), (0.06, 0.06 + height), BLACK)
    screen = box((0.0, 0.002), (0.01 - width / 2, width / 2 - 0.01), (0.08, 0.05 + height), (22, 26, 36), dropout=0.25)
    feet = [box((-0.13, 0.1), (y - 0.012, y + 0.012), (0, 0.062), BLACK) for y in (-0.36 * width, 0.36 * width)]
    return Piece("tv", join(case, screen, *feet))


def speaker(width: float, height: float) -> Piece:
    """Return a loudspeaker box, 1.3 times as deep as wide, with two round membranes; its front is at x = 0."""
    case = box((-1.3 * width, 0), (-width / 2, width / 2), (0, height), (64, 50, 42), WOOD)
    disks = [
        cylinder(r * width, 0.006, BLACK).moved(at(0, 0, z) @ LYING)
        for r, z in ((0.38, height - 0.65 * width), (0.2, height - 0.2 * width))
    ]
    return Piece("speaker", join(case, *disks))


def console(rng: np.random.Generator) -> Piece:
    """Return a game console or receiver, 0.3 m wide."""
    tone = int(rng.integers(30, 70))
    case = box((-0.24, 0), (-0.15, 0.15), (0.006, 0.06), (tone, tone, tone + 4))
    feet = box((-0.2, -0.04), (-0.12, 0.12), (0, 0.006), BLACK)
    return Piece("game console", join(case, feet, box((0, 0.002), (-0.12, 0.0), (0.03, 0.036), STEEL)))


def remote_control() -> Piece:
    """Return a remote control, long along x."""
    keys = [
        box((x, x + 0.008), (y - 0.004, y + 0.004), (0.016, 0.019), (150, 150, 154))
        for x in np.arange(-0.06, 0.06, 0.02)
        for y in (-0.01, 0.01)
    ]
    return Piece("remote control", join(box((-0.09, 0.09), (-0.022, 0.022), (0, 0.016), BLACK), *keys))


def mirror(width: float, height: float) -> Piece:
    """Return a framed mirror that hangs with its back at x = 0; a laser gets hardly anything back from it."""
    half, wood = width / 2, (120, 88, 56)
    sides = [box((0, 0.03), (y, y + 0.03), (0, height), wood, WOOD) for y in (-half, half - 0.03)]
    ends = [box((0, 0.03), (-half + 0.03, half - 0.03), (z, z + 0.03), wood, WOOD) for z in (0, height - 0.03)]
    glass = box((0.002, 0.016), (-half + 0.03, half - 0.03), (0.03, height - 0.03), (190, 204, 210), dropout=0.7)
    return Piece("mirror", join(*sides, *ends, glass))


def vase(rng: np.random.Generator, height: float) -> Piece:
    """Return a vase with a few dry twigs."""
    r, color = 0.28 * height, SPINES[rng.integers(len(SPINES))]
    profile = [
        (0, 0),
        (0.5 * r, 0),
        (r, 0.4),
        (0.35 * r, 0.85),
        (0.5 * r, 1.0),
        (0.4 * r, 1.0),
        (0.2 * r, 0.8),
        (0, 0.8),
    ]
    body = lathe([(radius, z * height) for radius, z in profile], color)
    twigs = [
        cylinder(0.004, 0.9 * height, (132, 100, 66), sides=8).moved(
            at(0, 0, 0.8 * height, 72 * i) @ rotation((0, rng.uniform(0.1, 0.4), 0))
        )
        for i in range(5)
    ]
    return Piece("vase", join(body, *twigs))


def bowl(rng: np.random.Generator, fruit: bool = True) -> Piece:
    """Return a bowl 0.26 m across, with fruit in it."""
    profile = [(0, 0), (0.06, 0), (0.13, 0.08), (0.124, 0.08), (0.055, 0.008), (0, 0.008)]
    colors: tuple[Color, ...] = ((200, 60, 40), (226, 150, 40), (120, 160, 60))
    balls = [
        ellipsoid((0.075, 0.075, 0.075), colors[i % 3]).moved(
            at(0.045 * np.cos(2.1 * i), 0.045 * np.sin(2.1 * i), 0.055 + 0.002 * rng.uniform())
        )
        for i in range(3)
    ]
    return Piece("bowl", join(lathe(profile, (210, 206, 196)), *(balls if fruit else [])))


def candle(height: float) -> Piece:
    """Return a thick candle on a dish."""
    wax = cylinder(0.035, height, (236, 222, 190)).moved(at(0, 0, 0.01))
    return Piece(
        "candle", join(cylinder(0.06, 0.01, STEEL), wax, cylinder(0.002, 0.012, BLACK).moved(at(0, 0, height + 0.01)))
    )


def alarm_clock() -> Piece:
    """Return an alarm clock with a dark face towards +x."""
    case = box((-0.05, 0), (-0.065, 0.065), (0, 0.08), (200, 60, 50))
    return Piece("alarm clock", join(case, box((0, 0.002), (-0.055, 0.055), (0.012, 0.068), (24, 30, 28))))


def photo(rng: np.random.Generator) -> Piece:
    """Return a framed photograph that leans on its strut."""
    red, green, blue = rng.integers(70, 220, 3).tolist()
    frame = join(
        box((-0.012, 0), (-0.08, 0.08), (0, 0.22), OAK, WOOD),
        box((0, 0.0015), (-0.062, 0.062), (0.018, 0.202), (red, green, blue)),
    )
    strut = box((-0.06, -0.052), (-0.02, 0.02), (0, 0.16), BLACK).moved(rotation((0, 0.12, 0)) @ at(0, 0, 0.004))
    return Piece("picture", join(frame.moved(rotation((0, -0.2, 0)) @ at(0, 0, 0.003)), strut))


def floor_lamp() -> Piece:
    """Return a standing lamp 1.6 m high with a cylindrical shade."""
    shade = lathe([(0.19, 1.28), (0.15, 1.58), (0.144, 1.58), (0.184, 1.28), (0.19, 1.28)], SHADE, FABRIC)
    hub = join(*(box((-0.15, 0.15), (-0.003, 0.003), (1.55, 1.556), STEEL).moved(at(0, 0, 0, y)) for y in (0, 90)))
    return Piece("floor lamp", join(cylinder(0.14, 0.02, STEEL), cylinder(0.012, 1.56, STEEL), shade, hub))


def pendant_lamp(drop: float, radius: float = 0.22) -> Piece:
    """Return a lamp that hangs from the ceiling z = 0 on a cord of given length [m], with a paper globe."""
    globe = ellipsoid((2 * radius, 2 * radius, 1.7 * radius), SHADE, FABRIC, sides=20).moved(
        at(0, 0, -drop - 0.8 * radius)
    )
    cord = cylinder(0.004, drop, WHITE).moved(at(0, 0, -drop))
    return Piece("ceiling lamp", join(cylinder(0.05, 0.025, WHITE).moved(at(0, 0, -0.025)), cord, globe))


def basket(radius: float, height: float) -> Piece:
    """Return an open wicker basket."""
    profile = [
        (0, 0),
        (0.8 * radius, 0),
        (radius, height),
        (radius - 0.012, height),
        (0.8 * radius - 0.01, 0.01),
        (0, 0.01),
    ]
    return Piece("laundry basket", lathe(profile, (176, 144, 98), FABRIC))


def slippers(rng: np.random.Generator) -> Piece:
    """Return a pair of slippers, their toes towards +x."""
    red, green, blue = rng.integers(60, 180, 3).tolist()
    color = (red, green, blue)
    shoes = []
    for y in (-0.06, 0.06):
        sole = ellipsoid((0.27, 0.1, 0.03), color, FABRIC).moved(at(0, y, 0.015, rng.uniform(-8, 8)))
        shoes += [sole, ellipsoid((0.13, 0.1, 0.09), color, FABRIC).moved(at(0.06, y, 0.045))]
    return Piece("shoes", join(*shoes))


def teddy() -> Piece:
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
    return Piece(
        "teddy bear", join(*(ellipsoid(size, color, FABRIC).moved(at(*place)) for size, place, color in sizes_places))
    )
