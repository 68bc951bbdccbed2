"""Paths of the tool frame, straight to a grasp and with the part that it holds; collision-free motions of the arm by OMPL."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.core.errors import InputError
from s2a.robot.kinematics import Kinematics
from s2a.scene.articulation import displace, lever_arm, open_limit, pose_at, transform
from s2a.scene.scene import Joint

STEP = 0.015  # [m] Distance between neighbouring poses
TURN = 0.1  # [rad] Largest rotation between neighbouring poses
# Fractions of `opening`, and of a hinged part's turn that its handle makes in the gripper: what is asked for, with the gripper
# fast on the handle; then what a person does in a corner
ASKED = (1.0, 0.0)
VARIANTS = (ASKED, (1.0, 0.8), (0.75, 0.0), (0.75, 0.8))
# [rad] Most that a handle turns in the gripper. A Panda's hand, 0.2 m wide and 0.04 m behind a bar 0.038 m before a front,
# meets the front at 0.7: 0.038 + 0.04 cos - 0.1 sin
MAX_SLIP = 0.6
# Cosine of the angle between a handle and its hinge, at least, about which it can turn between two fingers
PARALLEL = 0.9


@dataclass(frozen=True)
class ToolPath:
    """Poses that the tool frame passes."""

    poses: np.ndarray  # shape [pose 4 4], scene frame
    q: np.ndarray  # coordinate of the part's joint at each [m or rad], shape [pose]
    grasp: int  # index of the pose in which the gripper closes, or touches the part that it pushes
    pushes: bool = False  # the gripper is closed from the beginning, and pushes


def opening_coordinate(joint: Joint, point: np.ndarray, opening: float) -> float:
    """Return the coordinate of a joint [m] or [rad] at which a point [3] has moved by `opening` [m], or 95 % of its range."""
    lever, end = lever_arm(joint, point), open_limit(joint)
    return math.copysign(min(opening / lever, 0.95 * abs(end)), end) if lever > 1e-6 else 0.0


class PathSettings(Protocol):
    """What a tool path takes of a planner's settings; see `PlannerConfig`."""

    @property
    def approach(self) -> float:
        """Where the straight path begins, before the grasp [m]."""

    @property
    def opening(self) -> float:
        """Path of the grasp point [m]."""

    @property
    def depth(self) -> float:
        """How far the tool frame goes past the grasp [m]."""


def part_path(
    joint: Joint, grasp: np.ndarray, approach: float, end: float, depth: float = 0.0, start: float = 0.0
) -> ToolPath:
    """Return the path to a grasp and from there with the part.

    Args:
        joint: of the part.
        grasp: pose of the grasp frame, the part at zero: 7-vector (position, quaternion xyzw), z forward; scene frame.
        approach: where the straight path begins, before the grasp [m].
        end: coordinate to which the part is moved [m] or [rad], with its sign.
        depth: how far the tool frame goes past the grasp [m].
        start: coordinate at which it is grasped.
    """
    forward = Rotation.from_quat(grasp[3:]).as_matrix()[:, 2]
    held = np.concatenate([grasp[:3] + depth * forward, grasp[3:]])
    back = np.linspace(approach, 0.0, max(2, round(approach / STEP) + 1))
    ends = [displace(held[None, :3], joint, q)[0] for q in (start, end)]
    length = float(np.linalg.norm(ends[1] - ends[0]))
    turn = 0.0 if joint.kind == "prismatic" else abs(end - start)
    count = max(2, round(length / STEP) + 1, math.ceil(turn / TURN) + 1)
    q = np.concatenate([np.full(len(back), start), np.linspace(start, end, count)[1:]])
    vectors = [pose_at(joint, held, value) for value in q]
    ahead = transform(joint, start)[:3, :3] @ forward
    for vector, distance in zip(vectors, back, strict=False):
        vector[:3] -= distance * ahead
    return ToolPath(matrices(np.array(vectors)), q, len(back) - 1)


def variants(joint: Joint, grasp: np.ndarray, *, internal: bool) -> list[tuple[float, float]]:
    """Return those of VARIANTS that serve a part, in the order in which they are tried.

    Args:
        joint: of the part.
        grasp: pose of the grasp frame, x along the handle: 7-vector.
        internal: it is held from within a pocket, in which fingers cannot turn.
    """
    along = Rotation.from_quat(grasp[3:]).as_matrix()[:, 0]
    slips = joint.kind == "revolute" and not internal and abs(along @ np.array(joint.axis)) > PARALLEL
    return [variant for variant in VARIANTS if slips or variant[1] == 0.0]


def slipping(path: ToolPath, joint: Joint, slip: float, depth: float = 0.0) -> ToolPath:
    """Return a tool path on which the handle of a hinged part turns in the gripper.

    A closed gripper that turns with a door needs the arm to swing around it; two fingers let a bar turn between them.

    Args:
        path: with the gripper fast on its handle.
        joint: of the part.
        slip: fraction of the part's turn that the gripper does not make, of MAX_SLIP or less.
        depth: how far the tool frame is past the handle [m].
    """
    if joint.kind == "prismatic" or path.pushes or slip == 0.0:
        return path
    poses, held = path.poses.copy(), path.grasp
    for k in range(path.grasp, len(poses)):
        held = k if path.q[k] != path.q[k - 1] else held  # the gripper draws back from where the part was moved to
        angle = np.clip(-slip * (path.q[k] - path.q[path.grasp]), -MAX_SLIP, MAX_SLIP)
        back = Rotation.from_rotvec(angle * np.array(joint.axis)).as_matrix()
        pivot = path.poses[held, :3, 3] - depth * path.poses[held, :3, 2]
        poses[k, :3, :3] = back @ path.poses[k, :3, :3]
        poses[k, :3, 3] = pivot + back @ (path.poses[k, :3, 3] - pivot)
    return replace(path, poses=poses)


def turns(rotations: np.ndarray) -> np.ndarray:
    """Return the angles of rotations, or of motions, [... 3 3] or [... 4 4], by which they turn [rad], shape [...]."""
    trace = np.trace(rotations[..., :3, :3], axis1=-2, axis2=-1)
    return np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0))


def matrices(vectors: np.ndarray) -> np.ndarray:
    """Return 7-vectors (position, quaternion xyzw) [pose 7] as matrices [pose 4 4]."""
    poses = np.tile(np.eye(4), (len(vectors), 1, 1))
    poses[:, :3, :3] = Rotation.from_quat(vectors[:, 3:]).as_matrix()
    poses[:, :3, 3] = vectors[:, :3]
    return poses


def matrix(vector: np.ndarray) -> np.ndarray:
    """Return a 7-vector (position, quaternion xyzw) as a matrix [4 4]."""
    return matrices(np.asarray(vector, float)[None])[0]


EXACT = 1e-4  # Accepted root of the squared errors: 0.1 mm and 0.1 mrad
JUMP = 0.3  # [rad] Largest change of a joint from one pose to the next: more is another IK branch
MARGIN = 0.02  # [rad] What every joint keeps from its limits
# [rad] Largest change of a joint between two poses that are checked for collisions: 4 cm at arm's length
JOINT_TURN = 0.05
HALF_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])  # A parallel gripper holds as well with its fingers exchanged


def follow(
    kin: Kinematics,
    poses: np.ndarray,
    bases: np.ndarray,
    ik_seeds: int | Sequence[int],
    seed: int = 0,
    near: np.ndarray | None = None,
) -> list[np.ndarray]:
    """Return, for each base, the joint paths with which the arm can follow a tool path, shape [path pose arm].

    Args:
        kin: of the robot.
        poses: of the tool frame, shape [pose 4 4], or [base pose 4 4] for a path of each base's own; scene frame; it may also be
            turned by half about its z axis.
        bases: poses of the base, shape [base 4 4], scene frame.
        ik_seeds: starts of the inverse kinematics for each base (one number for all, or one each) and both gripper rolls:
            home, and random ones.
        seed: of those.
        near: joints to start from at each base instead of home, shape [base arm]: where the arm comes from, so that the branch on
            which it stays is among those found.
    """
    local = np.linalg.inv(bases)[:, None] @ (poses if poses.ndim == 4 else poses[None])
    near_enough = kin.may_reach(local).all(axis=1) | kin.may_reach(local @ HALF_TURN).all(axis=1)
    counts = np.where(near_enough, ik_seeds, 0)
    if not counts.any():
        return [np.empty((0, local.shape[1], len(kin.lower))) for _ in bases]
    owner = np.tile(np.repeat(np.arange(len(bases)), counts), 2)
    targets = np.repeat(np.concatenate([local, local @ HALF_TURN]), np.tile(counts, 2), axis=0)
    starts = np.random.default_rng(seed).uniform(kin.lower, kin.upper, (counts.max(), len(kin.lower)))
    starts[0] = kin.spec.home
    each = [starts[:count].copy() for count in counts]
    for begun, joints in zip(each, [] if near is None else near, strict=near is not None):
        begun[:1] = joints
    first = np.concatenate(each)
    q, left = kin.solve(targets[:, 0], np.tile(first, (2, 1)), iterations=40, damping=1e-2)
    alive = np.flatnonzero((left < EXACT) & (_margin(kin, q) > MARGIN))
    path = [q[alive]]
    for k in range(1, local.shape[1]):
        # Most starts are near enough for a few steps; the others get more before they are given up.
        q, left = kin.solve(targets[alive, k], path[-1], iterations=4, damping=1e-4)
        late = np.flatnonzero(left >= EXACT)
        q[late], left[late] = kin.solve(targets[alive[late], k], path[-1][late], iterations=12, damping=1e-2)
        good = (left < EXACT) & (np.abs(q - path[-1]).max(axis=1) < JUMP) & (_margin(kin, q) > MARGIN)
        alive, path = alive[good], [*(p[good] for p in path), q[good]]
    paths = np.stack(path, axis=1)
    return [paths[owner[alive] == b] for b in range(len(bases))]


def _margin(kin: Kinematics, q: np.ndarray) -> np.ndarray:
    """Return the smallest distance of joints [pose arm] from their limits [rad], shape [pose]."""
    return np.minimum(q - kin.lower, kin.upper - q).min(axis=1)


def straight(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the joint path from one position to another on which all joints turn evenly, shape [pose arm], without its start."""
    count = max(1, int(np.ceil(np.abs(end - start).max() / JOINT_TURN)))
    return start + np.linspace(0.0, 1.0, count + 1)[1:, None] * (end - start)


Free = Callable[[np.ndarray], np.ndarray]  # Joints [pose arm] -> whether each collides with nothing, shape [pose]
# Joint positions that a search may ask about, and its shortening: counted, so that what it returns does not depend on the
# speed of a machine
CHECKS, SHORTENING = 6000, 1500
EVERY = 4  # Of so many joint positions along a line one is asked about first, then all others


def free_motion(
    start: np.ndarray,
    goal: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    free: Free,
    seed: int,
    checks: int = CHECKS,
) -> np.ndarray | None:
    """Return evenly spaced joint positions [pose arm] from start to goal that collide with nothing; None: none was found.

    Args:
        start: joints [arm].
        goal: joints [arm].
        lower: limits of the joints [rad], shape [arm].
        upper: likewise.
        free: what is asked of joints.
        seed: of the search, whatever was searched before.
        checks: joint positions that the search may ask about.

    Raises:
        InputError: OMPL is not installed.
    """
    direct = np.concatenate([start[None], straight(start, goal)])
    if free(direct).all():
        return direct
    try:
        from ompl import base, geometric, util  # most motions are direct, and do without
    except ImportError as error:
        raise InputError("planning around obstacles needs OMPL; install the extra: pip install 's2a[sim]'") from error
    # OMPL complains of a seed after its first number; all that draws in this search is made after it, so it holds.
    util.setLogLevel(util.LogLevel.LOG_NONE)
    util.RNG.setSeed(seed + 1)
    util.setLogLevel(util.LogLevel.LOG_ERROR)
    count = len(start)
    space, bounds = base.RealVectorStateSpace(count), base.RealVectorBounds(count)
    for i in range(count):
        bounds.setLow(i, float(lower[i]))
        bounds.setHigh(i, float(upper[i]))
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    search = _Counted(free)
    setup.setStateValidityChecker(lambda state: search.all_free(_joints(state, count)[None]))
    ends = []
    for joints in (start, goal):
        state = space.allocState()
        for i in range(count):
            state[i] = float(joints[i])
        ends.append(state)
    setup.setStartAndGoalStates(*ends)
    info = setup.getSpaceInformation()
    info.setMotionValidator(_line_check(base)(info, search, count))
    setup.setPlanner(geometric.RRTConnect(info))
    setup.solve(base.PlannerTerminationCondition(lambda: search.count >= checks))
    if not setup.haveExactSolutionPath():
        return None
    search.count = 0
    setup.simplifySolution(base.PlannerTerminationCondition(lambda: search.count >= SHORTENING))
    path = setup.getSolutionPath()
    corners = np.array([_joints(path.getState(i), count) for i in range(path.getStateCount())])
    return _rounded(corners, free)


class _Counted:
    """Function that tells whether joints are free, with the number of joint positions that it was given."""

    def __init__(self, free: Free) -> None:
        self._free, self.count = free, 0

    def all_free(self, q: np.ndarray) -> bool:
        """Return whether all of some joints [pose arm] are free."""
        self.count += len(q)
        return bool(self._free(q).all())


@cache
def _line_check(base: Any) -> Any:
    """Return OMPL's check of straight lines, a class that asks about many joints at once: one by one takes several times as long.

    It is made once: a class is freed by the garbage collector alone, and would hold all that a search has read until then.
    """

    class LineCheck(base.MotionValidator):
        def __init__(self, info: object, search: _Counted, count: int) -> None:
            super().__init__(info)
            self._search, self._count = search, count

        def checkMotion(self, start: object, end: object, last: object = None) -> bool:  # noqa: N802 - OMPL's name
            line = even(np.stack([_joints(start, self._count), _joints(end, self._count)]))[:0:-1]
            first = np.arange(len(line)) % EVERY == 0
            return self._search.all_free(line[first]) and self._search.all_free(line[~first])

    return LineCheck


def _joints(state: object, count: int) -> np.ndarray:
    return np.array([state[i] for i in range(count)])  # type: ignore[index]


def _rounded(corners: np.ndarray, free: Free) -> np.ndarray | None:
    """Return evenly spaced poses along a path, its corners rounded as far as that is free."""
    dense = even(corners)
    for width in (15, 9, 5, 0):
        path = dense.copy()
        for _ in range(2 if width else 0):
            padded = np.concatenate([np.repeat(path[:1], width, 0), path, np.repeat(path[-1:], width, 0)])
            sums = np.cumsum(np.concatenate([padded[:1] * 0, padded]), axis=0)
            path = (sums[2 * width + 1 :] - sums[: -2 * width - 1]) / (2 * width + 1)
        path = np.concatenate([corners[:1], even(path)[1:-1], corners[-1:]]) if width else dense
        if free(path).all():
            return path
    return None


def even(path: np.ndarray) -> np.ndarray:
    """Return a path [corner arm] as poses TURN apart along its length, shape [pose arm]."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], max(3, int(np.ceil(length[-1] / JOINT_TURN)) + 1))
    return np.stack([np.interp(at, length, column) for column in path.T], axis=1)
