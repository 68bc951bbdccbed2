"""A planned motion opens the drawer by the friction of the fingers on the handle."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import newton
import numpy as np
import pytest
import torch
from cabinet import box, write_cabinet
from part_worlds import make_env
from settings import load

from s2a import robot
from s2a.env.vec_env import VecEnv
from s2a.errors import InputError
from s2a.evaluate import evaluate
from s2a.planner.collision import freest
from s2a.planner.motion import Planner, PlannerConfig, grasping_motion
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import read_stage


def planner_env(stage_path: Path, base: tuple[float, float, float] | None = None) -> VecEnv:
    """Return two worlds of a stage, the robot's base moved to `base`."""
    stage = read_stage(stage_path)
    if base:
        stage = replace(stage, base=np.array([*base, 0.0, 0.0, 1.0, 0.0]))
    return make_env(stage, 2, sim="sim/planner")


def test_the_planner_opens_the_drawer_with_both_fingers_on_the_handle(tmp_path: Path) -> None:
    env = planner_env(write_cabinet(tmp_path / "sim.usda"))
    result = evaluate(env, Planner(env, load(PlannerConfig, "planner/default")))
    assert result["success"]["rate"] == result["handle_success"]["rate"] == 1.0
    # The hand moves 0.30 m; what the drawer lacks of that is slip and the arm's lag.
    assert 0.28 < result["opening"]["min"] <= 0.30


def test_the_arm_takes_a_way_on_which_nothing_is_in_its_way(tmp_path: Path) -> None:
    config = load(SimConfig, "sim/planner")
    # So short a motion has all that is asked of it: steps that are small enough to follow.
    plan = load(PlannerConfig, "planner/default", approach_time=0.3, close_time=0.05, pull_time=0.8)
    start = np.array(robot.load("panda").start)
    plain = Simulation(read_stage(write_cabinet(tmp_path / "plain.usda")), config, 1)
    first = grasping_motion(plain, plan)
    hand = (start + first[0]) / 2
    place = _tool(plain, hand)
    post = box(tuple(place), (0.03, 0.03, 0.03))
    blocked = Simulation(read_stage(write_cabinet(tmp_path / "blocked.usda", beside=[post])), config, 1)
    paths = np.stack([first, grasping_motion(blocked, plan)])
    assert freest(plain, paths) == 0
    assert freest(blocked, paths) == 1
    assert freest(blocked, paths[::-1]) == 0


def _tool(sim: Simulation, q: np.ndarray) -> np.ndarray:
    """Return where the point between the fingers is [m] in joints [9]."""
    sim.joint_q[0, :9] = torch.tensor(q)
    newton.eval_fk(sim.model, sim.state.joint_q, sim.state.joint_qd, sim.state)
    return sim.body_q[0, sim.body("panda_hand_tcp"), :3].numpy().astype(float)


def test_a_handle_out_of_reach_is_said_before_anything_moves(tmp_path: Path) -> None:
    env = planner_env(write_cabinet(tmp_path / "sim.usda"), base=(1.6, 0.0, 0.0))
    with pytest.raises(InputError, match="the arm cannot follow part 'drawer_2' from its base at"):
        Planner(env, load(PlannerConfig, "planner/default", restarts=4))
