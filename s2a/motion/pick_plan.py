"""Plans to pick a free object and place it: base, grasp and joint paths, or the segment that fails and by how much."""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from s2a.motion.floor import FreeFloor
from s2a.motion.grasps import SAMPLES, GraspCache, ObjectGrasps, failure
from s2a.motion.gripper import FIRM, Contact, gripper_depth, is_near
from s2a.motion.obstacles import Obstacles, surface_points
from s2a.motion.search import IK_SEEDS, Follow, Search, Stand, around, chunks, reached
from s2a.motion.workcell import Workcell, noisy_starts
from s2a.robot.collision import SLACK, Penetration, robot_shape
from s2a.robot.spec import RobotSpec
from s2a.robot.tool_path import matrix
from s2a.scene.usd.sim_scene import SimRoom

LIFT = 0.08  # [m] Straight path after the grasp, and above the place
STEP = 0.02  # [m] Between poses of a straight path
DROP = 0.001  # [m] Above the planned place the fingers open, so that the object is not pressed onto its support
GRASPS, BASES, PAIRS = 16, 24, 96  # Grasps and bases that are tried, and pairs of both that are planned to the end
SOLVING = 1000  # Comparisons of a sphere with the room that take as long as inverse kinematics of a base and a grasp
BLOCK = 256  # Grasps that are looked at together
ENOUGH = 8  # Grasps of different directions from which no more are looked for
SAMPLED = 512  # Grasps of which the one that comes nearest to being clear is named where none is
# [m] More than needed, by which arm and held object keep from the room where that can be done: an arm lags behind its
# motion and cuts its corners, by 2 cm before a mirror cabinet, and an object that has slipped by a few millimetres
# met what it was to pass
WIDE = 0.02, 0.01
BRANCHES = 3  # Branches of the inverse kinematics that are tried for each straight path
# [rad] Turn of a joint between start and place from which a plan comes last: held objects slip on the long way. And
# blocks of pairs that are looked at for a shorter way
FAR, MORE = 1.6, 2
AT_ONCE = 8  # Pairs whose inverse kinematics are solved together
Fits = Callable[[list[Stand]], list[Stand]]  # Bases -> those of them that will do


@dataclass(frozen=True)
class PickTask:
    """An object that is picked and placed."""

    room: SimRoom  # as it stands
    target: str  # id of the object
    start: np.ndarray  # where it stands, 7-vector of its body frame, scene frame
    goal: np.ndarray  # where it is placed, likewise
    approach: float  # straight path to the grasp, and back after the release [m]
    noise: float = 0.0  # by which joints may be off home as the robot starts [rad]
    floor: FreeFloor | None = None  # on which the robot drives to its base; None: that is put there


@dataclass(frozen=True)
class Driven:
    """What a robot does between the pick and the place that it drives to."""

    base: np.ndarray  # pose of its base there, 7-vector, scene frame
    pedestal: float  # height of the arm's root link there [m]
    route: np.ndarray  # coordinates of the base (x, y, yaw, lift) from here to there, shape [pose 4]
    carry: np.ndarray  # joints from how the object is carried to above the place, shape [pose arm]


@dataclass(frozen=True)
class PickPlan:
    """A plan to pick and place an object."""

    base: np.ndarray  # pose of the robot's base, 7-vector, scene frame
    pedestal: float  # height of what it stands on [m]
    reach: np.ndarray  # joints from home to the point of approach, shape [pose arm]
    approach: np.ndarray  # from there to the grasp
    lift: np.ndarray  # from the grasp to above it
    carry: np.ndarray  # from there to above the place; where the robot drives, to how the object is carried
    lower: np.ndarray  # from there to the place
    retreat: np.ndarray  # from there with open fingers, back from the object
    # from above the grasp back to the point of approach, for an object that was not lifted; None: that is not free
    again: np.ndarray | None
    grasp: np.ndarray  # tool frame in the object's body frame when the fingers close, shape [4 4]
    opened: float  # distance of the pads before and after [m]
    driven: Driven | None = None  # between `carry` and `lower`; None: one base serves both ends

    def swept(self, spec: RobotSpec, surface: np.ndarray) -> np.ndarray:
        """Return points [point 3] that the arm, from home on, and the object's surface [point 3] in its hand pass."""
        to_start = np.linspace(spec.home, self.reach[0], 9)
        carried = np.concatenate([self.lift, self.carry, self.lower])
        arm = self.passed(spec, np.concatenate([to_start, self.reach, self.approach, carried, self.retreat]))
        base = matrix(self.base)
        body = base @ robot_shape(spec).kin.tool(carried) @ np.linalg.inv(self.grasp)
        held = surface @ body[:, :3, :3].transpose(0, 2, 1) + body[:, None, :3, 3]
        return np.concatenate([arm, held.reshape(-1, 3)])

    def passed(self, spec: RobotSpec, arm: np.ndarray) -> np.ndarray:
        """Return points [point 3] within the arm in joints [pose arm], scene frame."""
        shape, base = robot_shape(spec), matrix(self.base)
        return shape.centers(arm)[:, shape.moving].reshape(-1, 3) @ base[:3, :3].T + base[:3, 3]


@dataclass(frozen=True)
class StraightPaths:
    """The straight paths at start and place."""

    stand: Stand  # the base
    up: np.ndarray  # joints of approach and lift, shape [pose arm]
    held: np.ndarray  # the object in the tool frame [4 4]
    opened: float  # distance of the open pads [m]
    down: np.ndarray  # joints of lowering and retreat, shape [pose arm]

    @property
    def turn(self) -> float:
        """Largest turn of a joint between start and place [rad]."""
        return float(np.abs(self.down[0] - self.up[-1]).max())


def plan_pick(
    task: PickTask,
    spec: RobotSpec,
    seed: int = 0,
    fits: Fits | None = None,
    contacts: Sequence[Contact] = (FIRM,),
    grasps: GraspCache | None = None,
) -> PickPlan:
    """Return how a robot picks an object at a pose and places it at another.

    Args:
        task: what is done.
        spec: the robot.
        seed: of the searches.
        fits: which bases will do, of those where the robot can stand; None: all.
        contacts: how the object may be held, those that come first where there is a plan with them.
        grasps: grasps of this object by this robot, for several calls.

    Raises:
        Unreachable: no grasp, base or path was found.
    """
    planner = PickPlanner(task, spec, grasps or GraspCache(task.room.free[task.target], spec.gripper), seed)
    return planner.plan(fits, contacts)


class PickPlanner:
    """Base, grasp and paths for an object, cheapest tests first.

    Attributes:
        start: pose of the object where it is picked [4 4].
        goal: that where it is placed.
        cell: the robot in the room around both.
        points: on the object's surface, in its own frame [point 3].
        search: the bases and paths that were tried.
    """

    def __init__(self, task: PickTask, spec: RobotSpec, grasps: GraspCache, seed: int) -> None:
        """Take what is done, by which robot, and the object's grasps."""
        self._spec, self._grasps, self._seed, self._target = spec, grasps, seed, task.target
        self._starts = noisy_starts(spec, task.noise, seed) if task.noise else np.array([spec.home])
        self.start, self.goal, self._approach = matrix(task.start), matrix(task.goal), task.approach
        near = Obstacles.of_room(task.room, {task.target}, (task.start[:3] + task.goal[:3]) / 2)
        self.cell = Workcell(spec, near, task.floor)
        self.points = surface_points([c.mesh for c in task.room.free[task.target].colliders])
        self.search = Search(spec, self.cell.kin, seed)
        self._solved, self._counted = 0, 0

    def spend(self) -> bool:
        """Count the work since the last call; return whether that, or the time, for plans with the object is used up."""
        work = self.cell.obstacles.lookups + SOLVING * self._solved
        late = self._grasps.spend(work - self._counted)
        self._counted = work
        return late

    def plan(self, fits: Fits | None, contacts: Sequence[Contact]) -> PickPlan:
        """Return the first plan; Unreachable: there is none."""
        up, tried = self.start[2, :3], []
        for contact in contacts:
            for samples in SAMPLES:
                every = self._grasps(samples, contact, up)
                clear = self.diverse(every)
                tried.append((every, bool(clear)))
                if clear and (plan := self._with(every[clear], fits)) is not None:
                    return plan
                if len(clear) >= ENOUGH or self.spend():
                    break
        nearest = 0.0 if any(is_clear for _, is_clear in tried) else self._least([every for every, _ in tried])
        size = float(np.ptp(self.points, axis=0).min())
        error = failure(self._target, nearest, size, self.search.misses, self._spec, self._grasps.ended)
        error.graspable = any(len(every.tool) > 0 for every, _ in tried)
        if 0.0 < nearest < math.inf and not self.spend():
            ends = (self.start, self.goal)
            error.crowded = next((at for at in ends if not any(self._is_clear(each, at) for each, _ in tried)), None)
            self.spend()
        raise error

    def _with(self, grasps: ObjectGrasps, fits: Fits | None) -> PickPlan | None:
        places = {"grasp": self.start, "place": self.goal}
        pairs = chunks(itertools.islice(self.pairs(grasps.tool, places, fits=fits), PAIRS), AT_ONCE)
        in_time = itertools.takewhile(lambda _: not self.spend(), pairs)
        ordered = shorter_first(self._paths(some, grasps) for some in in_time)
        return next(filter(None, map(self._joined, ordered)), None)

    def pairs(
        self,
        grasps: np.ndarray,
        places: dict[str, np.ndarray],
        floor: FreeFloor | None = None,
        fits: Fits | None = None,
    ) -> Iterator[tuple[Stand, int]]:
        """Yield bases and indices of grasps [grasp 4 4] that reach, those where the arm was found to be clear first.

        Args:
            grasps: tool poses in the object's frame.
            places: poses of the object [4 4] by what is done there.
            floor: on which the robot drives to the bases; None: that of the task.
            fits: which bases will do; None: all.
        """
        later: list[tuple[Stand, int]] = []
        for some in chunks(self._bases(floor), BASES):
            if self.spend():
                return
            stands = some if fits is None else fits(some)
            self._solved += len(stands) * len(grasps)
            for stand, k, clear in reached(self.cell, places, stands, grasps, self._seed, self.search.misses):
                if clear:
                    yield stand, k
                else:
                    later.append((stand, k))
        yield from later

    def _bases(self, floor: FreeFloor | None) -> Iterator[Stand]:
        """Yield bases; those from which the arm, as it starts off home, may meet something, come last."""
        tight: list[Stand] = []
        cell = self.cell if floor is None else replace(self.cell, floor=floor)
        for stand in around(cell, self.start, self.goal):
            if self.cell.arm_depth(self._starts, stand.base).max() <= SLACK:
                yield stand
            else:
                tight.append(stand)
        yield from tight

    def _least(self, tried: list[ObjectGrasps]) -> float:
        """Return the penetration depth [m] of the grasp nearest to being clear, of up to SAMPLED of each; inf of none."""
        least = math.inf
        for grasps in tried:
            count = len(grasps.tool)
            for block in chunks(iter(range(0, count, math.ceil(max(count, 1) / SAMPLED))), BLOCK):
                least = min(least, float(self.depth(grasps[block], least).min()))
                if self.spend():
                    return least
        return least

    def depth(self, grasps: ObjectGrasps, limit: float = 0.0) -> np.ndarray:
        """Return how deep the gripper reaches into what is around start and place, shape [grasp]; see `gripper_depth`."""
        near, gripper, lengths = self.cell.obstacles, self._spec.gripper, (self._approach, LIFT)
        ends = (self.start, self.goal)
        return np.maximum(
            *(gripper_depth(near, gripper, at @ grasps.tool, grasps.opened, *lengths, limit) for at in ends)
        )

    def _is_clear(self, grasps: ObjectGrasps, at: np.ndarray) -> bool:
        """Return whether the gripper keeps clear with one of some grasps of the object at a pose [4 4]."""
        blocks = (grasps[block] for block in chunks(iter(range(len(grasps.tool))), BLOCK))
        near, gripper = self.cell.obstacles, self._spec.gripper
        depths = (gripper_depth(near, gripper, at @ g.tool, g.opened, self._approach, LIFT) for g in blocks)
        return any(bool((depth <= 0.0).any()) for depth in depths)

    def diverse(self, grasps: ObjectGrasps) -> list[int]:
        """Return up to GRASPS of them, in order, that keep clear.

        No two have nearly the same direction, so that those near to one that is kept need not be looked at.
        """
        chosen: list[int] = []
        for block in chunks(iter(range(len(grasps.tool))), BLOCK):
            some = [k for k in block if not is_near(grasps.tool[k], grasps.tool[chosen])]
            depth = self.depth(grasps[some]) if some else np.zeros(0)
            for k, reached_into in zip(some, depth, strict=True):
                # Only those that keep clear; the arm comes from somewhere above or beside, never from below.
                if reached_into <= 0.0 and not is_near(grasps.tool[k], grasps.tool[chosen]):
                    chosen.append(k)
                if len(chosen) == GRASPS:
                    return chosen
            if self.spend():
                break
        return chosen

    def _paths(self, pairs: list[tuple[Stand, int]], grasps: ObjectGrasps) -> Iterator[StraightPaths]:
        """Yield the straight paths for bases and indices of grasps; what fails is noted."""
        self._solved += len(pairs)
        stands, remedy = [stand for stand, _ in pairs], "; choose a place with more room"
        ups = np.stack([there_and_up(self.start @ grasps.tool[k], self._approach) for _, k in pairs])
        up = Follow("approach and lift", 1, ups, self.meets, IK_SEEDS, clear=BRANCHES, remedy=remedy)
        partial, downs = [], []
        for k, path in self.search.followed(stands, up):
            at = len(path) - 1 - round(LIFT / STEP)
            tool = self.cell.kin.tool(path[at : at + 1])[0]
            held = np.linalg.inv(tool) @ np.linalg.inv(stands[k].base) @ self.start
            down = self.goal @ np.linalg.inv(held)
            down[2, 3] += DROP
            partial.append((stands[k], path, held, float(grasps.opened[pairs[k][1]])))
            downs.append(there_and_up(down, self._approach)[::-1])
        if not partial:
            return
        lifted = np.stack([path[-1] for _, path, *_ in partial])
        lower = Follow(
            "lowering and retreat", 2, np.stack(downs), self.meets, IK_SEEDS, clear=BRANCHES, near=lifted,
            may_flip=False, remedy=remedy,
        )  # fmt: skip
        for k, path in self.search.followed([stand for stand, *_ in partial], lower):
            yield StraightPaths(*partial[k], path)

    def meets(self, stand: Stand, path: np.ndarray) -> Penetration:
        """Return how deep the arm reaches into something on a joint path [pose arm] from a base [m], and into what."""
        return self.cell.met(path, stand.base)

    def _joined(self, paths: StraightPaths) -> PickPlan | None:
        """Return a plan with these straight paths at start and place; None where what joins them is not free."""
        cell, search, stand, opened = self.cell, self.search, paths.stand, paths.opened
        body = np.linalg.inv(stand.base) @ self.start
        empty = cell.empty(stand.base, opened, self.points @ body[:3, :3].T + body[:3, 3])
        holding = cell.holding(stand.base, opened, paths.held, self.points)
        home, up, down = np.array(self._spec.home), paths.up, paths.down
        reach = search.joined(cell, stand, home, up[0], empty, "reach", 3, WIDE)
        carry = None if reach is None else search.joined(cell, stand, up[-1], down[0], holding, "carry", 4, WIDE)
        if reach is None or carry is None:
            return None
        again = search.joined(cell, stand, up[-1], up[0], empty, "reach again", 0, WIDE)
        at, low = len(up) - 1 - round(LIFT / STEP), round(LIFT / STEP)
        return PickPlan(
            stand.vector, stand.pedestal, reach, up[: at + 1], up[at:], carry, down[: low + 1], down[low:],
            again, np.linalg.inv(paths.held), opened,
        )  # fmt: skip


def shorter_first(blocks: Iterator[Iterator[StraightPaths]]) -> Iterator[StraightPaths]:
    """Yield straight paths; those for which the arm turns far between start and place after a look at MORE further blocks."""
    far: list[StraightPaths] = []
    for number, paths in enumerate(blocks):
        for each in paths:
            if each.turn > FAR:
                far.append(each)
            else:
                yield each
        if number >= MORE:
            yield from far
            far.clear()
    yield from far


def there_and_up(tool: np.ndarray, approach: float) -> np.ndarray:
    """Return poses [pose 4 4] from `approach` [m] before a tool pose [4 4] to it, and from there LIFT up, about STEP apart."""
    back = line(tool, -approach * tool[:3, 2])[::-1]
    return np.concatenate([back, line(tool, np.array([0.0, 0.0, LIFT]))[1:]])


def line(tool: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Return poses from a tool pose [4 4] to the same shifted by an offset [3], shape [pose 4 4]."""
    count = max(1, round(float(np.linalg.norm(offset)) / STEP)) + 1
    poses = np.tile(tool, (count, 1, 1))
    poses[:, :3, 3] += np.linspace(0.0, 1.0, count)[:, None] * offset
    return poses
