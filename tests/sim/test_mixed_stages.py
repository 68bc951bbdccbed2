"""Stages of slides and of hinges share a batch, and each moves as it does alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from cabinet import HANDLE, write_cabinet
from part_worlds import make_env
from settings import load

from s2a.scene.scene import Joint
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import SimStage, read_stage

HINGE = Joint("revolute", (0.0, 0.0, 1.0), (HANDLE[0] - 0.02, 0.37, 0.7), (0.0, 1.2))
SPEED = 0.3
"""[m/s or rad/s] By which all parts open at the start."""


@pytest.fixture
def stages(tmp_path: Path) -> list[SimStage]:
    joints = {"slide": None, "hinge": HINGE}
    return [read_stage(write_cabinet(tmp_path / f"{name}.usda", joint=joint)) for name, joint in joints.items()]


def opened(sim: Simulation) -> np.ndarray:
    """Return the coordinates of the parts after a quarter of a second of coasting, shape [step world]."""
    worlds, coord, dof = torch.arange(sim.num_envs), torch.tensor(sim.part_coord), torch.tensor(sim.part_dof)
    path, step = [], sim.capture(sim.step)
    sim.joint_qd[worlds, dof] = SPEED
    for _ in range(15):
        step()
        path.append(sim.joint_q[worlds, coord].numpy().copy())
    return np.array(path)


def test_each_moves_as_it_does_alone(stages: list[SimStage]) -> None:
    config = load(SimConfig, "sim/planner")
    mixed = Simulation(stages, config, 4)
    path = opened(mixed)
    for k, stage in enumerate(stages):
        alone = opened(Simulation([stage, stage], config, 2))[:, 0]
        assert alone[-1] > 0.01
        assert path[:, k] == pytest.approx(alone, abs=1e-6)
        assert (path[:, k] == path[:, k + 2]).all()
    locked = mixed.joint_q.numpy()[np.arange(4), 9 + 10 - mixed.part_coord]
    assert np.abs(locked).max() < 1e-5


def test_an_environment_reads_each_worlds_own_axis(stages: list[SimStage]) -> None:
    env = make_env(stages, num_envs=2)
    env.sim.joint_q[0, 9], env.sim.joint_q[1, 10] = 0.1, 0.1
    env.step(torch.zeros(2, env.num_actions))
    slide, hinge = env.observation[:, 21].tolist()
    assert slide == pytest.approx(0.1, abs=0.005) and hinge == pytest.approx(0.1, abs=0.005)


def test_a_described_part_tells_its_axis_travel_and_grasp(stages: list[SimStage]) -> None:
    env = make_env(stages, num_envs=2, describe_part=True)
    env.step(torch.zeros(2, env.num_actions))
    vectors, facts = env.observation[:, -22:-4].reshape(2, 6, 3), env.observation[:, -4:]
    # The robot looks along -x of the world: an opening along +x comes towards it, and z is up for both.
    assert vectors[0, 3].tolist() == pytest.approx([-1.0, 0.0, 0.0], abs=1e-5)
    assert vectors[0, 4].tolist() == pytest.approx([-1.0, 0.0, 0.0], abs=1e-5)
    assert vectors[1, 3].tolist() == pytest.approx([0.0, 0.0, 1.0], abs=1e-5)
    arm = np.array(HANDLE)[:2] - HINGE.origin[:2]
    towards = np.array([-arm[1], arm[0]]) / np.linalg.norm(arm)
    assert vectors[1, 4].tolist() == pytest.approx(
        [-towards[0], -towards[1], 0.0], abs=0.02
    )  # the robot is turned by 180 degrees
    assert facts[:, 0].tolist() == [1.0, 0.0]
    assert facts[1, 1].item() == pytest.approx(np.linalg.norm(arm), abs=1e-5) and facts[0, 1] == 0.0
    assert facts[:, 2].tolist() == pytest.approx([stage.travel for stage in stages], abs=1e-5)
    assert vectors[:, 5].tolist() == pytest.approx(np.tile(stages[0].grasp_size, (2, 1)), abs=1e-6)
    between = env.observation[:, 18:21]
    assert vectors[:, 0].norm(dim=1).tolist() == pytest.approx(between.norm(dim=1).tolist(), abs=1e-5)
