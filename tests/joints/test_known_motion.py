"""Least squares of the force find the dynamics by which it was made."""

from __future__ import annotations

import numpy as np
import pytest
from pulled_bodies import DOOR, DRAWER

from s2a.core.errors import InputError
from s2a.joints.dynamics import PARAMETERS
from s2a.joints.identify import fit
from s2a.joints.pull import Pull
from s2a.joints.pulled import Moving

STEP, TRUTH = 1 / 60, {"mass": 0.7, "damping": 6.0, "friction": 2.0, "spring": 8.0}


def made(body: Moving, seconds: float, noise: float, seed: int) -> Pull:
    """Return a pull whose force follows from its motion: an ease to 0.3 m, noise [N] on the force."""
    time = np.arange(0.0, seconds + STEP, STEP)
    u = time / seconds
    opening = 0.3 * u**3 * (10 - 15 * u + 6 * u**2)
    speed = 0.9 * u**2 * (1 - u) ** 2 * 10 / seconds
    speeding = 0.3 * 60 * u * (1 - u) * (1 - 2 * u) / seconds**2
    first, second = body.gravity
    turn = opening / body.lever if body.joint.kind == "revolute" else 0.0 * opening
    force = TRUTH["mass"] * (body.inertia * speeding - first * np.cos(turn) - second * np.sin(turn))
    force += TRUTH["damping"] * speed + TRUTH["friction"] * (speed > 0.0) + TRUTH["spring"] * opening
    return Pull(opening, force + np.random.default_rng(seed).normal(0.0, noise, len(time)), STEP)


def pulls(body: Moving, noise: float, seed: int = 0) -> list[Pull]:
    return [made(body, seconds, noise, 10 * seed + k) for k, seconds in enumerate((1.2, 1.8, 2.4, 3.0))]


@pytest.mark.parametrize("body", [DRAWER, DOOR], ids=["drawer", "door"])
def test_a_force_without_noise_gives_the_truth(body: Moving) -> None:
    found = fit(body, pulls(body, 0.0), 0.3)
    for name, value in TRUTH.items():
        assert found.values[PARAMETERS.index(name)] == pytest.approx(value, rel=0.01), name
    assert np.isinf(found.deviations[PARAMETERS.index("breakaway")])


def test_stated_intervals_hold_the_truth_as_often_as_they_say() -> None:
    held, misfits = [], []
    for seed in range(60):
        found = fit(DRAWER, pulls(DRAWER, 0.3, seed), 0.3)
        misfits.append(found.misfit)
        for name, value in TRUTH.items():
            low, high = found.interval(name)
            held.append(low <= value <= high)
    assert 0.84 < np.mean(held) < 0.96  # 90 %: 240 of them, which the four of a fit share
    assert np.mean(misfits) == pytest.approx(1.0, abs=0.1)


def test_pulls_that_hardly_move_are_refused() -> None:
    with pytest.raises(InputError, match="half a second or longer"):
        fit(DRAWER, [Pull(np.linspace(0.0, 0.002, 60), np.zeros(60), STEP)], 0.3)


@pytest.mark.parametrize("body", [DRAWER, DOOR], ids=["drawer", "door"])
def test_a_soft_close_is_found_and_none_is_invented(body: Moving) -> None:
    given = [drawn_in(body, pull, 6.0) for pull in pulls(body, 0.3)]
    found, k = fit(body, given, 0.3), PARAMETERS.index("pull_in")
    low, high = found.interval("pull_in")
    assert low <= 6.0 <= high and found.values[k] == pytest.approx(6.0, rel=0.1)
    assert np.isinf(found.deviations[PARAMETERS.index("closing")])  # nothing closed
    without = fit(body, pulls(body, 0.3), 0.3)
    assert without.values[k] == 0.0 and without.determined[k]


def drawn_in(body: Moving, pull: Pull, force: float) -> Pull:
    """Return a pull against a soft close too, at full force but for the last quarter of its reach [N]."""
    acts = np.clip((body.reach - pull.opening) / (0.25 * body.reach), 0.0, 1.0)
    return Pull(pull.opening, pull.force + force * acts, pull.step)


def test_an_error_that_lasts_all_along_a_pull_widens_the_intervals() -> None:
    """Each pull's force is off by a factor of its own, as by a grip that rolls: neighbours alike tell nothing of that."""
    held = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        off = [Pull(p.opening, p.force * (1.0 + rng.normal(0.0, 0.03)), p.step) for p in pulls(DRAWER, 0.1, seed)]
        found = fit(DRAWER, off, 0.1)
        held += [found.interval(name)[0] <= value <= found.interval(name)[1] for name, value in TRUTH.items()]
    assert np.mean(held) > 0.75
