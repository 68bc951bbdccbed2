"""How much of a move is dared, against the normal distribution by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from s2a.prepare.refine import STEPS, dared


def test_a_move_within_the_bound_is_made_whatever_is_known() -> None:
    assert dared(np.array([0.06, 0.08]), np.array([1.0, 1.0]), worse=0.1, regret=10.0) == 1.0


def test_a_move_that_is_sure_is_made() -> None:
    assert dared(np.array([2.0, 0.0]), np.array([0.1, 0.1]), worse=0.1, regret=0.5) == 1.0


def test_a_large_move_is_made_though_it_is_uncertain() -> None:
    # One in eight gets worse, which counts as 0.5 degrees; hardly moving would leave 1.35.
    assert dared(np.array([1.35, 0.0]), np.array([0.6, 0.0]), worse=0.1, regret=0.5) > 0.9


@pytest.mark.parametrize(("move", "sigma"), [(0.25, 0.1), (0.3, 0.15), (0.2, 0.12)])
def test_a_move_is_shortened_to_where_way_and_risk_together_are_least(move: float, sigma: float) -> None:
    # Along one line an axis at t is worse by more than w after a step s > w where t < (s - w) / 2; t is normal around the move.
    step = np.linspace(0.1, move, 2000)
    cost = (move - step) ** 2 + 0.5**2 * norm.cdf(((step - 0.1) / 2 - move) / sigma) * (step > 0.1)
    best = step[cost.argmin()]
    assert best < 0.97 * move
    assert dared(np.array([move, 0.0]), np.array([sigma, 0.0]), 0.1, 0.5) * move == pytest.approx(best, abs=0.03 * move)


def test_a_move_on_no_evidence_goes_no_farther_than_the_bound() -> None:
    fraction = dared(np.array([0.4, 0.0]), np.array([1.0, 0.0]), worse=0.1, regret=3.0)
    assert fraction * 0.4 == pytest.approx(0.1, abs=0.4 / STEPS)


def test_whoever_regrets_nothing_gets_the_best_guess() -> None:
    assert dared(np.array([0.4, 0.1]), np.array([1.0, 1.0]), worse=0.0, regret=0.0) == 1.0
