"""A policy that is told an estimate of its part: what it observes, and how it follows the part by the robot's own motion."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
import warp as wp
from cabinet import HANDLE, write_cabinet
from part_worlds import make_env
from settings import load

from s2a.core.errors import InputError
from s2a.motion.policy import Planner
from s2a.motion.trajectory import PlannerConfig
from s2a.scene.scene import Joint
from s2a.sim.world import SimStage, read_stage
from s2a.tasks.env import VecEnv
from s2a.tasks.mdp.seen import Description, of_vector, truth

HINGE = Joint("revolute", (0.0, 0.0, 1.0), (HANDLE[0] - 0.02, 0.37, 0.7), (0.0, 1.2))


@pytest.fixture(params=["slide", "hinge"])
def stage(request: pytest.FixtureRequest, tmp_path: Path) -> SimStage:
    joint = HINGE if request.param == "hinge" else None
    return read_stage(write_cabinet(tmp_path / "room.usda", joint=joint))


def told(stage: SimStage, *estimates: Description) -> SimStage:
    return replace(stage, estimates=np.stack([each.vector() for each in estimates]))


def test_a_description_survives_as_a_vector(stage: SimStage) -> None:
    known = truth(stage)
    again = of_vector(known.vector())
    for name in vars(known):
        assert getattr(again, name) == pytest.approx(getattr(known, name), abs=1e-6)


def test_told_the_truth_a_policy_observes_what_it_does_without_estimates(stage: SimStage) -> None:
    plain = make_env(stage, num_envs=2, describe_part=True, start_noise=0.0)
    exact = make_env(told(stage, truth(stage)), num_envs=2, describe_part=True, start_noise=0.0)
    for _ in range(2):
        assert torch.allclose(exact.observation, plain.observation, atol=2e-5)
        for env in (plain, exact):
            env.step(torch.full((2, env.num_actions), 0.3))


def test_an_estimate_off_by_a_centimetre_is_observed_there_and_the_critic_knows_better(stage: SimStage) -> None:
    known = truth(stage)
    off = replace(known, point=known.point + [0.0, 0.01, 0.0])
    env = make_env(told(stage, off), num_envs=2, describe_part=True)
    error = env.observation[:, -22:-19] - env.privileged[:, :3]
    assert error.norm(dim=1).tolist() == pytest.approx([0.01, 0.01], abs=1e-5)
    seen = env.task.seen_grasp()
    assert seen is not None and np.linalg.norm(seen[:, :3], axis=1) == pytest.approx([0.01, 0.01], abs=1e-5)


@pytest.mark.slow
def test_the_opening_is_followed_while_the_gripper_holds_the_handle_and_not_before(tmp_path: Path) -> None:
    stage = read_stage(write_cabinet(tmp_path / "room.usda"))
    env = make_env(told(stage, truth(stage)), num_envs=2, sim="sim/planner", graph=True, describe_part=True)
    planner = Planner(env, load(PlannerConfig, "planner/default"))
    tracked, part = wp.to_torch(env.task.world.tracked), env.sim.joint_q[:, env.sim.layout.part_coord]
    before = torch.zeros(2)
    for _ in range(planner.steps):
        env.step(planner(env.observation))
        before = torch.where(part < 1e-3, tracked[:, 0], before)
    assert before.max() < 0.005, "nothing is followed on the way to the handle"
    assert part.min() > 0.25
    assert tracked[:, 0].tolist() == pytest.approx(part.tolist(), abs=0.01)


def test_each_episode_is_told_one_of_its_stages_frames(stage: SimStage) -> None:
    known = truth(stage)
    two = [replace(known, point=known.point + [0.0, offset, 0.0]) for offset in (0.01, 0.03)]
    env: VecEnv = make_env(told(stage, *two), num_envs=64, describe_part=True)
    off = (env.observation[:, -22:-19] - env.privileged[:, :3]).norm(dim=1)
    assert set(off.mul(100.0).round().int().tolist()) == {1, 3}


def test_a_stage_without_estimates_beside_one_with_them_is_refused(tmp_path: Path) -> None:
    plain = read_stage(write_cabinet(tmp_path / "room.usda"))
    with pytest.raises(InputError, match="no camera frame shows"):
        make_env([plain, told(plain, truth(plain))], num_envs=2, describe_part=True)
