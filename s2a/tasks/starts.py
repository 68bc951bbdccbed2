"""Starts of episodes: home, or a point of a demonstration: on the way to the handle, in the grasp, the part already moved."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import warp as wp

from s2a.core.cache import UNREADABLE
from s2a.core.errors import InputError
from s2a.motion.trajectory import Demonstration
from s2a.sim import pool
from s2a.tasks.kernels import Motion
from s2a.tasks.state import State, finger_position

wp.set_module_options({"enable_backward": False})  # half the time to compile


def save(motion: Demonstration, path: Path) -> None:
    """Write a motion as an npz file."""
    np.savez_compressed(
        path,
        targets=motion.targets.astype(np.float32),
        positions=motion.positions.astype(np.float32),
        grasped=motion.grasped,
    )


def load(path: Path) -> Demonstration:
    """Read a motion that `save` wrote; InputError where the file is none."""
    try:
        with np.load(path) as file:
            return Demonstration(file["targets"], file["positions"], int(file["grasped"]))
    except UNREADABLE as error:
        raise InputError(f"{path}: not a motion of s2a pool ({error}); make the pool again") from error


def of_pool(index: Path) -> list[Demonstration]:
    """Return the motions of a pool's parts, in its order; InputError where the index or one of them is damaged."""
    return [load(index.parent / entry.motion) for entry in pool.read(index)]


@dataclass(frozen=True)
class DemoStarts:
    """How many episodes start on a demonstration.

    Attributes:
        demonstrations: one a stage.
        fraction: of the episodes that start on it.
        moved_fraction: of these, the fraction that starts where the part is already moved; they are not counted.
    """

    demonstrations: Sequence[Demonstration]
    fraction: float
    moved_fraction: float


@wp.kernel
def reset(s: State, m: Motion, world_mask: wp.array(dtype=bool), articulation_mask: wp.array2d(dtype=bool)):
    """Put the worlds whose episode ended back to the start, the robot with noise; mark them in both masks.

    Everything else takes the coordinates that the task starts with. A fraction of the worlds starts on a demonstration; of
    these moved_fraction where the part is already moved. Of the others half start on the straight path in joint space from home
    to its first targets, the noise fading, a quarter at any step until the grasp, a quarter at the last of them, where the
    fingers close. Targets start at the sampled positions. (The reference leaves them where the last episode ended, which pulls
    the arm away in the first step.)
    """
    world = wp.tid()
    ended = s.done[world] == 1
    world_mask[world] = ended
    for i in range(articulation_mask.shape[1]):
        articulation_mask[world, i] = ended
    if ended:
        rng = s.rng[world]
        for i in range(s.joint_q.shape[1]):
            s.joint_q[world, i] = m.start[world, i]
        for i in range(s.joint_qd.shape[1]):
            s.joint_qd[world, i] = 0.0
        near = float(0.0)
        at, stage = int(0), m.stage[world]
        if m.demo_fraction > 0.0:  # the stream of random numbers stays as it is where nothing starts on a demonstration
            if wp.randf(rng) < m.demo_fraction:
                moved, grasped = bool(False), m.demo_grasped[stage]
                if m.moved_fraction > 0.0:
                    moved = wp.randf(rng) < m.moved_fraction
                if moved:
                    near, at = 1.0, wp.randi(rng, grasped, m.demo_steps[stage])
                    s.joint_q[world, m.part_coord[world]] = m.demo_positions[stage, at, s.joints]
                    s.uncounted[world] = 1
                else:
                    near = wp.min(2.0 * wp.randf(rng), 1.0)
                    at = wp.where(near < 1.0, 0, wp.min(wp.randi(rng, 0, 2 * grasped), grasped - 1))
        for i in range(s.joints):
            noise = (1.0 - near) * wp.randf(rng, -m.noise, m.noise)
            led = m.demo_targets[stage, at, i]
            home = finger_position(s, world, i, m.home[i])
            target = wp.clamp(home + near * (led - home) + noise, s.lower[i], s.upper[i])
            if m.coupled == 1 and i > s.arm:  # the fingers stand alike
                target = s.target_q[world, s.arm]
            s.target_q[world, i] = target
            s.target_qd[world, i] = 0.0
            s.joint_q[world, i] = wp.where(near < 1.0 or i < s.arm, target, m.demo_positions[stage, at, i])
        if m.delay[1] > 0:
            s.delay[world] = wp.randi(rng, m.delay[0], m.delay[1] + 1)
            for k in range(s.past.shape[1]):
                for i in range(s.joints):
                    s.past[world, k, i] = 0.0
        s.rng[world] = rng
        s.step[world] = 0
        s.begun[world] = wp.where(near < 1.0, -1, at)
        s.terminated[world] = 0
        s.dropped[world, 0] = 0
        s.dropped[world, 1] = 0
