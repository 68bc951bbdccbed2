"""The skills open and close: a part is moved by its handle, or pushed; base, joint path and targets over time."""

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from s2a import robot as robots
from s2a.core.errors import InputError
from s2a.motion import trajectory as pull_law
from s2a.motion.obstacles import Obstacles, moved_room
from s2a.motion.search import Search
from s2a.motion.segments import SETTLE, Along, Grip, Reach, Release, Segment, Straight, Timeline
from s2a.motion.trajectory import Demonstration, PlannerConfig, Progress, Trajectory, eased, timed
from s2a.motion.workcell import MovingPart, Workcell, lines, noisy_starts
from s2a.robot.collision import SLACK
from s2a.robot.kinematics import Kinematics, kinematics
from s2a.robot.spec import RobotSpec
from s2a.robot.tool_path import (
    ASKED,
    PathSettings,
    ToolPath,
    follow,
    matrix,
    opening_coordinate,
    part_path,
    slipping,
    straight,
    variants,
)
from s2a.robot.urdf import position_limits
from s2a.scene.articulation import displace, transform
from s2a.scene.scene import Joint
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage

_log = logging.getLogger(__name__)
Skill = Callable[[SimStage, PathSettings], ToolPath]  # A task's tool path in a stage: `Task.tool_path` of its settings
PATHS = 16  # Joint paths from a given base that are checked
# [m] That searches for a motion to the point of approach keep, less SLACK, each of its own seed, until one is found:
# the arm lags behind the motion and cuts its corners, by 25 mm before an open door
CLEARANCES = 0.025, 0.01, 0.0, 0.0
# [m] Between a finger and the handle, whose hull may bulge by so much, where an episode starts in the grip
MARGIN = 0.002
SAME_GOAL = 1e-3  # [m] By which the goal of a pull law may be off the end of the path
GRAVITY = 9.81  # [m/s^2]
TURN = math.radians(0.5)  # [rad] Between coordinates at which the weight's moment is looked at
# Fractions of `planner.approach` by which the gripper comes straight to the handle, and draws back from it, and of
# `planner.opening`, tried in this order: bases are for opening what is shut, and an open part may be too near to the
# robot for all of it
LET_GO = ((1.0, 1.0, 1.0), (1.0, 0.5, 1.0), (1.0, 0.5, 0.8), (0.5, 0.5, 1.0), (1.0, 0.0, 1.0), (0.5, 0.0, 1.0))


def opening_path(stage: SimStage, motion: PathSettings, config: object = None) -> ToolPath:  # noqa: ARG001
    """Return the tool path that opens a stage's part by `motion.opening` [m], or by 95 % of its travel."""
    end = opening_coordinate(stage.joint, stage.grasp[:3], motion.opening)
    return part_path(stage.joint, stage.grasp, motion.approach, end, motion.depth)


def closing_path(stage: SimStage, motion: PathSettings, config: Any) -> ToolPath:
    """Return the tool path that grasps the part where it stands open, or has fallen by its weight, and closes it.

    It stands open by `config.start_opening` [m] at first. Where the stage says how to push it, the path pushes.
    """
    start = at_rest(stage, opening_coordinate(stage.joint, stage.grasp[:3], config.start_opening))
    if stage.push is not None:
        return replace(part_path(stage.joint, stage.push, motion.approach, 0.0, start=start), pushes=True)
    return part_path(stage.joint, stage.grasp, motion.approach, 0.0, motion.depth, start)


def at_rest(stage: SimStage, coordinate: float) -> float:
    """Return the coordinate [m] or [rad] at which a stage's part comes to rest that is let go at one.

    It moves where its weight exceeds its dry friction, until that holds it, or to the end of its range. What else draws it,
    such as a spring, is not known here; nor does momentum carry it past its rest.
    """
    joint, part = stage.joint, stage.room.articulations[stage.target]
    friction = part.friction + (part.resistance.breakaway if part.resistance else 0.0)
    if joint.kind == "prismatic":
        force = -_weight(stage) * joint.axis[2]
        return coordinate if abs(force) <= friction else joint.limits[int(force > 0.0)]
    sense = math.copysign(1.0, _moment(stage, coordinate))
    while sense * _moment(stage, coordinate) > friction:
        following = coordinate + sense * TURN
        if not joint.limits[0] < following < joint.limits[1]:
            return joint.limits[int(sense > 0.0)]
        coordinate = following
    return coordinate


def _weight(stage: SimStage) -> float:
    """Return the weight of a stage's part [N]."""
    return GRAVITY * stage.room.bodies[stage.target].mass.mass


def _moment(stage: SimStage, coordinate: float) -> float:
    """Return the moment of the weight of a hinged part about its axis at a coordinate [N m]."""
    center = displace(np.array([stage.room.bodies[stage.target].mass.center]), stage.joint, coordinate)[0]
    arm = np.cross(stage.joint.axis, center - np.array(stage.joint.origin))
    return -_weight(stage) * float(arm[2])


def segments(
    sim: Simulation, path: ToolPath, arm: np.ndarray, settings: PlannerConfig, detour: np.ndarray | None, last: int
) -> list[Segment]:
    """Return the segments that move a part.

    Args:
        sim: whose robot and stage.
        path: of the tool.
        arm: joint path that follows it [pose arm].
        settings: times.
        detour: joints from home to the first of `arm`, shape [pose arm]; None: nothing is in the way.
        last: index of the pose at which the gripper lets go; the last one: it does not.
    """
    gripper, internal = sim.robot.gripper, sim.stage.internal
    held, q = arm[path.grasp : last + 1], path.q[path.grasp : last + 1]
    seconds, progress = _pull_time(sim, path, held, settings)
    release: list[Segment] = [Release.of(internal), Straight(arm[last:], settings.approach_time)]
    return [
        *([] if detour is None else [Reach(detour, settings.reach_time)]),
        Straight(arm[: path.grasp + 1], settings.approach_time, "approach"),
        *([] if path.pushes else [Grip.on(gripper, internal)]),
        Along(held, seconds, "pull", q, progress),
        *(release if last < len(arm) - 1 else []),
    ]


def plan(sim: Simulation, settings: PlannerConfig, tool_path: Skill) -> Trajectory:
    """Return the trajectory that does a task in a simulation's stage; InputError: out of reach."""
    path, arm = planned_path(sim, settings, tool_path)
    return _trajectory(sim, path, arm, settings, len(arm) - 1, settle=0.0)


def _trajectory(
    sim: Simulation, path: ToolPath, arm: np.ndarray, settings: PlannerConfig, last: int, settle: float = SETTLE
) -> Trajectory:
    """Return the segments in time; `settle`: that the arm stands after it has moved [s]."""
    opened = 0.0 if path.pushes or sim.stage.internal else None
    detour = reach_around(sim.stage, sim.robot, arm[0], float(path.q[0]), settings, opened)
    line = Timeline(
        arm[0] if detour is None else detour[0],
        sim.robot,
        sim.plan_limits,
        sim.config.control_frequency,
        settings.close_time,
        closed=opened is not None,
        part=float(path.q[0]),
        settle=settle,
    ).add(segments(sim, path, arm, settings, detour, last))
    trajectory = line.trajectory(settings.start_noise, settings.reach_time)
    return replace(trajectory, closed=line.span("approach")[1] + 1) if path.pushes else trajectory


def _pull_time(sim: Simulation, path: ToolPath, arm: np.ndarray, settings: PlannerConfig) -> tuple[float, Progress]:
    """Return how long a pull along a joint path [pose arm] takes [s], and its progress: the planner's own, or a law's."""
    if settings.pull_law is None:
        return settings.pull_time, eased
    law = pull_law.read(settings.pull_law)
    length = abs(float(path.q[-1] - path.q[path.grasp])) * sim.stage.lever_arm
    if abs(length - law.goal) > SAME_GOAL:
        raise InputError(
            f"{settings.pull_law}: a law for a pull of {law.goal:.3f} m; this one is {length:.3f} m long; give "
            "planner.opening, or make a law for this part"
        )
    frequency = sim.config.control_frequency
    steps = len(timed(arm, law.seconds, sim.plan_limits, frequency, law.progress))
    if steps > math.ceil(law.seconds * frequency):
        text = "%s: the robot's limits stretch the pull from %.2f to %.2f s"
        _log.warning(text, settings.pull_law, law.seconds, steps / frequency)
    return law.seconds, law.progress


def demonstration(sim: Simulation, settings: PlannerConfig, tool_path: Skill) -> Demonstration:
    """Return the planned motion as one on which episodes start.

    The fingers stand open until the part moves, then MARGIN off what they hold, on which they close at once; those that hold a
    pocket from within stand closed, then MARGIN off its walls.

    Raises:
        InputError: the arm cannot reach along the whole path.
    """
    trajectory, arm = plan(sim, settings, tool_path), len(sim.robot.arm_joints)
    positions = np.concatenate([trajectory.targets, trajectory.part[:, None]], axis=1)
    opened = position_limits(sim.robot)[1][arm:]
    held = sim.robot.gripper.coordinate(sim.stage.grasp_size[1] + 2 * MARGIN)
    if trajectory.targets[:, arm:].any():  # what pushes is closed all the time
        before, after = (0.0, held_from_within(sim)) if sim.stage.internal else (opened, np.minimum(held, opened))
        positions[: trajectory.closed, arm:-1] = before
        positions[trajectory.closed :, arm:-1] = after
    return Demonstration(trajectory.targets, positions, trajectory.closed)


def held_from_within(sim: Simulation) -> float:
    """Return the finger joints' coordinate at which they are MARGIN off the walls of the pocket that they hold [m or rad]."""
    gripper = sim.robot.gripper
    return gripper.coordinate(float(sim.stage.grasp_size[1]) - 2 * (gripper.finger_box[1] + MARGIN))


@dataclass(frozen=True)
class LettingGo:
    """The motion of a task that moves a part: grasp, move, let go, draw back."""

    demonstration: Demonstration  # its targets, as the policy takes them
    arm: np.ndarray  # its joint path, shape [pose arm]
    approach: float  # straight path to the handle [m]
    retreat: float  # that back from it [m]


def plan_letting_go(sim: Simulation, settings: PlannerConfig, tool_path: Skill) -> LettingGo:
    """Return the motion that does a task and lets go of the handle, with the first fractions of LET_GO that the arm reaches.

    Raises:
        InputError: the arm cannot reach along the path.
    """
    first: InputError | None = None
    for ahead, back, opening in LET_GO:
        shorter = replace(settings, approach=ahead * settings.approach, opening=opening * settings.opening)
        try:
            path, arm = planned_path(sim, shorter, partial(_with_retreat, tool_path, back), exact=opening < 1.0)
        except InputError as error:
            first = first or error
            continue
        count = round(back * path.grasp)
        trajectory = _trajectory(sim, path, arm, shorter, len(arm) - 1 - count)
        positions = np.concatenate([trajectory.targets, trajectory.part[:, None]], axis=1)
        motion = Demonstration(trajectory.targets, positions, trajectory.closed)
        return LettingGo(motion, arm, shorter.approach, shorter.approach * count / max(1, path.grasp))
    assert first is not None, "there are fractions to try"
    raise first


def _with_retreat(tool_path: Skill, fraction: float, stage: SimStage, settings: PathSettings) -> ToolPath:
    return drawn_back(stage.joint, tool_path(stage, settings), fraction)


def drawn_back(joint: Joint, path: ToolPath, fraction: float) -> ToolPath:
    """Return a tool path, and after it a fraction of the approach backwards, from where the part of a joint was moved to."""
    moved = transform(joint, float(path.q[-1])) @ np.linalg.inv(transform(joint, float(path.q[path.grasp])))
    back = moved @ path.poses[: path.grasp][::-1][: round(fraction * path.grasp)]
    poses, q = np.concatenate([path.poses, back]), np.append(path.q, np.full(len(back), path.q[-1]))
    return replace(path, poses=poses, q=q)


def planned_path(
    sim: Simulation, settings: PlannerConfig, tool_path: Skill, *, exact: bool = False
) -> tuple[ToolPath, np.ndarray]:
    """Return a task's tool path in a simulation's stage and a joint path [pose arm] that follows it; InputError: out of reach.

    Where the arm meets something on all paths that are asked for, or reaches along none, the first other variant is taken on
    which it meets nothing; `exact`: none is, nor with a pull law, which is made for one path.
    """
    kin, stage = kinematics(sim.robot), sim.stage
    only = exact or settings.pull_law is not None
    best: tuple[ToolPath, np.ndarray] | None = None
    failure: InputError | None = None
    tried: list[ToolPath] = []
    for variant in [ASKED] if only else variants(stage.joint, stage.grasp, internal=stage.internal):
        path = variant_path(stage, settings, tool_path, variant)
        if any(np.array_equal(path.poses, other.poses) for other in tried):
            continue
        tried.append(path)
        try:
            paths = joint_paths(kin, stage, path, settings)
        except InputError as error:
            failure = failure or error
            continue
        depth, index = most_clear(stage, sim.robot, paths, path)
        if variant == ASKED or depth <= SLACK:
            best = path, paths[index]
        if depth <= SLACK:
            break
    if best is None:
        assert failure is not None, "there are variants to try"
        raise failure
    asked, moved = (abs(float(p.q[-1] - p.q[p.grasp])) * stage.lever_arm for p in (tried[0], best[0]))
    if moved < asked:
        text = "%s: %s is moved by %.2f m instead of %.2f m: farther, the arm collides or cannot reach"
        _log.warning(text, stage.path, stage.target, moved, asked)
    return best


def variant_path(stage: SimStage, settings: PlannerConfig, tool_path: Skill, variant: tuple[float, float]) -> ToolPath:
    """Return a task's tool path in a stage with a variant's fractions of the opening and of the handle's turn."""
    opening, slip = variant
    path = tool_path(stage, replace(settings, opening=opening * settings.opening))
    return slipping(path, stage.joint, slip, settings.depth)


def joint_paths(kin: Kinematics, stage: SimStage, path: ToolPath, settings: PlannerConfig) -> np.ndarray:
    """Return the joint paths along a tool path, shape [path pose arm], the best first.

    They are ordered by how far they keep from the joint limits and how near home they begin.

    Raises:
        InputError: there is none.
    """
    (paths,) = follow(kin, path.poses, matrix(stage.base)[None], settings.ik_seeds, settings.seed)
    if not len(paths):
        raise InputError(
            f"{stage.path}: the arm cannot follow part {stage.target!r} from its base at {np.round(stage.base[:3], 2)} m; "
            f"give search_base=true to s2a evaluate, or prepare the stage again, with robot={stage.robot}"
        )
    distance = np.abs(paths[:, 0] - np.array(kin.spec.home)).max(axis=1)
    margin = np.minimum(paths - kin.lower, kin.upper - paths).min(axis=(1, 2))
    jump = np.abs(np.diff(paths, axis=1)).max(axis=(1, 2))
    return paths[np.argsort(distance + jump - 2.0 * np.clip(margin, 0.0, 0.2), kind="stable")]


def most_clear(stage: SimStage, spec: RobotSpec, paths: np.ndarray, path: ToolPath) -> tuple[float, int]:
    """Return how deep a joint path of several [path pose arm] reaches into things [m], and its index.

    It is the first path that meets nothing, else the least deep one. What is on the way to a path has no share in its depth.

    What it meets itself weighs more than what is on the way to it, which may be led around. The arm turns all joints evenly from
    home to a path's first pose, where nothing may touch; from there on the gripper and the part move together, and the rest of
    the arm may not touch that either.
    """
    base, part, home = matrix(stage.base), moving_part(stage), np.array(spec.home)
    still, start = Workcell(spec, beside_part(stage, stage.also)), Workcell(spec, room_around(stage, float(path.q[0])))
    best = (np.inf, np.inf, 0)
    for k, joints in enumerate(paths[:PATHS]):
        reach = straight(home, joints[0])
        own, _ = still.met(joints, base, part, path.q)
        on_the_way = max(float(start.arm_depth(reach, base).max()), still.shape.self_penetration(reach)[0])
        if max(own, on_the_way) <= SLACK:
            return own, k
        best = min(best, (max(own, SLACK), on_the_way, k))
    return best[0], best[2]


def moving_part(stage: SimStage) -> MovingPart:
    """Return a stage's part alone, as scanned."""
    room, target = stage.room, stage.target
    alone = replace(room, bodies={target: room.bodies[target]}, articulations={}, free={}, static_colliders=())
    return MovingPart(stage.joint, Obstacles.of_room(alone, (), stage.grasp[:3]))


def beside_part(stage: SimStage, without: Sequence[str] = (), about: np.ndarray | None = None) -> Obstacles:
    """Return the hulls about a point [3], the handle by default, but for the part's, those of what hangs on it, and of others."""
    riders = {i for i in stage.room.articulations if stage.target in stage.room.carriers(i)}
    beside = Obstacles.of_room(
        stage.room, {stage.target, *riders, *without}, stage.grasp[:3] if about is None else about
    )
    drives = about is None and robots.load(stage.robot).drive is not None
    return _with_base(beside, stage) if drives else beside


def room_around(stage: SimStage, q: float) -> Obstacles:
    """Return the hulls around a stage's part, which stands at a coordinate, and the robot's pedestal."""
    room = moved_room(stage.room, stage.target, q, {})
    return _with_base(Obstacles.of_room(room, (), stage.grasp[:3]), stage)


def _with_base(obstacles: Obstacles, stage: SimStage) -> Obstacles:
    """Return obstacles and what the robot stands on: its own base where that drives, else its pedestal."""
    drive = robots.load(stage.robot).drive
    if drive is None:
        return obstacles.with_column(stage.base[:3], *stage.pedestal)
    return obstacles.with_base(drive, matrix(stage.base), stage.pedestal[0])


def reach_around(
    stage: SimStage, spec: RobotSpec, first: np.ndarray, q: float, settings: PlannerConfig, opened: float | None = None
) -> np.ndarray | None:
    """Return joints [pose arm] from home to `first` [arm] around a part at a coordinate, and around the room.

    The pads are `opened` apart [m]; None: fully open.
    None where the straight lines from all starts are free, or no motion was found.
    """
    cell, home = Workcell(spec, room_around(stage, q)), np.array(spec.home)
    depth = cell.empty(matrix(stage.base), opened)
    if cell.all_free(depth, lines(noisy_starts(spec, settings.start_noise, settings.seed), first)):
        return None
    search = Search(spec, cell.kin, settings.seed)
    motions = (search.moved(cell, home, first, depth, more, again) for again, more in enumerate(CLEARANCES))
    return next((path for path in motions if path is not None), None)
