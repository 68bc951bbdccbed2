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
from s2a.motion.search import EXACT, IK_SEEDS, Follow, Stand, Unreachable
from s2a.robot.spec import RobotSpec

PICKS, PLACES = (
    6,
    24,
)  # Bases with a grasp from which the pick is planned to the end; bases that are tried for the place
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
        for stand, up, held, opened, grasp in itertools.islice(self._picks(clear), PICKS):
            cell, body = self._pick.cell, np.linalg.inv(stand.base) @ self._pick.start
            empty = cell.empty(stand.base, opened, self._pick.points @ body[:3, :3].T + body[:3, 3])
            holding = cell.holding(stand.base, opened, held, self._pick.points)
            home = np.array(self._spec.home)
            reach = self._pick.search.joined(cell, stand, home, up[0], empty, "reach", 3, WIDE)
            if reach is None:
                continue
            for tucked in self._tucked(stand, up[-1]):
                tuck = self._pick.search.joined(cell, stand, up[-1], tucked, holding, "carry away", 4)
                if tuck is None:
                    continue
                driven = self._driven(stand, tucked, held, opened, clear.tool[grasp])
                if driven is None:
                    break
                further, down = driven
                again = self._pick.search.joined(cell, stand, up[-1], up[0], empty, "reach again", 0, WIDE)
                at, low = len(up) - 1 - round(LIFT / STEP), round(LIFT / STEP)
                return PickPlan(
                    stand.vector, stand.pedestal, reach, up[: at + 1], up[at:], tuck, down[: low + 1], down[low:],
                    again, np.linalg.inv(held), opened, further,
                )  # fmt: skip
        misses = max((self._pick.search.misses, self._place.search.misses), key=lambda m: m.nearest.order)
        error = Unreachable(f"{self._task.target!r}: {misses.nearest}, from two bases")
        error.graspable = bool(len(clear.tool))
        raise error

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
        self, stand: Stand, tucked: np.ndarray, held: np.ndarray, opened: float, grasp: np.ndarray
    ) -> tuple[Driven, np.ndarray] | None:
        """Return the route to another base and what is done there, and joints of lowering and retreat [pose arm]; None: none."""
        place, points = self._place, self._pick.points
        tool = place.cell.kin.tool(tucked[None])[0]
        carried = (tool @ held)[:3, :3] @ points.T + (tool @ held)[:3, 3:]
        now = self._floor.stands(stand.base, stand.pedestal)
        loaded = self._floor.loaded(now, tucked, carried.T)
        goal = self._task_goal(held)
        pairs = place.pairs(grasp[None], {"place": place.start}, loaded)
        for there, _ in itertools.islice(pairs, PLACES):
            lower = Follow(
                "lowering and retreat", 5, goal[None], place.meets, IK_SEEDS, clear=1, near=tucked[None], may_flip=False,
            )  # fmt: skip
            holding = place.cell.holding(there.base, opened, held, points)
            for _, down in place.search.followed([there], lower):
                carry = place.search.joined(place.cell, there, tucked, down[0], holding, "carry", 6, WIDE)
                if carry is None:
                    continue
                route = loaded.path(loaded.stands(there.base, there.pedestal), self._seed)
                if route is not None:
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
