"""How much of a refinement is dared: an axis that its annotation may have had right is not moved far on weak evidence.

The fit is the best guess of an axis, but a best guess is worse than what it replaces where that happened to be good. Of a low
drawer front far from the scanner that is no rare case. So a move is shortened where that spares more risk than it costs: a large
correction is made though it is uncertain, a small one is not.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

STEPS = 50
"""Fractions of a move that are tried."""
PLACES = norm.ppf((0.5 + np.outer(np.arange(4096), (0.7548776662, 0.5698402910))) % 1.0)
"""Where the true axis may be, in standard deviations of two directions, shape [place 2]; evenly spread (Roberts' R2 sequence)."""


def dared(move: np.ndarray, sigma: np.ndarray, worse: float, regret: float) -> float:
    """Return the fraction of a move of an axis that costs least: what is left of the way, squared, and the risk of harm.

    Args:
        move: from the annotation to the best guess, across the axis in two directions [rad], shape [2].
        sigma: standard deviations of the true axis around the best guess [rad], shape [2].
        worse: the axis may get farther from the true one by this [rad].
        regret: getting farther by more counts as much as being off by this [rad].
    """
    true, fractions = move + sigma * PLACES, np.linspace(1.0, 0.0, STEPS + 1)
    bound = np.linalg.norm(true, axis=1) + worse
    harm = np.array([(np.linalg.norm(true - part * move, axis=1) > bound).mean() for part in fractions])
    return float(fractions[np.argmin((1.0 - fractions) ** 2 * (move @ move) + regret**2 * harm)])
