"""The handle of a front: faces that stand out where somebody clicked, or a parametric shape where the mesh has none."""

from typing import Literal

import numpy as np

from s2a.annotate.region import FrontRegion
from s2a.annotate.surface import SplitSurface
from s2a.scene.geometry.mesh_ops import merge, painted
from s2a.scene.geometry.planes import across
from s2a.scene.scene import Joint, Mesh

Shape = Literal["bar", "knob", "lever"]
SHAPES: tuple[Shape, ...] = ("bar", "knob", "lever")
# [m] A handle stands out by more than the first and less than the second: noise, and another piece of furniture
RELIEF, STEPS_OUT = 0.008, 0.09
NOISE = 4.0  # Standard deviations of a front's own faces that a handle exceeds
NEAR = 0.02  # [m] A click this near to faces that stand out means them
MARGIN = 0.03  # [m] A handle may stand over the sides of its front by so much
MIN_AREA, MAX_FRACTION = 2e-4, 0.35  # [m^2] and fraction of the front: smaller is noise, larger is a moulding
# [m] What stands out by less no finger gets behind: a handle that the scan has smeared over its front
GRASPABLE = 0.015
# Cosine with the front's normal below which a face is turned away, and fraction of a handle's area that is. What
# looks ahead all over is a bulge that the scan made of one, on whose sides no finger can press
SIDEWAYS, TURNED = 0.5, 0.1
AROUND = 0.04  # [m] What is this near to a handle tells the height that it stands out from
# [m] Largest height of what a scan made of a handle, and distance in which it lies from where one clicks
MAX_RISE, REACH = 0.03, 0.06
SMEAR = 0.15  # [m] What stands out nearer to a handle that is added is what the scan made of it
CLEARANCE = 0.032  # [m] Between a parametric bar and the front: a finger of the Panda is 0.02 m thick
# [m] Of bars and levers, of their posts, and of knobs. A part is grasped at the mean of its handle's surface: thick
# posts would put that behind the bar, where the fingertips miss it
RADIUS, POST, KNOB = 0.006, 0.0025, 0.016
LENGTH = {"bar": 0.128, "lever": 0.11}  # [m] A usual distance between the screws of a bar; a lever's arm
USUAL: Shape = "bar"  # The shape that a handle most often has which a mesh does not resolve
# [m] A handle's distance from the side that moves most, its middle's from the ends of that side,
# and the height of a hand
INSET, REACH_IN, HAND = 0.05, 0.12, 1.0
SIDES = 10
STEEL = (150, 152, 156)


def find(surface: SplitSurface, region: FrontRegion, point: np.ndarray) -> np.ndarray:
    """Return the faces of the handle at a clicked place; none where the mesh does not resolve it.

    `point`: the place [m], shape [3].
    """
    out = standing_out(surface, region)
    seeds = np.flatnonzero(out & (np.linalg.norm(surface.centroids - point, axis=1) < NEAR))
    if not len(seeds):
        return seeds
    faces = surface.component(seeds, out)
    return faces if resolved(surface, region, faces) and has_sides(surface, region, faces) else faces[:0]


def has_sides(surface: SplitSurface, region: FrontRegion, faces: np.ndarray) -> bool:
    """Return whether a handle's faces do not all look ahead, as those of a bulge do."""
    turned = surface.normals[faces] @ region.normal < SIDEWAYS
    return bool(surface.areas[faces][turned].sum() >= TURNED * surface.areas[faces].sum())


def resolved(surface: SplitSurface, region: FrontRegion, faces: np.ndarray) -> bool:
    """Return whether faces that stand out of a front are a handle that can be grasped, and not what a scan smeared.

    Their height counts from what is around them: a window's handle is on a frame, which itself stands out of the glass.
    """
    if not MIN_AREA < float(surface.areas[faces].sum()) < MAX_FRACTION * float(np.prod(region.size)):
        return False
    top = float(np.quantile(region.local(surface.centroids[faces])[:, 2], 0.95))
    return top - ground(surface, region, faces) > GRASPABLE


def ground(surface: SplitSurface, region: FrontRegion, faces: np.ndarray) -> float:
    """Return the height over a front's plane of what is around some faces [m]; 0 where that is behind it, or nothing."""
    place = region.local(surface.centroids)
    low, high = place[faces, :2].min(axis=0), place[faces, :2].max(axis=0)
    near = ((place[:, :2] > low - AROUND) & (place[:, :2] < high + AROUND)).all(axis=1)
    near &= np.abs(place[:, 2]) < STEPS_OUT
    near[faces] = False
    return max(float(np.median(place[near, 2])), 0.0) if near.any() else 0.0


def standing_out(surface: SplitSurface, region: FrontRegion) -> np.ndarray:
    """Return which faces stand out of a front, over it or a little beside it [face]."""
    place = region.local(surface.centroids)
    within = (np.abs(place[:, :2]) < region.size / 2 + MARGIN).all(axis=1)
    height = place[:, 2]
    own = height[region.faces]
    noise = 1.4826 * float(np.median(np.abs(own - np.median(own)))) if len(own) else 0.0
    return np.asarray(within & (height > max(RELIEF, NOISE * noise)) & (height < STEPS_OUT))


def smeared(surface: SplitSurface, region: FrontRegion, point: np.ndarray) -> np.ndarray:
    """Return the faces of a front that stand out around a place: what a scan made of a handle, which moves with its front."""
    within = (np.abs(region.local(surface.centroids)[:, :2]) < region.size / 2).all(axis=1)
    near = np.linalg.norm(surface.centroids - point, axis=1) < SMEAR
    return np.flatnonzero(standing_out(surface, region) & within & near)


def usual_place(region: FrontRegion, joint: Joint | None) -> np.ndarray:
    """Return the place on a front at which its handle most often is [m], shape [3].

    Drawers have it in their middle. Doors and flaps have it at the side that moves most, doors at the end that is nearer to
    the height of a standing person's hand: the upper end of floor cabinets, the lower end of wall cabinets.
    """
    half = region.size / 2
    place = np.zeros(2)
    inset = np.minimum(INSET, half)
    if joint is not None and joint.kind == "revolute":
        hinge = region.local(np.array([joint.origin]))[0, :2]
        across = int(np.argmin(np.abs(region.axes.T @ np.array(joint.axis))))
        place[across] = -np.sign(hinge[across]) * (half - inset)[across]
        if across == 0:
            place[1] = np.clip(HAND - region.center[2], -(half - REACH_IN)[1].clip(0), (half - REACH_IN)[1].clip(0))
    elif joint is not None and abs(np.array(joint.axis) @ region.normal) < 0.5:
        way = region.axes.T @ np.array(joint.axis)
        place = -np.sign(way) * (np.abs(way) > 0.5) * (half - inset)
    return np.asarray(region.center + region.axes @ place)


def rise(surface: SplitSurface, region: FrontRegion, point: np.ndarray) -> float:
    """Return how high a front rises around a place [m]: what a scan made of a handle that it did not resolve."""
    place = region.local(surface.centroids[region.faces])
    near = np.linalg.norm(place[:, :2] - region.local(point[None])[0, :2], axis=1) < REACH
    return float(np.clip(np.quantile(place[near, 2], 0.95), 0.0, MAX_RISE)) if near.any() else 0.0


def shape(kind: Shape, region: FrontRegion, point: np.ndarray, joint: Joint | None, height: float = 0.0) -> Mesh:
    """Return a parametric handle before a front.

    A bar lies level on what slides and along the hinge on what turns; a lever points towards the hinge.

    Args:
        kind: what it is.
        region: the front.
        point: where it is [m], shape [3].
        joint: the front's joint, if it is known.
        height: of the front's surface there over its plane [m], before which a finger needs its clearance.
    """
    foot = point - float((point - region.center) @ region.normal) * region.normal
    out = height + CLEARANCE + RADIUS
    if kind == "knob":
        neck = _rod(foot, foot + out * region.normal, RADIUS)
        return painted(
            merge([neck, _rod(foot + (out - 0.02) * region.normal, foot + (out - 0.004) * region.normal, KNOB)]), STEEL
        )
    top = foot + out * region.normal
    if kind == "lever":
        arm = _towards_hinge(region, foot, joint) * LENGTH["lever"]
        return painted(merge([_rod(foot, top, POST), _rod(top, top + arm, RADIUS)]), STEEL)
    half = _along(region, joint)
    posts = [_rod(foot + sign * 0.85 * half, foot + sign * 0.85 * half + out * region.normal, POST) for sign in (-1, 1)]
    return painted(merge([_rod(top - half, top + half, RADIUS), *posts]), STEEL)


def _along(region: FrontRegion, joint: Joint | None) -> np.ndarray:
    """Return half of a bar [m], shape [3]: no longer than its front is."""
    turns = joint is not None and joint.kind == "revolute"
    k = int(np.argmax(np.abs(np.array(joint.axis) @ region.axes))) if turns and joint else 0
    return np.asarray(region.axes[:, k] * min(LENGTH["bar"], 0.8 * float(region.size[k])) / 2)


def _towards_hinge(region: FrontRegion, foot: np.ndarray, joint: Joint | None) -> np.ndarray:
    """Return the direction of a lever: level, towards the hinge, or else towards the middle."""
    goal = np.array(joint.origin) if joint is not None and joint.kind == "revolute" else region.center
    return np.asarray(region.axes[:, 0] * (1.0 if (goal - foot) @ region.axes[:, 0] >= 0 else -1.0))


def _rod(start: np.ndarray, end: np.ndarray, radius: float) -> Mesh:
    """Return a closed rod between two points [m], faces outwards."""
    along = (end - start) / np.linalg.norm(end - start)
    x, y = across(along)
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    ring = radius * (np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y)
    i = np.arange(SIDES)
    j = (i + 1) % SIDES
    walls = [np.stack([i, j, j + SIDES], axis=1), np.stack([i, j + SIDES, i + SIDES], axis=1)]
    caps = [
        np.stack([j, i, 0 * i + 2 * SIDES], axis=1),
        np.stack([i + SIDES, j + SIDES, 0 * i + 2 * SIDES + 1], axis=1),
    ]
    return Mesh(np.concatenate([start + ring, end + ring, [start, end]]), np.concatenate(walls + caps))
