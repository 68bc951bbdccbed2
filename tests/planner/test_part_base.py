"""Where a robot stands to move a part, and how its arm comes to the handle around what is in the way."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cabinet import HANDLE, box, write_cabinet
from settings import load

from s2a import robot
from s2a.planner.misses import Unreachable
from s2a.planner.part_base import with_base
from s2a.planner.part_plan import PlannerConfig, joint_paths, plan
from s2a.planner.part_reach import detour, is_free, preceded, room_hulls
from s2a.robot.collision import robot_shape
from s2a.robot.kinematics import kinematics
from s2a.robot.tool_path import ToolPath, follow, matrices
from s2a.scene.geometry import convex
from s2a.scene.usd.sim_scene import Collider
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import SimStage, read_stage
from s2a.tasks.skills_open_part import tool_path

PANDA = robot.load("panda")


def settings() -> PlannerConfig:
    return load(PlannerConfig, "planner/default")


def path_of(stage: SimStage) -> ToolPath:
    return tool_path(stage, settings())


def test_a_prepared_base_that_serves_is_kept(tmp_path: Path) -> None:
    stage = read_stage(write_cabinet(tmp_path / "sim.usda"))
    found = with_base(stage, path_of(stage), PANDA, 0.125)
    np.testing.assert_allclose(found.base[:3], stage.base[:3], atol=1e-6)
    assert found.pedestal[0] == stage.pedestal[0]


def test_where_the_prepared_base_does_not_reach_another_one_is_found(tmp_path: Path) -> None:
    stage = read_stage(write_cabinet(tmp_path / "sim.usda", base=(HANDLE[0] + 1.5, 0.0, 0.0)))
    path = path_of(stage)
    kin = kinematics(PANDA)
    (paths,) = follow(kin, path.poses, matrices(stage.base[None]), 12)
    assert not len(paths)
    found = with_base(stage, path, PANDA, 0.125)
    (paths,) = follow(kin, path.poses, matrices(found.base[None]), 12)
    assert len(paths)
    # The drawer comes out by 0.3 m: the robot does not stand where it comes.
    assert found.base[0] > HANDLE[0] + 0.3 or abs(found.base[1]) > 0.3


def test_a_prepared_base_into_which_the_part_moves_is_not_kept(tmp_path: Path) -> None:
    """A robot that was placed for a shorter way stood where a door came, and stopped it."""
    stage = read_stage(write_cabinet(tmp_path / "sim.usda"))
    body = stage.room.bodies[stage.target]
    rider = convex.box(stage.base[:3] + [-0.3, 0.0, 0.1], np.eye(3), np.array([0.05, 0.05, 0.05]))
    wide = replace(body, colliders=(*body.colliders, Collider(stage.target, rider)))
    room = replace(stage.room, bodies={**stage.room.bodies, stage.target: wide})
    found = with_base(replace(stage, room=room), path_of(stage), PANDA, 0.125)
    assert np.linalg.norm(found.base[:3] - stage.base[:3]) > 0.1


def test_what_no_base_reaches_is_said_with_its_segment(tmp_path: Path) -> None:
    stage = read_stage(write_cabinet(tmp_path / "sim.usda"))
    path = path_of(stage)
    high = replace(path, poses=path.poses + [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1.9], [0, 0, 0, 0]])
    with pytest.raises(Unreachable, match="cannot be moved so far: handle: the arm cannot follow"):
        with_base(stage, high, PANDA, 0.125)


@pytest.fixture
def blocked(tmp_path: Path) -> tuple[SimStage, np.ndarray]:
    """A stage with a post on the straight line from home to the point of approach, and the joints there [arm]."""
    plain = read_stage(write_cabinet(tmp_path / "plain.usda"))
    kin = kinematics(PANDA)
    first = joint_paths(kin, plain, path_of(plain), settings())[0][0]
    assert detour(plain, PANDA, first, 0.0, 0.0, 0) is None, "the straight line is free"
    halfway = (np.array(PANDA.home) + first) / 2
    place = matrices(plain.base[None])[0] @ kin.tool(halfway[None])[0]
    post = box(tuple(place[:3, 3]), (0.03, 0.03, 0.03))
    return read_stage(write_cabinet(tmp_path / "blocked.usda", beside=[post])), first


def test_the_arm_reaches_around_what_is_in_the_way(blocked: tuple[SimStage, np.ndarray]) -> None:
    stage, first = blocked
    path = detour(stage, PANDA, first, 0.0, 0.0, 0)
    assert path is not None
    np.testing.assert_allclose(path[[0, -1]], [PANDA.home, first], atol=1e-9)
    near, base = room_hulls(stage, 0.0), matrices(stage.base[None])[0]
    free = is_free(robot_shape(PANDA), near, base)
    assert not free(np.linspace(PANDA.home, first, 20)).all()
    # An arm that lags behind it cuts its corners; 25 mm the point of approach itself does not keep from the front.
    assert is_free(robot_shape(PANDA), near, base, clearance=0.01)(path).all()


def test_a_trajectory_around_begins_at_home_and_goes_on_without_a_jump(tmp_path: Path) -> None:
    sim = Simulation(read_stage(write_cabinet(tmp_path / "sim.usda")), load(SimConfig, "sim/planner"), 1)
    config = settings()
    before = plan(sim, config, tool_path)
    home, first = np.array(PANDA.home), before.targets[0, :7]
    path = np.linspace(home, first, 30)
    after = preceded(before, path, PANDA, sim.plan_limits, 60.0, config.start_noise, config.reach_time)
    added = len(after.targets) - len(before.targets)
    np.testing.assert_allclose(after.targets[0, :7], home)
    np.testing.assert_allclose(after.targets[added:], before.targets)
    assert (after.closed, len(after.part)) == (before.closed + added, len(after.targets))
    speed = np.abs(np.diff(after.targets[:, :7], axis=0)).max(axis=0) * 60.0
    assert (speed <= np.array(sim.plan_limits.velocity)).all()
    assert (after.targets[: after.closed - 60, 7] > 0.0).all(), "the fingers stay open on the way"
