"""Opening a part as a decision process: handles, reward terms, termination.

The formulas of the first six terms are those of IsaacLab 2.3's direct task "Isaac-Franka-Cabinet-Direct-v0", with which the
paper trains. A reward term is one Warp function; REWARDS below lists them, and conf/reward gives them weights.
"""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import numpy as np
import warp as wp

from s2a.env.kernels import finger_position
from s2a.env.state import State
from s2a.env.task import columns
from s2a.sim.simulation import Simulation
from s2a.tasks.open_part.config import OpenPartConfig
from s2a.tasks.part_functions import firmness, frames, opening_of, squared_action, tool_distance
from s2a.tasks.part_handles import PartHandles
from s2a.tasks.part_observation import PRIVILEGED

Grasped = columns(("before", "opening", "maximum", "path"))
"""What is kept of a running episode's grasp: the opening of the last physics step and how much of it the part was grasped over,
by how firmly; the maximum opening so far, and how much of the way to it `grasped_path` pays [m]."""
PRIVILEGED_GRASP = wp.constant(2)
"""Numbers that a critic is told of it."""


@wp.struct
class OpenPart:
    """Handles of the task.

    Attributes:
        p: what all tasks with a part share.
        scale: factor of all openings, below 1 where the part's travel is short, shape [world].
        bonus: openings that give a bonus [m].
        termination: opening that ends the episode [m].
        close_distance: [m].
        gentle_force: [N].
        firm: cosine between the fingers' forces from which a grasp is paid in full.
        grasped: how the part was grasped so far [m], shape [world Grasped].
        progress: of the running episode, see metrics, shape [world column].
        limits: thresholds of the metrics, shape [world limit].
        force: from which a contact counts in the metrics [N].
        static_speed, grasp_fraction, contact_fraction: of the metrics.
    """

    p: PartHandles
    scale: wp.array(dtype=float)
    bonus: wp.vec3
    termination: float
    close_distance: float
    gentle_force: float
    firm: float
    grasped: wp.array2d(dtype=float)
    progress: wp.array2d(dtype=float)
    limits: wp.array2d(dtype=float)
    force: float
    static_speed: float
    grasp_fraction: float
    contact_fraction: float


def bind(sim: Simulation, shared: PartHandles, config: OpenPartConfig) -> OpenPart:
    """Return the handles of the decision process; metrics.bind adds its own."""
    h = OpenPart()
    h.p, h.bonus = shared, wp.vec3(*config.bonus_openings)
    h.termination, h.close_distance = config.termination_opening, config.close_distance
    h.gentle_force, h.firm = config.gentle_force, float(np.cos(np.deg2rad(config.firm_angle)))
    h.scale = wp.array(travel_scale(sim, config.full_travel), dtype=float)
    h.grasped = wp.zeros((sim.num_envs, len(Grasped)), dtype=float)
    return h


def travel_scale(sim: Simulation, full_travel: float) -> np.ndarray:
    """Return the factor of all openings, below 1 where a part travels less than `full_travel` [m], shape [world]."""
    return np.minimum(1.0, np.array([sim.stages[i].travel for i in sim.stage_of_env]) / full_travel)


@wp.func
def signed_square(x: float):
    """Return the square of x with x's sign."""
    return wp.sign(x) * x * x


@wp.func
def distance(s: State, h: OpenPart, world: int):
    """Weight of the tool being near the grasp point: 1 / (1 + d²)², twice that within task.close_distance."""
    d = tool_distance(frames(s, h.p, world))
    near = 1.0 / (1.0 + d * d)
    return near * near * wp.where(d <= h.close_distance, 2.0, 1.0)


@wp.func
def rotation(s: State, h: OpenPart, world: int):
    """Weight of the tool being turned as the grasp is, from -1 to 1."""
    f = frames(s, h.p, world)
    z, y = wp.vec3(0.0, 0.0, 1.0), wp.vec3(0.0, 1.0, 0.0)
    forward = wp.dot(wp.transform_vector(f.tool, z), wp.transform_vector(f.grasp, z))
    upward = wp.dot(wp.transform_vector(f.tool, y), wp.transform_vector(f.grasp, y))
    return 0.5 * (signed_square(forward) + signed_square(upward))


@wp.func
def opening(s: State, h: OpenPart, world: int):
    """Weight of how far the part is open, as the path of its grasp point [m]."""
    return opening_of(s, h.p, world)


@wp.func
def finger(s: State, h: OpenPart, world: int):
    """Weight of the fingers standing on the wrong sides of the grasp point: how far [m], below 0."""
    f = frames(s, h.p, world)
    point, up = wp.transform_get_translation(f.grasp), wp.transform_vector(f.grasp, wp.vec3(0.0, 1.0, 0.0))
    return wp.min(wp.dot(f.left - point, up), 0.0) + wp.min(-wp.dot(f.right - point, up), 0.0)


@wp.func
def bonus(s: State, h: OpenPart, world: int):
    """Weight of each of task.bonus_openings that is passed."""
    passed = float(0.0)
    for i in range(3):
        passed += wp.where(opening_of(s, h.p, world) > h.scale[world] * h.bonus[i], 1.0, 0.0)
    return passed


@wp.func
def action(s: State, h: OpenPart, world: int):
    """Weight of the sum of the squared actions; below 0: a cost."""
    return squared_action(s, world)


@wp.func
def grip(s: State, h: OpenPart, world: int):
    """Weight of both fingers pressing on the grasp region, 0 or 1."""
    return wp.where(wp.min(h.p.region_force[world, 0], h.p.region_force[world, 1]) >= h.p.contact_force, 1.0, 0.0)


@wp.func
def pinch(s: State, h: OpenPart, world: int):
    """Weight of how firmly the part is grasped (`s2a.tasks.part_functions.firmness`), from 0 to 1."""
    return firmness(h.p, h.firm, world)


@wp.func
def grasped_opening(s: State, h: OpenPart, world: int):
    """Weight of how far the part was opened while it was grasped, by how firmly [m]; never more than it is open."""
    return h.grasped[world, Grasped.opening]


@wp.func
def paid_path(h: OpenPart, world: int, opening: float):
    """Return how much of an opening lies on the way from the first to the second of task.bonus_openings [m]."""
    first, second = h.scale[world] * h.bonus[0], h.scale[world] * h.bonus[1]
    return wp.clamp(opening, first, second) - first


@wp.func
def grasped_path(s: State, h: OpenPart, world: int):
    """Weight of how much of that way the part was grasped over, by how firmly, when it came there first: from 0 to 1, squared.

    As in the metrics what was pushed is lost for the episode: to close the part and to open it again in a grasp pays nothing.
    Squared, the last tenths count most.
    """
    path = h.grasped[world, Grasped.path] / wp.max(paid_path(h, world, wp.inf), 1.0e-6)
    return path * path


@wp.func
def closing(s: State, h: OpenPart, world: int):
    """Weight of how far both fingers have closed [m] around the grasp point, within task.close_distance of it."""
    f = frames(s, h.p, world)
    point, up = wp.transform_get_translation(f.grasp), wp.transform_vector(f.grasp, wp.vec3(0.0, 1.0, 0.0))
    between = wp.dot(f.left - point, up) > 0.0 and wp.dot(f.right - point, up) < 0.0
    closed = float(0.0)
    for i in range(s.arm, s.joints):
        closed += s.upper[i] - finger_position(s, world, i, s.joint_q[world, i])
    return wp.where(between and tool_distance(f) <= h.close_distance, closed, 0.0)


@wp.func
def joint_speed(s: State, h: OpenPart, world: int):
    """Weight of the sum of the squared speeds of the arm's joints [rad^2/s^2]; below 0: a cost."""
    squares = float(0.0)
    for i in range(s.arm):
        squares += s.joint_qd[world, i] * s.joint_qd[world, i]
    return squares


@wp.func
def torque(s: State, h: OpenPart, world: int):
    """Weight of the sum of the squared torques of the arm's drives [N^2 m^2]; below 0: a cost."""
    squares = float(0.0)
    for i in range(s.arm):
        squares += s.torque[world, i] * s.torque[world, i]
    return squares


@wp.func
def contact_force(s: State, h: OpenPart, world: int):
    """Weight of how far the robot's max contact force of the step exceeds task.gentle_force [N]; below 0: a cost."""
    return wp.max(h.p.contacts.peak[world] - h.gentle_force, 0.0)


REWARDS = (
    distance,
    rotation,
    opening,
    finger,
    bonus,
    action,
    grip,
    pinch,
    grasped_opening,
    grasped_path,
    closing,
    joint_speed,
    torque,
    contact_force,
)


@wp.kernel
def accumulate_grasped_opening(joint_q: wp.array2d(dtype=float), h: OpenPart):
    """Keep how far the part was opened while it was grasped; joint_q is that after the physics step."""
    world = wp.tid()
    now = joint_q[world, h.p.part[world].coord] * h.p.part[world].lever_arm
    firm, maximum = firmness(h.p, h.firm, world), h.grasped[world, Grasped.maximum]
    gained = firm * wp.max(now - h.grasped[world, Grasped.before], 0.0)
    opening = wp.clamp(h.grasped[world, Grasped.opening] + gained, 0.0, wp.max(now, 0.0))
    h.grasped[world, Grasped.opening] = opening
    h.grasped[world, Grasped.before] = now
    if now > maximum:
        h.grasped[world, Grasped.path] += firm * (paid_path(h, world, now) - paid_path(h, world, maximum))
        h.grasped[world, Grasped.maximum] = now


@wp.kernel
def update(s: State, h: OpenPart):
    """End the episode where the part is open far enough."""
    world = wp.tid()
    now = opening_of(s, h.p, world)
    s.terminated[world] = wp.where(now > h.scale[world] * h.termination, 1, 0)


@wp.kernel
def tell_critic(s: State, h: OpenPart):
    """Write what a critic is told of the grasp so far, in second bonus openings: how much of the opening, and of the way, counts.

    Both are paid in every step that follows: a critic that did not know them would credit a grasp for twenty steps alone.
    """
    world = wp.tid()
    unit = h.scale[world] * h.bonus[1]
    s.privileged[world, PRIVILEGED] = h.grasped[world, Grasped.opening] / unit
    s.privileged[world, PRIVILEGED + 1] = h.grasped[world, Grasped.path] / unit


@wp.kernel
def reset(s: State, h: OpenPart):
    """Clear the last episode's progress; a part that a demonstration has opened was grasped."""
    world = wp.tid()
    if s.done[world] == 1:
        now = opening_of(s, h.p, world)
        h.grasped[world, Grasped.before] = now
        h.grasped[world, Grasped.opening] = now
        h.grasped[world, Grasped.maximum] = now
        h.grasped[world, Grasped.path] = paid_path(h, world, now)
        for i in range(h.progress.shape[1]):
            h.progress[world, i] = 0.0
