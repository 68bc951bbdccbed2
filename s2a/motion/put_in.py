"""The skill put in: a part is opened, an object picked and placed in it, the part shut; one base for all of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from s2a import robot as robots
from s2a.core.errors import InputError
from s2a.motion import pick
from s2a.motion.floor import FreeFloor
from s2a.motion.obstacles import Obstacles, moved_room
from s2a.motion.open import drawn_back
from s2a.motion.pick import PickStage
from s2a.motion.pick_plan import BASES, PickPlan, PickTask, plan_pick
from s2a.motion.places import Inside, first_planned, free_object, inside_placements, place_poses
from s2a.motion.search import IK_SEEDS, Follow, Search, Stand, Unreachable, around, chunks
from s2a.motion.segments import Along, Grip, Reach, Release, Segment, Straight, Timeline
from s2a.motion.trajectory import Anchor, PlannerConfig, Trajectory
from s2a.motion.workcell import Workcell
from s2a.robot.collision import Penetration
from s2a.robot.spec import RobotSpec
from s2a.robot.tool_path import ToolPath, matrix, opening_coordinate, part_path
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Mesh
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import DEFAULT_ROBOT, SimRoom
from s2a.sim.room import Workspace
from s2a.sim.simulation import Simulation

PLACEMENTS = 4  # Places in the part that are tried
PLACEMENT_STRIDE = 3  # Of the places, which lie 2 cm apart, every third is tried
BRANCHES = 4  # Joint paths to the handle that are tried from each base


@dataclass(frozen=True)
class PutPlan:
    """A plan to put an object into a part."""

    pick: PickPlan  # how it is picked and placed in the open part, from home on
    goal: np.ndarray  # pose of the object in the open part, 7-vector, scene frame
    inside: Inside  # of the part
    to_shut: np.ndarray  # joints from home to the point of approach to the shut part's handle, shape [pose arm]
    # from there to the handle, with it until the part is open, and back from it; the reverse shuts the part
    handle: np.ndarray
    held: tuple[int, int]  # indices of `handle` between which the gripper holds it
    leave: np.ndarray  # from its end to home
    home: np.ndarray  # from the last pose of `pick` to home
    to_open: np.ndarray  # from home to the end of `handle`, the object in the part


@dataclass(frozen=True)
class PutTask:
    """An object that is put into a part."""

    room: SimRoom  # the room
    target: str  # id of the object
    start: np.ndarray  # where it stands, 7-vector of its body frame, scene frame
    part: str  # id of the part
    opening: float  # coordinate to which this is opened [m] or [rad]
    approach: float  # straight path to the handle, and to the object [m]
    depth: float  # of the grasp of the handle past the grasp point [m]
    floor: FreeFloor | None = None  # as of PickTask


@dataclass(frozen=True, kw_only=True)
class PutStage(PickStage):
    """A free object and the part into which it is put."""

    part: str  # id of the part, the first of `also`
    opened: float  # coordinate at which the object is put in [m] or [rad]
    put: PutPlan  # how the robot does it; `plan` is its part that picks and places

    @property
    def surface(self) -> Mesh:
        """The part's hulls, at zero in the scene frame: the frame of its body."""
        return merge([c.mesh for c in self.room.bodies[self.part].colliders])

    def workspace(self) -> Workspace:
        """Return where the plan, and what moves, pass."""
        put = self.put
        arm = np.concatenate([put.to_shut, put.handle, put.leave, put.home, put.to_open])
        return super().workspace().planned_along(put.pick.passed(robots.load(self.robot), arm), np.zeros((0, 3)))


def read_stage(
    path: Path,
    part: str | None,
    robot: str | None,
    also: Sequence[str],
    config: Any,
    motion: PlannerConfig,
    room: SimRoom | None = None,
    floor: FreeFloor | None = None,
) -> PutStage:
    """Read a room and plan for an object and a part of it, which decides where the robot stands.

    The task's settings are those of `pick.EndsConfig`, and `opening`: the path of the handle [m]. `room` and `floor` are as those
    of `Task.read_stage`.

    Raises:
        InputError: no such object, start or part; the robot cannot do it, with the segment that fails.
    """
    room = room or sim_stage.read(path, visuals=False)
    target, spec = free_object(room, part), robots.load(robot or DEFAULT_ROBOT)
    if config.place not in room.articulations:
        possible = ", ".join(room.articulations) or "none"
        raise InputError(
            f"task.place={config.place} is no articulated part of room {room.name!r}; possible: {possible}"
        )
    into = config.place
    grasp = np.array([*room.articulations[into].grasp.point, 0.0, 0.0, 0.0, 1.0])
    opened = opening_coordinate(room.articulations[into].joint, grasp[:3], config.opening)
    start, put = first_planned(
        room,
        target,
        spec,
        place_poses(room, target, config.start, grasp, leaning=not (config.start_shift or config.start_turn)),
        lambda at: plan_put(PutTask(room, target, at, into, opened, motion.approach, motion.depth, floor), spec),
    )
    stage = pick.of_object(path, room, target, start, put.goal, put.pick, spec, (into, *also))
    return PutStage(**stage, start=start, goal=put.goal, plan=put.pick, part=into, opened=opened, put=put)


def segments(stage: PutStage, settings: PlannerConfig, spec: RobotSpec) -> list[Segment]:
    """Return the segments of a stage's plan."""
    put, (first, last) = stage.put, stage.put.held
    opening = np.linspace(0.0, stage.opened, last - first + 1)
    internal = stage.room.articulations[stage.part].grasp.internal
    hold, release, ready = Grip.on(spec.gripper, internal), Release.of(internal), [Release(0.0)] if internal else []
    back, approach, reach = put.handle[::-1], settings.approach_time, settings.reach_time
    away = len(back) - 1 - first
    return [
        *ready,
        Reach(put.to_shut, reach),
        Straight(put.handle[: first + 1], approach),
        hold,
        Along(put.handle[first : last + 1], settings.pull_time, "open", opening),
        release,
        Straight(put.handle[last:], approach),
        *([Release()] if internal else []),
        Reach(put.leave, reach),
        *pick.segments(put.pick, settings),
        Reach(put.home, reach),
        Reach(put.to_open, reach, "back to the handle"),
        *ready,
        Straight(back[: len(back) - last], approach),
        hold,
        Along(back[len(back) - 1 - last : away + 1], settings.pull_time, "shut", opening[::-1]),
        release,
        Straight(back[away:], approach),
    ]


def trajectory(sim: Simulation, stage: PutStage, settings: PlannerConfig) -> Trajectory:
    """Return the joint targets that do a stage's plan, from home on."""
    put, timing = stage.put, (sim.robot, sim.plan_limits, sim.config.control_frequency, settings.close_time)
    line = Timeline(put.to_shut[0], *timing).add(segments(stage, settings, sim.robot))
    (begin, near), (_, shut) = line.span("back to the handle"), line.span("shut")
    handle = Anchor("handle", begin, near, shut, shut, part=stage.part)
    retry = pick.come_back(put.pick, settings, *timing)
    anchors = (*pick.anchors(line, put.pick, stage.part), handle)
    return line.trajectory(settings.start_noise, settings.reach_time, anchors, retry)


def plan_put(task: PutTask, spec: RobotSpec, seed: int = 0) -> PutPlan:
    """Return how a robot does a task.

    Raises:
        Unreachable: no grasp, base or path was found.
        InputError: the part has no floor for the object.
    """
    last: Unreachable | None = None
    places = inside_placements(task.room, task.target, task.part, task.opening)[::PLACEMENT_STRIDE]
    for goal, inside in places[:PLACEMENTS]:
        planner = PutPlanner(task, goal, inside, spec, seed)
        planner.refuse_without_base()
        try:
            return planner.plan()
        except Unreachable as error:
            last = error
    raise last or Unreachable(f"{task.part!r}: nothing was tried")


class PutPlanner:
    """Base and paths for one place in the part."""

    def __init__(self, task: PutTask, goal: np.ndarray, inside: Inside, spec: RobotSpec, seed: int) -> None:
        """Take what is done, and the pose of the object in the open part, 7-vector."""
        self._task, self._goal, self._inside, self._spec, self._seed = task, goal, inside, spec, seed
        self._about = (task.start[:3] + goal[:3]) / 2
        part, target = task.part, task.target
        self._opened = moved_room(task.room, part, task.opening, {target: task.start})
        done = moved_room(task.room, part, task.opening, {target: goal})
        shut = moved_room(task.room, part, 0.0, {target: task.start})
        self._beside = self._cell(shut, part)
        self._cells = {"shut": self._cell(shut), "open": self._cell(self._opened), "done": self._cell(done)}
        self._search = Search(spec, self._beside.kin, seed)
        self._path = handle_path(task)
        self._handle = Follow("handle", 0, self._path.poses, self._meets, IK_SEEDS, clear=BRANCHES)
        self._handles: dict[bytes, list[np.ndarray]] = {}

    def _cell(self, room: SimRoom, *without: str) -> Workcell:
        return Workcell(self._spec, Obstacles.of_room(room, without, self._about), self._task.floor)

    def _meets(self, stand: Stand, joints: np.ndarray) -> Penetration:
        return self._beside.met(joints, stand.base)

    def refuse_without_base(self) -> None:
        """Raise Unreachable where from no base the arm can open the part: that takes less time than a search for grasps."""
        near, ends = self._cell(self._opened, self._task.target), (matrix(self._task.start), matrix(self._goal))
        if not any(map(self._fits, chunks(around(near, *ends), BASES))):
            raise self._refusal()

    def _refusal(self) -> Unreachable:
        return self._search.unreachable(f"{self._task.target!r} cannot be put into {self._task.part!r} so")

    def plan(self) -> PutPlan:
        """Return the first plan; Unreachable: there is none."""
        t = self._task
        try:
            task = PickTask(self._opened, t.target, t.start, self._goal, t.approach, floor=t.floor)
            picked = plan_pick(task, self._spec, self._seed, self._fits)
        except Unreachable as error:
            nearest = self._search.misses.nearest
            detail = f"; {t.part!r}: {nearest}" if nearest.order >= 0 else ""
            raise Unreachable(f"{error}{detail}") from error
        stand, home = Stand(matrix(picked.base), picked.pedestal), np.array(self._spec.home)
        back = self._move(stand, picked.retreat[-1], home, "done", "return")
        for handle in self._handles[_key(stand)] if back is not None else ():
            moves = (
                (home, handle[0], "shut", "reach of the handle"),
                (handle[-1], home, "open", "return from the handle"),
                (home, handle[-1], "done", "reach of the open handle"),
            )
            paths: list[np.ndarray] = []
            for move in moves:
                path = self._move(stand, *move)
                if path is None:
                    break
                paths.append(path)
            if len(paths) == len(moves) and back is not None:
                to_shut, leave, to_open = paths
                held = (self._path.grasp, len(handle) - 1 - self._path.grasp)
                return PutPlan(picked, self._goal, self._inside, to_shut, handle, held, leave, back, to_open)
        raise self._refusal()

    def _fits(self, stands: list[Stand]) -> list[Stand]:
        """Return the bases from which the arm can open the part, clear of the room; keeps their joint paths."""
        fitting: dict[int, list[np.ndarray]] = {}
        for k, path in self._search.followed(stands, self._handle):
            fitting.setdefault(k, []).append(path)
        self._handles |= {_key(stands[k]): paths for k, paths in fitting.items()}
        return [stands[k] for k in fitting]

    def _move(self, stand: Stand, start: np.ndarray, goal: np.ndarray, room: str, name: str) -> np.ndarray | None:
        """Return a collision-free motion [pose arm] in one of the rooms; None where there is none, which is noted."""
        cell = self._cells[room]
        return self._search.joined(cell, stand, start, goal, cell.empty(stand.base), name, 1)


def handle_path(task: PutTask) -> ToolPath:
    """Return the tool path to the handle, with it to the open part, and straight back from it."""
    articulation = task.room.articulations[task.part]
    grasp = np.array([*articulation.grasp.point, *articulation.grasp.orientation])
    there = part_path(articulation.joint, grasp, task.approach, task.opening, task.depth)
    return drawn_back(articulation.joint, there, 1.0)


def _key(stand: Stand) -> bytes:
    """Return what a base is found by: its position to the millimetre."""
    return np.round(1000 * stand.base[:3, 3]).astype(int).tobytes()
