"""Kernels of `s2a.joints.joint_worlds`: forces on pulled joints, and corrections by their recordings."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import warp as wp

from s2a.sim.resistance import engaged, held

PARAMETERS = ("mass", "damping", "friction", "breakaway", "spring", "pull_in", "closing")
"""Factor of the stage's mass; [N s/m]; dry friction in motion [N]; how much more of it at rest [N]; closing spring [N/m]; of a
soft close: the force with which it draws the part in [N], its damping while the part closes [N s/m]."""
SHARPNESS = wp.constant(6.0)
"""How sharply dry friction goes over from what holds a body to what it is in motion; an infinite one is Coulomb's law."""


@wp.struct
class Recordings:
    """Recorded pulls, a world each.

    Attributes:
        opening, force: shape [sample world]; NaN past a recording's end.
        joint: index of each world's joint, shape [world].
        lever: path of the grasp point by the coordinate, shape [world].
        inertia: mass at the grasp point, of the stage's mass [kg], shape [world].
        turns: 1 for a hinge, 0 for a slide, shape [world].
        gravity: force along the path [N], of the stage's mass: g0 cos(turns q) + g1 sin(turns q), shape [world] of vec2.
        reach: opening below which a soft close acts [m], shape [world].
        gain: corrections of opening [1] and speed [1/s] by innovation, shape [world 2].
        weight: 1 / (2 variance) of an innovation [1/m^2], shape [world].
    """

    opening: wp.array2d(dtype=float)
    force: wp.array2d(dtype=float)
    joint: wp.array(dtype=int)
    lever: wp.array(dtype=float)
    inertia: wp.array(dtype=float)
    turns: wp.array(dtype=float)
    gravity: wp.array(dtype=wp.vec2)
    reach: wp.array(dtype=float)
    gain: wp.array2d(dtype=float)
    weight: wp.array(dtype=float)


@wp.func
def resisted(before: float, free: float, inverse: float, damping: float, friction: float, breakaway: float):
    """Return the mean force [N] of damping and dry friction in a step, against a motion at the grasp point.

    Damping acts on the mean of the speeds before and after: a light body stays stable, and a damped one does not seem to have
    another mass; then dry friction, which stops the body at most: u f / (u^n + f^n)^(1/n), u being the force that stops it.

    Args:
        before: speed before the step [m/s].
        free: speed after it without damping and friction [m/s].
        inverse: length of the step over the mass [s/kg].
        damping: [N s/m].
        friction: in motion [N].
        breakaway: how much more at rest [N].
    """
    half = 0.5 * inverse * damping
    damped = (free - half * before) / (1.0 + half)
    u = damped * (1.0 + half) / inverse
    most = friction + breakaway * held(damped) + 1.0e-4
    both = wp.pow(wp.pow(wp.abs(u), SHARPNESS) + wp.pow(most, SHARPNESS), 1.0 / SHARPNESS)
    return (free - damped) / inverse + u * most / both / (1.0 + half)


@wp.kernel
def drive(
    r: Recordings,
    parameters: wp.array2d(dtype=float),
    sample: int,
    later: float,
    dt: float,
    joint_q: wp.array(dtype=float),
    joint_qd: wp.array(dtype=float),
    joint_f: wp.array(dtype=float),
):
    """Set the joint's force of a physics step that begins `later` after a sample, in times between samples.

    The body has the stage's own mass. Velocities are those of half a step before (the solver's Euler steps are then a leapfrog),
    which makes openings accurate to the second order.
    """
    world = wp.tid()
    joint, lever = r.joint[world], r.lever[world]
    s, v = joint_q[world] * lever, joint_qd[world] * lever
    pulled = (1.0 - later) * r.force[sample, world] + later * r.force[sample + 1, world]
    acts = engaged(s, r.reach[world])
    force = wp.where(wp.isnan(pulled), 0.0, pulled) - parameters[joint, 4] * s - parameters[joint, 5] * acts
    inverse = dt / (parameters[joint, 0] * r.inertia[world])
    turn, g = r.turns[world] * joint_q[world], r.gravity[world]
    weight = parameters[joint, 0] * (g[0] * wp.cos(turn) + g[1] * wp.sin(turn))  # the solver adds it by itself
    free = v + inverse * (force + weight)
    damping = parameters[joint, 1] + wp.where(v < 0.0, parameters[joint, 6] * acts, 0.0)
    force -= resisted(v, free, inverse, damping, parameters[joint, 2], parameters[joint, 3])
    joint_f[world] = force * lever / parameters[joint, 0]


@wp.kernel
def correct(
    r: Recordings,
    sample: int,
    joint_q: wp.array(dtype=float),
    joint_qd: wp.array(dtype=float),
    next_q: wp.array(dtype=float),
    next_qd: wp.array(dtype=float),
    loss: wp.array(dtype=float),
):
    """Compare a world with a sample, add to its joint's loss, and correct it."""
    world = wp.tid()
    lever, seen = r.lever[world], r.opening[sample, world]
    missed = wp.where(wp.isnan(seen), 0.0, seen - joint_q[world] * lever)
    wp.atomic_add(loss, r.joint[world], r.weight[world] * missed * missed)
    next_q[world] = joint_q[world] + r.gain[world, 0] * missed / lever
    next_qd[world] = joint_qd[world] + r.gain[world, 1] * missed / lever
