"""Coming back for an object that was not lifted: it has slipped out of the gripper, and stands near where it was."""

from __future__ import annotations

import math

import numpy as np
import torch

from s2a.planner.held_object import FARTHEST, target_in_tool
from s2a.planner.shifted_object import ShiftedObject
from s2a.planner.trajectory import Aligned, Picked, Trajectory, eased
from s2a.robot.tool_path import matrices, turns
from s2a.sim.simulation import Simulation

NEAR, STEEPEST = 0.1, math.radians(40.0)
"""[m, rad] From its start: an object that has rolled farther would be grasped where no collisions were looked for."""


class Regrasp:
    """Where on its trajectory a world goes on that has not lifted its object, and what is added to the arm's targets on its way.

    The targets of the way back follow those of the trajectory. It begins where the object should be lifted, opens the fingers,
    sees where the object stands now, and ends at the point of approach to that.
    """

    def __init__(self, sim: Simulation, trajectory: Trajectory, shifted: ShiftedObject) -> None:
        """Take a trajectory that picks, and knows a way back.

        Args:
            sim: whose worlds have one object each.
            trajectory: all of it.
            shifted: what moves its grasp to where the object stands.
        """
        assert trajectory.picked and trajectory.aligned and trajectory.again
        self._sim, self._shifted = sim, shifted
        self._picked: Picked = trajectory.picked
        self._aligned: Aligned = trajectory.aligned
        self._end, back = len(trajectory.targets), trajectory.again
        self._seen, self._last = self._end + back.seen, self._end + len(back.targets) - 1
        gone = eased((np.arange(len(back.targets)) - back.seen) / max(len(back.targets) - 1 - back.seen, 1))
        self._gone = torch.tensor(gone, dtype=torch.float32, device=sim.device)
        shape = (sim.num_envs, len(sim.robot.arm_joints))
        self._before = torch.zeros(shape, dtype=torch.float32, device=sim.device)
        self._lost = torch.zeros(sim.num_envs, dtype=torch.bool, device=sim.device)

    def see(self, step: torch.Tensor) -> torch.Tensor | None:
        """Find which worlds have not lifted their object, by where they are on the trajectory, shape [world].

        Returns:
            The worlds that have just seen where their object stands now, shape [world], bool; None: none has.
        """
        lifted = step == self._picked.lifted
        self._lost &= ~lifted
        if bool(lifted.any()):
            index = torch.nonzero(lifted)[:, 0]
            self._lost[index] = torch.tensor(self._slipped(lifted.cpu().numpy()), device=step.device)
            self._before[index] = self._shifted(step)[index]
        seen = (step == self._seen) & self._lost
        if not bool(seen.any()):
            return None
        self._lost &= ~seen
        self._shifted.see(seen)
        return seen

    def _slipped(self, worlds: np.ndarray) -> np.ndarray:
        """Return in which of some worlds [world], bool, the object is not in the gripper, but near its start; shape [some]."""
        held = target_in_tool(self._sim, worlds)
        fell = np.linalg.norm(held[:, :3, 3] - self._aligned.held[:3, 3], axis=1) > FARTHEST
        poses = self._sim.state.body_q.numpy().reshape(self._sim.num_envs, -1, 7)[worlds, self._sim.layout.part_body]
        moved = matrices(poses) @ np.linalg.inv(matrices(self._sim.stage.grasp[None]))
        away = np.linalg.norm(poses[:, :3] - self._sim.stage.grasp[:3], axis=1)
        return fell & (away <= NEAR) & (turns(moved) <= STEEPEST)

    def after(self, place: torch.Tensor, following: torch.Tensor) -> torch.Tensor:
        """Return where each world goes on that would be at `following` after `place`, shape [world]."""
        own = torch.where(place < self._end, following.clamp(max=self._end - 1.0), following)
        leaves = self._lost & (place >= self._picked.lifted) & (place < self._end)
        own = torch.where(leaves, float(self._end), own)
        return torch.where(own > self._last, float(self._picked.near), own)

    def __call__(self, step: torch.Tensor) -> torch.Tensor:
        """Return what to add to the arm's targets on the way back, shape [world arm], at these steps [world]; else 0."""
        gone = self._gone[(step - self._end).clamp(0, len(self._gone) - 1)][:, None]
        now = self._shifted(torch.full_like(step, self._picked.near))
        return (step >= self._end)[:, None] * torch.lerp(self._before, now, gone)
