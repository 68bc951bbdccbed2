"""The dynamics of joints from recordings of how they were pulled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from s2a.core.errors import InputError
from s2a.joints import known_motion
from s2a.joints.dynamics import LOWER, TYPICAL, UPPER, Dynamics
from s2a.joints.joint_kernels import PARAMETERS
from s2a.joints.joint_worlds import JointWorlds
from s2a.joints.moving_body import Moving
from s2a.joints.pull import Noise, Pull, same_step
from s2a.joints.together import Evaluate, minimize_together

OPTIONAL = np.isin(PARAMETERS, ("breakaway", "pull_in", "closing"))
"""What a joint need not have: where recordings do not tell, it is none, and the others are fitted without it."""
STARTS = np.array(
    [[1.0, 5.0, 2.0, 1.0, 10.0, 0.0, 0.0], [0.4, 2.0, 1.0, 0.2, 2.0, 0.0, 0.0], [3.0, 15.0, 5.0, 1.0, 20.0, 5.0, 40.0]]
)
"""Where the search begins if it ended in a poor minimum from what least squares tell, one after another."""
POOR = 1.5
"""Misfit from which a minimum is poor."""
ROUNDS = 100
WORSE = 2.0
"""Of log-likelihood: what a parameter that says nothing may explain by chance."""
STEP = 0.01
"""Of the variables, in the differences of gradients by which the curvature is measured."""


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
    for start in (_first(bodies, pulls), *STARTS):
        poor = values > POOR * expected
        begin = np.where(poor[:, None], variables(np.broadcast_to(start, points.shape)), points)
        found = minimize_together(evaluate, begin, variables(LOWER), variables(UPPER), ROUNDS, poor)
        better = found.values < values
        points[better], values[better] = found.points[better], found.values[better]
        if (values <= POOR * expected).all():
            break
    return _without_idle(evaluate, points, values, expected)


def _without_idle(evaluate: Evaluate, points: np.ndarray, values: np.ndarray, expected: np.ndarray) -> list[Dynamics]:
    """Return minima as dynamics, fitted again without what is OPTIONAL and undetermined, where that explains them as well.

    Where it does not, and the curvature told nothing, the deviation is that of the likelihoods with it and without.

    Args:
        evaluate: the loss of all joints.
        points: shape [joint variable].
        values: their losses, shape [joint].
        expected: these where all is right, shape [joint].
    """
    first = _dynamics(evaluate, points, values / expected)
    spread, told = (np.array([getattr(each, name) for each in first]) for name in ("deviations", "determined"))
    upper = np.broadcast_to(variables(UPPER), points.shape).copy()
    points, values = points.copy(), values.copy()
    for k in np.flatnonzero(OPTIONAL):
        idle = ~told[:, k]
        bound = upper.copy()
        bound[idle, k] = 0.0
        fewer = minimize_together(evaluate, np.minimum(points, bound), variables(LOWER), bound, ROUNDS, idle)
        dropped = fewer.values < values + WORSE
        kept = idle & ~dropped
        lost = 2.0 * (fewer.values[kept] - values[kept])
        spread[kept, k] = np.minimum(spread[kept, k], parameters(points)[kept, k] / np.sqrt(lost))
        points[dropped], values[dropped], upper[dropped] = fewer.points[dropped], fewer.values[dropped], bound[dropped]
    again = _dynamics(evaluate, points, values / expected)
    known = OPTIONAL & ~told
    return [
        replace(each, deviations=np.where(none, old, each.deviations))
        for each, none, old in zip(again, known, spread, strict=True)
    ]


def _first(bodies: Sequence[Moving], pulls: Sequence[Sequence[Pull]]) -> np.ndarray:
    """Return what least squares of the force tell, a start for samples so noisy, shape [joint parameter]."""
    found = np.tile(STARTS[0], (len(bodies), 1))
    for i, (body, own) in enumerate(zip(bodies, pulls, strict=True)):
        try:
            found[i] = known_motion.fit(body, own, 1.0).values
        except InputError:  # they hardly move
            continue
    return found


def _dynamics(evaluate: Evaluate, points: np.ndarray, misfits: np.ndarray) -> list[Dynamics]:
    """Return minima [joint variable] with their deviations."""
    rows = zip(points, curvature(evaluate, points), parameters(points), slopes(points), misfits, strict=True)
    return [Dynamics(x, deviations(point, hessian) * slope, misfit) for point, hessian, x, slope, misfit in rows]


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

    What lies at a bound does not move with the others; its deviation is that of its own curvature. Nor do those that curve it
    downwards, what is OPTIONAL before the others: dry friction has kinks.
    """
    free = (x > variables(LOWER) + 1e-6) & (x < variables(UPPER) - 1e-6)
    own = np.diagonal(hessian)
    found = np.where(own > 0.0, 1.0 / np.sqrt(np.maximum(own, 1e-12)), np.inf)
    index = np.flatnonzero(free)
    while len(index):
        values, vectors = np.linalg.eigh(hessian[np.ix_(index, index)])
        if values[0] > 0.0:
            found[index] = np.sqrt((vectors**2 / values).sum(axis=1))
            break
        flat = (np.abs(vectors[:, 0]) * np.where(OPTIONAL[index], 10.0, 1.0)).argmax()
        found[index[flat]], index = np.inf, np.delete(index, flat)
    return found
