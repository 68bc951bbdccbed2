"""Joint paths in time, within the limits of the robot."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from s2a.robot.spec import GripperSpec, JointLimits

Progress = Callable[[np.ndarray], np.ndarray]
"""Time from 0 to 1 -> how far along a path, 1 at its end; beyond it where above."""
USED = 0.8
"""Largest fraction of a limit that is planned with; the rest is for the controller."""
EASE = 0.25
"""Fraction of a motion's time in which it gains speed, and in which it loses it."""
RAMP = 0.1
"""[s] In which the fingers reach their speed, and stop."""


@dataclass(frozen=True)
class Aligned:
    """Where a trajectory makes up for how an object has slipped in the gripper; indices of its targets.

    Attributes:
        seen: where the arm stands above the place and measures how it holds the object.
        ready: from where on what it holds is where it was planned to be.
        released: where it has let go and is clear of it.
        back: from where on nothing is made up for; beyond the end where the motion ends before.
        held: planned pose of the object in the tool frame, shape [4 4].
    """

    seen: int
    ready: int
    released: int
    back: int
    held: np.ndarray


@dataclass(frozen=True)
class Picked:
    """Where a trajectory picks an object; indices of its targets.

    Attributes:
        begin: the arm sets off.
        near: it is at the point of approach.
        lifted: it has lifted the object.
        above: it is above the object's place.
    """

    begin: int
    near: int
    lifted: int
    above: int


@dataclass(frozen=True)
class Shutting:
    """Where a trajectory comes back to a part that it has opened, and shuts it; indices of its targets.

    Attributes:
        part: its id.
        begin: the arm sets off for it.
        near: it is at the point of approach to the handle.
        shut: the part is shut.
    """

    part: str
    begin: int
    near: int
    shut: int


@dataclass(frozen=True)
class Again:
    """A way back for an object that was not lifted, from where it should be to the point of approach.

    Attributes:
        targets: arm and fingers, shape [step joint].
        seen: index of those at which the arm stands with open fingers, and sees where the object is.
    """

    targets: np.ndarray
    seen: int


@dataclass(frozen=True)
class Trajectory:
    """Joint targets, one a control step.

    Attributes:
        targets: arm and fingers, from the point of approach to the end, shape [step joint].
        part: coordinate of the part at each [m or rad], shape [step].
        reach_steps: control steps from the start of an episode to `targets[0]`.
        closed: index of the first target with the gripper closed.
        aligned: where it makes up for how an object has slipped in the gripper; None: nowhere.
        picked: where it picks an object; None: nowhere.
        shutting: where it shuts a part that it has opened; None: nowhere.
        again: how it comes back for what was not lifted; None: it goes on without.
    """

    targets: np.ndarray
    part: np.ndarray
    reach_steps: int
    closed: int
    aligned: Aligned | None = None
    picked: Picked | None = None
    shutting: Shutting | None = None
    again: Again | None = None


def eased(time: np.ndarray) -> np.ndarray:
    """Return a motion from 0 to 1 in the time from 0 to 1, at constant speed between two smooth ramps (peak 4/3 and 8)."""
    t = np.clip(time, 0.0, 1.0)
    rising = np.minimum(np.minimum(t, 1.0 - t) / EASE, 1.0)
    ramp = EASE * (rising**3 - 0.5 * rising**4)
    before = np.where(rising < 1.0, ramp, np.minimum(t, 1.0 - t) - 0.5 * EASE) / (1.0 - EASE)
    return np.where(t <= 0.5, before, 1.0 - before)


def timed(
    path: np.ndarray, duration: float, limits: JointLimits, rate: float, progress: Progress = eased
) -> np.ndarray:
    """Return targets [step arm] along a joint path [pose arm], at rest at both ends, without its first pose.

    Args:
        path: evenly spaced poses.
        duration: at least [s]; more where a limit demands it.
        limits: of the joints.
        rate: steps a second.
        progress: in time.
    """
    steps = max(2, math.ceil(duration * rate))
    for _ in range(3):
        targets = sampled(path, steps, progress)
        used = limit_use(np.concatenate([path[:1], targets, targets[-1:]]), limits, rate)
        if used <= 1.0:
            break
        steps = math.ceil(steps * used) + 1
    return targets


def limit_use(targets: np.ndarray, limits: JointLimits, rate: float) -> float:
    """Return by what factor targets [step arm] would have to be slower for USED of the limits; 1 or less: they keep them."""
    fast, hard = limit_fractions(targets, limits, rate)
    return float(max(fast, np.sqrt(hard)))


def limit_fractions(targets: np.ndarray, limits: JointLimits, rate: float) -> tuple[float, float]:
    """Return the largest velocity and acceleration of targets [step arm], at rest at its ends, as fractions of USED limits."""
    velocity = np.diff(targets, axis=0) * rate
    acceleration = np.diff(np.concatenate([velocity[:1] * 0.0, velocity, velocity[:1] * 0.0]), axis=0) * rate
    fast = np.abs(velocity).max(axis=0) / (USED * np.array(limits.velocity))
    hard = np.abs(acceleration).max(axis=0) / (USED * np.array(limits.acceleration))
    return float(fast.max()), float(hard.max())


def reach_steps(
    start: np.ndarray, goal: np.ndarray, noise: float, duration: float, limits: JointLimits, rate: float
) -> int:
    """Return the steps of an eased motion from near a start to a goal, shape [arm] each, `duration` [s] or more.

    Args:
        start: [rad].
        goal: [rad].
        noise: how far the real start may be from it [rad].
        duration: at least [s].
        limits: of the joints.
        rate: steps a second.
    """
    far = goal + np.where(goal >= start, noise, -noise)
    return len(timed(np.linspace(start, far, 9), duration, limits, rate))


def closing(gripper: GripperSpec, duration: float, rate: float) -> np.ndarray:
    """Return finger positions [step] from open to closed, at constant speed between two ramps, in `duration` [s] or more."""
    speed = USED * gripper.finger_speed
    steps = math.ceil(max(duration, gripper.finger_joint_open / speed + RAMP) * rate)
    time = np.arange(1, steps + 1) / steps
    ramp = min(0.5, RAMP * rate / steps)
    speeds = np.clip(np.minimum(time, 1.0 - time) / ramp, 0.0, 1.0)
    progress = np.cumsum(speeds) / speeds.sum()
    return gripper.finger_joint_open * (1.0 - progress)


def sampled(path: np.ndarray, steps: int, progress: Progress = eased) -> np.ndarray:
    """Return a path [pose column] in steps, without its first pose."""
    spline = CubicSpline(np.arange(len(path)), path)
    return spline((len(path) - 1) * progress(np.arange(1, steps + 1) / steps))
