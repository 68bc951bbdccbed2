"""Pulled joints: the gradient of the loss, and what a recording of known dynamics costs."""

from __future__ import annotations

from dataclasses import astuple

import joint_model
import numpy as np
import pytest
from pulled_bodies import DOOR, DRAWER, LID
from recorded_pulls import Truth, record

from s2a.joints.dynamics import RATE, JointWorlds, kalman
from s2a.joints.pull import Noise, Pull
from s2a.joints.pulled import Moving

NOISE = Noise(0.001, 0.5)
TRUTH = Truth(mass=1.4, damping=6.0, friction=2.0, spring=12.0)
SOFT = Truth(mass=1.4, damping=6.0, friction=2.0, breakaway=1.0, spring=12.0, pull_in=5.0, closing=40.0)


def test_what_resists_at_the_handle_follows_from_the_body() -> None:
    assert DRAWER.inertia == pytest.approx(6.0)
    assert DOOR.inertia == pytest.approx((0.1 + 4.0 * 0.2**2) / 0.4**2) and DOOR.lever == pytest.approx(-0.4)
    # Half way between hinge and handle, the weight is half its force at the handle; none where its centre is above the hinge.
    cosine, sine = LID.gravity
    upright = -np.arctan2(0.2, 0.02)
    assert cosine == pytest.approx(-3.0 * 9.81 * 0.5)
    assert cosine * np.cos(upright) + sine * np.sin(upright) == pytest.approx(0.0, abs=1e-6)


def test_a_filter_trusts_what_is_exact() -> None:
    of_force, of_opening = kalman(5.0, 1 / 60, Noise(1e-3, 1e-6)), kalman(5.0, 1 / 60, Noise(1e-6, 10.0))
    assert of_force[0] < 0.01 and of_opening[0] > 0.99


@pytest.mark.parametrize("body", [DRAWER, DOOR, LID], ids=["drawer", "door", "lid"])
def test_gradients_are_central_differences_of_the_law_in_double_precision(body: Moving) -> None:
    pulls = [record(body, SOFT, NOISE, seed, seconds=0.8) for seed in range(2)]
    worlds = JointWorlds([body], [pulls], pulls[0].step, NOISE)
    at = np.array([[1.2, 4.0, 2.5, 0.5, 15.0, 3.0, 20.0]])
    found = worlds.loss(at)[1][0]
    expected = joint_model.gradient(at[0], body, pulls, NOISE, round(pulls[0].step * RATE))
    assert found @ expected / np.linalg.norm(found) / np.linalg.norm(expected) > 0.999999
    assert found == pytest.approx(expected, rel=1e-3, abs=1e-3)  # breakaway of a drawer in motion: 0.04 of 7000


@pytest.mark.slow
def test_innovations_of_the_truth_are_as_large_as_expected() -> None:
    """MuJoCo's recording, whose friction is a constraint, is explained by this model; a wrong one is not."""
    bodies = [DRAWER, DOOR, LID]
    pulls = [[record(body, TRUTH, NOISE, seed) for seed in range(2)] for body in bodies]
    worlds = JointWorlds(bodies, pulls, pulls[0][0].step, NOISE)
    truth = np.tile(astuple(TRUTH), (3, 1))
    expected = sum(len(pull.opening) - 1 for pull in pulls[0]) / 2
    right = worlds.loss(truth)[0]
    assert (np.abs(right / expected - 1.0) < 4.0 / np.sqrt(expected)).all()
    for k, more in enumerate([0.0, 0.0, 0.0, 3.0, 0.0, 5.0]):
        wrong = truth.copy()
        wrong[:, k] = truth[:, k] * 1.5 + more
        assert (worlds.loss(wrong)[0] > right + 4.0).all(), k


@pytest.mark.slow
def test_recordings_of_different_lengths_share_a_batch() -> None:
    long = record(DRAWER, TRUTH, NOISE, 0, seconds=1.0)
    short = Pull(long.opening[:30], long.force[:30], long.step)
    at = np.array([[1.4, 6.0, 2.0, 0.1, 12.0, 1.0, 5.0]])
    alone = [JointWorlds([DRAWER], [[pull]], pull.step, NOISE).loss(at) for pull in (long, short)]
    both = JointWorlds([DRAWER, DRAWER], [[long], [short]], long.step, NOISE).loss(np.repeat(at, 2, axis=0))
    for i, (loss, gradient) in enumerate(alone):
        assert both[0][i] == pytest.approx(loss[0], rel=1e-4)
        assert both[1][i] == pytest.approx(gradient[0], rel=1e-3, abs=1e-2)
