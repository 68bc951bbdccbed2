"""The direction in which a part opens, against the side from which its front was scanned."""

from __future__ import annotations

import numpy as np

from s2a.scan.evidence.bounds import Bounds
from s2a.scan.evidence.finding import Finding, bounded_below, unknown
from s2a.scan.evidence.front import Front
from s2a.scene.articulation import opening_direction
from s2a.scene.scene import Joint

CHECK = "opens_outward"
AJAR = 0.1
"""Fraction of a joint's range on the lesser side of zero from which the part was scanned ajar: both ways are open."""


def outward_cosine(joint: Joint, front: Front) -> float:
    """Return the cosine between the first motion of a front's middle and its outward side: 1 out of the furniture, -1 into it."""
    return float(opening_direction(joint, front.center) @ front.normal)


def opens_outward(part: str, joint: Joint, front: Front, bounds: Bounds) -> Finding:
    """Judge the opening direction of a slide or hinge by the outward side of its front.

    Unknown where the part was scanned ajar, where the witnesses of the outward side disagree, and where the front moves in
    its own plane.
    """
    votes = front.votes
    for_, against = sum(v > 0 for v in votes.values()), sum(v < 0 for v in votes.values())
    if for_ <= against:
        return unknown(CHECK, part, "the scan does not tell the front's outward side")
    lower, upper = (abs(limit) for limit in joint.limits)
    if joint.limits[0] < 0.0 < joint.limits[1] and min(lower, upper) > AJAR * max(lower, upper):
        return unknown(CHECK, part, "scanned ajar, it moves both ways")
    cosine = outward_cosine(joint, front)
    if abs(cosine) < bounds.outward:
        return unknown(CHECK, part, f"its front moves in its own plane (cosine {cosine:.2f})")
    verb = "slides" if joint.kind == "prismatic" else "turns"
    into = "out of" if cosine > 0 else "into"
    message = f"{verb} {into} the furniture: cosine {cosine:.2f} with the side of its front {witnesses(front)}"
    remedy = f"possible: {bounds.outward:g} to 1; negate the axis"
    return bounded_below(CHECK, part, cosine, bounds.outward, "", message, remedy)


def witnesses(front: Front) -> str:
    """Return in words what tells the outward side of a front."""
    words = {
        "seen": f"seen from the room ({front.seen:+.2f})",
        "facing": f"to which its faces look ({front.facing:+.2f})",
        "relief": f"on which the handle stands out by {1000 * front.relief:.0f} mm",
    }
    return ", ".join(words[name] for name, value in front.votes.items() if value > 0)


def normal_angle(axis: np.ndarray, front: Front) -> float:
    """Return the angle between an axis and a front's normal, either way [deg]."""
    return float(np.degrees(np.arccos(np.clip(abs(axis @ front.normal), 0.0, 1.0))))


def edge_angle(axis: np.ndarray, front: Front) -> float:
    """Return the angle between an axis and the nearer side of a front's rectangle [deg].

    A rectangle around a disc has no direction. Gravity gives a round front one, unless it lies level: its hinge is plumb or
    level, or it would swing by itself. Of a round lid only its plane counts.
    """
    if front.fill >= ROUND:
        return _angle(axis, front.axes)
    if abs(front.normal @ UP) > UPRIGHT:
        return 90.0 - normal_angle(axis, front)
    level = np.cross(UP, front.normal) / np.linalg.norm(np.cross(UP, front.normal))
    return _angle(axis, np.stack([level, np.cross(front.normal, level)], axis=1))


def _angle(axis: np.ndarray, directions: np.ndarray) -> float:
    """Return the angle between an axis and the nearest of some unit directions, shape [3 direction], either way [deg]."""
    return float(np.degrees(np.arccos(np.clip(np.abs(axis @ directions).max(), 0.0, 1.0))))


ROUND = 0.87
"""A front counts as round whose outline fills less of its rectangle (a disc fills pi / 4, one with ragged corners 0.92)."""
UP = np.array([0.0, 0.0, 1.0])
UPRIGHT = 0.7
"""Cosine between a front's normal and the vertical up to which the front stands rather than lies."""
