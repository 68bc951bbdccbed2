"""What a plan to pick and place is made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.planner.object_grasps import matrix
from s2a.robot.collision import robot_shape
from s2a.robot.spec import RobotSpec

StraightPaths = tuple[np.ndarray, float, np.ndarray, np.ndarray, float, np.ndarray]
"""Pose of a base [4 4] and its pedestal [m], joints [pose arm] of approach and lift, the object in the tool frame [4 4], distance
of the open pads [m], joints of lowering and retreat."""


@dataclass(frozen=True)
class PickPlan:
    """A way to pick and place an object.

    Attributes:
        base: pose of the robot's base, 7-vector, scene frame.
        pedestal: height of what it stands on [m].
        reach: joints from home to the point of approach, shape [pose arm].
        approach: from there to the grasp.
        lift: from the grasp to above it.
        carry: from there to above the place.
        lower: from there to the place.
        retreat: from there with open fingers, back from the object.
        again: from above the grasp back to the point of approach, for an object that was not lifted; None: that is not free.
        grasp: tool frame in the object's body frame when the fingers close, shape [4 4].
        opened: distance of the pads before and after [m].
    """

    base: np.ndarray
    pedestal: float
    reach: np.ndarray
    approach: np.ndarray
    lift: np.ndarray
    carry: np.ndarray
    lower: np.ndarray
    retreat: np.ndarray
    again: np.ndarray | None
    grasp: np.ndarray
    opened: float

    def swept(self, spec: RobotSpec, surface: np.ndarray) -> np.ndarray:
        """Return points [point 3] that the arm, from home on, and the object's surface [point 3] in its hand pass."""
        to_start = np.linspace(spec.home, self.reach[0], 9)
        carried = np.concatenate([self.lift, self.carry, self.lower])
        arm = self.passed(spec, np.concatenate([to_start, self.reach, self.approach, carried, self.retreat]))
        base = matrix(self.base)
        body = base @ robot_shape(spec).kin.tool(carried) @ np.linalg.inv(self.grasp)
        held = surface @ body[:, :3, :3].transpose(0, 2, 1) + body[:, None, :3, 3]
        return np.concatenate([arm, held.reshape(-1, 3)])

    def passed(self, spec: RobotSpec, arm: np.ndarray) -> np.ndarray:
        """Return points [point 3] within the arm in joints [pose arm], scene frame."""
        shape, base = robot_shape(spec), matrix(self.base)
        return shape.centers(arm)[:, shape.moving].reshape(-1, 3) @ base[:3, :3].T + base[:3, 3]
