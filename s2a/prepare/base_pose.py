"""The base pose of the robot: where its arm can follow the whole path of the handle without a collision."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.evidence.floor import FloorConfig, floor_fraction
from s2a.geometry.convex import column, overlap
from s2a.prepare.grasp import floor_height, floor_points, heading, lowest_point
from s2a.prepare.obstacles import Obstacles
from s2a.prepare.path_clearance import deepest_collision
from s2a.ranges import Count, Numbers, Positive
from s2a.robot.collision import SLACK, robot_shape
from s2a.robot.joint_path import follow
from s2a.robot.spec import RobotSpec
from s2a.robot.tool_path import opening_coordinate, part_path
from s2a.scene import Mesh, Scene, Vec3
from s2a.usd.sim_scene import Grasp, Quat

CHUNK = 24
"""Places whose reach is computed at once."""
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
class Candidate:
    """A candidate: distance and offset to the side [m], height of the pedestal [m], turn [rad]."""

    distance: float
    side: float
    pedestal: float
    turn: float = 0.0

    def __str__(self) -> str:
        words = [f"{self.distance:.2f} m before the handle"]
        words += [f"{abs(self.side):.2f} m to its {'left' if self.side > 0 else 'right'}"] if self.side else []
        words += [f"on a pedestal of {self.pedestal:.2f} m"] if self.pedestal else ["on the floor"]
        words += [f"turned by {math.degrees(self.turn):.0f} degrees"] if self.turn else []
        return ", ".join(words)


Tried = tuple[float, str, np.ndarray, Candidate]
"""A place that does not serve: depth of the collision [m], words for it, pose of the base, place."""


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
    search = _Search(scene, target, grasp, moving, swept, config, robot)
    tried: list[Tried] = []
    for places in _places(config, robot.base.distances):
        found = search.first_free(places, tried)
        if found is not None:
            return found
    depth, problem, base, place = min(tried, key=lambda t: t[0])
    return _chosen(base, place, f"{place}, though {problem}; no place is free", False)


class _Search:
    """The search for a place from which a part can be opened."""

    def __init__(
        self,
        scene: Scene,
        target: str,
        grasp: Grasp,
        moving: Sequence[str],
        swept: Sequence[Mesh],
        config: BaseConfig,
        robot: RobotSpec,
    ) -> None:
        joint, self._point = scene.joint(target), np.array(grasp.point)
        opening = opening_coordinate(joint, self._point, config.opening)
        held = np.array([*grasp.point, *grasp.orientation])
        self._poses = part_path(joint, held, config.approach, opening).poses
        self._near = Obstacles(scene, moving, self._point, config.query_radius)
        self._ahead, floor = heading(scene, target), floor_points(scene)
        self._asks_floor = len(floor) > 0
        self._floor = floor if self._asks_floor else lowest_point(scene)
        self._swept, self._config, self._robot, self._shape = swept, config, robot, robot_shape(robot)

    def first_free(self, places: Sequence[Candidate], tried: list[Tried]) -> BasePose | None:
        """Return the first place that serves; add the others to those tried."""
        poses = [_pose(self._floor, self._point, self._ahead, place) for place in places]
        taken = [self._taken(base, place) for base, place in zip(poses, places, strict=True)]
        tried += [
            (STUCK, problem, base, place)
            for problem, base, place in zip(taken, poses, places, strict=True)
            if problem is not None
        ]
        open_places = [
            (base, place) for problem, base, place in zip(taken, poses, places, strict=True) if problem is None
        ]
        if not open_places:
            return None
        # The preferred place is not given up before it was tried hard.
        ik_seeds = self._config.ik_seeds * (4 if len(places) == 1 else 1)
        paths = follow(self._shape.kin, self._poses, np.array([base for base, _ in open_places]), ik_seeds)
        for (base, place), found in zip(open_places, paths, strict=True):
            chosen = self._facing(base, place, found, tried)
            if chosen is not None:
                return chosen
        return None

    def _facing(self, base: np.ndarray, place: Candidate, paths: np.ndarray, tried: list[Tried]) -> BasePose | None:
        """Return a place if the robot is free there, facing the handle or turned past it; else add it to those tried."""
        first = np.eye(len(self._robot.arm_joints))[0]
        for turn in self._config.turns if self._config.search and len(paths) else self._config.turns[:1]:
            turned, there = _turned(base, turn, self._shape.kin.shoulder), replace(place, turn=turn)
            # The foot of a robot whose arm is not on its axis moves when the robot turns about its shoulder.
            if not np.allclose(turned[:3, 3], base[:3, 3]) and (problem := self._taken(turned, there)) is not None:
                tried.append((STUCK, problem, turned, there))
                continue
            near = self._near.with_pedestal(turned[:3, 3], place.pedestal, self._robot.base.radius)
            depth, problem = deepest_collision(near, self._shape, turned, self._poses, paths - turn * first)
            if depth <= SLACK:
                return _chosen(turned, there, _praise(there, tried), True)
            tried.append((depth, problem, turned, there))
        return None

    def _taken(self, base: np.ndarray, place: Candidate) -> str | None:
        """Return why a base cannot stand at a place, or None if it can."""
        body, foot = self._robot.base, base[:3, 3]
        floor = foot[2] - place.pedestal
        low, high = floor + 0.05 + body.radius, foot[2] + body.shoulder_height
        standing = self._near.standing_in(foot[:2], low, high, body.radius)
        if standing is not None:
            return f"{standing} stands where the base has to stand"
        if self._asks_floor and not self._on_floor(foot, place):
            return "no floor was scanned there"
        height = place.pedestal + body.shoulder_height + body.upper_arm
        trunk = column(np.array([*foot[:2], floor]), body.radius, height)
        opens_into = any(overlap(trunk, piece) > 1e-3 for piece in self._swept)
        return "the part would open into the base" if opens_into else None

    def _on_floor(self, foot: np.ndarray, place: Candidate) -> bool:
        """Return True if there is scanned floor below a base [3]; `s2a certify` asks the same."""
        known, radius = self._config.floor, self._robot.base.radius
        below = floor_fraction(foot, place.pedestal, radius, self._near.surface, known.tolerance)
        return below >= known.min_fraction


def _praise(place: Candidate, tried: Sequence[Tried]) -> str:
    """Return why a place was taken."""
    instead = f" (not {tried[0][3]}: {tried[0][1]})" if tried else ""
    return f"{place}; the arm reaches the whole path, start and path are free{instead}"


def _places(config: BaseConfig, distances: Sequence[float]) -> Iterator[list[Candidate]]:
    """Yield the places in the order of how far they are from the preferred one."""
    places = [Candidate(*p) for p in itertools.product(distances, config.sides, config.pedestals)]
    places = sorted(places, key=lambda p: abs(p.distance - distances[0]) + abs(p.side) + 0.5 * p.pedestal)
    places = places if config.search else places[:1]
    yield places[:1]
    for k in range(1, len(places), CHUNK):
        yield places[k : k + CHUNK]


def _pose(floor: np.ndarray, point: np.ndarray, ahead: np.ndarray, place: Candidate) -> np.ndarray:
    """Return the pose [4 4] of the base at a place above the floor's points [point 3], facing the handle."""
    left = np.array([-ahead[1], ahead[0]])
    position = point[:2] - place.distance * ahead + place.side * left
    towards = point[:2] - position
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("z", math.atan2(towards[1], towards[0])).as_matrix()
    pose[:3, 3] = [*position, floor_height(floor, position) + place.pedestal]
    return pose


def _chosen(base: np.ndarray, place: Candidate, reason: str, free: bool) -> BasePose:
    x, y, z = map(float, base[:3, 3])
    half = math.atan2(base[1, 0], base[0, 0]) / 2
    return BasePose((x, y, z), (0.0, 0.0, math.sin(half), math.cos(half)), reason, place.pedestal, free)


def _turned(base: np.ndarray, turn: float, shoulder: np.ndarray) -> np.ndarray:
    """Return a base turned about its arm's vertical first axis, through a point [3] of its frame."""
    pose = base.copy()
    pose[:3, :3] = base[:3, :3] @ Rotation.from_euler("z", turn).as_matrix()
    pose[:3, 3] += (base[:3, :3] - pose[:3, :3]) @ shoulder
    return pose
