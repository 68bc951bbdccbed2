"""A part that does not stand where it was to be left: the arm moves its grasp of the handle, or of what is put in, along."""

from __future__ import annotations

import numpy as np
import torch

from s2a.planner.held_object import DAMPING, ITERATIONS, REACHED
from s2a.planner.knots import Added
from s2a.planner.trajectory import Shutting, Trajectory, eased
from s2a.robot.kinematics import kinematics
from s2a.robot.tool_path import matrices
from s2a.scene.articulation import lever_arm, transform
from s2a.sim.simulation import Simulation
from s2a.sim.world import axis_of

FARTHEST = 0.15
"""[m] By which the handle may be off. What is farther off would need another plan."""


class PartOff:
    """Where a part stands that the trajectory opens."""

    def __init__(self, sim: Simulation, part: str) -> None:
        """Find a part of the simulation's room by its id."""
        found = sim.stage.room.articulations[part]
        self._sim, self.joint, self._lever = sim, found.joint, lever_arm(found.joint, np.array(found.grasp.point))
        self._coord, self.base = axis_of(sim.world, part, found.joint.kind)[0], matrices(sim.stage.base[None])[0]

    def coordinates(self, worlds: np.ndarray) -> np.ndarray:
        """Return its coordinates in some worlds [world], bool; shape [some]."""
        return self._sim.joint_q[:, self._coord].cpu().numpy()[worlds].astype(float)

    def is_near(self, coordinate: float, planned: float) -> bool:
        """Return whether its handle is near enough to where it is at a planned coordinate for the same plan to do."""
        return abs(coordinate - planned) * self._lever <= FARTHEST

    def off(self, planned: float, worlds: np.ndarray) -> np.ndarray:
        """Return by what motions in the base frame it is off a planned coordinate in some worlds, shape [some 4 4]."""
        back = np.linalg.inv(transform(self.joint, planned)) @ self.base
        known = [q if self.is_near(q, planned) else planned for q in self.coordinates(worlds)]
        return np.array([np.linalg.inv(self.base) @ transform(self.joint, q) @ back for q in known]).reshape(-1, 4, 4)


class MovedPart:
    """What is added to the arm's targets so that it takes the handle where the part stands as the arm comes back to it.

    With q the planned coordinate of the part, M(q) its motion, and s the share of the planned opening that it is open, the tool's
    pose T becomes M(s q) M(q)^-1 T: at the handle, and with it until the part is shut.
    """

    def __init__(self, sim: Simulation, trajectory: Trajectory, shutting: Shutting) -> None:
        """Find the poses of the tool from the point of approach on.

        Args:
            sim: whose worlds have the part.
            trajectory: all of it.
            shutting: when and what.

        Attributes:
            window: first and last step at which something is added.
        """
        self._kin, self.window = kinematics(sim.robot), (shutting.begin, shutting.shut)
        first, last, step = shutting.near, shutting.shut, np.arange(len(trajectory.targets))
        rising = eased((step - shutting.begin) / max(first - shutting.begin, 1))
        self._added = Added(sim, first, last, np.where(step <= last, rising, 0.0))
        at = self._added.at
        self._arm, self._q = trajectory.targets[at, : len(sim.robot.arm_joints)], trajectory.part[at]
        self._tool, self._part = self._kin.tool(self._arm), PartOff(sim, shutting.part)

    def see(self, step: torch.Tensor) -> torch.Tensor | None:
        """See where the part stands in worlds whose way back to it has begun, shape [world]; return which."""
        worlds = step == self.window[0]
        if not bool(worlds.any()):
            return None
        self._added.found(worlds, self._correction(self._part.coordinates(worlds.cpu().numpy())))
        return worlds

    def _correction(self, opened: np.ndarray) -> np.ndarray:
        """Return what to add to the arm's joints in worlds whose part stands at coordinates [some], shape [some pose arm].

        It is 0 where the handle is too far off, or where the arm does not reach all of it.
        """
        moved, joint, base = np.zeros((len(opened), *self._arm.shape)), self._part.joint, self._part.base
        for k, coordinate in enumerate(opened):
            if not self._part.is_near(coordinate, self._q[0]):
                continue
            fraction = coordinate / self._q[0]
            change = [transform(joint, fraction * q) @ np.linalg.inv(transform(joint, q)) for q in self._q]
            tool = np.linalg.inv(base) @ np.array(change) @ base @ self._tool
            arm, left = self._kin.solve(tool, self._arm, ITERATIONS, DAMPING)
            if (left <= REACHED).all():
                moved[k] = arm - self._arm
        moved[:, -1] = 0.0  # shut, it is where it was planned to be
        return moved

    def __call__(self, step: torch.Tensor) -> torch.Tensor:
        """Return what to add to the arm's targets, shape [world arm], at these steps of the trajectory, shape [world]."""
        return self._added(step)
