"""A part that does not stand where it was left is shut by its handle all the same."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from drawer_room import drawer_room
from settings import load

from s2a.motion import put_in
from s2a.motion.correction import Correction, TrackedPart, lead_handle, lead_held
from s2a.motion.trajectory import PlannerConfig, Trajectory
from s2a.robot.kinematics import kinematics
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import axis_of
from s2a.tasks.put_in import PutInConfig

STANDS = (0.3, 0.26, 0.33, 0.1)
"""[m] Where the drawer stands in each world; it was opened to the first, and the last is too far off."""
APPROACH = 0.08
"""[m] Straight path to the handle and to the object, other than by default."""
Moved = tuple[Simulation, Trajectory, np.ndarray]
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def moved(tmp_path_factory: pytest.TempPathFactory) -> Moved:
    """Return worlds, their trajectory, and what is added to the arm's targets in each, shape [step world arm]."""
    path = tmp_path_factory.mktemp("moved") / "sim.usda"
    drawer_room(path)
    motion = load(PlannerConfig, "planner/default", approach=APPROACH)
    stage = put_in.read_stage(path, "cube_9", None, (), load(PutInConfig, "task/put_in", place="drawer_2"), motion)
    sim = Simulation(stage, load(SimConfig, "sim/put_in"), len(STANDS))
    trajectory = put_in.trajectory(sim, stage, motion)
    shutting = trajectory.anchor("handle")
    assert shutting is not None
    sim.joint_q[:, axis_of(sim.world, "drawer_2", "prismatic")[0]] = torch.tensor(STANDS)
    part, worlds = Correction(sim, [trajectory], [shutting]), torch.ones(len(STANDS), dtype=torch.bool)
    lead_handle(part, TrackedPart(sim, shutting.part), trajectory.part, worlds)
    steps = range(len(trajectory.targets))
    return sim, trajectory, np.stack([part(torch.full((len(STANDS),), step)).numpy() for step in steps])


def test_the_straight_paths_are_as_long_as_the_planner_s_approach(moved: Moved) -> None:
    stage, kin = moved[0].stage, kinematics(moved[0].robot)
    put, (first, _) = stage.put, stage.put.held
    for path in (put.handle[: first + 1], put.pick.approach):
        tool = kin.tool(path)[:, :3, 3]
        assert np.linalg.norm(tool[-1] - tool[0]) == pytest.approx(APPROACH, abs=1e-3)


def test_the_gripper_is_at_the_handle_until_the_part_is_shut(moved: Moved) -> None:
    sim, trajectory, added = moved
    shutting, arm = trajectory.anchor("handle"), trajectory.targets[:, None, :7] + added
    for step in range(shutting.first, shutting.last + 1, 7):
        planned, *tools = kinematics(sim.robot).tool(np.concatenate([trajectory.targets[step, None, :7], arm[step]]))
        for tool, stands in zip(tools, STANDS[:3], strict=False):
            off = trajectory.part[step] * (stands / STANDS[0] - 1.0)
            turned = np.linalg.inv(planned) @ tool
            assert np.linalg.norm(tool[:3, 3] - planned[:3, 3]) == pytest.approx(abs(off), abs=1e-3)
            assert np.trace(turned[:3, :3]) == pytest.approx(3.0, abs=1e-3)
    assert trajectory.part[shutting.first] == pytest.approx(STANDS[0])
    assert trajectory.part[shutting.last] == pytest.approx(0.0, abs=1e-6)


def test_nothing_is_added_before_and_after_nor_where_the_part_is_far_off(moved: Moved) -> None:
    _, trajectory, added = moved
    shutting = trajectory.anchor("handle")
    assert np.abs(added[: shutting.begin]).max() == 0.0
    assert np.abs(added[shutting.last :]).max() < 1e-6
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
    aligned = trajectory.anchor("held")
    assert aligned.part == "drawer_2"
    part, worlds = TrackedPart(sim, aligned.part), torch.ones(len(STANDS), dtype=torch.bool)
    planned = float(trajectory.part[aligned.begin])
    held = Correction(sim, [trajectory], [aligned])
    lead_held(held, worlds, np.tile(aligned.held, (len(STANDS), 1, 1)), part.off(planned, worlds))
    for step in (aligned.first, aligned.last):
        added = held(torch.full((len(STANDS),), step)).numpy()
        asked, *tools = kinematics(sim.robot).tool(
            np.concatenate([[0.0 * added[0]], added]) + trajectory.targets[step, :7]
        )
        for tool, motion, stands in zip(tools, part.off(planned, worlds), STANDS, strict=True):
            assert tool[:3, 3] == pytest.approx((motion @ asked)[:3, 3], abs=1e-3)
            off = stands - STANDS[0] if stands != STANDS[-1] else 0.0
            assert np.linalg.norm(motion[:3, 3]) == pytest.approx(abs(off), abs=1e-4)
