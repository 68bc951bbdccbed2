"""rsl-rl around the environment."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
import torch
from cabinet import write_cabinet
from counting_env import OBSERVATIONS, CountingEnv
from part_worlds import make_env
from settings import load
from tensordict import TensorDict

from s2a.core.errors import InputError
from s2a.learn.rl.adapter import RslRlEnv
from s2a.learn.rl.config import PpoConfig
from s2a.learn.rl.ppo import load_policy, make_runner, train

SMALL = {"num_steps_per_env": 8, "iterations": 2, "num_learning_epochs": 2, "num_mini_batches": 2, "hidden_dims": [16]}


def test_stored_observations_are_those_the_policy_saw() -> None:
    runner = make_runner(RslRlEnv(CountingEnv(), 1.0), load(PpoConfig, "ppo/default", **SMALL), None)
    runner.learn(1)
    stored = runner.alg.storage.observations["policy"][:, 0, 0]
    assert stored.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]


@pytest.mark.parametrize("cuda_graph", [False, True])
def test_noise_does_not_fall_below_its_floor(cuda_graph: bool) -> None:
    config = load(PpoConfig, "ppo/default", **SMALL, cuda_graph=cuda_graph, init_std=0.3, min_std=0.5)
    runner = make_runner(RslRlEnv(CountingEnv(), 1.0), config, None)
    runner.learn(1)
    assert runner.alg.get_policy().output_std.min() >= 0.5


class ShortEnv(CountingEnv):
    """An environment of short episodes, in each step of which one world succeeds early."""

    def __init__(self) -> None:
        super().__init__()
        self.max_episode_length = 6

    def step(self, action: torch.Tensor) -> None:
        """Count an episode that succeeded."""
        super().step(action)
        self.finish("success")


def test_no_rate_is_told_before_an_episode_could_have_failed() -> None:
    env = RslRlEnv(ShortEnv(), 1.0)
    rates = [float(env.step(torch.zeros(2, 9))[3]["log"]["success"]) for _ in range(8)]
    assert [math.isfinite(rate) for rate in rates] == [False] * 6 + [True] * 2
    assert rates[-1] == pytest.approx(1.0)
    assert float(env.recent[env.names.index("episodes")]) == pytest.approx(sum(0.999**k for k in range(8)))


class PayingEnv(CountingEnv):
    """An environment that pays for actions near 0.5."""

    def step(self, action: torch.Tensor) -> None:
        """Pay, and leave the observation as it is."""
        self.reward.copy_(-(action - 0.5).square().sum(dim=1))


@pytest.mark.parametrize("graph", [False, True])
def test_the_reward_rises(graph: bool) -> None:
    torch.manual_seed(0)
    settings = load(PpoConfig, "ppo/default", **{**SMALL, "num_learning_epochs": 4}, cuda_graph=graph)
    runner = make_runner(RslRlEnv(PayingEnv(64), 1.0), settings, None)
    seen = TensorDict({"policy": torch.zeros(1, OBSERVATIONS)}, batch_size=[1])

    def error() -> float:
        """Return by how much less than the most the mean action is paid."""
        return float((runner.alg.get_policy()(seen).detach() - 0.5).square().sum())

    before = error()
    runner.learn(20)
    assert error() < 0.25 * before


def test_training_writes_a_checkpoint_that_acts_the_same_when_loaded(tmp_path: Path) -> None:
    env = make_env(write_cabinet(tmp_path / "sim.usda"), 4)
    metrics = train(env, load(PpoConfig, "ppo/default", **SMALL), tmp_path / "run")
    assert metrics["env_steps"] == 4 * 8 * 2
    assert json.loads((tmp_path / "run/policy.json").read_text())["hidden_dims"] == [16]
    policies = [load_policy(env, tmp_path / "run/model_1.pt") for _ in range(2)]
    actions = [policy(env.observation) for policy in policies]
    assert actions[0].shape == (4, 9)
    assert torch.equal(actions[0], actions[1])
    (tmp_path / "README.md").touch()
    with pytest.raises(InputError, match="checkpoint '.*README.md': .*policy.json: no such file"):
        load_policy(env, tmp_path / "README.md")
    for content in (b"", b"no checkpoint"):
        (tmp_path / "run/model_9.pt").write_bytes(content)
        with pytest.raises(InputError, match="model_9.pt: not a checkpoint of this policy"):
            load_policy(env, tmp_path / "run/model_9.pt")
