"""The gripper roll about a round grasp region, and the side of a bar that it approaches from, free of collisions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.prepare.obstacles import Obstacles
from s2a.robot.collision import RobotShape
from s2a.scene.scene import Scene
from s2a.scene.usd.sim_scene import Grasp

ROUND = 1.5
"""A grasp region whose section is less elongated than this can be held at any gripper roll."""
TURNS = (0, 90, 45, -45)
"""[degrees] Rolls about the approach, the preferred one first: the fingers close along the vertical."""
APPROACH = 0.1
"""[m] Length of the approach that has to be free before the grasp."""
SEARCH_RADIUS = 0.4
"""[m] Radius of the gripper around the grasp in plan."""
BETTER = 0.005
"""[m] Another roll or side has to penetrate the room by so much less: scans are rough."""


def is_round(grasp: Grasp) -> bool:
    """Return whether a grasp's region can be held at any gripper roll."""
    along, across, _ = grasp.size
    return max(along, across) < ROUND * min(along, across)


def free_roll(scene: Scene, target: str, grasp: Grasp, shape: RobotShape) -> Grasp:
    """Return a grasp of what is round, rolled about its approach if the gripper would otherwise collide with the room."""
    near = Obstacles(scene, (target, *scene.descendants(target)), np.array(grasp.point), SEARCH_RADIUS)
    return _collision_free(near, shape, grasp, (_rolled(grasp, turn) for turn in TURNS[1:]))


def free_side(scene: Scene, target: str, grasp: Grasp, others: Iterable[Grasp], shape: RobotShape) -> Grasp:
    """Return a grasp, or one from another side if the gripper would otherwise collide with anything beside its grasp region."""
    near = Obstacles(scene, scene.handle_parts(target), np.array(grasp.point), SEARCH_RADIUS)
    return _collision_free(near, shape, grasp, others)


def _collision_free(near: Obstacles, shape: RobotShape, grasp: Grasp, others: Iterable[Grasp]) -> Grasp:
    """Return a grasp, or another one with a clearly smaller penetration depth on its approach."""
    depth = _depth(near, shape, grasp)
    if depth <= BETTER:  # as almost always: then the others are not even made
        return grasp
    depths, grasps = zip(*((_depth(near, shape, other), other) for other in others), strict=True)
    best = int(np.argmin(depths))
    return grasps[best] if depths[best] < depth - BETTER else grasp


def _rolled(grasp: Grasp, degrees: float) -> Grasp:
    """Return a grasp with its frame turned about the approach, and its extents with it."""
    if not degrees:
        return grasp
    turn = Rotation.from_quat(grasp.orientation) * Rotation.from_euler("z", degrees, degrees=True)
    x, y, z, w = map(float, turn.as_quat(canonical=True))
    points = turn.inv().apply(grasp.region.vertices[grasp.region.faces.ravel()])
    along, across = np.ptp(points[:, :2], axis=0) if degrees % 90 else (grasp.size[1], grasp.size[0])
    return replace(grasp, orientation=(x, y, z, w), size=(float(along), float(across), grasp.size[2]))


def _depth(near: Obstacles, shape: RobotShape, grasp: Grasp) -> float:
    """Return the penetration depth of the open gripper in the obstacles on its straight approach [m]."""
    turn = Rotation.from_quat(grasp.orientation)
    back = np.linspace(0.0, APPROACH, 6)[:, None, None] * np.array([0.0, 0.0, 1.0])
    centers = turn.apply((shape.gripper[None] - back).reshape(-1, 3)) + grasp.point
    return near.penetration(centers, np.tile(shape.gripper_radii, 6), moving=False)[0]
