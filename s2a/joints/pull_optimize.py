"""Pulls by gradient: the set-points of an arm that bring parts to their goals at least cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from s2a.joints.pull_config import PullConfig
from s2a.joints.pull_loss import PullLoss
from s2a.joints.pulled import Pulled
from s2a.joints.together import minimize_together
from s2a.planner.pull_law import PullLaw


@dataclass(frozen=True)
class Optimum:
    """A pull that was found.

    Attributes:
        law: its time law.
        cost: of the model's motion.
        opening: that the model predicts [m], shape [step].
        speed: likewise [m/s].
        force: on the handle [N].
    """

    law: PullLaw
    cost: float
    opening: np.ndarray
    speed: np.ndarray
    force: np.ndarray


def optimize(
    pulled: Sequence[Pulled], config: PullConfig, seconds: np.ndarray | None = None, device: str = "cpu"
) -> tuple[list[Optimum], int]:
    """Return the best pull of each part, and how often all were evaluated.

    Args:
        pulled: parts and arms.
        config: what a good pull is.
        seconds: given times, shape [part]; None: free.
        device: cpu or cuda:0.
    """
    loss = PullLoss(pulled, config, seconds, device=device)
    bounds = np.zeros(loss.variables), np.ones(loss.variables)
    found = minimize_together(loss, loss.start(), *bounds, config.rounds, np.ones(len(pulled), bool))
    return optima(loss, found.points), found.rounds


def optima(loss: PullLoss, points: np.ndarray) -> list[Optimum]:
    """Return points [problem variable] of problems as pulls."""
    moved, costs = loss.motions(points), loss.costs(points)
    return [
        Optimum(law, float(cost), *(x[:, i] for x in moved))
        for i, (law, cost) in enumerate(zip(loss.laws(points), costs, strict=True))
    ]
