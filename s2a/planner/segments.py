"""Joint targets of a motion that is made of segments: paths of the arm, and a gripper that closes and opens between them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from s2a.planner.part_reach import SPEED
from s2a.planner.trajectory import (
    USED,
    Again,
    Aligned,
    Picked,
    Shutting,
    Trajectory,
    closing,
    reach_steps,
    sampled,
    timed,
)
from s2a.robot.spec import JointLimits, RobotSpec

SETTLE = 0.7
"""[s] Between two motions: the arm's controller lags by 0.2 s."""
ALIGN = 1.0
"""[s] In which the arm makes up for how an object has slipped in the gripper: a few degrees and millimetres, seldom 20 and 50."""


class Segments:
    """Collects targets, from one joint position on.

    Attributes:
        closed: index of the first target with the gripper closed for the first time; 0: it has not.
        picked: where an object is picked, if it is.
        shutting: where a part is shut, if it is.
        again: how the arm comes back for what was not lifted, if it does.
    """

    def __init__(
        self,
        first: np.ndarray,
        spec: RobotSpec,
        limits: JointLimits,
        rate: float,
        close_time: float,
        *,
        closed: bool = False,
    ) -> None:
        """Begin at joints [arm].

        Args:
            first: joints [arm].
            spec: the robot.
            limits: that the arm keeps.
            rate: control steps a second.
            close_time: for the fingers to close [s].
            closed: the fingers are, at first.
        """
        self._spec, self._limits, self._rate = spec, limits, rate
        self._shut = closing(spec.gripper, close_time, rate)
        self._wide = spec.gripper.finger_joint_open
        self._fingers = 0.0 if closed else self._wide
        self._arm, self._finger, self._part = [first[None]], [np.full(1, self._fingers)], [np.zeros(1)]
        self.closed = 0
        self.picked: Picked | None = None
        self.shutting: Shutting | None = None
        self.again: Again | None = None
        self._aligned: Aligned | None = None
        self._close_time = close_time

    def come_back(self, path: np.ndarray, opened: float, seconds: float) -> None:
        """Know a way [pose arm] back for an object that slipped out; its fingers open to a distance [m] before."""
        back = Segments(path[0], self._spec, self._limits, self._rate, self._close_time, closed=True)
        back.open(opened)
        back._stand(math.ceil(SETTLE * self._rate))
        seen = back.last
        back.between(path, seconds)
        self.again = Again(back._targets(), seen)

    def go(self, path: np.ndarray, seconds: float, part: np.ndarray | None = None) -> None:
        """Follow a path [pose arm] in `seconds` or more, and wait for the arm.

        Args:
            path: of the arm.
            seconds: at least.
            part: coordinates of a part that the arm moves along [m or rad], shape [pose]; None: it moves none.
        """
        moved = timed(path, seconds, self._limits, self._rate)
        self._add(moved, np.full(len(moved), self._fingers))
        if part is not None:
            self._part[-1] = sampled(part[:, None], len(moved))[:, 0]
        self._stand(math.ceil(SETTLE * self._rate))

    def between(self, path: np.ndarray, seconds: float) -> None:
        """Follow a path [pose arm] between straight ones, at SPEED or slower."""
        length = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
        self.go(path, max(seconds, length / SPEED))

    def close(self) -> None:
        """Close the fingers on what is between them."""
        self.hold(internal=False)

    def open(self, distance: float | None = None) -> None:
        """Open the fingers until their pads are at a distance [m]; None: fully."""
        self._grip(self._wide if distance is None else distance / self._spec.gripper.max_opening * self._wide)

    def hold(self, internal: bool) -> None:
        """Close the fingers on a handle, or spread them in the pocket that they are in."""
        self._grip(self._wide if internal else 0.0)
        self.closed = self.closed or self._count()

    def release(self, internal: bool) -> None:
        """Let go of a handle, or be ready to hold it so."""
        self._grip(0.0 if internal else self._wide)

    def align(self, held: np.ndarray) -> None:
        """Stand, and make up for how the object, planned at `held` [4 4] in the tool frame, has slipped in the gripper."""
        seen, steps = self._count() - 1, math.ceil(ALIGN * self._rate)
        self._stand(steps)
        self._stand(math.ceil(SETTLE * self._rate))
        self._aligned = Aligned(seen, seen + steps, seen + steps, seen + 2 * steps, held)

    def leave_aligned(self) -> None:
        """Have let go of what was aligned: from here on ever less is made up for."""
        if self._aligned is not None:
            released, steps = self._count() - 1, self._aligned.ready - self._aligned.seen
            self._aligned = replace(self._aligned, released=released, back=released + steps)

    @property
    def last(self) -> int:
        """Index of the last target so far."""
        return self._count() - 1

    def _count(self) -> int:
        return sum(map(len, self._arm))

    def _add(self, arm: np.ndarray, fingers: np.ndarray) -> None:
        """Add targets [step arm] and [step]; the part stays where it is."""
        self._arm.append(arm)
        self._finger.append(fingers)
        self._part.append(np.full(len(arm), self._part[-1][-1]))

    def _stand(self, steps: int) -> None:
        self._add(np.tile(self._arm[-1][-1], (steps, 1)), np.full(steps, self._fingers))

    def _grip(self, goal: float) -> None:
        """Move the fingers to a joint position, in the time that they need for all of their way."""
        values = goal + (self._fingers - goal) * self._shut / self._wide
        self._add(np.tile(self._arm[-1][-1], (len(values), 1)), values)
        self._fingers = float(values[-1])

    def trajectory(self, noise: float, reach_time: float) -> Trajectory:
        """Return the targets, after a motion to the first from home, up to `noise` [rad] off, in half of `reach_time` [s]."""
        targets = self._targets()
        # The fingers may start closed; an eased motion's peak is 4/3 of its mean speed.
        opening = 4.0 / 3.0 * self._wide / (USED * self._spec.gripper.finger_speed)
        home = np.array(self._spec.home)
        reach = reach_steps(
            home, targets[0, : len(home)], noise, max(0.5 * reach_time, opening), self._limits, self._rate
        )
        part = np.concatenate(self._part)
        return Trajectory(targets, part, reach, self.closed, self._aligned, self.picked, self.shutting, self.again)

    def _targets(self) -> np.ndarray:
        """Return the targets of arm and fingers, shape [step joint]."""
        arms, fingers = np.concatenate(self._arm), np.concatenate(self._finger)[:, None]
        return np.concatenate([arms, fingers, fingers], axis=1)
