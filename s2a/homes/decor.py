"""Things that stand, hang and lie about in bedrooms and living rooms. Local frames: on z = 0, front towards +x, metres."""

from __future__ import annotations

import numpy as np

from s2a.homes import objects
from s2a.homes.objects import BLACK, SPINES, STEEL, WHITE
from s2a.homes.solids import FABRIC, WOOD, Color, Piece, at, box, cylinder, ellipsoid, join, lathe, rotation

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
        piece, _ = objects.book(rng, standing=False)
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
