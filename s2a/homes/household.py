"""Things of kitchens and bathrooms that stand and lie about. Local frames: standing on z = 0, front towards +x, metres."""

from itertools import pairwise

import numpy as np

from s2a.homes import solids as p
from s2a.homes.fronts import open_box
from s2a.homes.grips import STEEL

Point = tuple[float, float, float]
CHROME: p.Color = (186, 188, 192)


def pipe(points: list[Point], radius: float, color: p.Color = CHROME, sides: int = 12) -> p.Surface:
    """Return a round pipe along a line of points [m], with a ball at every bend."""
    solids = []
    for start, end in pairwise(points):
        along = np.subtract(end, start)
        length = float(np.linalg.norm(along))
        solids.append(
            p.cylinder(radius, length, color, sides=sides).moved(p.translation(start) @ _towards(along / length))
        )
    for x, y, z in points[1:-1]:
        solids.append(p.ellipsoid((2 * radius,) * 3, color, sides=sides).moved(p.at(x, y, z)))
    return p.join(*solids)


def _towards(direction: np.ndarray) -> np.ndarray:
    """Return a rotation that takes z to a unit direction, shape [4 4]."""
    across = np.cross((0.0, 0.0, 1.0), direction)
    sine = float(np.linalg.norm(across))
    if sine < 1e-9:
        return p.rotation((np.pi if direction[2] < 0 else 0.0, 0.0, 0.0))
    return p.rotation(across / sine * np.arctan2(sine, direction[2]))


def faucet(height: float, reach: float, name: str = "faucet") -> p.Piece:
    """Return a mixer tap on a base: a pipe that rises to a height, bends over and reaches forward [m], and its lever."""
    arch = [
        (reach / 2 - reach / 2 * float(np.cos(a)), 0.0, height - reach / 2 + reach / 2 * float(np.sin(a)))
        for a in np.linspace(0, np.pi, 7)
    ]
    spout = pipe([(0, 0, 0.03), *arch, (reach, 0, height - reach / 2 - 0.03)], 0.012)
    lever = pipe([(0, -0.02, 0.07), (0, -0.05, 0.075), (0.01, -0.115, 0.1)], 0.008)
    return p.Piece(name, p.join(p.cylinder(0.026, 0.09, CHROME), spout, lever))


def basin(size: tuple[float, float, float], color: p.Color = STEEL, rim: float = 0.02, lip: float = 0.004) -> p.Piece:
    """Return a sink to be let into a hole of its outer width: an open bowl whose rim lies on the counter at z = 0.

    Args:
        size: outer extents of the bowl along x, y and down [m].
        color: of everything.
        rim: how far the rim lies over the counter's edge [m].
        lip: how far it rises above the counter [m].
    """
    deep, wide, down = size
    x, y, wall = deep / 2, wide / 2, 0.006
    bowl = open_box((deep, wide, down + lip), wall, color).moved(p.at(0, 0, -down))
    around = counter((-y - rim, y + rim), (-x - rim, x + rim), (0, lip), (-x, x, -y, y), color, p.PLAIN)
    drain = p.cylinder(0.032, 0.004, (90, 92, 96)).moved(p.at(0, 0, wall - down))
    return p.Piece("sink", p.join(bowl, around.surface, drain))


def counter(
    y: tuple[float, float],
    x: tuple[float, float],
    z: tuple[float, float],
    hole: tuple[float, float, float, float],
    color: p.Color,
    texture: int,
    name: str = "kitchen counter",
) -> p.Piece:
    """Return a worktop along y as four boards around a hole (x from, x to, y from, y to) [m]: nothing closes the hole."""
    near, far, left, right = hole
    boards = [
        p.box(x, (y[0], left), z, color, texture),
        p.box(x, (right, y[1]), z, color, texture),
        p.box((x[0], near), (left, right), z, color, texture),
        p.box((far, x[1]), (left, right), z, color, texture),
    ]
    return p.Piece(name, p.join(*boards))


BLACK, WHITE = (40, 40, 44), (236, 234, 228)
BRIGHT: tuple[p.Color, ...] = ((60, 110, 160), (190, 70, 60), (230, 180, 70), (80, 140, 110), (150, 90, 140))


def pot(radius: float, height: float) -> p.Piece:
    """Return a cooking pot with two ears and a lid with a knob."""
    body = p.cylinder(radius, height, (150, 152, 158))
    cover = p.lathe([(0, 0), (radius + 0.003, 0), (radius + 0.003, 0.008), (0.3 * radius, 0.025), (0, 0.025)], CHROME)
    ears = [p.box((-0.03, 0.03), (y, y + 0.03), (0.7 * height, 0.78 * height), BLACK) for y in (radius, -radius - 0.03)]
    grip = p.cylinder(0.014, 0.02, BLACK).moved(p.at(0, 0, height + 0.025))
    return p.Piece("pot", p.join(body, cover.moved(p.at(0, 0, height)), *ears, grip))


def jar(rng: np.random.Generator) -> p.Piece:
    """Return a storage jar with a lid."""
    radius, height = rng.uniform(0.035, 0.055), rng.uniform(0.1, 0.18)
    body = p.cylinder(radius, height, p.pick(rng, BRIGHT))
    return p.Piece(
        "jar", p.join(body, p.cylinder(radius + 0.003, 0.02, (196, 170, 130), p.WOOD).moved(p.at(0, 0, height)))
    )


def bottle(rng: np.random.Generator, height: float, name: str = "bottle") -> p.Piece:
    """Return a bottle with a neck and a cap."""
    radius, color = 0.145 * height, p.pick(rng, BRIGHT)
    body = p.lathe(
        [(0, 0), (radius, 0), (radius, 0.62 * height), (0.4 * radius, 0.8 * height), (0, 0.8 * height)], color
    )
    neck = p.cylinder(0.4 * radius, 0.94 * height, color)
    return p.Piece(
        name, p.join(body, neck, p.cylinder(0.5 * radius, 0.08 * height, WHITE).moved(p.at(0, 0, 0.92 * height)))
    )


def bowl(radius: float, color: p.Color) -> p.Piece:
    """Return an open bowl."""
    height = 0.5 * radius
    outside = [(0, 0), (0.5 * radius, 0), (0.85 * radius, 0.5 * height), (radius, height)]
    inside = [(radius - 0.006, height), (0.83 * radius - 0.005, 0.5 * height), (0.48 * radius, 0.008), (0, 0.008)]
    return p.Piece("bowl", p.lathe(outside + inside, color))


def plate(radius: float) -> p.Piece:
    """Return a shallow plate."""
    profile = [(0, 0), (0.6 * radius, 0), (radius, 0.02), (radius, 0.024), (0.6 * radius, 0.006), (0, 0.006)]
    return p.Piece("plate", p.lathe(profile, WHITE))


def mat(rng: np.random.Generator, depth: float, width: float, name: str) -> p.Piece:
    """Return a thick mat on the floor, centred on the origin."""
    pile = p.box((-depth / 2, depth / 2), (-width / 2, width / 2), (0, 0.02), p.pick(rng, BRIGHT), p.FABRIC)
    return p.Piece(name, pile)


def hanging_towel(rng: np.random.Generator, width: float, length: float) -> p.Piece:
    """Return a towel folded over a rod along y through the origin, its longer half in front."""
    color = p.pick(rng, BRIGHT)
    y = (-width / 2, width / 2)
    folds = [
        p.box(
            (0.014 + 0.004 * (i % 2), 0.03 + 0.006 * (i % 2)),
            (y[0] + i * width / 6, y[0] + (i + 1) * width / 6),
            (-length, 0.012),
            color,
            p.FABRIC,
            p.PLAIN,
        )
        for i in range(6)
    ]
    top = p.box((-0.026, 0.03), y, (0.012, 0.028), color, p.FABRIC)
    return p.Piece("towel", p.join(*folds, top, p.box((-0.026, -0.014), y, (-0.6 * length, 0.012), color, p.FABRIC)))


def towel_rail(width: float) -> p.Piece:
    """Return a rod along y through the origin, 0.07 m from the wall, on two brackets."""
    half = width / 2
    return p.Piece("towel rail", pipe([(-0.07, -half, 0), (0, -half, 0), (0, half, 0), (-0.07, half, 0)], 0.01))


def towel_stack(rng: np.random.Generator, count: int) -> p.Piece:
    """Return a pile of folded towels."""
    folded = []
    for i in range(count):
        color = p.pick(rng, BRIGHT)
        x, y = 0.12 + rng.uniform(-0.008, 0.008), 0.15 + rng.uniform(-0.008, 0.008)
        folded.append(p.box((-x, x), (-y, y), (0.055 * i, 0.055 * (i + 1) - 0.004), color, p.FABRIC))
    return p.Piece("towel", p.join(*folded))


def stool() -> p.Piece:
    """Return a round wooden stool, 0.42 m high."""
    legs = [
        pipe([(x, y, 0), (0.7 * x, 0.7 * y, 0.4)], 0.014, (196, 160, 112)) for x in (-0.1, 0.1) for y in (-0.1, 0.1)
    ]
    seat = p.cylinder(0.15, 0.03, (196, 160, 112), p.WOOD).moved(p.at(0, 0, 0.39))
    return p.Piece("stool", p.join(*legs, seat))


def toothbrush_cup(rng: np.random.Generator) -> p.Piece:
    """Return a beaker with two toothbrushes."""
    beaker = p.lathe([(0, 0), (0.034, 0), (0.038, 0.1), (0.034, 0.1), (0.03, 0.006), (0, 0.006)], (206, 222, 224))
    brushes = []
    for tilt in (0.25, -0.2):
        color = p.pick(rng, BRIGHT)
        stick = p.box((-0.004, 0.004), (-0.005, 0.005), (0, 0.19), color)
        head = p.box((0.004, 0.014), (-0.006, 0.006), (0.16, 0.19), WHITE)
        brushes.append(p.join(stick, head).moved(p.at(-0.1 * tilt, 0, 0.012) @ p.rotation((0, tilt, 0))))
    return p.Piece("cup", p.join(beaker, *brushes))


def tissue_box(rng: np.random.Generator) -> p.Piece:
    """Return a box of tissues with one drawn out."""
    carton = p.box((-0.06, 0.06), (-0.115, 0.115), (0, 0.08), p.pick(rng, BRIGHT))
    tissue = p.lathe([(0.045, 0.08), (0.01, 0.13), (0, 0.08)], WHITE, p.FABRIC, sides=7, squeeze=1.5)
    return p.Piece("tissue box", p.join(carton, tissue))
