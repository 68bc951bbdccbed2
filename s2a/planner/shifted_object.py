"""Picking an object that stands a little beside where the plan has it: the arm moves its grasp along."""

from __future__ import annotations

import numpy as np
import torch

from s2a.planner.held_object import DAMPING, ITERATIONS
from s2a.planner.knots import Added
from s2a.planner.trajectory import Picked, Trajectory, eased
from s2a.robot.kinematics import kinematics
from s2a.robot.tool_path import matrices
from s2a.sim.simulation import Simulation


class ShiftedObject:
    """What is added to the arm's targets so that it picks the object where an episode begins with it.

    With P the planned pose of the object at the start and S the true one, the tool's pose T becomes S P^-1 T from the point of
    approach until the object is lifted. It is in the gripper as planned then, and the way to its place is that of the plan again.
    """

    def __init__(self, sim: Simulation, trajectory: Trajectory, picked: Picked) -> None:
        """Find the poses of the tool from the point of approach on.

        Args:
            sim: whose worlds have one object each, the target.
            trajectory: all of it.
            picked: when.

        Attributes:
            window: first and last step at which something is added.
        """
        self._sim, self._kin, self.window = sim, kinematics(sim.robot), (picked.begin, picked.above)
        self._added = Added(sim, picked.near, picked.lifted, _weights(picked, len(trajectory.targets)))
        self._arm = trajectory.targets[self._added.at, : len(sim.robot.arm_joints)]
        self._tool, self._base = self._kin.tool(self._arm), matrices(sim.stage.base[None])[0]
        self._planned = matrices(sim.stage.grasp[None])[0]

    def see(self, worlds: torch.Tensor) -> None:
        """See where the object stands in worlds whose episode begins, shape [world], bool."""
        first, index = self._sim.layout.part_coord, worlds.cpu().numpy()
        pose = matrices(self._sim.joint_q[:, first : first + 7].cpu().numpy()[index].astype(float))
        change = np.linalg.inv(self._base) @ pose @ np.linalg.inv(self._planned) @ self._base
        start = np.tile(self._arm, (len(pose), 1))
        arm, _ = self._kin.solve((change[:, None] @ self._tool).reshape(-1, 4, 4), start, ITERATIONS, DAMPING)
        self._added.found(worlds, (arm - start).reshape(len(pose), *self._arm.shape))

    def __call__(self, step: torch.Tensor) -> torch.Tensor:
        """Return what to add to the arm's targets, shape [world arm], at these steps of the trajectory, shape [world]."""
        return self._added(step)


def _weights(picked: Picked, steps: int) -> np.ndarray:
    """Return the fraction of the shift at each step: rising on the way to the object, falling on the way to its place."""
    step = np.arange(steps)
    rising = eased((step - picked.begin) / max(picked.near - picked.begin, 1))
    return rising - eased((step - picked.lifted) / max(picked.above - picked.lifted, 1))
