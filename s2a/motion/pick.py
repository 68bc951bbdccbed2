"""The skill pick and place: the stage of a free object, its plan, and the segments that do it."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from s2a import robot as robots
from s2a.core.errors import InputError
from s2a.motion.far import is_far, plan_far
from s2a.motion.floor import FreeFloor
from s2a.motion.grasps import DRIVEN, GraspCache, Ungraspable
from s2a.motion.gripper import FIRM, SLOPING, Contact
from s2a.motion.obstacles import surface_points
from s2a.motion.pick_plan import LIFT, PickPlan, PickTask, plan_pick
from s2a.motion.places import first_planned, free_object, near_support, place_poses, scanned
from s2a.motion.search import Unreachable
from s2a.motion.segments import SETTLE, Carry, Drive, Grip, Reach, Release, Segment, Straight, Timeline, Wait
from s2a.motion.trajectory import Anchor, PlannerConfig, Retry, Trajectory
from s2a.robot.spec import JointLimits, RobotSpec
from s2a.robot.tool_path import matrix
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Joint
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import DEFAULT_ROBOT, SimRoom
from s2a.sim.room import Workspace
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage

Plan = TypeVar("Plan")
Ends = tuple[np.ndarray, np.ndarray]  # Start and place of an object's body frame, 7-vectors, scene frame
NEIGHBOURS = 0.4  # [m] From start or place: free objects up to there can move
# [s] In which the arm corrects how an object has slipped in the gripper: a few degrees and millimetres,
# seldom 20 and 50
ALIGN = 1.0


class EndsConfig(Protocol):
    """The settings of a task that say where an object starts and where it is placed; see `places.place_poses`."""

    start: str | None
    place: str | None
    start_shift: float
    start_turn: float


@dataclass(frozen=True, kw_only=True)
class PickStage(SimStage):
    """A free object of a room as the target of a robot; `joint` stands for the first coordinate of its free joint."""

    start: np.ndarray  # of the object's body frame, 7-vector, scene frame
    goal: np.ndarray  # likewise
    plan: PickPlan  # how the robot picks and places it

    def workspace(self) -> Workspace:
        """Return where the plan, and what lies free, pass."""
        surface = surface_points([c.mesh for c in self.room.free[self.target].colliders])
        ends = [surface @ at[:3, :3].T + at[:3, 3] for at in (matrix(self.start), matrix(self.goal))]
        passed = self.plan.swept(robots.load(self.robot), surface)
        return super().workspace().planned_along(passed, np.concatenate(ends))


def read_stage(
    path: Path,
    part: str | None,
    robot: str | None,
    also: Sequence[str],
    config: EndsConfig,
    motion: PlannerConfig,
    room: SimRoom | None = None,
    floor: FreeFloor | None = None,
) -> PickStage:
    """Read a room and plan for an object of it, which decides where the robot stands.

    `room` and `floor` are as those of `Task.read_stage`.

    Raises:
        InputError: no such object, start or place; the robot cannot do it, with the segment that fails.
    """
    room = room or sim_stage.read(path, visuals=False)
    target, spec = free_object(room, part), robots.load(robot or DEFAULT_ROBOT)
    grasps = GraspCache(room.free[target], spec.gripper, work=None if floor is None else DRIVEN)

    failures: list[Unreachable] = []
    # Poses at which no grasp is clear, wherever the other end is
    crowded: list[tuple[Contact, np.ndarray, Unreachable]] = []

    def plan_with(ends: Ends, contact: Contact) -> PickPlan:
        if grasps.spend():
            raise failures[-1] if failures else Unreachable(f"{target!r}: {grasps.ended}")
        poses = [matrix(each) for each in ends]
        for held, at, error in crowded:
            if held == contact and any(np.array_equal(pose, at) for pose in poses):
                raise error
        try:
            task = PickTask(room, target, *ends, motion.approach, motion.start_noise, floor)
            if floor is not None and is_far(task, spec):
                return plan_far(task, spec, contact, grasps)
            try:
                return plan_pick(task, spec, contacts=(contact,), grasps=grasps)
            except Unreachable:
                if floor is None:
                    raise
                return plan_far(task, spec, contact, grasps)
        except Unreachable as error:
            failures.append(error)
            if error.crowded is not None:
                crowded.append((contact, error.crowded, error))
            raise

    try:
        (start, goal), plan = firmest(room, target, spec, kept(_ends(room, target, config, floor)), plan_with)
    except Unreachable as error:  # of the first ends, for which there may have been work and time enough
        if not grasps.ended or isinstance(error, Ungraspable) or grasps.ended in str(error):
            raise
        raise Unreachable(f"{error} ({grasps.ended})") from error
    return PickStage(**of_object(path, room, target, start, goal, plan, spec, also), start=start, goal=goal, plan=plan)


def of_object(
    path: Path,
    room: SimRoom,
    target: str,
    start: np.ndarray,
    goal: np.ndarray,
    plan: PickPlan,
    spec: RobotSpec,
    also: Sequence[str],
) -> dict[str, Any]:
    """Return the fields of a SimStage for an object of a room that starts and is placed at poses (7-vectors) by a plan."""
    surface = merge([c.mesh for c in room.free[target].colliders])
    near = [
        i for i, body in room.free.items()
        if i != target and min(np.linalg.norm(np.subtract(body.position, at[:3])) for at in (start, goal)) < NEIGHBOURS
    ]  # fmt: skip
    return {
        "path": path,
        "target": target,
        "joint": Joint("prismatic", (1.0, 0.0, 0.0), tuple(start[:3]), (0.0, 1.0)),
        "base": plan.base,
        "grasp": start,
        "grasp_size": np.ptp(surface.vertices, axis=0),
        "region": surface,
        "pedestal": (plan.pedestal, spec.base.radius),
        "robot": spec.name,
        "also": tuple(dict.fromkeys([*also, *near])),
        "room": room,
    }


def firmest(
    room: SimRoom,
    target: str,
    spec: RobotSpec,
    ends: Callable[[], Iterable[Ends]],
    plan: Callable[[Ends, Contact], Plan],
) -> tuple[Ends, Plan]:
    """Return start and place of an object, and the plan: with a firm grasp wherever there is one, else by sloping faces.

    Raises:
        InputError: there is neither, for the reason that holds with sloping faces, or no start or place.
    """
    try:
        return first_planned(room, target, spec, ends(), lambda each: plan(each, FIRM), FIRM)
    except Unreachable:
        return first_planned(room, target, spec, ends(), lambda each: plan(each, SLOPING), SLOPING)


def kept(items: Iterator[Ends]) -> Callable[[], Iterator[Ends]]:
    """Return what iterates over the same items each time it is called; each is made once, when it is first asked for."""
    made: list[Ends] = []

    def every() -> Iterator[Ends]:
        yield from made
        for item in items:
            made.append(item)
            yield item

    return every


def _ends(room: SimRoom, target: str, config: EndsConfig, floor: FreeFloor | None) -> Iterator[Ends]:
    """Yield where the object may start and where it is to be placed, 7-vectors."""
    if config.start == config.place:
        raise InputError(
            f"task.start and task.place are both {config.place!r}; give the id of a support, a pose or a record"
        )
    here = scanned(room, target)
    if config.start is None or config.start.endswith(".json"):
        (start,) = place_poses(room, target, config.start, here)
        about = start if floor is None else near_support(room, config.place, start)
        for goal in place_poses(room, target, config.place, about):
            yield start, goal
        return
    goal = next(place_poses(room, target, config.place, here))
    for start in place_poses(room, target, config.start, goal, leaning=not (config.start_shift or config.start_turn)):
        yield start, goal


def segments(plan: PickPlan, settings: PlannerConfig) -> list[Segment]:
    """Return the segments of a plan."""
    straight = settings.approach_time * LIFT / settings.approach
    driven: list[Segment] = []
    if plan.driven is not None:
        driven = [Drive(plan.driven.route), Carry(plan.driven.carry, settings.reach_time)]
    return [
        Release(plan.opened),
        Reach(plan.reach, settings.reach_time, "reach"),
        Straight(plan.approach, settings.approach_time),
        Grip(0.0),
        Straight(plan.lift, straight),
        Carry(plan.carry, settings.reach_time, "carry"),
        *driven,
        Wait(ALIGN, "align"),
        Wait(SETTLE),
        Straight(plan.lower, 2.0 * straight),
        Release(plan.opened),
        Straight(plan.retreat, settings.approach_time, "retreat"),
        Release(),
    ]


def anchors(line: Timeline, plan: PickPlan, part: str = "") -> tuple[Anchor, Anchor]:
    """Return where the gripper moves along with the object at its start, and with how it is held, in a timeline with `segments`.

    Its place may be in a part, which may not be where it was planned to be.
    """
    (begin, near), (lifted, above) = line.span("reach"), line.span("carry")
    (seen, ready), (_, released) = line.span("align"), line.span("retreat")
    held = Anchor("held", seen, ready, released, released + ready - seen, np.linalg.inv(plan.grasp), part)
    return Anchor("object", begin, near, lifted, above), held


def trajectory(sim: Simulation, plan: PickPlan, settings: PlannerConfig) -> Trajectory:
    """Return the joint targets that do a plan, from home on."""
    return trajectory_of(plan, settings, sim.robot, sim.plan_limits, sim.config.control_frequency)


def trajectory_of(
    plan: PickPlan, settings: PlannerConfig, spec: RobotSpec, limits: JointLimits, frequency: float
) -> Trajectory:
    """Return the joint targets that do a plan with a robot that keeps limits, at a control frequency [Hz]."""
    timing = (spec, limits, frequency, settings.close_time)
    base = plan.driven.route[0] if plan.driven else None
    line = Timeline(plan.reach[0], *timing, base=base).add(segments(plan, settings))
    retry = come_back(plan, settings, *timing)
    return line.trajectory(settings.start_noise, settings.reach_time, anchors(line, plan), retry)


def come_back(
    plan: PickPlan, settings: PlannerConfig, spec: RobotSpec, limits: JointLimits, frequency: float, close_time: float
) -> Retry | None:
    """Return the motion back for an object that slipped out; None where there is none."""
    if plan.again is None:
        return None
    line = Timeline(plan.again[0], spec, limits, frequency, close_time, closed=True)
    line.add([Release(plan.opened), Wait(SETTLE, "see"), Reach(plan.again, settings.reach_time)])
    return Retry(line.targets, line.span("see")[1])
