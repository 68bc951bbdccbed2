"""What is added to the arm's targets, known at some poses of its trajectory."""

from __future__ import annotations

import torch


def between(moved: torch.Tensor, place: torch.Tensor) -> torch.Tensor:
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
