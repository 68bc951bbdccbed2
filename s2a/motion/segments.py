"""Segments of a motion, and the joint targets that do them one after the other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from s2a.motion.trajectory import USED, Anchor, Progress, Retry, Trajectory, closing, eased, reach_steps, sampled, timed
from s2a.robot.spec import GripperSpec, JointLimits, RobotSpec

SETTLE = 0.7  # [s] Between two segments: the arm's controller lags by 0.2 s
SPEED = 0.6  # [rad] Of all joints together that the arm moves in a second between two straight paths


@dataclass(frozen=True)
class Straight:
    """The tool moves straight."""

    path: np.ndarray  # joints [pose arm]
    seconds: float  # at least [s]
    name: str = ""  # for `Timeline.span`


@dataclass(frozen=True)
class Reach(Straight):
    """The arm moves freely between two straight paths, with nothing in its gripper, at SPEED or slower."""


@dataclass(frozen=True)
class Carry(Reach):
    """The arm moves freely with an object in its gripper."""


@dataclass(frozen=True)
class Along(Straight):
    """The gripper moves a part along its joint."""

    q: np.ndarray = field(default_factory=lambda: np.zeros(0))  # coordinates of the part [m or rad], shape [pose]
    progress: Progress = eased  # in time


@dataclass(frozen=True)
class Grip:
    """The fingers close, or spread in a pocket, on what they hold."""

    opened: float  # distance of the pads to which they are led [m]; where they stop is what is between them

    @classmethod
    def on(cls, gripper: GripperSpec, internal: bool) -> Grip:
        """Return the segment that holds a bar between the pads, or a pocket from within."""
        return cls(gripper.max_opening if internal else 0.0)


@dataclass(frozen=True)
class Release:
    """The fingers let go."""

    opened: float = math.inf  # distance of the pads afterwards [m]; fully open where that is less

    @classmethod
    def of(cls, internal: bool) -> Release:
        """Return the segment that lets go of a bar between the pads, or of a pocket that is held from within."""
        return cls(0.0 if internal else math.inf)


@dataclass(frozen=True)
class Wait:
    """The arm stands."""

    seconds: float  # [s]
    name: str = ""  # for `Timeline.span`


@dataclass(frozen=True)
class Drive:
    """The base drives and lifts, the arm as it is."""

    path: np.ndarray  # coordinates of the base: x, y, yaw, lift, shape [pose 4]


Segment = Straight | Grip | Release | Wait | Drive
# Of a base in a room: m/s, m/s, rad/s, m/s and the same per second, at most
CALM = JointLimits((0.6, 0.6, 0.8, 0.2), (0.5, 0.5, 0.8, 0.5), (0.0, 0.0, 0.0, 0.0))


class Timeline:
    """Joint targets of segments, from one joint position on.

    Attributes:
        closed: index of the first target with the gripper closed for the first time; 0: it has not.
    """

    def __init__(
        self,
        first: np.ndarray,
        spec: RobotSpec,
        limits: JointLimits,
        frequency: float,
        close_time: float,
        *,
        closed: bool = False,
        settle: float = SETTLE,
        part: float = 0.0,
        base: np.ndarray | None = None,
    ) -> None:
        """Begin at joints [arm].

        Args:
            first: joints [arm].
            spec: the robot.
            limits: that the arm keeps.
            frequency: control steps a second.
            close_time: for the fingers to close [s].
            closed: the fingers are, at first.
            settle: that the arm stands after it has moved [s].
            part: coordinate of the part that is moved, at first [m or rad].
            base: coordinates of a base that drives [4]; None: there is none.
        """
        self._spec, self._limits, self._frequency = spec, limits, frequency
        self._shut, self._settle = closing(spec.gripper, close_time, frequency), settle
        self._wide = spec.gripper.finger_joint_open
        self._fingers = 0.0 if closed else self._wide
        self._arm, self._finger, self._part = [first[None]], [np.full(1, self._fingers)], [np.full(1, part)]
        self._base = [np.zeros((1, 0)) if base is None else base[None]]
        self._spans: dict[str, tuple[int, int]] = {}
        self.closed = 0

    def add(self, segments: Sequence[Segment]) -> Timeline:
        """Add segments, and return this."""
        for segment in segments:
            begin = self.last
            if isinstance(segment, Straight):
                self._move(segment)
            elif isinstance(segment, Drive):
                self._drive(segment.path)
            elif isinstance(segment, Wait):
                self._stand(segment.seconds)
            else:
                self._grip(segment.opened)
                if isinstance(segment, Grip):
                    self.closed = self.closed or self.last + 1
            if isinstance(segment, Straight | Wait) and segment.name:
                self._spans[segment.name] = begin, self.last
        return self

    def span(self, name: str) -> tuple[int, int]:
        """Return the indices of the targets between which a segment is done, until the arm stands."""
        return self._spans[name]

    @property
    def last(self) -> int:
        """Index of the last target so far."""
        return sum(map(len, self._arm)) - 1

    @property
    def targets(self) -> np.ndarray:
        """Targets of arm and fingers, shape [step joint]."""
        fingers = np.concatenate(self._finger)[:, None]
        return np.concatenate([np.concatenate(self._arm), fingers, fingers], axis=1)

    @property
    def base(self) -> np.ndarray | None:
        """Targets of the base, shape [step 4]; None: it stands still."""
        whole = np.concatenate(self._base)
        return whole if whole.shape[1] else None

    def trajectory(
        self, noise: float, reach_time: float, anchors: tuple[Anchor, ...] = (), retry: Retry | None = None
    ) -> Trajectory:
        """Return the targets, after a motion to the first of them from home, up to `noise` [rad] off.

        That takes `reach_time` [s]; where the first target is home, as long as the fingers need that may start closed, or half of
        that time.
        """
        home, targets = np.array(self._spec.home), self.targets
        first = targets[0, : len(home)]
        if np.allclose(first, home):
            # An eased motion's peak is 4/3 of its mean speed.
            reach_time = max(0.5 * reach_time, 4.0 / 3.0 * self._wide / (USED * self._spec.gripper.finger_speed))
        reach = reach_steps(home, first, noise, reach_time, self._limits, self._frequency)
        return Trajectory(targets, np.concatenate(self._part), reach, self.closed, anchors, retry, self.base)

    def _move(self, segment: Straight) -> None:
        seconds, progress = segment.seconds, segment.progress if isinstance(segment, Along) else eased
        if isinstance(segment, Reach):
            length = float(np.linalg.norm(np.diff(segment.path, axis=0), axis=1).sum())
            seconds = max(seconds, length / SPEED)
        moved = timed(segment.path, seconds, self._limits, self._frequency, progress)
        self._add(moved, np.full(len(moved), self._fingers))
        if isinstance(segment, Along):
            self._part[-1] = sampled(segment.q[:, None], len(moved), lambda time: np.minimum(progress(time), 1.0))[:, 0]
        self._stand(self._settle)

    def _drive(self, path: np.ndarray) -> None:
        """Move the base along its path [pose 4], within its limits and CALM."""
        drive = self._spec.drive
        assert drive is not None, "a robot whose base drives"
        pairs = [(drive.velocity, CALM.velocity), (drive.acceleration, CALM.acceleration)]
        fast, hard = (tuple(map(min, own, calm)) for own, calm in pairs)
        moved = timed(path, 0.0, JointLimits(fast, hard, drive.force), self._frequency)
        self._add(np.tile(self._arm[-1][-1], (len(moved), 1)), np.full(len(moved), self._fingers))
        self._base[-1] = moved
        self._stand(SETTLE)

    def _add(self, arm: np.ndarray, fingers: np.ndarray) -> None:
        """Add targets [step arm] and [step]; the part and the base stay where they are."""
        self._arm.append(arm)
        self._finger.append(fingers)
        self._base.append(np.tile(self._base[-1][-1], (len(arm), 1)))
        self._part.append(np.full(len(arm), self._part[-1][-1]))

    def _stand(self, seconds: float) -> None:
        if steps := math.ceil(seconds * self._frequency):
            self._add(np.tile(self._arm[-1][-1], (steps, 1)), np.full(steps, self._fingers))

    def _grip(self, opened: float) -> None:
        """Move the fingers until the pads would be at a distance [m], in the time that they need for all of their way."""
        most = self._spec.gripper.max_opening
        goal = min(opened, most) / most * self._wide
        values = goal + (self._fingers - goal) * self._shut / self._wide
        values[-1] = self._fingers = goal  # what rounding leaves
        self._add(np.tile(self._arm[-1][-1], (len(values), 1)), values)
