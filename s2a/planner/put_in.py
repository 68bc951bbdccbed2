"""Putting an object into a part: open it, pick, place, shut it; one base, and a joint path for every segment."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.planner.free_motion import free_motion
from s2a.planner.insides import Inside, inside_placements, moved_room
from s2a.planner.misses import Misses, Unreachable
from s2a.planner.object_grasps import matrix
from s2a.planner.obstacles import RoomHulls
from s2a.planner.pick_base import arm_depth, bases, chunks
from s2a.planner.pick_place import BASES, IK_SEEDS, plan_pick
from s2a.planner.pick_plan import PickPlan
from s2a.robot.collision import SLACK, robot_shape
from s2a.robot.spec import RobotSpec
from s2a.robot.tool_path import ToolPath, follow, part_path
from s2a.scene.articulation import transform
from s2a.scene.usd.sim_scene import SimRoom

PLACEMENTS = 4
"""Places in the part that are tried."""
PLACEMENT_STRIDE = 3
"""Of the places, which lie 2 cm apart, every third is tried."""
Based = tuple[np.ndarray, float]
"""Pose [4 4] of a base and height of its pedestal [m]."""


@dataclass(frozen=True)
class PutPlan:
    """A way to put an object into a part.

    Attributes:
        pick: how it is picked and placed in the open part, from home on.
        goal: pose of the object in the open part, 7-vector, scene frame.
        inside: of the part.
        to_shut: joints from home to the point of approach to the shut part's handle, shape [pose arm].
        handle: from there to the handle, with it until the part is open, and back from it; the reverse shuts the part.
        held: indices of `handle` between which the gripper holds it.
        leave: from its end to home.
        home: from the last pose of `pick` to home.
        to_open: from home to the end of `handle`, the object in the part.
    """

    pick: PickPlan
    goal: np.ndarray
    inside: Inside
    to_shut: np.ndarray
    handle: np.ndarray
    held: tuple[int, int]
    leave: np.ndarray
    home: np.ndarray
    to_open: np.ndarray


@dataclass(frozen=True)
class PutTask:
    """What is to be done.

    Attributes:
        room: the room.
        target: id of the object.
        start: where it stands, 7-vector of its body frame, scene frame.
        part: id of the part.
        opening: coordinate to which this is opened [m] or [rad].
        approach: straight path to the handle [m].
        depth: of the grasp past the grasp point [m].
    """

    room: SimRoom
    target: str
    start: np.ndarray
    part: str
    opening: float
    approach: float
    depth: float


def plan_put(task: PutTask, spec: RobotSpec, seed: int = 0) -> PutPlan:
    """Return how a robot does a task.

    Raises:
        Unreachable: no grasp, base or path was found.
        InputError: the part has no floor for the object.
    """
    last: Unreachable | None = None
    for goal, inside in inside_placements(task.room, task.target, task.part, task.opening)[::PLACEMENT_STRIDE][
        :PLACEMENTS
    ]:
        search = _Search(task, goal, inside, spec, seed)
        search.refuse_without_base()
        try:
            return search.plan()
        except Unreachable as error:
            last = error
    raise last or Unreachable(f"{task.part!r}: nothing was tried")


class _Search:
    """The search for one place in the part."""

    def __init__(self, task: PutTask, goal: np.ndarray, inside: Inside, spec: RobotSpec, seed: int) -> None:
        self._task, self._goal, self._inside, self._spec, self._seed = task, goal, inside, spec, seed
        self._shape, self._misses = robot_shape(spec), Misses()
        part, about = task.part, (task.start[:3] + goal[:3]) / 2
        self._opened = moved_room(task.room, part, task.opening, {task.target: task.start})
        done = moved_room(task.room, part, task.opening, {task.target: goal})
        closed = moved_room(task.room, part, 0.0, {task.target: task.start})
        self._around = RoomHulls(closed, {part}, about)
        self._rooms = {"closed": RoomHulls(closed, (), about), "open": RoomHulls(self._opened, (), about),
                       "done": RoomHulls(done, (), about)}  # fmt: skip
        self._path = handle_path(task)
        self._handles: dict[bytes, list[np.ndarray]] = {}

    def refuse_without_base(self) -> None:
        """Raise Unreachable where from no base the arm can open the part: that takes less time than a search for grasps."""
        t, ends = self._task, (matrix(self._task.start), matrix(self._goal))
        near = RoomHulls(self._opened, {t.target}, (t.start[:3] + self._goal[:3]) / 2)
        if not any(map(self._fits, chunks(bases(self._shape, near, *ends), BASES))):
            raise Unreachable(f"{t.target!r} cannot be put into {t.part!r} so: {self._misses.text}")

    def plan(self) -> PutPlan:
        """Return the first plan found."""
        t = self._task
        try:
            pick = plan_pick(self._opened, t.target, t.start, self._goal, self._spec, self._seed, self._fits)
        except Unreachable as error:
            detail = f"; {t.part!r}: {self._misses.text}" if self._misses.stage >= 0 else ""
            raise Unreachable(f"{error}{detail}") from error
        base, home = matrix(pick.base), np.array(self._spec.home)
        back = self._move(pick.retreat[-1], home, base, "done", "return")
        for handle in self._handles[_key(base)]:
            to_shut = self._move(home, handle[0], base, "closed", "reach of the handle")
            leave = None if to_shut is None else self._move(handle[-1], home, base, "open", "return from the handle")
            to_open = None if leave is None else self._move(home, handle[-1], base, "done", "reach of the open handle")
            if back is not None and to_shut is not None and leave is not None and to_open is not None:
                back_at = len(handle) - 1 - self._path.grasp
                held = (self._path.grasp, back_at)
                return PutPlan(pick, self._goal, self._inside, to_shut, handle, held, leave, back, to_open)
        raise Unreachable(f"{t.target!r} cannot be put into {t.part!r} so: {self._misses.text}")

    def _fits(self, bases: list[Based]) -> list[Based]:
        """Return the bases from which the arm can open the part, clear of the room; keeps their joint paths."""
        if not bases:
            return []
        kin, kept = self._shape.kin, []
        found = follow(kin, self._path.poses, np.stack([base for base, _ in bases]), IK_SEEDS, self._seed)
        if not any(map(len, found)):
            self._misses.note(0, 1.0, "handle: the arm cannot follow the part's path from any base")
        for (base, pedestal), paths in zip(bases, found, strict=True):
            order = np.argsort(np.abs(paths[:, 0] - np.array(kin.spec.home)).max(axis=1))
            clear = [paths[k] for k in order if self._is_clear(paths[k], base)]
            if clear:
                self._handles[_key(base)] = clear[:4]
                kept.append((base, pedestal))
        return kept

    def _is_clear(self, path: np.ndarray, base: np.ndarray) -> bool:
        depth = max(
            float(arm_depth(self._shape, self._around, path, base, fingers=False).max()),
            self._shape.self_penetration(path)[0],
        )
        if depth > SLACK:
            text = f"handle: the arm reaches {1000 * depth:.0f} mm into the room or itself as it opens the part"
            self._misses.note(1, depth, text)
        return depth <= SLACK

    def _move(self, start: np.ndarray, goal: np.ndarray, base: np.ndarray, room: str, name: str) -> np.ndarray | None:
        """Return a collision-free motion [pose arm] in one of the rooms; None where there is none, which is noted."""
        kin, near = self._shape.kin, self._rooms[room]

        def free(q: np.ndarray) -> np.ndarray:
            return self._shape.keeps_clear(arm_depth(self._shape, near, q, base), q)

        ends = arm_depth(self._shape, near, np.stack([start, goal]), base)
        path = free_motion(start, goal, kin.lower, kin.upper, free, self._seed) if ends.max() <= SLACK else None
        if path is None:
            text = f"{name}: its ends reach {1000 * ends.max():.0f} mm into the room, or no collision-free motion was found"
            self._misses.note(2, float(ends.max()), text)
        return path


def handle_path(task: PutTask) -> ToolPath:
    """Return the tool path to the handle, with it to the open part, and straight back from it."""
    articulation = task.room.articulations[task.part]
    grasp = np.array([*articulation.grasp.point, *articulation.grasp.orientation])
    there = part_path(articulation.joint, grasp, task.approach, task.opening, task.depth)
    moved = transform(articulation.joint, task.opening)
    back = moved @ there.poses[: there.grasp + 1][::-1]
    poses = np.concatenate([there.poses, back[1:]])
    return ToolPath(poses, np.concatenate([there.q, np.full(len(back) - 1, task.opening)]), there.grasp)


def _key(base: np.ndarray) -> bytes:
    """Return what a base is found by, [4 4]: its position to the millimetre."""
    return np.round(1000 * base[:3, 3]).astype(int).tobytes()
