"""Joint paths: what the arm does so that its tool frame follows a path."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from s2a.robot.kinematics import Kinematics

EXACT = 1e-4
"""Accepted root of the squared errors: 0.1 mm and 0.1 mrad."""
JUMP = 0.3
"""[rad] Largest change of a joint from one pose to the next: more is another IK branch."""
MARGIN = 0.02
"""[rad] What every joint keeps from its limits."""
TURN = 0.05
"""[rad] Largest change of a joint between two poses that are checked for collisions: 4 cm at arm's length."""
HALF_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])
"""A parallel gripper holds as well with its fingers exchanged."""


def follow(
    kin: Kinematics,
    poses: np.ndarray,
    bases: np.ndarray,
    ik_seeds: int | Sequence[int],
    seed: int = 0,
    near: np.ndarray | None = None,
) -> list[np.ndarray]:
    """Return, for each base, the joint paths with which the arm can follow a tool path, shape [path pose arm].

    Args:
        kin: of the robot.
        poses: of the tool frame, shape [pose 4 4], or [base pose 4 4] for a path of each base's own; scene frame; it may also be
            turned by half about its z axis.
        bases: poses of the base, shape [base 4 4], scene frame.
        ik_seeds: starts of the inverse kinematics for each base (one number for all, or one each) and both gripper rolls:
            home, and random ones.
        seed: of those.
        near: joints to start from at each base instead of home, shape [base arm]: where the arm comes from, so that the branch on
            which it stays is among those found.
    """
    local = np.linalg.inv(bases)[:, None] @ (poses if poses.ndim == 4 else poses[None])
    counts = np.broadcast_to(ik_seeds, len(bases))
    owner = np.tile(np.repeat(np.arange(len(bases)), counts), 2)
    targets = np.repeat(np.concatenate([local, local @ HALF_TURN]), np.tile(counts, 2), axis=0)
    starts = np.random.default_rng(seed).uniform(kin.lower, kin.upper, (counts.max(), len(kin.lower)))
    starts[0] = kin.spec.home
    each = [starts[:count].copy() for count in counts]
    for begun, joints in zip(each, [] if near is None else near, strict=near is not None):
        begun[:1] = joints
    first = np.concatenate(each)
    q, left = kin.solve(targets[:, 0], np.tile(first, (2, 1)), iterations=40, damping=1e-2)
    alive = np.flatnonzero((left < EXACT) & (_margin(kin, q) > MARGIN))
    path = [q[alive]]
    for k in range(1, local.shape[1]):
        # Most starts are near enough for a few steps; the others get more before they are given up.
        q, left = kin.solve(targets[alive, k], path[-1], iterations=4, damping=1e-4)
        late = np.flatnonzero(left >= EXACT)
        q[late], left[late] = kin.solve(targets[alive[late], k], path[-1][late], iterations=12, damping=1e-2)
        good = (left < EXACT) & (np.abs(q - path[-1]).max(axis=1) < JUMP) & (_margin(kin, q) > MARGIN)
        alive, path = alive[good], [*(p[good] for p in path), q[good]]
    paths = np.stack(path, axis=1)
    return [paths[owner[alive] == b] for b in range(len(bases))]


def _margin(kin: Kinematics, q: np.ndarray) -> np.ndarray:
    """Return the smallest distance of joints [pose arm] from their limits [rad], shape [pose]."""
    return np.minimum(q - kin.lower, kin.upper - q).min(axis=1)


def straight(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the joint path from one position to another on which all joints turn evenly, shape [pose arm], without its start."""
    count = max(1, int(np.ceil(np.abs(end - start).max() / TURN)))
    return start + np.linspace(0.0, 1.0, count + 1)[1:, None] * (end - start)
