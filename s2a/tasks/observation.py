"""What the observations of all tasks have alike."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import warp as wp

from s2a.env.kernels import finger_position, sense
from s2a.env.state import State


@wp.func
def observe_joints(s: State, world: int, velocity_scale: float, limit: float):
    """Write the robot's joint positions, scaled to their range, and its velocities, scaled, as the first 2 * joints numbers.

    Those of fingers that hold by opening are mirrored (`State.internal`).
    """
    for i in range(s.joints):
        scaled = (
            2.0 * (finger_position(s, world, i, s.joint_q[world, i]) - s.lower[i]) / (s.upper[i] - s.lower[i]) - 1.0
        )
        s.observation[world, i] = wp.clamp(scaled, -limit, limit)
        s.observation[world, s.joints + i] = wp.clamp(
            sense(s, world, i) * velocity_scale * s.joint_qd[world, i], -limit, limit
        )


@wp.func
def observe_vector(s: State, world: int, first: int, values: wp.vec3, limit: float):
    """Write three numbers from column `first` on."""
    for i in range(3):
        s.observation[world, first + i] = wp.clamp(values[i], -limit, limit)
