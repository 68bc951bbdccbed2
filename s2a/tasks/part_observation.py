"""What a policy sees of an articulated part, and what its critic is told besides."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import math

import warp as wp

from s2a.env.state import State
from s2a.sim.simulation import Simulation
from s2a.tasks.observation import observe_joints, observe_vector
from s2a.tasks.part_functions import frames, is_grasped, opening_of
from s2a.tasks.part_handles import PartHandles, PartMdp

DESCRIBED = wp.constant(22)
"""Numbers that tell one part from another."""
PRIVILEGED = wp.constant(16)
"""Numbers that a critic is told."""
FORCE = wp.constant(0.05)
"""[1/N] Scale of the fingers' forces for a critic."""


def length(sim: Simulation, config: PartMdp) -> int:
    """Return the length of an observation."""
    joints = sim.layout.robot_joints
    return 2 * joints + 5 + (2 * joints + int(DESCRIBED) if config.describe_part else 0)


def privileged_length(config: PartMdp) -> int:
    """Return how many numbers a critic is told besides."""
    return int(PRIVILEGED) if config.describe_part else 0


def observe(state: State, h: PartHandles, config: PartMdp) -> None:
    """Write the observations."""
    worlds = len(state.done)
    wp.launch(_observe, dim=worlds, inputs=[state, h])
    if config.describe_part:
        wp.launch(_describe, dim=worlds, inputs=[state, h])
        wp.launch(_tell_critic, dim=worlds, inputs=[state, h])


def is_misplaced(config: PartMdp) -> bool:
    """Return whether the grasp that is seen is not the true one."""
    return max(*config.grasp_error, *config.grasp_turn) > 0.0


def misplace_grasp(state: State, h: PartHandles, config: PartMdp) -> None:
    """Draw a new error of the grasp that is seen, in worlds whose episode ended."""
    if not is_misplaced(config):
        return  # the stream of random numbers stays as it is
    length, turn = wp.vec2(*config.grasp_error), wp.vec2(*map(math.radians, config.grasp_turn))
    wp.launch(_misplace, dim=len(state.done), inputs=[state, h, length, turn])


@wp.kernel
def _misplace(s: State, h: PartHandles, length: wp.vec2, turn: wp.vec2):
    """Shift and turn the seen grasp frame in random directions by amounts between two limits [m], [rad]."""
    world = wp.tid()
    if s.done[world] == 0:
        return
    rng = s.rng[world]
    shift = wp.sample_unit_sphere_surface(rng) * wp.randf(rng, length[0], length[1] + 1.0e-9)
    axis = wp.sample_unit_sphere_surface(rng)
    h.seen[world] = wp.transform(shift, wp.quat_from_axis_angle(axis, wp.randf(rng, turn[0], turn[1] + 1.0e-9)))
    s.rng[world] = rng


@wp.kernel
def _observe(s: State, h: PartHandles):
    """Write the reference's observation, shape [world 2 * joints + 5].

    Joint positions scaled to their range and velocities, the vector from tool to grasp in the robot's base frame [m], the
    part's coordinate and velocity.
    """
    world = wp.tid()
    limit, p = h.observation_limit, h.part[world]
    observe_joints(s, world, h.velocity_scale, limit)
    f = frames(s, h, world)
    grasp = wp.transform_point(f.grasp, wp.transform_get_translation(h.seen[world]))
    between = grasp - wp.transform_get_translation(f.tool)
    seen = wp.quat_rotate_inv(h.part[world].base, between)
    observe_vector(s, world, 2 * s.joints, seen, limit)
    s.observation[world, 2 * s.joints + 3] = wp.clamp(s.joint_q[world, p.coord], -limit, limit)
    s.observation[world, 2 * s.joints + 4] = wp.clamp(s.joint_qd[world, p.dof], -limit, limit)


@wp.kernel
def _describe(s: State, h: PartHandles):
    """Write what a policy of many parts sees besides.

    How far each joint's target is ahead of it [rad, m], ten times, and the target's velocity, scaled as the joint's. Then what
    tells one part from another: the seen grasp in the tool frame: point [m], its y and z; in the robot's base frame the joint's
    axis, positive opens, and the direction in which the grasp point moves when the part opens; the extents of the grasp region
    [m]; 1 for a slide, else 0; a hinge's lever arm, 0 for a slide, travel and opening [m].
    """
    world = wp.tid()
    p, f, limit = h.part[world], frames(s, h, world), h.observation_limit
    for i in range(s.joints):
        ahead = 10.0 * (s.target_q[world, i] - s.joint_q[world, i])
        s.observation[world, 2 * s.joints + 5 + i] = wp.clamp(ahead, -limit, limit)
        commanded = h.velocity_scale * s.target_qd[world, i]
        s.observation[world, 3 * s.joints + 5 + i] = wp.clamp(commanded, -limit, limit)
    grasp = wp.transform_inverse(f.tool) * f.grasp * h.seen[world]
    y, z = wp.vec3(0.0, 1.0, 0.0), wp.vec3(0.0, 0.0, 1.0)
    axis = p.axis * wp.sign(p.lever_arm)
    along = axis
    if p.slides == 0:
        along = wp.normalize(wp.cross(axis, wp.transform_get_translation(f.grasp) - p.origin))
    arm = wp.where(p.slides == 1, 0.0, wp.abs(p.lever_arm))
    first = s.observation.shape[1] - DESCRIBED
    observe_vector(s, world, first, wp.transform_get_translation(grasp), limit)
    observe_vector(s, world, first + 3, wp.transform_vector(grasp, y), limit)
    observe_vector(s, world, first + 6, wp.transform_vector(grasp, z), limit)
    observe_vector(s, world, first + 9, wp.quat_rotate_inv(p.base, axis), limit)
    observe_vector(s, world, first + 12, wp.quat_rotate_inv(p.base, along), limit)
    observe_vector(s, world, first + 15, p.size, limit)
    observe_vector(s, world, first + 18, wp.vec3(float(p.slides), arm, p.travel), limit)
    s.observation[world, first + 21] = wp.clamp(opening_of(s, h, world), -limit, limit)


@wp.kernel
def _tell_critic(s: State, h: PartHandles):
    """Write what no sensor tells, shape [world PRIVILEGED].

    The true grasp in the tool frame: point [m], its y and z; the force of each finger on the region; 1 where the part is
    grasped; the joint's dry friction and damping and the logarithm of the part's mass; the action's delay [control step].
    """
    world = wp.tid()
    f = frames(s, h, world)
    grasp = wp.transform_inverse(f.tool) * f.grasp
    point, y = wp.transform_get_translation(grasp), wp.transform_vector(grasp, wp.vec3(0.0, 1.0, 0.0))
    z = wp.transform_vector(grasp, wp.vec3(0.0, 0.0, 1.0))
    for i in range(3):
        s.privileged[world, i] = wp.clamp(point[i], -h.observation_limit, h.observation_limit)
        s.privileged[world, 3 + i] = y[i]
        s.privileged[world, 6 + i] = z[i]
        s.privileged[world, 12 + i] = h.resistance[world][i]
    for i in range(2):
        s.privileged[world, 9 + i] = wp.min(FORCE * h.contacts.on_region[world, i], h.observation_limit)
    s.privileged[world, 11] = wp.where(is_grasped(h, h.contact_force, 1.0, world), 1.0, 0.0)
    s.privileged[world, 15] = float(s.delay[world])
