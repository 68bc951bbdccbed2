"""Hinges: line, direction and range against the part that turns, its handle, and its furniture."""

from __future__ import annotations

import numpy as np

from s2a.scan.evidence.bounds import Bounds
from s2a.scan.evidence.finding import Finding, bounded_above, bounded_below, unknown
from s2a.scan.evidence.front import Front
from s2a.scan.evidence.opening import edge_angle
from s2a.scene.articulation import open_limit
from s2a.scene.scene import Joint


def across(joint: Joint, front: Front) -> np.ndarray | None:
    """Return the unit direction in a front's plane across a hinge, shape [3]; None for a hinge along the normal."""
    sideways = np.cross(joint.axis, front.normal)
    length = float(np.linalg.norm(sideways))
    return sideways / length if length > 0.3 else None


def edge_distance(joint: Joint, front: Front, points: np.ndarray) -> tuple[float, float]:
    """Return the distance of a hinge line from the nearer edge of its part, and the part's breadth across it [m].

    Args:
        joint: a hinge.
        front: the front of its part.
        points: vertices of the part [m], shape [point 3].

    Returns:
        Two NaN for a hinge along the front's normal, which has no edge.
    """
    sideways = across(joint, front)
    if sideways is None:
        return float("nan"), float("nan")
    along = points @ sideways
    low, high = np.quantile(along, [0.002, 0.998])
    origin = np.array(joint.origin)
    middle = (points - origin) @ np.array(joint.axis)
    # Where the line passes the part's middle: an oblique line is near its part at one end only.
    on_line = origin + float(np.median(middle)) * np.array(joint.axis)
    beside = min(abs(on_line @ sideways - low), abs(on_line @ sideways - high))
    height = float(on_line @ front.normal - front.offset)
    over = max(0.0, height, -height - front.thickness)
    return float(np.hypot(beside, over)), float(high - low)


def hinge_edge(part: str, joint: Joint, front: Front, points: np.ndarray, bounds: Bounds) -> Finding:
    """Judge the distance of a hinge line from the edge of its part, relative to the part's size."""
    distance, breadth = edge_distance(joint, front, points)
    if not distance >= 0:
        return unknown("hinge_edge", part, "it turns in its own plane")
    bound = min(bounds.edge, bounds.edge_fraction * breadth)
    message = f"its hinge is {1000 * distance:.0f} mm off its nearest edge, and it is {1000 * breadth:.0f} mm broad"
    remedy = f"possible: up to {1000 * bound:.0f} mm; put the origin on the edge that stays"
    return bounded_above("hinge_edge", part, distance, bound, "m", message, remedy)


def hinge_parallel(part: str, joint: Joint, front: Front, bounds: Bounds) -> Finding:
    """Judge a hinge's direction: along an edge of its part; in its plane, if the part is round."""
    angle = edge_angle(np.array(joint.axis), front)
    message = f"its hinge is {angle:.1f} deg off the nearest edge of its part"
    remedy = f"possible: up to {bounds.angle:g} deg; turn the axis, or is it a translation?"
    return bounded_above("hinge_parallel", part, angle, bounds.angle, "deg", message, remedy)


def hinge_handle(
    part: str, joint: Joint, front: Front, points: np.ndarray, grasp: np.ndarray, bounds: Bounds
) -> Finding:
    """Judge on which edge a hinge lies: far from the handle, for the sake of its lever arm.

    Args:
        part: id of the part.
        joint: its hinge.
        front: its front.
        points: vertices of the part [m], shape [point 3].
        grasp: mean of its grasp region [m], shape [3].
        bounds: `handle_distance`.
    """
    sideways = across(joint, front)
    if sideways is None:
        return unknown("hinge_handle", part, "it turns in its own plane")
    away = np.abs(np.quantile(points @ sideways, [0.002, 0.998]) - np.array(joint.origin) @ sideways).max()
    fraction = abs(float((grasp - np.array(joint.origin)) @ sideways)) / float(away)
    message = f"its handle is {fraction:.0%} of its breadth away from the hinge"
    remedy = f"possible: from {bounds.handle_distance:.0%}; is the hinge at the opposite edge, or is it a drawer?"
    return bounded_below(
        "hinge_handle", part, fraction, bounds.handle_distance, "of the breadth", message, remedy, "warn"
    )


def hinge_range(part: str, joint: Joint, bounds: Bounds) -> Finding:
    """Judge how far a hinge turns."""
    angle = abs(open_limit(joint))
    message = f"it turns by {angle:.2f} rad ({np.degrees(angle):.0f} deg)"
    remedy = f"possible: up to {bounds.max_angle:g} rad; correct rangeMin and rangeMax, in radians"
    return bounded_above("hinge_range", part, angle, bounds.max_angle, "rad", message, remedy, "warn")
