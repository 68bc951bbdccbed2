"""Train the network that proposes fronts on images of virtual homes.

    python experiments/proposal_images.py runs/homes_train/* --out runs/proposal_images
    python experiments/proposal_network.py runs/proposal_images/*.npz --out s2a/annotate/propose/fronts.pt
        [--steps 6000] [--batch 8] [--device cpu] [--init FILE] [--seed 0]

Each step sees crops of the planes: mostly about a front; mirrored, in other colours, with noise and holes. A cell of a
front says where its sides are, by the logarithm of the intersection over union (Yu et al. 2016, UnitBox) and by the distances.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import torch
from proposal_images import Planes
from torch import nn

from s2a.annotate.propose.network import CHANNELS, COARSE, MOTIONS, FrontNetwork, load
from s2a.core.outputs import atomic_write
from s2a.core.progress import track

CROP = 256
"""Cells along a side of what is seen in a step."""
ABOUT, BESIDE = 0.75, 80
"""Fraction of the crops that lie about a front, and cells by which they are off at most."""
MARGIN = 1.5
"""Cells beside a front's sides that count as neither front nor not, so that neighbours are told apart."""
UNSURE = 0.3
"""Weight of these."""
OTHER = {"left": "right", "right": "left"}
MIRRORED = torch.tensor([*(MOTIONS.index((kind, OTHER.get(way, way))) for kind, way in MOTIONS), -1])
"""Index in MOTIONS of each motion in a mirror; -1 stays."""
RATE = 2e-3
"""Highest learning rate of AdamW; it falls as a cosine."""


class Crops(torch.utils.data.IterableDataset):
    """Endless crops of planes."""

    def __init__(self, files: list[Path], seed: int) -> None:
        """Read all planes."""
        self.seed = seed
        self.planes = [
            (*plane, planes.cell)
            for planes in map(Planes.read, files)
            for plane in zip(planes.images, planes.boxes, planes.handles, strict=True)
        ]
        many = np.array([0.4 + min(int(boxes[:, 5].sum()), 4) for _, boxes, _, _ in self.planes])
        self.chance = many / many.sum()

    def __iter__(self):
        """Yield image, front, weight, sides [m], motion, handle."""
        helper = torch.utils.data.get_worker_info()
        random = np.random.default_rng([self.seed, helper.id if helper else 0])
        while True:
            image, boxes, handle, cell = self.planes[random.choice(len(self.planes), p=self.chance)]
            yield _mirrored(random, *_crop(random, image, boxes, handle, cell))


def main() -> None:
    """Train, and write the weights in half precision."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("images", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=6000)
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--helpers", type=int, default=0, help="processes that cut crops")
    parser.add_argument("--init", type=Path, help="weights to go on from")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    torch.manual_seed(args.seed)
    network = load(args.init).train() if args.init else FrontNetwork()
    network = network.to(args.device, memory_format=torch.channels_last)
    crops = torch.utils.data.DataLoader(Crops(args.images, args.seed), args.batch, num_workers=args.helpers)
    optimizer = torch.optim.AdamW(network.parameters(), RATE, weight_decay=1e-4)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, args.steps)
    mean = 0.0
    for step, batch in enumerate(track(crops, "train", args.steps)):
        image, *truth = (x.to(args.device) for x in batch)
        with torch.autocast(args.device.split(":")[0], torch.bfloat16):
            found = network(image.contiguous(memory_format=torch.channels_last))
        total = loss(*(x.float() for x in found), *truth)
        optimizer.zero_grad()
        total.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 5.0)
        optimizer.step()
        schedule.step()
        mean += 0.02 * (float(total.detach()) - mean)
        if step + 1 == args.steps:
            break
        if step % 500 == 499:
            print(f"step {step + 1}: loss {mean:.3f}", flush=True)
            _write(network, args.out)
    _write(network, args.out)


def _write(network: FrontNetwork, file: Path) -> None:
    with atomic_write(file) as out:
        torch.save(
            {k: v.cpu().half() if v.is_floating_point() else v.cpu() for k, v in network.state_dict().items()}, out
        )


def loss(
    front: torch.Tensor,
    sides: torch.Tensor,
    motion: torch.Tensor,
    handle: torch.Tensor,
    true_front: torch.Tensor,
    weight: torch.Tensor,
    true_sides: torch.Tensor,
    true_motion: torch.Tensor,
    true_handle: torch.Tensor,
) -> torch.Tensor:
    """Return the loss of what the network found; shapes as `FrontNetwork` returns them."""
    cross = nn.functional.binary_cross_entropy_with_logits
    on = (true_front > 0.5) & (weight > 0.0)
    count = on.sum().clamp(min=1)
    found, true = (x.permute(0, 2, 3, 1)[on] for x in (sides, true_sides))
    shared = torch.minimum(found, true)
    areas = [(x[:, 0] + x[:, 2]) * (x[:, 1] + x[:, 3]) for x in (shared, found, true)]
    overlap = -torch.log((areas[0] / (areas[1] + areas[2] - areas[0]).clamp(min=1e-6)).clamp(min=1e-3)).sum() / count
    away = nn.functional.smooth_l1_loss(found, true, beta=0.02, reduction="sum") / count / 4
    known = on & (true_motion >= 0)
    opens = nn.functional.cross_entropy(motion.permute(0, 2, 3, 1)[known], true_motion[known], reduction="sum") / count
    p = handle.sigmoid()
    dice = 1 - (2 * (p * true_handle).sum() + 1) / (p.sum() + true_handle.sum() + 1)
    fronts = (weight * cross(front, true_front, reduction="none")).mean()
    held = cross(handle, true_handle, pos_weight=torch.tensor(2.0, device=handle.device))
    return 3 * fronts + 0.5 * overlap + 2 * away + 0.4 * opens + 5 * held + 0.3 * dice


def _crop(
    random: np.random.Generator, image: np.ndarray, boxes: np.ndarray, handle: np.ndarray, cell: float
) -> tuple[np.ndarray, ...]:
    """Return a crop of a plane, changed as scans differ, and the truth in it."""
    rows, columns = handle.shape
    asked = boxes[boxes[:, 5] > 0]
    if len(asked) and random.random() < ABOUT:
        box = random.choice(asked)
        middle = (box[:2] + box[2:4]) / 2 + random.uniform(-BESIDE, BESIDE, 2)
    else:
        middle = random.uniform(0, (columns, rows))
    x0, y0 = (_start(random, m, n) for m, n in zip(middle, (columns, rows), strict=True))
    here = np.s_[max(y0, 0) : min(y0 + CROP, rows), max(x0, 0) : min(x0 + CROP, columns)]
    there = tuple(slice(max(s.start - o, 0), s.stop - o) for s, o in zip(here, (y0, x0), strict=True))
    seen = np.zeros((CHANNELS, CROP, CROP), np.float32)
    seen[(slice(None), *there)] = _changed(random, image[(slice(None), *here)].astype(np.float32))
    seen[-1] = (float(image[-1, 0, 0]) + cell * (y0 + np.arange(CROP)))[:, None] + random.normal(0, 0.02)
    held = np.zeros((CROP, CROP), np.float32)
    held[there] = handle[here]
    return seen, *_truth(boxes - np.array([x0, y0, x0, y0, 0, 0]), cell), held


def _start(random: np.random.Generator, middle: float, size: int) -> int:
    """Return where a crop begins along one side of a plane."""
    if size <= CROP:
        return int(random.integers(size - CROP, 1))
    return int(np.clip(middle - CROP / 2, -16, size + 16 - CROP))


def _changed(random: np.random.Generator, image: np.ndarray) -> np.ndarray:
    """Return a plane in other colours, its handles higher or lower, with noise and holes."""
    seen = image[0] > 0
    color = image[1:4][random.permutation(3) if random.random() < 0.5 else slice(None)]
    color = color * random.uniform(0.6, 1.2) + random.uniform(-0.1, 0.1, (3, 1, 1)) + random.uniform(-0.1, 0.1)
    color += random.normal(0, random.uniform(0, 0.02), color.shape)
    image[1:4] = np.where(seen, color.clip(-0.5, 0.5), 0.0)
    image[4] = np.where(seen, image[4] + random.normal(0, 0.15) + random.normal(0, 0.1, seen.shape), 0.0)
    image[5:7] *= random.uniform(0.8, 1.2)
    for _ in range(random.integers(1, 5) if random.random() < 0.2 else 0):
        row, column, height, width = *random.integers(0, seen.shape), *random.integers(4, 30, 2)
        image[:5, row : row + height, column : column + width] = 0.0
    return image


def _truth(boxes: np.ndarray, cell: float) -> tuple[np.ndarray, ...]:
    """Return fronts, weights, sides [m] and motions at the network's cells of a crop; `boxes` as in Planes, from its corner."""
    size = CROP // COARSE
    front, weight = np.zeros((size, size), np.float32), np.ones((size, size), np.float32)
    sides, motion = np.full((4, size, size), 1e-3, np.float32), np.full((size, size), -1)
    middle = (np.arange(size) + 0.5) * COARSE
    for box in boxes[boxes[:, 5] == 0]:
        weight[_area(box, 0.0)] = 0.0
    asked = boxes[boxes[:, 5] > 0]
    for box in asked[
        np.argsort(-(asked[:, 2] - asked[:, 0]) * (asked[:, 3] - asked[:, 1]))
    ]:  # those within others last
        outer, inner = _area(box, 0.0), _area(box, MARGIN)
        weight[outer], front[outer] = UNSURE, 0.0
        weight[inner], front[inner], motion[inner] = 1.0, 1.0, int(box[4])
        x, y = middle[None, inner[1]], middle[inner[0], None]
        for k, away in enumerate((x - box[0], y - box[1], box[2] - x, box[3] - y)):
            sides[k][inner] = (cell * away).clip(1e-3)
    return front, weight, sides, motion


def _area(box: np.ndarray, within: float) -> tuple[slice, slice]:
    """Return the network's cells of a rectangle of a crop, without some cells of the image at its sides."""
    low = np.clip((box[:2] + within) / COARSE, 0, CROP // COARSE).astype(int)
    high = np.clip(np.ceil((box[2:4] - within) / COARSE), 0, CROP // COARSE).astype(int)
    return slice(low[1], high[1]), slice(low[0], high[0])


def _mirrored(random: np.random.Generator, *crop: np.ndarray) -> tuple[torch.Tensor, ...]:
    """Return a crop as tensors, half of them mirrored."""
    image, front, weight, sides, motion, handle = (torch.from_numpy(x) for x in crop)
    if random.random() < 0.5:
        image, front, weight, sides, motion, handle = (
            x.flip(-1) for x in (image, front, weight, sides, motion, handle)
        )
        sides, motion = sides[[2, 1, 0, 3]], MIRRORED[motion]
    return image, front, weight, sides, motion, handle


if __name__ == "__main__":
    main()
