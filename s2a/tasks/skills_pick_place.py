"""The stage of picking and placing, and the trajectory that does it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from s2a import robot as robots
from s2a.core.errors import InputError
from s2a.planner.contact import FIRM, SLOPING, Contact
from s2a.planner.grasp_cache import GraspCache
from s2a.planner.misses import Unreachable
from s2a.planner.object_grasps import matrix
from s2a.planner.obstacles import surface_points
from s2a.planner.part_plan import PlannerConfig
from s2a.planner.pick_place import plan_pick
from s2a.planner.pick_plan import PickPlan
from s2a.planner.places import first_planned, free_object, place_poses, scanned
from s2a.planner.segments import Segments
from s2a.planner.straight_paths import LIFT
from s2a.planner.trajectory import Picked, Trajectory
from s2a.robot.spec import RobotSpec
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Joint
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import DEFAULT_ROBOT
from s2a.sim.nearby import Workspace
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage

if TYPE_CHECKING:
    from s2a.tasks.pick_place import PickPlaceConfig

Ends = tuple[np.ndarray, np.ndarray]
"""Start and place of an object's body frame, 7-vectors, scene frame."""
NEIGHBOURS = 0.4
"""[m] From start or place: free objects up to there can move."""


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
        surface = surface_points([c.mesh for c in self.room.free[self.target].colliders])
        ends = [surface @ at[:3, :3].T + at[:3, 3] for at in (matrix(self.start), matrix(self.goal))]
        passed = self.plan.swept(robots.load(self.robot), surface)
        return super().workspace().planned_along(passed, np.concatenate(ends))


def read_stage(
    path: Path, part: str | None, robot: str | None, also: Sequence[str], config: PickPlaceConfig
) -> PickStage:
    """Read a room and plan for an object of it, which decides where the robot stands.

    Raises:
        InputError: no such object, start or place; the robot cannot do it, with the segment that fails.
    """
    room = sim_stage.read(path, visuals=False)
    target, name = free_object(room, part), robot or DEFAULT_ROBOT
    spec = robots.load(name)
    (start, goal), plan = _planned(room, target, spec, config)
    near = neighbours(room, target, start, goal)
    surface = merge([c.mesh for c in room.free[target].colliders])
    return PickStage(
        path=path,
        target=target,
        joint=Joint("prismatic", (1.0, 0.0, 0.0), tuple(start[:3]), (0.0, 1.0)),
        base=plan.base,
        grasp=start,
        grasp_size=np.ptp(surface.vertices, axis=0),
        region=surface,
        pedestal=(plan.pedestal, spec.base.radius),
        robot=name,
        also=tuple(dict.fromkeys([*also, *near])),
        room=room,
        start=start,
        goal=goal,
        plan=plan,
    )


def _planned(room: sim_stage.SimRoom, target: str, spec: RobotSpec, config: PickPlaceConfig) -> tuple[Ends, PickPlan]:
    """Return start and place of an object, and the plan: with a firm grasp wherever there is one, else by sloping faces.

    Raises:
        InputError: there is neither, for the reason that holds with sloping faces, or no start or place.
    """
    known = GraspCache(room.free[target], spec.gripper)

    def planned_with(contact: Contact) -> tuple[Ends, PickPlan]:
        def plan(ends: Ends) -> PickPlan:
            return plan_pick(room, target, *ends, spec, contacts=(contact,), known=known)

        return first_planned(room, target, spec, _ends(room, target, config), plan, contact)

    try:
        return planned_with(FIRM)
    except Unreachable:
        return planned_with(SLOPING)


def neighbours(room: sim_stage.SimRoom, target: str, start: np.ndarray, goal: np.ndarray) -> list[str]:
    """Return the free objects that can move too: those near start or place (7-vectors) of the one that is picked."""
    return [
        i for i, body in room.free.items()
        if i != target and min(np.linalg.norm(np.subtract(body.position, at[:3])) for at in (start, goal)) < NEIGHBOURS
    ]  # fmt: skip


def _ends(room: sim_stage.SimRoom, target: str, config: PickPlaceConfig) -> Iterator[Ends]:
    """Yield where the object may start and where it is to be placed, 7-vectors."""
    if config.start == config.place:
        raise InputError(
            f"task.start and task.place are both {config.place!r}; give the id of a support, a pose or a record"
        )
    here = scanned(room, target)
    if config.start is None or config.start.endswith(".json"):
        (start,) = place_poses(room, target, config.start, here)
        for goal in place_poses(room, target, config.place, start):
            yield start, goal
        return
    goal = next(place_poses(room, target, config.place, here))
    for start in place_poses(room, target, config.start, goal):
        yield start, goal


def trajectory(sim: Simulation, plan: PickPlan, config: PlannerConfig) -> Trajectory:
    """Return the joint targets that do a plan, from home on."""
    found = segments(sim, plan.reach[0], config)
    pick(found, plan, config)
    return found.trajectory(config.start_noise, config.reach_time)


def segments(sim: Simulation, first: np.ndarray, config: PlannerConfig) -> Segments:
    """Return the beginning of a motion in a simulation, at joints [arm]."""
    rate = 1.0 / (sim.config.dt * sim.config.substeps)
    return Segments(first, sim.robot, sim.plan_limits, rate, config.close_time)


def pick(found: Segments, plan: PickPlan, config: PlannerConfig) -> None:
    """Add the segments of a plan to a motion."""
    straight = config.approach_time * LIFT / config.approach
    found.open(plan.opened)
    begin = found.last
    found.between(plan.reach, config.reach_time)
    near = found.last
    found.go(plan.approach, config.approach_time)
    found.close()
    found.go(plan.lift, straight)
    lifted = found.last
    found.between(plan.carry, config.reach_time)
    found.picked = Picked(begin, near, lifted, found.last)
    found.align(np.linalg.inv(plan.grasp))
    found.go(plan.lower, 2.0 * straight)
    found.open(plan.opened)
    found.go(plan.retreat, config.approach_time)
    found.leave_aligned()
    found.open()
    if plan.again is not None:
        found.come_back(plan.again, plan.opened, config.reach_time)
