"""Kernels of `s2a.joints.arm_worlds`: forces on joints that an arm pulls."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import warp as wp

from s2a.joints.joint_kernels import resisted
from s2a.sim.resistance import engaged

STOP = wp.constant(2.0e4)
"""[N/m] Of the stop of a closed part."""
STOP_DAMPING = wp.constant(1.0e6)
"""[N s/m^2] Of the same, by its depth (Hunt and Crossley's contact, which begins without a jump): nothing bounces off it."""


@wp.struct
class Arms:
    """Bodies on their joints and the arms that pull them, a world each; all at the grasp point, s its path [m].

    Attributes:
        lever: path of the grasp point by the coordinate, shape [world].
        inertia: mass at the grasp point, of the stage's mass [kg], shape [world].
        turns: 1 for a hinge, 0 for a slide, shape [world].
        gravity: force along the path [N], of the stage's mass: g0 cos(turns q) + g1 sin(turns q), shape [world] of vec2.
        dynamics: joint_kernels.PARAMETERS, shape [world parameter].
        reach: opening below which a soft close acts [m], shape [world].
        arm: of the arm along the path at even places: stiffness [N/m], damping [N s/m], mass [kg], shape [world place] of vec3.
        spacing: between the places [m], shape [world].
    """

    lever: wp.array(dtype=float)
    inertia: wp.array(dtype=float)
    turns: wp.array(dtype=float)
    gravity: wp.array(dtype=wp.vec2)
    dynamics: wp.array2d(dtype=float)
    reach: wp.array(dtype=float)
    arm: wp.array2d(dtype=wp.vec3)
    spacing: wp.array(dtype=float)


@wp.struct
class Rolled:
    """How the worlds moved.

    Attributes:
        opening: at the beginning of a step [m], shape [step world].
        speed: at its end [m/s], shape [step world].
        force: of the gripper on the handle, along the path [N], shape [step world].
    """

    opening: wp.array2d(dtype=float)
    speed: wp.array2d(dtype=float)
    force: wp.array2d(dtype=float)


@wp.func
def arm_at(h: Arms, world: int, s: float):
    """Return stiffness, damping and mass of the arm where the grasp point is."""
    last = h.arm.shape[1] - 2
    at = wp.clamp(s / h.spacing[world], 0.0, float(last + 1))
    i = wp.min(int(at), last)
    return wp.lerp(h.arm[world, i], h.arm[world, i + 1], at - float(i))


@wp.kernel
def pull(
    h: Arms,
    setpoint: wp.array2d(dtype=float),
    step: int,
    dt: float,
    joint_q: wp.array(dtype=float),
    joint_qd: wp.array(dtype=float),
    joint_f: wp.array(dtype=float),
    moved: Rolled,
):
    """Set the joint's force of a physics step in which the arm pulls the part to a set-point, and keep how both move.

    Arm and part move as one body, M + m at the grasp point; the solver's has the stage's mass m alone, so that the joint's force
    gives it the acceleration of both. Velocities are those of half a step before; see `joint_kernels.drive`.
    """
    world = wp.tid()
    lever, mass = h.lever[world], h.dynamics[world, 0] * h.inertia[world]
    s, v, arm = joint_q[world] * lever, joint_qd[world] * lever, arm_at(h, world, joint_q[world] * lever)
    turn, g = h.turns[world] * joint_q[world], h.gravity[world]
    weight = g[0] * wp.cos(turn) + g[1] * wp.sin(turn)
    pulled = arm[0] * (setpoint[step, world] - s)
    force = pulled + h.dynamics[world, 0] * weight - h.dynamics[world, 4] * s + STOP * wp.max(-s, 0.0)
    acts = engaged(s, h.reach[world])
    force -= acts * h.dynamics[world, 5]
    inverse = dt / (mass + arm[2])
    damping, friction, breakaway = h.dynamics[world, 1] + arm[1], h.dynamics[world, 2], h.dynamics[world, 3]
    damping += wp.where(v < 0.0, acts * h.dynamics[world, 6], 0.0) + STOP_DAMPING * wp.max(-s, 0.0)
    force -= resisted(v, v + inverse * force, inverse, damping, friction, breakaway)
    a = force / (mass + arm[2])
    moved.opening[step, world] = s
    moved.speed[step, world] = v + dt * a
    moved.force[step, world] = pulled - arm[1] * (v + 0.5 * dt * a) - arm[2] * a
    joint_f[world] = (h.inertia[world] * a - weight) * lever  # the solver adds the weight by itself
