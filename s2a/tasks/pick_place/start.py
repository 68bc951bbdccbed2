"""Where the object stands as an episode begins."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import warp as wp

from s2a.env.state import State


@wp.kernel
def shift(s: State, first: int, far: float, turn: float):
    """Where an episode begins, shift the object by up to `far` [m] along x and y, and turn it by up to `turn` [rad] about z.

    `first` is the index of the object's first coordinate.
    """
    world = wp.tid()
    if s.done[world] == 1:
        rng = s.rng[world]
        for i in range(2):
            s.joint_q[world, first + i] += wp.randf(rng, -far, far)
        turned = wp.quat_from_axis_angle(wp.vec3(0.0, 0.0, 1.0), wp.randf(rng, -turn, turn)) * wp.quat(
            s.joint_q[world, first + 3],
            s.joint_q[world, first + 4],
            s.joint_q[world, first + 5],
            s.joint_q[world, first + 6],
        )
        for i in range(4):
            s.joint_q[world, first + 3 + i] = turned[i]
        s.rng[world] = rng


@wp.func
def start_of(s: State, first: int, world: int):
    """Return where the object stands as an episode begins [m]."""
    return wp.vec3(s.joint_q[world, first], s.joint_q[world, first + 1], s.joint_q[world, first + 2])
