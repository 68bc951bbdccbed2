"""Paths of the tool frame: straight to a grasp, then with the part that it holds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.scene.articulation import displace, lever_arm, open_limit, pose_at, transform
from s2a.scene.scene import Joint

STEP = 0.015
"""[m] Distance between neighbouring poses."""
TURN = 0.1
"""[rad] Largest rotation between neighbouring poses."""


@dataclass(frozen=True)
class ToolPath:
    """Poses that the tool frame passes.

    Attributes:
        poses: shape [pose 4 4], scene frame.
        q: coordinate of the part's joint at each [m or rad], shape [pose].
        grasp: index of the pose in which the gripper closes, or touches the part that it pushes.
        pushes: the gripper is closed from the beginning, and pushes.
    """

    poses: np.ndarray
    q: np.ndarray
    grasp: int
    pushes: bool = False


def opening_coordinate(joint: Joint, point: np.ndarray, opening: float) -> float:
    """Return the coordinate of a joint [m] or [rad] at which a point [3] has moved by `opening` [m], or 95 % of its range."""
    lever, end = lever_arm(joint, point), open_limit(joint)
    return math.copysign(min(opening / lever, 0.95 * abs(end)), end) if lever > 1e-6 else 0.0


class PathSettings(Protocol):
    """What a tool path takes of a planner's settings; see `PlannerConfig`."""

    @property
    def approach(self) -> float:
        """Where the straight path begins, before the grasp [m]."""

    @property
    def opening(self) -> float:
        """Path of the grasp point [m]."""

    @property
    def depth(self) -> float:
        """How far the tool frame goes past the grasp [m]."""


def part_path(
    joint: Joint, grasp: np.ndarray, approach: float, end: float, depth: float = 0.0, start: float = 0.0
) -> ToolPath:
    """Return the path to a grasp and from there with the part.

    Args:
        joint: of the part.
        grasp: pose of the grasp frame, the part at zero: 7-vector (position, quaternion xyzw), z forward; scene frame.
        approach: where the straight path begins, before the grasp [m].
        end: coordinate to which the part is moved [m] or [rad], with its sign.
        depth: how far the tool frame goes past the grasp [m].
        start: coordinate at which it is grasped.
    """
    forward = Rotation.from_quat(grasp[3:]).as_matrix()[:, 2]
    held = np.concatenate([grasp[:3] + depth * forward, grasp[3:]])
    back = np.linspace(approach, 0.0, max(2, round(approach / STEP) + 1))
    ends = [displace(held[None, :3], joint, q)[0] for q in (start, end)]
    length = float(np.linalg.norm(ends[1] - ends[0]))
    turn = 0.0 if joint.kind == "prismatic" else abs(end - start)
    count = max(2, round(length / STEP) + 1, math.ceil(turn / TURN) + 1)
    q = np.concatenate([np.full(len(back), start), np.linspace(start, end, count)[1:]])
    vectors = [pose_at(joint, held, value) for value in q]
    ahead = transform(joint, start)[:3, :3] @ forward
    for vector, distance in zip(vectors, back, strict=False):
        vector[:3] -= distance * ahead
    return ToolPath(matrices(np.array(vectors)), q, len(back) - 1)


def turns(rotations: np.ndarray) -> np.ndarray:
    """Return the angles of rotations, or of motions, [... 3 3] or [... 4 4], by which they turn [rad], shape [...]."""
    trace = np.trace(rotations[..., :3, :3], axis1=-2, axis2=-1)
    return np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0))


def matrices(vectors: np.ndarray) -> np.ndarray:
    """Return 7-vectors (position, quaternion xyzw) [pose 7] as matrices [pose 4 4]."""
    poses = np.tile(np.eye(4), (len(vectors), 1, 1))
    poses[:, :3, :3] = Rotation.from_quat(vectors[:, 3:]).as_matrix()
    poses[:, :3, 3] = vectors[:, :3]
    return poses
