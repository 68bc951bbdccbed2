"""Joint paths with which a part is opened, and how the arm comes to the handle around what is in the way."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cabinet import box, write_cabinet
from settings import load

from s2a import robot
from s2a.core.errors import InputError
from s2a.motion.open import (
    joint_paths,
    most_clear,
    opening_path,
    plan_letting_go,
    planned_path,
    reach_around,
    room_around,
)
from s2a.motion.trajectory import PlannerConfig
from s2a.motion.workcell import Workcell
from s2a.robot.collision import SLACK, robot_shape
from s2a.robot.kinematics import kinematics
from s2a.robot.tool_path import ToolPath, matrices, matrix
from s2a.scene.articulation import displace
from s2a.scene.geometry import convex
from s2a.scene.scene import Joint
from s2a.scene.usd.sim_scene import Collider
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import SimStage, read_stage

PANDA = robot.load("panda")


def settings() -> PlannerConfig:
    return load(PlannerConfig, "planner/default")


def exact() -> PlannerConfig:
    """Return settings of episodes that start at home."""
    return replace(settings(), start_noise=0.0)


def path_of(stage: SimStage) -> ToolPath:
    return opening_path(stage, settings())


@pytest.fixture
def blocked(tmp_path: Path) -> tuple[SimStage, np.ndarray]:
    """A stage with a post on the straight line from home to the point of approach, and the joints there [arm]."""
    plain = read_stage(write_cabinet(tmp_path / "plain.usda"))
    kin = kinematics(PANDA)
    first = joint_paths(kin, plain, path_of(plain), settings())[0][0]
    assert reach_around(plain, PANDA, first, 0.0, exact()) is None, "the straight line is free"
    halfway = (np.array(PANDA.home) + first) / 2
    place = matrices(plain.base[None])[0] @ kin.tool(halfway[None])[0]
    post = box(tuple(place[:3, 3]), (0.03, 0.03, 0.03))
    return read_stage(write_cabinet(tmp_path / "blocked.usda", beside=[post])), first


def test_the_arm_reaches_around_what_is_in_the_way(blocked: tuple[SimStage, np.ndarray]) -> None:
    stage, first = blocked
    path = reach_around(stage, PANDA, first, 0.0, exact())
    assert path is not None
    np.testing.assert_allclose(path[[0, -1]], [PANDA.home, first], atol=1e-9)
    cell = Workcell(PANDA, room_around(stage, 0.0))
    depth = cell.empty(matrix(stage.base))
    assert not cell.is_free(depth, np.linspace(PANDA.home, first, 20)).all()
    # An arm that lags behind it cuts its corners; 25 mm the point of approach itself does not keep from the front.
    assert cell.is_free(depth, path, 0.01).all()


def test_the_arm_takes_a_path_on_which_nothing_is_in_its_way(tmp_path: Path) -> None:
    plain = read_stage(write_cabinet(tmp_path / "plain.usda"))
    path, kin = path_of(plain), kinematics(PANDA)
    paths = joint_paths(kin, plain, path, settings())
    first = paths[most_clear(plain, PANDA, paths, path)[1]]
    halfway = (np.array(PANDA.home) + first[0]) / 2
    place = matrix(plain.base) @ kin.tool(halfway[None])[0]
    post = box(tuple(place[:3, 3]), (0.03, 0.03, 0.03))
    blocked = read_stage(write_cabinet(tmp_path / "blocked.usda", beside=[post]))
    other = paths[most_clear(blocked, PANDA, paths, path)[1]]
    assert not np.array_equal(first, other)
    both = np.stack([first, other])
    assert most_clear(plain, PANDA, both, path)[1] == 0
    assert [most_clear(blocked, PANDA, each, path)[1] for each in (both, both[::-1])] == [1, 0]


def test_the_arm_takes_a_path_on_which_the_part_does_not_move_into_it(tmp_path: Path) -> None:
    """Of the paths from a base one was clear of a door; another was taken, and the door met the arm's second link."""
    stage = read_stage(write_cabinet(tmp_path / "sim.usda"))
    path, shape = path_of(stage), robot_shape(PANDA)
    paths = joint_paths(shape.kin, stage, path, settings())
    ends = shape.centers(paths[:, -1])[:, shape.moving & ~shape.held]
    apart = np.linalg.norm(ends[0][:, None, None] - ends[None], axis=-1).min(axis=2).max(axis=0)
    other = int(apart.argmax())
    sphere = np.linalg.norm(ends[0][:, None] - ends[other][None], axis=-1).min(axis=1).argmax()
    met = matrix(stage.base)[:3] @ [*ends[0, sphere], 1.0]
    rider = convex.box(displace(met[None], stage.joint, -path.q[-1])[0], np.eye(3), np.full(3, 0.03))
    body = stage.room.bodies[stage.target]
    wide = replace(body, colliders=(*body.colliders, Collider(stage.target, rider)))
    room = replace(stage.room, bodies={**stage.room.bodies, stage.target: wide})
    both = paths[[0, other]]
    assert most_clear(stage, PANDA, both, path)[1] == 0
    assert most_clear(replace(stage, room=room), PANDA, both, path)[1] == 1


@pytest.mark.slow
def test_a_door_is_opened_another_way_where_the_asked_one_meets_something(tmp_path: Path) -> None:
    """A post stands where the hand would be that turned with a flap all the way."""
    door = Joint("revolute", (0.0, -1.0, 0.0), (0.31, 0.0, 1.1), (0.0, 1.5))
    stage = read_stage(write_cabinet(tmp_path / "plain.usda", joint=door))
    plain = Simulation(stage, load(SimConfig, "sim/planner"), 1)
    asked, _ = planned_path(plain, settings(), opening_path)
    np.testing.assert_array_equal(asked.poses, path_of(plain.stage).poses)
    hand = asked.poses[-1, :3, 3] - 0.2 * asked.poses[-1, :3, 2]
    post = write_cabinet(tmp_path / "post.usda", joint=door, beside=[box(tuple(hand), (0.02, 0.02, 0.02))])
    blocked = Simulation(read_stage(post), load(SimConfig, "sim/planner"), 1)
    path, arm = planned_path(blocked, settings(), opening_path)
    assert not np.array_equal(path.poses, asked.poses)
    assert most_clear(blocked.stage, PANDA, arm[None], path)[0] <= SLACK


def test_a_path_to_which_the_arm_reaches_around_something_is_kept(blocked: tuple[SimStage, np.ndarray]) -> None:
    stage, _ = blocked
    path, _ = planned_path(Simulation(stage, load(SimConfig, "sim/planner"), 1), settings(), opening_path)
    np.testing.assert_array_equal(path.poses, path_of(stage).poses)


def test_an_exact_path_is_the_asked_one_whatever_it_meets(tmp_path: Path) -> None:
    block = box((0.75, 0.0, 0.75), (0.05, 0.3, 0.3))
    sim = Simulation(
        read_stage(write_cabinet(tmp_path / "sim.usda", beside=[block])), load(SimConfig, "sim/planner"), 1
    )
    path, _ = planned_path(sim, settings(), opening_path, exact=True)
    np.testing.assert_array_equal(path.poses, path_of(sim.stage).poses)


@pytest.mark.slow
def test_a_path_out_of_reach_is_replaced_only_by_one_that_meets_nothing(tmp_path: Path) -> None:
    flap = Joint("revolute", (0.0, 1.0, 0.0), (0.31, 0.0, 0.25), (0.0, 1.5))
    plain = Simulation(
        read_stage(write_cabinet(tmp_path / "plain.usda", joint=flap)), load(SimConfig, "sim/planner"), 1
    )
    path, arm = planned_path(plain, settings(), opening_path)
    assert most_clear(plain.stage, PANDA, arm[None], path)[0] <= SLACK
    with pytest.raises(InputError, match="cannot follow"):
        planned_path(plain, settings(), opening_path, exact=True)
    block = write_cabinet(tmp_path / "blocked.usda", joint=flap, beside=[box((0.75, 0.0, 0.75), (0.05, 0.3, 0.3))])
    with pytest.raises(InputError, match="cannot follow"):
        planned_path(Simulation(read_stage(block), load(SimConfig, "sim/planner"), 1), settings(), opening_path)


def test_a_task_that_lets_go_ends_with_open_fingers_off_the_handle(tmp_path: Path) -> None:
    sim = Simulation(read_stage(write_cabinet(tmp_path / "sim.usda")), load(SimConfig, "sim/planner"), 1)
    found = plan_letting_go(sim, settings(), opening_path)
    assert (found.approach, found.retreat) == (pytest.approx(0.1), pytest.approx(0.1))
    targets, kin = found.demonstration.targets, kinematics(PANDA)
    assert targets[-1, 7] == pytest.approx(PANDA.gripper.finger_joint_open)
    end, held = (matrix(sim.stage.base) @ kin.tool(each[None])[0] for each in (targets[-1, :7], found.arm[-1 - 7]))
    assert np.linalg.norm(end[:3, 3] - held[:3, 3]) == pytest.approx(0.1, abs=0.02)
    assert np.linalg.norm(np.diff(targets[-40:, :7], axis=0), axis=1).max() < 1e-3, "the arm has come to rest"
