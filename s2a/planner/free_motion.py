"""Collision-free motions of an arm between two joint positions: OMPL's RRT-Connect, shortened and smoothed."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from s2a.errors import InputError
from s2a.robot.joint_path import TURN, straight

Free = Callable[[np.ndarray], np.ndarray]
"""Joints [pose arm] -> whether each collides with nothing, shape [pose]."""


def free_motion(
    start: np.ndarray, goal: np.ndarray, lower: np.ndarray, upper: np.ndarray, free: Free, seconds: float, seed: int
) -> np.ndarray | None:
    """Return evenly spaced joint positions [pose arm] from start to goal that collide with nothing; None: none was found.

    Args:
        start: joints [arm].
        goal: joints [arm].
        lower: limits of the joints [rad], shape [arm].
        upper: likewise.
        free: what is asked of joints.
        seconds: for the search.
        seed: of the search.

    Raises:
        InputError: OMPL is not installed.
    """
    direct = np.concatenate([start[None], straight(start, goal)])
    if free(direct).all():
        return direct
    try:
        from ompl import base, geometric, util
    except ImportError as error:
        raise InputError("planning around obstacles needs OMPL; install the extra: pip install 's2a[sim]'") from error
    _seed_once(util, seed)
    count = len(start)
    space, bounds = base.RealVectorStateSpace(count), base.RealVectorBounds(count)
    for i in range(count):
        bounds.setLow(i, float(lower[i]))
        bounds.setHigh(i, float(upper[i]))
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(lambda state: bool(free(_joints(state, count)[None])[0]))
    ends = []
    for joints in (start, goal):
        state = space.allocState()
        for i in range(count):
            state[i] = float(joints[i])
        ends.append(state)
    setup.setStartAndGoalStates(*ends)
    info = setup.getSpaceInformation()
    info.setStateValidityCheckingResolution(TURN / float(np.linalg.norm(upper - lower)))
    setup.setPlanner(geometric.RRTConnect(info))
    setup.solve(seconds)
    if not setup.haveExactSolutionPath():
        return None
    setup.simplifySolution(min(1.0, seconds))
    path = setup.getSolutionPath()
    corners = np.array([_joints(path.getState(i), count) for i in range(path.getStateCount())])
    return _rounded(corners, free)


@cache
def _once(util: object) -> list[int]:
    """Return the seed that OMPL was given in this process, if any: it takes one before its first number alone."""
    return []


def _seed_once(util: object, seed: int) -> None:
    """Seed OMPL's random numbers, once a process, and keep its log to errors."""
    if not _once(util):
        util.setLogLevel(util.LogLevel.LOG_ERROR)  # type: ignore[attr-defined]
        util.RNG.setSeed(seed + 1)  # type: ignore[attr-defined]
        _once(util).append(seed)


def _joints(state: object, count: int) -> np.ndarray:
    return np.array([state[i] for i in range(count)])  # type: ignore[index]


def _rounded(corners: np.ndarray, free: Free) -> np.ndarray | None:
    """Return evenly spaced poses along a path, its corners rounded as far as that is free."""
    dense = _even(corners)
    for width in (15, 9, 5, 0):
        path = dense.copy()
        for _ in range(2 if width else 0):
            padded = np.concatenate([np.repeat(path[:1], width, 0), path, np.repeat(path[-1:], width, 0)])
            sums = np.cumsum(np.concatenate([padded[:1] * 0, padded]), axis=0)
            path = (sums[2 * width + 1 :] - sums[: -2 * width - 1]) / (2 * width + 1)
        path = np.concatenate([corners[:1], _even(path)[1:-1], corners[-1:]]) if width else dense
        if free(path).all():
            return path
    return None


def _even(path: np.ndarray) -> np.ndarray:
    """Return a path [corner arm] as poses TURN apart along its length, shape [pose arm]."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], max(3, int(np.ceil(length[-1] / TURN)) + 1))
    return np.stack([np.interp(at, length, column) for column in path.T], axis=1)
