"""The dynamics of a joint whose motion is known well, as a robot's own joints tell it: then the force is linear in them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag, toeplitz
from scipy.ndimage import binary_erosion, gaussian_filter1d
from scipy.optimize import lsq_linear

from s2a.core.errors import InputError
from s2a.joints.dynamics import LOWER, UPPER, Dynamics
from s2a.joints.joint_kernels import PARAMETERS
from s2a.joints.moving_body import Moving
from s2a.joints.pull import Pull, same_step
from s2a.sim.resistance import EDGE

SMOOTHED = 0.05
"""[s] Standard deviation of the Gaussian that smooths motion and force alike, which leaves their relation as it is."""
REACH = 2.5
"""Standard deviations around a sample that have to be of the same motion."""
MOVES = 0.01
"""[m/s] Slower, dry friction may be anything below its bound."""
ASKED = [PARAMETERS.index(name) for name in ("mass", "damping", "friction", "spring", "pull_in", "closing")]
SOFT_CLOSE = slice(4, 6)
"""Of ASKED."""
TELLS = 2.0
"""Deviations from 0 from which a soft close is believed."""


def fit(body: Moving, pulls: Sequence[Pull], force_noise: float) -> Dynamics:
    """Return the dynamics by which the motion explains the force, by least squares over the samples that move.

    A force's noise is an error of the outcome alone, and biases nothing; that of positions hardly shows in the smoothed
    accelerations. Breakaway is not asked for; a soft close is left out where it does not tell itself.

    Args:
        body: with the stage's mass.
        pulls: recordings at one rate.
        force_noise: standard deviation of their samples [N], for the misfit alone.

    Raises:
        InputError: the pulls do not move long enough.
    """
    step = same_step(pulls)
    samples = [_moving_samples(body, pull) for pull in pulls]
    if (count := sum(len(force) for _, force in samples)) < 4 * len(ASKED):
        raise InputError(
            f"the part moves faster than {MOVES} m/s in {count} samples only; give pulls of half a second or longer"
        )
    asked = np.any(np.concatenate([columns for columns, _ in samples]) != 0.0, axis=0)
    found, spread, variance = _solve(samples, asked, step)
    idle = np.zeros_like(asked)
    idle[SOFT_CLOSE] = found[SOFT_CLOSE] < TELLS * spread[SOFT_CLOSE]
    if (asked & idle).any():
        found, without, variance = _solve(samples, asked & ~idle, step)
        spread = np.where(idle, spread, without)
    values, deviations = np.zeros(len(PARAMETERS)), np.full(len(PARAMETERS), np.inf)
    values[ASKED], deviations[ASKED] = found, spread
    expected = force_noise**2 * step / (2.0 * np.sqrt(np.pi) * SMOOTHED)
    return Dynamics(values, deviations, variance / expected)


Samples = list[tuple[np.ndarray, np.ndarray]]
"""What ASKED are multiplied with, shape [sample parameter], and the force [N], of each pull."""


def _solve(samples: Samples, asked: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the ASKED that were asked for, the others 0, their deviations, the others' infinite, and the residuals' variance.

    A deviation is that of the residuals, which the smoothing has made alike among neighbours, or that of the pulls, each left out
    in turn (the jackknife), where this is larger: a grip that rolls errs alike all along a pull.
    """
    matrix, force = (np.concatenate(each) for each in zip(*samples, strict=True))
    found = _least_squares(matrix, force, asked)
    residual = force - matrix @ found
    # Smoothed white noise: samples k steps apart correlate by exp(-(k step / 2 SMOOTHED)^2).
    lengths = [len(own) for _, own in samples]
    alike = block_diag(*(toeplitz(np.exp(-((np.arange(n) * step / (2 * SMOOTHED)) ** 2))) for n in lengths))
    inverse = np.linalg.pinv(matrix[:, asked])
    free = len(force) - np.trace(matrix[:, asked] @ (inverse @ alike))
    variance = float(residual @ residual) / max(free, 1.0)
    deviations = np.full(len(asked), np.inf)
    deviations[asked] = np.sqrt(variance * np.diagonal(inverse @ alike @ inverse.T))
    if (pulls := len(samples)) > 1:
        left = np.repeat(np.arange(pulls), lengths)
        others = np.array([_least_squares(matrix[left != k], force[left != k], asked) for k in range(pulls)])
        jackknife = np.sqrt((pulls - 1) * others.var(axis=0))
        deviations = np.maximum(deviations, np.where(asked, jackknife, np.inf))
    return found, deviations, variance


def _least_squares(matrix: np.ndarray, force: np.ndarray, asked: np.ndarray) -> np.ndarray:
    found = np.zeros(len(asked))
    found[asked] = lsq_linear(matrix[:, asked], force, (LOWER[ASKED][asked], UPPER[ASKED][asked])).x
    return found


def _moving_samples(body: Moving, pull: Pull) -> tuple[np.ndarray, np.ndarray]:
    """Return what ASKED are multiplied with, and the force [N], where a pull moves."""
    step = pull.step

    def smooth(values: np.ndarray) -> np.ndarray:
        return gaussian_filter1d(values, SMOOTHED / step, mode="nearest")

    opening = smooth(pull.opening)
    speed, speeding = np.gradient(opening, step), np.zeros_like(opening)
    speeding[1:-1] = np.diff(opening, 2) / step**2
    first, second = body.gravity
    turn = pull.opening / body.lever if body.joint.kind == "revolute" else np.zeros_like(opening)
    weight = smooth(first * np.cos(turn) + second * np.sin(turn))
    acts = smooth(np.clip((body.reach - pull.opening) / (EDGE * body.reach), 0.0, 1.0))
    soft = (acts, acts * np.minimum(speed, 0.0))
    columns = np.column_stack([body.inertia * speeding - weight, speed, np.sign(speed), opening, *soft])
    around = np.ones(2 * round(REACH * SMOOTHED / step) + 1)
    kept = binary_erosion(np.abs(speed) > MOVES, around) & binary_erosion(np.ones(len(speed), bool), around)
    return columns[kept], smooth(pull.force)[kept]
