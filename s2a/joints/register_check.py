"""Checks that tell a part that opens from an object that was moved: it opens outwards, and its furniture is still."""

from __future__ import annotations

import numpy as np

from s2a.joints.register_surface import Cloud, OrientedMesh, Patch, match
from s2a.scene.articulation import opening_direction, transform
from s2a.scene.geometry.mesh_query import visible_distance
from s2a.scene.scene import Joint

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
OWN = 0.02
"""[m] A line of sight that ends so near to a part where it stands open is hidden by the part itself."""
MIN_ASKED = 0.1
"""Fraction of the lines of sight that the part itself does not hide, at least; fewer say nothing."""
INSIDE = 0.02
"""[m] What an opened front shows lies deeper behind it."""
MIN_GONE = 0.4
"""Fraction of the lines of sight to a front's old place that are free in the open scan, at least; hidden walls have 0 to 0.35."""
MIN_INSIDE = 0.1
"""Fraction of a front behind which the open scan shows room, at least, where the open part hides its old place."""
LEVEL = 0.97
"""Cosine to the vertical from which a surface is level."""
FLOOR = 0.03
"""[m] The floor is not higher above the height below which a tenth of the level surface lies."""


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


def left(joint: Joint, patch: Patch, opened: OrientedMesh) -> bool:
    """Return whether a front has left its old place: that is seen to be empty, or hidden by the open part alone and open behind.

    Where a drawer or a narrow door hides its own old place, the open scan has to show something of what is inside.
    """
    if gone(patch, opened) > MIN_GONE:
        return True
    return gone(patch, opened, joint) > MIN_GONE and shows_inside(patch, opened) > MIN_INSIDE


def gone(patch: Patch, opened: OrientedMesh, joint: Joint | None = None) -> float:
    """Return the fraction of lines of sight to the places of a patch that are free in the open scan.

    What was hidden, by a door that opened before it, is seen from nowhere: every line to it meets the back of a surface.

    Args:
        patch: of the closed scan.
        opened: the open scan, all of it.
        joint: of the patch, whose lines to itself where it stands open are left out; None: all lines count.
    """
    points = _places(patch)
    rays = _cone(patch.normal)
    starts, ways = np.repeat(points + 0.005 * patch.normal, len(rays), axis=0), np.tile(rays, (len(points), 1))
    distance, behind = visible_distance(opened.tree, starts, ways, FREE)
    hidden = (distance < FREE) & behind
    if joint is None:
        return float(np.mean(~hidden))
    back = np.linalg.inv(transform(joint, joint.limits[1]))
    returned = (starts + distance[:, None] * ways) @ back[:3, :3].T + back[:3, 3]
    asked = ~(hidden & near_box(returned, patch, OWN))
    return float(np.mean(~hidden[asked])) if np.mean(asked) > MIN_ASKED else 0.0


def shows_inside(patch: Patch, opened: OrientedMesh) -> float:
    """Return the fraction of the places of a patch behind which the open scan shows room: the front of a surface.

    Behind an opened front it shows what is inside; behind a wall that something hides, backs of surfaces or nothing.
    """
    distance, behind = visible_distance(opened.tree, _places(patch) - 0.005 * patch.normal, -patch.normal, FAR)
    return float(np.mean((distance > INSIDE) & (distance < FAR) & ~behind))


def on_floor(patch: Patch, room: OrientedMesh) -> bool:
    """Return whether a patch is of the floor, which opens nowhere: it faces up at the height of the lowest level surface."""
    if patch.normal[2] < LEVEL:
        return False
    level = room.normals[:, 2] > LEVEL
    heights, areas = room.centroids[level, 2], room.areas[level]
    order = np.argsort(heights)
    lowest = heights[order][np.searchsorted(np.cumsum(areas[order]), 0.1 * areas.sum())]
    return bool(patch.centre[2] < lowest + FLOOR)


def _places(patch: Patch) -> np.ndarray:
    """Return the places of a patch that are asked [m], shape [place 3]."""
    return patch.cloud.points[np.linspace(0, len(patch.cloud) - 1, POINTS).astype(int)]


def near_box(points: np.ndarray, patch: Patch, room: float) -> np.ndarray:
    """Return a mask of points [point 3] in the box around a patch in its own axes, and so much more on all sides [m]."""
    axes = np.linalg.svd(patch.normal[None])[2]
    flat = (patch.cloud.points - patch.centre) @ axes.T
    local = (points - patch.centre) @ axes.T
    return ((local > flat.min(axis=0) - room) & (local < flat.max(axis=0) + room)).all(axis=1)


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
    points = _places(patch)
    distance = visible_distance(opened.tree, points + 0.005 * patch.normal, axis, q + 0.05)[0]
    met = distance < q + 0.04
    return float(np.mean(distance[met] > q - THICK)) if met.any() else 0.0


def before_room(joint: Joint, patch: Patch, closed: OrientedMesh) -> float:
    """Return the fraction of a front, where it stands open, behind which the closed scan has room: the front of a surface.

    Behind a wall, or the side of a cabinet, that the closed scan does not show are backs of surfaces or nothing.
    """
    motion = transform(joint, joint.limits[1])
    points = _places(patch)
    normal = motion[:3, :3] @ patch.normal
    there = points @ motion[:3, :3].T + motion[:3, 3] - 0.03 * normal
    distance, behind = visible_distance(closed.tree, there, -normal, FAR)
    return float(np.mean((distance < FAR) & ~behind))
