"""Worlds of a hand-made cabinet whose drawer stands open."""

from __future__ import annotations

from pathlib import Path

from cabinet import write_cabinet
from settings import load

from s2a import tasks
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import SimStage, read_stage
from s2a.tasks.close_part import ClosePartConfig, ClosePartMetrics
from s2a.tasks.env import VecEnv


def make_env(tmp_path: Path, num_envs: int = 2, stage: SimStage | None = None, **task: object) -> VecEnv:
    """Return worlds of a hand-made cabinet whose drawer stands open."""
    # Without the spring of the reference's cabinet, which would close the drawer by itself.
    settings = load(SimConfig, "sim/planner", joint={"stiffness": 0.0, "damping": 1.0, "spring": "grasp"})
    sim = Simulation(stage or read_stage(write_cabinet(tmp_path / "sim.usda")), settings, num_envs)
    config, metrics = load(ClosePartConfig, "task/close_part", **task), load(ClosePartMetrics, "metrics/close_part")
    return tasks.make_env(sim, config, metrics, load(dict, "reward/close_part"), 0, graph=False)
