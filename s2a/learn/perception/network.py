"""The network that estimates a part from points: its layers, its training, and what it makes of a pool's or a room's parts."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch import nn

from s2a.core.bounds import Count, NotNegative, Positive
from s2a.core.cache import UNREADABLE
from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.learn.perception import depth_camera
from s2a.learn.perception.depth_camera import DepthCameraConfig, PartPoints, VisibleRoom
from s2a.scene.usd import sim_stage
from s2a.sim.world import SimStage
from s2a.tasks import pool
from s2a.tasks.mdp.seen import DIRECTIONS, NUMBERS, SIDEWAYS

FEATURES = 5  # Numbers of a point: place [m], 1 on the part, height above the front [m]
NEAR = 256  # Points about the grasp point that are seen a second time
# [1/m] Scales of places and heights, which bring them to about 1; near the grasp places are scaled as heights
PLACE, HEIGHT = 4.0, 20.0
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

        `points`: shape [cloud point FEATURES].
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
        numbers = self.head(torch.cat([whole, self.near(closer).amax(dim=1)], dim=-1))
        return _description(numbers, guess.detach()), guess


def _layers(first: int, *widths: int) -> nn.Sequential:
    """Return linear layers with normalisation in between."""
    sizes = (first, *widths)
    each = [(nn.Linear(a, b), nn.LayerNorm(b), nn.ELU()) for a, b in zip(sizes, sizes[1:], strict=False)]
    return nn.Sequential(*(layer for group in each for layer in group))


def _description(numbers: torch.Tensor, guess: torch.Tensor) -> torch.Tensor:
    """Return a network's numbers as a description: directions of length 1, across and inwards at right angles."""
    point = guess + CENTIMETRES * numbers[:, :3]
    inwards = nn.functional.normalize(numbers[:, 6:9], dim=1)
    across = numbers[:, 3:6] - (numbers[:, 3:6] * inwards).sum(dim=1, keepdim=True) * inwards
    across = nn.functional.normalize(across, dim=1)
    sign = (across * across.new_tensor(SIDEWAYS)).sum(dim=1, keepdim=True)
    across = torch.where(sign < 0.0, -across, across)
    axis, along = (nn.functional.normalize(numbers[:, i : i + 3], dim=1) for i in (9, 12))
    size = nn.functional.softplus(numbers[:, 15:18]) * 3.0 * CENTIMETRES
    slides, lengths = numbers[:, 18:19].sigmoid(), nn.functional.softplus(numbers[:, 19:21]) * 0.4
    return torch.cat([point, across, inwards, axis, along, size, slides, lengths], dim=1)


@dataclass(frozen=True, kw_only=True)
class NetworkConfig:
    """How the network is trained.

    Attributes:
        steps: number of steps of the optimiser.
        batch: frames per step.
        points: number of a frame's points, drawn for each step.
        width: width of the network's first layers.
    """

    steps: Count
    batch: Count
    # the highest; it rises over the first twentieth of the steps and falls as a cosine to zero
    learning_rate: Positive = 0.001
    weight_decay: NotNegative = 0.01  # of AdamW
    turn: NotNegative = 0.35  # frames are turned about the vertical by at most this [rad]
    scale: Positive = 1.15  # and scaled by at most this factor, up or down
    points: Count
    width: Count


def features(clouds: Sequence[PartPoints]) -> torch.Tensor:
    """Return clouds of as many points as the network's input, shape [cloud point FEATURES]."""
    each = [np.concatenate([c.points, c.is_part[:, None], c.height[:, None]], axis=1, dtype=np.float32) for c in clouds]
    return torch.from_numpy(np.stack(each))


def loss(estimate: torch.Tensor, guess: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """Return the mean loss of descriptions: centimetres of places, and of directions 1 - cosine, weighed as a policy needs them.

    Args:
        estimate: what the network found, shape [cloud NUMBERS].
        guess: its first guess of the grasp point, shape [cloud 3].
        truth: shape [cloud NUMBERS].
    """

    def centimetres(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
        return nn.functional.huber_loss(100.0 * a, 100.0 * b, reduction="none").sum(dim=1)

    def cosine(first: int) -> torch.Tensor:
        return (estimate[:, first : first + 3] * truth[:, first : first + 3]).sum(dim=1)

    hinge = 1.0 - truth[:, 18]
    total = centimetres(estimate[:, :3], truth[:, :3]) + 0.5 * centimetres(guess, truth[:, :3])
    total += 20.0 * (1.0 - cosine(3) ** 2)  # a gripper turned by half is the same
    total += 20.0 * sum(1.0 - cosine(first) for first in (6, 12)) + 10.0 * (1.0 - cosine(9))
    total += 0.3 * centimetres(estimate[:, 15:18], truth[:, 15:18])
    total += 2.0 * nn.functional.binary_cross_entropy(estimate[:, 18], truth[:, 18], reduction="none")
    total += 0.05 * hinge * centimetres(estimate[:, 19:20], truth[:, 19:20])
    total += 0.02 * centimetres(estimate[:, 20:21], truth[:, 20:21])
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

    `points`: of all frames, shape [frame point FEATURES], on the device that is to train; `truth`: descriptions, the
    grasp point relative to the cloud's center, shape [frame NUMBERS].
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
        estimate, guess = network(seen)
        error = loss(estimate, guess, wanted)
        optimizer.zero_grad()
        error.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        schedule.step()
        if step % every == every - 1:
            curve.append(float(error.detach()))
    return network.eval(), curve


PRETRAINED = "pretrained"  # Names the network that comes with s2a
ESTIMATES = ".npz"  # Ending of a file of estimates; other files hold a network
ROOM_ESTIMATES = 4  # Made of a room's part; each episode is told one of them
BATCH = 256  # Clouds that the network sees at once


class Perception:
    """A network on the device that it is to run on."""

    def __init__(self, network: PartNetwork, device: str) -> None:
        self._network, self._device = network.to(device).eval(), device

    @torch.inference_mode()
    def estimate(self, clouds: Sequence[PartPoints]) -> np.ndarray:
        """Return the description of each cloud's part (`s2a.tasks.mdp.seen`), shape [cloud NUMBERS]."""
        seen = features(clouds)
        numbers = torch.cat([self._network(some.to(self._device))[0].cpu() for some in seen.split(BATCH)]).numpy()
        numbers[:, :3] += np.stack([cloud.center for cloud in clouds])
        return numbers


def save(network: PartNetwork, path: Path) -> None:
    """Write a network's weights."""
    state = {name: value.cpu() for name, value in network.state_dict().items()}
    with atomic_write(path) as out:
        torch.save({"width": network.width, "weights": state}, out)


def file_of(path: Path) -> Path:
    """Return the file that a path or "pretrained" means; InputError where there is none."""
    file = Path(__file__).parents[1] / "policies/perception.pt" if str(path) == PRETRAINED else path
    if not file.is_file():
        raise InputError(f"perception {str(path)!r}: no such file; give what s2a perceive wrote, or {PRETRAINED}")
    return file


def load(path: Path, device: str) -> Perception:
    """Read a network that `save` wrote, or the one that comes with s2a; nothing in the file is executed.

    Raises:
        InputError: there is no such file, or it holds no network.
    """
    file = file_of(path)
    try:
        saved = torch.load(file, weights_only=True, map_location="cpu")
        network = PartNetwork(int(saved["width"]))
        network.load_state_dict(saved["weights"])
    except Exception as error:  # of torch, pickle, zipfile: whatever a damaged or foreign file makes them raise
        why = (str(error) or type(error).__name__).splitlines()[0]
        raise InputError(f"{file}: not a network of s2a perceive ({why})") from error
    return Perception(network, device)


def seen(
    path: Path,
    stages: Sequence[SimStage],
    perception: Path,
    together: int,
    camera: DepthCameraConfig,
    seed: int,
    device: str,
) -> list[SimStage]:
    """Return stages with what is made of camera frames of their parts.

    Args:
        path: the pool's index, whose frames are taken; or the room, of whose visuals they are taken now.
        stages: its parts.
        perception: a network of s2a perceive, pretrained, or the estimates that it wrote of a pool.
        together: frames that make an estimate.
        camera: for a room.
        seed: of where it stands.
        device: on which the network runs.
    """
    if pool.is_index(path):
        each = seen_pool(path, stages, perception, device)
    else:
        each = [seen_room(stage, perception, ROOM_ESTIMATES * together, camera, seed) for stage in stages]
    return [replace(stage, estimates=fused(stage.estimates, together)) for stage in each]


def fused(estimates: np.ndarray | None, together: int) -> np.ndarray | None:
    """Return the medians of each `together` estimates [frame NUMBERS]; of a rest only where there is nothing else."""
    if estimates is None or together == 1:
        return estimates
    count = max(1, len(estimates) // together)
    groups = np.array_split(estimates[: count * together], count)
    medians = np.stack([np.median(group, axis=0) for group in groups])
    for first in DIRECTIONS:
        medians[:, first : first + 3] /= np.linalg.norm(medians[:, first : first + 3], axis=1, keepdims=True) + 1e-9
    return medians


def seen_pool(index: Path, stages: Sequence[SimStage], perception: Path, device: str) -> list[SimStage]:
    """Return a pool's stages with what is made of their frames: by a network, or as s2a perceive wrote it down.

    Raises:
        InputError: a part has no frames, or no estimates.
    """
    entries = pool.read(index)
    if perception.suffix == ESTIMATES:
        estimates = read_estimates(perception)
        missing = [key for key in map(key_of, entries) if key not in estimates]
        if missing:
            raise InputError(f"{perception}: nothing of {', '.join(missing[:3])}; it is of another pool")
        return [replace(s, estimates=estimates[key_of(entry)]) for s, entry in zip(stages, entries, strict=True)]
    network = load(perception, device)
    clouds = of_pool(index)
    return [replace(s, estimates=network.estimate(some)) for s, some in zip(stages, clouds, strict=True)]


def seen_room(stage: SimStage, perception: Path, count: int, camera: DepthCameraConfig, seed: int) -> SimStage:
    """Return a room's stage with what a network makes of frames of its part; InputError where none shows it."""
    if perception.suffix == ESTIMATES:
        raise InputError(f"key 'perception': {perception} is of the parts of a pool; give a network or {PRETRAINED}")
    clouds = depth_camera.take(VisibleRoom(sim_stage.read(stage.path)), stage, camera, count, seed)
    if not clouds:
        raise InputError(f"no camera frame shows {stage.target}; it has no surface that a camera could see")
    return replace(stage, estimates=load(perception, "cpu").estimate(clouds))


def of_pool(index: Path) -> list[list[PartPoints]]:
    """Return the frames of a pool's parts, in its order; InputError where it was made without."""
    entries = pool.read(index)
    missing = [key_of(entry) for entry in entries if not entry.frames]
    if missing:
        raise InputError(f"{index}: no frames of {', '.join(missing[:3])}; make the pool with frames=8")
    return [depth_camera.load(index.parent / entry.frames) for entry in entries]


def key_of(entry: pool.PoolPart) -> str:
    """Return a part's name in a file of estimates."""
    return f"{entry.room}/{entry.part}"


def read_estimates(path: Path) -> dict[str, np.ndarray]:
    """Return the estimates of parts, shape [frame NUMBERS] each; InputError where the file is none."""
    try:
        with np.load(path) as file:
            return {name: file[name] for name in file.files}
    except UNREADABLE as error:
        raise InputError(f"{path}: not estimates of s2a perceive ({error})") from error


def error_table(
    estimates: Sequence[np.ndarray], truths: Sequence[np.ndarray], kinds: Sequence[str]
) -> dict[str, dict[str, float]]:
    """Return median and 95th percentile of each error over all frames of all parts.

    Args:
        estimates: of each part, shape [frame NUMBERS].
        truths: the truth of each, shape [NUMBERS].
        kinds: of each part's joint.
    """
    every = np.concatenate(estimates)
    true = np.repeat(np.stack(truths), [len(each) for each in estimates], axis=0)
    hinge = np.repeat(np.array(kinds) == "revolute", [len(each) for each in estimates])
    if every.shape[1] != NUMBERS:
        raise ValueError(f"estimates of {every.shape[1]} numbers, expected {NUMBERS}")
    columns = {
        "grasp point [m]": np.linalg.norm(every[:, :3] - true[:, :3], axis=1),
        "across [degree]": _angles(every, true, 3, lines=True),
        "inwards [degree]": _angles(every, true, 6),
        "axis [degree]": _angles(every, true, 9),
        "along [degree]": _angles(every, true, 12),
        "thickness [m]": np.abs(every[:, 16] - true[:, 16]),
        "lever arm of hinges [m]": np.abs(every[hinge, 19] - true[hinge, 19]),
        "travel [m]": np.abs(every[:, 20] - true[:, 20]),
        "wrong kind": ((every[:, 18] > 0.5) != (true[:, 18] > 0.5)).astype(float),
    }
    return {
        name: {"median": float(np.median(v)), "p95": float(np.quantile(v, 0.95)), "mean": float(v.mean())}
        for name, v in columns.items()
        if len(v)
    }


def _angles(a: np.ndarray, b: np.ndarray, first: int, lines: bool = False) -> np.ndarray:
    """Return the angles between directions, or between lines, in columns from `first` on [degree], shape [row]."""
    cosine = np.einsum("rk,rk->r", a[:, first : first + 3], b[:, first : first + 3])
    return np.degrees(np.arccos(np.clip(np.abs(cosine) if lines else cosine, -1.0, 1.0)))
