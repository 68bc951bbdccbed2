"""Command `s2a perceive`: train a network that estimates a part's grasp and joint from a depth image."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import torch

from s2a.core.bounds import AtLeast, CountFromZero
from s2a.core.errors import InputError
from s2a.core.outputs import Output, atomic_write
from s2a.core.progress import track
from s2a.core.provenance import provenance
from s2a.learn.perception.depth_camera import PartPoints
from s2a.learn.perception.network import NetworkConfig, Perception, error_table, features, key_of, of_pool, save, train
from s2a.robot import Robot
from s2a.sim.simulation import device_of
from s2a.tasks import pool
from s2a.tasks.mdp.seen import truth


@dataclass(frozen=True)
class Config:
    """Keys of `s2a perceive`.

    Attributes:
        stage: the index of a pool that was made with frames.
        out: folder of perception.pt, the network; estimates.npz; and errors.json.
        folds: number of folds of the cross-validation: each network estimates the parts of rooms that it was not trained
            on, for the training of a policy.
        robot: the robot that the parts were prepared for, such as panda or baxter.
        network: its training.
        device: cpu, cuda:0, or auto: a GPU where there is one.
        seed: seed of the networks and of the samples.
    """

    stage: Path
    out: Output
    folds: Annotated[int, AtLeast(2)]
    robot: Robot
    network: NetworkConfig
    device: str
    seed: CountFromZero


def run(config: Config) -> str:
    """Train the networks, write them and their errors, and return a table of these."""
    entries, clouds, device = pool.read(config.stage), of_pool(config.stage), device_of(config.device)
    rooms = sorted({entry.room for entry in entries})
    if len(rooms) < config.folds:
        raise InputError(f"key 'folds' is {config.folds}, and the pool has {len(rooms)} rooms; give that many or fewer")
    truths = [truth(stage).vector() for stage in pool.stages(config.stage, config.robot.name)]
    fold = [rooms.index(entry.room) % config.folds for entry in entries]
    estimates: list[np.ndarray] = [np.zeros(0)] * len(entries)
    for k in track(range(config.folds), "folds"):
        network = _trained([i for i, each in enumerate(fold) if each != k], clouds, truths, config, device)[0]
        for i in (i for i, each in enumerate(fold) if each == k):
            estimates[i] = network.estimate(clouds[i])
    _, raw, curve = _trained(range(len(entries)), clouds, truths, config, device)
    config.out.mkdir(parents=True, exist_ok=True)
    save(raw, config.out / "perception.pt")
    named: dict[str, Any] = {key_of(entry): each for entry, each in zip(entries, estimates, strict=True)}
    with atomic_write(config.out / "estimates.npz") as file:
        np.savez_compressed(file, **named)
    errors = error_table(estimates, truths, [entry.kind for entry in entries])
    about = {"parts": len(entries), "folds": config.folds, "network": asdict(config.network), "seed": config.seed}
    with atomic_write(config.out / "errors.json") as file:
        file.write_text(json.dumps({**about, "errors": errors, "curve": curve, **provenance(device)}, indent=1))
    lines = [f"  {name:24} median {row['median']:8.4g}   95 % below {row['p95']:8.4g}" for name, row in errors.items()]
    return "\n".join([f"{config.out}: errors on parts of rooms that a network was not trained on", *lines])


def _trained(
    chosen: Any, clouds: list[list[PartPoints]], truths: list[np.ndarray], config: Config, device: str
) -> tuple[Perception, Any, list[float]]:
    """Return a network trained on some of the parts, for use and to be written, and its losses."""
    frames = [(cloud, truths[i]) for i in chosen for cloud in clouds[i]]
    wanted = np.stack([numbers for _, numbers in frames])
    wanted[:, :3] -= np.stack([cloud.center for cloud, _ in frames])
    points = features([cloud for cloud, _ in frames]).to(device)
    network, curve = train(points, torch.from_numpy(wanted).to(device), config.network, config.seed)
    return Perception(network, device), network, curve
