"""A trained network, and what it makes of a pool's or a room's parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from s2a.core.cache import UNREADABLE
from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.learn.perception import depth_camera
from s2a.learn.perception.depth_camera import DepthCameraConfig, PartPoints, VisibleRoom
from s2a.learn.perception.training import PartNetwork, features
from s2a.scene.usd import sim_stage
from s2a.sim import pool
from s2a.sim.world import SimStage
from s2a.tasks.mdp.seen import DIRECTIONS, NUMBERS

PRETRAINED = "pretrained"
"""Names the network that comes with s2a."""
ESTIMATES = ".npz"
"""Ending of a file of estimates; other files hold a network."""
ROOM_ESTIMATES = 4
"""Made of a room's part; each episode is told one of them."""
BATCH = 256
"""Clouds that the network sees at once."""


class Perception:
    """A network on the device that it is to run on."""

    def __init__(self, network: PartNetwork, device: str) -> None:
        """Take a trained network."""
        self._network, self._device = network.to(device).eval(), device

    @torch.inference_mode()
    def estimate(self, clouds: Sequence[PartPoints]) -> np.ndarray:
        """Return the description of each cloud's part (`s2a.tasks.mdp.seen`), shape [cloud NUMBERS]."""
        seen = features(clouds)
        found = torch.cat([self._network(some.to(self._device))[0].cpu() for some in seen.split(BATCH)]).numpy()
        found[:, :3] += np.stack([cloud.center for cloud in clouds])
        return found


def save(network: PartNetwork, path: Path) -> None:
    """Write a network's weights."""
    state = {name: value.cpu() for name, value in network.state_dict().items()}
    with atomic_write(path) as out:
        torch.save({"width": network.width, "weights": state}, out)


def load(path: Path, device: str) -> Perception:
    """Read a network that `save` wrote, or the one that comes with s2a; nothing in the file is executed.

    Raises:
        InputError: there is no such file, or it holds no network.
    """
    file = Path(__file__).parents[1] / "policies/perception.pt" if str(path) == PRETRAINED else path
    if not file.is_file():
        raise InputError(f"perception {str(path)!r}: no such file; give what s2a perceive wrote, or {PRETRAINED}")
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
    found = np.stack([np.median(group, axis=0) for group in groups])
    for first in DIRECTIONS:
        found[:, first : first + 3] /= np.linalg.norm(found[:, first : first + 3], axis=1, keepdims=True) + 1e-9
    return found


def seen_pool(index: Path, stages: Sequence[SimStage], perception: Path, device: str) -> list[SimStage]:
    """Return a pool's stages with what is made of their frames: by a network, or as s2a perceive wrote it down.

    Raises:
        InputError: a part has no frames, or no estimates.
    """
    entries = pool.read(index)
    if perception.suffix == ESTIMATES:
        known = read_estimates(perception)
        missing = [key for key in map(key_of, entries) if key not in known]
        if missing:
            raise InputError(f"{perception}: nothing of {', '.join(missing[:3])}; it is of another pool")
        return [replace(s, estimates=known[key_of(entry)]) for s, entry in zip(stages, entries, strict=True)]
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
    estimates: Sequence[np.ndarray], known: Sequence[np.ndarray], kinds: Sequence[str]
) -> dict[str, dict[str, float]]:
    """Return median and 95th percentile of each error over all frames of all parts.

    Args:
        estimates: of each part, shape [frame NUMBERS].
        known: the truth of each, shape [NUMBERS].
        kinds: of each part's joint.
    """
    found = np.concatenate(estimates)
    true = np.repeat(np.stack(known), [len(each) for each in estimates], axis=0)
    hinge = np.repeat(np.array(kinds) == "revolute", [len(each) for each in estimates])
    if found.shape[1] != NUMBERS:
        raise ValueError(f"estimates of {found.shape[1]} numbers, expected {NUMBERS}")
    columns = {
        "grasp point [m]": np.linalg.norm(found[:, :3] - true[:, :3], axis=1),
        "across [degree]": _angles(found, true, 3, lines=True),
        "inwards [degree]": _angles(found, true, 6),
        "axis [degree]": _angles(found, true, 9),
        "along [degree]": _angles(found, true, 12),
        "thickness [m]": np.abs(found[:, 16] - true[:, 16]),
        "lever arm of hinges [m]": np.abs(found[hinge, 19] - true[hinge, 19]),
        "travel [m]": np.abs(found[:, 20] - true[:, 20]),
        "wrong kind": ((found[:, 18] > 0.5) != (true[:, 18] > 0.5)).astype(float),
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
