"""A step that is replayed as a graph is the step that was captured."""

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

GPU = [pytest.mark.gpu, pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")]


@pytest.mark.parametrize(("device", "apart"), [("cpu", 0.0), pytest.param("cuda:0", 1e-5, marks=GPU)])
def test_captured_graph_equals_eager_steps(device: str, apart: float, tmp_path: Path) -> None:
    stage = read_stage(write_cabinet(tmp_path / "sim.usda"))
    task = task_settings(episode_steps=15)  # resets within the forty steps
    envs = []
    for graph in (True, False):
        sim = Simulation(stage, load(SimConfig, "sim/paper"), 2, device)
        envs.append(make_env(sim, task, metric_settings(), load(dict, "reward/paper"), 0, graph=graph))
    actions = torch.rand(40, 2, 9, generator=torch.Generator().manual_seed(0)) * 2.0 - 1.0
    worst = 0.0
    for action in actions.to(device):
        for env in envs:
            env.step(action)
        worst = max(worst, float((envs[0].observation - envs[1].observation).abs().max()))
    assert worst <= apart
    assert torch.allclose(envs[0].reward, envs[1].reward, rtol=0.0, atol=apart)
