"""A training run goes on after its process was killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import torch
from cabinet import write_cabinet
from counting_env import CountingEnv
from settings import load
from tensorboard.summary.writer import event_file_writer

from s2a.commands import train as verb
from s2a.core import config
from s2a.core.errors import InputError
from s2a.core.provenance import scalars
from s2a.learn.rl import run_folder
from s2a.learn.rl.adapter import RslRlEnv
from s2a.learn.rl.config import PpoConfig
from s2a.learn.rl.ppo import Runner, make_runner, train

SMALL = {
    "num_steps_per_env": 8,
    "iterations": 6,
    "num_learning_epochs": 2,
    "num_mini_batches": 2,
    "hidden_dims": [16],
    "save_interval": 2,
}


def make(out: Path) -> Runner:
    """Return a runner on an environment without physics."""
    return make_runner(RslRlEnv(CountingEnv(), 1.0), load(PpoConfig, "ppo/default", **SMALL), out)


def test_networks_normaliser_optimiser_learning_rate_iteration_and_time_go_on(tmp_path: Path) -> None:
    torch.manual_seed(0)  # by some networks the learning rate comes back to where it began
    first = make(tmp_path)
    first.learn(3)
    second = make(tmp_path)
    second.resume(tmp_path / "model_2.pt")
    before, after = first.alg.save(), second.alg.save()
    assert float(before["actor_state_dict"]["obs_normalizer.count"]) == 3 * 8 * 2
    for part in ("actor_state_dict", "critic_state_dict"):
        assert all(torch.equal(value, after[part][name]) for name, value in before[part].items())
    adam = [state["optimizer_state_dict"]["state"] for state in (before, after)]
    assert all(torch.equal(adam[0][i][name], adam[1][i][name]) for i in adam[0] for name in adam[0][i])
    assert second.alg.learning_rate == first.alg.learning_rate != 5e-4
    assert second.current_learning_iteration == 3
    assert 0.0 < second.seconds <= first.seconds


class Killed(CountingEnv):
    """An environment that fails in the middle of an iteration."""

    def step(self, action: torch.Tensor) -> None:
        """Count, and fail in the 29th step."""
        super().step(action)
        if self.observation[0, 0] == 29.0:
            raise InterruptedError


@pytest.mark.parametrize("number", [8, 9])
def test_the_log_of_an_interrupted_run_is_that_of_a_whole_one(
    tmp_path: Path, number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The name of an event file ends in how many its process has written, and "10" comes before "9".
    monkeypatch.setattr(event_file_writer, "_global_uid", event_file_writer.AtomicCounter(number))
    settings = load(PpoConfig, "ppo/default", **SMALL)
    with pytest.raises(InterruptedError):
        train(Killed(), settings, tmp_path)
    last = run_folder.latest(tmp_path)
    assert last == tmp_path / "model_2.pt"
    metrics = train(CountingEnv(), settings, tmp_path, last)
    assert metrics["first_iteration"] == 3
    assert metrics["env_steps"] == 6 * 8 * 2
    steps = [event.step for event in scalars(tmp_path, "Loss/learning_rate")]
    assert steps == [0, 1, 2, 3, 4, 5]
    assert (tmp_path / "train.log").read_text().count("Learning iteration") == 6


def test_a_checkpoint_that_is_not_whole_is_passed_over_with_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    torch.save({"weights": torch.zeros(1000)}, tmp_path / "model_9.pt")
    torch.save({"weights": torch.zeros(1000)}, tmp_path / "model_10.pt")
    assert run_folder.latest(tmp_path) == tmp_path / "model_10.pt"
    whole = (tmp_path / "model_10.pt").read_bytes()
    for damaged in (whole[: len(whole) // 2], whole.replace(bytes(999), bytes(998) + b"x"), b""):
        (tmp_path / "model_10.pt").write_bytes(damaged)
        assert run_folder.latest(tmp_path) == tmp_path / "model_9.pt"
        assert caplog.messages[-1].startswith(str(tmp_path / "model_10.pt"))


def test_a_checkpoint_appears_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    runner = make(tmp_path)
    runner.learn(1)
    before = (tmp_path / "model_0.pt").read_bytes()

    def full(values: object, path: str) -> None:
        Path(path).write_bytes(b"half")
        raise OSError("no space left on device")

    monkeypatch.setattr(torch, "save", full)
    with pytest.raises(OSError, match="no space"):
        runner.save(str(tmp_path / "model_0.pt"))
    assert (tmp_path / "model_0.pt").read_bytes() == before


def test_a_run_is_not_begun_over_another_nor_gone_on_when_done(tmp_path: Path) -> None:
    keys = [f"stage={tmp_path / 'sim.usd'}", f"out={tmp_path}", "ppo.iterations=3"]
    (tmp_path / "model_2.pt").touch()
    with pytest.raises(InputError, match="continue with resume=true"):
        verb.run(config.load(verb.Config, config.compose("train", keys)))
    torch.save({}, tmp_path / "model_2.pt")
    settings = config.load(verb.Config, config.compose("train", [*keys, "resume=true"]))
    with pytest.raises(InputError, match="settings.json: not what this version"):
        verb.run(settings)
    (tmp_path / "model_2.pt").unlink()
    run_folder.keep_settings(verb.asdict(settings), tmp_path)
    torch.save({}, tmp_path / "model_2.pt")
    (tmp_path / "metrics.json").touch()
    with pytest.raises(InputError, match="has completed its 3 iterations"):
        verb.run(settings)


@pytest.mark.parametrize("key", ["critic_learning_rate=1e-3", "imitation_iterations=5"])
def test_what_only_our_own_update_does_is_refused_for_that_of_rsl_rl(key: str, tmp_path: Path) -> None:
    keys = [f"stage={tmp_path / 'sim.usd'}", f"out={tmp_path / 'out'}", f"ppo.{key}", "ppo.cuda_graph=false"]
    with pytest.raises(InputError, match=f"'ppo.{key.split('=')[0]}' needs ppo.cuda_graph=true"):
        verb.run(config.load(verb.Config, config.compose("train", keys)))
    assert not (tmp_path / "out").exists()


def test_recent_rates_are_told_once_there_are_episodes() -> None:
    assert verb._rates({"episodes": 0.0, "success": 0.0, "opening": 0.0}, ("opening",)) == {"episodes": 0.0}
    rates = verb._rates({"episodes": 9.7, "success": 8.0, "opening": 2.0}, ("opening",))
    assert set(rates) == {"episodes", "success"} and rates["success"]["rate"] == pytest.approx(8.0 / 9.7)
    assert rates["success"]["low"] == pytest.approx(0.49016, abs=1e-5)  # of 8 of 10


def leaves(value: object, name: str = "") -> dict[str, object]:
    """Return all that a checkpoint holds by its place in it, save the time that the run took."""
    if isinstance(value, (dict, list, tuple)):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        return {key: leaf for k, inner in items for key, leaf in leaves(inner, f"{name}/{k}").items()}
    return {} if name == "/infos/seconds" else {name: value}


@pytest.mark.parametrize("graph", [pytest.param(False, marks=pytest.mark.slow), True])
def test_a_run_that_goes_on_equals_one_that_was_not_stopped_bit_for_bit(tmp_path: Path, graph: bool) -> None:
    keys = [f"stage={write_cabinet(tmp_path / 'sim.usda')}", "num_envs=3", "device=cpu", "task.episode_steps=9"]
    keys += ["ppo.num_steps_per_env=4", "ppo.num_mini_batches=2", "ppo.hidden_dims=[16]", f"ppo.cuda_graph={graph}"]

    def run(out: str, *more: str) -> dict[str, object]:
        """Train, with random numbers of any state before, and return the last checkpoint."""
        torch.manual_seed(len(more))
        verb.run(config.load(verb.Config, config.compose("train", [*keys, f"out={tmp_path / out}", *more])))
        return leaves(torch.load(run_folder.latest(tmp_path / out), weights_only=True))

    whole = run("whole", "ppo.iterations=6")
    run("stopped", "ppo.iterations=3")
    resumed = run("stopped", "ppo.iterations=6", "resume=true")
    assert whole["/iter"] == 5 and whole.keys() == resumed.keys()
    tensors = [name for name, value in whole.items() if isinstance(value, torch.Tensor)]
    assert len(tensors) > 60 and int(whole["/infos/run/counted"][0]) > 0, "episodes have ended on the way"
    assert [name for name in tensors if not torch.equal(whole[name], resumed[name])] == []
    others = whole.keys() - set(tensors)
    assert [name for name in others if repr(whole[name]) != repr(resumed[name])] == []


@pytest.mark.slow
def test_a_run_that_was_killed_goes_on(tmp_path: Path) -> None:
    out = tmp_path / "run"
    keys = [f"stage={write_cabinet(tmp_path / 'sim.usda')}", f"out={out}", "num_envs=2", "device=cpu"]
    keys += ["ppo.num_steps_per_env=8", "ppo.num_mini_batches=2", "ppo.hidden_dims=[16]", "ppo.save_interval=1"]
    command = [sys.executable, "-m", "s2a", "train", *keys]
    process = subprocess.Popen([*command, "ppo.iterations=100000"], stderr=subprocess.DEVNULL)
    end = time.monotonic() + 200.0
    while not (out / "model_3.pt").exists() and time.monotonic() < end:
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    reached = run_folder.latest(out)
    assert reached is not None and run_folder.iteration(reached) >= 3
    done = run_folder.iteration(reached) + 1
    (out / "model_99999.pt").write_bytes(reached.read_bytes()[:1000])
    message = subprocess.run(
        [*command, f"ppo.iterations={done + 2}", "resume=true"], check=True, capture_output=True, text=True
    )
    assert "model_99999.pt is not whole" in message.stderr
    metrics = json.loads((out / "metrics.json").read_text())
    assert metrics["first_iteration"] == done
    assert metrics["env_steps"] == (done + 2) * 8 * 2
    assert "out of order" not in message.stderr, "what was cut is not told as if something were wrong"
    steps = [event.step for event in scalars(out, "Loss/learning_rate")]
    assert steps == list(range(done + 2))
    state = torch.load(out / f"model_{done + 1}.pt", weights_only=True)["actor_state_dict"]
    assert int(state["obs_normalizer.count"]) == (done + 2) * 8 * 2
