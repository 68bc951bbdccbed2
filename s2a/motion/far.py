"""Plans to pick a free object at one end of a room and place it at another: the robot drives with it in its gripper."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from s2a.motion.grasps import SAMPLES, GraspCache, ObjectGrasps
from s2a.motion.gripper import Contact
from s2a.motion.pick_plan import DROP, LIFT, STEP, WIDE, Driven, PickPlan, PickPlanner, PickTask, there_and_up
from s2a.motion.search import EXACT, IK_SEEDS, Follow, Miss, Stand, Unreachable
from s2a.robot.spec import RobotSpec

PICKS, PLACES = 6, 96  # Bases with a grasp from which a pick is planned to the end; bases with a grasp for the place
# Comparisons of a sphere with the room that take as long as a search for a route of the base
ROUTE = 300_000
# [m] In the frame of the arm's root link: tool frames in which an object is carried, upright as it was lifted
TUCKED = ((0.40, 0.0, 0.50), (0.35, 0.0, 0.65), (0.45, 0.0, 0.40), (0.30, -0.2, 0.55), (0.30, 0.2, 0.55))
STARTS = 8  # Of the inverse kinematics of each


def plan_far(task: PickTask, spec: RobotSpec, contact: Contact, grasps: GraspCache, seed: int = 0) -> PickPlan:
    """Return how a robot that drives picks an object from one base and places it from another.

    Raises:
        Unreachable: no grasp, base or path was found.
    """
    return FarPlanner(task, spec, contact, grasps, seed).plan()


class FarPlanner:
    """A planner for each end; what joins them is the object in the gripper, and the route between both bases."""

    def __init__(self, task: PickTask, spec: RobotSpec, contact: Contact, grasps: GraspCache, seed: int) -> None:
        """Take what is done, by a robot that drives on `task.floor`."""
        assert task.floor is not None
        self._task, self._spec, self._contact, self._grasps, self._seed = task, spec, contact, grasps, seed
        self._floor = task.floor
        self._pick = PickPlanner(replace(task, goal=task.start), spec, grasps, seed)
        self._place = PickPlanner(replace(task, start=task.goal), spec, grasps, seed)

    def plan(self) -> PickPlan:
        """Return the first plan; Unreachable: there is none."""
        clear = self._clear()
        # Most picks fail at the place: grasps that no base reaches there are not looked at, and joint searches come last.
        places: dict[int, list[Stand]] = {}
        for there, k in itertools.islice(self._place.pairs(clear.tool, {"place": self._place.start}), PLACES):
            places.setdefault(k, []).append(there)
        some = sorted(places)
        for stand, up, held, opened, k in itertools.islice(self._picks(clear[some]) if some else iter(()), PICKS):
            found = self._joined(stand, up, held, opened, places[some[k]])
            if found is not None:
                return found
            if self._pick.spend() or self._place.spend():
                break
        misses = max((self._pick.search.misses, self._place.search.misses), key=lambda m: m.nearest.order)
        error = Unreachable(f"{self._task.target!r}: {misses.nearest}, from two bases")
        error.graspable = bool(len(clear.tool))
        raise error

    def _joined(
        self, stand: Stand, up: np.ndarray, held: np.ndarray, opened: float, places: list[Stand]
    ) -> PickPlan | None:
        """Return a plan with a base and the straight path at the start; None where it cannot be driven or joined."""
        cell, search, body = self._pick.cell, self._pick.search, np.linalg.inv(stand.base) @ self._pick.start
        empty = cell.empty(stand.base, opened, self._pick.points @ body[:3, :3].T + body[:3, 3])
        holding = cell.holding(stand.base, opened, held, self._pick.points)
        for tucked in self._tucked(stand, up[-1]):
            if not cell.is_free(holding, tucked[None])[0]:
                continue
            driven = self._driven(stand, tucked, held, opened, places)
            if driven is None:
                continue
            reach = search.joined(cell, stand, np.array(self._spec.home), up[0], empty, "reach", 3, WIDE)
            if reach is None:
                return None
            tuck = search.joined(cell, stand, up[-1], tucked, holding, "carry away", 4)
            if tuck is None:
                continue
            further, down = driven
            again = search.joined(cell, stand, up[-1], up[0], empty, "reach again", 0, WIDE)
            at, low = len(up) - 1 - round(LIFT / STEP), round(LIFT / STEP)
            return PickPlan(
                stand.vector, stand.pedestal, reach, up[: at + 1], up[at:], tuck, down[: low + 1], down[low:],
                again, np.linalg.inv(held), opened, further,
            )  # fmt: skip
        return None

    def _clear(self) -> ObjectGrasps:
        """Return grasps of different directions that keep clear at both ends."""
        up = self._pick.start[2, :3]
        for samples in SAMPLES:
            every = self._grasps(samples, self._contact, up)
            chosen = every[self._pick.diverse(every)]
            clear = chosen[np.flatnonzero(self._place.depth(chosen) <= 0.0)] if len(chosen.tool) else chosen
            if len(clear.tool) or self._grasps.spend():
                return clear
        return clear

    def _picks(self, grasps: ObjectGrasps) -> Iterator[tuple[Stand, np.ndarray, np.ndarray, float, int]]:
        """Yield bases, joints of approach and lift [pose arm], the object in the tool frame, distance of the pads, the grasp."""
        for stand, k in self._pick.pairs(grasps.tool, {"grasp": self._pick.start}):
            poses = there_and_up(self._pick.start @ grasps.tool[k], self._task.approach)[None]
            up = Follow("approach and lift", 1, poses, self._pick.meets, IK_SEEDS, clear=1)
            for _, path in self._pick.search.followed([stand], up):
                at = len(path) - 1 - round(LIFT / STEP)
                tool = self._pick.cell.kin.tool(path[at : at + 1])[0]
                held = np.linalg.inv(tool) @ np.linalg.inv(stand.base) @ self._pick.start
                yield stand, path, held, float(grasps.opened[k]), k

    def _tucked(self, stand: Stand, lifted: np.ndarray) -> Iterator[np.ndarray]:
        """Yield joints [arm] in which the arm carries the object near itself, turned as it is when lifted [arm]."""
        kin = self._pick.cell.kin
        tool = kin.tool(lifted[None])[0]
        poses = np.tile(tool, (len(TUCKED), 1, 1))
        poses[:, :3, 3] = TUCKED
        starts = np.random.default_rng(self._seed).uniform(kin.lower, kin.upper, (STARTS, len(lifted)))
        starts[0], starts[1] = lifted, self._spec.home
        q, left = kin.solve(np.repeat(poses, STARTS, axis=0), np.tile(starts, (len(poses), 1)), 40, 1e-2)
        q = q[left < EXACT]
        yield from q[np.argsort(np.abs(q - lifted).max(axis=1), kind="stable")][: len(TUCKED)]

    def _driven(
        self, stand: Stand, tucked: np.ndarray, held: np.ndarray, opened: float, places: list[Stand]
    ) -> tuple[Driven, np.ndarray] | None:
        """Return the route to another base and what is done there, and joints of lowering and retreat [pose arm]; None: none."""
        place, points = self._place, self._pick.points
        tool = place.cell.kin.tool(tucked[None])[0]
        carried = (tool @ held)[:3, :3] @ points.T + (tool @ held)[:3, 3:]
        loaded = self._floor.loaded(self._floor.stands(stand.base, stand.pedestal), tucked, carried.T)
        free = loaded.reachable(np.stack([self._floor.stands(each.base, each.pedestal) for each in places]))
        for there in itertools.compress(places, free):
            if place.spend():
                break
            lower = Follow(
                "lowering and retreat", 5, self._task_goal(held)[None], place.meets, IK_SEEDS, clear=1, near=tucked[None],
                may_flip=False,
            )  # fmt: skip
            down = next((path for _, path in place.search.followed([there], lower)), None)
            if down is None:
                continue
            self._grasps.spend(ROUTE)
            route = loaded.path(loaded.stands(there.base, there.pedestal), self._seed)
            if route is None:
                text = "drive: no free route of the base that carries the object was found"
                place.search.misses.note(Miss(6, 0.0, text, there))
                continue
            holding = place.cell.holding(there.base, opened, held, points)
            carry = place.search.joined(place.cell, there, tucked, down[0], holding, "carry", 7, WIDE)
            if carry is not None:
                return Driven(there.vector, there.pedestal, route, carry), down
        return None

    def _task_goal(self, held: np.ndarray) -> np.ndarray:
        """Return tool poses from above the place to it and back from it [pose 4 4]."""
        down = self._place.start @ np.linalg.inv(held)
        down[2, 3] += DROP
        return there_and_up(down, self._task.approach)[::-1]


def is_far(task: PickTask, spec: RobotSpec) -> bool:
    """Return whether no single base reaches both ends."""
    return math.dist(task.start[:2], task.goal[:2]) > 2.0 * spec.base.reach
