"""Whether an arm collides: where it starts, on its path to a handle, and while it moves the handle."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from s2a.prepare.obstacles import Obstacles
from s2a.robot.collision import SLACK, Penetration, RobotShape
from s2a.robot.tool_path import HALF_TURN, straight

UNREACHABLE = 10.0
"""Depth [m] that stands for a place from which the arm cannot reach."""
MAX_REACH_TIME = 2.0
"""[s] In which every joint, at full speed, has to turn from home to the path: an episode has to have time for the rest."""
TRIED = 8
"""Number of joint paths that are checked: those that begin nearest to home."""


def start_collision(near: Obstacles, shape: RobotShape, base: np.ndarray, first: np.ndarray) -> Penetration:
    """Return the robot's deepest collision at home and with the gripper's straight path from there, with words for it.

    Args:
        near: what it can collide with.
        shape: of the robot.
        base: pose of the base, shape [4 4], scene frame.
        first: pose of the tool frame at the point of approach, shape [4 4], scene frame.
    """
    home = np.array(shape.kin.spec.home)
    depth, owner = _robot(near, shape, base, home[None], moving=True)
    if depth > SLACK:
        return depth, f"the start pose reaches {1000 * depth:.0f} mm into {owner}"
    depth, owner = _straight(near, shape, base @ shape.kin.tool(home[None])[0], first)
    return depth, f"the gripper on its path reaches {1000 * depth:.0f} mm into {owner}"


def path_collision(near: Obstacles, shape: RobotShape, base: np.ndarray, paths: np.ndarray) -> Penetration:
    """Return the robot's deepest collision on its way from home to the handle and with it, on the best of its joint paths.

    Args:
        near: what it can collide with.
        shape: of the robot.
        base: pose of the base, shape [4 4], scene frame.
        paths: joint paths from the point of approach on [rad], shape [path pose arm].
    """
    kin = shape.kin
    home = np.array(kin.spec.home)
    paths = paths[((paths > kin.lower) & (paths < kin.upper)).all(axis=(1, 2))]
    distance = np.abs(paths[:, 0] - home).max(axis=1)
    time = (np.abs(paths[:, 0] - home) / kin.spec.limits.velocity).max(axis=1)
    order = np.argsort(distance, kind="stable")
    best: Penetration = (UNREACHABLE, "the arm cannot turn so far")
    for path in paths[order[time[order] < MAX_REACH_TIME]][:TRIED]:
        depth, owner = _path_collision(near, shape, base, straight(home, path[0]), path)
        if depth <= SLACK:
            return 0.0, ""
        best = min(best, (depth, f"the arm reaches {1000 * depth:.0f} mm into {owner}"))
    return best


def _path_collision(
    near: Obstacles, shape: RobotShape, base: np.ndarray, reach: np.ndarray, path: np.ndarray
) -> Penetration:
    """Return the deepest collision on the joint path to the point of approach [pose arm] and on that from there."""
    depth, owner = _robot(near, shape, base, path[1:], moving=False)
    if depth > SLACK:
        return depth, f"{owner} on its path"
    depth, owner = _robot(near, shape, base, reach, moving=True)
    if depth > SLACK:
        return depth, f"{owner} on its path to the handle"
    return shape.self_penetration(np.concatenate([reach, path]))


def _robot(near: Obstacles, shape: RobotShape, base: np.ndarray, q: np.ndarray, *, moving: bool) -> Penetration:
    """Return the deepest collision in joints [pose arm]; while it moves the handle, the fingers may touch what they hold."""
    chosen = shape.moving & (~shape.fingers | moving)
    centers = shape.centers(q)[:, chosen] @ base[:3, :3].T + base[:3, 3]
    return near.penetration(centers.reshape(-1, 3), np.tile(shape.radii[chosen], len(q)), moving=moving)


def _straight(near: Obstacles, shape: RobotShape, start: np.ndarray, end: np.ndarray) -> Penetration:
    """Return the gripper's deepest collision on the straight path between two poses of the tool frame [4 4]."""
    best: Penetration = (np.inf, "")
    for flip in (np.eye(3), HALF_TURN[:3, :3]):
        turns = Rotation.from_matrix(np.stack([start[:3, :3], end[:3, :3] @ flip]))
        count = max(2, int(np.linalg.norm(end[:3, 3] - start[:3, 3]) / 0.03))
        fraction = np.linspace(0.0, 1.0, count)
        matrices = Slerp([0.0, 1.0], turns)(fraction).as_matrix()
        places = start[:3, 3] + fraction[:, None] * (end[:3, 3] - start[:3, 3])
        centers = np.einsum("kij,sj->ksi", matrices, shape.gripper) + places[:, None]
        best = min(best, near.penetration(centers.reshape(-1, 3), np.tile(shape.gripper_radii, count), moving=True))
        if best[0] <= 0.0:
            break
    return best
