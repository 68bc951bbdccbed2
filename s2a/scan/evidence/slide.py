"""Slides: axis, travel and handle against the front and the furniture behind it."""

from __future__ import annotations

import re

import numpy as np

from s2a.scan.evidence.bounds import Bounds
from s2a.scan.evidence.finding import Finding, bounded_above, unknown
from s2a.scan.evidence.front import Front
from s2a.scan.evidence.opening import UP, edge_angle, normal_angle
from s2a.scan.evidence.surface import REACH, ScanSurface
from s2a.scan.evidence.sweep import moved_parts
from s2a.scene.articulation import open_limit
from s2a.scene.scene import Joint

LIFTS = re.compile(r"\b(sash|garage|roller|roll|shutter|blinds?|hatch)\b")
"""Names of what slides up and down."""
DEEP = 0.15
"""[m] What lies less far behind a front is another front or the edge of the furniture, not the wall."""
AHEAD = 0.1
"""[m] Where the rays to the wall begin, before the front: its handle and rim are passed."""
BEHIND = 0.06
"""[m] Free space is looked for this far behind furniture: more than the thickness of its back."""
ABOVE = 2.5
"""[m] The wall behind furniture is looked for up to this height over a front."""


def along_normal(joint: Joint, front: Front) -> bool:
    """Return True for a slide that moves its front forwards, as a drawer does, False for one in its plane."""
    axis = np.array(joint.axis)
    return normal_angle(axis, front) < edge_angle(axis, front)


def slide_axis(part: str, joint: Joint, front: Front, bounds: Bounds) -> Finding:
    """Judge a slide's direction: along the normal of its front, or along an edge of it (a sliding door)."""
    axis = np.array(joint.axis)
    angle = min(normal_angle(axis, front), edge_angle(axis, front))
    message = f"its axis is {angle:.1f} deg off its front's normal and edges"
    remedy = f"possible: up to {bounds.angle:g} deg; take {_text(front.normal)} for a drawer"
    return bounded_above("slide_axis", part, angle, bounds.angle, "deg", message, remedy)


def slide_level(part: str, label: str, joint: Joint, bounds: Bounds) -> Finding:
    """Judge a slide by gravity: what slides stays where it is left, so it slides level, but for shutters and sashes."""
    if LIFTS.search(label.lower()):
        return unknown("slide_level", part, f"a {label} may slide upwards")
    slope = float(np.degrees(np.arcsin(np.clip(abs(np.array(joint.axis) @ UP), 0.0, 1.0))))
    message, remedy = (
        f"it slides at a slope of {slope:.1f} deg",
        f"possible: up to {bounds.slope:g} deg; check the axis",
    )
    return bounded_above("slide_level", part, slope, bounds.slope, "deg", message, remedy, "warn")


def depth_behind(surface: ScanSurface, part: str, front: Front) -> float:
    """Return how deep the space behind a front is at most [m]; NaN where the scan does not tell.

    Furniture against a wall has no scanned back, and often no side: the wall over it, in a column over the front, is as far
    as it reaches, or its own surface where that reaches farther (a niche). Free space behind its own surface ends it too.
    """
    scene, mine = surface.scene, moved_parts(surface.scene, part)
    root = scene.root(part)
    own = [scene.parts[i].mesh.vertices for i in (root, *scene.descendants(root)) if i not in mine]
    depth = max((float((front.offset - points @ front.normal).max()) for points in own if len(points)), default=0.0)
    across = front.axes[:, int(np.argmin(np.abs(UP @ front.axes)))]
    width = float(np.abs(across @ front.axes) @ front.size)
    rear = front.center - (depth + BEHIND) * front.normal
    if depth > DEEP and surface.is_free(rear + np.linspace(-0.3, 0.3, 5)[:, None] * width * across):
        return depth
    start = front.center + np.arange(0.0, ABOVE, 0.05)[:, None] * UP
    way, behind = surface.sight(start + AHEAD * front.normal, -front.normal)
    walls = way[(way > AHEAD + DEEP) & (way < REACH) & ~behind] - AHEAD
    return max(depth, float(walls.max())) if len(walls) else float("nan")


def slide_travel(part: str, joint: Joint, front: Front, surface: ScanSurface, bounds: Bounds) -> Finding:
    """Judge a slide's travel: a drawer's by the depth behind its front, a sliding door's by its own length."""
    travel = abs(open_limit(joint))
    if along_normal(joint, front):
        depth = depth_behind(surface, part, front)
        if not depth > 0:
            return unknown("slide_travel", part, "the scan does not tell how deep its furniture is")
        bound, of = depth + bounds.depth_margin, f"its furniture is {depth:.2f} m deep"
    else:
        length = float(np.abs(np.array(joint.axis) @ front.axes) @ front.size)
        bound, of = bounds.length_margin * length, f"it is {length:.2f} m long"
    message = f"it slides by {travel:.2f} m, and {of}"
    remedy = f"possible: up to {bound:.2f} m; correct rangeMin and rangeMax"
    return bounded_above("slide_travel", part, travel, bound, "m", message, remedy, "warn")


def slide_handle(part: str, joint: Joint, front: Front, grasp: np.ndarray, bounds: Bounds) -> Finding:
    """Judge the kind of a joint by its handle: what is pulled forwards is pulled at its middle, a door at its edge.

    Args:
        part: id of the part.
        joint: its slide.
        front: its front.
        grasp: mean of its grasp region [m], shape [3].
        bounds: `handle_offset`.
    """
    sideways = np.cross(UP, front.normal)
    if not along_normal(joint, front) or np.linalg.norm(sideways) < 0.5:
        return unknown("slide_handle", part, "it is not pulled forwards")
    sideways /= np.linalg.norm(sideways)
    width = float(np.abs(sideways @ front.axes) @ front.size)
    offset = abs(float((grasp - front.center) @ sideways)) / width
    message = f"it slides, but its handle is {offset:.0%} of its width beside its middle, as on a door"
    remedy = f"possible: up to {bounds.handle_offset:.0%}; is it a rotation?"
    return bounded_above("slide_handle", part, offset, bounds.handle_offset, "of the width", message, remedy, "warn")


def _text(direction: np.ndarray) -> str:
    return "(" + ", ".join(f"{x:.3f}" for x in direction) + ")"
