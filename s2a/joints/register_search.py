"""The search among candidate joints: each is fitted roughly; the one that explains most surface comes first."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from s2a.joints.register_check import before_room, held, left, near_box, on_floor, outwards, reaches
from s2a.joints.register_fit import (
    ALIKE,
    MAX_SLIDE,
    MAX_TURN,
    MIN_FRONT,
    MIN_SLIDE,
    JointFit,
    Start,
    across,
    fit,
    front_of,
)
from s2a.joints.register_surface import FLAT, SPACING, TILT, Cloud, OrientedMesh, Patch, match, plane
from s2a.scene.articulation import transform
from s2a.scene.scene import Joint

MIN_OUTWARDS = 0.5
"""Mean cosine between the front's normal and its first motion, at least: parts open towards whoever stands before them."""
MIN_HELD = (0.4, 0.6)
"""Fraction of a front's border, and of a hinge, that has something near that stands still."""
MIN_REACHES = 0.5
"""Fraction of a slide's front before whose old place nothing is nearer than where it slid to; of a front that has room behind."""
MAX_TILT = 0.01
"""[rad] Standard deviation of an axis' direction beyond which nothing is proposed."""
ROOM = 0.1
"""[m] What belongs to a part lies so near to its front: handles."""
TIGHT = 0.008
"""[m] Surface that is explained lies so near."""
SHIFTS = np.arange(-0.04, 0.0401, 0.005)
"""[m] Shifts of a hinge's axis towards and from the front that are tried, since planes alone do not fix it."""
LATERAL = np.arange(-0.015, 0.0151, 0.005)
"""[m] Sideways errors of a slide's end that are tried."""
NEXT = 0.15
"""[m] Patches of one part are not farther from each other."""
MIN_MEMBER = 0.5
"""Fraction of a patch that a joint explains if it belongs to the part."""
FEW, MANY = 800, 8000
"""Samples for a rough and for a fine fit."""
MIN_NEW = 0.5
"""Fraction of what a joint explains that no better one has explained."""
MIN_EXPLAINED = 0.45
"""Fraction of the changed surface around a front that its joint explains."""


@dataclass(frozen=True, eq=False)
class Scans:
    """Both scans in the closed one's frame, and what changed.

    Attributes:
        closed: surface that only the closed scan shows.
        opened: surface that only the open scan shows.
        still: what both show.
        first: the whole closed scan.
        room: the whole open scan.
        before: samples of `closed`.
        after: samples of `opened`.
    """

    closed: OrientedMesh
    opened: OrientedMesh
    still: OrientedMesh
    first: OrientedMesh
    room: OrientedMesh
    before: Cloud
    after: Cloud


@dataclass(frozen=True, eq=False)
class FittedPart:
    """A joint with what it explains.

    Attributes:
        fit: the joint.
        front: its front.
        before: indices of the samples before that it explains.
        after: indices of the samples after that it explains.
        fraction: of the changed surface around its front that it explains.
    """

    fit: JointFit
    front: Patch
    before: np.ndarray
    after: np.ndarray
    fraction: float

    @property
    def area(self) -> float:
        """Explained surface of both scans [m^2]."""
        return (len(self.before) + len(self.after)) * SPACING**2


def candidates(found: list[Start], patches: list[Patch], scans: Scans) -> list[FittedPart]:
    """Return the joints that open outwards, are held by what stands still, and fit, the most surface first."""
    kept = []
    floor = {index for index in {start.patch for start in found} if on_floor(patches[index], scans.still)}
    for start in found:
        if start.patch in floor:
            continue
        patch = front_of(start, patches[start.patch], scans.opened)
        if not possible(start.joint, patch, scans) or not left(start.joint, patch, scans.room):
            continue
        candidate = measured(rough(start, patch, scans), patch, scans)
        if candidate.fraction > MIN_EXPLAINED and possible(candidate.fit.joint, patch, scans):
            kept.append(candidate)
    return sorted(kept, key=lambda candidate: -candidate.area)


def possible(joint: Joint, patch: Patch, scans: Scans) -> bool:
    """Return whether a front could open by a joint: outwards, held by what stands still, nothing in its way."""
    longest = MAX_SLIDE if joint.kind == "prismatic" else MAX_TURN
    if not MIN_SLIDE < joint.limits[1] < longest or outwards(joint, patch) < MIN_OUTWARDS:
        return False
    around_it, hinge = held(joint, patch, scans.still)
    if around_it < MIN_HELD[0] or hinge < MIN_HELD[1]:
        return False
    return min(reaches(joint, patch, scans.room), before_room(joint, patch, scans.first)) > MIN_REACHES


def chosen(found: list[FittedPart]) -> list[FittedPart]:
    """Return the candidates that explain what no better one does."""
    before: set[int] = set()
    after: set[int] = set()
    kept = []
    for candidate in found:
        new = len(set(candidate.before) - before) / max(1, len(candidate.before))
        new_after = len(set(candidate.after) - after) / max(1, len(candidate.after))
        tilt = float(np.linalg.norm(candidate.fit.deviations[:2]))
        if min(new, new_after) >= MIN_NEW and tilt < MAX_TILT and len(candidate.before) * SPACING**2 > MIN_FRONT / 2:
            kept.append(candidate)
            before |= set(candidate.before)
            after |= set(candidate.after)
    return kept


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
        worth = _worth(joint, before, scans.opened, 0.02).mean() + _worth_back(joint, after_cloud, scans, 0.02).mean()
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
        found = zip(ends, lengths, strict=True)
        return [replace(joint, axis=tuple(end / length), limits=(0.0, length)) for end, length in found]
    bisector = patch.normal + transform(joint, q)[:3, :3] @ patch.normal
    bisector /= max(float(np.linalg.norm(bisector)), 1e-9)
    return [replace(joint, origin=tuple(np.array(joint.origin) + shift * bisector)) for shift in SHIFTS]


def _worth(joint: Joint, before: Cloud, opened: OrientedMesh, reach: float) -> np.ndarray:
    """Return how well each sample is explained, 0 to 1, shape [sample]."""
    found = match(before.moved(transform(joint, joint.limits[1])), opened, reach)
    return np.where(found.alike > ALIKE, 1.0 - (np.minimum(found.gap, reach) / reach) ** 2, 0.0)


def _worth_back(joint: Joint, after: Cloud, scans: Scans, reach: float) -> np.ndarray:
    found = match(after.moved(np.linalg.inv(transform(joint, joint.limits[1]))), scans.closed, reach)
    return np.where(found.alike > ALIKE, 1.0 - (np.minimum(found.gap, reach) / reach) ** 2, 0.0)


def measured(found: JointFit, patch: Patch, scans: Scans) -> FittedPart:
    """Return a fit with what it explains."""
    before, after = region(found.joint, patch, scans)
    explained = _worth(found.joint, scans.before[before], scans.opened, TIGHT) > 0
    returned = _worth_back(found.joint, scans.after[after], scans, TIGHT) > 0
    members = np.isin(before, np.flatnonzero(near_box(scans.before.points, patch, 0.005)))
    fraction = float(explained[members].mean()) if members.any() else 0.0
    return FittedPart(found, patch, before[explained], after[returned], fraction)


def grown(candidate: FittedPart, patches: list[Patch], scans: Scans) -> tuple[FittedPart, Patch]:
    """Return a candidate fitted finely to all patches near its front that its joint explains, and those as one patch."""
    patch = candidate.front
    found = candidate.fit
    for _ in range(2):
        members = [patch]
        for other in patches:
            near = other is not patch and near_box(other.cloud.points, patch, NEXT).mean() > 0.5
            if near and (_worth(found.joint, thinned(other.cloud, FEW), scans.opened, TIGHT) > 0).mean() > MIN_MEMBER:
                members.append(other)
        clouds = [member.cloud for member in members]
        points, normals, faces = (
            np.concatenate([getattr(c, n) for c in clouds]) for n in ("points", "normals", "faces")
        )
        whole = Patch(Cloud(points, normals, faces), patch.normal, patch.centre, sum(m.area for m in members))
        now = measured(found, whole, scans)
        patch = replace(whole, normal=front_normal(found.joint, now, patch, scans))
        found = fitted(found.joint, patch, scans, now.before, now.after, MANY)
    return measured(found, patch, scans), patch


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
