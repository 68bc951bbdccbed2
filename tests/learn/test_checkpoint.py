"""Checkpoints: nothing in one is executed, and the best one is kept."""

from __future__ import annotations

import math
import pickle
import shutil
from pathlib import Path

import pytest
import torch
from counting_env import CountingEnv
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


@pytest.mark.parametrize("damage", ["half", "empty", "other", "no run", "other worlds"])
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
    assert str(refused.value).startswith(f"{file}: not a checkpoint that this run can go on from (")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("text", ["{", "[]", '{"gamma": 0.9}', ""])
def test_damaged_settings_of_a_policy_are_one_line(run: Path, text: str) -> None:
    (run / "policy.json").write_text(text)
    with pytest.raises(InputError, match=r"policy.json: not what s2a train writes \(.*\); train again") as refused:
        load_policy(CountingEnv(), run / "model_0.pt")
    assert "\n" not in str(refused.value)


class Scored(CountingEnv):
    """An environment whose episodes succeed as told."""

    max_episode_length = 3

    def __init__(self) -> None:
        super().__init__()
        self.max_episode_length, self.rate = 3, 0.0

    def step(self, action: torch.Tensor) -> None:
        """Count a hundred episodes."""
        super().step(action)
        self.finish("success", 100.0)
        self.counts[1 + self.columns.index("tidy_success")] += 100.0 * self.rate


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
        adapter.recent.zero_()
        for _ in range(4):
            adapter.step(torch.zeros(2, 9))
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


def test_a_folder_with_the_best_checkpoint_alone_has_none_to_go_on_from(run: Path) -> None:
    shutil.copy(run / "model_0.pt", run / BEST)
    (run / "model_0.pt").write_bytes(b"half")
    assert latest(run) is None
