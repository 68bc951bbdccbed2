"""What only a CUDA device can show; run with: pytest -m gpu."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from cabinet import write_cabinet
from part_worlds import metric_settings, task_settings
from settings import load

from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import read_stage
from s2a.tasks import make_env

pytestmark = [pytest.mark.gpu, pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")]


def test_captured_graph_equals_eager_steps(tmp_path: Path) -> None:
    stage = read_stage(write_cabinet(tmp_path / "sim.usda"))
    task = task_settings(episode_steps=30)  # resets within the hundred steps
    envs = []
    for graph in (True, False):
        sim = Simulation(stage, load(SimConfig, "sim/paper"), 2, "cuda:0")
        envs.append(make_env(sim, task, metric_settings(), load(dict, "reward/paper"), 0, graph=graph))
    actions = torch.rand(100, 2, 9, generator=torch.Generator().manual_seed(0)) * 2.0 - 1.0
    worst = 0.0
    for action in actions.to("cuda:0"):
        for env in envs:
            env.step(action)
        worst = max(worst, float((envs[0].observation - envs[1].observation).abs().max()))
    print(f"largest difference of an observation in 100 steps: {worst:.2e}")
    assert worst <= 1e-5
    assert torch.allclose(envs[0].reward, envs[1].reward, atol=1e-5)
