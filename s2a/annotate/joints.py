"""Joints of flat fronts: a slide along the normal or a side, a hinge along a side or a line."""

from __future__ import annotations

from typing import Literal

import numpy as np

from s2a.annotate.region import FrontRegion
from s2a.scan.predictions import USUAL_RANGE
from s2a.scene.scene import Joint

Direction = Literal["out", "right", "left", "up", "down"]
DIRECTIONS: tuple[Direction, ...] = ("out", "right", "left", "up", "down")
NEAR_SIDE = 0.06
"""[m] Picked points this near to a side mean that side."""


def slide(region: FrontRegion, direction: Direction = "out") -> Joint:
    """Return the slide of a front: out of its plane by a usual drawer's travel, or along a side by its own length."""
    if direction == "out":
        return _joint("prismatic", region.normal, region.center, USUAL_RANGE["translation"])
    k, sign = (0 if direction in ("right", "left") else 1), (1.0 if direction in ("right", "up") else -1.0)
    return _joint("prismatic", sign * region.axes[:, k], region.center, float(region.size[k]))


def hinge(region: FrontRegion, points: np.ndarray) -> Joint:
    """Return the hinge of a front from picked points: along the side that is near, or else along the line through two.

    It opens to the side to which the front looks.

    Args:
        region: the front.
        points: one or two points [m], shape [point 3].

    Raises:
        ValueError: two points at one place.
    """
    points = points - np.outer((points - region.center) @ region.normal, region.normal)
    nearest = [side(region, point) for point in points]
    if len(points) == 1 or (nearest[0][0] == nearest[1][0] and max(gap for _, gap in nearest) < NEAR_SIDE):
        return hinge_at(region, nearest[0][0])
    along = points[1] - points[0]
    length = float(np.linalg.norm(along))
    if length < 1e-3:
        raise ValueError("both points are at one place; pick two ends of the edge")
    return _hinge(region, points.mean(axis=0), along / length)


def hinge_at(region: FrontRegion, index: int) -> Joint:
    """Return the hinge along a side of a front: 0 right, 1 left, 2 top, 3 bottom, as seen from the room."""
    return _hinge(region, region.sides()[index][0], region.axes[:, 1 - index // 2])


def side(region: FrontRegion, point: np.ndarray) -> tuple[int, float]:
    """Return the side of a front that is nearest to a point [3], and its distance in the plane [m]."""
    x, y = region.local(point[None])[0, :2]
    half = region.size / 2
    gaps = [
        np.hypot(place - end, max(abs(other) - half[1 - k], 0.0))
        for k, place, other in ((0, x, y), (1, y, x))
        for end in (half[k], -half[k])
    ]
    return int(np.argmin(gaps)), float(min(gaps))


def _hinge(region: FrontRegion, origin: np.ndarray, along: np.ndarray) -> Joint:
    opens = float(np.cross(along, region.center - origin) @ region.normal)
    return _joint("revolute", along if opens >= 0 else -along, origin, USUAL_RANGE["rotation"])


def _joint(kind: Literal["prismatic", "revolute"], axis: np.ndarray, origin: np.ndarray, limit: float) -> Joint:
    unit = axis / np.linalg.norm(axis)
    return Joint(kind, tuple(unit.tolist()), tuple(origin.tolist()), (0.0, limit))
