"""The stage of picking and placing, and the trajectory that does it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from s2a import robot as robots
from s2a.errors import InputError
from s2a.geometry.mesh_ops import merge
from s2a.planner.motion import PlannerConfig
from s2a.planner.obstacles import surface_points
from s2a.planner.pick_place import LIFT, plan_pick
from s2a.planner.pick_plan import PickPlan
from s2a.planner.places import free_object, place_pose, scanned
from s2a.planner.trajectory import USED, Trajectory, closing, reach_steps, timed
from s2a.scene import Joint
from s2a.sim.nearby import Workspace
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage
from s2a.tasks.pick_place.config import PickPlaceConfig
from s2a.usd import sim_stage
from s2a.usd.sim_scene import DEFAULT_ROBOT

NEIGHBOURS = 0.4
"""[m] From start or place: free objects up to there can move."""
SPEED = 0.6
"""[rad] Of all joints together that a carried object is moved in a second."""
SETTLE = 0.7
"""[s] Between two motions: the arm's controller lags by 0.2 s."""


@dataclass(frozen=True, kw_only=True)
class PickStage(SimStage):
    """A free object of a room as the target of a robot; `joint` stands for the first coordinate of its free joint.

    Attributes:
        start: of the object's body frame, 7-vector, scene frame.
        goal: likewise.
        plan: how the robot picks and places it.
    """

    start: np.ndarray
    goal: np.ndarray
    plan: PickPlan

    def workspace(self) -> Workspace:
        """Return where the plan, and what lies free, pass."""
        found, spec = super().workspace(), robots.load(self.robot)
        points = self.plan.swept(spec, surface_points([c.mesh for c in self.room.free[self.target].colliders]))
        return Workspace(np.concatenate([found.points, points]), found.shoulder, found.reach, planned=True)


def read_stage(
    path: Path, part: str | None, robot: str | None, also: Sequence[str], config: PickPlaceConfig
) -> PickStage:
    """Read a room and plan for an object of it, which decides where the robot stands.

    Raises:
        InputError: no such object, start or place; the robot cannot do it, with the segment that fails.
    """
    room = sim_stage.read(path, visuals=False)
    target, name = free_object(room, part), robot or DEFAULT_ROBOT
    start, goal = _ends(room, target, config)
    plan = plan_pick(room, target, start, goal, robots.load(name))
    near = [
        i for i, body in room.free.items()
        if i != target and min(np.linalg.norm(np.subtract(body.position, at[:3])) for at in (start, goal)) < NEIGHBOURS
    ]  # fmt: skip
    surface = merge([c.mesh for c in room.free[target].colliders])
    return PickStage(
        path=path,
        target=target,
        joint=Joint("prismatic", (1.0, 0.0, 0.0), tuple(start[:3]), (0.0, 1.0)),
        base=plan.base,
        grasp=start,
        grasp_size=np.ptp(surface.vertices, axis=0),
        region=surface,
        pedestal=(plan.pedestal, robots.load(name).base.radius),
        robot=name,
        also=tuple(dict.fromkeys([*also, *near])),
        room=room,
        start=start,
        goal=goal,
        plan=plan,
    )


def _ends(room: sim_stage.SimRoom, target: str, config: PickPlaceConfig) -> tuple[np.ndarray, np.ndarray]:
    """Return where the object starts and where it is to be placed, 7-vectors."""
    if config.start == config.place:
        raise InputError(
            f"task.start and task.place are both {config.place!r}; give the id of a support, a pose or a record"
        )
    here = scanned(room, target)
    if config.start is None or config.start.endswith(".json"):
        start = place_pose(room, target, config.start, here)
        return start, place_pose(room, target, config.place, start)
    goal = place_pose(room, target, config.place, here)
    return place_pose(room, target, config.start, goal), goal


def trajectory(sim: Simulation, plan: PickPlan, config: PlannerConfig) -> Trajectory:
    """Return the joint targets that do a plan, from home on."""
    spec, limits = sim.robot, sim.plan_limits
    rate = 1.0 / (sim.config.dt * sim.config.substeps)
    wide, still = spec.gripper.finger_joint_open, math.ceil(SETTLE * rate)
    shut = closing(spec.gripper, config.close_time, rate)
    arm, finger = [plan.reach[:1]], [np.full(1, wide)]
    closed = 0

    def go(path: np.ndarray, fingers: float, seconds: float) -> None:
        moved = timed(path, seconds, limits, rate)
        arm.append(np.concatenate([moved, np.tile(moved[-1], (still, 1))]))
        finger.append(np.full(len(arm[-1]), fingers))

    def grip(values: np.ndarray) -> None:
        arm.append(np.tile(arm[-1][-1], (len(values), 1)))
        finger.append(values)

    go(plan.reach, wide, max(config.reach_time, _length(plan.reach) / SPEED))
    go(plan.approach, wide, config.approach_time)
    grip(shut)
    closed = sum(map(len, arm))
    straight = config.approach_time * LIFT / config.approach
    go(plan.lift, 0.0, straight)
    go(plan.carry, 0.0, max(config.reach_time, _length(plan.carry) / SPEED))
    go(plan.lower, 0.0, 2.0 * straight)
    grip(wide - shut)
    go(plan.retreat, wide, config.approach_time)
    arms, fingers = np.concatenate(arm), np.concatenate(finger)[:, None]
    home = np.array(spec.home)
    # The fingers may start closed; an eased motion's peak is 4/3 of its mean speed.
    opening = 4.0 / 3.0 * wide / (USED * spec.gripper.finger_speed)
    reach = reach_steps(home, arms[0], config.start_noise, max(0.5 * config.reach_time, opening), limits, rate)
    return Trajectory(np.concatenate([arms, fingers, fingers], axis=1), np.zeros(len(arms)), reach, closed)


def _length(path: np.ndarray) -> float:
    """Return the length of a joint path [pose arm] [rad]."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
