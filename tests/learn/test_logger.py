"""The logger that never waits for the device, against rsl-rl's."""

from __future__ import annotations

from pathlib import Path

import torch
from rsl_rl.utils.logger import Logger
from settings import load

from s2a.learn.rl.config import PpoConfig, rsl_rl_settings
from s2a.learn.rl.ppo import LazyLogger

WORLDS, STEPS, ITERATIONS = 5, 7, 3


def logged(kind: type[Logger], folder: Path) -> tuple[Logger, list[list[float]]]:
    """Return a logger after some iterations of episodes that end at random, and the rewards it knew after each."""
    settings = rsl_rl_settings(load(PpoConfig, "ppo/default", num_steps_per_env=STEPS))
    logger = kind(str(folder), settings, {}, WORLDS, False, 1, 0, "cpu")
    logger.init_logging_writer()
    noise, known = torch.Generator().manual_seed(0), []
    for iteration in range(ITERATIONS):
        for _ in range(STEPS):
            rewards = torch.randn(WORLDS, generator=noise)
            logger.process_env_step(rewards, (torch.rand(WORLDS, generator=noise) < 0.3).long(), {}, None)
        logger.log(iteration, 0, ITERATIONS, 1.0, 1.0, {}, 1e-3, torch.ones(9), None)
        known.append(list(logger.rewbuffer))
    logger.stop_logging_writer()
    return logger, known


def test_episodes_are_the_librarys_own_in_their_order(tmp_path: Path) -> None:
    (theirs, expected), (ours, found) = (logged(kind, tmp_path / kind.__name__) for kind in (Logger, LazyLogger))
    assert found == expected and len(set(map(len, expected))) == ITERATIONS
    assert list(ours.lenbuffer) == list(theirs.lenbuffer) and max(ours.lenbuffer) > STEPS
    assert torch.equal(ours.cur_reward_sum, theirs.cur_reward_sum)
    assert torch.equal(ours.cur_episode_length, theirs.cur_episode_length)
