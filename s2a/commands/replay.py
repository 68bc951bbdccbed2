"""Command `s2a replay`: replay demonstrations and measure their success."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from s2a.core import config as settings
from s2a.core.bounds import Count
from s2a.core.errors import InputError
from s2a.learn.collect.episodes import read_replay, read_stage, restored
from s2a.learn.collect.robomimic import INDEX, lengths
from s2a.learn.rl.run_folder import world_of
from s2a.scene.artefacts import DATASET
from s2a.scene.usd.stamp import layer_hash
from s2a.sim.simulation import Simulation, device_of
from s2a.tasks import make_env, task
from s2a.tasks.env import VecEnv


@dataclass(frozen=True)
class Config:
    """Keys of `s2a replay`.

    Attributes:
        dataset: folder that `s2a collect` wrote.
        stage: the sim.usd that it was collected in.
        num_envs: episodes that are played at once.
        device: cpu, cuda:0, or auto: a GPU where there is one.
    """

    dataset: Path
    stage: Path
    num_envs: Count
    device: str


def run(config: Config) -> str:
    """Play all episodes again and return how many of them succeed."""
    file = config.dataset / DATASET
    try:
        about = json.loads(file.read_text())
        total, world = _count(config.dataset), world_of(json.dumps(about["world"]), file)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{config.dataset}: not a dataset of s2a collect ({error!r})") from error
    if not total:
        raise InputError(f"{config.dataset} has no episode; continue it with s2a collect")
    if about.get("stage_sha256") not in (None, layer_hash(config.stage)):
        raise InputError(
            f"{config.stage} is not the room that {config.dataset} was collected in, or was prepared again"
        )
    stage = read_stage(task(world[1].name).Stage, config.stage, config.dataset)
    sim = Simulation([stage], world[0], min(config.num_envs, total), device_of(config.device))
    name = world[1].name
    thresholds: Any = settings.load(task(name).Metrics, settings.compose(f"metrics/{settings.option(name)}")["metrics"])
    env = make_env(sim, world[1], thresholds, {}, 0)
    failed: list[int] = []
    for first in range(0, total, env.num_envs):
        indices = [min(i, total - 1) for i in range(first, first + env.num_envs)]
        good = played(env, [read_replay(config.dataset, i) for i in indices])
        failed += [i for i, one in zip(indices, good, strict=True) if not one and i not in failed]
    lines = [f"{config.dataset}: {total - len(failed)} of {total} episodes succeed when played again"]
    return "\n".join(lines + [f"  episode {i} does not" for i in failed])


def played(env: VecEnv, episodes: list[tuple[dict[str, np.ndarray], np.ndarray]]) -> np.ndarray:
    """Play episodes again, one in each world, and return which of them succeed, shape [world]."""
    restored(env, [start for start, _ in episodes])
    success, ended = np.zeros(env.num_envs), np.zeros(env.num_envs, dtype=bool)
    for step in range(max(len(actions) for _, actions in episodes)):
        rows = [actions[min(step, len(actions) - 1)] for _, actions in episodes]
        env.step(torch.from_numpy(np.stack(rows)).to(env.observation))
        now = (env.done.cpu().numpy() == 1) & ~ended
        if now.any():
            success[now] = env.result[:, env.columns.index(env.task.RESULTS.logged[0])].cpu().numpy()[now]
            ended |= now
    return success > 0.5


def _count(dataset: Path) -> int:
    """Return the number of episodes of a dataset: those that can be played are there one after the other."""
    info = dataset / "meta/info.json"
    if info.is_file():
        return int(json.loads(info.read_text())["total_episodes"])
    return len(lengths(dataset / INDEX))
