"""What tells a part that opens from an object that was moved: it opens outwards, and what holds it stands still around it."""

from __future__ import annotations

import numpy as np

from s2a.articulation import opening_direction
from s2a.diff.register_change import Patch
from s2a.diff.register_surface import Cloud, Surface, match
from s2a.scene import Joint

HELD = 0.06
"""[m] What holds a part is not farther from its border, or from its hinge, than this."""
STEP = 0.02
"""[m] Distance of the places on the border that are asked."""
QUANTILE = 0.01
"""Points of a patch beyond its border."""


def outwards(joint: Joint, patch: Patch) -> float:
    """Return the mean cosine between a patch's normal and the way in which its points move first: 1 for a drawer."""
    points = patch.cloud.points[:: max(1, len(patch.cloud) // 100)]
    return float(np.mean([opening_direction(joint, point) @ patch.normal for point in points]))


def border(patch: Patch) -> list[np.ndarray]:
    """Return places along the four sides of the rectangle around a patch [m], shape [place 3] each."""
    local = patch.cloud.points - patch.centre
    axes = _rectangle(local, patch.normal)
    flat = local @ axes.T
    low, high = np.quantile(flat, [QUANTILE, 1 - QUANTILE], axis=0)
    corners = np.array([(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])])
    sides = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        count = max(2, int(np.linalg.norm(b - a) / STEP))
        sides.append(patch.centre + (a + np.linspace(0.1, 0.9, count)[:, None] * (b - a)) @ axes)
    return sides


def _rectangle(local: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return two directions in a plane along which points have the smallest bounding rectangle, shape [2 3]."""
    u = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    u /= np.linalg.norm(u)
    v = np.cross(normal, u)
    best, found = np.inf, np.stack([u, v])
    for angle in np.radians(np.arange(0, 90, 1.0)):
        axes = np.stack([np.cos(angle) * u + np.sin(angle) * v, np.cos(angle) * v - np.sin(angle) * u])
        low, high = np.quantile(local @ axes.T, [QUANTILE, 1 - QUANTILE], axis=0)
        if (area := float(np.prod(high - low))) < best:
            best, found = area, axes
    return found


def held(joint: Joint, patch: Patch, still: Surface) -> tuple[float, float]:
    """Return the fraction of a patch's border that has something near that stands still, and that of its hinge, or 1.

    Args:
        joint: the joint that is asked about.
        patch: of the part.
        still: what both scans show.
    """
    sides = border(patch)
    around = np.mean([_near(side, still).mean() for side in sides])
    if joint.kind == "prismatic":
        return float(around), 1.0
    axis, origin = np.array(joint.axis), np.array(joint.origin)
    along = (patch.cloud.points - origin) @ axis
    low, high = np.quantile(along, [QUANTILE, 1 - QUANTILE])
    line = origin + np.linspace(low, high, max(4, int((high - low) / STEP)))[:, None] * axis
    return float(around), float(_near(line, still).mean())


def _near(points: np.ndarray, surface: Surface) -> np.ndarray:
    return match(Cloud(points, points, np.zeros(len(points), int)), surface, HELD).face >= 0
