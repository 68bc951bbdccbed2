"""What a policy of many parts sees: a grasp with an error of known size; and when its actions act."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
import warp as wp
from cabinet import write_cabinet
from part_worlds import make_env

from s2a.sim.world import SimStage, read_stage

WORLDS = 32
POINT = slice(-22, -19)
"""Of the seen grasp in the tool frame, among the observations."""


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> SimStage:
    return read_stage(write_cabinet(Path(tmp_path_factory.mktemp("cabinet")) / "slide.usda"))


def test_the_seen_grasp_is_off_by_the_asked_distance_and_the_critic_knows_the_true_one(stage: SimStage) -> None:
    env = make_env(stage, num_envs=WORLDS, describe_part=True, grasp_error=(0.01, 0.02), grasp_turn=(5.0, 5.0))
    off = env.observation[:, POINT] - env.privileged[:, :3]
    length = off.norm(dim=1)
    assert length.min() >= 0.01 - 1e-5 and length.max() <= 0.02 + 1e-5 and length.std() > 0.001
    turned = torch.acos((env.observation[:, -19:-16] * env.privileged[:, 3:6]).sum(dim=1).clamp(-1.0, 1.0))
    assert turned.max() <= torch.deg2rad(torch.tensor(5.0)) + 1e-3 and turned.max() > 0.05
    seen = wp.to_torch(env.task.handles.p.seen).clone()
    env.step(torch.zeros(WORLDS, env.num_actions))
    assert (wp.to_torch(env.task.handles.p.seen) == seen).all(), "it stays for an episode"
    env.reset_all()
    assert (wp.to_torch(env.task.handles.p.seen) != seen).any(dim=1).all(), "and is drawn anew for the next"


def test_without_an_error_the_true_grasp_is_seen(stage: SimStage) -> None:
    env = make_env(stage, num_envs=2, describe_part=True)
    assert torch.allclose(env.observation[:, POINT], env.privileged[:, :3], atol=1e-6)


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_an_action_acts_as_many_steps_late_as_its_world_has_drawn(delay: int, stage: SimStage) -> None:
    env = make_env(stage, num_envs=2, start_noise=0.0, action_delay=(delay, delay))
    action, still = torch.zeros(2, env.num_actions), torch.zeros(2, env.num_actions)
    action[:, 0] = 1.0
    before, moved = env.sim.joint_target_q[:, 0].clone(), []
    for k in range(5):
        env.step(action if k == 0 else still)
        moved.append(bool((env.sim.joint_target_q[:, 0] - before).abs().min() > 1e-3))
    assert moved == [k >= delay for k in range(5)]


def test_delays_are_drawn_between_their_limits(stage: SimStage) -> None:
    env = make_env(stage, num_envs=WORLDS, action_delay=(1, 3))
    assert set(wp.to_torch(env.state.delay).tolist()) == {1, 2, 3}
