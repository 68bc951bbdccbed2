"""How a front opens, by its shape and its handle: rules of furniture, which hold most of the time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

LONG = 1.6
"""A handle whose length is this multiple of its width has a direction."""
MIDDLE = 0.2
"""A handle this near to the middle, as a fraction of the front, is in the middle."""
FLAP = (0.3, 0.95)
"""[m] Height of a front from which on a level handle at its upper end tips it; and width up to which."""
WALL = 1.3
"""[m] Fronts whose middle is higher and that have a level handle at their lower end lift up."""

Motion = Literal["slide", "right", "left", "top", "bottom"]
"""It slides out, or turns about a side: as seen from the room."""


@dataclass(frozen=True)
class FrontShape:
    """What tells how a front opens.

    Attributes:
        width: of the front [m].
        height: of the front [m].
        middle: of the front, above the floor [m].
        x: place of the handle along the width, 0 left to 1 right.
        y: place along the height, 0 bottom to 1 top.
        handle_width: level extent of the handle [m].
        handle_height: upright extent [m].
    """

    width: float
    height: float
    middle: float
    x: float
    y: float
    handle_width: float
    handle_height: float


def motion(seen: FrontShape) -> Motion:
    """Return how a front opens."""
    level = seen.handle_width > LONG * seen.handle_height
    upright = seen.handle_height > LONG * seen.handle_width
    beside: Motion = "left" if seen.x > 0.5 else "right"
    if upright:
        return beside
    if abs(seen.x - 0.5) < MIDDLE:
        if level and seen.middle > WALL and seen.y < 0.35:
            return "top"
        if level and seen.height > FLAP[0] and seen.width < FLAP[1] and seen.y > 0.8 and seen.height > 0.6 * seen.width:
            return "bottom"
        return "slide"
    return beside
