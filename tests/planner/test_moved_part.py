"""A part that does not stand where it was left is shut by its handle all the same."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from drawer_room import drawer_room
from settings import load

from s2a.planner.held_object import HeldObject
from s2a.planner.moved_part import MovedPart, PartOff
from s2a.planner.part_plan import PlannerConfig
from s2a.planner.trajectory import Trajectory
from s2a.robot.kinematics import kinematics
from s2a.sim.simulation import SimConfig, Simulation
from s2a.tasks import skills_put_in as skill
from s2a.tasks.put_in import PutInConfig

STANDS = (0.3, 0.26, 0.33, 0.1)
"""[m] Where the drawer stands in each world; it was opened to the first, and the last is too far off."""
Moved = tuple[Simulation, Trajectory, np.ndarray]


@pytest.fixture(scope="module")
def moved(tmp_path_factory: pytest.TempPathFactory) -> Moved:
    """Return worlds, their trajectory, and what is added to the arm's targets in each, shape [step world arm]."""
    path = tmp_path_factory.mktemp("moved") / "sim.usda"
    drawer_room(path)
    stage = skill.read_stage(path, "cube_9", None, (), load(PutInConfig, "task/put_in", place="drawer_2"))
    sim = Simulation(stage, load(SimConfig, "sim/put_in"), len(STANDS))
    trajectory = skill.trajectory(sim, stage, load(PlannerConfig, "planner/default"))
    assert trajectory.shutting is not None
    part = MovedPart(sim, trajectory, trajectory.shutting)
    sim.joint_q[:, part._part._coord] = torch.tensor(STANDS)
    part.see(torch.full((len(STANDS),), trajectory.shutting.begin))
    steps = range(len(trajectory.targets))
    return sim, trajectory, np.stack([part(torch.full((len(STANDS),), step)).numpy() for step in steps])


def test_the_gripper_is_at_the_handle_until_the_part_is_shut(moved: Moved) -> None:
    sim, trajectory, added = moved
    shutting, arm = trajectory.shutting, trajectory.targets[:, None, :7] + added
    for step in range(shutting.near, shutting.shut + 1, 7):
        planned, *tools = kinematics(sim.robot).tool(np.concatenate([trajectory.targets[step, None, :7], arm[step]]))
        for tool, stands in zip(tools, STANDS[:3], strict=False):
            off = trajectory.part[step] * (stands / STANDS[0] - 1.0)
            turned = np.linalg.inv(planned) @ tool
            assert np.linalg.norm(tool[:3, 3] - planned[:3, 3]) == pytest.approx(abs(off), abs=1e-3)
            assert np.trace(turned[:3, :3]) == pytest.approx(3.0, abs=1e-3)
    assert trajectory.part[shutting.near] == pytest.approx(STANDS[0])
    assert trajectory.part[shutting.shut] == pytest.approx(0.0, abs=1e-6)


def test_nothing_is_added_before_and_after_nor_where_the_part_is_far_off(moved: Moved) -> None:
    _, trajectory, added = moved
    assert np.abs(added[: trajectory.shutting.begin]).max() == 0.0
    assert np.abs(added[trajectory.shutting.shut :]).max() < 1e-6
    assert np.abs(added[:, 3]).max() == 0.0
    assert np.abs(added[:, 0]).max() < 1e-3


def test_what_is_added_keeps_the_robot_s_limits(moved: Moved) -> None:
    """With all of the trajectory, which alone uses up to 80 % of them."""
    sim, trajectory, added = moved
    arm = trajectory.targets[:, None, :7] + added
    velocity = np.diff(arm, axis=0) * 60.0
    acceleration = np.diff(velocity, axis=0) * 60.0
    assert (np.abs(velocity) / sim.plan_limits.velocity).max() < 1.0
    assert (np.abs(acceleration) / sim.plan_limits.acceleration).max() < 1.0


def test_an_object_is_put_where_its_place_in_the_part_has_moved_to(moved: Moved) -> None:
    sim, trajectory, _ = moved
    aligned, part = trajectory.aligned, PartOff(sim, trajectory.shutting.part)
    worlds = np.ones(len(STANDS), dtype=bool)
    sim.joint_q[:, part._coord] = torch.tensor(STANDS)
    planned = float(trajectory.part[aligned.seen])
    seen = [lambda worlds: np.tile(aligned.held, (len(STANDS), 1, 1)), lambda worlds: part.off(planned, worlds)]
    held = HeldObject(sim, trajectory, aligned, *seen)
    held.see(torch.full((len(STANDS),), aligned.seen))
    for step in (aligned.ready, aligned.released):
        added = held(torch.full((len(STANDS),), step)).numpy()
        asked, *tools = kinematics(sim.robot).tool(
            np.concatenate([[0.0 * added[0]], added]) + trajectory.targets[step, :7]
        )
        for tool, motion, stands in zip(tools, part.off(planned, worlds), STANDS, strict=True):
            assert tool[:3, 3] == pytest.approx((motion @ asked)[:3, 3], abs=1e-3)
            off = stands - STANDS[0] if stands != STANDS[-1] else 0.0
            assert np.linalg.norm(motion[:3, 3]) == pytest.approx(abs(off), abs=1e-4)
