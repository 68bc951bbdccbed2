"""Storage furniture of bedrooms and living rooms. Local frames: the body's front edge at x = 0, facing +x, z up, metres."""

from __future__ import annotations

import numpy as np

from s2a.homes.cabinets import BOARD, Finish, bank, case, grip, leaf, paint
from s2a.homes.furniture import cabinet_body
from s2a.homes.solids import Piece, at, box, join
from s2a.scene.scene import Joint


def chest_of_drawers(
    rng: np.random.Generator, width: float, rows: tuple[float, ...], columns: int, style: str, finish: Finish
) -> Piece:
    """Return a chest of drawers 0.46 m deep on legs 0.1 m high; its drawers open by 0.33 m."""
    high, edges = 0.12 + sum(rows), np.linspace(-width / 2, width / 2, columns + 1)
    body = case((0.46, width, high), 0.1, finish)
    body += [box((-0.44, 0), (y - 0.009, y + 0.009), (0.1, high - 0.02), *paint(finish)) for y in edges[1:-1]]
    spans = [(float(a), float(b)) for a, b in zip(edges[:-1], edges[1:], strict=True)]
    drawers = [d for span in spans for d in bank(rng, span, 0.1, rows, style, finish, 0.33)]
    return Piece("chest of drawers", join(*body), tuple(drawers))


def nightstand(rng: np.random.Generator, drawers: int, finish: Finish, name: str = "nightstand") -> Piece:
    """Return a nightstand 0.45 m deep and wide, 0.56 m high, with knobs: two drawers, or one over an open compartment."""
    body = case((0.45, 0.45, 0.56), 0.14, finish)
    rows = (0.2,) * drawers
    low = 0.54 - sum(rows)
    if drawers == 1:
        body.append(box((-0.44, 0), (-0.22, 0.22), (low, low + BOARD), *paint(finish)))
    return Piece(name, join(*body), tuple(bank(rng, (-0.225, 0.225), low, rows, "knob", finish, 0.31)))


WARDROBE_SHELVES = (0.82, 1.24, 1.66)
"""Height of the open shelves between a wardrobe's doors [m]."""


def wardrobe(rng: np.random.Generator, finish: Finish) -> Piece:
    """Return a wardrobe 1.74 m wide, 2.1 m high, 0.58 m deep: a door to the left and right, drawers and open shelves between.

    The doors' upright bars have their middle 1 m above the floor.
    """
    half, inner = 0.87, 0.28
    body = [part.moved(at(0, 0, 0.06)) for part in cabinet_body((0.58, 2 * half, 2.04), BOARD, *paint(finish))]
    body += [box((-0.57, 0), (y - 0.009, y + 0.009), (0.06, 2.1), *paint(finish)) for y in (-inner, inner)]
    body += [box((-0.57, 0), (-inner, inner), (z - BOARD, z), *paint(finish)) for z in WARDROBE_SHELVES]
    body.append(box((-0.56, -0.03), (-half + 0.02, half - 0.02), (0, 0.06), *paint(finish)))
    doors = [
        leaf(rng, span, (0.06, 2.1), side, ("bar", 1.0), finish)
        for span, side in (((inner, half), 1), ((-half, -inner), -1))
    ]
    drawers = bank(rng, (-inner, inner), 0.06, (0.25, 0.25, 0.24), "bar", finish, 0.4)
    return Piece("wardrobe", join(*body), (*doors, *drawers))


def sideboard(rng: np.random.Generator, finish: Finish) -> Piece:
    """Return a sideboard 1.6 m wide, 0.78 m high, 0.45 m deep with edge pulls: a door to the left and right, drawers between."""
    half, inner = 0.8, 0.29
    body = case((0.45, 2 * half, 0.78), 0.16, finish)
    body += [box((-0.44, 0), (y - 0.009, y + 0.009), (0.16, 0.76), *paint(finish)) for y in (-inner, inner)]
    doors = [
        leaf(rng, span, (0.16, 0.76), side, ("edge", 0.5), finish)
        for span, side in (((inner, half), 1), ((-half, -inner), -1))
    ]
    return Piece(
        "sideboard", join(*body), (*doors, *bank(rng, (-inner, inner), 0.16, (0.2,) * 3, "edge", finish, 0.32))
    )


def tv_stand(rng: np.random.Generator, finish: Finish) -> Piece:
    """Return a TV stand 1.7 m wide, 0.5 m high, 0.46 m deep: two drawers with bars to each side, open shelves between.

    The open shelves are at z = 0.118 m and 0.3 m, between y = -0.29 m and 0.29 m.
    """
    half, inner = 0.85, 0.3
    body = case((0.46, 2 * half, 0.5), 0.1, finish)
    body += [box((-0.45, 0), (y - 0.009, y + 0.009), (0.1, 0.48), *paint(finish)) for y in (-inner, inner)]
    body.append(box((-0.45, 0), (-inner, inner), (0.282, 0.3), *paint(finish)))
    drawers = [
        d for span in ((inner, half), (-half, -inner)) for d in bank(rng, span, 0.1, (0.19, 0.19), "bar", finish, 0.33)
    ]
    return Piece("tv stand", join(*body), tuple(drawers))


CABINET_SHELVES = (0.96, 1.28, 1.6)
"""Height of the open shelves above a tall cabinet's doors [m]."""


def tall_cabinet(rng: np.random.Generator, finish: Finish) -> Piece:
    """Return a cabinet 0.96 m wide, 1.92 m high, 0.4 m deep: open shelves above a left and a right door with upright bars."""
    half = 0.48
    body = cabinet_body((0.4, 2 * half, 1.92), BOARD, *paint(finish))
    body += [box((-0.39, 0), (-half, half), (z - BOARD, z), *paint(finish)) for z in CABINET_SHELVES]
    doors = [
        leaf(rng, span, (0.06, 0.95), side, ("bar", 0.72), finish)
        for span, side in (((0.0, half), 1), ((-half, 0.0), -1))
    ]
    plinth = box((-0.02, 0.012), (-half, half), (0, 0.057), *paint(finish))
    return Piece("storage cabinet", join(*body, plinth), tuple(doors))


def storage_bench(rng: np.random.Generator, width: float, style: str, finish: Finish) -> Piece:
    """Return a bench 0.44 m deep and 0.46 m high whose lid turns up about its back edge at x = -0.44, up to 85 degrees."""
    deep, half, low = 0.44, width / 2, 0.42
    walls = [
        box((-deep, 0), (-half, -half + BOARD), (0, low), *paint(finish)),
        box((-deep, 0), (half - BOARD, half), (0, low), *paint(finish)),
        box((-deep, -deep + BOARD), (-half, half), (0, low), *paint(finish)),
        box((-BOARD, 0), (-half, half), (0, low), *paint(finish)),
        box((-deep, 0), (-half, half), (0.05, 0.05 + BOARD), *paint(finish)),
    ]
    rise = 0.003 + rng.uniform(0, 0.001)
    board = box((-deep, 0.02), (-half - 0.01, half + 0.01), (low + rise, low + 0.04), finish.front, finish.texture)
    pull = grip(style, width, 0.04 - rise, finish.metal).moved(at(0.02, 0, low + (0.04 + rise) / 2))
    joint = Joint("revolute", (0.0, -1.0, 0.0), (-deep, 0.0, low + rise), (0.0, float(np.radians(85))))
    return Piece("storage bench", join(*walls), (Piece("lid", board, (pull,), joint),))
