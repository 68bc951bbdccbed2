"""The search for where a robot can stand, reach, and move along a path: joint paths, or a reason for each base."""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.core.errors import InputError
from s2a.motion.workcell import Depth, Workcell
from s2a.robot.collision import SLACK, Penetration
from s2a.robot.kinematics import Kinematics
from s2a.robot.spec import RobotSpec
from s2a.robot.tool_path import follow, free_motion, turns

Item = TypeVar("Item")
UNREACHABLE = 10.0  # Depth [m] that stands for a path that the arm cannot follow
# [m] Heights of what the robot may stand on for an object; handles of wall cabinets and windows ask for more
PEDESTALS = (0.0, 0.2, 0.4, 0.6)
DIRECTIONS = 24  # Directions from which the robot may face the object: 14 cm apart, half of what the base is wide
# [m] Distances besides the robot's own, which are for handles in front of it:
# where there is little floor, these are left
FURTHER = 0.4, 0.8
# [rad] By which a base that drives is turned away from the object, its arm turned back: a long one fits beside furniture so
TURNS = (0.0, 0.7, -0.7, 1.4, -1.4)
BLOCK = 64  # Bases that are looked at together
IK_SEEDS = 12  # Starts of the inverse kinematics at each base, for a path that the arm follows
EXACT = 1e-3  # Root of the squared errors [m and rad] up to which inverse kinematics reaches a single pose


class Unreachable(InputError):
    """No plan: from which base which segment fails, by how much, and what to change.

    Attributes:
        crowded: pose of the object [4 4] at which no grasp is clear, whatever its other end; None: there is none.
        graspable: the gripper fits on the object, clear of the room or not; False: it was not seen.
    """

    crowded: np.ndarray | None = None
    graspable: bool = False


@dataclass(frozen=True, eq=False)
class Stand:
    """A place of the robot's base."""

    base: np.ndarray  # pose of the base [4 4], scene frame
    pedestal: float = 0.0  # height of what it stands on [m]
    turn: float = 0.0  # about the vertical axis of the arm's first joint, away from `facing` [rad]
    facing: np.ndarray | None = None  # pose of the base before that turn [4 4]; None: it is not turned
    words: str = ""  # the place in words; empty: its coordinates

    @property
    def vector(self) -> np.ndarray:
        """Pose of the base, 7-vector."""
        return np.array([*self.base[:3, 3], *Rotation.from_matrix(self.base[:3, :3]).as_quat()])

    def __str__(self) -> str:
        x, y = self.base[:2, 3]
        raised = f" on a pedestal of {self.pedestal:.2f} m" if self.pedestal else ""
        return self.words or f"at ({x:.2f}, {y:.2f}){raised}"


@dataclass(frozen=True)
class Miss:
    """Why a base does not serve."""

    order: int  # of the segment that fails, counted from the first one
    depth: float  # by how much [m]: of a penetration, or what a pose is missed by
    text: str  # the segment and the failure
    stand: Stand | None = None  # the base; None: none was tried, or it is of several

    def __str__(self) -> str:
        return f"{self.text} (base {self.stand})" if self.stand is not None else self.text


NO_BASE = Miss(
    -1,
    math.inf,
    "base: there is no free floor from which the arm reaches both ends of the motion; choose a place or part nearer to it",
)


@dataclass
class Misses:
    """Reasons why bases do not serve."""

    nearest: Miss = NO_BASE  # the miss that came farthest, and of those by the least
    of: dict[Stand, Miss] = field(default_factory=dict)  # that of each base, in the order in which they were tried

    def note(self, miss: Miss) -> None:
        """Keep a failure that came farther than all others, or missed by less; and so for its base alone."""
        if _progress(miss) > _progress(self.nearest):
            self.nearest = miss
        if miss.stand is not None and (miss.stand not in self.of or _progress(miss) > _progress(self.of[miss.stand])):
            self.of[miss.stand] = miss


def _progress(miss: Miss) -> tuple[int, float]:
    return miss.order, -miss.depth


@dataclass(frozen=True)
class Follow:
    """A segment of a motion on which the tool frame follows a path."""

    name: str  # of the segment; empty: it is the only one
    order: int  # of the segment in the motion
    # of the tool frame, shape [pose 4 4], or [stand pose 4 4] for a path of each base's own; scene frame
    poses: np.ndarray
    # base and joint path [pose arm] -> how deep the robot reaches into something on it [m], and into what
    meets: Callable[[Stand, np.ndarray], Penetration]
    ik_seeds: int | Sequence[int]  # starts of the inverse kinematics at each base; one number for all, or one each
    # joint paths at each base that are looked at, those that begin nearest to where the arm comes from first
    tried: int | None = None
    clear: int | None = None  # joint paths at each base that meet nothing, at most
    near: np.ndarray | None = None  # joints from which the arm comes, shape [stand arm]; None: home
    may_flip: bool = True  # The tool may be turned by half about the approach, its fingers exchanged
    reach_time: float = math.inf  # in which every joint, at full speed, has to turn from home to the path [s]
    remedy: str = ""  # what to change where no arm can follow

    @property
    def label(self) -> str:
        """The name, as it begins a message."""
        return f"{self.name}: " if self.name else ""


class Search:
    """Joint paths from bases along the segments of a motion, and why there is none.

    Attributes:
        misses: of all bases so far.
    """

    def __init__(self, spec: RobotSpec, kin: Kinematics, seed: int = 0) -> None:
        """Begin with nothing tried; `seed` is that of inverse kinematics and of searches for motions."""
        self.misses = Misses()
        self._spec, self._kin, self._seed = spec, kin, seed

    def unreachable(self, subject: str) -> Unreachable:
        """Return the error that says what cannot be done, and which base and segment come nearest to it."""
        return Unreachable(f"{subject}: {self.misses.nearest}")

    def paths(self, stands: Sequence[Stand], segment: Follow) -> list[np.ndarray]:
        """Return the joint paths along a segment from each base, shape [path pose arm], whatever they meet.

        A base that is turned about the arm's first axis has those of the base that is not, turned back.
        """
        facing = [stand.base if stand.facing is None else stand.facing for stand in stands]
        first = {pose.tobytes(): k for k, pose in reversed(list(enumerate(facing)))}
        own = sorted(first.values()) if segment.poses.ndim == 3 and segment.near is None else list(range(len(stands)))
        seeds = [int(count) for count in np.broadcast_to(segment.ik_seeds, len(stands))[own]]
        solved = follow(self._kin, segment.poses, np.stack([facing[k] for k in own]), seeds, self._seed, segment.near)
        each = dict(zip(own, solved, strict=True))
        axis = np.eye(len(self._kin.lower))[0]
        chosen = [each[k if len(own) == len(stands) else first[facing[k].tobytes()]] for k in range(len(stands))]
        return [paths - stand.turn * axis for stand, paths in zip(stands, chosen, strict=True)]

    def followed(self, stands: Sequence[Stand], segment: Follow) -> Iterator[tuple[int, np.ndarray]]:
        """Yield indices of bases, and joint paths [pose arm] from them on which the robot meets nothing along a segment.

        Inverse kinematics are solved for all bases together: they cost what starts them, not how many they are.
        """
        home, velocity = np.array(self._spec.home), np.array(self._spec.limits.velocity)
        if not stands:
            return
        for k, (stand, paths) in enumerate(zip(stands, self.paths(stands, segment), strict=True)):
            if not segment.may_flip:
                paths = self._unflipped(paths, stand, segment.poses[k])
            if not len(paths):
                text = f"{segment.label}the arm cannot reach along the whole path{segment.remedy}"
                self.misses.note(Miss(segment.order, UNREACHABLE, text, stand))
                continue
            paths = paths[((paths > self._kin.lower) & (paths < self._kin.upper)).all(axis=(1, 2))]
            paths = paths[(np.abs(paths[:, 0] - home) / velocity).max(axis=1) < segment.reach_time]
            if not len(paths):
                text = f"{segment.label}the arm cannot turn so far"
                self.misses.note(Miss(segment.order, UNREACHABLE, text, stand))
                continue
            start = home if segment.near is None else segment.near[k]
            order = np.argsort(np.abs(paths[:, 0] - start).max(axis=1), kind="stable")
            clear = (path for path in paths[order[: segment.tried]] if self._is_clear(stand, path, segment))
            for path in itertools.islice(clear, segment.clear):
                yield k, path

    def _is_clear(self, stand: Stand, path: np.ndarray, segment: Follow) -> bool:
        """Return whether the robot meets nothing on a joint path [pose arm]; what it meets is noted."""
        depth, what = segment.meets(stand, path)
        if depth > SLACK:
            text = f"{segment.label}the arm reaches {1000 * depth:.0f} mm into {what}"
            self.misses.note(Miss(segment.order, depth, text, stand))
        return depth <= SLACK

    def _unflipped(self, paths: np.ndarray, stand: Stand, poses: np.ndarray) -> np.ndarray:
        """Return those of joint paths [path pose arm] along tool poses [pose 4 4] on which the tool is not turned by half."""
        wanted = np.linalg.inv(stand.base) @ poses[0]
        turn = np.einsum("pij,ij->p", self._kin.tool(paths[:, 0])[:, :3, :3], wanted[:3, :3])
        return paths[turn > 2.9]  # the trace of a rotation by 0: 3; by half a turn: -1

    def moved(
        self, cell: Workcell, start: np.ndarray, goal: np.ndarray, depth: Depth, clearance: float = 0.0, again: int = 0
    ) -> np.ndarray | None:
        """Return a motion [pose arm] between joints [arm] that meets nothing by more than SLACK; None: none was found.

        Args:
            cell: the robot.
            start: joints [arm].
            goal: joints [arm].
            depth: of the arm in the obstacles.
            clearance: by which all is taken to be thicker [m].
            again: number of the attempt: each has a seed of its own.
        """

        def free(q: np.ndarray) -> np.ndarray:
            return cell.is_free(depth, q, clearance)

        if not free(np.stack([start, goal])).all():
            return None
        return free_motion(start, goal, self._kin.lower, self._kin.upper, free, self._seed + again)

    def joined(
        self,
        cell: Workcell,
        stand: Stand,
        start: np.ndarray,
        goal: np.ndarray,
        depth: Depth,
        name: str,
        order: int,
        wide: Sequence[float] = (),
    ) -> np.ndarray | None:
        """Return the motion [pose arm] of a segment between joints [arm]; None where none was found, which is noted.

        Of motions that keep the clearances `wide` [m], the first there is; else one that meets nothing.
        """
        path = self.moved(cell, start, goal, depth)
        if path is None:
            worst = float(depth(np.stack([start, goal]), 0.0).max())
            text = f"{name}: an end of the motion reaches {1000 * worst:.0f} mm into something"
            if worst <= SLACK:
                worst, text = 0.0, f"{name}: no collision-free motion was found"
            self.misses.note(Miss(order, worst, text, stand))
            return None
        wider = (self.moved(cell, start, goal, depth, more) for more in wide)
        return next((better for better in wider if better is not None), path)


def around(
    cell: Workcell, start: np.ndarray, goal: np.ndarray, pedestals: Sequence[float] = PEDESTALS
) -> Iterator[Stand]:
    """Yield bases about two poses [4 4] that an arm has to reach, where it stands clear, the preferred ones first.

    Args:
        cell: the robot among what is around it.
        start: pose of the object where it is picked, or of the tool at the beginning of a path.
        goal: that where it is placed, or at the end.
        pedestals: heights of what the robot may stand on [m].
    """
    spec = cell.spec.base
    distances = (*spec.distances, *FURTHER)
    middle = (start[:3, 3] + goal[:3, 3]) / 2
    angles = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    heights, turns = (pedestals, (0.0,)) if cell.heights is None else (cell.heights, TURNS)
    places = sorted(
        itertools.product(distances, angles, heights, turns),
        key=lambda p: abs(p[0] - distances[0]) + 0.3 * p[2] + 0.05 * abs(p[3]),
    )
    over = max(start[2, 3], goal[2, 3])
    spots = np.array([[*(middle[:2] + r * np.array([np.cos(a), np.sin(a)])), over] for r, a, *_ in places])
    floor, _ = cell.obstacles.below(spots)
    stands = np.isfinite(floor) & (floor <= floor[np.isfinite(floor)].min(initial=np.inf) + 0.05)
    if cell.floor is not None:  # a base that drives is as high as its floor, whatever the scan says below it
        floor = np.full(len(places), cell.floor.height)
    raised = np.array([height for _, _, height, _ in places])
    shoulders = np.c_[spots[:, :2], floor + raised + spec.shoulder_height]
    reach = np.max([np.linalg.norm(at[:3, 3] - shoulders, axis=1) for at in (start, goal)], axis=0)
    poses = np.tile(np.eye(4), (len(places), 1, 1))
    poses[:, :3, :3] = Rotation.from_euler("z", [[angle + np.pi] for _, angle, *_ in places]).as_matrix()
    poses[:, :3, 3] = np.c_[spots[:, :2], floor + raised]
    aside = np.array([turn for *_, turn in places])
    facing = poses.copy()
    poses[:, :3, :3] = poses[:, :3, :3] @ Rotation.from_euler("z", aside[:, None]).as_matrix()
    hopeful = np.flatnonzero(stands & (reach <= spec.reach + 0.1))
    for block in np.array_split(hopeful, max(1, math.ceil(len(hopeful) / BLOCK))):
        for k in block[cell.clear_stands(poses[block], raised[block])]:
            turned = facing[k] if aside[k] else None
            yield Stand(poses[k], float(raised[k]), float(aside[k]), turned)


def reached(
    cell: Workcell,
    places: dict[str, np.ndarray],
    stands: Sequence[Stand],
    grasps: np.ndarray,
    seed: int,
    misses: Misses,
) -> Iterator[tuple[Stand, int, bool]]:
    """Yield bases and grasps whose tool poses inverse kinematics reaches, and whether with the arm clear of the room.

    Bases and grasps are taken in turn: neither one base, from which no grasp does, nor one grasp, which does from no base,
    comes again and again. Where the arm is not clear, another elbow may be.

    Args:
        cell: the robot in the room around the object.
        places: poses of the object [4 4] by what is done there.
        stands: the bases.
        grasps: tool poses in the object's frame, shape [grasp 4 4].
        seed: of the starts.
        misses: gets how far the arm misses.
    """
    if not stands or not len(grasps):
        return
    poses = np.stack([stand.base for stand in stands])
    kin, seeds = cell.kin, 4
    ok = np.ones((len(stands), len(grasps)), bool)
    clear = ok.copy()
    starts = np.random.default_rng(seed).uniform(kin.lower, kin.upper, (seeds, len(kin.lower)))
    starts[0] = kin.spec.home
    left_by = np.zeros((len(places), *ok.shape))
    errors = np.zeros((len(places), *ok.shape, 2))
    for i, at in enumerate(places.values()):
        wanted = np.linalg.inv(poses)[:, None] @ (at @ grasps)[None]
        targets = np.repeat(wanted.reshape(-1, 4, 4), seeds, axis=0)
        q, left = kin.solve(targets, np.tile(starts, (len(targets) // seeds, 1)), iterations=30, damping=1e-2)
        good = left < EXACT
        left_by[i], errors[i] = _nearest(kin.tool(q), targets, left, ok.shape)
        depth = np.full(len(q), np.inf)
        owner = np.repeat(poses, len(grasps) * seeds, axis=0)
        depth[good] = cell.arm_depth(q[good], owner[good], fingers=False)
        smallest = depth.reshape(*ok.shape, seeds).min(axis=2)
        ok &= np.isfinite(smallest)
        clear &= smallest <= SLACK
    _note(left_by, errors, list(places), stands, misses)
    rank = np.cumsum(ok, axis=1) + np.cumsum(ok, axis=0)
    for b, k in sorted(np.argwhere(ok), key=lambda pair: (rank[tuple(pair)], *pair)):
        yield stands[b], int(k), bool(clear[b, k])


def _nearest(
    tool: np.ndarray, targets: np.ndarray, left: np.ndarray, shape: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Return what the best start of every base and grasp leaves, shape [base grasp], and its errors [m, rad], [base grasp 2].

    Args:
        tool: poses reached [pose 4 4], all starts of a base and grasp in a row.
        targets: poses wanted, likewise.
        left: by inverse kinematics, shape [pose].
        shape: numbers of bases and grasps.
    """
    best = left.reshape(*shape, -1).argmin(axis=2)
    best = best + np.arange(best.size).reshape(shape) * (len(left) // best.size)
    angle = turns(np.swapaxes(tool[best][..., :3, :3], -1, -2) @ targets[best][..., :3, :3])
    far = np.linalg.norm(tool[best][..., :3, 3] - targets[best][..., :3, 3], axis=-1)
    return left[best], np.stack([far, angle], axis=-1)


def _note(left_by: np.ndarray, errors: np.ndarray, names: list[str], stands: Sequence[Stand], misses: Misses) -> None:
    """Note the nearest miss of each base: of the grasp whose worst place is best.

    Args:
        left_by: what inverse kinematics leaves, shape [place base grasp].
        errors: of position and angle [m, rad], shape [place base grasp 2].
        names: of the places.
        stands: the bases.
        misses: gets them, unless a grasp reaches all places.
    """
    worst = left_by.max(axis=0)
    for b, k in enumerate(worst.argmin(axis=1)):
        if worst[b, k] < EXACT:
            continue
        place = int(left_by[:, b, k].argmax())
        far, angle = errors[place, b, k]
        text = f"{names[place]}: the arm's nearest miss is {1000 * far:.0f} mm and {np.degrees(angle):.0f} degrees"
        misses.note(Miss(0, float(worst[b, k]), f"{text}; choose a place nearer to free floor", stands[b]))


def chunks(items: Iterator[Item], size: int) -> Iterator[list[Item]]:
    """Yield lists of some items."""
    while some := list(itertools.islice(items, size)):
        yield some
