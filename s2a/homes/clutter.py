"""Things on and in furniture: themes of objects, and how they are spread over a board without touching."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from s2a.homes import household, objects
from s2a.homes.objects import SPINES
from s2a.homes.solids import FABRIC, WOOD, Piece, at, box, cylinder, integer, join, lathe, pick, random_color

Maker = Callable[[np.random.Generator], Piece]
MARGIN = 0.008  # Between two objects, and between an object and a wall [m]


@dataclass(frozen=True)
class Board:
    """A level rectangle on which things can stand, in the frame of its furniture."""

    x: tuple[float, float]  # from back to front [m]
    y: tuple[float, float]  # from side to side [m]
    z: float  # of its upper face [m]
    headroom: float  # how high a thing on it may be [m]


def carton(rng: np.random.Generator) -> Piece:
    """Return a small cardboard box."""
    return objects.carton((rng.uniform(0.1, 0.26), rng.uniform(0.12, 0.34), rng.uniform(0.06, 0.24)))


def notebook(rng: np.random.Generator) -> Piece:
    """Return a notebook or folder that lies."""
    x, y = rng.uniform(0.07, 0.11), rng.uniform(0.09, 0.155)
    return Piece("notebook", box((-x, x), (-y, y), (0, rng.uniform(0.008, 0.03)), random_color(rng, 50, 225)))


def case(rng: np.random.Generator) -> Piece:
    """Return a small plastic case."""
    x, y = rng.uniform(0.03, 0.08), rng.uniform(0.04, 0.11)
    return Piece("box", box((-x, x), (-y, y), (0, rng.uniform(0.025, 0.07)), random_color(rng, 50, 225)))


def can(rng: np.random.Generator) -> Piece:
    """Return a tin can or paint pot."""
    radius = rng.uniform(0.03, 0.08)
    return Piece("can", cylinder(radius, rng.uniform(0.9, 2.4) * radius, random_color(rng, 50, 225)))


def cutlery(rng: np.random.Generator) -> Piece:
    """Return a tray with cutlery."""
    tools = [
        box((-0.1, 0.09 + rng.uniform(0, 0.02)), (y, y + 0.012), (0.006, 0.011), (176, 178, 182))
        for y in (-0.06, -0.03, 0.0, 0.03, 0.055)
    ]
    return Piece("cutlery", join(box((-0.12, 0.12), (-0.08, 0.08), (0, 0.006), (60, 60, 64)), *tools))


def tool_box(rng: np.random.Generator) -> Piece:
    """Return a tool box with a grip."""
    x, y, z = rng.uniform(0.09, 0.12), rng.uniform(0.17, 0.26), rng.uniform(0.12, 0.2)
    grip = box((-0.012, 0.012), (-0.07, 0.07), (z, z + 0.02), (40, 40, 44))
    return Piece("tool box", join(box((-x, x), (-y, y), (0, z), pick(rng, ((170, 40, 36), (40, 70, 120)))), grip))


def crate(rng: np.random.Generator) -> Piece:
    """Return a closed storage crate with a lid."""
    x, y, z = rng.uniform(0.1, 0.17), rng.uniform(0.12, 0.25), rng.uniform(0.1, 0.22)
    lid = box((-x - 0.006, x + 0.006), (-y - 0.006, y + 0.006), (z, z + 0.012), random_color(rng, 50, 225))
    return Piece("crate", join(box((-x, x), (-y, y), (0, z), random_color(rng, 50, 225)), lid))


def pot_plant(rng: np.random.Generator) -> Piece:
    """Return a small plant in a pot."""
    return objects.plant(rng, rng.uniform(0.18, 0.34))


def pile(rng: np.random.Generator) -> Piece:
    """Return a few books that lie on each other, as one object."""
    return Piece("books", join(*(book.surface for book in objects.pile(rng, integer(rng, 1, 4)))))


def row(rng: np.random.Generator) -> Piece:
    """Return a row of upright books or binders, as one object; its spines face +x."""
    tall, deep, colors = rng.uniform(0.17, 0.3), rng.uniform(0.12, 0.19), [pick(rng, SPINES) for _ in range(12)]
    spines, y = [], 0.0
    for color in colors[: integer(rng, 4, 12)]:
        thick, lower = rng.uniform(0.014, 0.06), rng.uniform(0.0, 0.03)
        spines.append(box((-deep, -lower), (y, y + thick), (0, tall - lower), color))
        y += thick + 0.001
    return Piece("books", join(*spines))


def vase(rng: np.random.Generator) -> Piece:
    """Return an empty vase."""
    r, h = rng.uniform(0.03, 0.07), rng.uniform(0.1, 0.3)
    profile = [(0, 0), (0.6 * r, 0), (r, 0.4 * h), (0.4 * r, 0.8 * h), (0.55 * r, h), (0.45 * r, h), (0.3 * r, 0.8 * h)]
    return Piece("vase", lathe([*profile, (0, 0.75 * h)], random_color(rng, 50, 225)))


def towels(rng: np.random.Generator) -> Piece:
    """Return a small pile of folded towels."""
    return household.towel_stack(rng, integer(rng, 1, 3))


def folded(rng: np.random.Generator) -> Piece:
    """Return a pile of folded clothes."""
    return objects.clothes(rng, integer(rng, 1, 3))


def bottle(rng: np.random.Generator) -> Piece:
    """Return a bottle."""
    return household.bottle(rng, rng.uniform(0.14, 0.32))


def soap(rng: np.random.Generator) -> Piece:
    """Return a soap dispenser."""
    return household.bottle(rng, rng.uniform(0.15, 0.2), "soap dispenser")


def bowl(rng: np.random.Generator) -> Piece:
    """Return an empty bowl."""
    return household.bowl(rng.uniform(0.08, 0.13), random_color(rng, 50, 225))


def candle(rng: np.random.Generator) -> Piece:
    """Return a low candle."""
    return objects.candle(rng.uniform(0.05, 0.15))


def basket(rng: np.random.Generator) -> Piece:
    """Return an open wicker basket."""
    x, y, z = rng.uniform(0.1, 0.16), rng.uniform(0.12, 0.2), rng.uniform(0.1, 0.2)
    walls = [
        box((-x, x), (-y, y), (0, 0.01), (176, 144, 98), FABRIC),
        *(box((s, s + 0.01), (-y, y), (0.01, z), (176, 144, 98), FABRIC) for s in (-x, x - 0.01)),
        *(box((-x + 0.01, x - 0.01), (s, s + 0.01), (0.01, z), (176, 144, 98), WOOD) for s in (-y, y - 0.01)),
    ]
    return Piece("basket", join(*walls))


# What stands about by theme
THEMES: dict[str, tuple[Maker, ...]] = {
    "office": (row, pile, notebook, carton, objects.cup, objects.paper_stack, pot_plant, crate),
    "paper": (notebook, case, objects.paper_stack, notebook),
    "kitchen": (household.jar, bottle, objects.cup, can, carton, bowl),
    "pantry": (household.jar, can, bottle, carton, basket),
    "cutlery": (cutlery, case, lambda r: household.plate(r.uniform(0.08, 0.12))),
    "bath": (bottle, soap, towels, household.tissue_box, household.toothbrush_cup, can),
    "toiletries": (case, can, case),
    "linen": (towels, folded, basket),
    "clothes": (folded, folded, carton, objects.slippers),
    "bedroom": (pile, candle, lambda r: objects.alarm_clock(), objects.photo, vase, case),
    "living": (row, pile, vase, objects.photo, lambda r: objects.candle(r.uniform(0.05, 0.2)), pot_plant, objects.bowl),
    "dishes": (vase, objects.bowl, bottle, lambda r: household.plate(0.11), objects.cup),
    "tools": (tool_box, can, crate, carton, case),
    "shoes": (objects.slippers, carton, basket),
    "nothing": (),
}


def fill(rng: np.random.Generator, board: Board, theme: str, count: int) -> tuple[Piece, ...]:
    """Return up to `count` things of a theme that stand on a board and keep clear of each other.

    `theme`: a key of THEMES.
    """
    placed: list[Piece] = []
    taken: list[np.ndarray] = []
    for _ in range(count if THEMES[theme] else 0):
        thing = pick(rng, THEMES[theme])(rng)
        thing = thing.moved(at(0, 0, 0, rng.uniform(-12, 12) + 90 * (thing.name == "cutlery")))
        spot = _spot(rng, thing, board, taken)
        if spot is not None:
            placed.append(thing.moved(spot))
            taken.append(_footprint(placed[-1]))
    return tuple(placed)


def _spot(rng: np.random.Generator, thing: Piece, board: Board, taken: list[np.ndarray]) -> np.ndarray | None:
    """Return a motion that puts a thing on a free place of a board, shape [4 4], or None."""
    low, high = thing.surface.vertices.min(axis=0), thing.surface.vertices.max(axis=0)
    starts = np.array((board.x[0], board.y[0])) + MARGIN - low[:2]
    ends = np.array((board.x[1], board.y[1])) - MARGIN - high[:2]
    if high[2] - low[2] > board.headroom - MARGIN or (ends < starts).any():
        return None
    for _ in range(8):
        place = rng.uniform(starts, ends)
        mine = np.stack([low[:2] + place, high[:2] + place]) + [[-MARGIN], [MARGIN]]
        if not any((mine[0] < other[1]).all() and (other[0] < mine[1]).all() for other in taken):
            return at(place[0], place[1], board.z - low[2] + 0.0003)
    return None


def _footprint(thing: Piece) -> np.ndarray:
    points = thing.surface.vertices[:, :2]
    return np.stack([points.min(axis=0), points.max(axis=0)])
