"""What is added to the arm's targets, found at some poses of its trajectory."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import torch
from scipy.interpolate import CubicSpline

from s2a.robot.spec import RobotSpec

STEPS = 8
"""Control steps between poses for which inverse kinematics are solved."""


class Worlds(Protocol):
    """What this needs to know of a simulation."""

    @property
    def num_envs(self) -> int:
        """How many worlds there are."""

    @property
    def device(self) -> Any:
        """Where the targets are computed."""

    @property
    def robot(self) -> RobotSpec:
        """The robot in each."""


class Added:
    """What is added to the arm's targets in every world, a smooth curve through what was found at some steps.

    At the first and the last of these it does not change, as the arm stands there. Corners would cost accelerations far beyond
    the robot's limits.
    """

    def __init__(self, sim: Worlds, first: int, last: int, weight: np.ndarray) -> None:
        """Begin with nothing to be added.

        Args:
            sim: whose worlds.
            first: step of the trajectory from which on there is something to be found.
            last: step up to which, later than `first`.
            weight: fraction that is added at each of all steps, shape [step].

        Attributes:
            at: steps at which it is found, shape [pose].
        """
        self.at = np.append(np.arange(first, last, STEPS), last)
        curve = CubicSpline(self.at, np.eye(len(self.at)), bc_type="clamped")
        shares = weight[:, None] * curve(np.clip(np.arange(len(weight)), first, last))
        self._shares = torch.tensor(shares, dtype=torch.float32, device=sim.device)
        shape = (sim.num_envs, len(self.at), len(sim.robot.arm_joints))
        self._moved = torch.zeros(shape, dtype=torch.float32, device=sim.device)

    def found(self, worlds: torch.Tensor, moved: np.ndarray) -> None:
        """Take what is to be added at `at` in some worlds (shape [world], bool), shape [some pose arm]."""
        self._moved[worlds] = torch.tensor(moved, dtype=torch.float32, device=self._moved.device)

    def __call__(self, step: torch.Tensor) -> torch.Tensor:
        """Return what to add to the arm's targets, shape [world arm], at these steps of the trajectory, shape [world]."""
        return torch.einsum("wp,wpa->wa", self._shares[step.clamp(0, len(self._shares) - 1)], self._moved)
