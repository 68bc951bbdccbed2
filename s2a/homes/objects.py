"""Things that stand, hang and lie about in an office. Local frames: standing on z = 0, front towards +x, metres."""

from __future__ import annotations

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
