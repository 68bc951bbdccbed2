"""The base pose of the robot before a handle: where its arm can follow the whole path of the handle without a collision."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from s2a.core.bounds import Count, Numbers, Positive
from s2a.motion.obstacles import Obstacles
from s2a.motion.search import UNREACHABLE, Follow, Miss, Search, Stand
from s2a.motion.trajectory import STRAIGHT_APPROACH
from s2a.prepare.grasp import floor_height, floor_points, heading, lowest_point
from s2a.robot.collision import SLACK, Penetration, RobotShape, robot_shape
from s2a.robot.spec import RobotSpec
from s2a.robot.tool_path import ASKED, HALF_TURN, opening_coordinate, part_path, slipping, straight, variants
from s2a.scan.evidence.surface import FloorConfig, FloorSupport, floor_support
from s2a.scene.geometry.convex import column, overlap
from s2a.scene.scene import Mesh, Scene, Vec3
from s2a.scene.usd.sim_scene import Grasp, Quat

# Places with a free start from which the reach is computed at once, at first and at most, and places that are looked at last
AT_ONCE, MOST, CHUNK = 8, 64, 24
COARSE = 5  # Of so many poses on a path one is looked at first, where it does not matter how deep the robot reaches
STUCK = 1.0  # Depth [m] that stands for a place where the base cannot stand
# [s] In which every joint, at full speed, has to turn from home to the path: an episode has to have time for the rest
MAX_REACH_TIME = 2.0
TRIED = 8  # Number of joint paths that are checked: those that begin nearest to home
ASSUMED_FLOOR = "the scan has a hole there, amid floor at this height; make sure that no step and no stairs are there"


@dataclass(frozen=True, kw_only=True)
class BaseConfig:
    """Candidate base poses; the robot's spec has the distances.

    The first place that serves is taken, nearest to the preferred one first: the first distance, straight before the
    handle, facing it, on the floor.

    Attributes:
        opening: path of the handle that the arm has to follow [m]; less where the joint ends earlier.
        search: Try other base poses than the preferred one.
    """

    sides: Numbers = (0.0, -0.2, 0.2, -0.4, 0.4)  # how far to the side of the handle it may stand [m]
    turns: Numbers = (0.0, -0.5, 0.5)  # how far it may look past the handle [rad]
    # what is tried last, in all combinations with the others, in a corner or beside a table: sides [m], and distances as
    # fractions of the robot's least; 0.0 and 1.0 add none
    further_sides: Numbers = (-0.1, 0.1, -0.3, 0.3, -0.5, 0.5, -0.6, 0.6)
    further_distances: Numbers = (7 / 9, 8 / 9)
    pedestals: Numbers = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)  # heights of what it may stand on [m]
    approach: Positive = STRAIGHT_APPROACH  # distance before the handle from which the gripper moves straight to it [m]
    opening: Positive
    ik_seeds: Count = 16  # starts of the inverse kinematics at each place, for both gripper rolls
    query_radius: Positive = 1.6  # how far from the handle the room is looked at [m]
    search: bool
    floor: FloorConfig = FloorConfig()  # when it stands on scanned floor; not asked where no part is labelled as floor


@dataclass(frozen=True)
class BasePose:
    """Where the robot stands."""

    position: Vec3  # of its base [m]
    orientation: Quat  # quaternion xyzw; x looks ahead
    reason: str  # why there, in words
    pedestal: float  # height of what it stands on above the floor [m]
    free: bool  # the arm follows the path that `reason` names without a collision
    assumed_floor: bool  # the floor below was not scanned, but around it


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

    Inverse kinematics take most of the time: they are asked for many places at once, and for none where the robot starts in
    something. Places whose floor is assumed are tried where none on scanned floor is free, after them all the other
    variants of its path, and after these all of it again from further places.
    """
    joint, point, shape = scene.joint(target), np.array(grasp.point), robot_shape(robot)
    held = np.array([*grasp.point, *grasp.orientation])

    def poses(opening: float, slip: float) -> np.ndarray:
        end = opening_coordinate(joint, point, opening * config.opening)
        return slipping(part_path(joint, held, config.approach, end), joint, slip).poses

    asked = poses(*ASKED)
    near = Obstacles.of_scan(scene, point, config.query_radius)
    surroundings = ScannedSurfaces(near, near.without(moving), shape)
    ground = Ground(scene, target, point, near, swept, config, robot)
    search = Search(robot, shape.kin)
    preferred = next(iter(ground.places()))

    def follow(poses: np.ndarray, exact: bool, stands: Sequence[Stand]) -> Follow:
        seeds = [config.ik_seeds * (4 if np.array_equal(_facing(s), preferred.base) else 1) for s in stands]
        meets = surroundings.meets if exact else surroundings.meets_something
        return Follow("", 2, poses, meets, seeds, tried=TRIED, clear=1, reach_time=MAX_REACH_TIME)

    waiting: set[Stand] = set()
    every = variants(joint, held, internal=grasp.internal) if config.search else [ASKED]
    for further, variant, assumed in itertools.product((False, True)[: 1 + config.search], every, (False, True)):
        # What is said of a part without a free place is about the path that is asked for, from the nearer places.
        tried, unsure = (search, waiting) if variant == ASKED and not further else (Search(robot, shape.kin), None)
        path = asked if variant == ASKED else poses(*variant)
        facings, followed = (
            partial(ground.facings, search=tried, assumed=assumed),
            partial(follow, path, tried is search),
        )
        for some in _groups(ground.places(further=further), facings, surroundings, path[0], tried, followed, unsure):
            for k, _ in tried.followed(some, followed(some)):
                return _chosen(some[k], _praise(some[k], preferred, search, variant), True, assumed)
    order = sorted(search.misses.of.values(), key=lambda miss: miss.depth)
    for start in range(0, len(order), CHUNK):
        stands = [miss.stand for miss in order[start : start + CHUNK] if miss.stand is not None]
        unknown = [stand for stand in stands if stand in waiting]
        reach = dict(zip(unknown, search.paths(unknown, follow(asked, True, unknown)), strict=True)) if unknown else {}
        for stand in stands:
            if stand not in reach or len(reach[stand]):
                return _chosen(
                    stand,
                    f"{stand}, but {search.misses.of[stand].text}",
                    False,
                    ground.floor(stand).assumed,
                )
    raise AssertionError("the preferred place was tried to the end")


def _groups(
    places: Iterator[Stand],
    facings: Callable[[Stand], Iterator[Stand]],
    surroundings: ScannedSurfaces,
    first: np.ndarray,
    search: Search,
    follow: Callable[[Sequence[Stand]], Follow],
    waiting: set[Stand] | None,
) -> Iterator[list[Stand]]:
    """Yield bases at which the robot starts clear of all, AT_ONCE places together, the preferred place alone and in any case.

    The more places do not serve, the more are looked at together, up to MOST: inverse kinematics cost their launches.

    Why others do not serve is noted, of the preferred place also whether the arm reaches from it; `waiting` gets those of which
    that is not known; None: nobody asks.
    """
    hopeful: list[list[Stand]] = []
    at_once = AT_ONCE
    for number, place in enumerate(places):
        starting = []
        for stand in facings(place):
            depth, problem = surroundings.start(stand, first)
            if depth <= SLACK:
                starting.append(stand)
            else:
                search.misses.note(Miss(1, depth, problem, stand))
                if waiting is None:
                    continue
                if number or stand.turn or len(search.paths([stand], follow([stand]))[0]):
                    waiting.add(stand)
                else:
                    search.misses.note(Miss(2, UNREACHABLE, "the arm cannot reach along the whole path", stand))
        if starting:
            hopeful.append(starting)
        if hopeful and (number == 0 or len(hopeful) == at_once):
            yield list(itertools.chain(*hopeful))
            hopeful, at_once = [], min(MOST, 2 * at_once) if number else at_once
    if hopeful:
        yield list(itertools.chain(*hopeful))


def _facing(stand: Stand) -> np.ndarray:
    return stand.base if stand.facing is None else stand.facing


def _praise(stand: Stand, preferred: Stand, search: Search, variant: tuple[float, float]) -> str:
    """Return why a base was taken, and what was wrong with the preferred place."""
    wrong = [miss for other, miss in search.misses.of.items() if np.array_equal(_facing(other), preferred.base)]
    instead = f" (not {wrong[0].stand}: {wrong[0].text})" if wrong and str(wrong[0].stand) != str(stand) else ""
    opening, slip = variant
    reached = "the whole path" if opening == 1.0 else f"{100 * opening:.0f} % of the path"
    turning = ", the handle turning in the gripper" if slip else ""
    return f"{stand}; the arm reaches {reached}{turning}, start and path are free{instead}"


def _chosen(stand: Stand, reason: str, free: bool, assumed_floor: bool) -> BasePose:
    x, y, z = map(float, stand.base[:3, 3])
    half = math.atan2(stand.base[1, 0], stand.base[0, 0]) / 2
    if assumed_floor:
        reason += "; the floor there is assumed"
    return BasePose((x, y, z), (0.0, 0.0, math.sin(half), math.cos(half)), reason, stand.pedestal, free, assumed_floor)


@dataclass(frozen=True)
class ScannedSurfaces:
    """The scanned surfaces around a handle, and what of a robot collides with them."""

    near: Obstacles  # all of them
    still: Obstacles  # those that do not move with the part
    shape: RobotShape  # of the robot
    _starts: dict[tuple[object, ...], Penetration] = field(default_factory=dict)
    _paths: dict[tuple[object, ...], Penetration] = field(default_factory=dict)
    _coarse: dict[tuple[object, ...], Penetration] = field(default_factory=dict)

    @cached_property
    def _home(self) -> np.ndarray:
        return np.array(self.shape.kin.spec.home)

    def start(self, stand: Stand, first: np.ndarray) -> Penetration:
        """Return the deepest collision at home and of the gripper straight from there to a tool pose [4 4], with words for it.

        All variants of a path begin alike; it is computed once.
        """
        key = (stand.base.tobytes(), stand.pedestal, first.tobytes())
        if key not in self._starts:
            self._starts[key] = self._start(stand, first)
        return self._starts[key]

    def _start(self, stand: Stand, first: np.ndarray) -> Penetration:
        depth, owner = self._robot(stand, self._home[None], moving=True)
        if depth > SLACK:
            return depth, f"the start pose reaches {1000 * depth:.0f} mm into {owner}"
        depth, owner = self._straight(stand, stand.base @ self.shape.kin.tool(self._home[None])[0], first)
        return depth, f"the gripper on its path reaches {1000 * depth:.0f} mm into {owner}"

    def meets(self, stand: Stand, path: np.ndarray) -> Penetration:
        """Return the deepest collision on a joint path [pose arm] to the handle and with it, and on the way there from home."""
        key = _key(stand, path)
        if key not in self._paths:
            self._paths[key] = self._robot(stand, path[1:], moving=False)
        depth, owner = self._paths[key]
        if depth > SLACK:
            return depth, f"{owner} on its path"
        reach = straight(self._home, path[0])
        depth, owner = self._robot(stand, reach, moving=True)
        if depth > SLACK:
            return depth, f"{owner} on its path to the handle"
        return self.shape.self_penetration(np.concatenate([reach, path]))

    def meets_something(self, stand: Stand, path: np.ndarray) -> Penetration:
        """Return what `meets` does where the robot meets nothing, else a collision that need not be the deepest."""
        key = _key(stand, path)
        if key not in self._coarse:
            self._coarse[key] = self._robot(stand, path[1::COARSE], moving=False)
        return self._coarse[key] if self._coarse[key][0] > SLACK else self.meets(stand, path)

    def _robot(self, stand: Stand, q: np.ndarray, *, moving: bool) -> Penetration:
        """Return the deepest collision in joints [pose arm]; while it moves the handle, the fingers may touch what they hold."""
        chosen, base = self.shape.moving & (~self.shape.fingers | moving), stand.base
        centers = self.shape.centers(q)[:, chosen] @ base[:3, :3].T + base[:3, 3]
        return self._obstacles(stand, moving=moving).deepest(centers, self.shape.radii[chosen])

    def _straight(self, stand: Stand, start: np.ndarray, end: np.ndarray) -> Penetration:
        """Return the gripper's deepest collision on the straight path between two poses of the tool frame [4 4]."""
        best: Penetration = (np.inf, "")
        for flip in (np.eye(3), HALF_TURN[:3, :3]):
            turns = Rotation.from_matrix(np.stack([start[:3, :3], end[:3, :3] @ flip]))
            count = max(2, int(np.linalg.norm(end[:3, 3] - start[:3, 3]) / 0.03))
            fraction = np.linspace(0.0, 1.0, count)
            matrices = Slerp([0.0, 1.0], turns)(fraction).as_matrix()
            places = start[:3, 3] + fraction[:, None] * (end[:3, 3] - start[:3, 3])
            centers = np.einsum("kij,sj->ksi", matrices, self.shape.gripper) + places[:, None]
            best = min(best, self._obstacles(stand, moving=True).deepest(centers, self.shape.gripper_radii))
            if best[0] <= 0.0:
                break
        return best

    def _obstacles(self, stand: Stand, *, moving: bool) -> Obstacles:
        """Return what the robot can collide with on a base, its pedestal too; the target in its scanned pose if `moving`."""
        surfaces, radius = self.near if moving else self.still, self.shape.kin.spec.base.radius
        return surfaces.with_column(stand.base[:3, 3], stand.pedestal, radius)


def _key(stand: Stand, path: np.ndarray) -> tuple[object, ...]:
    """Return what a joint path [pose arm] from a base has in common with that of a base which is turned under its arm."""
    same = path + stand.turn * np.eye(path.shape[1])[0]
    return _facing(stand).tobytes(), stand.base[:3, 3].round(6).tobytes(), stand.pedestal, same.round(6).tobytes()


class Ground:
    """The floor before a handle, and where on it a base can stand."""

    def __init__(
        self,
        scene: Scene,
        target: str,
        point: np.ndarray,
        near: Obstacles,
        swept: Sequence[Mesh],
        config: BaseConfig,
        robot: RobotSpec,
    ) -> None:
        """Take the floor before the handle of a target at a point [m], shape [3]; `swept` is where the target opens."""
        self._point, self._ahead = point, heading(scene, target)
        floor = floor_points(scene)
        self._asks_floor = len(floor) > 0
        self._floor = floor if self._asks_floor else lowest_point(scene)
        self._near, self._swept, self._config, self._body = near, swept, config, robot.base
        self._problems: dict[tuple[object, ...], str | None] = {}
        self._floors: dict[tuple[object, ...], FloorSupport] = {}
        self._shoulder = robot_shape(robot).kin.shoulder

    def places(self, *, further: bool = False) -> Iterator[Stand]:
        """Yield places that face the handle, those nearest to the preferred one first; that alone where there is no search.

        The `further` ones are no others' and within the arm's reach.
        """
        config, distances = self._config, self._body.distances
        every = list(itertools.product(distances, config.sides, config.pedestals))
        if further:
            near = set(every)
            nearer = tuple(round(min(distances) * each, 6) for each in config.further_distances)
            wide = (*distances, *nearer), (*config.sides, *config.further_sides), config.pedestals
            every = [place for place in itertools.product(*wide) if place not in near]
        order = sorted(every, key=lambda p: abs(p[0] - distances[0]) + abs(p[1]) + 0.5 * p[2])
        left = np.array([-self._ahead[1], self._ahead[0]])
        for distance, side, pedestal in order if config.search else order[:1]:
            position = self._point[:2] - distance * self._ahead + side * left
            towards = self._point[:2] - position
            pose = np.eye(4)
            pose[:3, :3] = Rotation.from_euler("z", math.atan2(towards[1], towards[0])).as_matrix()
            pose[:3, 3] = [*position, floor_height(self._floor, position) + pedestal]
            shoulder = pose[:3, 3] + [0.0, 0.0, self._body.shoulder_height]
            if further and np.linalg.norm(self._point - shoulder) > self._body.reach + 0.1:
                continue
            yield Stand(pose, pedestal, words=_in_words(distance, side, pedestal))

    def facings(self, place: Stand, search: Search, *, assumed: bool) -> Iterator[Stand]:
        """Yield bases at a place, facing the handle or turned past it, at which the robot can stand; what fails is noted.

        Those on scanned floor, or those whose floor is `assumed`, of which nothing is noted: the others were before.
        """
        if (problem := self._taken(place, assumed)) is not None:
            if not assumed:
                search.misses.note(Miss(0, STUCK, problem, place))
            return
        for turn in self._config.turns if self._config.search else self._config.turns[:1]:
            base = turned(place.base, turn, self._shoulder)
            words = f"{place.words}, turned by {math.degrees(turn):.0f} degrees" if turn else place.words
            stand = Stand(base, place.pedestal, turn, place.base, words)
            # The foot of a robot whose arm is not on its axis moves when the robot turns about its shoulder.
            moves = not np.allclose(base[:3, 3], place.base[:3, 3])
            if not moves or (problem := self._taken(stand, assumed)) is None:
                yield stand
            elif not assumed:
                search.misses.note(Miss(0, STUCK, problem, stand))

    def _taken(self, stand: Stand, assumed: bool) -> str | None:
        """Return why a base cannot stand there, or None if it can; all variants of a path ask the same."""
        key = (stand.base.tobytes(), stand.pedestal, assumed)
        if key not in self._problems:
            self._problems[key] = self._problem(stand, assumed)
        return self._problems[key]

    def _problem(self, stand: Stand, assumed: bool) -> str | None:
        body, foot = self._body, stand.base[:3, 3]
        floor = foot[2] - stand.pedestal
        low, high = floor + 0.05 + body.radius, foot[2] + body.shoulder_height
        owner = self._near.in_column(foot[:2], low, high, body.radius)
        if owner is not None:
            return f"{owner} stands where the base has to stand"
        support = self.floor(stand)
        if not (support.assumed if assumed else support.scanned):
            return "no floor was scanned there"
        height = stand.pedestal + body.shoulder_height + body.upper_arm
        trunk = column(np.array([*foot[:2], floor]), body.radius, height)
        opens_into = any(overlap(trunk, piece) > 1e-3 for piece in self._swept)
        return "the part would open into the base" if opens_into else None

    def floor(self, stand: Stand) -> FloorSupport:
        """Return the floor below a base; `s2a certify` asks the same. It is not asked for where no part is labelled as floor."""
        if not self._asks_floor:
            return FloorSupport(1.0, scanned=True)
        place, key = stand.base[:3, 3], (stand.base[:3, 3].tobytes(), stand.pedestal)
        if key not in self._floors:
            radius, surface = self._body.radius, self._near.surface
            self._floors[key] = floor_support(place, stand.pedestal, radius, surface, self._config.floor)
        return self._floors[key]


def _in_words(distance: float, side: float, pedestal: float) -> str:
    words = [f"{distance:.2f} m before the handle"]
    words += [f"{abs(side):.2f} m to its {'left' if side > 0 else 'right'}"] if side else []
    words += [f"on a pedestal of {pedestal:.2f} m"] if pedestal else ["on the floor"]
    return ", ".join(words)


def turned(base: np.ndarray, turn: float, shoulder: np.ndarray) -> np.ndarray:
    """Return a base turned about its arm's vertical first axis, through a point [3] of its frame."""
    pose = base.copy()
    pose[:3, :3] = base[:3, :3] @ Rotation.from_euler("z", turn).as_matrix()
    pose[:3, 3] += (base[:3, :3] - pose[:3, :3]) @ shoulder
    return pose
