"""The parts of storage furniture: body, drawers, hinged leaves. Local frames: the body's front at x = 0, facing +x, z up, metres.

Fronts lie 2 mm before the cabinet body and 3 mm apart, as cabinet makers hang them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.homes.furniture import cabinet_body, door, drawer
from s2a.homes.handles import bar, cup, edge, knob, upright
from s2a.homes.solids import WOOD, Color, Piece, Surface, at, box, rotation

BOARD, FRONT, GAP, RIM = 0.018, 0.018, 0.003, 0.002
"""Thickness of boards and fronts, gap between fronts, and how far an edge pull stands out of its front's edge [m]."""


@dataclass(frozen=True)
class Finish:
    """How a piece of furniture looks.

    Attributes:
        body: colour of the cabinet body.
        front: colour of what opens.
        texture: texture of both.
        metal: colour of the handles.
    """

    body: Color
    front: Color
    texture: int
    metal: Color


def grip(style: str, width: float, height: float, metal: Color) -> Piece:
    """Return a handle in its place on a drawer's front of given width and height [m].

    Args:
        style: "bar" (26 mm before the front), "knob" (28 mm), "cup" (28 mm deep) or "edge" (20 mm).
        width: of the front.
        height: of the front.
        metal: colour.
    """
    middle = at(0, 0, max(0.0, height / 2 - 0.1))
    match style:
        case "bar":
            return bar(0.32 if width > 0.6 else 0.16, 0.012, 0.012, 0.026, 0.012, metal).moved(middle)
        case "knob":
            return knob(0.016, 0.028, metal).moved(middle)
        case "cup":
            return cup(0.1, 0.042, 0.028, metal).moved(middle @ at(0, 0, 0.02))
        case _:
            return edge(min(0.4, 0.6 * width), color=metal).moved(at(0, 0, height / 2))


def bank(
    rng: np.random.Generator,
    span: tuple[float, float],
    low: float,
    rows: tuple[float, ...],
    style: str,
    finish: Finish,
    travel: float,
) -> list[Piece]:
    """Return drawers one above the other.

    Args:
        rng: how little each front hangs askew.
        span: of the fronts along y, gaps included [m].
        low: height of the lowest drawer's lower end [m].
        rows: height of each, gaps included, from below [m].
        style: of the handles.
        finish: how they texture.
        travel: how far they open [m].
    """
    width, drawers = span[1] - span[0] - GAP, []
    rim = RIM if style == "edge" else 0.0
    for z, row in zip(low + np.cumsum((0.0, *rows[:-1])), rows, strict=True):
        height = row - GAP - rim
        handle = grip(style, width, height, finish.metal)
        # The tray leaves room for partitions and runners.
        front = drawer(
            (FRONT, width, height), (width - 0.06, height - 0.05), handle, finish.front, finish.texture, travel
        )
        drawers.append(_hung(rng, front).moved(at(FRONT + 0.002, sum(span) / 2, z + (row - rim) / 2)))
    return drawers


def leaf(
    rng: np.random.Generator,
    span: tuple[float, float],
    rise: tuple[float, float],
    hinge: int,
    handle: tuple[str, float],
    finish: Finish,
) -> Piece:
    """Return a hinged door.

    Args:
        rng: how little it hangs askew.
        span: from where to where along y, gaps included [m].
        rise: from where to where along z, gaps included [m].
        hinge: side of the hinge along y, +1 or -1.
        handle: its style and the height of its middle [m]; bars and edge pulls stand upright at the free edge.
        finish: how it looks.
    """
    style, height = handle
    rim = RIM if style == "edge" else 0.0
    width, tall, middle = span[1] - span[0] - GAP - rim, rise[1] - rise[0] - GAP, sum(rise) / 2
    free, z = -hinge * width / 2, height - middle
    if style == "edge":
        pull = edge(0.3, color=finish.metal).moved(at(0, free, z) @ rotation((hinge * np.pi / 2, 0, 0)))
    elif style == "bar":
        long = 0.4 if tall > 1.2 else 0.2
        pull = upright(bar(long, 0.012, 0.012, 0.026, 0.012, finish.metal)).moved(at(0, free + hinge * 0.05, z))
    else:
        pull = knob(0.016, 0.028, finish.metal).moved(at(0, free + hinge * 0.05, z))
    panel = _hung(rng, door((FRONT, width, tall), hinge, pull, finish.front, finish.texture))
    return panel.moved(at(FRONT + 0.002, sum(span) / 2 + hinge * rim / 2, middle))


def case(size: tuple[float, float, float], legs: float, finish: Finish) -> list[Surface]:
    """Return a cabinet body on legs under a top board that covers the fronts' upper edges; size along x, y, z with both [m].

    The fronts have the room between z = legs and z = size - 20 mm.
    """
    deep, half, high = size[0], size[1] / 2, size[2]
    body = [
        part.moved(at(0, 0, legs)) for part in cabinet_body((deep, size[1], high - legs - 0.02), BOARD, *paint(finish))
    ]
    top = box((-deep, 0.024), (-half, half), (high - 0.02, high), *paint(finish))
    posts = [
        box((x, x + 0.04), (y, y + 0.04), (0, legs), finish.body, WOOD)
        for x in (0.02 - deep, -0.06)
        for y in (0.02 - half, half - 0.06)
    ]
    return [*body, top, *posts]


def _hung(rng: np.random.Generator, front: Piece) -> Piece:
    """Return a front that hangs so little askew that no corner moves by more than 1.5 mm."""
    return front.tilted(rng, float(np.degrees(0.0015 / (front.size[1:].max() / 2))))


def paint(finish: Finish) -> tuple[Color, int]:
    """Return colour and texture of a cabinet body."""
    return finish.body, finish.texture
