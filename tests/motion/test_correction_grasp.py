"""A planner that knows no more than it sees."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from cabinet import write_cabinet
from part_worlds import metric_settings, task_settings
from scipy.spatial.transform import Rotation
from settings import load

from s2a import tasks
from s2a.learn.evaluate import evaluate
from s2a.motion.correction import Correction, lead_grasp
from s2a.motion.policy import Planner
from s2a.motion.trajectory import Anchor, PlannerConfig
from s2a.robot.kinematics import kinematics
from s2a.robot.tool_path import matrices
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import read_stage
from s2a.tasks.env import VecEnv


def env_with(folder: Path, **task: object) -> VecEnv:
    """Return four worlds of the cabinet with these settings of the task."""
    sim = Simulation(read_stage(write_cabinet(folder / "sim.usda")), load(SimConfig, "sim/planner"), 4)
    return tasks.make_env(sim, task_settings(**task), metric_settings(), {}, 0)


def test_the_tool_goes_where_the_grasp_is_seen(tmp_path: Path) -> None:
    env = env_with(tmp_path)
    planner = Planner(env, load(PlannerConfig, "planner/default"))
    (trajectory,) = planner.trajectories
    end = len(trajectory.targets) - 1
    seen = Correction(env.sim, [trajectory], [Anchor("grasp", 0, 0, end, end)])
    turn = Rotation.from_euler("y", 8.0, degrees=True)
    offset = np.array([0.01, -0.012, 0.008, *turn.as_quat()])
    worlds = torch.tensor([False, True, True, True])
    lead_grasp(seen, env.sim.stages, [trajectory.part], worlds, np.tile(offset, (4, 1)))
    kin, base = kinematics(env.sim.robot), matrices(env.sim.stage.base[None])[0]
    for step in (0, trajectory.closed, (trajectory.closed + len(trajectory.targets)) // 2, len(trajectory.targets) - 1):
        moved = seen(torch.full((4,), step)).numpy()
        assert not moved[0].any(), "a world whose episode has not begun"
        arm = trajectory.targets[step, :7]
        before, after = (base @ kin.tool(each[None])[0] for each in (arm, arm + moved[1]))
        # The cabinet's drawer slides along -x: the grasp frame only shifts with it.
        grasp = matrices(env.sim.stage.grasp[None])[0]
        grasp[:3, 3] += trajectory.part[step] * np.array(env.sim.stage.joint.axis)
        should = grasp @ matrices(offset[None])[0] @ np.linalg.inv(grasp) @ before
        assert np.linalg.norm(after[:3, 3] - should[:3, 3]) < 1e-3
        assert np.degrees(Rotation.from_matrix(after[:3, :3].T @ should[:3, :3]).magnitude()) < 0.5


@pytest.mark.slow
def test_a_planner_that_sees_the_handle_elsewhere_misses_it(tmp_path: Path) -> None:
    settings = load(PlannerConfig, "planner/default")
    env = env_with(tmp_path, grasp_error=(0.08, 0.08))
    assert evaluate(env, Planner(env, settings))["grasp_success"]["rate"] == 0.0
    env = env_with(tmp_path, grasp_error=(0.08, 0.08))
    assert evaluate(env, Planner(env, settings, knows_grasp=True))["grasp_success"]["rate"] == 1.0


@pytest.mark.slow
def test_a_planner_that_sees_it_two_millimetres_off_opens_the_part(tmp_path: Path) -> None:
    env = env_with(tmp_path, grasp_error=(0.002, 0.002), grasp_turn=(1.0, 1.0))
    assert evaluate(env, Planner(env, load(PlannerConfig, "planner/default")))["grasp_success"]["rate"] == 1.0
