"""A part that cannot be held is pushed shut, from where it has come to rest."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cabinet import write_cabinet
from open_drawer import make_env
from settings import load

from s2a import robot
from s2a.learn.evaluate import evaluate
from s2a.motion.gripper import gripper_boxes
from s2a.motion.open import at_rest
from s2a.motion.part_base import PRESS, pushes, ready_to_move
from s2a.motion.policy import Planner
from s2a.motion.search import Unreachable
from s2a.motion.trajectory import PlannerConfig
from s2a.robot.tool_path import ToolPath, matrices
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Joint
from s2a.sim.world import SimStage, read_stage
from s2a.tasks.close_part import ClosePart, ClosePartConfig

PANDA = robot.load("panda")
FRONT = 0.32465
"""[m] Outer face of the drawer."""


def flap(origin: tuple[float, float, float], axis: tuple[float, float, float]) -> Joint:
    return Joint("revolute", axis, origin, (0.0, math.pi / 2))


BELOW = flap((0.32, 0.0, 0.655), (0.0, 1.0, 0.0))
ABOVE = flap((0.32, 0.0, 0.78), (0.0, -1.0, 0.0))
BESIDE = flap((0.32, -0.36, 0.7), (0.0, 0.0, -1.0))


def stage_of(tmp_path: Path, joint: Joint | None = None) -> SimStage:
    return read_stage(write_cabinet(tmp_path / "sim.usda", joint=joint))


@pytest.mark.parametrize(
    ("joint", "left", "rest"),
    [(BELOW, 0.5, math.pi / 2), (ABOVE, 0.5, 0.0), (BESIDE, 0.5, 0.5), (None, 0.2, 0.2)],
    ids=["falls open", "falls shut", "door", "drawer"],
)
def test_a_part_falls_by_its_weight_alone(tmp_path: Path, joint: Joint | None, left: float, rest: float) -> None:
    stage = stage_of(tmp_path, joint)
    assert at_rest(stage, left) == pytest.approx(rest, abs=0.02)
    assert at_rest(stage, at_rest(stage, left)) == pytest.approx(rest, abs=0.02)


def test_dry_friction_holds_a_lid(tmp_path: Path) -> None:
    stage = stage_of(tmp_path, BELOW)
    stiff = replace(stage.room.articulations[stage.target], friction=10.0)
    held = replace(stage, room=replace(stage.room, articulations={stage.target: stiff}))
    assert at_rest(held, 0.5) == 0.5


@pytest.mark.parametrize("joint", [BELOW, BESIDE, None], ids=["flap", "door", "drawer"])
def test_what_pushes_touches_the_outer_face_alone(tmp_path: Path, joint: Joint | None) -> None:
    stage = stage_of(tmp_path, joint)
    found = matrices(np.array(list(pushes(stage, PANDA.gripper))))
    assert len(found) > 100
    boxes = [
        (low - [0, side * 0.04, 0], high - [0, side * 0.04, 0])
        for (low, high), side in zip(gripper_boxes(PANDA.gripper), (1, -1, 0), strict=True)
    ]
    corners = np.concatenate([np.array(np.meshgrid(*zip(*box, strict=True))).reshape(3, -1).T for box in boxes])
    reached = (corners @ found[:, :3, :3].transpose(0, 2, 1) + found[:, None, :3, 3])[..., 0].min(axis=1)
    surface = merge([c.mesh for c in stage.room.bodies[stage.target].colliders])
    assert (reached >= FRONT - PRESS - 1e-6).all()
    assert (reached <= surface.vertices[:, 0].max() - PRESS + 1e-6).all()


@pytest.mark.slow
def test_what_cannot_be_held_is_pushed_shut_from_where_it_fell(tmp_path: Path) -> None:
    motion = load(PlannerConfig, "planner/default")
    config = load(ClosePartConfig, "task/close_part", start_opening=0.05)
    stage = stage_of(tmp_path, BELOW)

    def path_of(based: SimStage) -> ToolPath:
        path = ClosePart.tool_path(based, motion, config)
        lifted = path.poses + 2.4 * np.outer(np.eye(4)[2], np.eye(4)[3])
        return path if based.push is not None else replace(path, poses=lifted)

    with pytest.raises(Unreachable):
        ready_to_move(stage, path_of, PANDA, 0.125)
    found = ready_to_move(stage, path_of, PANDA, 0.125, may_push=True)
    assert found.push is not None
    path = path_of(found)
    assert (path.pushes, path.q[0], path.q[-1]) == (True, pytest.approx(math.pi / 2), 0.0)
    env = make_env(tmp_path, stage=found, start_opening=0.05)
    result = evaluate(env, Planner(env, motion))
    assert result["final_success"]["rate"] == 1.0
    assert result["remaining"]["max"] < 0.01
