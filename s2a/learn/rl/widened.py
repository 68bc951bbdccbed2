"""Networks that are told more than those which they begin with."""

from __future__ import annotations

from collections.abc import Mapping

import torch

UNSEEN = {"obs_normalizer._mean": 0.0, "obs_normalizer._var": 1.0, "obs_normalizer._std": 1.0, "mlp.0.weight": 0.0}
"""What belongs to an input that a network did not have: it is seen as it is, and counts for nothing."""


def widened(
    saved: Mapping[str, torch.Tensor], own: Mapping[str, torch.Tensor], known: int, given: int
) -> dict[str, torch.Tensor]:
    """Return saved weights as a network takes them that has further inputs; it gives what the saved one gives.

    Args:
        saved: of a network and its normaliser, under rsl-rl's names.
        own: those of the network that is to begin so; what the saved one lacks stays.
        known: how many numbers the policy observed.
        given: how many it observes; the further ones come after these, and what else is new, which a critic alone is told, at
            the end.
    """
    weights = dict(own) | dict(saved)
    for name, value in UNSEEN.items():
        before = weights[name]
        further = own[name].shape[1] - before.shape[1]
        if further > 0:
            new = before.new_full((len(before), further), value)
            observed, told = new.tensor_split([given - known], dim=1)
            weights[name] = torch.cat([before[:, :known], observed, before[:, known:], told], dim=1)
    return weights
