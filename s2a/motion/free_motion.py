"""Collision-free motions of an arm between two joint positions: OMPL's RRT-Connect, shortened and smoothed."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from s2a.core.errors import InputError
from s2a.robot.tool_path import JOINT_TURN, straight

Free = Callable[[np.ndarray], np.ndarray]  # Joints [pose arm] -> whether each collides with nothing, shape [pose]
# Joint positions that a search may ask about, and its shortening: counted, so that what it returns does not depend on the
# speed of a machine
CHECKS, SHORTENING = 6000, 1500
EVERY = 4  # Of so many joint positions along a line one is asked about first, then all others


def free_motion(
    start: np.ndarray, goal: np.ndarray, lower: np.ndarray, upper: np.ndarray, free: Free, seed: int
) -> np.ndarray | None:
    """Return evenly spaced joint positions [pose arm] from start to goal that collide with nothing; None: none was found.

    Args:
        start: joints [arm].
        goal: joints [arm].
        lower: limits of the joints [rad], shape [arm].
        upper: likewise.
        free: what is asked of joints.
        seed: of the search, whatever was searched before.

    Raises:
        InputError: OMPL is not installed.
    """
    direct = np.concatenate([start[None], straight(start, goal)])
    if free(direct).all():
        return direct
    try:
        from ompl import base, geometric, util  # most motions are direct, and do without
    except ImportError as error:
        raise InputError("planning around obstacles needs OMPL; install the extra: pip install 's2a[sim]'") from error
    # OMPL complains of a seed after its first number; all that draws in this search is made after it, so it holds.
    util.setLogLevel(util.LogLevel.LOG_NONE)
    util.RNG.setSeed(seed + 1)
    util.setLogLevel(util.LogLevel.LOG_ERROR)
    count = len(start)
    space, bounds = base.RealVectorStateSpace(count), base.RealVectorBounds(count)
    for i in range(count):
        bounds.setLow(i, float(lower[i]))
        bounds.setHigh(i, float(upper[i]))
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    search = _Counted(free)
    setup.setStateValidityChecker(lambda state: search.all_free(_joints(state, count)[None]))
    ends = []
    for joints in (start, goal):
        state = space.allocState()
        for i in range(count):
            state[i] = float(joints[i])
        ends.append(state)
    setup.setStartAndGoalStates(*ends)
    info = setup.getSpaceInformation()
    info.setMotionValidator(_line_check(base)(info, search, count))
    setup.setPlanner(geometric.RRTConnect(info))
    setup.solve(base.PlannerTerminationCondition(lambda: search.asked >= CHECKS))
    if not setup.haveExactSolutionPath():
        return None
    search.asked = 0
    setup.simplifySolution(base.PlannerTerminationCondition(lambda: search.asked >= SHORTENING))
    path = setup.getSolutionPath()
    corners = np.array([_joints(path.getState(i), count) for i in range(path.getStateCount())])
    return _rounded(corners, free)


class _Counted:
    """What says whether joints are free, and how many it was asked about."""

    def __init__(self, free: Free) -> None:
        self._free, self.asked = free, 0

    def all_free(self, q: np.ndarray) -> bool:
        """Return whether all of some joints [pose arm] are free."""
        self.asked += len(q)
        return bool(self._free(q).all())


@cache
def _line_check(base: Any) -> Any:
    """Return OMPL's check of straight lines, a class that asks about many joints at once: one by one takes several times as long.

    It is made once: a class is freed by the garbage collector alone, and would hold all that a search has read until then.
    """

    class LineCheck(base.MotionValidator):
        def __init__(self, info: object, search: _Counted, count: int) -> None:
            super().__init__(info)
            self._search, self._count = search, count

        def checkMotion(self, start: object, end: object, last: object = None) -> bool:  # noqa: N802 - OMPL's name
            line = _even(np.stack([_joints(start, self._count), _joints(end, self._count)]))[:0:-1]
            first = np.arange(len(line)) % EVERY == 0
            return self._search.all_free(line[first]) and self._search.all_free(line[~first])

    return LineCheck


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
    at = np.linspace(0.0, length[-1], max(3, int(np.ceil(length[-1] / JOINT_TURN)) + 1))
    return np.stack([np.interp(at, length, column) for column in path.T], axis=1)
