"""The law of `s2a.joints.dynamics` once more, in double precision and without a solver, to measure gradients against."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from s2a.joints.dynamics import kalman
from s2a.joints.pull import Noise, Pull
from s2a.joints.pulled import Moving

SHARPNESS, STRIBECK, EDGE = 6.0, 0.05, 0.25


def loss(parameters: np.ndarray, body: Moving, pulls: Sequence[Pull], noise: Noise, substeps: int) -> float:
    """Return the loss of recordings of one body."""
    return sum(_one(parameters, body, pull, noise, substeps) for pull in pulls)


def gradient(parameters: np.ndarray, *args: object) -> np.ndarray:
    """Return the loss's central differences; double precision leaves them 1e-6 or so."""
    steps = 1e-5 * np.maximum(np.abs(parameters), 0.1)
    return np.array(
        [(loss(parameters + e, *args) - loss(parameters - e, *args)) / (2 * e.max()) for e in np.diag(steps)]
    )


def _one(parameters: np.ndarray, body: Moving, pull: Pull, noise: Noise, substeps: int) -> float:
    mass, damping, friction, breakaway, spring, pull_in, closing = parameters
    onto, speed_onto, variance = kalman(body.inertia, pull.step, noise)
    first, second = body.gravity
    opening, force = (values.astype(np.float32).astype(float) for values in (pull.opening, pull.force))
    dt, heavy = pull.step / substeps, mass * body.inertia
    s, v, total = opening[0], 0.0, 0.0
    for sample in range(len(opening) - 1):
        for i in range(substeps):
            turn = s / body.lever if body.joint.kind == "revolute" else 0.0
            drive = force[sample] + i / substeps * (force[sample + 1] - force[sample])
            acts = np.clip((body.reach - s) / (EDGE * body.reach), 0, 1)
            drive += mass * (first * np.cos(turn) + second * np.sin(turn)) - spring * s - pull_in * acts
            inverse = dt / heavy
            free, half = v + inverse * drive, 0.5 * inverse * (damping + (v < 0) * closing * acts)
            damped = (free - half * v) / (1 + half)
            u = damped * (1 + half) / inverse
            most = friction + breakaway * np.exp(-((damped / STRIBECK) ** 2)) + 1e-4
            dry = u * most / (abs(u) ** SHARPNESS + most**SHARPNESS) ** (1 / SHARPNESS)
            v += inverse * (drive - (free - damped) / inverse - dry / (1 + half))
            s += dt * v
        missed = opening[sample + 1] - s
        total += missed**2 / (2 * variance)
        s, v = s + onto * missed, v + speed_onto * missed
    return total
