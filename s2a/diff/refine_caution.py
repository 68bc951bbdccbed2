"""How much of a refinement is dared: an axis that its annotation may have had right is not moved far on weak evidence.

The fit is the best guess of an axis, but a best guess is worse than what it replaces where that happened to be good. Of a low
drawer front far from the scanner that is no rare case. So a move is shortened until it is unlikely to do harm.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

STEPS = 50
"""Fractions of a move that are tried."""
PLACES = norm.ppf((0.5 + np.outer(np.arange(4096), (0.7548776662, 0.5698402910))) % 1.0)
"""Where the true axis may be, in standard deviations of two directions, shape [place 2]; evenly spread (Roberts' R2 sequence)."""


def dared(move: np.ndarray, sigma: np.ndarray, worse: float, risk: float) -> float:
    """Return the largest fraction of a move of an axis that is unlikely to make it worse.

    Args:
        move: from the annotation to the best guess, across the axis in two directions [rad], shape [2].
        sigma: standard deviations of the true axis around the best guess [rad], shape [2].
        worse: the axis may get farther from the true one by this [rad].
        risk: probability with which it may get farther by more.
    """
    true = move + sigma * PLACES
    bound = np.linalg.norm(true, axis=1) + worse
    for fraction in np.linspace(1.0, 0.0, STEPS + 1):
        if (np.linalg.norm(true - fraction * move, axis=1) > bound).mean() <= risk:
            return float(fraction)
    return 0.0
