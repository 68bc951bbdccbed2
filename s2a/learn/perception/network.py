"""A network that finds a part's grasp and joint in its points: shared layers on all points, then again near the grasp."""

from __future__ import annotations

import torch
from torch import nn

from s2a.tasks.part_description import NUMBERS, SIDEWAYS

FEATURES = 5
"""Numbers of a point: place [m], 1 on the part, height above the front [m]."""
NEAR = 256
"""Points about the grasp point that are seen a second time."""
PLACE, HEIGHT = 4.0, 20.0
"""[1/m] Scales of places and heights, which bring them to about 1; near the grasp places are scaled as heights."""
CENTIMETRES = 0.01


class PartNetwork(nn.Module):
    """Points of a part -> its description.

    After PointNet (Qi et al. 2017): the same layers for every point, then the maximum over points. Every point also votes for the
    grasp point, and says how much its vote counts. The points nearest to what the votes find are then seen in a finer scale.
    """

    def __init__(self, width: int = 128) -> None:
        """Make the layers; `width` of the first, those after it are twice as wide."""
        super().__init__()
        self.width = width
        self.points = _layers(FEATURES, width // 2, width)
        self.spread = _layers(width, 2 * width)
        self.votes = nn.Sequential(_layers(3 * width, width), nn.Linear(width, 4))
        self.near = _layers(FEATURES, width // 2, width, 2 * width)
        self.head = nn.Sequential(_layers(4 * width, 2 * width, width), nn.Linear(width, NUMBERS))

    def forward(self, points: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return descriptions [cloud NUMBERS], places relative to the cloud's center, and the first guess of the point [cloud 3].

        Args:
            points: shape [cloud point FEATURES].
        """
        place = points[..., :3]
        height = points[..., 3:] * points.new_tensor([1.0, HEIGHT])
        local = self.points(torch.cat([PLACE * place, height], dim=-1))
        whole = self.spread(local).amax(dim=1)
        vote = self.votes(torch.cat([local, whole[:, None].expand(-1, local.shape[1], -1)], dim=-1))
        weight = vote[..., :1].softmax(dim=1)
        guess = (weight * (place + 10.0 * CENTIMETRES * vote[..., 1:])).sum(dim=1)
        away = place - guess.detach()[:, None]
        index = away.square().sum(dim=-1).topk(min(NEAR, place.shape[1]), dim=1, largest=False).indices[..., None]
        closer = torch.cat([HEIGHT * away, height], dim=-1).gather(1, index.expand(-1, -1, FEATURES))
        found = self.head(torch.cat([whole, self.near(closer).amax(dim=1)], dim=-1))
        return _description(found, guess.detach()), guess


def _layers(first: int, *widths: int) -> nn.Sequential:
    """Return linear layers with normalisation in between."""
    sizes = (first, *widths)
    each = [(nn.Linear(a, b), nn.LayerNorm(b), nn.ELU()) for a, b in zip(sizes, sizes[1:], strict=False)]
    return nn.Sequential(*(layer for group in each for layer in group))


def _description(found: torch.Tensor, guess: torch.Tensor) -> torch.Tensor:
    """Return a network's numbers as a description: directions of length 1, across and inwards at right angles."""
    point = guess + CENTIMETRES * found[:, :3]
    inwards = nn.functional.normalize(found[:, 6:9], dim=1)
    across = found[:, 3:6] - (found[:, 3:6] * inwards).sum(dim=1, keepdim=True) * inwards
    across = nn.functional.normalize(across, dim=1)
    sign = (across * across.new_tensor(SIDEWAYS)).sum(dim=1, keepdim=True)
    across = torch.where(sign < 0.0, -across, across)
    axis, along = (nn.functional.normalize(found[:, i : i + 3], dim=1) for i in (9, 12))
    size = nn.functional.softplus(found[:, 15:18]) * 3.0 * CENTIMETRES
    slides, lengths = found[:, 18:19].sigmoid(), nn.functional.softplus(found[:, 19:21]) * 0.4
    return torch.cat([point, across, inwards, axis, along, size, slides, lengths], dim=1)
