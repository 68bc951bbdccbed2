"""What is added to a trajectory at the robot's limits makes it slower, not faster than they allow."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from s2a import robot as robots
from s2a.motion.policy import Pace
from s2a.motion.trajectory import Trajectory, eased, limit_fractions, timed

SPEC = robots.load("panda")
RATE, STAND = 60.0, 20
SLIP = 0.5
"""[rad] That is added in the first world."""


def moving() -> np.ndarray:
    """Return joints [step arm] that stand, move as fast as is planned, and stand."""
    path = np.array(SPEC.home) + np.linspace(0.0, 1.0, 9)[:, None] * [1.0, 0, 0, 0, 0, 0, 0]
    moved = timed(path, 0.1, SPEC.limits, RATE)
    return np.concatenate([np.tile(path[0], (STAND, 1)), moved, np.tile(moved[-1], (STAND, 1))])


def followed(fitted: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return what two worlds are told, [step world arm], and where they are on the trajectory, [step world]; one adds SLIP."""
    arm = moving()
    sim = SimpleNamespace(num_envs=2, device="cpu", robot=SPEC)
    last = len(arm) - STAND
    share = eased((np.arange(len(arm)) - STAND) / (last - STAND))
    added = torch.tensor(share[:, None, None] * np.array([SLIP, 0.0])[:, None] * np.eye(7)[0])
    pace = Pace(sim, Trajectory(arm, np.zeros(len(arm)), 1, 0), SPEC.limits, RATE)
    if fitted:
        pace.fit((STAND, last), torch.tensor([True, True]), lambda step: added[step, torch.arange(2)])
    place, places, told = torch.zeros(2, dtype=torch.float64), [], []
    total = arm[:, None] + added.numpy()
    while float(place.min()) < len(arm) - 1:
        places.append(place.numpy())
        told.append(
            [[np.interp(at, np.arange(len(arm)), column) for column in total[:, k].T] for k, at in enumerate(place)]
        )
        place = pace.after(place).clamp(max=len(arm) - 1)
    return np.array(told), np.array(places)


def test_the_sum_keeps_the_limits() -> None:
    at_full_pace, _ = followed(fitted=False)
    assert max(limit_fractions(at_full_pace[:, 0], SPEC.limits, RATE)) > 1.3
    told, _ = followed(fitted=True)
    assert max(limit_fractions(told[:, 0], SPEC.limits, RATE)) < 1.01
    assert told[-1, 0] == pytest.approx(at_full_pace[-1, 0], abs=1e-3)


def test_a_world_that_adds_nothing_is_not_slowed_and_all_leave_the_window_at_a_whole_step() -> None:
    _, places = followed(fitted=True)
    slowed, planned = places.T
    assert planned[: len(moving()) - 1] == pytest.approx(np.arange(len(moving()) - 1), abs=0.5)
    assert (slowed[slowed >= len(moving()) - STAND] % 1.0 == 0.0).all()
    assert np.flatnonzero(slowed >= len(moving()) - STAND)[0] > len(moving()) - STAND
