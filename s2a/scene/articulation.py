"""Motion of a part by its joint: the one copy of it for scans, preparation, simulation and validation.

A joint's coordinate q is 0 in the scanned pose, [m] for a slide and [rad] for a hinge; points and directions are in scene
coordinates. The farther limit from zero is the open one, since a scan's zero is the pose in which the part was found.
"""

import math
from collections.abc import Mapping

import numpy as np

from s2a.scene.scene import Joint

ON_AXIS = 1e-9  # [m] A point nearer to a hinge's axis than this does not move


def transform(joint: Joint, q: float) -> np.ndarray:
    """Return the displacement of a part at coordinate q, shape [4 4]: scene pose at q = transform @ scene pose at zero."""
    moved, axis = np.eye(4), np.array(joint.axis)
    if joint.kind == "prismatic":
        moved[:3, 3] = q * axis
        return moved
    origin = np.array(joint.origin)
    cross = np.cross(axis, np.eye(3)).T  # cross @ v = axis x v; Rodrigues' formula
    moved[:3, :3] = np.eye(3) + math.sin(q) * cross + (1.0 - math.cos(q)) * cross @ cross
    moved[:3, 3] = origin - moved[:3, :3] @ origin
    return moved


def displace(points: np.ndarray, joint: Joint, q: float) -> np.ndarray:
    """Return points [point 3] of a part at zero, moved to coordinate q."""
    moved = transform(joint, q)
    return points @ moved[:3, :3].T + moved[:3, 3]


def open_limit(joint: Joint) -> float:
    """Return the coordinate at which the part is fully open: the limit farther from zero."""
    lower, upper = joint.limits
    return upper if abs(upper) >= abs(lower) else lower


def opening_sign(joint: Joint) -> float:
    """Return 1 where the part opens towards its upper limit, -1 towards its lower one."""
    return math.copysign(1.0, open_limit(joint))


def lever_arm(joint: Joint, point: np.ndarray) -> float:
    """Return the path of a point [3] per unit of q: 1 for a slide, the distance to the axis [m] for a hinge."""
    if joint.kind == "prismatic":
        return 1.0
    return float(np.linalg.norm(np.cross(joint.axis, point - np.array(joint.origin))))


def travel(joint: Joint, point: np.ndarray) -> float:
    """Return the path length of a point [3] from zero to the open limit [m]."""
    return abs(open_limit(joint)) * lever_arm(joint, point)


def opening_direction(joint: Joint, point: np.ndarray) -> np.ndarray:
    """Return the unit direction in which a point [3] of the closed part moves first when it opens."""
    axis = opening_sign(joint) * np.array(joint.axis)
    if joint.kind == "prismatic":
        return axis
    tangent = np.cross(axis, point - np.array(joint.origin))
    if np.linalg.norm(tangent) <= ON_AXIS:  # any direction across the axis
        tangent = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    return tangent / np.linalg.norm(tangent)


def pose_at(joint: Joint, pose: np.ndarray, q: float) -> np.ndarray:
    """Return a pose fixed to the part (position, quaternion xyzw; shape [7], given at zero) at coordinate q."""
    point = displace(pose[None, :3], joint, q)[0]
    if joint.kind == "prismatic":
        return np.concatenate([point, pose[3:]])
    u, s = math.sin(q / 2) * np.array(joint.axis), math.cos(q / 2)
    v, w = pose[3:6], pose[6]
    return np.concatenate([point, s * v + w * u + np.cross(u, v), [s * w - u @ v]])


def carried(part: str, parents: Mapping[str, str]) -> list[str]:
    """Return a part and those that move with it, by the body that each part moves against."""
    group = [part]
    for body in group:
        group += [child for child, parent in parents.items() if parent == body]
    return group
