"""How an arm comes to the handle of a part that stands open: around it, where the straight line meets it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from s2a.planner.free_motion import Free, free_motion
from s2a.planner.insides import moved_room
from s2a.planner.obstacles import RoomHulls
from s2a.planner.pick_base import arm_depth
from s2a.planner.trajectory import USED, Trajectory, reach_steps, timed
from s2a.robot.collision import SLACK, RobotShape, robot_shape
from s2a.robot.spec import JointLimits, RobotSpec
from s2a.robot.tool_path import matrices, straight
from s2a.scene.articulation import transform
from s2a.scene.scene import Joint
from s2a.sim.room import pedestal
from s2a.sim.world import SimStage

CLEARANCES = 0.025, 0.01, 0.0, 0.0
"""[m] That searches for a motion to the point of approach keep, less SLACK, each of its own seed, until one is found: the arm
lags behind the motion and cuts its corners, by 25 mm before an open door."""
STARTS = 24
"""Starts off home that must be free: a joint that is off by 0.125 rad moves the gripper by 10 cm."""
SPEED = 0.6
"""[rad] Of all joints together that the arm moves in a second between two straight paths."""


def room_hulls(stage: SimStage, q: float) -> RoomHulls:
    """Return the hulls around a stage's part, which stands at a coordinate, and the robot's pedestal."""
    room = moved_room(stage.room, stage.target, q, {})
    return RoomHulls(room, (), stage.grasp[:3], pedestal(stage.base, *stage.pedestal))


def part_hulls(stage: SimStage) -> RoomHulls:
    """Return the hulls of a stage's part alone, as scanned."""
    room, target = stage.room, stage.target
    alone = replace(room, bodies={target: room.bodies[target]}, articulations={}, free={}, static_colliders=())
    return RoomHulls(alone, (), stage.grasp[:3])


def arm_in_part(
    shape: RobotShape, part: RoomHulls, joint: Joint, coordinates: np.ndarray, path: np.ndarray, base: np.ndarray
) -> float:
    """Return how deep an arm without its gripper reaches into the part that it moves [m].

    Args:
        shape: the robot.
        part: `part_hulls`.
        joint: of the part.
        coordinates: of the part at each pose, shape [pose].
        path: joints [pose arm].
        base: pose of the base [4 4].
    """
    chosen = shape.moving & ~shape.held
    back = np.stack([np.linalg.inv(transform(joint, q)) @ base for q in coordinates])
    centers = shape.centers(path)[:, chosen] @ np.swapaxes(back[:, :3, :3], 1, 2) + back[:, None, :3, 3]
    return float(part.depth(centers, shape.radii[chosen]).max())


def is_free(
    shape: RobotShape, near: RoomHulls, base: np.ndarray, opened: float | None = None, clearance: float = 0.0
) -> Free:
    """Return what says of joints [pose arm] whether the arm on its base [4 4] meets neither a room nor itself.

    Its pads are `opened` apart [m]; None: fully open. It keeps `clearance` [m] from the room, less SLACK.
    """

    def free(q: np.ndarray) -> np.ndarray:
        return shape.keeps_clear(arm_depth(shape, near, q, base, opened=opened, clearance=clearance), q)

    return free


def all_free(shape: RobotShape, near: RoomHulls, base: np.ndarray, q: np.ndarray, opened: float | None = None) -> bool:
    """Return whether in all of many joints [pose arm] the arm meets neither a room nor itself; faster than `is_free`."""
    clear = bool(arm_depth(shape, near, q, base, opened=opened).max() <= SLACK)
    return clear and shape.self_penetration(q)[0] <= SLACK


def noisy_starts(spec: RobotSpec, noise: float, seed: int) -> np.ndarray:
    """Return joints [start arm] at which an episode may begin: home, and up to `noise` [rad] off it."""
    home = np.array(spec.home)
    off = np.random.default_rng(seed).uniform(-noise, noise, (STARTS, len(home)))
    return np.concatenate([home[None], home + off])


def lines(starts: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return joints [pose arm] on the straight lines from starts [start arm] to an end [arm]."""
    return np.concatenate([np.concatenate([start[None], straight(start, end)]) for start in starts])


def detour(
    stage: SimStage,
    spec: RobotSpec,
    first: np.ndarray,
    q: float,
    noise: float,
    seed: int,
    opened: float | None = None,
) -> np.ndarray | None:
    """Return joints [pose arm] from home to `first` [arm] around a part at a coordinate, and around the room.

    The pads are `opened` apart [m]; None: fully open.
    None where the straight lines from all starts are free, or no motion was found.
    """
    shape, home = robot_shape(spec), np.array(spec.home)
    near, base = room_hulls(stage, q), matrices(stage.base[None])[0]
    if all_free(shape, near, base, lines(noisy_starts(spec, noise, seed), first), opened):
        return None
    for i, clearance in enumerate(CLEARANCES):
        clear = is_free(shape, near, base, opened, clearance)
        if clear(np.stack([home, first])).all():
            path = free_motion(home, first, shape.kin.lower, shape.kin.upper, clear, seed + i)
            if path is not None:
                return path
    return None


def preceded(
    trajectory: Trajectory,
    path: np.ndarray,
    spec: RobotSpec,
    limits: JointLimits,
    rate: float,
    noise: float,
    duration: float,
) -> Trajectory:
    """Return a trajectory that first follows a path [pose arm] from home to its first target.

    Args:
        trajectory: the rest.
        path: from home on.
        spec: the robot.
        limits: that the arm keeps.
        rate: control steps a second.
        noise: how far the start may be from home [rad].
        duration: of the path at least [s].
    """
    length = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
    moved = timed(path, max(duration, length / SPEED), limits, rate)
    fingers = np.tile(trajectory.targets[0, path.shape[1] :], (len(moved) + 1, 1))
    before = np.concatenate([np.concatenate([path[:1], moved]), fingers], axis=1)
    # The fingers may start closed; an eased motion's peak is 4/3 of its mean speed.
    opening = 4.0 / 3.0 * spec.gripper.finger_joint_open / (USED * spec.gripper.finger_speed)
    return replace(
        trajectory,
        targets=np.concatenate([before, trajectory.targets]),
        part=np.concatenate([np.full(len(before), trajectory.part[0]), trajectory.part]),
        reach_steps=reach_steps(path[0], path[0], noise, opening, limits, rate),
        closed=trajectory.closed + len(before),
    )
