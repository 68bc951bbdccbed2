"""Time laws: at rest at both ends, within the limits, no faster than asked."""

from __future__ import annotations

import numpy as np
import pytest

from s2a import robot
from s2a.motion.trajectory import USED, closing, eased, timed

RATE = 60.0
PANDA = robot.load("panda")


def test_an_eased_motion_is_symmetric_and_starts_at_rest() -> None:
    time = np.linspace(0.0, 1.0, 1001)
    place = eased(time)
    assert (place[0], place[500], place[-1]) == pytest.approx((0.0, 0.5, 1.0))
    assert place + place[::-1] == pytest.approx(1.0)
    speed = np.diff(place) * 1000
    assert speed[0] < 1e-4 and speed.max() == pytest.approx(4 / 3, rel=1e-3)
    assert np.abs(np.diff(speed)).max() * 1000 == pytest.approx(8.0, rel=1e-2)


@pytest.mark.parametrize(("angle", "duration"), [(0.1, 1.0), (3.0, 0.2), (0.01, 0.05)])
def test_a_motion_takes_its_time_or_longer_for_the_limits(angle: float, duration: float) -> None:
    path = np.linspace(np.zeros(7), np.full(7, angle), 12)
    targets = timed(path, duration, PANDA.limits, RATE)
    assert targets[-1] == pytest.approx(path[-1])
    assert len(targets) >= duration * RATE
    whole = np.concatenate([path[:1], path[:1], targets, targets[-1:]])
    velocity = np.diff(whole, axis=0) * RATE
    assert (np.abs(velocity) <= 1.01 * USED * np.array(PANDA.limits.velocity)).all()
    assert (np.abs(np.diff(velocity, axis=0)) * RATE <= 1.01 * USED * np.array(PANDA.limits.acceleration)).all()


def test_a_slow_motion_is_not_stretched() -> None:
    assert len(timed(np.linspace(np.zeros(7), np.full(7, 0.1), 12), 1.0, PANDA.limits, RATE)) == 60


def test_the_fingers_close_no_faster_than_they_can() -> None:
    fingers = closing(PANDA.gripper, 0.1, RATE)
    speed = -np.diff(np.concatenate([[0.04], fingers])) * RATE
    assert fingers[-1] == pytest.approx(0.0, abs=1e-12)
    assert 0.0 <= speed.min() and speed.max() <= PANDA.gripper.finger_speed
    assert len(closing(PANDA.gripper, 2.0, RATE)) == 120
