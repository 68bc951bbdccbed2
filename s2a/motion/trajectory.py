"""The planner's settings, and joint targets in time, within the limits of the robot."""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.interpolate import CubicSpline

from s2a.core.bounds import Count, CountFromZero, NotNegative, Positive
from s2a.core.errors import InputError
from s2a.robot.spec import GripperSpec, JointLimits

# [m] Length of the straight path to a grasp: of the search for a base, the grasp-hold test and the planner
STRAIGHT_APPROACH = 0.10


@dataclass(frozen=True, kw_only=True)
class PlannerConfig:
    """The motion in numbers; times are minima, which a limit of the robot may extend.

    Attributes:
        ik_seeds: starts of the inverse kinematics; each is followed along the whole tool path.
        opening: path of the grasp point [m]; less where the joint ends earlier.
        pull_time: time to move the part along its joint by `opening` [s].
        pull_law: file of s2a optimize with a time law of that motion, instead of `pull_time` and the planner's own; or null.
        seed: seed of the IK starts.
    """

    ik_seeds: Count
    # distance from which the gripper moves straight to a grasp, and back from it [m]
    approach: Positive = STRAIGHT_APPROACH
    depth: float = 0.0  # how far the pads reach past the grasp point, into the furniture [m]
    opening: Positive
    # how far an episode may start from the home position [rad]; for the time of the first motion. As in conf/task
    start_noise: NotNegative = 0.125
    reach_time: Positive = 2.0  # to the point of approach, and between others [s]
    approach_time: Positive = 1.0  # from there to the grasp [s]
    close_time: Positive = 0.8  # for the fingers to close [s]
    pull_time: Positive
    pull_law: Path | None
    seed: CountFromZero


# Time from 0 to 1 -> how far along a path, 1 at its end; beyond it where above
Progress = Callable[[np.ndarray], np.ndarray]
USED = 0.8  # Largest fraction of a limit that is planned with; the rest is for the controller
EASE = 0.25  # Fraction of a motion's time in which it gains speed, and in which it loses it
RAMP = 0.1  # [s] In which the fingers reach their speed, and stop


@dataclass(frozen=True)
class Anchor:
    """A stretch of a trajectory on which the gripper moves along with something that is not where it was planned to be.

    The correction grows from `begin` to `first`, is whole from there to `last`, and is gone at `end`; indices of the targets.
    """

    # what it moves with. object: what the robot picks, seen as an episode begins; held: the object in the
    # gripper, seen at `begin`, whose place may be in `part`; handle: that of `part` as the robot comes back to
    # it, seen at `begin`; grasp: the handle as the policy observes it when an episode begins
    to: Literal["object", "held", "handle", "grasp"]
    begin: int  # where the correction begins
    first: int  # from where on it is whole
    last: int  # up to where it is whole
    end: int  # from where on there is none; beyond the end where the motion ends before
    held: np.ndarray | None = None  # planned pose of the object in the tool frame, shape [4 4]; of `held`
    part: str = ""  # id of an articulated part; empty: none

    def weights(self, steps: int) -> np.ndarray:
        """Return the fraction of the correction at each of so many steps, shape [step]."""
        step = np.arange(steps)
        rising = eased((step - self.begin + (self.first == self.begin)) / max(self.first - self.begin, 1))
        return rising - eased((step - self.last) / max(self.end - self.last, 1))


@dataclass(frozen=True)
class Retry:
    """A motion back for an object that was not lifted, from where it should be to the point of approach."""

    targets: np.ndarray  # arm and fingers, shape [step joint]
    seen: int  # index of those at which the arm stands with open fingers, and sees where the object is


@dataclass(frozen=True)
class Trajectory:
    """Joint targets, one a control step."""

    targets: np.ndarray  # arm and fingers, from the point of approach to the end, shape [step joint]
    part: np.ndarray  # coordinate of the part at each [m or rad], shape [step]
    reach_steps: int  # control steps from the start of an episode to `targets[0]`
    closed: int  # index of the first target with the gripper closed
    anchors: tuple[Anchor, ...] = ()  # where it moves along with what is elsewhere
    retry: Retry | None = None  # how it comes back for what was not lifted; None: it goes on without
    base: np.ndarray | None = (
        None  # of a base that drives: x, y, yaw, lift [m, rad], shape [step 4]; None: it stands still
    )

    def anchor(self, to: str) -> Anchor | None:
        """Return the anchor to something; None: it has none."""
        return next((each for each in self.anchors if each.to == to), None)


def preceded(after: Trajectory, targets: np.ndarray, base: np.ndarray) -> Trajectory:
    """Return a trajectory that does other targets first, and then another one, whose reach from home is among its targets.

    Args:
        after: the other one; where it has no targets of the base, this stands where the first targets end.
        targets: of arm and fingers, up to home, shape [step joint].
        base: of the base, shape [step 4].
    """
    ramp = eased(np.arange(1, after.reach_steps) / after.reach_steps)[:, None]
    first = np.concatenate([targets, targets[-1] + ramp * (after.targets[0] - targets[-1])])
    own = np.tile(base[-1], (len(after.targets), 1)) if after.base is None else after.base
    # The same heading may be whole turns away, which the base would make
    own = own + np.array([0.0, 0.0, 2.0 * np.pi * np.round((base[-1, 2] - own[0, 2]) / (2.0 * np.pi)), 0.0])
    count, part = len(first), np.concatenate([np.full(len(first), after.part[0]), after.part])
    shifted = tuple(
        replace(a, begin=a.begin + count, first=a.first + count, last=a.last + count, end=a.end + count)
        for a in after.anchors
    )
    return Trajectory(
        np.concatenate([first, after.targets]),
        part,
        1,
        after.closed + count,
        shifted,
        after.retry,
        np.concatenate([base, np.tile(base[-1], (count - len(base), 1)), own]),
    )


@dataclass(frozen=True)
class Demonstration:
    """A motion that does a task in one stage, a row a control step."""

    targets: np.ndarray  # joint targets of the robot [rad, m], shape [step joint]
    positions: np.ndarray  # where its joints then are, and last the part's coordinate [rad, m], shape [step joint + 1]
    grasped: int  # number of steps until the gripper has closed; in those after them the part moves


def padded(rows: Sequence[np.ndarray]) -> np.ndarray:
    """Return motions [step column] of several lengths as one array [motion step column], each one's last row repeated."""
    longest = max(map(len, rows))
    return np.stack([np.concatenate([each, np.repeat(each[-1:], longest - len(each), axis=0)]) for each in rows])


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

    `duration`: at least [s]; more where a limit demands it.
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


@dataclass(frozen=True)
class PullLaw:
    """Set-points at even times, at rest at both ends."""

    seconds: float  # from the first to the last
    # of the grasp point [m], 0 at first, shape [sample]; past the goal where the arm would lag behind, or sag
    path: tuple[float, ...]
    goal: float  # where the part shall stand [m]

    def at(self, fraction: np.ndarray) -> np.ndarray:
        """Return the set-points [m] at fractions of the time; outside 0 to 1 those of the ends."""
        spline = CubicSpline(np.linspace(0.0, 1.0, len(self.path)), self.path, bc_type="clamped")
        return spline(np.clip(fraction, 0.0, 1.0))

    def progress(self, fraction: np.ndarray) -> np.ndarray:
        """Return the same as fractions of the goal: above 1 past it."""
        return self.at(fraction) / self.goal


def write(law: PullLaw, file: Path) -> None:
    """Write a law as JSON."""
    file.write_text(json.dumps(asdict(law), indent=1))


def read(file: Path) -> PullLaw:
    """Read a law; InputError: no such file; not a law."""
    if not file.is_file():
        raise InputError(f"no pull law {str(file)!r}; make one with s2a optimize")
    try:
        values = json.loads(file.read_text())
        law = PullLaw(float(values["seconds"]), tuple(map(float, values["path"])), float(values["goal"]))
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{file}: not a pull law ({error}); expected {{seconds, path, goal}}") from error
    is_finite = bool(np.isfinite([law.seconds, law.goal, *law.path]).all())
    if not is_finite or min(law.seconds, law.goal) <= 0.0 or len(law.path) < 3 or law.path[0] != 0.0:
        raise InputError(
            f"{file}: not a pull law; seconds and goal must be above 0, and path must begin at 0 and have 3 samples or more"
        )
    return law
