"""Training of the network on frames of a pool's parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import nn

from s2a.core.bounds import Count, NotNegative, Positive
from s2a.learn.perception.depth_camera import PartPoints
from s2a.tasks.mdp.seen import NUMBERS, SIDEWAYS

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


@dataclass(frozen=True)
class NetworkConfig:
    """How the network is trained.

    Attributes:
        steps: of the optimiser.
        batch: frames a step.
        learning_rate: the highest; it rises over the first twentieth of the steps and falls as a cosine to zero.
        weight_decay: of AdamW.
        turn: frames are turned about the vertical by at most this [rad].
        scale: and scaled by at most this factor, up or down.
        points: of a frame's points a random part is seen in each step.
        width: of the network's first layers.
    """

    steps: Count
    batch: Count
    learning_rate: Positive
    weight_decay: NotNegative
    turn: NotNegative
    scale: Positive
    points: Count
    width: Count


def features(clouds: Sequence[PartPoints]) -> torch.Tensor:
    """Return clouds of as many points as the network's input, shape [cloud point FEATURES]."""
    each = [np.concatenate([c.points, c.is_part[:, None], c.height[:, None]], axis=1, dtype=np.float32) for c in clouds]
    return torch.from_numpy(np.stack(each))


def loss(found: torch.Tensor, guess: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """Return the mean loss of descriptions: centimetres of places, and of directions 1 - cosine, weighed as a policy needs them.

    Args:
        found: what the network found, shape [cloud NUMBERS].
        guess: its first guess of the grasp point, shape [cloud 3].
        truth: shape [cloud NUMBERS].
    """

    def centimetres(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
        return nn.functional.huber_loss(100.0 * a, 100.0 * b, reduction="none").sum(dim=1)

    def cosine(first: int) -> torch.Tensor:
        return (found[:, first : first + 3] * truth[:, first : first + 3]).sum(dim=1)

    hinge = 1.0 - truth[:, 18]
    total = centimetres(found[:, :3], truth[:, :3]) + 0.5 * centimetres(guess, truth[:, :3])
    total += 20.0 * (1.0 - cosine(3) ** 2)  # a gripper turned by half is the same
    total += 20.0 * sum(1.0 - cosine(first) for first in (6, 12)) + 10.0 * (1.0 - cosine(9))
    total += 0.3 * centimetres(found[:, 15:18], truth[:, 15:18])
    total += 2.0 * nn.functional.binary_cross_entropy(found[:, 18], truth[:, 18], reduction="none")
    total += 0.05 * hinge * centimetres(found[:, 19:20], truth[:, 19:20])
    total += 0.02 * centimetres(found[:, 20:21], truth[:, 20:21])
    return total.mean()


def augmented(
    points: torch.Tensor, truth: torch.Tensor, config: NetworkConfig, random: torch.Generator
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return frames and descriptions turned about the vertical, scaled, and half of them mirrored; fewer points of each.

    Places are relative to the cloud's center. Mirrored, the axis of a hinge keeps its sense as a direction turns round: it is
    no arrow, but a sense of rotation.
    """
    count, device = len(points), points.device

    def uniform(most: float) -> torch.Tensor:
        return (2.0 * torch.rand(count, generator=random, device=device) - 1.0) * most

    angle, factor = uniform(config.turn), torch.exp(uniform(float(np.log(config.scale))))
    side = torch.where(torch.rand(count, generator=random, device=device) < 0.5, -1.0, 1.0)
    cos, sin, zero = angle.cos(), angle.sin(), torch.zeros_like(angle)
    rows = [cos, -sin * side, zero, sin, cos * side, zero, zero, zero, zero + 1.0]
    turn = torch.stack(rows, dim=1).view(count, 3, 3)
    keep = torch.rand(points.shape[:2], generator=random, device=device).topk(config.points, dim=1).indices[..., None]
    few = points.gather(1, keep.expand(-1, -1, points.shape[2]))
    moved = torch.cat(
        [_turned(few[..., :3], turn) * factor[:, None, None], few[..., 3:4], few[..., 4:] * factor[:, None, None]], 2
    )
    vectors = _turned(truth[:, :15].reshape(count, 5, 3), turn)
    vectors[:, 0] *= factor[:, None]
    is_hinge = truth[:, 18:19] < 0.5
    vectors[:, 3] = torch.where(is_hinge, vectors[:, 3] * side[:, None], vectors[:, 3])
    sizes, slides, lengths = truth[:, 15:18], truth[:, 18:19], truth[:, 19:]
    return moved, torch.cat([vectors.flatten(1), sizes * factor[:, None], slides, lengths * factor[:, None]], dim=1)


def _turned(vectors: torch.Tensor, turn: torch.Tensor) -> torch.Tensor:
    """Return vectors [cloud vector 3] turned by matrices [cloud 3 3]."""
    return vectors @ turn.transpose(1, 2)


def train(
    points: torch.Tensor, truth: torch.Tensor, config: NetworkConfig, seed: int
) -> tuple[PartNetwork, list[float]]:
    """Return a trained network, and its loss every hundredth of the steps.

    Args:
        points: of all frames, shape [frame point FEATURES], on the device that is to train.
        truth: descriptions, the grasp point relative to the cloud's center, shape [frame NUMBERS].
        config: how.
        seed: of the network and of what is drawn.
    """
    torch.manual_seed(seed)
    device = points.device
    random = torch.Generator(device).manual_seed(seed)
    network = PartNetwork(config.width).to(device)
    optimizer = torch.optim.AdamW(network.parameters(), config.learning_rate, weight_decay=config.weight_decay)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, config.learning_rate, config.steps, pct_start=0.05)
    curve, every = [], max(1, config.steps // 100)
    for step in range(config.steps):
        index = torch.randint(len(points), (config.batch,), generator=random, device=device)
        seen, wanted = augmented(points[index], truth[index], config, random)
        found, guess = network(seen)
        error = loss(found, guess, wanted)
        optimizer.zero_grad()
        error.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        schedule.step()
        if step % every == every - 1:
            curve.append(float(error.detach()))
    return network.eval(), curve
