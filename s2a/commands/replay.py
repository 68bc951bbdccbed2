"""Demonstrations -> do they succeed when they are played again?"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from s2a import config as settings
from s2a import robot
from s2a.cache import UNREADABLE
from s2a.collect.episodes import REPLAY, restored
from s2a.commands.collect import ABOUT
from s2a.errors import InputError
from s2a.ranges import Count
from s2a.rl.run_world import world_of
from s2a.sim.simulation import Simulation, device_of
from s2a.sim.world import read_stage
from s2a.tasks import make_env, task


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
    file = config.dataset / ABOUT
    try:
        about, count = json.loads(file.read_text()), json.loads((config.dataset / "meta/info.json").read_text())
        total, world = int(count["total_episodes"]), world_of(json.dumps(about["world"]), file)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{config.dataset}: not a dataset of s2a collect ({error!r})") from error
    if not total:
        raise InputError(f"{config.dataset}: no episode in it")
    stage = read_stage(config.stage, about["part"], robot=robot.load(about["robot"]).name)
    sim = Simulation([stage], world[0], min(config.num_envs, total), device_of(config.device))
    name = world[1].name
    thresholds: Any = settings.load(task(name).Metrics, settings.compose(f"metrics/{name}")["metrics"])
    env = make_env(sim, world[1], thresholds, {}, 0)
    failed: list[int] = []
    for first in range(0, total, env.num_envs):
        indices = [min(i, total - 1) for i in range(first, first + env.num_envs)]
        episodes = [_episode(config.dataset / REPLAY.format(index=i)) for i in indices]
        restored(env, [start for start, _ in episodes])
        for step in range(max(len(actions) for _, actions in episodes)):
            rows = [actions[min(step, len(actions) - 1)] for _, actions in episodes]
            env.step(torch.from_numpy(np.stack(rows)).to(env.observation))
        success = env.result[:, env.columns.index(env.task.LOGGED[0])].cpu().numpy() > 0.5
        failed += [
            i for i, good in zip(range(first, min(first + env.num_envs, total)), success, strict=False) if not good
        ]
    lines = [f"{config.dataset}: {total - len(failed)} of {total} episodes succeed when played again"]
    return "\n".join(lines + [f"  episode {i} does not" for i in failed])


def _episode(path: Path) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return how an episode began, by name, and its actions [step action]; InputError where the file is damaged."""
    try:
        with np.load(path) as file:
            return {name.removeprefix("start."): file[name] for name in file.files if name != "actions"}, file[
                "actions"
            ]
    except UNREADABLE as error:
        raise InputError(f"{path}: cannot be read ({error})") from error
