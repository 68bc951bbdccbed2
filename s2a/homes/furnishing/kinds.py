"""One varied home from a random stream: its shape, doors and windows, furniture by the rules of its kind, scanner positions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from s2a.core.errors import InputError
from s2a.homes import outline, styles
from s2a.homes.catalog import moves
from s2a.homes.draw import Range, integer
from s2a.homes.floor_plan import Crowded, FloorPlan
from s2a.homes.furnishing import cooking, living, sleeping, washing, working
from s2a.homes.furnishing.common import doors, lamps, sockets, windows
from s2a.homes.room import Room
from s2a.homes.styles import Palette
from s2a.homes.viewpoints import viewpoints

ATTEMPTS = 80
"""Rooms that are begun before a kind of room is given up."""
SCANNERS = 24
"""Positions of a scanner that are found; a tripod stands at the first few, a hand-held one passes all."""


@dataclass(frozen=True)
class Kind:
    """One kind of room.

    Attributes:
        area: of the floor [m^2].
        plain: probability of a rectangle.
        doors: least and largest number.
        windows: least and largest number.
        furnish: places what makes it such a room; raises Crowded where something has no place.
    """

    area: Range
    plain: float
    doors: tuple[int, int]
    windows: tuple[int, int]
    furnish: Callable[[FloorPlan, Palette], None]


HOMES: Mapping[str, Kind] = {
    "office": Kind((10, 18), 0.6, (1, 1), (1, 2), working.office),
    "bedroom": Kind((10, 17), 0.5, (1, 1), (1, 2), sleeping.bedroom),
    "kitchen": Kind((10, 18), 0.6, (1, 1), (1, 1), cooking.kitchen),
    "bathroom": Kind((5.5, 10), 0.75, (1, 1), (0, 1), washing.bathroom),
    "living_room": Kind((14, 25), 0.4, (1, 2), (1, 2), living.living_room),
    "dining_room": Kind((11, 18), 0.5, (1, 2), (1, 2), living.dining_room),
    "hallway": Kind((5.5, 12), 0.4, (2, 3), (0, 1), living.hallway),
    "laundry": Kind((5, 9), 0.8, (1, 1), (0, 1), washing.laundry),
    "study": Kind((8.5, 14), 0.5, (1, 1), (1, 2), working.study),
    "workshop": Kind((11, 20), 0.7, (1, 1), (0, 1), working.workshop),
}
"""Kinds of rooms; floor areas as in flats and offices (DIN 283, ASR A1.2)."""


def stream(name: str, seed: int) -> np.random.Generator:
    """Return the random stream of a room; rooms of different kinds share no draws: not one palette and one door ten times."""
    return np.random.default_rng([seed, *name.encode()])


def home(name: str, seed: int) -> Room:
    """Return the room that `s2a sample virtual=varied` scans, before it is turned in its scene."""
    return furnish(name, stream(name, seed).spawn(1)[0])


def furnish(name: str, rng: np.random.Generator) -> Room:
    """Return a furnished room of a kind.

    Args:
        name: a key of HOMES.
        rng: everything that is drawn.

    Raises:
        InputError: no attempt found a place for all that such a room needs.
    """
    kind = HOMES[name]
    for attempt in rng.spawn(ATTEMPTS):
        shape = outline.outline(attempt, kind.area, (2.35, 3.0), kind.plain)
        plan = FloorPlan(shape, attempt)
        try:
            return _furnished(plan, kind)
        except Crowded:
            continue
    raise InputError(f"no {name} could be furnished in {ATTEMPTS} attempts; take another seed")


def _furnished(plan: FloorPlan, kind: Kind) -> Room:
    """Return a room of one attempt; raises Crowded."""
    rng, colors = plan.rng, styles.palette(plan.rng)
    holes = doors(plan, colors, integer(rng, *kind.doors))
    windows(plan, colors, holes, integer(rng, *kind.windows))
    kind.furnish(plan, colors)
    sockets(plan)
    lamps(plan)
    paint, ground = outline.paints(rng)
    pieces = sorted([*plan.pieces, *outline.structure(plan.room, holes, paint, ground)], key=lambda p: not moves(p))
    scanners = viewpoints(pieces, plan.room, SCANNERS, rng)
    if len(scanners) < 6:
        raise Crowded
    return Room(tuple(pieces), scanners, plan.room.size)
