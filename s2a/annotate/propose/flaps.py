"""Flaps that look like drawers from the front, told apart by how deep the furniture is."""

from __future__ import annotations

import numpy as np

from s2a.annotate.propose.layers import Points
from s2a.annotate.region import FrontRegion

SHALLOW = 0.4
"""[m] Shoe cabinets whose flaps tip forward are no deeper; sold ones have 0.17 to 0.35 m."""
TALL = 0.8
"""A front at least this fraction as high as its furniture is deep is a flap: of 206 drawers of 29 virtual homes one is."""
WIDE = 1.3
"""Width over height from which on a front is no box of a shelf, which is about as wide as high."""
NEAREST, FARTHEST, THICK = 0.1, 1.0, 0.02
"""[m] How far behind a front the wall is looked for, and how thick it may seem."""
STRIP = 0.1
"""[m] Height of the strip of a wall that tells where it is."""
FACING = 0.8
"""Cosine between the wall and the front, at least."""


def is_flap(region: FrontRegion, points: Points, density: float) -> bool:
    """Return whether a front that could slide out tips forward about its lower side instead.

    Args:
        region: the front.
        points: spread over the upright surface of the scan.
        density: of these, per m^2.
    """
    wide, high = region.size
    if wide < WIDE * high:
        return False
    depth = depth_behind(region, points, density)
    return depth is not None and depth <= SHALLOW and high >= TALL * depth


def depth_behind(region: FrontRegion, points: Points, density: float) -> float | None:
    """Return how far behind a front the wall is [m]: the farthest surface that faces as it does; None where none is seen."""
    place = region.local(points.place)
    behind = -place[:, 2]
    beside = np.abs(place[:, 0]) < region.size[0] / 2
    facing = points.normal @ region.normal > FACING
    near = beside & facing & (behind > NEAREST) & (behind < FARTHEST)
    found = np.sort(behind[near])
    count = max(round(STRIP * region.size[0] * density), 1)
    if len(found) < count:
        return None
    enough = np.flatnonzero(found[count - 1 :] - found[: len(found) - count + 1] < THICK)
    return float(np.median(found[enough[-1] : enough[-1] + count])) if len(enough) else None
