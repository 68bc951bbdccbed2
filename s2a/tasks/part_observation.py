"""What a policy sees of an articulated part, and what its critic is told besides."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import math

import warp as wp

from s2a.env.kernels import finger_position, sense
from s2a.env.state import State
from s2a.sim.simulation import Simulation
from s2a.tasks.observation import observe_joints, observe_vector
from s2a.tasks.part_functions import frames, is_grasped, opening_of
from s2a.tasks.part_handles import EstimatedPart, PartHandles, PartMdp

DESCRIBED = wp.constant(22)
"""Numbers that tell one part from another."""
FINE = wp.constant(4)
"""Numbers that tell where the last centimetres of the way lead."""
FINE_LENGTH = wp.constant(0.02)
"""[m] Told as 1, where a policy is told the way in fine; from FINE_LIMIT of it on it is told the direction alone."""
FINE_LIMIT = wp.constant(2.5)
PRIVILEGED = wp.constant(16)
"""Numbers that a critic is told."""
HOLD_DISTANCE = wp.constant(0.1)
"""[m] From the grasp that is told, up to which the tool is at it; the reference's tool frame is 6 cm from the fingertips."""
HOLD_GAP = wp.constant(0.002)
"""[m] By which a finger's target is closed further than the finger, and by which fingers are open that hold something."""
HOLD_SPEED = wp.constant(0.01)
"""[m/s] Below it a finger stands still."""
FORCE = wp.constant(0.05)
"""[1/N] Scale of the fingers' forces for a critic."""


def length(sim: Simulation, config: PartMdp) -> int:
    """Return the length of an observation."""
    joints = sim.layout.robot_joints
    described = 2 * joints + int(DESCRIBED) + (int(FINE) if config.fine_grasp else 0)
    return 2 * joints + 5 + (described if config.describe_part else 0)


def privileged_length(config: PartMdp) -> int:
    """Return how many numbers a critic is told besides."""
    return int(PRIVILEGED) if config.describe_part else 0


def observe(state: State, h: PartHandles, config: PartMdp) -> None:
    """Write the observations."""
    worlds = len(state.done)
    wp.launch(_observe, dim=worlds, inputs=[state, h])
    if config.describe_part:
        wp.launch(_describe, dim=worlds, inputs=[state, h])
        if config.fine_grasp:
            wp.launch(_describe_finely, dim=worlds, inputs=[state, h])
        wp.launch(_tell_critic, dim=worlds, inputs=[state, h])


def track(state: State, h: PartHandles) -> None:
    """Follow the part's opening by the robot's own motion, where a policy is told an estimate."""
    if h.is_estimated:
        wp.launch(_track, dim=len(state.done), inputs=[state, h])


def is_misplaced(config: PartMdp) -> bool:
    """Return whether the grasp that is seen is not the true one."""
    return max(*config.grasp_error, *config.grasp_turn) > 0.0


def misplace_grasp(state: State, h: PartHandles, config: PartMdp) -> None:
    """Draw a new error of the grasp that is seen, or a new frame of the camera, in worlds whose episode ended."""
    if h.is_estimated:
        wp.launch(_choose_frame, dim=len(state.done), inputs=[state, h])
        return
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
def _choose_frame(s: State, h: PartHandles):
    """Draw one of the stage's estimates; the part stands where the episode begins, which is zero but in episodes that train."""
    world = wp.tid()
    if s.done[world] == 0:
        return
    rng, stage = s.rng[world], h.stage[world]
    h.frame[world] = wp.randi(rng, 0, h.estimates.shape[1])
    h.seen[world] = wp.transform_inverse(h.part[world].grasp) * h.estimates[stage, h.frame[world]].grasp
    h.tracked[world] = wp.vec2(wp.max(opening_of(s, h, world), 0.0), 0.0)
    h.tool_before[world] = wp.vec3(wp.inf, 0.0, 0.0)
    s.rng[world] = rng


@wp.func
def estimate_of(h: PartHandles, world: int):
    """Return what a policy is told of a world's part."""
    return h.estimates[h.stage[world], h.frame[world]]


@wp.func
def grasp_at(t: EstimatedPart, opening: float):
    """Return the grasp frame that is told, the part opened so far [m]."""
    point, turn = wp.transform_get_translation(t.grasp), wp.transform_get_rotation(t.grasp)
    if t.slides == 1:
        return wp.transform(point + opening * t.along, turn)
    by = wp.quat_from_axis_angle(t.axis, opening / t.lever_arm)
    return wp.transform(t.origin + wp.quat_rotate(by, point - t.origin), by * turn)


@wp.func
def along_at(t: EstimatedPart, opening: float):
    """Return the direction in which the grasp that is told moves, the part opened so far [m]."""
    if t.slides == 1:
        return t.along
    return wp.quat_rotate(wp.quat_from_axis_angle(t.axis, opening / t.lever_arm), t.along)


@wp.kernel
def _track(s: State, h: PartHandles):
    """Add to the tracked opening what the tool moved along the told path in a control step, while the gripper holds something.

    It holds something where its fingers are asked to close, stand still, are not closed, and the tool is near the grasp.
    """
    world = wp.tid()
    t, now = estimate_of(h, world), frames(s, h, world)
    tool = wp.transform_get_translation(now.tool)
    opening = h.tracked[world][0]
    holds = wp.length(tool - wp.transform_get_translation(grasp_at(t, opening))) < HOLD_DISTANCE
    width = float(0.0)
    for i in range(s.arm, s.joints):
        width += finger_position(s, world, i, s.joint_q[world, i])
        closes = sense(s, world, i) * (s.joint_q[world, i] - s.target_q[world, i]) > HOLD_GAP
        holds = holds and closes and wp.abs(s.joint_qd[world, i]) < HOLD_SPEED
    gained = float(0.0)
    if holds and width > HOLD_GAP and wp.isfinite(h.tool_before[world][0]):
        step = tool - h.tool_before[world]
        if t.slides == 1:
            gained = wp.dot(step, t.along)
        else:
            out = tool - t.origin
            out -= wp.dot(out, t.axis) * t.axis
            gained = t.lever_arm * wp.dot(step, wp.cross(t.axis, out)) / wp.max(wp.dot(out, out), 1.0e-4)
    h.tracked[world] = wp.vec2(wp.max(opening + gained, 0.0), gained / h.control_step)
    h.tool_before[world] = tool


@wp.struct
class SeenPart:
    """What a policy sees of a part: the seen grasp, world frame; axis to travel as of EstimatedPart, where the part now is.

    Attributes:
        opening: [m].
        coordinate, velocity: of the joint [m or rad, a second].
    """

    grasp: wp.transform
    axis: wp.vec3
    along: wp.vec3
    size: wp.vec3
    slides: float
    lever_arm: float
    travel: float
    opening: float
    coordinate: float
    velocity: float


@wp.func
def seen_part(s: State, h: PartHandles, world: int):
    """Return what a policy sees of a world's part: the truth but for the error of the grasp, or what it is told."""
    d, p = SeenPart(), h.part[world]
    if h.is_estimated == 1:
        t, track = estimate_of(h, world), h.tracked[world]
        unit = wp.where(t.slides == 1, 1.0, wp.max(t.lever_arm, 1.0e-6))
        d.grasp = grasp_at(t, track[0])
        d.opening = track[0]
        d.axis = t.axis
        d.along = along_at(t, track[0])
        d.size = t.size
        d.slides = float(t.slides)
        d.lever_arm = t.lever_arm
        d.travel = t.travel
        d.coordinate = track[0] / unit
        d.velocity = track[1] / unit
        return d
    grasp = s.body_q[world, h.bodies.part] * p.grasp
    d.grasp = grasp * h.seen[world]
    d.opening = opening_of(s, h, world)
    d.axis = p.axis * wp.sign(p.lever_arm)
    d.size = p.size
    d.slides = float(p.slides)
    d.travel = p.travel
    d.along = d.axis
    d.lever_arm = 0.0
    if p.slides == 0:
        d.along = wp.normalize(wp.cross(d.axis, wp.transform_get_translation(grasp) - p.origin))
        d.lever_arm = wp.abs(p.lever_arm)
    d.coordinate = s.joint_q[world, p.coord]
    d.velocity = s.joint_qd[world, p.dof]
    return d


@wp.kernel
def _observe(s: State, h: PartHandles):
    """Write the reference's observation, shape [world 2 * joints + 5].

    Joint positions scaled to their range and velocities, the vector from tool to grasp in the robot's base frame [m], the
    part's coordinate and velocity.
    """
    world = wp.tid()
    limit = h.observation_limit
    observe_joints(s, world, h.velocity_scale, limit)
    f, d = frames(s, h, world), seen_part(s, h, world)
    between = wp.transform_get_translation(d.grasp) - wp.transform_get_translation(f.tool)
    observe_vector(s, world, 2 * s.joints, wp.quat_rotate_inv(h.part[world].base, between), limit)
    s.observation[world, 2 * s.joints + 3] = wp.clamp(d.coordinate, -limit, limit)
    s.observation[world, 2 * s.joints + 4] = wp.clamp(d.velocity, -limit, limit)


@wp.kernel
def _describe(s: State, h: PartHandles):
    """Write what a policy of many parts sees besides.

    How far each joint's target is ahead of it [rad, m], ten times, and the target's velocity, scaled as the joint's. Then what
    tells one part from another: the seen grasp in the tool frame: point [m], its y and z; in the robot's base frame the joint's
    axis, positive opens, and the direction in which the grasp point moves when the part opens; the extents of the grasp region
    [m]; 1 for a slide, else 0; a hinge's lever arm, 0 for a slide, travel and opening [m].
    """
    world = wp.tid()
    base, f, d, limit = h.part[world].base, frames(s, h, world), seen_part(s, h, world), h.observation_limit
    for i in range(s.joints):
        ahead = 10.0 * sense(s, world, i) * (s.target_q[world, i] - s.joint_q[world, i])
        s.observation[world, 2 * s.joints + 5 + i] = wp.clamp(ahead, -limit, limit)
        commanded = h.velocity_scale * sense(s, world, i) * s.target_qd[world, i]
        s.observation[world, 3 * s.joints + 5 + i] = wp.clamp(commanded, -limit, limit)
    grasp = wp.transform_inverse(f.tool) * d.grasp
    y, z = wp.vec3(0.0, 1.0, 0.0), wp.vec3(0.0, 0.0, 1.0)
    first = 4 * s.joints + 5
    observe_vector(s, world, first, wp.transform_get_translation(grasp), limit)
    observe_vector(s, world, first + 3, wp.transform_vector(grasp, y), limit)
    observe_vector(s, world, first + 6, wp.transform_vector(grasp, z), limit)
    observe_vector(s, world, first + 9, wp.quat_rotate_inv(base, d.axis), limit)
    observe_vector(s, world, first + 12, wp.quat_rotate_inv(base, d.along), limit)
    observe_vector(s, world, first + 15, d.size, limit)
    observe_vector(s, world, first + 18, wp.vec3(d.slides, d.lever_arm, d.travel), limit)
    s.observation[world, first + 21] = wp.clamp(d.opening, -limit, limit)


@wp.kernel
def _describe_finely(s: State, h: PartHandles):
    """Write the seen grasp point in the tool frame [FINE_LENGTH], at most FINE_LIMIT, and 1 where the gripper holds from within.

    Among distances of half a metre a network hardly sees that the fingers are still a centimetre outside of a pocket.
    """
    world = wp.tid()
    f, d = frames(s, h, world), seen_part(s, h, world)
    point = wp.transform_get_translation(wp.transform_inverse(f.tool) * d.grasp) / FINE_LENGTH
    first = 4 * s.joints + 5 + DESCRIBED
    observe_vector(s, world, first, point, FINE_LIMIT)
    s.observation[world, first + 3] = float(s.internal[world])


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
