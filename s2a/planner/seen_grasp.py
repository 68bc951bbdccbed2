"""A planner that knows no more than it sees: its motion ends at the grasp that is seen, not at the true one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from s2a.planner.trajectory import Trajectory
from s2a.robot.kinematics import Kinematics, kinematics
from s2a.robot.tool_path import matrices
from s2a.scene.articulation import pose_at
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage

KNOTS = 32
"""Poses of a trajectory at which the arm is moved over; between them what it is moved by changes evenly."""
ITERATIONS, DAMPING = 12, 1e-3
"""Of the inverse kinematics: starts are within 10 degrees and 2 cm of their targets."""


class SeenGrasp:
    """What is added to the arm's targets of a trajectory for a grasp that is seen elsewhere.

    Every pose of the tool is moved with the seen grasp, which moves with the part: with G the true grasp when the part is at the
    pose's coordinate, and S the seen grasp in it, T becomes G S G^-1 T. The joint stays as it is known. Where the arm cannot
    reach the moved pose, it goes as near as the inverse kinematics finds.
    """

    def __init__(self, sim: Simulation, trajectories: Sequence[Trajectory], stage: torch.Tensor) -> None:
        """Find the knots of each stage's trajectory.

        Args:
            sim: whose worlds.
            trajectories: one a stage.
            stage: of each world, shape [world].
        """
        self._kin, self._stage, arm = kinematics(sim.robot), stage, len(sim.robot.arm_joints)
        longest = max(len(each.targets) for each in trajectories)
        found = [_knots(self._kin, sim.stages[i], each, arm, longest) for i, each in enumerate(trajectories)]
        self._arm, self._tool, self._grasp = (np.stack([each[k] for each in found]) for k in range(3))
        place = np.stack([each[3] for each in found])
        self._place = torch.tensor(place, dtype=torch.float32, device=sim.device)
        self._moved = torch.zeros((len(stage), KNOTS, arm), device=sim.device)

    def see(self, worlds: torch.Tensor, seen: np.ndarray) -> None:
        """Take what is seen in worlds whose episode begins.

        Args:
            worlds: which, shape [world], bool.
            seen: pose of the seen grasp in the true grasp frame of each of all worlds, shape [world 7].
        """
        index = worlds.nonzero()[:, 0].cpu().numpy()
        stage = self._stage.cpu().numpy()[index]
        grasp, offset = self._grasp[stage], matrices(seen[index])[:, None]
        targets = grasp @ offset @ np.linalg.inv(grasp) @ self._tool[stage]
        start = self._arm[stage].reshape(-1, self._arm.shape[-1])
        arm, _ = self._kin.solve(targets.reshape(-1, 4, 4), start, ITERATIONS, DAMPING)
        moved = (arm - start).reshape(len(index), KNOTS, -1)
        self._moved[worlds] = torch.tensor(moved, dtype=torch.float32, device=self._moved.device)

    def __call__(self, step: torch.Tensor) -> torch.Tensor:
        """Return what to add to the arm's targets, shape [world arm], at these steps of the trajectories, shape [world]."""
        return _between(self._moved, self._place[self._stage, step.clamp(0, self._place.shape[1] - 1)])


def _knots(
    kin: Kinematics, stage: SimStage, trajectory: Trajectory, arm: int, longest: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return knots even in what the arm turns: arm joints, tool and true grasp in the base frame; and each step's place.

    Returns:
        Shapes [knot arm], [knot 4 4], [knot 4 4] and [longest]: a step's place among the knots, from 0 to KNOTS - 1.
    """
    targets = trajectory.targets[:, :arm]
    turned = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(targets, axis=0)).max(axis=1))])
    turned += 1e-9 * np.arange(len(turned))  # increases also where the arm stands and the fingers close
    knots = np.linspace(0.0, turned[-1], KNOTS)
    joints = np.stack([np.interp(knots, turned, column) for column in targets.T], axis=1)
    part = np.interp(knots, turned, trajectory.part)
    grasp = matrices(np.array([pose_at(stage.joint, stage.grasp, q) for q in part]))
    place = np.interp(turned, knots, np.arange(KNOTS))
    place = np.concatenate([place, np.full(longest - len(place), KNOTS - 1.0)])
    return joints, kin.tool(joints), np.linalg.inv(matrices(stage.base[None])) @ grasp, place


def _between(moved: torch.Tensor, place: torch.Tensor) -> torch.Tensor:
    """Return what is added to each world's arm, shape [world arm]; between two poses it changes evenly.

    Args:
        moved: what is added at each pose, shape [world pose arm].
        place: where each world is among the poses, 0 or more; beyond the last one is on it; shape [world].
    """
    last = moved.shape[1] - 1
    place = place.clamp(0, last)
    low = place.floor().long().clamp(max=max(last - 1, 0))
    world, rest = torch.arange(len(place), device=place.device), (place - low)[:, None]
    return (1.0 - rest) * moved[world, low] + rest * moved[world, (low + 1).clamp(max=last)]
