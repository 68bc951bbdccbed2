"""Where a robot may stand to pick an object and place it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.planner.gripper_shape import gripper_spheres
from s2a.planner.misses import Misses
from s2a.planner.obstacles import RoomHulls
from s2a.robot.collision import SLACK, RobotShape
from s2a.robot.tool_path import turns

Item = TypeVar("Item")
PEDESTALS = (0.0, 0.2, 0.4, 0.6)
"""[m] Heights of what the robot may stand on for an object; handles of wall cabinets and windows ask for more."""
DIRECTIONS = 24
"""Directions from which the robot may face the object: 14 cm apart, half of what the base is wide."""
FURTHER = 0.4, 0.8
"""[m] Distances besides the robot's own, which are for handles in front of it: where there is little floor, these are left."""
BLOCK = 64
"""Bases that are looked at together."""
EXACT = 1e-3
"""Root of the squared errors [m and rad] up to which inverse kinematics reaches a pose."""


def bases(
    shape: RobotShape,
    near: RoomHulls,
    start: np.ndarray,
    goal: np.ndarray,
    pedestals: Sequence[float] = PEDESTALS,
) -> Iterator[tuple[np.ndarray, float]]:
    """Yield poses [4 4] where the base can stand, and the pedestal's height [m], the preferred ones first.

    Args:
        shape: the robot.
        near: the room around the object.
        start: pose of the object [4 4] where it is picked.
        goal: that where it is placed.
        pedestals: heights of what the robot may stand on [m].
    """
    spec = shape.kin.spec.base
    distances = (*spec.distances, *FURTHER)
    middle = (start[:3, 3] + goal[:3, 3]) / 2
    angles = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    places = sorted(
        itertools.product(distances, angles, pedestals), key=lambda p: abs(p[0] - distances[0]) + 0.3 * p[2]
    )
    over = max(start[2, 3], goal[2, 3])
    spots = np.array([[*(middle[:2] + r * np.array([np.cos(a), np.sin(a)])), over] for r, a, _ in places])
    floor, _ = near.below(spots)
    stands = np.isfinite(floor) & (floor <= floor[np.isfinite(floor)].min(initial=np.inf) + 0.05)
    raised = np.array([pedestal for _, _, pedestal in places])
    shoulders = np.c_[spots[:, :2], floor + raised + spec.shoulder_height]
    reach = np.max([np.linalg.norm(at[:3, 3] - shoulders, axis=1) for at in (start, goal)], axis=0)
    poses = np.tile(np.eye(4), (len(places), 1, 1))
    poses[:, :3, :3] = Rotation.from_euler("z", [[angle + np.pi] for _, angle, _ in places]).as_matrix()
    poses[:, :3, 3] = np.c_[spots[:, :2], floor + raised]
    hopeful = np.flatnonzero(stands & (reach <= spec.reach + 0.1))
    for block in np.array_split(hopeful, max(1, math.ceil(len(hopeful) / BLOCK))):
        for k in block[_clear(shape, near, poses[block], raised[block])]:
            yield poses[k], float(raised[k])


def _clear(shape: RobotShape, near: RoomHulls, poses: np.ndarray, pedestals: np.ndarray) -> np.ndarray:
    """Return at which poses [base 4 4] on pedestals [base] column, shoulder, however turned, and arm at home are clear [base]."""
    if not len(poses):
        return np.zeros(0, bool)
    spec, home = shape.kin.spec, np.array(shape.kin.spec.home)
    feet = poses[:, 2, 3] - pedestals
    low, high = feet + 0.05 + spec.base.radius, poses[:, 2, 3] + spec.base.shoulder_height
    count = max(2, math.ceil(float((high - low).max()) / spec.base.radius) + 1)
    heights = np.linspace(low, high, count, axis=1)
    columns = np.concatenate([np.repeat(poses[:, None, :2, 3], count, axis=1), heights[..., None]], axis=2)
    free = near.depth(columns, np.full(count, spec.base.radius)) <= 0.0
    around = shape.shoulder @ poses[free][:, :3, :3].transpose(0, 2, 1) + poses[free][:, None, :3, 3]
    free[free] = near.depth(around, shape.shoulder_radii) <= SLACK
    free[free] = arm_depth(shape, near, np.tile(home, (int(free.sum()), 1)), poses[free]) <= SLACK
    return free


def arm_depth(
    shape: RobotShape,
    near: RoomHulls,
    q: np.ndarray,
    base: np.ndarray,
    *,
    fingers: bool = True,
    opened: float | None = None,
    clearance: float = 0.0,
) -> np.ndarray:
    """Return how deep the arm in joints [pose arm] reaches into the room [m], shape [pose].

    Args:
        shape: of the robot.
        near: the room.
        q: joints [pose arm].
        base: pose of the base, [4 4] or [pose 4 4].
        fingers: they count too.
        opened: distance of the pads [m]; None: fully open.
        clearance: by which the arm is taken to be thicker [m].
    """
    chosen = shape.moving & ~shape.held
    gripper = gripper_spheres(shape.kin.spec.gripper, fingers)
    pads = None if opened is None else np.full(len(q), opened)
    whole = np.concatenate([shape.centers(q)[:, chosen], gripper.placed(shape.kin.tool(q), pads)], axis=1)
    centers = whole @ np.swapaxes(base[..., :3, :3], -1, -2) + base[..., None, :3, 3]
    return near.depth(centers, np.concatenate([shape.radii[chosen], gripper.radii]) + clearance)


def reached(
    shape: RobotShape,
    near: RoomHulls,
    places: Mapping[str, np.ndarray],
    bases: list[tuple[np.ndarray, float]],
    grasps: np.ndarray,
    seed: int,
    misses: Misses,
) -> Iterator[tuple[np.ndarray, float, int, bool]]:
    """Yield bases and grasps whose tool poses inverse kinematics reaches, and whether with the arm clear of the room.

    Bases and grasps are taken in turn: neither one base, from which no grasp does, nor one grasp, which does from no base,
    comes again and again. Where the arm is not clear, another elbow may be.

    Args:
        shape: the robot.
        near: the room around the object.
        places: poses of the object [4 4] by what is done there.
        bases: poses and pedestals.
        grasps: tool poses in the object's frame, shape [grasp 4 4].
        seed: of the starts.
        misses: is told how far the arm misses.
    """
    if not bases or not len(grasps):
        return
    poses = np.stack([pose for pose, _ in bases])
    kin, seeds = shape.kin, 4
    ok = np.ones((len(bases), len(grasps)), bool)
    clear = ok.copy()
    starts = np.random.default_rng(seed).uniform(kin.lower, kin.upper, (seeds, len(kin.lower)))
    starts[0] = kin.spec.home
    missed = np.zeros((len(places), *ok.shape))
    errors = np.zeros((len(places), *ok.shape, 2))
    for i, at in enumerate(places.values()):
        wanted = np.linalg.inv(poses)[:, None] @ (at @ grasps)[None]
        targets = np.repeat(wanted.reshape(-1, 4, 4), seeds, axis=0)
        q, left = kin.solve(targets, np.tile(starts, (len(targets) // seeds, 1)), iterations=30, damping=1e-2)
        good = left < EXACT
        missed[i], errors[i] = _nearest(kin.tool(q), targets, left, ok.shape)
        depth = np.full(len(q), np.inf)
        owner = np.repeat(poses, len(grasps) * seeds, axis=0)
        depth[good] = arm_depth(shape, near, q[good], owner[good], fingers=False)
        least = depth.reshape(*ok.shape, seeds).min(axis=2)
        ok &= np.isfinite(least)
        clear &= least <= SLACK
    _note(missed, errors, list(places), misses)
    rank = np.cumsum(ok, axis=1) + np.cumsum(ok, axis=0)
    for b, k in sorted(np.argwhere(ok), key=lambda pair: (rank[tuple(pair)], *pair)):
        yield *bases[b], int(k), bool(clear[b, k])


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


def _note(missed: np.ndarray, errors: np.ndarray, names: list[str], misses: Misses) -> None:
    """Note the nearest miss, which is of one base and grasp at all places: of the pair whose worst place is best.

    Args:
        missed: what inverse kinematics leaves, shape [place base grasp].
        errors: of position and angle [m, rad], shape [place base grasp 2].
        names: of the places.
        misses: is told, unless a pair reaches all places.
    """
    worst = missed.max(axis=0)
    pair = np.unravel_index(worst.argmin(), worst.shape)
    if worst[pair] < EXACT:
        return
    place = int(missed[(slice(None), *pair)].argmax())
    far, angle = errors[(place, *pair)]
    text = f"{names[place]}: the arm's nearest miss is {1000 * far:.0f} mm and {np.degrees(angle):.0f} degrees"
    misses.note(0, float(worst[pair]), f"{text}; choose a place nearer to free floor")


def chunks(items: Iterator[Item], size: int) -> Iterator[list[Item]]:
    """Yield lists of some items."""
    while some := list(itertools.islice(items, size)):
        yield some
