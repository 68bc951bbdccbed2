"""Checkpoints: nothing in one is executed, and the best one is kept."""

from __future__ import annotations

import math
import pickle
import shutil
from pathlib import Path
from typing import Any

import pytest
import torch
from counting_env import CountingEnv
from few import few
from settings import load

from s2a.core.errors import InputError
from s2a.learn.rl.adapter import RslRlEnv
from s2a.learn.rl.config import PpoConfig
from s2a.learn.rl.ppo import Runner, load_policy, make_runner, train
from s2a.learn.rl.run_folder import BEST, latest

SMALL = {"num_steps_per_env": 8, "iterations": 1, "num_learning_epochs": 1, "num_mini_batches": 2, "hidden_dims": [16]}


class Hostile:
    """What writes a file while it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple:
        """Return a call of `open`."""
        return (open, (str(self.mark), "w"))


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """The folder of a training."""
    train(CountingEnv(), load(PpoConfig, "ppo/default", **SMALL), tmp_path / "run")
    return tmp_path / "run"


def hostile(run: Path, mark: Path, zipped: bool) -> Path:
    """Return a checkpoint of the run whose `infos` write a file when they are unpickled."""
    whole = torch.load(run / "model_0.pt", weights_only=True) | {"infos": Hostile(mark)}
    file = run / "model_1.pt"
    if zipped:
        torch.save(whole, file)
    else:
        file.write_bytes(pickle.dumps(whole))
    return file


@pytest.mark.parametrize("zipped", [True, False])
def test_a_hostile_checkpoint_is_refused_in_one_line_and_nothing_of_it_is_executed(run: Path, zipped: bool) -> None:
    mark = run.parent / "was_here"
    file = hostile(run, mark, zipped)
    for use in (
        lambda: load_policy(CountingEnv(), file),
        lambda: train(CountingEnv(), load(PpoConfig, "ppo/default", **{**SMALL, "iterations": 3}), run, file),
    ):
        with pytest.raises(InputError) as refused:
            use()
        assert str(refused.value).startswith(f"{file}: not a checkpoint") and "\n" not in str(refused.value)
    assert not mark.exists()
    if zipped:
        torch.load(file, weights_only=False)
    else:
        pickle.loads(file.read_bytes())
    assert mark.exists(), "it does its work where it is trusted"


@pytest.mark.parametrize("damage", few(["half", "empty", "other", "no run", "other worlds"]))
def test_a_damaged_checkpoint_is_one_line(run: Path, damage: str) -> None:
    file, whole = run / "model_0.pt", torch.load(run / "model_0.pt", weights_only=True)
    content = file.read_bytes()
    if damage in ("half", "empty"):
        file.write_bytes(content[: len(content) // 2 if damage == "half" else 0])
    elif damage == "other":
        torch.save({"weights": torch.zeros(3)}, file)
    elif damage == "no run":  # as rsl-rl alone would write it
        torch.save(whole | {"infos": {}}, file)
    else:
        whole["infos"]["run"]["worlds"] = {"observation": torch.zeros(5, 23)}
        torch.save(whole, file)
    with pytest.raises(InputError) as refused:
        train(CountingEnv(), load(PpoConfig, "ppo/default", **{**SMALL, "iterations": 3}), run, file)
    assert str(refused.value).startswith(f"{file}: not a checkpoint that this run can continue from (")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("text", ["{", "[]", '{"gamma": 0.9}', ""])
def test_damaged_settings_of_a_policy_are_one_line(run: Path, text: str) -> None:
    (run / "policy.json").write_text(text)
    with pytest.raises(InputError, match=r"policy.json: not what s2a train writes \(.*\); train again") as refused:
        load_policy(CountingEnv(), run / "model_0.pt")
    assert "\n" not in str(refused.value)


class Scored(CountingEnv):
    """An environment in which an episode of each world ends in every step; of the unaided ones some succeed, as told."""

    def __init__(self) -> None:
        super().__init__(120)
        self.max_episode_length, self.rate = 3, 0.0
        self.begun[100:] = 7  # on a demonstration, where all succeed

    def step(self, action: torch.Tensor) -> None:
        """End all episodes."""
        super().step(action)
        self.done.fill_(1)
        succeeds = torch.arange(self.num_envs) >= 100.0 * (1.0 - self.rate)
        self.result[:, self.columns.index("tidy_success")] = succeeds.float()
        self.uncounted.zero_()

    def reset_all(self, seed: int | None = None) -> None:
        """Begin again."""
        self.done.zero_()


def scored(tmp_path: Path) -> tuple[Scored, RslRlEnv, Runner]:
    """Return what learns in worlds that succeed as told."""
    env = Scored()
    adapter = RslRlEnv(env, 1.0)
    return env, adapter, make_runner(adapter, load(PpoConfig, "ppo/default", **SMALL), tmp_path)


def test_the_checkpoint_with_the_best_score_is_kept(tmp_path: Path) -> None:
    env, adapter, runner = scored(tmp_path)

    def kept(name: str, rate: float) -> int:
        """Return of which iteration the best checkpoint is, after one at a rate of success in the recent episodes."""
        env.rate = rate
        adapter.unaided.zero_()
        for _ in range(4):
            adapter.step(torch.zeros(120, 9))
        runner.current_learning_iteration = int(name)
        runner.save(str(tmp_path / f"model_{name}.pt"))
        return int(torch.load(tmp_path / BEST, weights_only=True)["iter"])

    runner.save(str(tmp_path / "model_0.pt"))
    assert math.isnan(adapter.score) and not (tmp_path / BEST).exists(), "nothing is known before the worlds are warm"
    assert [kept(name, rate) for name, rate in (("1", 0.5), ("2", 0.2), ("3", 0.5), ("4", 0.75), ("5", 0.6))] == [
        1,
        1,
        1,
        4,
        4,
    ]
    assert (tmp_path / BEST).read_bytes() == (tmp_path / "model_4.pt").read_bytes()
    assert latest(tmp_path) == tmp_path / "model_5.pt", "the best one is not what a run goes on from"
    _, later, resumed = scored(tmp_path)
    resumed.resume(tmp_path / "model_5.pt")
    assert resumed.best == pytest.approx(0.75) and later.score == pytest.approx(0.6), "what was best is remembered"


def test_the_policy_is_measured_in_unaided_episodes_and_the_training_goes_on_as_if_it_had_not_been(
    tmp_path: Path,
) -> None:
    env, adapter, runner = scored(tmp_path)
    env.rate = 0.75
    adapter.step(torch.zeros(120, 9))
    before = {name: value for name, value in adapter.state_dict().items() if name != "worlds"}
    observation = env.observation.clone()
    measured = runner.measure()
    assert (measured["episodes"], measured["rate"]) == (100, 0.75)
    assert measured["low"] == pytest.approx(0.657, abs=1e-3)  # Wilson, 75 of 100
    after = adapter.state_dict()
    assert torch.equal(env.observation, observation)
    assert torch.equal(before["rng"]["torch"], after["rng"]["torch"]) and before["steps"] == after["steps"]
    assert all(torch.equal(before[name], after[name]) for name in ("counted", "recent", "unaided", "terms"))


@pytest.mark.parametrize(
    ("success", "last", "why"),
    [(0.96, 0, "96.0% are measured"), (0.5, 5, ""), (0.0, 4, "0.0% are measured after 4 of 6")],
)
def test_a_training_with_a_target_ends_where_it_is_reached_or_out_of_sight(
    tmp_path: Path, success: float, last: int, why: str
) -> None:
    env = Scored()
    env.rate = success
    settings = load(PpoConfig, "ppo/default", **{**SMALL, "iterations": 6, "save_interval": 1, "target": 0.95})
    metrics = train(env, settings, tmp_path)
    assert latest(tmp_path) == tmp_path / f"model_{last}.pt"
    assert metrics["ended"].startswith(why) and bool(metrics["ended"]) == bool(why)
    assert metrics["measured"]["rate"] == pytest.approx(success)
    assert metrics["env_steps"] == (last + 1) * settings.num_steps_per_env * env.num_envs


@pytest.mark.parametrize(("success", "last"), [(0.96, 0), (0.02, 5)])
def test_a_run_that_begins_with_a_policy_is_measured_first_and_judged_by_what_it_is_later(
    run: Path, tmp_path: Path, success: float, last: int
) -> None:
    env = Scored()
    env.rate = success
    settings = load(PpoConfig, "ppo/default", **{**SMALL, "iterations": 6, "save_interval": 1, "target": 0.95})

    class Learning(Runner):
        """A runner whose worlds succeed in half of the episodes from the first iteration on."""

        def learn(self, *args: Any, **kwargs: Any) -> None:
            env.rate = 0.5
            super().learn(*args, **kwargs)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("s2a.learn.rl.ppo.Runner", Learning)
        metrics = train(env, settings, tmp_path / "on", init=run / "model_0.pt")
    assert latest(tmp_path / "on") == tmp_path / f"on/model_{last}.pt"
    assert metrics["measured"]["rate"] == pytest.approx(0.96 if last == 0 else 0.5)
    assert metrics["env_steps"] == (0 if last == 0 else 6 * settings.num_steps_per_env * env.num_envs)


def test_a_folder_with_the_best_checkpoint_alone_has_none_to_go_on_from(run: Path) -> None:
    shutil.copy(run / "model_0.pt", run / BEST)
    (run / "model_0.pt").write_bytes(b"half")
    assert latest(run) is None
