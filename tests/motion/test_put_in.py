"""A plan to put an object into a drawer: its ends, its order, and what is said where there is none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from drawer_room import FLOOR, START, drawer_room

from s2a import robot
from s2a.motion.put_in import PutPlan, PutTask, handle_path, plan_put
from s2a.motion.search import Unreachable
from s2a.robot.kinematics import kinematics
from s2a.robot.tool_path import matrix
from s2a.scene.usd.sim_scene import SimRoom

PANDA = robot.load("panda")
OPENING = 0.3


def task(room: SimRoom, start: np.ndarray = START) -> PutTask:
    return PutTask(room, "cube_9", start, "drawer_2", OPENING, 0.1, 0.0)


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> tuple[PutTask, PutPlan]:
    """Of the cube on the cabinet, into the drawer below it."""
    found = task(drawer_room(tmp_path_factory.mktemp("put") / "sim.usda"))
    return found, plan_put(found, PANDA)


@pytest.mark.slow
def test_the_segments_follow_one_another_from_home_to_home(planned: tuple[PutTask, PutPlan]) -> None:
    plan, home = planned[1], np.array(PANDA.home)
    ends = [(plan.to_shut[0], home), (plan.to_shut[-1], plan.handle[0]), (plan.leave[0], plan.handle[-1])]
    ends += [(plan.leave[-1], home), (plan.pick.reach[0], home), (plan.home[0], plan.pick.retreat[-1])]
    ends += [(plan.home[-1], home), (plan.to_open[0], home), (plan.to_open[-1], plan.handle[-1])]
    for one, other in ends:
        np.testing.assert_allclose(one, other, atol=1e-6)


@pytest.mark.slow
def test_the_handle_is_led_as_far_as_the_drawer_opens(planned: tuple[PutTask, PutPlan]) -> None:
    found, plan = planned
    first, last = plan.held
    tool = matrix(plan.pick.base) @ kinematics(PANDA).tool(plan.handle)
    np.testing.assert_allclose(tool[last, :3, 3] - tool[first, :3, 3], [OPENING, 0.0, 0.0], atol=1e-3)
    np.testing.assert_allclose(tool[:, :3, 3], handle_path(found).poses[:, :3, 3], atol=1e-3)


@pytest.mark.slow
def test_the_object_ends_on_the_floor_of_the_open_drawer(planned: tuple[PutTask, PutPlan]) -> None:
    plan = planned[1]
    assert plan.goal[2] == pytest.approx(FLOOR + 0.02 + 0.001, abs=1e-4)
    tool = matrix(plan.pick.base) @ kinematics(PANDA).tool(plan.pick.lower[-1:])
    held = (tool @ np.linalg.inv(plan.pick.grasp))[0]
    np.testing.assert_allclose(held[:3, 3], plan.goal[:3] + [0.0, 0.0, 0.001], atol=2e-3)


def test_an_object_out_of_reach_of_the_drawer_is_said(tmp_path: Path) -> None:
    far = START + [0.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    with pytest.raises(Unreachable, match="'cube_9' cannot be put into 'drawer_2' so: base: .*; choose a place"):
        plan_put(task(drawer_room(tmp_path / "sim.usda"), far), PANDA)
