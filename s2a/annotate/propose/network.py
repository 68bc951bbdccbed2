"""A network that sees fronts and their handles in the image of a plane."""

from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from torch import nn

from s2a.annotate import region
from s2a.annotate.propose.layers import Layer
from s2a.core.errors import InputError

# Of what the network sees of a cell: seen, RGB, height, what stands out, its relief, walls, height over the floor
CHANNELS = 9
Motion = tuple[Literal["slide"], region.Direction] | tuple[Literal["hinge"], Literal["right", "left", "top", "bottom"]]
# How a front opens, as seen from the room: it slides somewhere, or turns about one of its sides
MOTIONS: tuple[Motion, ...] = (
    ("slide", "out"),
    ("slide", "right"),
    ("slide", "left"),
    ("hinge", "right"),
    ("hinge", "left"),
    ("hinge", "top"),
    ("hinge", "bottom"),
)
COARSE = 2  # Cells of the image in a cell of the network
# Channels at the network's cells, and at each halving: a cell of the last covers 32 of the image
WIDTHS = (32, 48, 64, 96, 96)
MULTIPLE = COARSE * 2 ** (len(WIDTHS) - 1)  # Rows and columns of what the network takes are multiples
FILE = Path(__file__).with_name("fronts.pt")


class FrontNetwork(nn.Module):
    """Images of planes -> where fronts are, their sides, how they open, and where handles are.

    A U-Net (Ronneberger et al. 2015) whose cells each say where the sides of their front are, as in FCOS (Tian et al. 2019).
    """

    def __init__(self) -> None:
        super().__init__()
        self.first = nn.Sequential(nn.PixelUnshuffle(COARSE), _block(CHANNELS * COARSE**2, WIDTHS[0]))
        pairs = list(zip(WIDTHS, WIDTHS[1:], strict=False))
        self.down = nn.ModuleList(nn.Sequential(_block(a, b, 2), _block(b, b)) for a, b in pairs)
        self.up = nn.ModuleList(nn.Sequential(_block(a + b, a), _block(a, a)) for a, b in reversed(pairs))
        self.front = nn.Conv2d(WIDTHS[0], 1 + 4 + len(MOTIONS), 1)
        self.handle = nn.Sequential(nn.Conv2d(WIDTHS[0], COARSE**2, 1), nn.PixelShuffle(COARSE))

    def forward(self, image: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Return logits of fronts, distances to their sides [m] (left, bottom, right, top), logits of MOTIONS, logits of handles.

        `image`: shape [image CHANNELS row column], rows and columns multiples of MULTIPLE.

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
        maps = self.front(x)
        return maps[:, 0], nn.functional.softplus(maps[:, 1:5]) * 0.5, maps[:, 5:], self.handle(x)[:, 0]

    def see(self, image: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return probabilities of fronts, their sides [m], probabilities of MOTIONS and of handles in an image of any size.

        `image`: shape [CHANNELS row column].

        Returns:
            Shapes as `forward` has them, without the first axis; the first three go on beyond the image, to a multiple of
            MULTIPLE.
        """
        pad = [(0, 0), *((0, -size % MULTIPLE) for size in image.shape[1:])]
        with torch.inference_mode():
            front, sides, motion, handle = (x[0] for x in self(torch.from_numpy(np.pad(image, pad))[None]))
        handle = handle[: image.shape[1], : image.shape[2]]
        return front.sigmoid().numpy(), sides.numpy(), motion.softmax(dim=0).numpy(), handle.sigmoid().numpy()


def _block(first: int, last: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(nn.Conv2d(first, last, 3, stride, 1, bias=False), nn.BatchNorm2d(last), nn.ReLU())


def image(layer: Layer, floor: float) -> np.ndarray:
    """Return what the network sees of a plane, shape [CHANNELS row column]. `floor`: height of the floor [m]."""
    seen = ~np.isnan(layer.height)
    color = np.where(seen[..., None], layer.color / 255.0 - 0.5, 0.0)
    rows = layer.low[1] - floor + layer.cell * np.arange(len(seen)) - 1.0
    high = np.broadcast_to(rows[:, None], seen.shape)
    relief = np.clip(layer.relief, -0.03, 0.09) / 0.03
    planes = (np.where(seen, layer.height, 0.0) / 0.01, layer.ahead / 0.03, relief, layer.wall, high)
    return np.stack([seen, *np.moveaxis(color, -1, 0), *planes]).astype(np.float32)


@cache
def load(file: Path = FILE) -> FrontNetwork:
    """Return a trained network; InputError where the file is missing, damaged or of another network."""
    network = FrontNetwork()
    try:
        network.load_state_dict({name: value.float() for name, value in torch.load(file, weights_only=True).items()})
    except Exception as error:  # of torch, pickle, zipfile: whatever a damaged or foreign file makes them raise
        why = (str(error) or type(error).__name__).splitlines()[0]
        raise InputError(
            f"{file}: not a network that proposes fronts ({why}); give another file, or install s2a again"
        ) from error
    return network.eval()
