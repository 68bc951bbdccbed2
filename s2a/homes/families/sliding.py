"""Wardrobes with sliding doors on two tracks, one before the other.

Ranges: two doors 0.9 to 2.4 m wide, three 1.35 to 3.6 m (almara.com.au); 0.54 to 0.7 m deep (slidingdoorwardrobe.uk,
joycekitchens.com.au); 1.8 to 2.4 m high (choicewardrobe.co.uk). Common size: an overlap of 20 to 50 mm.
Doors of the rear track have recessed pulls, past which those of the front track slide.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from s2a.homes import grips, panels
from s2a.homes.casework import CabinetBase, Cell, Column, cabinet
from s2a.homes.draw import chance, integer, pick, uniform
from s2a.homes.fittings import Opening, Style
from s2a.homes.handle_places import door_grips
from s2a.homes.solids import Piece, at
from s2a.scene.scene import Joint

PLAY = 0.008
"""Between the tracks, and between doors and cabinet body [m]."""


def sliding_wardrobe(rng: np.random.Generator, style: Style) -> Piece:
    """Return a wardrobe with two or three doors that slide past each other."""
    size = uniform(rng, (0.6, 0.68)), uniform(rng, (1.2, 2.6)), uniform(rng, (1.9, 2.36))
    count = 3 if size[1] > 1.9 and chance(rng, 0.6) else 2
    base = CabinetBase("plinth", uniform(rng, (0.04, 0.08)))
    deep = size[0] - 2 * (style.thick + PLAY)
    inside = tuple(Column(1.0, (Cell(1.0, Opening("open"), integer(rng, 1, 4)),)) for _ in range(count))
    body = cabinet(rng, "wardrobe", (deep + style.thick + 0.002, *size[1:]), inside, style, base)
    overlap = uniform(rng, (0.02, 0.05))
    wide, high = (size[1] + (count - 1) * overlap) / count, size[2] - base.height - 2 * PLAY
    doors = []
    for i in range(count):
        ahead = i % 2 == 1
        # The outer doors slide inwards; the one in the middle to either side.
        towards = 1 if i == 0 else -1 if i == count - 1 else pick(rng, (-1, 1))
        front = _door(rng, (style.thick, wide, high), -towards, ahead, style, base.height + PLAY + high / 2)
        x = size[0] if ahead else size[0] - style.thick - PLAY
        y = -size[1] / 2 + wide / 2 + i * (wide - overlap)
        doors.append(front.moved(at(x, y, base.height + PLAY + high / 2)))
    return replace(body, children=tuple(doors))


def _door(rng: np.random.Generator, size: panels.Size, edge: int, ahead: bool, style: Style, height: float) -> Piece:
    """Return a door whose handle is near its edge at y = edge * width / 2 and that slides the other way."""
    grip = grips.design(rng, *(("bar", "rail", "square", "recess") if ahead else ("recess",)), color=style.grip.color)
    # A leaf that is hinged at the other edge has its handle here.
    handles, pocket = door_grips(grip, (-edge, 0), size, height, uniform(rng, (0.04, 0.07)))
    plain = panels.front(pick(rng, ("slab", "mirror", "grooved")), size, style.front, style.texture, style.frame)
    shape = plain if pocket is None else panels.pocketed(size, pocket, 0.0135, style.front, style.texture)
    travel = round(uniform(rng, (0.75, 0.9)) * size[1], 4)
    joint = Joint("prismatic", (0.0, float(-edge), 0.0), (0.0, 0.0, 0.0), (0.0, travel))
    return Piece("sliding door", shape, handles, joint)
