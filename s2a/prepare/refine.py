"""Joints improved from one scan, by gradient: what fronts, furniture and paths say, with a prior at the annotation.

All joints of a room are refined together, for they tell of one another: fronts of one piece of furniture are parallel, and how
far the annotations of a room lie from what its fronts say tells how far to trust them (the prior's width).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from s2a.prepare.refine_loss import TILT, ZERO, RefineConfig
from s2a.prepare.refine_room import JointedRoom, RoomFit, closed, fit, joints_of, loss_of, prior_sigma, priors
from s2a.scene.articulation import opening_sign
from s2a.scene.scene import Joint, Scene
from s2a.scene.usd.joints import Refinement

STEPS = 50  # Fractions of a move that are tried
# Where the true axis may be, in standard deviations of two directions, shape [place 2];
# evenly spread (Roberts' R2 sequence)
PRIOR_PLACES = norm.ppf((0.5 + np.outer(np.arange(4096), (0.7548776662, 0.5698402910))) % 1.0)


def dared(move: np.ndarray, sigma: np.ndarray, worse: float, regret: float) -> float:
    """Return the fraction of a move of an axis that costs least: what is left of the way, squared, and the risk of harm.

    Args:
        move: from the annotation to the best guess, across the axis in two directions [rad], shape [2].
        sigma: standard deviations of the true axis around the best guess [rad], shape [2].
        worse: the axis may get farther from the true one by this [rad].
        regret: getting farther by more counts as much as being off by this [rad].
    """
    true, fractions = move + sigma * PRIOR_PLACES, np.linspace(1.0, 0.0, STEPS + 1)
    bound = np.linalg.norm(true, axis=1) + worse
    harm = np.array([(np.linalg.norm(true - part * move, axis=1) > bound).mean() for part in fractions])
    return float(fractions[np.argmin((1.0 - fractions) ** 2 * (move @ move) + regret**2 * harm)])


ENOUGH = 6  # Known directions from which a room tells its annotator's errors
# [rad] Smallest and largest standard deviation that an annotator is taken to have
CAREFUL, HASTY = math.radians(0.15), math.radians(3.0)
TILTS = ("axis in the front's plane", "axis out of the front's plane")
LEVELS = ("axis sideways", "axis up and down")
# Names of the parameters: of an axis in a front's plane, of another, and of a hinge line
PLACES = ("line in the front's plane", "line's depth")


@dataclass(frozen=True)
class Refined:
    """A joint as refined."""

    joint: Joint  # as it is now
    change: Refinement  # how far that is from the annotation, and how sure
    before: float  # its share of the loss as annotated
    after: float  # the same as refined; never more


def refine(scene: Scene, config: RefineConfig) -> dict[str, Refined]:
    """Return every joint of a scene as its scan improves it, by the part's id.

    `scene`: as read from a scan or a geometric stage: no surface trimmed.
    """
    if not scene.movable:
        return {}
    room = joints_of(scene, config)
    wide = room.free
    wide[:, ZERO] = False
    axis = annotator(fit(room, HASTY, wide, config), wide, config)
    first = fit(room, axis, room.free, config)
    determined = room.free & (first.sigma < config.known * prior_sigma(room, axis, config))
    determined[:, ZERO] &= np.abs(first.values[:, ZERO]) > config.sure * first.sigma[:, ZERO]
    determined[:, ZERO] &= first.values[:, ZERO] * [opening_sign(joint) for joint in room.joints] < 0.0
    return _results(room, fit(room, axis, determined, config), determined, axis, config)


def with_joints(scene: Scene, refined: Mapping[str, Refined]) -> Scene:
    """Return a scene with refined joints instead of its own."""
    parts = {i: replace(part, motion=refined[i].joint) if i in refined else part for i, part in scene.parts.items()}
    return replace(scene, parts=parts)


def annotator(solution: RoomFit, free: np.ndarray, config: RefineConfig) -> float:
    """Return an annotator's standard deviation of axes [rad], from how far known directions lie from the annotation.

    Args:
        solution: parameters with next to no prior.
        free: which of them were sought, shape [joint 5].
        config: what holds where a room has too few joints to tell.
    """
    measured = free[:, TILT] & (solution.sigma[:, TILT] < config.axis / 2)
    if measured.sum() < ENOUGH:
        return config.axis
    moved, blur = solution.values[:, TILT][measured], solution.sigma[:, TILT][measured]
    typical = (float(np.median(np.abs(moved))) / 0.6745) ** 2 - float(np.median(blur)) ** 2
    return float(np.clip(math.sqrt(max(0.0, typical)), CAREFUL, HASTY))


def _results(
    room: JointedRoom, solution: RoomFit, determined: np.ndarray, axis: float, config: RefineConfig
) -> dict[str, Refined]:
    """Return the refined joints; one that came out worse by its own loss is as annotated."""
    terms, prior = priors(room, axis, config), prior_sigma(room, axis, config)
    results = {}
    for i, part in enumerate(room.parts):
        values, measured = solution.values.copy(), determined[i]
        values[i], away = _cautious(values[i], np.where(measured, solution.sigma[i], prior[i]), config)
        moved = values[i].copy()
        after = loss_of(room, i, values, solution.turns, terms)
        values[i] = 0.0
        before = loss_of(room, i, values, solution.turns, terms)
        improved = after <= before
        if not improved:
            measured = np.zeros_like(measured)
            moved, away = values[i], np.zeros_like(away)
        joint = _moved(room, i, moved, bool(measured[ZERO]))
        change = _change(
            room, i, joint, moved, measured, np.hypot(np.where(measured, solution.sigma[i], prior[i]), away)
        )
        results[part] = Refined(joint, change, before, after if improved else before)
    return results


def _cautious(values: np.ndarray, sigma: np.ndarray, config: RefineConfig) -> tuple[np.ndarray, np.ndarray]:
    """Return a joint's parameters [5], its axis moved no farther than `dared`, and how far that leaves them from the best [5]."""
    tilt, result = list(TILT), values.copy()
    result[tilt] *= dared(values[tilt], sigma[tilt], config.worse, config.regret)
    return result, np.abs(values - result)


def _moved(room: JointedRoom, number: int, values: np.ndarray, ajar: bool) -> Joint:
    """Return a joint with other parameters [5]; the same object where all are 0."""
    joint, first, second = room.joints[number], room.loss.first[number], room.loss.second[number]
    if not values.any():
        return joint
    axis = np.array(joint.axis) + values[0] * first + values[1] * second
    origin = np.array(joint.origin) + values[2] * first + values[3] * second
    limits = closed(joint, values[ZERO]) if ajar else joint.limits
    return replace(joint, axis=tuple(axis / np.linalg.norm(axis)), origin=tuple(origin), limits=limits)


def _change(
    room: JointedRoom, number: int, joint: Joint, values: np.ndarray, determined: np.ndarray, sigma: np.ndarray
) -> Refinement:
    """Return how far a joint was moved, and what the scan does not tell of it."""
    old = room.joints[number]
    hinge = joint.kind == "revolute"
    cross, dot = np.linalg.norm(np.cross(joint.axis, old.axis)), float(np.dot(joint.axis, old.axis))
    names = (*(TILTS if hinge else LEVELS), *(PLACES if hinge else ()))
    return Refinement(
        annotated=old,
        angle=float(np.arctan2(cross, dot)),
        shift=float(np.hypot(values[2], values[3])),
        zero=float(values[ZERO]),
        angle_sigma=float(sigma[:2].max()),
        shift_sigma=float(sigma[2:4].max()) if hinge else 0.0,
        unknown=tuple(name for name, measured in zip(names, determined, strict=False) if not measured),
    )


def sentence(part: str, change: Refinement) -> str:
    """Return how far a joint was moved, how sure that is, and what the scan does not tell."""
    hinge = change.annotated.kind == "revolute"
    turned = f"{math.degrees(change.angle):.2f} deg (sigma {math.degrees(change.angle_sigma):.2f})"
    words = [f"joint of {part} refined: axis turned by {turned}"]
    if hinge:
        words.append(f"line moved by {1e3 * change.shift:.1f} mm (sigma {1e3 * change.shift_sigma:.1f})")
    if change.zero:
        amount = f"{abs(math.degrees(change.zero)):.1f} deg" if hinge else f"{1e3 * abs(change.zero):.0f} mm"
        words.append(f"scanned {amount} ajar")
    if change.unknown:
        words.append(f"as annotated, since the scan does not tell: {', '.join(change.unknown)}")
    return "; ".join(words)
