"""Segments in time: they follow one another without a jump, and each does what it says."""

from __future__ import annotations

import numpy as np
import pytest

from s2a import robot
from s2a.motion.segments import SETTLE, SPEED, Along, Grip, Reach, Release, Segment, Straight, Timeline, Wait

PANDA = robot.load("panda")
FREQUENCY = 60.0
HOME = np.array(PANDA.home)
THERE, BEYOND = HOME + [0.6, 0, 0, 0, 0, 0, 0], HOME + [0.6, 0.2, 0, 0, 0, 0, 0]
REACH, PULL = np.linspace(HOME, THERE, 30), np.linspace(THERE, BEYOND, 9)
OPEN = PANDA.gripper.finger_joint_open


def timeline(segments: list[Segment], **more: object) -> Timeline:
    return Timeline(HOME, PANDA, PANDA.limits, FREQUENCY, 0.8, **more).add(segments)


def opening() -> list[Segment]:
    return [Reach(REACH, 0.1, "reach"), Grip(0.0), Along(PULL, 1.0, "pull", np.linspace(0.0, 0.3, 9)), Release()]


def test_segments_follow_one_another_within_the_limits() -> None:
    targets = timeline(opening()).targets
    np.testing.assert_allclose(targets[0, :7], HOME)
    np.testing.assert_allclose(targets[-1, :7], BEYOND, atol=1e-9)
    velocity = np.diff(targets[:, :7], axis=0) * FREQUENCY
    assert (np.abs(velocity) <= PANDA.limits.velocity).all()
    assert (np.abs(np.diff(velocity, axis=0)) * FREQUENCY <= PANDA.limits.acceleration).all()
    assert (np.abs(np.diff(targets[:, 7])) * FREQUENCY <= PANDA.gripper.finger_speed).all()


def test_between_straight_paths_the_arm_moves_slowly_and_waits() -> None:
    line = timeline(opening())
    (first, last), still = line.span("reach"), round(SETTLE * FREQUENCY)
    assert first == 0 and last - still == pytest.approx(0.6 / SPEED * FREQUENCY, abs=1)
    np.testing.assert_allclose(line.targets[last - still : last + 1, :7], np.tile(THERE, (still + 1, 1)), atol=1e-9)
    assert timeline(opening(), settle=0.0).span("reach") == (0, last - still)


def test_the_part_moves_with_the_arm_alone() -> None:
    line = timeline(opening(), part=0.0)
    part, (first, last) = line.trajectory(0.0, 2.0).part, line.span("pull")
    assert len(part) == len(line.targets)
    assert (part[: first + 1] == 0.0).all() and part[last:] == pytest.approx(0.3)
    assert (np.diff(part) >= 0.0).all()


def test_the_fingers_close_once_and_open_as_far_as_is_asked() -> None:
    line = timeline([Grip(0.0), Release(0.06), Wait(0.5), Release()])
    fingers = line.targets[:, 7]
    assert fingers[0] == OPEN and fingers[line.closed - 1] < 1e-12 < fingers[line.closed]
    assert fingers[-1] == pytest.approx(OPEN)
    assert (np.abs(fingers - 0.06 / PANDA.gripper.max_opening * OPEN) < 1e-9).sum() >= 30
    held = timeline([Grip.on(PANDA.gripper, internal=True), Release.of(internal=True)], closed=True).targets[:, 7]
    assert (held[0], held.max(), held[-1]) == (0.0, pytest.approx(OPEN), pytest.approx(0.0))


def test_an_episode_comes_to_the_first_target_in_the_time_for_it() -> None:
    """At home the fingers, which may start closed, need 4/3 of 0.04 m at 80 % of their speed; elsewhere the arm has its time."""
    at_home = timeline(opening()).trajectory(0.125, 2.0).reach_steps
    assert at_home == np.ceil(4 / 3 * OPEN / (0.8 * PANDA.gripper.finger_speed) * FREQUENCY)
    away = Timeline(THERE, PANDA, PANDA.limits, FREQUENCY, 0.8).add([Straight(PULL, 1.0)])
    assert away.trajectory(0.125, 2.0).reach_steps == 2.0 * FREQUENCY
