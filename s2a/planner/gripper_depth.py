"""How deep an open gripper reaches into a room where it takes an object, or lets it go."""

from __future__ import annotations

import numpy as np

from s2a.planner.graspable import AROUND
from s2a.planner.gripper_shape import gripper_spheres
from s2a.planner.obstacles import RoomHulls
from s2a.planner.straight_paths import APPROACH, LIFT
from s2a.robot.spec import GripperSpec

COARSE = 7
"""Every so many of the gripper's spheres are looked at first."""


def gripper_depth(
    near: RoomHulls, gripper: GripperSpec, tool: np.ndarray, opened: np.ndarray, limit: float = 0.0
) -> np.ndarray:
    """Return how deep a gripper, with AROUND added, reaches into a room at tool poses and on the straight paths from them.

    Its body alone as it lifts the object or lowers it. What is deeper than the limit at one place is looked at no further.

    Args:
        near: hulls of the room.
        gripper: which.
        tool: poses of the tool frame, shape [grasp 4 4], scene frame.
        opened: distance of the pads [m], shape [grasp].
        limit: [m].

    Returns:
        Depth [m], shape [grasp], 0 where it is clear.
    """
    depth, still = np.zeros(len(tool)), np.zeros((len(tool), 3))
    # A few of the spheres find most of what is hit.
    ways = [(True, COARSE, still)]
    ways += [(True, 1, -back * tool[:, :3, 2]) for back in np.linspace(0.0, APPROACH, 4)]
    ways += [(False, 1, still + [0.0, 0.0, up]) for up in (LIFT / 2, LIFT)]
    for fingers, every, shift in ways:
        left = np.flatnonzero(depth <= limit)
        spheres = gripper_spheres(gripper, fingers)
        places = spheres.placed(tool[left], opened[left], every) + shift[left][:, None]
        depth[left] = np.maximum(depth[left], near.depth(places, spheres.radii[::every] + AROUND))
    return depth
