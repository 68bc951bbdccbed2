"""The Franka Panda as a planner of poses needs it: kinematics, inverse kinematics, spheres around its links.

Dimensions and limits are those of Franka's documentation (and of the URDF in example-robot-data).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

ARM = 7
"""Joints of the arm."""
LOWER = np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973])
UPPER = np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])
"""Limits of the joints [rad]."""
SHOULDER = 0.333
"""[m] The second joint's axis above the base."""
TOOL = 7
"""Index of the frame between the finger pads (0.107 + 0.1034 m from the last joint): z forward, y along the fingers' way."""

# Per joint: offset [m] in the frame before, and turn about its x axis in quarters (modified Denavit-Hartenberg).
_OFFSETS = np.array(
    [[0, 0, 0.333], [0, 0, 0], [0, -0.316, 0], [0.0825, 0, 0], [-0.0825, 0.384, 0], [0, 0, 0], [0.088, 0, 0]]
)
_QUARTERS = (0, -1, 1, 1, -1, 1, 1)
_TOOL = np.array(
    [[np.sqrt(0.5), np.sqrt(0.5), 0, 0], [-np.sqrt(0.5), np.sqrt(0.5), 0, 0], [0, 0, 1, 0.2104], [0, 0, 0, 1]]
)

SPHERES = np.loadtxt(Path(__file__).with_name("panda_spheres.csv"), delimiter=",", skiprows=1)
"""Balls that cover the surfaces of the convex hulls of the links: frame, centre and radius [m], shape [sphere 5].

Frames 0 to 6 are links 1 to 7, frame 7 is the tool; the last four are the open fingers. `tools/panda_spheres.py` made them.
"""
HAND = SPHERES[:, 0] == TOOL
"""Which spheres belong to the hand."""


def frames(q: np.ndarray) -> np.ndarray:
    """Return the poses of links 1 to 7 and of the tool in the base's frame, shape [arm 8 4 4], for joints [arm 7]."""
    poses = np.empty((len(q), ARM + 1, 4, 4))
    pose = np.broadcast_to(np.eye(4), (len(q), 4, 4))
    for i in range(ARM):
        pose = pose @ _turned(i, q[:, i])
        poses[:, i] = pose
    poses[:, TOOL] = pose @ _TOOL
    return poses


def spheres(q: np.ndarray) -> np.ndarray:
    """Return the centres of all spheres in the base's frame [m], shape [arm sphere 3]."""
    poses = frames(q)[:, SPHERES[:, 0].astype(int)]
    return np.einsum("asij,sj->asi", poses[..., :3, :3], SPHERES[:, 1:4]) + poses[..., :3, 3]


def solve(targets: np.ndarray, start: np.ndarray, iterations: int) -> tuple[np.ndarray, np.ndarray]:
    """Turn the joints so that the tool comes to targets, by damped least squares within the limits.

    Args:
        targets: poses of the tool in the base's frame, shape [arm 4 4].
        start: joints to start from [rad], shape [arm 7].
        iterations: steps.

    Returns:
        Joints [arm 7] and what is left: distance [m] plus angle [rad], shape [arm].
    """
    q = start.copy()
    for _ in range(iterations):
        error, jacobian = _error(targets, q)
        square = jacobian @ jacobian.transpose(0, 2, 1) + 1e-4 * np.eye(6)
        step = np.einsum("aji,aj->ai", jacobian, np.linalg.solve(square, error[..., None])[..., 0])
        q = np.clip(q + np.clip(step, -0.3, 0.3), LOWER, UPPER)
    error, _ = _error(targets, q)
    return q, np.linalg.norm(error[:, :3], axis=1) + np.linalg.norm(error[:, 3:], axis=1)


def _turned(joint: int, angle: np.ndarray) -> np.ndarray:
    """Return the poses of a joint's frame in the one before, shape [arm 4 4]."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.zeros((len(angle), 4, 4))
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1] = c, -s, s, c
    turn[:, 2, 2] = turn[:, 3, 3] = 1.0
    k = _QUARTERS[joint]
    fixed = np.eye(4)
    if k:
        fixed[1:3, 1:3] = [[0, -k], [k, 0]]
    fixed[:3, 3] = _OFFSETS[joint]
    return fixed @ turn


def _error(targets: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what is missing to the targets (3 m, 3 rad) [arm 6] and the Jacobian [arm 6 7]."""
    poses = frames(q)
    tool, axes, origins = poses[:, TOOL], poses[:, :ARM, :3, 2], poses[:, :ARM, :3, 3]
    turning = np.cross(tool[:, :3, :3].transpose(0, 2, 1), targets[:, :3, :3].transpose(0, 2, 1)).sum(axis=1) / 2
    # Beyond a quarter turn the sine shrinks again; there any long step in the right direction will do.
    cosine = np.einsum("aij,aij->a", tool[:, :3, :3], targets[:, :3, :3])
    length = np.linalg.norm(turning, axis=1)
    angle = np.arctan2(length, (cosine - 1) / 2)
    turning *= (angle / np.maximum(length, 1e-12))[:, None]
    error = np.concatenate([targets[:, :3, 3] - tool[:, :3, 3], turning], axis=1)
    arms = np.cross(axes, tool[:, None, :3, 3] - origins)
    return error, np.concatenate([arms, axes], axis=2).transpose(0, 2, 1)
