"""Picking a free object and placing it: base, grasp and joint path, or the segment that fails and by how much."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from s2a.planner.contact import FIRM, Contact
from s2a.planner.free_motion import free_motion
from s2a.planner.grasp_cache import GraspCache
from s2a.planner.graspable import failure
from s2a.planner.gripper_depth import gripper_depth
from s2a.planner.gripper_shape import is_near
from s2a.planner.misses import Misses
from s2a.planner.object_grasps import SAMPLES, ObjectGrasps, matrix
from s2a.planner.obstacles import HELD_RADIUS, RoomHulls, surface_points
from s2a.planner.pick_base import arm_depth, bases, chunks, reached
from s2a.planner.pick_plan import PickPlan, StraightPaths
from s2a.planner.straight_paths import APPROACH, LIFT, STEP, there_and_up, unflipped
from s2a.robot.collision import SLACK, RobotShape, robot_shape
from s2a.robot.spec import RobotSpec
from s2a.robot.tool_path import follow
from s2a.scene.usd.sim_scene import SimRoom

DROP = 0.001
"""[m] Above the planned place the fingers open, so that the object is not pressed onto its support."""
GRASPS, BASES, PAIRS = 16, 24, 96
"""Grasps and bases that are tried, and pairs of both that are planned to the end."""
BLOCK = 256
"""Grasps that are looked at together."""
ENOUGH = 8
"""Grasps of different directions from which no more are looked for."""
IK_SEEDS = 12
"""Starts of the inverse kinematics."""
Fits = Callable[[list[tuple[np.ndarray, float]]], list[tuple[np.ndarray, float]]]
"""Poses [4 4] and pedestals of bases [m] -> those of them that will do."""
Depth = Callable[[np.ndarray, float], np.ndarray]
"""Joints [pose arm] and by how much all is taken to be thicker [m] -> how deep it reaches into the room [m], shape [pose]."""
WIDE = 0.02, 0.01
"""[m] More than needed, by which arm and held object keep from the room where that can be done: an arm lags behind its motion and
cuts its corners, by 2 cm before a mirror cabinet, and an object that has slipped by a few millimetres met what it was to pass."""
BRANCHES = 3
"""Branches of the inverse kinematics that are tried for each straight path."""
FAR, MORE = 1.6, 2
"""[rad] Turn of a joint between start and place from which a plan comes last: held objects slip on the long way. And blocks of
pairs that are looked at for a shorter way."""
AT_ONCE = 8
"""Pairs whose inverse kinematics are solved together."""


def plan_pick(
    room: SimRoom,
    target: str,
    start: np.ndarray,
    goal: np.ndarray,
    spec: RobotSpec,
    seed: int = 0,
    fits: Fits | None = None,
    contacts: Sequence[Contact] = (FIRM,),
    known: GraspCache | None = None,
) -> PickPlan:
    """Return how a robot picks an object at a pose and places it at another; 7-vectors of its body frame, scene frame.

    `fits` says which bases will do, of those where the robot can stand; `contacts` how the object may be held, those that come
    first where there is a plan with them; `known` are the grasps of this object by this robot, for several calls.

    Raises:
        Unreachable: no grasp, base or path was found.
    """
    known = known or GraspCache(room.free[target], spec.gripper)
    return _Search(room, target, start, goal, spec, known, seed).plan(fits, contacts)


class _Search:
    """The search for base, grasp and path, cheapest tests first."""

    def __init__(
        self,
        room: SimRoom,
        target: str,
        start: np.ndarray,
        goal: np.ndarray,
        spec: RobotSpec,
        known: GraspCache,
        seed: int,
    ) -> None:
        self._spec, self._known, self._seed, self._target = spec, known, seed, target
        self._shape: RobotShape = robot_shape(spec)
        self._object = room.free[target]
        self._start, self._goal = matrix(start), matrix(goal)
        self._near = RoomHulls(room, {target}, (start[:3] + goal[:3]) / 2)
        self._points, self._misses = surface_points([c.mesh for c in self._object.colliders]), Misses()

    def plan(self, fits: Fits | None, contacts: Sequence[Contact]) -> PickPlan:
        """Return the first plan found."""
        up, tried = self._start[2, :3], []
        for contact in contacts:
            for samples in SAMPLES:
                every = self._known(samples, contact, up)
                kept = self._diverse(every)
                tried.append((every, bool(kept)))
                if kept and (found := self._of(every[kept], fits)) is not None:
                    return found
                if len(kept) >= ENOUGH:
                    break
        nearest = 0.0 if any(clear for _, clear in tried) else self._least([every for every, _ in tried])
        raise failure(self._target, nearest, float(np.ptp(self._points, axis=0).min()), self._misses, self._spec)

    def _of(self, grasps: ObjectGrasps, fits: Fits | None) -> PickPlan | None:
        """Return the first plan with one of some grasps."""
        pairs = chunks(itertools.islice(self._pairs(grasps.tool, fits), PAIRS), AT_ONCE)
        return next(self._found(pairs, grasps), None)

    def _pairs(self, grasps: np.ndarray, fits: Fits | None) -> Iterator[tuple[np.ndarray, float, int]]:
        """Yield bases, pedestals and indices of grasps that reach, those where the arm was found to be clear first."""
        places = {"grasp": self._start, "place": self._goal}
        later: list[tuple[np.ndarray, float, int]] = []
        for some in chunks(bases(self._shape, self._near, self._start, self._goal), BASES):
            kept = some if fits is None else fits(some)
            found = reached(self._shape, self._near, places, kept, grasps, self._seed, self._misses)
            for base, pedestal, k, clear in found:
                if clear:
                    yield base, pedestal, k
                else:
                    later.append((base, pedestal, k))
        yield from later

    def _least(self, tried: list[ObjectGrasps]) -> float:
        """Return the penetration depth [m] of the grasp that comes nearest to being clear, inf of none."""
        least = math.inf
        for grasps in tried:
            for block in chunks(iter(range(len(grasps.tool))), BLOCK):
                least = min(least, float(self._depth(grasps[block], least).min()))
        return least

    def _depth(self, grasps: ObjectGrasps, limit: float = 0.0) -> np.ndarray:
        """Return how deep the gripper reaches into what is around start and place, shape [grasp]; see `gripper_depth`."""
        ends = (self._start, self._goal)
        return np.maximum(
            *(gripper_depth(self._near, self._spec.gripper, at @ grasps.tool, grasps.opened, limit) for at in ends)
        )

    def _diverse(self, grasps: ObjectGrasps) -> list[int]:
        """Return up to GRASPS of them, in order, that keep clear.

        No two have nearly the same direction, so that those near to one that is kept need not be looked at.
        """
        kept: list[int] = []
        for block in chunks(iter(range(len(grasps.tool))), BLOCK):
            some = [k for k in block if not is_near(grasps.tool[k], grasps.tool[kept])]
            depth = self._depth(grasps[some]) if some else np.zeros(0)
            for k, reached_into in zip(some, depth, strict=True):
                # Only those that keep clear; the arm comes from somewhere above or beside, never from below.
                if reached_into <= 0.0 and not is_near(grasps.tool[k], grasps.tool[kept]):
                    kept.append(k)
                if len(kept) == GRASPS:
                    return kept
        return kept

    def _found(self, blocks: Iterator[list[tuple[np.ndarray, float, int]]], grasps: ObjectGrasps) -> Iterator[PickPlan]:
        """Yield plans; those for which the arm turns far between start and place after a look at MORE further blocks of pairs."""
        far: list[StraightPaths] = []
        for turn, some in enumerate(blocks):
            for path in self._paths(some, grasps):
                if np.abs(path[-1][0] - path[2][-1]).max() > FAR:
                    far.append(path)
                elif (plan := self._joined(*path)) is not None:
                    yield plan
            if turn >= MORE:
                yield from filter(None, itertools.starmap(self._joined, far))
                far.clear()
        yield from filter(None, itertools.starmap(self._joined, far))

    def _paths(self, pairs: list[tuple[np.ndarray, float, int]], grasps: ObjectGrasps) -> Iterator[StraightPaths]:
        """Yield the straight paths for bases [4 4], pedestals [m] and indices of grasps; what fails is noted.

        Inverse kinematics solve the straight paths of all of them together: they cost what starts them, not how many they are.
        """
        kin, home, at = self._shape.kin, np.array(self._spec.home), round(APPROACH / STEP)
        ups = np.stack([there_and_up(self._start @ grasps.tool[k]) for _, _, k in pairs])
        bases = np.stack([base for base, _, _ in pairs])
        todo, downs = [], []
        for (base, pedestal, k), paths in zip(pairs, follow(kin, ups, bases, IK_SEEDS, self._seed), strict=True):
            for path in itertools.islice(self._free_paths(paths, base, home, "approach and lift", 1), BRANCHES):
                held = np.linalg.inv(kin.tool(path[at : at + 1])[0]) @ np.linalg.inv(base) @ self._start
                tool = self._goal @ np.linalg.inv(held)
                tool[2, 3] += DROP
                todo.append((base, pedestal, path, held, float(grasps.opened[k])))
                downs.append(there_and_up(tool)[::-1])
        if not todo:
            return
        lifted = np.stack([path[-1] for _, _, path, *_ in todo])
        lowers = follow(kin, np.stack(downs), np.stack([base for base, *_ in todo]), IK_SEEDS, self._seed, lifted)
        for (base, pedestal, path, held, opened), down, paths in zip(todo, downs, lowers, strict=True):
            ways = self._free_paths(unflipped(kin, paths, base, down), base, path[-1], "lowering and retreat", 2)
            for lower in itertools.islice(ways, BRANCHES):
                yield base, pedestal, path, held, opened, lower

    def _joined(
        self, base: np.ndarray, pedestal: float, path: np.ndarray, held: np.ndarray, opened: float, lower: np.ndarray
    ) -> PickPlan | None:
        """Return a plan with these straight paths [pose arm] at start and place; None where what joins them is not free."""
        at, low, home = round(APPROACH / STEP), round(LIFT / STEP), np.array(self._spec.home)
        empty, held_there = self._empty_depth(base, opened), self._held_depth(base, opened, held)
        reach = self._move(home, path[0], empty, "reach", 3)
        carry = None if reach is None else self._move(path[-1], lower[0], held_there, "carry", 4)
        if reach is None or carry is None:
            return None
        again = self._widest(path[-1], path[0], empty)
        pose = np.array([*base[:3, 3], *Rotation.from_matrix(base[:3, :3]).as_quat()])
        return PickPlan(
            pose, pedestal, reach, path[: at + 1], path[at:], carry, lower[: low + 1], lower[low:],
            again, np.linalg.inv(held), opened,
        )  # fmt: skip

    def _free_paths(
        self, paths: np.ndarray, base: np.ndarray, near: np.ndarray, name: str, stage: int
    ) -> Iterator[np.ndarray]:
        """Yield joint paths of some [path pose arm] on which the arm collides with nothing, nearest to joints first."""
        if not len(paths):
            self._misses.note(
                stage, 1.0, f"{name}: the arm cannot follow the straight path; choose a place with more room"
            )
        for path in paths[np.argsort(np.abs(paths[:, 0] - near).max(axis=1))] if len(paths) else ():
            depth = max(
                float(arm_depth(self._shape, self._near, path, base, fingers=False).max()),
                self._shape.self_penetration(path)[0],
            )
            if depth > SLACK:
                self._misses.note(
                    stage, depth, f"{name}: the arm reaches {1000 * depth:.0f} mm into the room or itself"
                )
            else:
                yield path

    def _held_depth(self, base: np.ndarray, opened: float, held: np.ndarray) -> Depth:
        """Return how deep the arm, or what it holds at `held` [4 4] and HELD_RADIUS around it, reaches into the room."""

        def depth(q: np.ndarray, more: float) -> np.ndarray:
            found = arm_depth(self._shape, self._near, q, base, opened=opened, clearance=more)
            carried = base @ self._shape.kin.tool(q) @ held
            points = self._points @ carried[:, :3, :3].transpose(0, 2, 1) + carried[:, None, :3, 3]
            near = self._near.depth(points, np.full(len(self._points), HELD_RADIUS + more))
            return np.maximum(found, np.where(near > 0.0, near + SLACK, 0.0))

        return depth

    def _empty_depth(self, base: np.ndarray, opened: float) -> Depth:
        """Return how deep the arm reaches into the room, or into the object at its start."""
        body = np.linalg.inv(base) @ self._start
        points = KDTree(self._points @ body[:3, :3].T + body[:3, 3])
        chosen = self._shape.moving

        def depth(q: np.ndarray, more: float) -> np.ndarray:
            found = arm_depth(self._shape, self._near, q, base, opened=opened, clearance=more)
            gaps, _ = points.query(self._shape.centers(q)[:, chosen])
            return np.maximum(found, (self._shape.radii[chosen] - gaps).max(axis=1))

        return depth

    def _move(self, start: np.ndarray, goal: np.ndarray, depth: Depth, name: str, stage: int) -> np.ndarray | None:
        """Return a collision-free motion [pose arm]; None where there is none, which is noted."""
        if (path := self._widest(start, goal, depth)) is not None:
            return path
        worst = float(depth(np.stack([start, goal]), 0.0).max())
        text = f"{name}: an end of the motion reaches {1000 * worst:.0f} mm into something"
        if worst <= SLACK:
            worst, text = 0.0, f"{name}: no collision-free motion was found"
        self._misses.note(stage, worst, text)
        return None

    def _widest(self, start: np.ndarray, goal: np.ndarray, depth: Depth) -> np.ndarray | None:
        """Return a motion [pose arm] that keeps as far from all as one of WIDE, else one that meets nothing; None: none found."""
        found = self._searched(start, goal, depth, 0.0)
        for more in WIDE if found is not None else ():
            if (better := self._searched(start, goal, depth, more)) is not None:
                return better
        return found

    def _searched(self, start: np.ndarray, goal: np.ndarray, depth: Depth, more: float) -> np.ndarray | None:
        """Return a motion [pose arm] that meets nothing by more than SLACK, all `more` [m] thicker; None: none found."""

        def free(q: np.ndarray) -> np.ndarray:
            return self._shape.keeps_clear(depth(q, more), q)

        if not free(np.stack([start, goal])).all():
            return None
        kin = self._shape.kin
        return free_motion(start, goal, kin.lower, kin.upper, free, self._seed)
