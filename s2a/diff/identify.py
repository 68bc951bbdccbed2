"""The dynamics of joints from recordings of how they were pulled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from s2a.diff.joint_kernels import PARAMETERS
from s2a.diff.joint_worlds import JointWorlds
from s2a.diff.moving_body import Moving
from s2a.diff.pull import Noise, Pull, same_step
from s2a.diff.together import Evaluate, minimize_together

TYPICAL = np.array([1.0, 5.0, 2.0, 1.0, 10.0])
"""Of PARAMETERS: unit of the variables that are searched, but for the mass, whose variable is its logarithm."""
LOWER = np.array([0.05, 0.0, 0.0, 0.0, 0.0])
UPPER = np.array([20.0, 200.0, 100.0, 50.0, 500.0])
STARTS = np.array([[1.0, 5.0, 2.0, 1.0, 10.0], [0.4, 2.0, 1.0, 0.2, 2.0], [3.0, 15.0, 5.0, 1.0, 20.0]])
"""Where the search begins; the later ones where an earlier one ended in a poor minimum."""
POOR = 1.5
"""Misfit from which a minimum is poor."""
ROUNDS = 60
STEP = 0.01
"""Of the variables, in the differences of gradients by which the curvature is measured."""
NINETY = 1.6449
"""Standard deviations of a normal distribution on either side of its mean that hold 90 %."""


@dataclass(frozen=True)
class Dynamics:
    """What resists at a joint's grasp point, as PARAMETERS name it.

    Attributes:
        values: shape [parameter].
        deviations: standard deviations, shape [parameter]; infinite where the recordings do not tell.
        misfit: mean square of the innovations over their expected variance: 1 where the model and the noise are right.
    """

    values: np.ndarray
    deviations: np.ndarray
    misfit: float

    def interval(self, name: str) -> tuple[float, float]:
        """Return the bounds between which a parameter lies with 90 %."""
        i = PARAMETERS.index(name)
        low, high = (float(self.values[i] + sign * NINETY * self.deviations[i]) for sign in (-1.0, 1.0))
        return max(low, float(LOWER[i])), min(high, float(UPPER[i]))


def identify(
    bodies: Sequence[Moving], pulls: Sequence[Sequence[Pull]], noise: Noise, device: str = "cpu"
) -> list[Dynamics]:
    """Return the dynamics of each body's joint that explain its recordings best.

    Args:
        bodies: with the stage's masses.
        pulls: one or more recordings of each, all at one rate.
        noise: of their samples.
        device: cpu or cuda:0.
    """
    worlds = JointWorlds(bodies, pulls, same_step([pull for own in pulls for pull in own]), noise, device)

    def evaluate(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        loss, gradient = worlds.loss(parameters(x))
        return loss, gradient * slopes(x)

    expected = np.array([sum(len(pull.opening) - 1 for pull in own) for own in pulls]) / 2.0
    points, values = np.zeros((len(bodies), len(PARAMETERS))), np.full(len(bodies), np.inf)
    for start in STARTS:
        poor = values > POOR * expected
        begin = np.where(poor[:, None], variables(start), points)
        found = minimize_together(evaluate, begin, variables(LOWER), variables(UPPER), ROUNDS, poor)
        better = found.values < values
        points[better], values[better] = found.points[better], found.values[better]
        if (values <= POOR * expected).all():
            break
    hessians, scale = curvature(evaluate, points), slopes(points)
    return [
        Dynamics(x, deviations(point, hessian) * each, value / count)
        for x, point, hessian, each, value, count in zip(
            parameters(points), points, hessians, scale, values, expected, strict=True
        )
    ]


def variables(values: np.ndarray) -> np.ndarray:
    """Return what is searched for PARAMETERS, shape [.. parameter]: the mass's logarithm, the others in TYPICAL."""
    found = values / TYPICAL
    found[..., 0] = np.log(values[..., 0])
    return found


def parameters(x: np.ndarray) -> np.ndarray:
    """Return PARAMETERS of what is searched, shape [.. parameter]."""
    found = x * TYPICAL
    found[..., 0] = np.exp(x[..., 0])
    return found


def slopes(x: np.ndarray) -> np.ndarray:
    """Return the derivative of each parameter by its variable, shape [.. parameter]."""
    found = np.broadcast_to(TYPICAL, x.shape).copy()
    found[..., 0] = np.exp(x[..., 0])
    return found


def curvature(evaluate: Evaluate, x: np.ndarray) -> np.ndarray:
    """Return the second derivatives of each problem at its point, shape [problem variable variable]."""
    columns = []
    for k in range(x.shape[1]):
        ahead, behind = x.copy(), x.copy()
        ahead[:, k] += STEP
        behind[:, k] = np.maximum(behind[:, k] - STEP, variables(LOWER)[k])
        columns.append((evaluate(ahead)[1] - evaluate(behind)[1]) / (ahead - behind)[:, k, None])
    found = np.stack(columns, axis=1)
    return (found + found.transpose(0, 2, 1)) / 2


def deviations(x: np.ndarray, hessian: np.ndarray) -> np.ndarray:
    """Return standard deviations of a minimum's variables from its curvature; infinite where that is none.

    What lies at a bound does not move with the others; its deviation is that of its own curvature.
    """
    free = (x > variables(LOWER) + 1e-6) & (x < variables(UPPER) - 1e-6)
    own = np.diagonal(hessian)
    found = np.where(own > 0.0, 1.0 / np.sqrt(np.maximum(own, 1e-12)), np.inf)
    index = np.flatnonzero(free)
    if len(index):
        values, vectors = np.linalg.eigh(hessian[np.ix_(index, index)])
        found[index] = np.sqrt((vectors**2 / values).sum(axis=1)) if values.min() > 0.0 else np.inf
    return found
