"""Where a robot may stand to move a part as far as a task asks for: a search over all tool poses of the task."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.planner.free_motion import free_motion
from s2a.planner.insides import moved_room
from s2a.planner.misses import Misses, Unreachable
from s2a.planner.obstacles import RoomHulls
from s2a.planner.part_reach import all_free, arm_in_part, is_free, lines, noisy_starts, part_hulls
from s2a.planner.pick_base import arm_depth, bases, chunks
from s2a.robot.collision import SLACK, robot_shape
from s2a.robot.spec import RobotSpec
from s2a.robot.tool_path import ToolPath, follow, matrices
from s2a.scene.articulation import transform
from s2a.sim.world import SimStage

IK_SEEDS, BRANCHES, AT_ONCE = 12, 4, 24
"""Starts of the inverse kinematics at each base, joint paths that are looked at there, and bases that are tried together."""
PEDESTALS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
"""[m] Heights of what the robot may stand on; as `s2a prepare` has them."""
BENT = 12
"""Bases for which a motion around what is in the way is searched, where from none the straight line is free."""
STOPS = 5
"""Coordinates of the part at which the base must be clear of it."""
Based = tuple[np.ndarray, float]
"""Pose [4 4] of a base and height of its pedestal [m]."""


def with_base(stage: SimStage, path: ToolPath, spec: RobotSpec, noise: float, seed: int = 0) -> SimStage:
    """Return a stage with the robot where it can follow a tool path with the part, and reach its beginning from home.

    The prepared base is taken if it serves. Bases from which the straight line to the beginning is free come first.

    Args:
        stage: of the part.
        path: of a task, to the part's handle and with it; the part stands at its first coordinate.
        spec: the robot.
        noise: how far from home an episode may start [rad].
        seed: of the searches.

    Raises:
        Unreachable: no base does, with the segment that comes farthest.
    """
    found = _Search(stage, path, spec, noise, seed).first()
    if found is None:
        return stage
    base, height = found
    vector = np.array([*base[:3, 3], *Rotation.from_matrix(base[:3, :3]).as_quat()])
    return replace(stage, base=vector, pedestal=(height, spec.base.radius))


class _Search:
    """The search, cheapest tests first."""

    def __init__(self, stage: SimStage, path: ToolPath, spec: RobotSpec, noise: float, seed: int) -> None:
        self._stage, self._path, self._spec, self._seed = stage, path, spec, seed
        self._opened = 0.0 if path.pushes or stage.internal else None
        self._shape, self._misses = robot_shape(spec), Misses()
        self._starts = noisy_starts(spec, noise, seed)
        room, target = stage.room, stage.target
        about = (path.poses[0, :3, 3] + path.poses[-1, :3, 3]) / 2
        riders = {i for i in room.articulations if target in room.carriers(i)}
        self._around = RoomHulls(room, {target, *riders}, about)
        self._start = RoomHulls(moved_room(room, target, float(path.q[0]), {}), (), about)
        self._part = part_hulls(stage)

    def first(self) -> Based | None:
        """Return the first base that serves; None: the prepared one."""
        prepared = (matrices(self._stage.base[None])[0], self._stage.pedestal[0])
        bent: list[tuple[Based, np.ndarray]] = []
        for some in itertools.chain(
            [[prepared] if self._is_beside(*prepared) else []], chunks(self._standing(), AT_ONCE)
        ):
            for based, path in self._followed(some):
                if self._is_straight(path[0], based[0]):
                    return None if based is prepared else based
                bent.append((based, path))
        for based, path in bent[:BENT]:
            if self._reaches(path[0], based[0]):
                return None if based is prepared else based
        raise Unreachable(f"{self._stage.target!r} cannot be moved so far: {self._misses.text}")

    def _followed(self, some: list[Based]) -> Iterator[tuple[Based, np.ndarray]]:
        """Yield of bases those from which the arm follows the path clear of all, each with its joint path [pose arm]."""
        kin = self._shape.kin
        if not some:
            return
        found = follow(kin, self._path.poses, np.stack([base for base, _ in some]), IK_SEEDS, self._seed)
        if not any(map(len, found)):
            self._misses.note(0, 1.0, "handle: the arm cannot follow the handle's path from any base")
        for based, paths in zip(some, found, strict=True):
            order = np.argsort(np.abs(paths[:, 0] - np.array(kin.spec.home)).max(axis=1))
            for k in order[:BRANCHES]:
                if self._is_clear(paths[k], based[0]):
                    yield based, paths[k]

    def _standing(self) -> Iterator[Based]:
        """Yield bases at which the robot stands clear of the room and of the part, however far it is open."""
        for base, pedestal in bases(self._shape, self._start, self._path.poses[0], self._path.poses[-1], PEDESTALS):
            if self._is_beside(base, pedestal):
                yield base, pedestal

    def _is_beside(self, base: np.ndarray, pedestal: float) -> bool:
        """Return whether a base, what it stands on and the shoulder are beside the part's way."""
        column = np.arange(0.05 - pedestal, self._spec.base.shoulder_height, self._spec.base.radius)
        stand = base[:3, 3] + column[:, None] * [0.0, 0.0, 1.0]
        turns = [transform(self._stage.joint, q) for q in np.linspace(self._path.q[0], self._path.q[-1], STOPS)]
        swept = np.stack([_moved(stand, turn) for turn in turns])
        if self._part.depth(swept, np.full(len(stand), self._spec.base.radius)).max() <= 0.0:
            return True
        self._misses.note(0, 1.0, "base: the part would move into the robot")
        return False

    def _is_clear(self, path: np.ndarray, base: np.ndarray) -> bool:
        """Return whether the arm is clear of all on a joint path [pose arm]."""
        depths = {
            "the room": float(arm_depth(self._shape, self._around, path, base, fingers=False).max()),
            "the part": arm_in_part(self._shape, self._part, self._stage.joint, self._path.q, path, base),
            "itself": self._shape.self_penetration(path)[0],
        }
        worst = max(depths, key=lambda name: depths[name])
        if depths[worst] > SLACK:
            text = f"handle: the arm reaches {1000 * depths[worst]:.0f} mm into {worst} as it moves the part"
            self._misses.note(1, depths[worst], text)
        return depths[worst] <= SLACK

    def _is_straight(self, goal: np.ndarray, base: np.ndarray) -> bool:
        """Return whether the straight lines from all starts to joints [arm] are free."""
        free = partial(all_free, self._shape, self._start, base, opened=self._opened)
        return free(self._starts) and free(lines(self._starts, goal))

    def _reaches(self, goal: np.ndarray, base: np.ndarray) -> bool:
        """Return whether all starts are free, and a motion from home to joints [arm]."""
        kin, home = self._shape.kin, np.array(self._spec.home)
        ends = np.concatenate([self._starts, goal[None]])
        depth = float(arm_depth(self._shape, self._start, ends, base, opened=self._opened).max())
        free = is_free(self._shape, self._start, base, self._opened)
        found = depth <= SLACK and free_motion(home, goal, kin.lower, kin.upper, free, self._seed) is not None
        if not found:
            text = f"reach: its ends reach {1000 * depth:.0f} mm into something, or no collision-free motion was found"
            self._misses.note(2, depth, text)
        return found


def _moved(points: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """Return points [point 3] as they are in a frame [4 4] that moved."""
    back = np.linalg.inv(moved)
    return points @ back[:3, :3].T + back[:3, 3]
