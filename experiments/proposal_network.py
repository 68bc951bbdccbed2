"""Train the network that proposes fronts on images of virtual homes.

    python experiments/proposal_images.py runs/homes_train/* --out runs/proposal_images
    python experiments/proposal_network.py runs/proposal_images/*.npz --out s2a/annotate/propose/fronts.pt
        [--steps 6000] [--batch 8] [--device cpu] [--init FILE] [--seed 0] [--seconds S] [--test IMAGES ...]

Each step sees crops of the planes: mostly about a front; mirrored, in other colours, with noise and holes, most of them bent,
smeared and unevenly lit too. A cell of a front says where its sides are, by the logarithm of the intersection over union (Yu et
al. 2016, UnitBox) and by the distances. In the end, and with `--steps 0` of the first weights, it tells how the fronts of the
test agree with the truth.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import torch
from proposal_images import Planes
from proposals import MATCH, matched
from torch import nn

from s2a.annotate.propose.fronts import fronts
from s2a.annotate.propose.layers import Layer, ProposeConfig
from s2a.annotate.propose.network import CHANNELS, COARSE, MOTIONS, FrontNetwork, load
from s2a.annotate.propose.network import image as image_of
from s2a.core import config
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
"""Highest learning rate of AdamW; it rises over WARM of the steps and falls as a cosine."""
WARM = 0.05
HARDER = 0.75
"""Fraction of the crops that are made `harder`."""
LOST = 0.2
"""Weight of a cell whose surface a harder crop lacks."""


class Crops(torch.utils.data.IterableDataset):
    """Endless crops of planes."""

    def __init__(self, files: list[Path], seed: int) -> None:
        """Read all planes."""
        self.seed = seed
        with ThreadPoolExecutor() as helpers:
            self.planes = [
                (*plane, planes.cell)
                for planes in helpers.map(Planes.read, files)
                for plane in zip(planes.images, planes.boxes, planes.handles, strict=True)
            ]
        many = np.array([0.4 + min(int(boxes[:, 5].sum()), 4) for _, boxes, _, _ in self.planes])
        self.chance = many / many.sum()

    def __iter__(self):
        """Yield image (in half precision), front, weight, sides [m], motion, handle."""
        helper = torch.utils.data.get_worker_info()
        random = np.random.default_rng([self.seed, helper.id if helper else 0])
        while True:
            image, boxes, handle, cell = self.planes[random.choice(len(self.planes), p=self.chance)]
            seen, *truth = _mirrored(random, *_crop(random, image, boxes, handle, cell))
            yield seen.half(), *truth


def main() -> None:
    """Train, and write the weights in half precision."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("images", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=6000)
    parser.add_argument(
        "--seconds", type=float, default=np.inf, help="of training, where that is less than its steps take"
    )
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--helpers", type=int, default=0, help="processes that cut crops")
    parser.add_argument("--init", type=Path, help="weights to go on from")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--test", type=Path, nargs="*", default=[], help="images that are not among those of the training"
    )
    args = parser.parse_args()
    torch.manual_seed(args.seed)
    network = load(args.init).train() if args.init else FrontNetwork()
    network = network.to(args.device, memory_format=torch.channels_last)
    if args.steps:
        train(network, args)
    for name, figures in tested(network.cpu().eval(), args.test).items():
        print(f"test of {name}: {figures}", flush=True)


def train(network: FrontNetwork, args: argparse.Namespace) -> None:
    """Train a network, and write its weights now and then and in the end."""
    crops = torch.utils.data.DataLoader(
        Crops(args.images, args.seed), args.batch, num_workers=args.helpers, prefetch_factor=1 if args.helpers else None
    )
    optimizer = torch.optim.AdamW(network.parameters(), RATE, weight_decay=1e-4)
    mean, start = 0.0, None
    for step, batch in enumerate(track(crops, "train", args.steps)):
        start = start or time.monotonic()
        done = max(step / args.steps, (time.monotonic() - start) / args.seconds)
        for group in optimizer.param_groups:
            group["lr"] = RATE * min(done / WARM + 0.01, 0.5 + 0.5 * np.cos(np.pi * min(done, 1.0)))
        image, *truth = (x.to(args.device, non_blocking=True) for x in batch)
        image, truth[1] = harder(image.float(), truth[1])
        with torch.autocast(args.device.split(":")[0], torch.bfloat16):
            found = network(image.contiguous(memory_format=torch.channels_last))
        total = loss(*(x.float() for x in found), *truth)
        optimizer.zero_grad()
        total.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 5.0)
        optimizer.step()
        mean += 0.02 * (float(total.detach()) - mean)
        if step + 1 == args.steps or done >= 1.0:
            print(f"step {step + 1}: loss {mean:.3f}, the last after {time.monotonic() - start:.0f} s", flush=True)
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


def tested(network: FrontNetwork, files: list[Path]) -> dict[str, dict[str, float]]:
    """Return precision, recall and F1 of the fronts on planes, by detail and whether a copy is coarse.

    Fronts that are not asked for are neither right nor wrong. Files are named as proposal_images.py names them.
    """
    settings = config.load(ProposeConfig, config.file("annotate")["propose"])
    sums: dict[str, np.ndarray] = defaultdict(lambda: np.zeros(3, int))
    for file in files:
        planes = Planes.read(file)
        *_, detail = file.stem.split("_")
        for image, boxes in zip(planes.images, planes.boxes, strict=True):
            plane = _layer(image, planes.cell)
            found = [
                [front.box.left, front.box.bottom, front.box.right, front.box.top]
                for front in fronts(plane, network.see(image_of(plane, 0.0)), settings)
            ]
            scores = _overlaps(np.array(found).reshape(-1, 4), boxes[:, :4])
            pairs = matched(scores * (boxes[:, 5] > 0))
            free = (scores.max(axis=1, initial=0.0) >= MATCH).sum() - len(pairs) if len(boxes) else 0
            sums[detail.rstrip("0123456789")] += [len(pairs), len(found) - free, int((boxes[:, 5] > 0).sum())]
    return {
        name: {
            "precision": round(int(right) / max(int(seen), 1), 3),
            "recall": round(int(right) / max(int(true), 1), 3),
            "f1": round(2 * int(right) / max(int(seen + true), 1), 3),
            "fronts": int(true),
        }
        for name, (right, seen, true) in sums.items()
    }


def _layer(image: np.ndarray, cell: float) -> Layer:
    """Return the plane of which an image was made, over a floor at zero; it lies anywhere."""
    seen, *color, height, ahead, relief, wall, rows = image.astype(np.float32)
    nothing = np.where(seen > 0, 0.0, np.nan)
    place = np.array([0.0, rows[0, 0] + 1.0])
    color = 255.0 * (np.stack(color, axis=-1) + 0.5) + nothing[..., None]
    axes = np.eye(3)[[1, 0]]
    return Layer(*axes, 0.0, place, cell, color, 0.01 * height + nothing, 0.03 * ahead, 0.03 * relief, wall > 0)


def _overlaps(ones: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return intersections over union of rectangles (left, bottom, right, top), shapes [one 4], [other 4] -> [one other]."""
    low, high = (np.maximum(ones[:, None, :2], others[:, :2]), np.minimum(ones[:, None, 2:], others[:, 2:]))
    shared = (high - low).clip(0.0).prod(axis=2)
    areas = [(x[:, 2:] - x[:, :2]).prod(axis=1) for x in (ones, others)]
    return shared / np.maximum(areas[0][:, None] + areas[1] - shared, 1e-9)


def _field(count: int, cells: int, like: torch.Tensor) -> torch.Tensor:
    """Return smooth noise of about unit variance over crops, with so many bumps along a side, shape [crop count CROP CROP]."""
    noise = torch.randn(len(like), count, cells, cells, device=like.device)
    noise = nn.functional.interpolate(noise, like.shape[-2:], mode="bicubic", align_corners=True)
    return noise / noise.std(dim=(-2, -1), keepdim=True).clamp(min=0.3)


def _any(like: torch.Tensor, low: float, high: float, chance: float = 1.0) -> torch.Tensor:
    """Return a number from a range for each crop, and 0 for those beyond a chance, shape [crop 1 1 1]."""
    number, drawn = torch.rand(2, len(like), 1, 1, 1, device=like.device)
    return torch.where(drawn < chance, low + (high - low) * number, torch.zeros_like(number))


def _blurred(values: torch.Tensor, seen: torch.Tensor, size: int) -> torch.Tensor:
    """Return the means of values over squares of so many cells of what is seen, twice."""
    for _ in range(2):
        mass, total = (nn.functional.avg_pool2d(x, size, 1, size // 2) for x in (seen, values * seen))
        values = total / mass.clamp(min=1e-3)
    return values


def harder(image: torch.Tensor, weight: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Return crops as coarse captures would show them, and the weights of the truth; HARDER of them are changed.

    Args:
        image: shape [crop CHANNELS row column].
        weight: of the network's cells, shape [crop row column].
    """
    seen, color, height, out, wall, rows = image.split([1, 3, 1, 2, 1, 1], dim=1)
    blur = int(torch.randint(1, 6, ())) * 2 + 1
    color = torch.lerp(color, _blurred(color, seen, blur), _any(image, 0.0, 1.0, 0.7)) + 0.5
    # Other paint: channels are mixed, and contrast is lost.
    mix = torch.eye(3, device=image.device) + _any(image, 0.0, 0.4)[:, 0] * torch.randn(
        len(image), 3, 3, device=image.device
    )
    color = torch.einsum("bij,bjyx->biyx", mix / mix.sum(dim=2, keepdim=True).clamp(min=0.5), color)
    mean = (color * seen).sum(dim=(2, 3), keepdim=True) / seen.sum(dim=(2, 3), keepdim=True).clamp(min=1.0)
    color = mean + (color - mean) * _any(image, 0.3, 1.1)
    # Grain along or across, light that falls off, an exposure that changes along a line, gloss.
    grain = torch.randn(
        len(image), 1, int(torch.randint(2, 9, ())), int(torch.randint(24, 129, ())), device=image.device
    )
    grain = nn.functional.interpolate(grain if torch.rand(()) < 0.5 else grain.mT, image.shape[-2:], mode="bilinear")
    light = _any(image, 0.0, 0.08, 0.4) * grain + _any(image, 0.0, 0.3, 0.8) * _field(
        1, int(torch.randint(2, 6, ())), image
    )
    step = torch.tanh(_any(image, 1.0, 20.0) * (_field(1, 2, image) - _any(image, -1.0, 1.0)))
    color = color * torch.exp(light + _any(image, -0.2, 0.2, 0.4) * step)
    gloss = _any(image, 0.0, 0.5, 0.4) * (_field(1, int(torch.randint(3, 9, ())), image) - 1.2).clamp(min=0.0)
    color = (color + gloss).clamp(0.0, 1.0) - 0.5
    # Relief is smeared or flat; planes lean and are bent, and what is farther than a layer is thick is not of them.
    size = int(torch.randint(1, 4, ())) * 2 + 1
    smear, whole = _any(image, 0.0, 1.0, 0.6), torch.ones_like(seen)
    height = torch.lerp(height, _blurred(height, seen, size), smear)
    out = torch.lerp(out, _blurred(out, whole, size), smear) * _any(image, 0.0, 1.0, 0.7)
    height = height * _any(image, 0.2, 1.0)
    lean = torch.linspace(-1.0, 1.0, image.shape[-2], device=image.device)[:, None] * _any(image, -2.0, 2.0, 0.5)
    bend = lean + _any(image, 0.0, 1.0, 0.7) * _field(1, int(torch.randint(2, 5, ())), image)
    height = height + bend
    ahead = torch.maximum(out[:, :1], (height * seen).clamp(min=0.0) / 3.0)
    left = (height.abs() < _any(image, 1.8, 3.3)) & (
        _field(1, int(torch.randint(4, 17, ())), image) < _any(image, 1.6, 4.0)
    )
    # Something stands before it.
    where = torch.stack([_field(1, 3, image), _field(1, int(torch.randint(2, 6, ())), image)]).sum(dim=0)
    before = (where > 3.2) & (_any(image, 1.0, 1.0, 0.3) > 0)
    ahead = torch.where(before, _any(image, 0.5, 3.0) + 0.0 * ahead, ahead)
    now = seen * (left & ~before)
    changed = torch.cat([now, color * now, height * now, ahead, out[:, 1:], wall, rows], dim=1)
    chosen = _any(image, 1.0, 1.0, HARDER) > 0
    lost = nn.functional.avg_pool2d((seen - now) * chosen, COARSE)[:, 0] > 0.5
    return torch.where(chosen, changed, image), torch.where(lost, LOST * weight, weight)


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
    color += random.uniform(0, 0.02) * random.standard_normal(color.shape, np.float32)
    image[1:4] = np.where(seen, color.clip(-0.5, 0.5), 0.0)
    image[4] = np.where(
        seen, image[4] + random.normal(0, 0.15) + 0.1 * random.standard_normal(seen.shape, np.float32), 0.0
    )
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
