"""What tells a part that opens from an object that was moved: it opens outwards, and what holds it stands still around it."""

from __future__ import annotations

import numpy as np

from s2a.articulation import opening_direction, transform
from s2a.diff.register_change import Patch
from s2a.diff.register_surface import Cloud, OrientedMesh, match
from s2a.geometry.line_of_sight import visible_distance
from s2a.scene import Joint

HELD = 0.06
"""[m] What holds a part is not farther from its border, or from its hinge, than this."""
STEP = 0.02
"""[m] Distance of the places on the border that are asked."""
QUANTILE = 0.01
"""Points of a patch beyond its border."""
CONE = np.radians(60.0)
"""[rad] Lines of sight farther from a front's normal than this are not asked."""
FREE = 0.4
"""[m] A line of sight that meets nothing for so long comes from the room."""
FAR = 15.0
"""[m] Longest line of sight through a room."""
RAYS, POINTS = 40, 60
"""Directions and places that are asked."""
THICK = 0.06
"""[m] Largest thickness of a front: how much nearer its back may be than its front."""


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


def held(joint: Joint, patch: Patch, still: OrientedMesh) -> tuple[float, float]:
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


def _near(points: np.ndarray, surface: OrientedMesh) -> np.ndarray:
    return match(Cloud(points, points, np.zeros(len(points), int)), surface, HELD).face >= 0


def gone(patch: Patch, opened: OrientedMesh) -> float:
    """Return the fraction of lines of sight to the places of a patch that are free in the open scan.

    What was hidden, by a door that opened before it, is seen from nowhere: every line to it meets the back of a surface.
    """
    points = patch.cloud.points[np.linspace(0, len(patch.cloud) - 1, POINTS).astype(int)]
    rays = _cone(patch.normal)
    starts, ways = np.repeat(points + 0.005 * patch.normal, len(rays), axis=0), np.tile(rays, (len(points), 1))
    distance, behind = visible_distance(opened.tree, starts, ways, FREE)
    return float(np.mean((distance >= FREE) | ~behind))


def _cone(normal: np.ndarray) -> np.ndarray:
    """Return unit directions spread evenly around a normal, shape [ray 3], by the golden angle."""
    height = 1.0 - (np.arange(RAYS) + 0.5) / RAYS * (1.0 - np.cos(CONE))
    angle = np.pi * (1 + 5**0.5) * np.arange(RAYS)
    u, v = np.linalg.svd(normal[None])[2][1:]
    flat = np.sqrt(1 - height**2)[:, None]
    return height[:, None] * normal + flat * (np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v)


def reaches(joint: Joint, patch: Patch, opened: OrientedMesh) -> float:
    """Return the fraction of a slide's front that is the first surface before its old place; 1 for a hinge."""
    if joint.kind == "revolute":
        return 1.0
    axis, q = np.array(joint.axis), joint.limits[1]
    points = patch.cloud.points[np.linspace(0, len(patch.cloud) - 1, POINTS).astype(int)]
    distance = visible_distance(opened.tree, points + 0.005 * patch.normal, axis, q + 0.05)[0]
    met = distance < q + 0.04
    return float(np.mean(distance[met] > q - THICK)) if met.any() else 0.0


def before_room(joint: Joint, patch: Patch, closed: OrientedMesh) -> float:
    """Return the fraction of a front, where it stands open, behind which the closed scan has room: the front of a surface.

    Behind a wall, or the side of a cabinet, that the closed scan does not show are backs of surfaces or nothing.
    """
    motion = transform(joint, joint.limits[1])
    points = patch.cloud.points[np.linspace(0, len(patch.cloud) - 1, POINTS).astype(int)]
    normal = motion[:3, :3] @ patch.normal
    there = points @ motion[:3, :3].T + motion[:3, 3] - 0.03 * normal
    distance, behind = visible_distance(closed.tree, there, -normal, FAR)
    return float(np.mean((distance < FAR) & ~behind))
