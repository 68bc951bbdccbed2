"""Several processes train one policy together."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from cabinet import write_cabinet

from s2a.core.errors import InputError
from s2a.learn.rl import config


def test_each_process_has_its_own_seed_and_a_single_one_the_users(monkeypatch: pytest.MonkeyPatch) -> None:
    assert config.own_seed(7) == 7
    monkeypatch.setenv("RANK", "1")
    seeds = {config.own_seed(seed, iteration) for seed in range(3) for iteration in (0, 100, 101)}
    assert len(seeds) == 9 and not seeds & {0, 1, 2}


def test_each_process_takes_its_own_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    assert config.own_device("cuda:3") == "cuda:3"
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    for name, value in (("RANK", "5"), ("LOCAL_RANK", "1"), ("WORLD_SIZE", "8")):
        monkeypatch.setenv(name, value)
    assert config.own_device("auto") == config.own_device("cuda:1") == "cuda:1"
    assert config.own_device("cpu") == "cpu"
    with pytest.raises(InputError, match="'cuda:0'; under torchrun every process takes its own"):
        config.own_device("cuda:0")


@pytest.mark.slow
@pytest.mark.parametrize("graph", ["false", "true"])
def test_two_processes_on_a_cpu_train_one_policy_and_one_of_them_writes(tmp_path: Path, graph: str) -> None:
    out = tmp_path / "run"
    keys = [f"stage={write_cabinet(tmp_path / 'sim.usda')}", f"out={out}", "num_envs=2", "device=cpu"]
    keys += [
        "ppo.num_steps_per_env=8",
        "ppo.iterations=3",
        "ppo.num_mini_batches=2",
        "ppo.hidden_dims=[16]",
        f"ppo.cuda_graph={graph}",
    ]
    torchrun = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2"]
    done = subprocess.run([*torchrun, "-m", "s2a", "train", *keys], capture_output=True, text=True, timeout=280)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count(f"{out}: ") == 1
    metrics = json.loads((out / "metrics.json").read_text())
    assert metrics["processes"] == 2
    assert metrics["env_steps"] == 3 * 8 * 2 * 2
    assert sorted(file.name for file in out.glob("model_*")) == ["model_0.pt", "model_2.pt"]
    state = torch.load(out / "model_2.pt", weights_only=True)["actor_state_dict"]
    assert int(state["obs_normalizer.count"]) == 3 * 8 * 2 * 2, "the normaliser has seen the worlds of both"


def test_each_item_is_one_processs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WORLD_SIZE", "3")
    mine = []
    for rank in range(3):
        monkeypatch.setenv("RANK", str(rank))
        mine.append(config.own_items(range(7)))
        assert config.own_items([5, 6]) == [5, 6], "too few to be divided: every process has all"
    assert sorted(sum(mine, [])) == list(range(7)) and min(map(len, mine)) == 2
