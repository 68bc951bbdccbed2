"""Whether the arm touches the room on the way that it is to take: asked of MuJoCo, without simulating."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from s2a.robot.model import ARM_JOINTS, JOINTS
from s2a.sim.simulation import Simulation

SLACK = 0.005
"""[m] A way on which colliders overlap by less counts as free: they reach a little beyond what was scanned."""
TURN = 0.05
"""[rad] Largest turn of a joint between two poses that are looked at: at arm's length 4 cm."""
EVERY = 6
"""Of the steps of a path, which lie close together, every so many are looked at."""


def freest(sim: Simulation, paths: np.ndarray) -> int:
    """Return the index of the first path [path step 9] that is free, or of that on which the arm reaches least into anything.

    The arm turns all joints evenly from the start position to the path's first step and then follows it. Before that step it
    may touch nothing; from there on the fingers are where they hold, and the part moves with them.
    """
    depth = _depth(sim.solver.mj_model)
    start = np.asarray(sim.robot.start)
    best = (np.inf, 0)
    for k, path in enumerate(paths):
        worst = max(depth(_turning(start, path[0]), False), depth(path[::EVERY], True))
        if worst <= SLACK:
            return k
        best = min(best, (worst, k))
    return best[1]


def _turning(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return joints [step 9] that turn evenly from one position to another."""
    count = max(1, int(np.ceil(np.abs(end - start)[:ARM_JOINTS].max() / TURN)))
    return start + np.linspace(0.0, 1.0, count + 1)[1:, None] * (end - start)


def _depth(model: mujoco.MjModel) -> Callable[[np.ndarray, bool], float]:
    """Return what tells how deep the robot's colliders reach into others [m] in joints [step 9], the room as scanned.

    The second argument says whether the hand holds the part: then the fingers do not count, nor does what can move.
    """
    data = mujoco.MjData(model)
    owner = model.body_weldid[model.geom_bodyid]
    moved = model.dof_bodyid[:JOINTS]
    robot, fingers, still = np.isin(owner, moved), np.isin(owner, moved[ARM_JOINTS:]), owner == 0

    def depth(q: np.ndarray, holding: bool) -> float:
        ours, theirs = (robot & ~fingers, still) if holding else (robot, ~robot)
        worst = 0.0
        for joints in q:
            data.qpos[:JOINTS] = joints
            mujoco.mj_kinematics(model, data)
            mujoco.mj_collision(model, data)
            a, b = data.contact.geom.T
            hit = (ours[a] & theirs[b]) | (ours[b] & theirs[a])
            worst = max(worst, float(-data.contact.dist[hit].min(initial=0.0)))
        return worst

    return depth
