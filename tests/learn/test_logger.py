"""The logger that never waits for the device, against rsl-rl's."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import torch
from counting_env import CountingEnv
from rsl_rl.utils.logger import Logger
from settings import load
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from s2a.core.provenance import curve
from s2a.learn.rl.config import PpoConfig, rsl_rl_settings
from s2a.learn.rl.ppo import LazyLogger, train

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


def test_a_log_has_a_line_an_iteration_and_tensorboard_the_librarys_tags(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    small = {"num_steps_per_env": 8, "num_learning_epochs": 1, "num_mini_batches": 2, "hidden_dims": [8]}
    env = CountingEnv()
    train(env, load(PpoConfig, "ppo/default", **small, iterations=3), tmp_path)
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("train: ")]
    assert [line.split(";")[0] for line in lines] == [f"train: iteration {i} of 3" for i in (1, 2, 3)]
    assert all(
        re.search(r"; (reward -?[\d.e+]+|no episode ended), .*\d+ steps/s, \d+:\d\d:\d\d left$", line) for line in lines
    )
    tags = EventAccumulator(str(tmp_path)).Reload().Tags()["scalars"]
    assert {tag.split("/")[0] for tag in tags} <= {"Episode", "Loss", "Perf", "Policy", "Train"}
    assert {f"Episode/rew_{name}" for name in env.task.REWARDS} <= set(tags)
    assert not any(name.startswith("rew_") for row in curve(tmp_path) for name in row)
