"""Where the robot stands: where its arm reaches the whole way of the handle and nothing is in its own way."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.articulation import lever_arm, open_limit
from s2a.geometry.convex import column, overlap
from s2a.prepare.grasp import floor_height, floor_points, heading
from s2a.prepare.obstacles import Surroundings
from s2a.prepare.path_clearance import deepest_clash
from s2a.prepare.reach import follow, hand_way
from s2a.ranges import Count, Numbers, Positive
from s2a.robot import panda
from s2a.scene import Joint, Mesh, Scene, Vec3
from s2a.usd.sim_scene import Grasp, Quat

CHUNK = 24
"""Places whose reach is asked for at once."""
UPPER_ARM = 0.42
"""[m] Its length and the radius of the elbow: so far above the shoulder no part may open into where the arm stands."""
STUCK = 1.0
"""What counts for the depth [m] of a clash where the base cannot stand."""


@dataclass(frozen=True)
class BaseConfig:
    """Where the robot may stand.

    The first place that serves is taken, nearest to the preferred one first: the first distance, straight before the
    handle, facing it, on the floor.

    Attributes:
        distances: horizontal distances of the base from the grasp point [m], the preferred one first.
        sides: how far to the side of the handle it may stand [m].
        turns: how far it may look past the handle [rad].
        pedestals: heights of what it may stand on [m].
        radius: of the upright column that its foot and shoulder fill [m].
        start: joints in which the arm starts [rad]; those of the simulation.
        approach: distance before the handle from which the hand moves straight to it [m].
        opening: way of the handle that the arm has to follow [m]; less where the joint ends earlier.
        restarts: random starts of the inverse kinematics at each place, for either way round of the hand.
        tracks: starts that have to lead along the whole way: another solver finds one of several more surely.
        around: how far from the handle the room is looked at [m].
        search: whether other places than the preferred one are looked at.
    """

    distances: Numbers
    sides: Numbers
    turns: Numbers
    pedestals: Numbers
    radius: Positive
    start: tuple[float, float, float, float, float, float, float]
    approach: Positive
    opening: Positive
    restarts: Count
    tracks: Count
    around: Positive
    search: bool


@dataclass(frozen=True)
class BasePose:
    """Where the robot stands.

    Attributes:
        position: of its base [m].
        orientation: quaternion xyzw; x looks ahead.
        reason: why there, in words.
        pedestal: height of what it stands on above the floor [m].
        free: whether the arm reaches the whole way and touches nothing on it.
    """

    position: Vec3
    orientation: Quat
    reason: str
    pedestal: float
    free: bool


@dataclass(frozen=True)
class Place:
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


def find_base(
    scene: Scene, target: str, grasp: Grasp, moving: Sequence[str], swept: Sequence[Mesh], config: BaseConfig
) -> BasePose:
    """Return where the robot stands to open a part.

    Args:
        scene: the room.
        target: the part.
        grasp: where it is taken hold of.
        moving: ids of all parts that move.
        swept: convex pieces that cover their way.
        config: where the robot may stand.
    """
    joint, point = scene.joint(target), np.array(grasp.point)
    way = hand_way(grasp, joint, config.approach, _opening(joint, point, config))
    near = Surroundings(scene, moving, point, config.around)
    ahead, floor, start = heading(scene, target), floor_points(scene), np.array(config.start)
    tried: list[tuple[float, str, np.ndarray, Place]] = []
    for chunk in _places(config):
        poses = [_pose(floor, point, ahead, place) for place in chunk]
        taken = [_taken(near, swept, base, place, config.radius) for base, place in zip(poses, chunk, strict=True)]
        free = [k for k, problem in enumerate(taken) if problem is None]
        tried += [(STUCK, f"{taken[k]}", poses[k], chunk[k]) for k in range(len(chunk)) if k not in free]
        if not free:
            continue
        # The preferred place is not given up before it was tried hard.
        restarts = config.restarts * (4 if len(chunk) == 1 else 1)
        tracks = follow(way, np.array([poses[k] for k in free]), start, restarts)
        for k, track in zip(free, tracks, strict=True):
            for turn in config.turns if config.search else config.turns[:1]:
                place, base = replace(chunk[k], turn=turn), _turned(poses[k], turn)
                enough = track if len(track) >= config.tracks else track[:0]
                around = near.with_pedestal(base[:3, 3], place.pedestal, config.radius)
                depth, problem = deepest_clash(around, base, turn, way, enough, start)
                if depth <= 0.0:
                    return _chosen(base, place, _praise(place, tried), True)
                tried.append((depth, problem, base, place))
                if not len(enough):
                    break
    depth, problem, base, place = min(tried, key=lambda t: t[0])
    return _chosen(base, place, f"{place}, though {problem}; no place is free", False)


def _praise(place: Place, tried: Sequence[tuple[float, str, np.ndarray, Place]]) -> str:
    """Return why a place was taken."""
    instead = f" (not {tried[0][3]}: {tried[0][1]})" if tried else ""
    return f"{place}; the arm reaches the whole way, start and way are free{instead}"


def _taken(near: Surroundings, swept: Sequence[Mesh], base: np.ndarray, place: Place, radius: float) -> str | None:
    """Return why a base cannot stand at a place, or None if it can."""
    foot, floor = base[:3, 3], base[2, 3] - place.pedestal
    standing = near.standing_in(foot[:2], floor + 0.05 + radius, foot[2] + panda.SHOULDER, radius)
    if standing is not None:
        return f"{standing} stands where the base has to stand"
    trunk = column(np.array([*foot[:2], floor]), radius, place.pedestal + panda.SHOULDER + UPPER_ARM)
    opens_into = any(overlap(trunk, piece) > 1e-3 for piece in swept)
    return "the part would open into the base" if opens_into else None


def _places(config: BaseConfig) -> Iterator[list[Place]]:
    """Yield the places in the order of how far they are from the preferred one."""
    places = [Place(*p) for p in itertools.product(config.distances, config.sides, config.pedestals)]
    places = sorted(places, key=lambda p: abs(p.distance - config.distances[0]) + abs(p.side) + 0.5 * p.pedestal)
    places = places if config.search else places[:1]
    yield places[:1]
    for k in range(1, len(places), CHUNK):
        yield places[k : k + CHUNK]


def _pose(floor: np.ndarray, point: np.ndarray, ahead: np.ndarray, place: Place) -> np.ndarray:
    """Return the pose [4 4] of the base at a place above the floor's points [point 3], facing the handle."""
    left = np.array([-ahead[1], ahead[0]])
    spot = point[:2] - place.distance * ahead + place.side * left
    towards = point[:2] - spot
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("z", math.atan2(towards[1], towards[0])).as_matrix()
    pose[:3, 3] = [*spot, floor_height(floor, spot) + place.pedestal]
    return pose


def _chosen(base: np.ndarray, place: Place, reason: str, free: bool) -> BasePose:
    x, y, z = map(float, base[:3, 3])
    half = math.atan2(base[1, 0], base[0, 0]) / 2
    return BasePose((x, y, z), (0.0, 0.0, math.sin(half), math.cos(half)), reason, place.pedestal, free)


def _opening(joint: Joint, point: np.ndarray, config: BaseConfig) -> float:
    """Return the coordinate of the joint [m] or [rad] to which the arm follows the handle."""
    arm, far = lever_arm(joint, point), open_limit(joint)
    return math.copysign(min(config.opening / arm, 0.95 * abs(far)), far) if arm > 1e-6 else 0.0


def _turned(base: np.ndarray, turn: float) -> np.ndarray:
    pose = base.copy()
    pose[:3, :3] = base[:3, :3] @ Rotation.from_euler("z", turn).as_matrix()
    return pose
