"""The counts of `experiments/gradients.py`."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("s2a.joints", reason="needs s2a.joints")
from gradients import quantile


def test_joints_that_are_never_solved_have_no_evaluations() -> None:
    assert quantile(np.array([10.0, 20.0, np.inf]), 0.5) == 20.0
    assert quantile(np.array([10.0, 20.0, np.inf]), 0.9) is None
