"""The base pose of the robot: where its arm can follow the whole path of the handle without a collision."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from s2a.core.bounds import Count, Numbers, Positive
from s2a.prepare.candidates import Candidate, Ground, candidates, turned
from s2a.prepare.obstacles import Obstacles
from s2a.prepare.path_clearance import UNREACHABLE, path_collision, start_collision
from s2a.robot.collision import SLACK, Penetration, robot_shape
from s2a.robot.spec import RobotSpec
from s2a.robot.tool_path import follow, opening_coordinate, part_path
from s2a.scan.evidence.floor import FloorConfig
from s2a.scene.scene import Mesh, Scene, Vec3
from s2a.scene.usd.sim_scene import Grasp, Quat

CHUNK, ENOUGH = 24, 8
"""Places that are looked at before the reach of those with a free start is computed at once, if there are so many of these."""
STUCK = 1.0
"""Depth [m] that stands for a place where the base cannot stand."""


@dataclass(frozen=True)
class BaseConfig:
    """Candidate base poses; the robot's spec has the distances.

    The first place that serves is taken, nearest to the preferred one first: the first distance, straight before the
    handle, facing it, on the floor.

    Attributes:
        sides: how far to the side of the handle it may stand [m].
        turns: how far it may look past the handle [rad].
        pedestals: heights of what it may stand on [m].
        approach: distance before the handle from which the gripper moves straight to it [m].
        opening: path of the handle that the arm has to follow [m]; less where the joint ends earlier.
        ik_seeds: starts of the inverse kinematics at each place, for both gripper rolls.
        query_radius: how far from the handle the room is looked at [m].
        search: other places than the preferred one are tried.
        floor: when it stands on scanned floor; not asked where no part is labelled as floor.
    """

    sides: Numbers
    turns: Numbers
    pedestals: Numbers
    approach: Positive
    opening: Positive
    ik_seeds: Count
    query_radius: Positive
    search: bool
    floor: FloorConfig


@dataclass(frozen=True)
class BasePose:
    """Where the robot stands.

    Attributes:
        position: of its base [m].
        orientation: quaternion xyzw; x looks ahead.
        reason: why there, in words.
        pedestal: height of what it stands on above the floor [m].
        free: the arm reaches the whole path without a collision.
    """

    position: Vec3
    orientation: Quat
    reason: str
    pedestal: float
    free: bool


@dataclass(frozen=True)
class _Facing:
    """A robot at a place, looking at the handle or past it.

    Attributes:
        base: pose of the base, shape [4 4], scene frame.
        place: where it stands.
        near: what it can collide with.
        measure: returns what `start` does.
    """

    base: np.ndarray
    place: Candidate
    near: Obstacles
    measure: Callable[[], Penetration]

    @cached_property
    def start(self) -> Penetration:
        """Its collision before the arm moves along a path: depth [m] and words; `STUCK` where its foot cannot stand."""
        return self.measure()


@dataclass(frozen=True)
class _Failure:
    """A facing that does not serve: how deep it collides [m], and with what; `waits`: unless the arm cannot even reach."""

    depth: float
    problem: str
    base: np.ndarray
    place: Candidate
    waits: bool = False


def find_base(
    scene: Scene,
    target: str,
    grasp: Grasp,
    moving: Sequence[str],
    swept: Sequence[Mesh],
    config: BaseConfig,
    robot: RobotSpec,
) -> BasePose:
    """Return where the robot stands to open a part.

    Args:
        scene: the room.
        target: the part.
        grasp: where it is taken hold of.
        moving: ids of all parts that move.
        swept: collision hulls that cover their path.
        config: where the robot may stand.
        robot: the robot.
    """
    joint, point = scene.joint(target), np.array(grasp.point)
    opening = opening_coordinate(joint, point, config.opening)
    held = np.array([*grasp.point, *grasp.orientation])
    poses = part_path(joint, held, config.approach, opening).poses
    near = Obstacles(scene, moving, point, config.query_radius)
    ground = Ground(scene, target, point, near, swept, config.floor, robot)
    search = _Search(poses, near, ground, config, robot)
    return search.first_free() or search.nearest()


class _Search:
    """The search for a place from which a part can be opened.

    Inverse kinematics take most of the time: they are asked for many places at once, and for none where the robot starts in
    something.
    """

    def __init__(
        self, poses: np.ndarray, near: Obstacles, ground: Ground, config: BaseConfig, robot: RobotSpec
    ) -> None:
        """Take the tool frame's poses on the path of the handle [pose 4 4], what is near it, and the floor before it."""
        self._poses, self._near, self._ground = poses, near, ground
        self._config, self._robot, self._shape = config, robot, robot_shape(robot)
        places = candidates(robot.base.distances, config.sides, config.pedestals)
        self._places = places if config.search else places[:1]
        self._failures: list[_Failure] = []

    def first_free(self) -> BasePose | None:
        """Return the first place that serves."""
        hopeful: list[list[_Facing]] = []
        for k, place in enumerate(self._places):
            facings = self._stand(place)
            starts = any(facing.start[0] <= SLACK for facing in facings)
            if starts or (facings and k == 0):  # why the preferred place was not taken is said in any case
                hopeful.append(facings)
            else:
                self._failures += [_Failure(*f.start, f.base, f.place, f.start[0] < STUCK) for f in facings]
            enough = len(hopeful) >= ENOUGH and k % CHUNK == 0
            if (k == 0 and starts) or enough or place is self._places[-1]:
                found = self._first_served(hopeful)
                if found is not None:
                    return found
                hopeful = []
        return None

    def nearest(self) -> BasePose:
        """Return the place where the robot collides least, once no other is left."""
        order = sorted(self._failures, key=lambda failure: failure.depth)
        for start in range(0, len(order), CHUNK):
            some = order[start : start + CHUNK]
            asked = list(dict.fromkeys(f.place.standing for f in some if f.waits))
            reached = dict(zip(asked, self._paths(asked), strict=True))
            for failure in some:
                if not failure.waits or len(reached[failure.place.standing]):
                    words = f"{failure.place}, though {failure.problem}; no place is free"
                    return _chosen(failure.base, failure.place, words, False)
        raise AssertionError("the preferred place was tried to the end")

    def _stand(self, place: Candidate) -> list[_Facing]:
        """Return the robot at a place, facing the handle or turned past it; nothing where it cannot stand, which is noted."""
        base = self._ground.base(place)
        if (problem := self._ground.taken(base, place)) is not None:
            self._failures.append(_Failure(STUCK, problem, base, place))
            return []
        found = []
        for turn in self._config.turns if self._config.search else self._config.turns[:1]:
            seen, there = turned(base, turn, self._shape.kin.shoulder), replace(place, turn=turn)
            near = self._near.with_pedestal(seen[:3, 3], place.pedestal, self._robot.base.radius)
            # The foot of a robot whose arm is not on its axis moves when the robot turns about its shoulder.
            moves = not np.allclose(seen[:3, 3], base[:3, 3])
            stuck = self._ground.taken(seen, there) if moves else None
            start = partial(start_collision, near, self._shape, seen, self._poses[0])
            found.append(_Facing(seen, there, near, partial(_stuck, stuck) if stuck else start))
        return found

    def _first_served(self, stands: Sequence[list[_Facing]]) -> BasePose | None:
        """Return the first facing that serves; note the others."""
        first = np.eye(len(self._robot.arm_joints))[0]
        for facings, paths in zip(stands, self._paths([f[0].place.standing for f in stands]), strict=True):
            for facing in facings if len(paths) else facings[:1]:
                depth, problem = facing.start
                if not len(paths) and depth < STUCK:
                    depth, problem = UNREACHABLE, "the arm cannot reach along the whole path"
                elif depth <= SLACK:
                    seen = paths - facing.place.turn * first
                    depth, problem = path_collision(facing.near, self._shape, facing.base, seen)
                if depth <= SLACK:
                    return _chosen(facing.base, facing.place, self._praise(facing.place), True)
                self._failures.append(_Failure(depth, problem, facing.base, facing.place))
        return None

    def _paths(self, places: Sequence[Candidate]) -> list[np.ndarray]:
        """Return the joint paths from each place, shape [path pose arm]; the preferred one is tried harder."""
        if not places:
            return []
        ik_seeds = [self._config.ik_seeds * (4 if place == self._places[0] else 1) for place in places]
        return follow(self._shape.kin, self._poses, np.array([self._ground.base(p) for p in places]), ik_seeds)

    def _praise(self, place: Candidate) -> str:
        """Return why a place was taken, and what was wrong with the preferred one."""
        wrong = [failure for failure in self._failures if failure.place.standing == self._places[0]]
        instead = f" (not {wrong[0].place}: {wrong[0].problem})" if wrong else ""
        return f"{place}; the arm reaches the whole path, start and path are free{instead}"


def _stuck(problem: str) -> Penetration:
    return STUCK, problem


def _chosen(base: np.ndarray, place: Candidate, reason: str, free: bool) -> BasePose:
    x, y, z = map(float, base[:3, 3])
    half = math.atan2(base[1, 0], base[0, 0]) / 2
    return BasePose((x, y, z), (0.0, 0.0, math.sin(half), math.cos(half)), reason, place.pedestal, free)
