"""Which limits, masses and places things in rooms have: one answer for scans, for preparation, and for validation."""

from __future__ import annotations

import math

WIDEST = {"prismatic": 3.0, "revolute": 2.0 * math.pi}
"""No drawer is longer [m], no door turns further [rad]; degrees read as radians are."""
NARROWEST = 0.01
"""Smallest range of a joint [m or rad] that is worth a robot."""
MAX_MASS, MAX_COORDINATE = 1e5, 1e7
"""Of a part [kg], and of a point [m]: scans may lie far from their zero point, as maps do."""
UNITS = {"prismatic": "m", "revolute": "rad"}


def problems(kind: str, low: float, high: float) -> list[str]:
    """Return in words what is wrong with a joint's limits; nothing for those that a robot can move it between.

    Args:
        kind: "prismatic" or "revolute".
        low: lowest coordinate [m] or [rad], relative to the scanned pose; may be NaN.
        high: the highest one.
    """
    unit, found = UNITS[kind], []
    if not low <= 0.0 <= high:
        found.append(f"limits {low:g} to {high:g} {unit} do not hold 0, the scanned pose")
    if not NARROWEST <= high - low <= WIDEST[kind]:
        found.append(f"a range of {high - low:g} {unit}, possible: {NARROWEST:g} to {WIDEST[kind]:g} {unit}")
    return found
