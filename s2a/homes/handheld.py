"""Errors of a hand-held scanner: drift along its path, and smoothing of the fused surface."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array

from s2a.core.bounds import NotNegative
from s2a.homes.surface_nets import Net


@dataclass(frozen=True)
class DriftConfig:
    """Errors of the places and directions in which a scanner believes to be: a random walk from pose to pose.

    Attributes:
        step: standard deviation of what each pose adds to the error of its place, along each axis [m].
        turn: the same of its orientation, about each axis [rad].
        closure: fraction of the error at the last pose that closing the loop takes back, spread over all poses.
    """

    step: NotNegative
    turn: NotNegative
    closure: NotNegative


def drifts(count: int, config: DriftConfig, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return errors of places [m] and rotation vectors [rad], shape [pose 3] each; nothing is drawn where there are none."""
    if config.step == 0.0 and config.turn == 0.0:
        return np.zeros((count, 3)), np.zeros((count, 3))
    walks = []
    for size in (config.step, config.turn):
        walk = np.cumsum(rng.normal(0.0, size, (count, 3)), axis=0)
        walks.append(walk - config.closure * np.linspace(0.0, 1.0, count)[:, None] * walk[-1])
    return walks[0], walks[1]


def smoothed(net: Net, passes: int) -> Net:
    """Return a surface whose vertices moved half way to the mean of their neighbours, so many times."""
    points = net.points
    if not passes:
        return net
    edges = np.concatenate([net.faces[:, [0, 1]], net.faces[:, [1, 2]], net.faces[:, [2, 0]]])
    both = np.concatenate([edges, edges[:, ::-1]])
    links = coo_array((np.ones(len(both), np.float32), both.T), shape=(len(points), len(points))).tocsr()
    count = np.maximum(np.asarray(links.sum(axis=1)).reshape(-1, 1), 1.0)
    for _ in range(passes):
        points = 0.5 * points + 0.5 * (links @ points) / count
    return replace(net, points=points.astype(np.float32))
