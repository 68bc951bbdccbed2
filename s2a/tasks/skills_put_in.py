"""The stage of putting an object into a part, and the trajectory that does it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from s2a import robot as robots
from s2a.core.errors import InputError
from s2a.planner.part_plan import PlannerConfig
from s2a.planner.places import first_planned, free_object, place_poses
from s2a.planner.put_in import PutPlan, PutTask, plan_put
from s2a.planner.trajectory import Shutting, Trajectory
from s2a.robot.tool_path import opening_coordinate
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Joint, Mesh
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import DEFAULT_ROBOT
from s2a.sim.nearby import Workspace
from s2a.sim.simulation import Simulation
from s2a.tasks import skills_pick_place as skill

if TYPE_CHECKING:
    from s2a.tasks.put_in import PutInConfig

APPROACH, DEPTH = 0.1, 0.0
"""[m] Straight path to the handle, and how far the grasp is past the grasp point; as conf/planner has them."""


@dataclass(frozen=True, kw_only=True)
class PutStage(skill.PickStage):
    """A free object and the part into which it is put.

    Attributes:
        part: id of the part, the first of `also`.
        opened: coordinate at which the object is put in [m] or [rad].
        put: how the robot does it; `plan` is its part that picks and places.
    """

    part: str
    opened: float
    put: PutPlan

    @property
    def surface(self) -> Mesh:
        """The part's hulls, at zero in the scene frame: the frame of its body."""
        return merge([c.mesh for c in self.room.bodies[self.part].colliders])

    def workspace(self) -> Workspace:
        """Return where the plan, and what moves, pass."""
        put = self.put
        arm = np.concatenate([put.to_shut, put.handle, put.leave, put.home, put.to_open])
        return super().workspace().planned_along(put.pick.passed(robots.load(self.robot), arm), np.zeros((0, 3)))


def read_stage(path: Path, part: str | None, robot: str | None, also: Sequence[str], config: PutInConfig) -> PutStage:
    """Read a room and plan for an object and a part of it, which decides where the robot stands.

    Raises:
        InputError: no such object, start or part; the robot cannot do it, with the segment that fails.
    """
    room = sim_stage.read(path, visuals=False)
    target, name = free_object(room, part), robot or DEFAULT_ROBOT
    if config.place not in room.articulations:
        known = ", ".join(room.articulations) or "none"
        raise InputError(f"task.place={config.place} is no articulated part of room {room.name!r}; possible: {known}")
    into = config.place
    grasp = np.array([*room.articulations[into].grasp.point, 0.0, 0.0, 0.0, 1.0])
    opened = opening_coordinate(room.articulations[into].joint, grasp[:3], config.opening)
    spec = robots.load(name)
    start, put = first_planned(
        room,
        target,
        spec,
        place_poses(room, target, config.start, grasp),
        lambda start: plan_put(PutTask(room, target, start, into, opened, APPROACH, DEPTH), spec),
    )
    near = skill.neighbours(room, target, start, put.goal)
    surface = merge([c.mesh for c in room.free[target].colliders])
    return PutStage(
        path=path,
        target=target,
        joint=Joint("prismatic", (1.0, 0.0, 0.0), tuple(start[:3]), (0.0, 1.0)),
        base=put.pick.base,
        grasp=start,
        grasp_size=np.ptp(surface.vertices, axis=0),
        region=surface,
        pedestal=(put.pick.pedestal, spec.base.radius),
        robot=name,
        also=tuple(dict.fromkeys([into, *also, *near])),
        room=room,
        start=start,
        goal=put.goal,
        plan=put.pick,
        part=into,
        opened=opened,
        put=put,
    )


def trajectory(sim: Simulation, stage: PutStage, config: PlannerConfig) -> Trajectory:
    """Return the joint targets that do a stage's plan, from home on."""
    put, (first, last) = stage.put, stage.put.held
    opening = np.linspace(0.0, stage.opened, last - first + 1)
    internal = stage.room.articulations[stage.part].grasp.internal
    found = skill.segments(sim, put.to_shut[0], config)
    if internal:
        found.release(internal)
    found.between(put.to_shut, config.reach_time)
    found.go(put.handle[: first + 1], config.approach_time)
    found.hold(internal)
    found.go(put.handle[first : last + 1], config.pull_time, opening)
    found.release(internal)
    found.go(put.handle[last:], config.approach_time)
    if internal:
        found.open()
    found.between(put.leave, config.reach_time)
    skill.pick(found, put.pick, config)
    found.between(put.home, config.reach_time)
    begin = found.last
    found.between(put.to_open, config.reach_time)
    near = found.last
    back = put.handle[::-1]
    first, last = len(back) - 1 - last, len(back) - 1 - first
    if internal:
        found.release(internal)
    found.go(back[: first + 1], config.approach_time)
    found.hold(internal)
    found.go(back[first : last + 1], config.pull_time, opening[::-1])
    found.shutting = Shutting(stage.part, begin, near, found.last)
    found.release(internal)
    found.go(back[last:], config.approach_time)
    return found.trajectory(config.start_noise, config.reach_time)
