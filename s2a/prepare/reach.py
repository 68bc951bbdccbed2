"""Which ways of the hand the arm can follow from where it stands."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.articulation import displace
from s2a.robot import panda
from s2a.scene import Joint
from s2a.usd.sim_scene import Grasp

STEP = 0.015
"""[m] Distance between the poses at which a way is checked."""
EXACT = 1e-4
"""[m + rad] What may be left between tool and target; a planner that moves by it takes 1 mm and 1 mrad, squared and added."""
JUMP = 0.3
"""[rad] Largest turn of a joint from one pose to the next: more is another branch."""
MARGIN = 0.02
"""[rad] What every joint keeps from its limits."""


def hand_way(grasp: Grasp, joint: Joint, approach: float, opening: float) -> np.ndarray:
    """Return the poses of the tool on its way: straight to the grasp, then with the part; shape [pose 4 4], scene frame.

    Args:
        grasp: where it takes hold, the part at zero.
        joint: of the part.
        approach: where the straight way begins, before the grasp [m].
        opening: coordinate to which the part is opened [m] or [rad], with its sign.
    """
    start = np.eye(4)
    start[:3, :3], start[:3, 3] = Rotation.from_quat(grasp.orientation).as_matrix(), grasp.point
    poses = []
    for back in np.linspace(approach, 0.0, max(2, round(approach / STEP) + 1)):
        pose = start.copy()
        pose[:3, 3] -= back * start[:3, 2]
        poses.append(pose)
    length = np.linalg.norm(displace(start[None, :3, 3], joint, opening)[0] - start[:3, 3])
    for q in np.linspace(0.0, opening, max(2, round(length / STEP) + 1))[1:]:
        corners = displace(np.concatenate([start[None, :3, 3], start[:3, 3] + start[:3, :3].T]), joint, q)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = (corners[1:] - corners[0]).T, corners[0]
        poses.append(pose)
    return np.array(poses)


def follow(way: np.ndarray, bases: np.ndarray, start: np.ndarray, restarts: int, seed: int = 0) -> list[np.ndarray]:
    """Return, for each base, the joints with which the arm can follow a way, shape [arm pose 7]; none if it cannot.

    Args:
        way: poses of the tool, shape [pose 4 4], scene frame; the hand may also hold on the other way round.
        bases: poses of the base, shape [base 4 4], scene frame.
        start: joints [rad] from which the first try starts, shape [7].
        restarts: tries for each base and either way round, the others from random joints.
        seed: of those.
    """
    half_turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    local = np.linalg.inv(bases)[:, None] @ way[None]
    targets = np.repeat(np.concatenate([local, local @ half_turn]), restarts, axis=0)
    tries = np.random.default_rng(seed).uniform(panda.LOWER, panda.UPPER, (restarts, panda.ARM))
    tries[0] = start
    q, left = panda.solve(targets[:, 0], np.tile(tries, (2 * len(bases), 1)), iterations=60)
    owner = np.tile(np.repeat(np.arange(len(bases)), restarts), 2)
    alive = np.flatnonzero(left < EXACT)
    path = [q[alive]]
    for k in range(1, len(way)):
        q, left = panda.solve(targets[alive, k], path[-1], iterations=15)
        edge = np.minimum(q - panda.LOWER, panda.UPPER - q).min(axis=1)
        good = (left < EXACT) & (np.abs(q - path[-1]).max(axis=1) < JUMP) & (edge > MARGIN)
        alive, path = alive[good], [*(p[good] for p in path), q[good]]
    tracks = np.stack(path, axis=1)
    return [tracks[owner[alive] == b] for b in range(len(bases))]
