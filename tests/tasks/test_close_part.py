"""Closing a part: the planner closes what it opened; what counts as closed."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from open_drawer import make_env
from settings import load

from s2a.learn.evaluate import evaluate
from s2a.motion.policy import Planner
from s2a.motion.trajectory import PlannerConfig


@pytest.mark.slow
def test_the_planner_closes_the_drawer(tmp_path: Path) -> None:
    env = make_env(tmp_path)
    assert env.sim.joint_q[:, env.sim.layout.part_coord].tolist() == pytest.approx([0.2, 0.2])
    found = evaluate(env, Planner(env, load(PlannerConfig, "planner/default")))
    assert found["final_success"]["rate"] == 1.0
    assert found["remaining"]["max"] < 0.01


def test_a_closed_part_and_an_open_one_are_told_apart(tmp_path: Path) -> None:
    env = make_env(tmp_path, episode_steps=4)
    env.sim.step = lambda: None
    coord, still = env.sim.layout.part_coord, torch.zeros(2, 9)
    env.sim.joint_q[0, coord], env.sim.joint_qd[0, env.sim.layout.part_dof] = 0.004, -1.0
    for _ in range(3):
        env.step(still)
    result = dict(zip(env.columns, env.result.T.tolist(), strict=True))
    assert result["success"] == result["final_success"] == [1.0, 0.0]
    assert result["remaining"] == pytest.approx([0.004, 0.2])
    assert env.sim.joint_q[:, coord].tolist() == pytest.approx([0.2, 0.2]), "the next episode begins with it open"


def test_an_open_part_costs_what_its_weight_says(tmp_path: Path) -> None:
    env = make_env(tmp_path)
    env.step(torch.zeros(2, 9))
    terms = dict(zip(env.task.REWARDS, env.terms[0].tolist(), strict=True))
    assert terms["opening"] == pytest.approx(0.2, abs=0.01)
    assert float(env.reward[0]) == pytest.approx(1.5 * terms["distance"] - 10.0 * terms["opening"], abs=1e-4)
