"""How much of a move is dared, against the normal distribution by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from s2a.diff.refine_caution import STEPS, dared


def test_a_move_within_the_bound_is_made_whatever_is_known() -> None:
    assert dared(np.array([0.06, 0.08]), np.array([1.0, 1.0]), worse=0.1, risk=0.0) == 1.0


def test_a_move_that_is_sure_is_made() -> None:
    assert dared(np.array([2.0, 0.0]), np.array([0.1, 0.1]), worse=0.1, risk=0.01) == 1.0


@pytest.mark.parametrize(("move", "sigma"), [(0.3, 0.11), (0.25, 0.1), (0.35, 0.12)])
def test_a_move_is_shortened_until_the_risk_is_what_it_may_be(move: float, sigma: float) -> None:
    # Along one line an axis at t is worse by more than w after a step s > w where t < (s - w) / 2; t is normal around the move.
    step = 0.1 + 2.0 * (move + sigma * norm.ppf(0.01))
    assert 0.1 < step < move
    assert dared(np.array([move, 0.0]), np.array([sigma, 0.0]), 0.1, 0.01) * move == pytest.approx(
        step, abs=2.0 * move / STEPS + 0.02 * sigma
    )


def test_a_move_on_no_evidence_goes_no_farther_than_the_bound() -> None:
    fraction = dared(np.array([0.4, 0.0]), np.array([1.0, 0.0]), worse=0.1, risk=0.01)
    assert fraction * 0.4 == pytest.approx(0.1, abs=0.4 / STEPS)


def test_whoever_takes_every_risk_gets_the_best_guess() -> None:
    assert dared(np.array([0.4, 0.1]), np.array([1.0, 1.0]), worse=0.0, risk=1.0) == 1.0
