"""Joints against the surface: the opening direction, slides, hinges, and the kind of a joint against the name of its part."""

import re

import numpy as np

from s2a.core.check import Check, at_least, at_most
from s2a.scan.evidence import Bounds
from s2a.scan.evidence.front import Front
from s2a.scan.evidence.surface import REACH, ScanSurface, moved_parts
from s2a.scene.articulation import open_limit, opening_direction
from s2a.scene.scene import Joint

CHECK = "opens_outward"
# Fraction of a joint's range on the lesser side of zero from which the part was scanned ajar: both ways are open
AJAR = 0.1


def outward_cosine(joint: Joint, front: Front) -> float:
    """Return the cosine between the first motion of a front's middle and its outward side: 1 out of the furniture, -1 into it."""
    return float(opening_direction(joint, front.center) @ front.normal)


def opens_outward(part: str, joint: Joint, front: Front, bounds: Bounds) -> Check:
    """Judge the opening direction of a slide or hinge by the outward side of its front.

    Unknown where the part was scanned ajar, where the witnesses of the outward side disagree, and where the front moves in
    its own plane.
    """
    votes = front.votes
    for_, against = sum(v > 0 for v in votes.values()), sum(v < 0 for v in votes.values())
    if for_ <= against:
        return Check(CHECK, "skipped", part=part, message="the scan does not tell the front's outward side")
    lower, upper = (abs(limit) for limit in joint.limits)
    if joint.limits[0] < 0.0 < joint.limits[1] and min(lower, upper) > AJAR * max(lower, upper):
        return Check(CHECK, "skipped", part=part, message="scanned ajar, it moves both ways")
    cosine = outward_cosine(joint, front)
    if abs(cosine) < bounds.outward:
        return Check(CHECK, "skipped", part=part, message=f"its front moves in its own plane (cosine {cosine:.2f})")
    verb = "slides" if joint.kind == "prismatic" else "turns"
    into = "out of" if cosine > 0 else "into"
    message = f"{verb} {into} the furniture: cosine {cosine:.2f} with the side of its front {witnesses(front)}"
    remedy = f"possible: {bounds.outward:g} to 1; negate the axis"
    return at_least(CHECK, cosine, bounds.outward, part=part, message=message, remedy=remedy)


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


# A front counts as round whose outline fills less of its rectangle (a disc fills pi / 4, one with ragged corners 0.92)
ROUND = 0.87
UP = np.array([0.0, 0.0, 1.0])
UPRIGHT = 0.7  # Cosine between a front's normal and the vertical up to which the front stands rather than lies

LIFTS = re.compile(r"\b(sash|garage|roller|roll|shutter|blinds?|hatch)\b")  # Names of what slides up and down
DEEP = 0.15  # [m] What lies less far behind a front is another front or the edge of the furniture, not the wall
AHEAD = 0.1  # [m] Where the rays to the wall begin, before the front: its handle and rim are passed
BEHIND = 0.06  # [m] Free space is looked for this far behind furniture: more than the thickness of its back
ABOVE = 2.5  # [m] The wall behind furniture is looked for up to this height over a front


def along_normal(joint: Joint, front: Front) -> bool:
    """Return True for a slide that moves its front forwards, as a drawer does, False for one in its plane."""
    axis = np.array(joint.axis)
    return normal_angle(axis, front) < edge_angle(axis, front)


def slide_axis(part: str, joint: Joint, front: Front, bounds: Bounds) -> Check:
    """Judge a slide's direction: along the normal of its front, or along an edge of it (a sliding door)."""
    axis = np.array(joint.axis)
    angle = min(normal_angle(axis, front), edge_angle(axis, front))
    message = f"its axis is {angle:.1f} deg off its front's normal and edges"
    remedy = f"possible: up to {bounds.angle:g} deg; take ({', '.join(f'{x:.3f}' for x in front.normal)}) for a drawer"
    return at_most("slide_axis", angle, bounds.angle, "deg", part=part, message=message, remedy=remedy)


def slide_level(part: str, label: str, joint: Joint, bounds: Bounds) -> Check:
    """Judge a slide by gravity: what slides stays where it is left, so it slides level, but for shutters and sashes."""
    if LIFTS.search(label.lower()):
        return Check("slide_level", "skipped", part=part, message=f"a {label} may slide upwards")
    slope = float(np.degrees(np.arcsin(np.clip(abs(np.array(joint.axis) @ UP), 0.0, 1.0))))
    message, remedy = (
        f"it slides at a slope of {slope:.1f} deg",
        f"possible: up to {bounds.slope:g} deg; check the axis",
    )
    return at_most(
        "slide_level", slope, bounds.slope, "deg", part=part, message=message, remedy=remedy, otherwise="warn"
    )


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


def slide_travel(part: str, joint: Joint, front: Front, surface: ScanSurface, bounds: Bounds) -> Check:
    """Judge a slide's travel: a drawer's by the depth behind its front, a sliding door's by its own length."""
    travel = abs(open_limit(joint))
    if along_normal(joint, front):
        depth = depth_behind(surface, part, front)
        if not depth > 0:
            return Check(
                "slide_travel", "skipped", part=part, message="the scan does not tell how deep its furniture is"
            )
        bound, of = depth + bounds.depth_margin, f"its furniture is {depth:.2f} m deep"
    else:
        length = float(np.abs(np.array(joint.axis) @ front.axes) @ front.size)
        bound, of = bounds.length_margin * length, f"it is {length:.2f} m long"
    message = f"it slides by {travel:.2f} m, and {of}"
    remedy = f"possible: up to {bound:.2f} m; correct rangeMin and rangeMax"
    return at_most("slide_travel", travel, bound, "m", part=part, message=message, remedy=remedy, otherwise="warn")


def slide_handle(part: str, joint: Joint, front: Front, grasp: np.ndarray, bounds: Bounds) -> Check:
    """Judge the kind of a joint by its handle: what is pulled forwards is pulled at its middle, a door at its edge.

    `grasp`: mean of its grasp region [m], shape [3].
    """
    sideways = np.cross(UP, front.normal)
    if not along_normal(joint, front) or np.linalg.norm(sideways) < 0.5:
        return Check("slide_handle", "skipped", part=part, message="it is not pulled forwards")
    sideways /= np.linalg.norm(sideways)
    width = float(np.abs(sideways @ front.axes) @ front.size)
    offset = abs(float((grasp - front.center) @ sideways)) / width
    message = f"it slides, but its handle is {offset:.0%} of its width off its centre, as on a door"
    remedy = f"possible: up to {bounds.handle_offset:.0%}; is it a rotation?"
    return at_most(
        "slide_handle",
        offset,
        bounds.handle_offset,
        "of the width",
        part=part,
        message=message,
        remedy=remedy,
        otherwise="warn",
    )


SLIDES = re.compile(r"\bdrawers?\b")  # Names of parts that slide
# Names of parts that turn about an edge, or slide along it, and are never pulled forwards
TURNS = re.compile(r"\b(doors?|windows?|lids?|flaps?|gates?|mirrors?)\b")


def kind(part: str, label: str, joint: Joint, front: Front, bounds: Bounds) -> Check:
    """Judge the kind of a joint by the part's label: drawers slide forwards; doors, windows and lids do not."""
    name = label.lower()
    forwards = joint.kind == "prismatic" and along_normal(joint, front)
    upwards = joint.kind == "prismatic" and not forwards and abs(joint.axis[2]) > 0.7 and abs(front.normal[2]) < 0.7
    if SLIDES.search(name):
        wrong, usual = not forwards, "slides"
        does = "turns" if joint.kind == "revolute" else "moves in its front's plane"
    elif TURNS.search(name) and not LIFTS.search(name):
        wrong, does = forwards or upwards, "slides forwards" if forwards else "slides upwards"
        usual = "turns about an edge"
    else:
        return Check("kind", "skipped", part=part, message="its name does not tell how it moves")
    if joint.kind == "revolute" and normal_angle(np.array(joint.axis), front) < bounds.angle and TURNS.search(name):
        wrong, does = True, "turns in its own plane"
    if not wrong:
        return Check("kind", "pass", part=part, message=f"it moves as a {label} does")
    remedy = f"possible: a {label} {usual}; check type and axis, or the label"
    return Check("kind", "warn", part=part, message=f"it is called {label!r} and {does}", remedy=remedy)


def across(joint: Joint, front: Front) -> np.ndarray | None:
    """Return the unit direction in a front's plane across a hinge, shape [3]; None for a hinge along the normal."""
    sideways = np.cross(joint.axis, front.normal)
    length = float(np.linalg.norm(sideways))
    return sideways / length if length > 0.3 else None


def edge_distance(joint: Joint, front: Front, points: np.ndarray) -> tuple[float, float]:
    """Return the distance of a hinge line from the nearer edge of its part, and the part's breadth across it [m].

    `points`: vertices of the part [m], shape [point 3].

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


def hinge_edge(part: str, joint: Joint, front: Front, points: np.ndarray, bounds: Bounds) -> Check:
    """Judge the distance of a hinge line from the edge of its part, relative to the part's size."""
    distance, breadth = edge_distance(joint, front, points)
    if not distance >= 0:
        return Check("hinge_edge", "skipped", part=part, message="it turns in its own plane")
    bound = min(bounds.edge, bounds.edge_fraction * breadth)
    message = f"its hinge is {1000 * distance:.0f} mm off its nearest edge, and it is {1000 * breadth:.0f} mm broad"
    remedy = f"possible: up to {1000 * bound:.0f} mm; put the origin on the edge that stays"
    return at_most("hinge_edge", distance, bound, "m", part=part, message=message, remedy=remedy)


def hinge_parallel(part: str, joint: Joint, front: Front, bounds: Bounds) -> Check:
    """Judge a hinge's direction: along an edge of its part; in its plane, if the part is round."""
    angle = edge_angle(np.array(joint.axis), front)
    message = f"its hinge is {angle:.1f} deg off the nearest edge of its part"
    remedy = f"possible: up to {bounds.angle:g} deg; turn the axis, or is it a translation?"
    return at_most("hinge_parallel", angle, bounds.angle, "deg", part=part, message=message, remedy=remedy)


def hinge_handle(part: str, joint: Joint, front: Front, points: np.ndarray, grasp: np.ndarray, bounds: Bounds) -> Check:
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
        return Check("hinge_handle", "skipped", part=part, message="it turns in its own plane")
    away = np.abs(np.quantile(points @ sideways, [0.002, 0.998]) - np.array(joint.origin) @ sideways).max()
    fraction = abs(float((grasp - np.array(joint.origin)) @ sideways)) / float(away)
    message = f"its handle is {fraction:.0%} of its breadth away from the hinge"
    remedy = f"possible: from {bounds.handle_distance:.0%}; is the hinge at the opposite edge, or is it a drawer?"
    return at_least(
        "hinge_handle",
        fraction,
        bounds.handle_distance,
        "of the breadth",
        part=part,
        message=message,
        remedy=remedy,
        otherwise="warn",
    )


def hinge_range(part: str, joint: Joint, bounds: Bounds) -> Check:
    """Judge how far a hinge turns."""
    angle = abs(open_limit(joint))
    message = f"it turns by {angle:.2f} rad ({np.degrees(angle):.0f} deg)"
    remedy = f"possible: up to {bounds.max_angle:g} rad; correct rangeMin and rangeMax, in radians"
    return at_most(
        "hinge_range", angle, bounds.max_angle, "rad", part=part, message=message, remedy=remedy, otherwise="warn"
    )
