"""What a policy of many parts sees: a grasp with an error of known size; and when its actions act."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import torch
import warp as wp
from cabinet import write_cabinet
from part_worlds import make_env
from settings import load

from s2a.core.errors import InputError
from s2a.sim.simulation import SimConfig, Simulation
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
    seen = wp.to_torch(env.task.world.seen).clone()
    env.step(torch.zeros(WORLDS, env.num_actions))
    assert (wp.to_torch(env.task.world.seen) == seen).all(), "it stays for an episode"
    env.reset_all()
    assert (wp.to_torch(env.task.world.seen) != seen).any(dim=1).all(), "and is drawn anew for the next"


def test_without_an_error_the_true_grasp_is_seen(stage: SimStage) -> None:
    env = make_env(stage, num_envs=2, describe_part=True)
    assert torch.allclose(env.observation[:, POINT], env.privileged[:, :3], atol=1e-6)


def test_the_way_is_told_in_fine_within_five_centimetres_and_whether_to_hold_from_within(stage: SimStage) -> None:
    """Of two worlds the one is held from within; an observation of 1 is 20 mm, and none is beyond 2.5."""
    stages = [stage, replace(stage, internal=True)]
    coarse, env = (
        make_env(stages, sim=Simulation(stages, load(SimConfig, "sim/paper"), 2), describe_part=True, fine_grasp=fine)
        for fine in (False, True)
    )
    assert torch.equal(env.observation[:, :-4], coarse.observation), "what a policy without it is told stays"
    point, y, z = coarse.observation[:, POINT], coarse.observation[:, -19:-16], coarse.observation[:, -16:-13]
    assert torch.allclose(env.observation[:, -4:-1], (point / 0.02).clamp(-2.5, 2.5), atol=1e-5)
    assert (point.abs() > 0.05).any() and env.observation[:, -1].tolist() == [0.0, 1.0]
    grasp_from_tool = torch.stack([torch.linalg.cross(y, z), y, z], dim=1)
    near = torch.tensor([0.004, -0.01, 0.012])
    wp.to_torch(env.task.world.seen)[:, :3] = (grasp_from_tool @ (near - point)[:, :, None])[:, :, 0]
    env.task.observe(env.state)
    assert env.observation[0, -4:-1].tolist() == pytest.approx([0.2, -0.5, 0.6], abs=1e-3)


def test_the_way_in_fine_alone_is_refused(stage: SimStage) -> None:
    with pytest.raises(InputError, match="describe_part"):
        make_env(stage, fine_grasp=True)


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
