"""What is known of how a joint resists."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.joints.joint_kernels import PARAMETERS

TYPICAL = np.array([1.0, 5.0, 2.0, 1.0, 10.0, 5.0, 20.0])
"""Of PARAMETERS: unit of the variables that are searched, but for the mass, whose variable is its logarithm."""
LOWER = np.array([0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
UPPER = np.array([20.0, 200.0, 100.0, 50.0, 500.0, 100.0, 1000.0])
VAGUE = 0.5
"""Relative deviation of a mass that tells nothing."""
NINETY = 1.6449
"""Standard deviations of a normal distribution on either side of its mean that hold 90 %."""


@dataclass(frozen=True)
class Dynamics:
    """What resists at a joint's grasp point, as PARAMETERS name it.

    Attributes:
        values: shape [parameter].
        deviations: standard deviations, shape [parameter]; infinite where the recordings do not tell.
        misfit: mean square of the innovations over their expected variance: 1 where the model and the noise are right.
    """

    values: np.ndarray
    deviations: np.ndarray
    misfit: float

    @property
    def determined(self) -> np.ndarray:
        """Which parameters the recordings determine, shape [parameter]: of others 0 and more than TYPICAL are as likely."""
        half = NINETY * self.deviations
        told = ~((half >= self.values) & (half > TYPICAL))
        told[0] = self.deviations[0] <= VAGUE * self.values[0]
        return told

    def interval(self, name: str) -> tuple[float, float]:
        """Return the bounds between which a parameter lies with 90 %."""
        i = PARAMETERS.index(name)
        low, high = (float(self.values[i] + sign * NINETY * self.deviations[i]) for sign in (-1.0, 1.0))
        return max(low, float(LOWER[i])), min(high, float(UPPER[i]))
