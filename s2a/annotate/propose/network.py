"""A network that sees fronts and their handles in the image of a plane."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from torch import nn

from s2a.annotate import joints
from s2a.annotate.propose.layers import Layer

CHANNELS = 9
"""Of what the network sees of a cell: seen, RGB, height, what stands out, its relief, walls, height over the floor."""
Motion = tuple[Literal["slide"], joints.Direction] | tuple[Literal["hinge"], Literal["right", "left", "top", "bottom"]]
MOTIONS: tuple[Motion, ...] = (
    ("slide", "out"),
    ("slide", "right"),
    ("slide", "left"),
    ("hinge", "right"),
    ("hinge", "left"),
    ("hinge", "top"),
    ("hinge", "bottom"),
)
"""How a front opens, as seen from the room: it slides somewhere, or turns about one of its sides."""
COARSE = 2
"""Cells of the image in a cell of the network."""
WIDTHS = (32, 48, 64, 96, 96)
"""Channels at the network's cells, and at each halving: a cell of the last covers 32 of the image."""
MULTIPLE = COARSE * 2 ** (len(WIDTHS) - 1)
"""Rows and columns of what the network takes are multiples."""
FILE = Path(__file__).with_name("fronts.pt")


class FrontNetwork(nn.Module):
    """Images of planes -> where fronts are, their sides, how they open, and where handles are.

    A U-Net (Ronneberger et al. 2015) whose cells each say where the sides of their front are, as in FCOS (Tian et al. 2019).
    """

    def __init__(self) -> None:
        """Make the layers."""
        super().__init__()
        self.first = nn.Sequential(nn.PixelUnshuffle(COARSE), _block(CHANNELS * COARSE**2, WIDTHS[0]))
        pairs = list(zip(WIDTHS, WIDTHS[1:], strict=False))
        self.down = nn.ModuleList(nn.Sequential(_block(a, b, 2), _block(b, b)) for a, b in pairs)
        self.up = nn.ModuleList(nn.Sequential(_block(a + b, a), _block(a, a)) for a, b in reversed(pairs))
        self.front = nn.Conv2d(WIDTHS[0], 1 + 4 + len(MOTIONS), 1)
        self.handle = nn.Sequential(nn.Conv2d(WIDTHS[0], COARSE**2, 1), nn.PixelShuffle(COARSE))

    def forward(self, image: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Return logits of fronts, distances to their sides [m] (left, bottom, right, top), logits of MOTIONS, logits of handles.

        Args:
            image: shape [image CHANNELS row column], rows and columns multiples of MULTIPLE.

        Returns:
            The first three at the network's cells, shapes [image row column], [image 4 row column], [image MOTIONS row column];
            the last at the image's, shape [image row column].
        """
        seen = [self.first(image)]
        for down in self.down:
            seen.append(down(seen[-1]))
        x = seen.pop()
        for up in self.up:
            x = up(torch.cat([seen.pop(), nn.functional.interpolate(x, scale_factor=2.0)], dim=1))
        found = self.front(x)
        return found[:, 0], nn.functional.softplus(found[:, 1:5]) * 0.5, found[:, 5:], self.handle(x)[:, 0]

    def see(self, image: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return probabilities of fronts, their sides [m], probabilities of MOTIONS and of handles in an image of any size.

        Args:
            image: shape [CHANNELS row column].

        Returns:
            What `forward` does, without its first axis.
        """
        pad = [(0, 0), *((0, -size % MULTIPLE) for size in image.shape[1:])]
        with torch.inference_mode():
            front, sides, motion, handle = (x[0] for x in self(torch.from_numpy(np.pad(image, pad))[None]))
        handle = handle[: image.shape[1], : image.shape[2]]
        return front.sigmoid().numpy(), sides.numpy(), motion.softmax(dim=0).numpy(), handle.sigmoid().numpy()


def _block(first: int, last: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(nn.Conv2d(first, last, 3, stride, 1, bias=False), nn.BatchNorm2d(last), nn.ReLU())


def image(layer: Layer, floor: float) -> np.ndarray:
    """Return what the network sees of a plane, shape [CHANNELS row column].

    Args:
        layer: the plane's image.
        floor: height of the floor [m].
    """
    rows = layer.low[1] - floor + layer.cell * np.arange(layer.height.shape[0])
    return channels(layer.color, layer.height, layer.ahead, layer.relief, layer.wall, rows)


def channels(
    color: np.ndarray, height: np.ndarray, ahead: np.ndarray, relief: np.ndarray, wall: np.ndarray, rows: np.ndarray
) -> np.ndarray:
    """Return the same of a Layer's values; `rows` are the heights of its rows over the floor [m]."""
    seen = ~np.isnan(height)
    rgb = np.where(seen[..., None], color / 255.0 - 0.5, 0.0)
    high = np.broadcast_to(rows[:, None] - 1.0, seen.shape)
    planes = (np.where(seen, height, 0.0) / 0.01, ahead / 0.03, np.clip(relief, -0.03, 0.09) / 0.03, wall, high)
    return np.stack([seen, *np.moveaxis(rgb, -1, 0), *planes]).astype(np.float32)


@cache
def load(file: Path = FILE) -> FrontNetwork:
    """Return a trained network."""
    network = FrontNetwork()
    network.load_state_dict({name: value.float() for name, value in torch.load(file, weights_only=True).items()})
    return network.eval()
