"""The dynamics of a joint whose motion is known well, as a robot's own joints tell it: then the force is linear in them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag, toeplitz
from scipy.ndimage import binary_erosion, gaussian_filter1d
from scipy.optimize import lsq_linear

from s2a.diff.dynamics import LOWER, UPPER, Dynamics
from s2a.diff.joint_kernels import PARAMETERS
from s2a.diff.moving_body import Moving
from s2a.diff.pull import Pull, same_step
from s2a.errors import InputError

SMOOTHED = 0.05
"""[s] Standard deviation of the Gaussian that smooths motion and force alike, which leaves their relation as it is."""
REACH = 2.5
"""Standard deviations around a sample that have to be of the same motion."""
MOVES = 0.01
"""[m/s] Slower, dry friction may be anything below its bound."""
ASKED = [PARAMETERS.index(name) for name in ("mass", "damping", "friction", "spring")]


def fit(body: Moving, pulls: Sequence[Pull], force_noise: float) -> Dynamics:
    """Return the dynamics by which the motion explains the force, by least squares over the samples that move.

    A force's noise is an error of the outcome alone, and biases nothing; that of positions hardly shows in the smoothed
    accelerations. The deviations are those of the residuals, which the smoothing has made alike among neighbours. Breakaway is
    not asked for.

    Args:
        body: with the stage's mass.
        pulls: recordings at one rate.
        force_noise: standard deviation of their samples [N], for the misfit alone.

    Raises:
        InputError: the pulls do not move long enough.
    """
    step = same_step(pulls)
    columns, forces = zip(*(_moving_samples(body, pull) for pull in pulls), strict=True)
    matrix, force = np.concatenate(columns), np.concatenate(forces)
    if len(force) < 4 * len(ASKED):
        raise InputError(
            f"the part moves faster than {MOVES} m/s in {len(force)} samples only; give pulls of half a second or longer"
        )
    found = lsq_linear(matrix, force, (LOWER[ASKED], UPPER[ASKED]))
    residual = force - matrix @ found.x
    # Smoothed white noise: samples k steps apart correlate by exp(-(k step / 2 SMOOTHED)^2).
    alike = block_diag(*(toeplitz(np.exp(-((np.arange(len(own)) * step / (2 * SMOOTHED)) ** 2))) for own in forces))
    inverse = np.linalg.pinv(matrix)
    free = len(force) - np.trace(matrix @ (inverse @ alike))
    variance = float(residual @ residual) / max(free, 1.0)
    values, deviations = np.zeros(len(PARAMETERS)), np.full(len(PARAMETERS), np.inf)
    values[ASKED] = found.x
    deviations[ASKED] = np.sqrt(variance * np.diagonal(inverse @ alike @ inverse.T))
    expected = force_noise**2 * step / (2.0 * np.sqrt(np.pi) * SMOOTHED)
    return Dynamics(values, deviations, variance / expected)


def _moving_samples(body: Moving, pull: Pull) -> tuple[np.ndarray, np.ndarray]:
    """Return what mass, damping, friction and spring are multiplied with, and the force [N], where a pull moves."""
    step = pull.step

    def smooth(values: np.ndarray) -> np.ndarray:
        return gaussian_filter1d(values, SMOOTHED / step, mode="nearest")

    opening = smooth(pull.opening)
    speed, speeding = np.gradient(opening, step), np.zeros_like(opening)
    speeding[1:-1] = np.diff(opening, 2) / step**2
    first, second = body.gravity
    turn = pull.opening / body.lever if body.joint.kind == "revolute" else np.zeros_like(opening)
    weight = smooth(first * np.cos(turn) + second * np.sin(turn))
    columns = np.column_stack([body.inertia * speeding - weight, speed, np.sign(speed), opening])
    around = np.ones(2 * round(REACH * SMOOTHED / step) + 1)
    kept = binary_erosion(np.abs(speed) > MOVES, around) & binary_erosion(np.ones(len(speed), bool), around)
    return columns[kept], smooth(pull.force)[kept]
