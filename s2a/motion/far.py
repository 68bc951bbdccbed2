"""Plans to pick a free object at one end of a room and place it at another: the robot drives with it in its gripper."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.motion.floor import FreeFloor
from s2a.motion.grasps import SAMPLES, GraspCache, ObjectGrasps
from s2a.motion.gripper import Contact
from s2a.motion.pick_plan import (
    AT_ONCE,
    BRANCHES,
    DROP,
    LIFT,
    PAIRS,
    STEP,
    WIDE,
    Driven,
    PickPlan,
    PickPlanner,
    PickTask,
    line,
    there_and_up,
)
from s2a.motion.search import EXACT, IK_SEEDS, Follow, Miss, Stand, Unreachable, chunks
from s2a.motion.workcell import Depth, Workcell, lines
from s2a.robot.spec import RobotSpec
from s2a.robot.tool_path import JOINT_TURN, even

PICKS, PLACES = 12, 24  # Ends at the start and at the place that are joined
TURNED = 6  # Ways to carry an object from an end at the start to those at the place that are joined
# Comparisons of a sphere with the room that take as long as a search for a route of the base
ROUTE = 300_000
# [m] Before the arm's first joint turns: distance ahead of its root link and height above that of tool frames in which an
# object is carried
TUCKED = (0.40, 0.50), (0.35, 0.65), (0.45, 0.40), (0.35, 0.35)
SWINGS = 9  # Turns of the first joint: over its own deck the arm needs no more floor than the base
AWAY = (0.0, 0.12), (0.15, 0.04), (0.15, 0.12), (0.3, 0.12)  # [m] Towards the robot and up, before the arm turns
CARRIED = 24  # Joints to carry an object with that are looked at
STARTS = 8  # Of the inverse kinematics of each pose
SAME = 3e-3  # [m] and rad: by which two ends of a grasp differ where the fingers are not exchanged


def plan_far(task: PickTask, spec: RobotSpec, contact: Contact, grasps: GraspCache, seed: int = 0) -> PickPlan:
    """Return how a robot that drives picks an object from one base and places it from another.

    Raises:
        Unreachable: no grasp, base or path was found.
    """
    return FarPlanner(task, spec, contact, grasps, seed).plan()


@dataclass(frozen=True)
class Placing:
    """How an object is placed from one base."""

    stand: Stand  # the base
    down: np.ndarray  # joints of lowering and retreat, shape [pose arm]
    held: np.ndarray  # the object in the tool frame [4 4]

    def holds(self, held: np.ndarray) -> bool:
        """Return whether the object is held as at `held` [4 4] in the tool frame: fingers exchanged are another grasp."""
        return bool(np.abs(self.held - held)[:3].max() < SAME)


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
        # Most picks fail at the place: grasps that no base places with are not looked at, and joint searches come last.
        places: dict[int, list[Placing]] = {}
        for k, placing in itertools.islice(self._places(clear), PLACES):
            places.setdefault(k, []).append(placing)
        some = sorted(places)
        for stand, up, held, opened, k in itertools.islice(self._picks(clear[some]) if some else iter(()), PICKS):
            way = self._joined(stand, up, held, opened, [each for each in places[some[k]] if each.holds(held)])
            if way is not None:
                return way
            if self._pick.spend() or self._place.spend():
                break
        misses = max((self._pick.search.misses, self._place.search.misses), key=lambda m: m.nearest.order)
        error = Unreachable(f"{self._task.target!r}: {misses.nearest}, from two bases")
        error.graspable = bool(len(clear.tool))
        raise error

    def _joined(
        self, stand: Stand, up: np.ndarray, held: np.ndarray, opened: float, places: list[Placing]
    ) -> PickPlan | None:
        """Return a plan with a base and the straight path at the start; None where it cannot be driven or joined."""
        cell, search, body = self._pick.cell, self._pick.search, np.linalg.inv(stand.base) @ self._pick.start
        empty = cell.empty(stand.base, opened, self._pick.points @ body[:3, :3].T + body[:3, 3])
        holding = cell.holding(stand.base, opened, held, self._pick.points)
        tucks: dict[bytes, np.ndarray | None] = {}
        for away, tucked, loaded, placing in itertools.islice(self._ways(stand, up[-1], held, opened, places), TURNED):
            if self._pick.spend() or self._place.spend():
                break
            key = tucked.tobytes()
            if key not in tucks:
                further = search.joined(cell, stand, away[-1], tucked, holding, "carry away", 4)
                tucks[key] = None if further is None else even(np.concatenate([away, further[1:]]))
            tuck = tucks[key]
            driven = None if tuck is None else self._driven(loaded, tucked, held, opened, placing)
            if tuck is None or driven is None:
                continue
            reach = search.joined(cell, stand, np.array(self._spec.home), up[0], empty, "reach", 3, WIDE)
            if reach is None:
                return None
            again = search.joined(cell, stand, up[-1], up[0], empty, "reach again", 0, WIDE)
            at, low = len(up) - 1 - round(LIFT / STEP), round(LIFT / STEP)
            return PickPlan(
                stand.vector, stand.pedestal, reach, up[: at + 1], up[at:], tuck, placing.down[: low + 1],
                placing.down[low:], again, np.linalg.inv(held), opened, driven,
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
            up = Follow("approach and lift", 1, poses, self._pick.meets, IK_SEEDS, clear=BRANCHES)
            for _, path in self._pick.search.followed([stand], up):
                at = len(path) - 1 - round(LIFT / STEP)
                tool = self._pick.cell.kin.tool(path[at : at + 1])[0]
                held = np.linalg.inv(tool) @ np.linalg.inv(stand.base) @ self._pick.start
                yield stand, path, held, float(grasps.opened[k]), k

    def _places(self, grasps: ObjectGrasps) -> Iterator[tuple[int, Placing]]:
        """Yield grasps, and bases and joints with which the object is placed."""
        place, low = self._place, round(LIFT / STEP)
        goal = place.start.copy()
        goal[2, 3] += DROP
        pairs = itertools.islice(place.pairs(grasps.tool, {"place": place.start}), PAIRS)
        for some in itertools.takewhile(lambda _: not place.spend(), chunks(pairs, AT_ONCE)):
            poses = np.stack([there_and_up(goal @ grasps.tool[k], self._task.approach)[::-1] for _, k in some])
            lower = Follow("lowering and retreat", 1, poses, place.meets, IK_SEEDS)
            kept: dict[int, list[Placing]] = {}  # One with the fingers either way
            for n, path in place.search.followed([stand for stand, _ in some], lower):
                tool = place.cell.kin.tool(path[low : low + 1])[0]
                one = Placing(some[n][0], path, np.linalg.inv(tool) @ np.linalg.inv(some[n][0].base) @ goal)
                if not any(each.holds(one.held) for each in kept.setdefault(n, [])):
                    kept[n].append(one)
                    yield some[n][1], one

    def _ways(
        self, stand: Stand, lifted: np.ndarray, held: np.ndarray, opened: float, places: list[Placing]
    ) -> Iterator[tuple[np.ndarray, np.ndarray, FreeFloor, Placing]]:
        """Yield joints [pose arm] away from the start and [arm] to carry with, floor free for that, and places that it joins.

        First those that the arm reaches straight at both ends: searches for its motions cost far more than all else.
        """
        if not places:
            return
        pick, place, points = self._pick.cell, self._place.cell, self._pick.points
        holding = pick.holding(stand.base, opened, held, points)
        now = self._floor.stands(stand.base, stand.pedestal)
        tucked = np.concatenate([lifted[None], self._tucked(lifted)])
        away = self._away(stand, lifted, holding)
        count = 0
        later: list[tuple[np.ndarray, np.ndarray, FreeFloor, Placing]] = []
        text = "drive: the base with the object collides where it leaves or arrives"
        for q in tucked[pick.is_free(holding, tucked)]:
            loaded = self._floor.loaded(now, q, self._carried(q, held))
            if not loaded.free(now[None])[0]:
                continue
            leaving = (path for path in away if _is_direct(pick, holding, path[-1], q))
            leave = next(leaving, None)
            for placing in places:
                there = placing.stand
                if not loaded.reachable(self._floor.stands(there.base, there.pedestal)[None])[0]:
                    self._place.search.misses.note(Miss(2, 0.0, text, there))
                    continue
                depth = place.holding(there.base, opened, held, points)
                if leave is not None and _is_direct(place, depth, q, placing.down[0]):
                    yield leave, q, loaded, placing
                else:
                    later.append((away[-1] if leave is None else leave, q, loaded, placing))
            count += 1
            if count == CARRIED:
                break
        yield from later

    def _away(self, stand: Stand, lifted: np.ndarray, holding: Depth) -> list[np.ndarray]:
        """Return joints [pose arm] that bring the object from where it is lifted straight to more room, and none that do."""
        search, cell = self._pick.search, self._pick.cell
        tool = stand.base @ cell.kin.tool(lifted[None])[0]
        back = (stand.base[:2, 3] - tool[:2, 3]) / np.linalg.norm(stand.base[:2, 3] - tool[:2, 3])
        raised = [lifted[None]]
        for behind, above in AWAY:
            poses = line(tool, np.array([*behind * back, above]))
            follow = Follow("carry away", 3, poses, lambda _, path: cell.met(path, stand.base), 1, near=lifted[None])
            for path in search.paths([stand], follow)[0]:
                if np.abs(path[0] - lifted).max() < JOINT_TURN and cell.is_free(holding, path).all():
                    raised.append(np.concatenate([lifted[None], path[1:]]))
                    break
        return raised

    def _carried(self, q: np.ndarray, held: np.ndarray) -> np.ndarray:
        """Return points [point 3] of the object that the arm holds in joints [arm], in the frame of its root link."""
        body = self._pick.cell.kin.tool(q[None])[0] @ held
        return self._pick.points @ body[:3, :3].T + body[:3, 3]

    def _tucked(self, lifted: np.ndarray) -> np.ndarray:
        """Return joints [pose arm] in which the arm carries the object near itself, upright as it is when lifted [arm]."""
        kin = self._pick.cell.kin
        tool = kin.tool(lifted[None])[0]
        ahead = Rotation.from_euler("z", -math.atan2(tool[1, 2], tool[0, 2])).as_matrix()
        poses = np.tile(tool, (2, len(TUCKED), 1, 1))
        poses[1, :, :3, :3] = ahead @ tool[:3, :3]  # which most arms reach
        poses[:, :, [0, 2], 3] = TUCKED
        poses[:, :, 1, 3] = 0.0
        poses = poses.reshape(-1, 4, 4)
        starts = np.random.default_rng(self._seed).uniform(kin.lower, kin.upper, (STARTS, len(lifted)))
        starts[0], starts[1] = lifted, self._spec.home
        q, left = kin.solve(np.repeat(poses, STARTS, axis=0), np.tile(starts, (len(poses), 1)), 40, 1e-2)
        q = q[(left < EXACT) & (q > kin.lower).all(axis=1) & (q < kin.upper).all(axis=1)]
        turned = np.repeat(q, SWINGS, axis=0)
        turned[:, 0] = np.tile(np.linspace(0.95 * kin.lower[0], 0.95 * kin.upper[0], SWINGS), len(q))
        turned = np.concatenate([q, turned])
        _, first = np.unique(turned.round(1), axis=0, return_index=True)
        turned = turned[np.sort(first)]
        return turned[np.argsort(np.abs(turned - lifted).max(axis=1), kind="stable")]

    def _driven(
        self, loaded: FreeFloor, tucked: np.ndarray, held: np.ndarray, opened: float, placing: Placing
    ) -> Driven | None:
        """Return the route to the place, and the motion there from joints [arm] to above it; None: none was found."""
        place, there = self._place, placing.stand
        self._grasps.spend(ROUTE)
        route = loaded.path(loaded.stands(there.base, there.pedestal), self._seed)
        if route is None:
            text = "drive: no free path of the base with the object was found"
            place.search.misses.note(Miss(6, 0.0, text, there))
            return None
        holding = place.cell.holding(there.base, opened, held, self._pick.points)
        carry = place.search.joined(place.cell, there, tucked, placing.down[0], holding, "carry", 7, WIDE)
        return None if carry is None else Driven(there.vector, there.pedestal, route, carry)


def _is_direct(cell: Workcell, depth: Depth, start: np.ndarray, goal: np.ndarray) -> bool:
    """Return whether the arm can move straight between joints [arm]; few poses in between are asked about first."""
    line = lines(start[None], goal)
    return all(bool(cell.is_free(depth, some).all()) for some in (line[:: len(line) // 4 + 1], line))


def is_far(task: PickTask, spec: RobotSpec) -> bool:
    """Return whether no single base reaches both ends."""
    return math.dist(task.start[:2], task.goal[:2]) > 2.0 * spec.base.reach
