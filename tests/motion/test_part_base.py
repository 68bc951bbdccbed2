"""Bases from which a robot can move a part as far as a task asks for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cabinet import HANDLE, write_cabinet
from settings import load

from s2a import robot
from s2a.motion.open import opening_path
from s2a.motion.part_base import with_base
from s2a.motion.search import Unreachable
from s2a.motion.trajectory import PlannerConfig
from s2a.robot.kinematics import kinematics
from s2a.robot.tool_path import ToolPath, follow, matrices
from s2a.scene.geometry import convex
from s2a.scene.usd.sim_scene import Collider
from s2a.sim.world import SimStage, read_stage

PANDA = robot.load("panda")


def settings() -> PlannerConfig:
    return load(PlannerConfig, "planner/default")


def path_of(stage: SimStage) -> ToolPath:
    return opening_path(stage, settings())


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
    with pytest.raises(Unreachable, match="cannot be moved so far: handle: the arm cannot reach"):
        with_base(stage, high, PANDA, 0.125)
