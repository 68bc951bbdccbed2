"""Straight paths of the tool before and after a grasp."""

from __future__ import annotations

import numpy as np

from s2a.robot.kinematics import Kinematics

APPROACH, LIFT = 0.10, 0.08
"""[m] Straight paths before the grasp and after the release, and above start and place."""
STEP = 0.02
"""[m] Between poses of a straight path."""


def there_and_up(tool: np.ndarray) -> np.ndarray:
    """Return poses [pose 4 4] from APPROACH before a tool pose [4 4] to it, and from there LIFT up, STEP apart."""
    back = _line(tool, -APPROACH * tool[:3, 2])[::-1]
    return np.concatenate([back, _line(tool, np.array([0.0, 0.0, LIFT]))[1:]])


def _line(tool: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Return poses from a tool pose [4 4] to the same shifted by an offset [3], STEP apart, shape [pose 4 4]."""
    count = round(float(np.linalg.norm(offset)) / STEP) + 1
    poses = np.tile(tool, (count, 1, 1))
    poses[:, :3, 3] += np.linspace(0.0, 1.0, count)[:, None] * offset
    return poses


def unflipped(kin: Kinematics, paths: np.ndarray, base: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Return those of joint paths [path pose arm] along tool poses [pose 4 4] on which the tool is not turned by half."""
    wanted = np.linalg.inv(base) @ poses[0]
    turn = np.einsum("pij,ij->p", kin.tool(paths[:, 0])[:, :3, :3], wanted[:3, :3])
    return paths[turn > 2.9]  # the trace of a rotation by 0: 3; by half a turn: -1
