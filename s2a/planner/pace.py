"""How fast each world goes along the trajectory: more slowly where what is added to it would exceed the robot's limits."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch

from s2a.planner.knots import Worlds
from s2a.planner.trajectory import Trajectory, limit_fractions
from s2a.robot.spec import JointLimits

Adding = Callable[[torch.Tensor], torch.Tensor | float]
"""Steps of the trajectory, shape [world] -> what is added to the arm's targets there, shape [world arm]."""


class Pace:
    """The fraction of a step of the trajectory by which each world goes on in a control step.

    The trajectory and what is added to it keep the limits each, their sum need not. In windows that begin and end at rest the sum
    is followed more slowly, evenly, where it has to be.
    """

    def __init__(self, sim: Worlds, trajectory: Trajectory, limits: JointLimits, rate: float) -> None:
        """Begin as fast as planned.

        Args:
            sim: whose worlds.
            trajectory: all of it.
            limits: of the arm's joints.
            rate: control steps a second.
        """
        self._limits, self._rate = limits, rate
        self._arm = trajectory.targets[:, : len(sim.robot.arm_joints)]
        self._count, self._device = sim.num_envs, sim.device
        self._windows: dict[tuple[int, int], torch.Tensor] = {}

    def fit(self, window: tuple[int, int], worlds: torch.Tensor, added: Adding) -> None:
        """Choose the pace of some worlds (shape [world], bool) in a window: first and last step of what is added."""
        first, last = self._to_rest(*window)
        steps = [torch.full((self._count,), step, device=self._device) for step in range(first, last + 1)]
        total = torch.stack([torch.as_tensor(added(step))[worlds] for step in steps]).cpu().numpy()
        total = self._arm[first : last + 1, None] + total
        # Between two targets the arm goes straight: at a fraction s of the pace, accelerations fall with s, not with its square.
        fractions = [max(1.0, *limit_fractions(total[:, k], self._limits, self._rate)) for k in range(total.shape[1])]
        pace = self._windows.setdefault(
            (first, last), torch.ones(self._count, dtype=torch.float64, device=self._device)
        )
        pace[worlds] = torch.tensor(
            [1.0 / fraction for fraction in fractions], dtype=torch.float64, device=self._device
        )

    def _to_rest(self, first: int, last: int) -> tuple[int, int]:
        """Return a window that ends where the arm stands: a change of pace on the way would be a jump of velocity."""
        last = min(last, len(self._arm) - 1)
        stands = np.flatnonzero(np.append(np.abs(np.diff(self._arm[last:], axis=0)).max(axis=1) < 1e-9, True))
        return first, last + int(stands[0])

    def after(self, place: torch.Tensor) -> torch.Tensor:
        """Return where each world is a control step later; places on the trajectory in steps of it, shape [world]."""
        following = place + 1.0
        for (first, last), pace in self._windows.items():
            within = (place >= first) & (place < last)
            following = torch.where(within, torch.clamp(place + pace, max=float(last)), following)
        return following
