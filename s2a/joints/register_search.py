"""The search among candidate joints: checks of each, a rough fit, and those that explain most surface."""

from dataclasses import dataclass, replace

import numpy as np

from s2a.joints.register_fit import MAX_SLIDE, MAX_TURN, MIN_FRONT, MIN_SLIDE, JointFit, Start, explained, fit, front_of
from s2a.joints.register_surface import FLAT, SPACING, TILT, Cloud, OrientedMesh, Patch, match, plane
from s2a.scene.articulation import opening_direction, transform
from s2a.scene.geometry.mesh_query import visible_distance
from s2a.scene.geometry.planes import across
from s2a.scene.scene import Joint

HELD = 0.06  # [m] What holds a part is not farther from its border, or from its hinge, than this
STEP = 0.02  # [m] Distance of the places on the border that are asked
QUANTILE = 0.01  # Points of a patch beyond its border
CONE = np.radians(60.0)  # [rad] Lines of sight farther from a front's normal than this are not asked
FREE = 0.4  # [m] A line of sight that meets nothing for so long comes from the room
FAR = 15.0  # [m] Longest line of sight through a room
RAYS, POINTS = 40, 60  # Directions and places that are asked
THICK = 0.06  # [m] Largest thickness of a front: how much nearer its back may be than its front
OWN = 0.02  # [m] A line of sight that ends so near to a part where it stands open is hidden by the part itself
MIN_ASKED = 0.1  # Fraction of the lines of sight that the part itself does not hide, at least; fewer say nothing
INSIDE = 0.02  # [m] What an opened front shows lies deeper behind it
# Fraction of the lines of sight to a front's old place that are free in the open scan, at least;
# hidden walls have 0 to 0.35
MIN_GONE = 0.4
# Fraction of a front behind which the open scan shows room, at least, where the open part hides its old place
MIN_INSIDE = 0.1
LEVEL = 0.97  # Cosine to the vertical from which a surface is level
FLOOR = 0.03  # [m] The floor is not higher above the height below which a tenth of the level surface lies


def outwards(joint: Joint, patch: Patch) -> float:
    """Return the mean cosine between a patch's normal and the way in which its points move first: 1 for a drawer."""
    points = patch.cloud.points[:: max(1, len(patch.cloud) // 100)]
    return float(np.mean([opening_direction(joint, point) @ patch.normal for point in points]))


def border(patch: Patch) -> list[np.ndarray]:
    """Return places along the four sides of the rectangle around a patch [m], shape [place 3] each."""
    local = patch.cloud.points - patch.centre
    axes = _bounding_axes(local, patch.normal)
    flat = local @ axes.T
    low, high = np.quantile(flat, [QUANTILE, 1 - QUANTILE], axis=0)
    corners = np.array([(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])])
    sides = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        count = max(2, int(np.linalg.norm(b - a) / STEP))
        sides.append(patch.centre + (a + np.linspace(0.1, 0.9, count)[:, None] * (b - a)) @ axes)
    return sides


def _bounding_axes(local: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return two directions in a plane along which points have the smallest bounding rectangle, shape [2 3]."""
    u, v = across(normal)
    smallest, best = np.inf, np.stack([u, v])
    for angle in np.radians(np.arange(0, 90, 1.0)):
        axes = np.stack([np.cos(angle) * u + np.sin(angle) * v, np.cos(angle) * v - np.sin(angle) * u])
        low, high = np.quantile(local @ axes.T, [QUANTILE, 1 - QUANTILE], axis=0)
        if (area := float(np.prod(high - low))) < smallest:
            smallest, best = area, axes
    return best


def held(joint: Joint, patch: Patch, still: OrientedMesh) -> tuple[float, float]:
    """Return the fraction of a patch's border that has something near that stands still, and that of its hinge, or 1."""
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

    `joint`: of the patch, whose lines to itself where it stands open are left out; None: all lines count.
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
    counted = ~(hidden & near_box(returned, patch, OWN))
    return float(np.mean(~hidden[counted])) if np.mean(counted) > MIN_ASKED else 0.0


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


# Mean cosine between the front's normal and its first motion, at least: parts open towards whoever stands before them
MIN_OUTWARDS = 0.5
MIN_HELD = (0.4, 0.6)  # Fraction of a front's border, and of a hinge, that has something near that stands still
# Fraction of a slide's front before whose old place nothing is nearer than where it slid to;
# of a front that has room behind
MIN_REACHES = 0.5
MAX_TILT = 0.01  # [rad] Standard deviation of an axis' direction beyond which nothing is proposed
ROOM = 0.1  # [m] What belongs to a part lies so near to its front: handles
TIGHT = 0.008  # [m] Surface that is explained lies so near
# [m] Shifts of a hinge's axis towards and from the front that are tried, since planes alone do not fix it
SHIFTS = np.arange(-0.04, 0.0401, 0.005)
LATERAL = np.arange(-0.015, 0.0151, 0.005)  # [m] Sideways errors of a slide's end that are tried
NEXT = 0.15  # [m] Patches of one part are not farther from each other
MIN_MEMBER = 0.5  # Fraction of a patch that a joint explains if it belongs to the part
FEW, MANY = 800, 8000  # Samples for a rough and for a fine fit
MIN_NEW = 0.5  # Fraction of what a joint explains that no better one has explained
MIN_EXPLAINED = 0.45  # Fraction of the changed surface around a front that its joint explains


@dataclass(frozen=True, eq=False)
class Scans:
    """Both scans in the closed one's frame, and what changed."""

    closed: OrientedMesh  # surface that only the closed scan shows
    opened: OrientedMesh  # surface that only the open scan shows
    still: OrientedMesh  # what both show
    first: OrientedMesh  # the whole closed scan
    room: OrientedMesh  # the whole open scan
    before: Cloud  # samples of `closed`
    after: Cloud  # samples of `opened`


@dataclass(frozen=True, eq=False)
class FittedPart:
    """A joint with what it explains."""

    fit: JointFit  # the joint
    front: Patch  # its front
    before: np.ndarray  # indices of the samples before that it explains
    after: np.ndarray  # indices of the samples after that it explains
    fraction: float  # of the changed surface around its front that it explains

    @property
    def area(self) -> float:
        """Explained surface of both scans [m^2]."""
        return (len(self.before) + len(self.after)) * SPACING**2


def candidates(starts: list[Start], patches: list[Patch], scans: Scans) -> list[FittedPart]:
    """Return the joints that open outwards, are held by what stands still, and fit, the most surface first."""
    fitting = []
    floor = {index for index in {start.patch for start in starts} if on_floor(patches[index], scans.still)}
    for start in starts:
        if start.patch in floor:
            continue
        patch = front_of(start, patches[start.patch], scans.opened)
        if not possible(start.joint, patch, scans) or not left(start.joint, patch, scans.room):
            continue
        candidate = measured(rough(start, patch, scans), patch, scans)
        if candidate.fraction > MIN_EXPLAINED and possible(candidate.fit.joint, patch, scans):
            fitting.append(candidate)
    return sorted(fitting, key=lambda candidate: -candidate.area)


def possible(joint: Joint, patch: Patch, scans: Scans) -> bool:
    """Return whether a front could open by a joint: outwards, held by what stands still, nothing in its way."""
    longest = MAX_SLIDE if joint.kind == "prismatic" else MAX_TURN
    if not MIN_SLIDE < joint.limits[1] < longest or outwards(joint, patch) < MIN_OUTWARDS:
        return False
    around_it, hinge = held(joint, patch, scans.still)
    if around_it < MIN_HELD[0] or hinge < MIN_HELD[1]:
        return False
    return min(reaches(joint, patch, scans.room), before_room(joint, patch, scans.first)) > MIN_REACHES


def chosen(candidates: list[FittedPart]) -> list[FittedPart]:
    """Return the candidates that explain what no better one does."""
    before: set[int] = set()
    after: set[int] = set()
    picks = []
    for candidate in candidates:
        new = len(set(candidate.before) - before) / max(1, len(candidate.before))
        new_after = len(set(candidate.after) - after) / max(1, len(candidate.after))
        tilt = float(np.linalg.norm(candidate.fit.deviations[:2]))
        if min(new, new_after) >= MIN_NEW and tilt < MAX_TILT and len(candidate.before) * SPACING**2 > MIN_FRONT / 2:
            picks.append(candidate)
            before |= set(candidate.before)
            after |= set(candidate.after)
    return picks


def thinned(cloud: Cloud, count: int) -> Cloud:
    """Return at most so many samples, evenly."""
    if len(cloud) <= count:
        return cloud
    return cloud[np.linspace(0, len(cloud) - 1, count).astype(int)]


def spacing(cloud: Cloud, count: int) -> float:
    """Return the mean distance of samples after `thinned` [m]."""
    return SPACING * max(1.0, len(cloud) / count) ** 0.5


def region(joint: Joint, patch: Patch, scans: Scans) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices of the samples before around a patch, and of those after around where a joint moves it."""
    back = np.linalg.inv(transform(joint, joint.limits[1]))
    returned = scans.after.points @ back[:3, :3].T + back[:3, 3]
    return np.flatnonzero(near_box(scans.before.points, patch, ROOM)), np.flatnonzero(near_box(returned, patch, ROOM))


def rough(start: Start, patch: Patch, scans: Scans) -> JointFit:
    """Return a fit with few samples, from the best of some shifts along what planes do not fix."""
    indices, after = region(start.joint, patch, scans)
    before, after_cloud = thinned(scans.before[indices], FEW), thinned(scans.after[after], FEW)
    best, most = start.joint, -1.0
    for joint in _shifted(start.joint, patch):
        motion = transform(joint, joint.limits[1])
        worth = explained(before, motion, scans.opened, 0.02).mean()
        worth += explained(after_cloud, np.linalg.inv(motion), scans.closed, 0.02).mean()
        if worth > most:
            best, most = joint, worth
    return fitted(best, patch, scans, indices, after, FEW)


def fitted(joint: Joint, patch: Patch, scans: Scans, before: np.ndarray, after: np.ndarray, count: int) -> JointFit:
    """Return the fit to some samples before and after, by their indices, at most so many of each."""
    clouds = scans.before[before], scans.after[after]
    spacings = spacing(clouds[0], count), spacing(clouds[1], count)
    part, moved = (thinned(cloud, count) for cloud in clouds)
    return fit(joint, part, scans.closed, moved, scans.opened, spacings, patch.normal)


def _shifted(joint: Joint, patch: Patch) -> list[Joint]:
    """Return a joint with its axis shifted along the bisector of its front's two planes, or its end shifted sideways."""
    axis, q = np.array(joint.axis), joint.limits[1]
    if joint.kind == "prismatic":
        u, v = across(axis)
        ends = [q * axis + a * u + b * v for a in LATERAL for b in LATERAL]
        lengths = [float(np.linalg.norm(end)) for end in ends]
        sideways = zip(ends, lengths, strict=True)
        return [replace(joint, axis=tuple(end / length), limits=(0.0, length)) for end, length in sideways]
    bisector = patch.normal + transform(joint, q)[:3, :3] @ patch.normal
    bisector /= max(float(np.linalg.norm(bisector)), 1e-9)
    return [replace(joint, origin=tuple(np.array(joint.origin) + shift * bisector)) for shift in SHIFTS]


def measured(joint_fit: JointFit, patch: Patch, scans: Scans) -> FittedPart:
    """Return a fit with what it explains."""
    before, after = region(joint_fit.joint, patch, scans)
    motion = transform(joint_fit.joint, joint_fit.joint.limits[1])
    ahead = explained(scans.before[before], motion, scans.opened, TIGHT) > 0
    back = explained(scans.after[after], np.linalg.inv(motion), scans.closed, TIGHT) > 0
    members = np.isin(before, np.flatnonzero(near_box(scans.before.points, patch, 0.005)))
    fraction = float(ahead[members].mean()) if members.any() else 0.0
    return FittedPart(joint_fit, patch, before[ahead], after[back], fraction)


def grown(candidate: FittedPart, patches: list[Patch], scans: Scans) -> tuple[FittedPart, Patch]:
    """Return a candidate fitted finely to all patches near its front that its joint explains, and those as one patch."""
    patch = candidate.front
    joint_fit = candidate.fit
    for _ in range(2):
        members, motion = [patch], transform(joint_fit.joint, joint_fit.joint.limits[1])
        for other in patches:
            near = other is not patch and near_box(other.cloud.points, patch, NEXT).mean() > 0.5
            if near and (explained(thinned(other.cloud, FEW), motion, scans.opened, TIGHT) > 0).mean() > MIN_MEMBER:
                members.append(other)
        clouds = [member.cloud for member in members]
        points, normals, faces = (
            np.concatenate([getattr(c, n) for c in clouds]) for n in ("points", "normals", "faces")
        )
        whole = Patch(Cloud(points, normals, faces), patch.normal, patch.centre, sum(m.area for m in members))
        now = measured(joint_fit, whole, scans)
        patch = replace(whole, normal=front_normal(joint_fit.joint, now, patch, scans))
        joint_fit = fitted(joint_fit.joint, patch, scans, now.before, now.after, MANY)
    return measured(joint_fit, patch, scans), patch


def front_normal(joint: Joint, candidate: FittedPart, patch: Patch, scans: Scans) -> np.ndarray:
    """Return the normal of a front in the closed scan's frame as both scans show it, shape [3]."""
    back = np.linalg.inv(transform(joint, joint.limits[1]))
    total = np.zeros(3)
    for cloud in (scans.before[candidate.before], scans.after[candidate.after].moved(back)):
        flat = (np.abs((cloud.points - patch.centre) @ patch.normal) < FLAT) & (cloud.normals @ patch.normal > TILT)
        if flat.sum() > MIN_FRONT / SPACING**2 / 4:
            total += plane(cloud.points[flat], cloud.normals[flat])[0]
    length = float(np.linalg.norm(total))
    return total / length if length > 0 else patch.normal
