"""Networks that are told more than those which they begin with."""

from __future__ import annotations

from collections.abc import Mapping

import torch

UNSEEN = {"obs_normalizer._mean": 0.0, "obs_normalizer._var": 1.0, "obs_normalizer._std": 1.0, "mlp.0.weight": 0.0}
"""What belongs to an input that a network did not have: it is seen as it is, and counts for nothing."""


def widened(saved: Mapping[str, torch.Tensor], own: Mapping[str, torch.Tensor], at: int) -> dict[str, torch.Tensor]:
    """Return saved weights as a network takes them that has further inputs; it gives what the saved one gives.

    Args:
        saved: of a network and its normaliser, under rsl-rl's names.
        own: those of the network that is to begin so; what the saved one lacks stays.
        at: index of the first further input.
    """
    weights = dict(own) | dict(saved)
    for name, value in UNSEEN.items():
        before = weights[name]
        further = own[name].shape[1] - before.shape[1]
        if further > 0:
            between = before.new_full((len(before), further), value)
            weights[name] = torch.cat([before[:, :at], between, before[:, at:]], dim=1)
    return weights
