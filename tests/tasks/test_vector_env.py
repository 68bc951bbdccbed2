"""The public environment: gymnasium's rules, autoreset, seeds, training through it."""

from __future__ import annotations

import gc
import os
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from cabinet import HANDLE, write_cabinet
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import vector as wrappers
from settings import load

from s2a.api import make
from s2a.core.errors import InputError
from s2a.learn.rl.config import PpoConfig
from s2a.learn.rl.ppo import train
from s2a.scene.scene import Joint
from s2a.tasks import pool
from s2a.tasks.env import TaskVectorEnv
from s2a.tasks.pool import PoolPart

HINGE = Joint("revolute", (0.0, 0.0, 1.0), (HANDLE[0] - 0.02, 0.37, 0.7), (0.0, 1.2))
SHORT = ("task.episode_steps=6",)


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A hand-made cabinet."""
    return write_cabinet(tmp_path_factory.mktemp("room") / "sim.usda")


class One(gymnasium.Env[np.ndarray, np.ndarray]):
    """World 0 of a vector environment as an environment of its own, for gymnasium's checker."""

    def __init__(self, worlds: TaskVectorEnv) -> None:
        self.worlds = worlds
        self.observation_space, self.action_space = worlds.single_observation_space, worlds.single_action_space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict]:
        super().reset(seed=seed)
        observation, info = self.worlds.reset(seed=seed)
        return observation[0].numpy(), info

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict]:
        observation, reward, terminated, truncated, _ = self.worlds.step(torch.from_numpy(action)[None])
        return observation[0].numpy(), float(reward[0]), bool(terminated[0]), bool(truncated[0]), {}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*Box observation space.*infinity")
@pytest.mark.filterwarnings("ignore:.*render")
def test_gymnasiums_own_checks_pass(room: Path) -> None:
    check_env(One(make("open_part", room, num_envs=1, device="cpu")), skip_render_check=True)


def test_a_random_rollout_stays_in_the_spaces(room: Path) -> None:
    env = make("open_part", room, num_envs=3, device="cpu", overrides=SHORT)
    env.action_space.seed(0)
    observation, info = env.reset(seed=1)
    assert observation.shape == env.observation_space.shape == (3, 23) and info == {}
    for _ in range(8):
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
        assert env.observation_space.contains(observation.numpy())
        assert reward.shape == terminated.shape == truncated.shape == (3,) and terminated.dtype == torch.bool


def test_a_world_is_reset_in_the_step_that_ends_its_episode(room: Path) -> None:
    env = make("open_part", room, num_envs=2, device="cpu", overrides=(*SHORT, "task.start_noise=0"))
    assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    first, _ = env.reset(seed=1)
    action = torch.full((2, 9), 0.2)
    for step in range(1, 6):
        before, _, terminated, truncated, info = env.step(action)
        assert truncated.tolist() == [step == 5] * 2 and not terminated.any()
    assert torch.allclose(before, first, atol=1e-5), "the observation is the next episode's first"
    assert info["_final_obs"].all() and np.abs(info["final_obs"] - first.numpy()).max() > 0.01
    assert info["metrics"]["success"].tolist() == [0.0, 0.0]


def test_a_seed_repeats_an_episode_and_none_goes_on(room: Path) -> None:
    env = make("open_part", room, num_envs=2, device="cpu")
    one, again, other = env.reset(seed=7)[0], env.reset(seed=7)[0], env.reset()[0]
    assert torch.equal(one, again) and not torch.equal(one, other)


def test_what_is_returned_is_not_overwritten_by_the_next_step(room: Path) -> None:
    env = make("open_part", room, num_envs=2, device="cpu")
    observation, _ = env.reset(seed=0)
    kept = observation.clone()
    env.step(torch.ones(2, 9))
    assert torch.equal(observation, kept)


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        (torch.zeros(9), r"shape \(9,\), expected \(2, 9\): 2 worlds with 9 actions each"),
        (np.zeros((2, 7)), r"shape \(2, 7\)"),
        (torch.tensor([[0.0] * 9, [float("nan")] * 9]), "of 1 worlds are not finite, first in world 1"),
        ("forward", "no array of numbers"),
    ],
)
def test_wrong_actions_are_one_line_and_move_nothing(room: Path, actions: Any, message: str) -> None:
    env = make("open_part", room, num_envs=2, device="cpu")
    with pytest.raises(InputError, match=r"step\(\) before reset\(\)"):
        env.step(torch.zeros(2, 9))
    env.reset(seed=0)
    before = env.worlds.sim.joint_q.clone()
    with pytest.raises(InputError, match=message):
        env.step(actions)
    assert torch.equal(env.worlds.sim.joint_q, before)


@pytest.mark.slow
def test_lengthened_worlds_are_those_that_were_made_so(room: Path) -> None:
    first = []
    for steps, length in ((6, 9), (9, 9)):
        worlds = make("open_part", room, num_envs=2, device="cpu", overrides=(f"task.episode_steps={steps}",)).worlds
        worlds.lengthen(length)
        first.append(worlds.observation.clone())
        done = []
        for _ in range(8):
            worlds.step(torch.zeros(2, 9))
            done.append(int(worlds.done.sum()))
        assert done == [0] * 7 + [2]
    assert torch.equal(*first)


def test_gymnasium_makes_a_task_by_its_name(room: Path) -> None:
    env = gymnasium.make_vec("s2a/OpenPart-v1", num_envs=2, room=room, device="cpu")
    observation, _ = env.reset(seed=0)
    assert isinstance(observation, np.ndarray) and observation.shape == (2, 23)
    assert {"s2a/ClosePart-v1", "s2a/PickPlace-v1", "s2a/PutIn-v1"} <= set(gymnasium.registry)


def test_making_a_task_prints_nothing(room: Path, capfd: pytest.CaptureFixture[str]) -> None:
    make("close_part", room, num_envs=1, device="cpu").reset(seed=0)
    assert capfd.readouterr().out == ""


def test_rsl_rl_trains_in_it(room: Path, tmp_path: Path) -> None:
    env = make("open_part", room, num_envs=4, device="cpu", overrides=("reward=grasped",))
    small = {"num_steps_per_env": 4, "iterations": 2, "num_mini_batches": 2, "hidden_dims": [8]}
    report = train(env.worlds, load(PpoConfig, "ppo/default", **small), tmp_path / "run")
    assert report["env_steps"] == 2 * 4 * 4 and (tmp_path / "run/model_1.pt").is_file()


def test_the_worlds_of_an_index_have_its_parts_in_turn(room: Path, tmp_path: Path) -> None:
    door = write_cabinet(tmp_path / "door.usda", joint=HINGE)
    parts = [
        PoolPart(str(room), "drawer_2", "prismatic", "bar", ""),
        PoolPart(door.name, "drawer_2", "revolute", "bar", ""),
    ]
    pool.write(tmp_path / "pool.json", parts, {}, {})
    env = make("open_part", tmp_path / "pool.json", num_envs=3, device="cpu", overrides=SHORT)
    assert [stage.joint.kind for stage in env.worlds.sim.stages] == ["prismatic", "revolute"]
    assert env.worlds.sim.stage_of_env.tolist() == [0, 1, 0]
    with pytest.raises(
        InputError, match="keys 'part' and 'also' choose from a room; .*pool.json has the parts of a pool"
    ):
        make("open_part", tmp_path / "pool.json", part="drawer_2", device="cpu")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"task": "open_prat"}, "task 'open_prat' is unknown; did you mean: open_part"),
        ({"part": "drawer_9"}, "drawer_9"),
        ({"device": "cuda:7"}, "key 'device' is 'cuda:7'; on this machine one of: auto, cpu"),
        ({"overrides": ("task.epsiode_steps=1",)}, "task.epsiode_steps"),
        ({"room": Path("nowhere.usd")}, "nowhere.usd: no such file"),
    ],
)
def test_wrong_arguments_are_one_line(room: Path, arguments: dict[str, Any], message: str) -> None:
    given = {"task": "open_part", "room": room, "num_envs": 1, "device": "cpu"} | arguments
    with pytest.raises(InputError, match=message) as error:
        make(**given)
    assert "\n" not in str(error.value)


@pytest.mark.slow
def test_environments_leak_no_memory(room: Path) -> None:
    used = []
    for _ in range(50):
        env = make("open_part", room, num_envs=4, device="cpu")
        env.reset()
        env.step(torch.zeros(4, 9))
        del env
        gc.collect()
        used.append(int(Path(f"/proc/{os.getpid()}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE"))
    assert used[-1] - used[4] < 30e6


WRAPPERS: dict[str, dict[str, Any]] = {
    "VectorizeTransformAction": {"wrapper": gymnasium.wrappers.ClipAction},
    "VectorizeTransformReward": {"wrapper": gymnasium.wrappers.ClipReward, "min_reward": -1.0, "max_reward": 1.0},
    "DictInfoToList": {},
    "TransformAction": {"func": lambda x: x / 2},
    "ClipAction": {},
    "RescaleAction": {"min_action": -2.0, "max_action": 2.0},
    "TransformReward": {"func": lambda x: 2 * x},
    "ClipReward": {"min_reward": -0.1, "max_reward": 0.1},
    "NormalizeReward": {},
    "RecordEpisodeStatistics": {},
}
"""Vector wrappers of Gymnasium that go around a task, and their arguments."""
OTHERS = {
    **dict.fromkeys((name for name in wrappers.__all__ if name.endswith("Observation")), "next step"),
    "RecordVideo": "images",
    "HumanRendering": "images",
    "ArrayConversion": "`array-api-compat`",
    "NumpyToTorch": "`array-api-compat`",
    "JaxToNumpy": "JAX",
    "JaxToTorch": "JAX",
}
"""Those that do not, and what they want."""


def test_each_of_gymnasiums_vector_wrappers_is_tested_or_refused_in_the_documentation() -> None:
    assert {*WRAPPERS, *OTHERS} == set(wrappers.__all__)
    text = " ".join((Path(__file__).parents[2] / "docs/python.md").read_text().split())
    assert [name for name in OTHERS if f"`{name}`" not in text and not name.endswith("Observation")] == []
    assert [want for want in OTHERS.values() if want not in text] == []


@pytest.fixture(scope="module")
def arrays(room: Path) -> TaskVectorEnv:
    """Worlds that return arrays."""
    return make("open_part", room, num_envs=2, device="cpu", overrides=SHORT, numpy=True)


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("name", WRAPPERS)
def test_a_wrapper_of_gymnasium_goes_around_a_task(arrays: TaskVectorEnv, name: str) -> None:
    env = getattr(wrappers, name)(arrays, **WRAPPERS[name])
    env.reset(seed=0)
    for step in range(1, 13):
        observation, reward, terminated, truncated, info = env.step(np.zeros(env.action_space.shape, np.float32))
        assert all(isinstance(each, np.ndarray) for each in (observation, reward, terminated, truncated))
        assert np.isfinite(observation).all() and np.isfinite(reward).all() and len(observation) == 2
        assert truncated.all() == (step % 5 == 0)
        first = info[0] if isinstance(info, list) else info
        if step % 5 == 0:
            assert np.all(first["metrics"]["success"] == 0.0) and first["final_obs"].shape[-1] == 23


def test_gymnasium_counts_the_steps_and_rewards_of_the_episodes(arrays: TaskVectorEnv) -> None:
    env = wrappers.RecordEpisodeStatistics(arrays)
    env.reset(seed=0)
    total = np.zeros(2)
    for _ in range(5):
        _, reward, _, _, info = env.step(np.zeros((2, 9), np.float32))
        total += reward
    assert info["episode"]["l"].tolist() == [5, 5] and info["episode"]["r"] == pytest.approx(total)
    assert wrappers.DictInfoToList(env).reset(seed=1)[1] == [{}, {}]
