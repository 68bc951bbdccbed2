"""Placing what slipped in the gripper: above the place the arm sees how it holds the object, and makes up for it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import torch

from s2a.planner.knots import Added, Worlds
from s2a.planner.trajectory import Aligned, Trajectory, eased
from s2a.robot.kinematics import kinematics
from s2a.robot.tool_path import matrices, turns
from s2a.sim.simulation import Simulation

ITERATIONS, DAMPING = 12, 1e-3
"""Of the inverse kinematics: starts are within FARTHEST and STEEPEST of their targets."""
FARTHEST, STEEPEST = 0.05, math.radians(60.0)
"""[m, rad] By which an object may be off in the gripper: it may have swung about the pads. What is farther off has fallen."""


REACHED = 5e-3
"""Root of the squared errors [m and rad] up to which the arm reaches what makes up for a slip; else it goes as planned."""


Seen = Callable[[np.ndarray], np.ndarray]
"""Worlds [world], bool -> poses or motions in some of them, shape [some 4 4]."""


def target_in_tool(sim: Simulation, worlds: np.ndarray) -> np.ndarray:
    """Return the poses of the target in the tool frame in some worlds [world], bool; shape [some 4 4]."""
    poses = sim.state.body_q.numpy().reshape(sim.num_envs, -1, 7)[worlds]
    tool = matrices(poses[:, sim.layout.tool_body])
    tool[:, :3, 3] += tool[:, :3, :3] @ np.array(sim.robot.tool_offset)
    return np.linalg.inv(tool) @ matrices(poses[:, sim.layout.part_body])


class HeldObject:
    """What is added to the arm's targets from where it sees the object in the gripper until it has let go.

    With T the pose of the tool, H that of the object in it as planned and S as seen, T becomes T H S^-1: the object then passes
    where it was planned to; or M T H S^-1 where its place is in a part that is off its planned coordinate by a motion M.
    """

    def __init__(
        self, sim: Worlds, trajectory: Trajectory, aligned: Aligned, seen: Seen, place_off: Seen | None = None
    ) -> None:
        """Find the poses of the tool between seeing it and the release.

        Args:
            sim: whose worlds hold one object each.
            trajectory: all of it.
            aligned: when and what.
            seen: poses of the objects in the tool frame.
            place_off: motions in the base frame by which their places are off; None: they stay.
        """
        self._place_off = place_off
        self._seen, self._aligned, self._kin = seen, aligned, kinematics(sim.robot)
        self._added = Added(sim, aligned.ready, aligned.released, _weights(aligned, len(trajectory.targets)))
        self._arm = trajectory.targets[self._added.at, : len(sim.robot.arm_joints)]
        self._tool = self._kin.tool(self._arm)

    @property
    def window(self) -> tuple[int, int]:
        """First and last step at which something is added."""
        return self._aligned.seen, self._aligned.back

    def see(self, step: torch.Tensor) -> torch.Tensor | None:
        """See the object in the gripper in worlds that have come to that step of the trajectory, shape [world]; return which."""
        worlds = step == self._aligned.seen
        if not bool(worlds.any()):
            return None
        self._added.found(worlds, self._correction(worlds.cpu().numpy()))
        return worlds

    def _correction(self, worlds: np.ndarray) -> np.ndarray:
        """Return what to add to the arm's joints in some worlds, shape [some pose arm].

        It is 0 where the object is not held, or where the arm does not reach all of it.
        """
        seen = self._seen(worlds)
        change = self._aligned.held @ np.linalg.inv(seen)
        off = np.linalg.norm(seen[:, :3, 3] - self._aligned.held[:3, 3], axis=1)
        held = (off <= FARTHEST) & (turns(change) <= STEEPEST)
        tool = self._tool[None] if self._place_off is None else self._place_off(worlds)[:, None] @ self._tool
        targets = (tool @ change[:, None])[held]
        start = np.tile(self._arm, (len(targets), 1))
        arm, left = self._kin.solve(targets.reshape(-1, 4, 4), start, ITERATIONS, DAMPING)
        reached = (left.reshape(-1, len(self._arm)) <= REACHED).all(axis=1)
        found = np.zeros((len(seen), *self._arm.shape), np.float32)
        found[np.flatnonzero(held)[reached]] = (arm - start).reshape(-1, *self._arm.shape)[reached]
        return found

    def __call__(self, step: torch.Tensor) -> torch.Tensor:
        """Return what to add to the arm's targets, shape [world arm], at these steps of the trajectory, shape [world]."""
        return self._added(step)


def _weights(aligned: Aligned, steps: int) -> np.ndarray:
    """Return the fraction of the correction at each step: rising while the arm stands, falling on the way after the release."""
    step = np.arange(steps)
    rising = eased((step - aligned.seen) / (aligned.ready - aligned.seen))
    return rising - eased((step - aligned.released) / (aligned.back - aligned.released))
