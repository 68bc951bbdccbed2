"""Reward terms of all tasks: Warp functions (State, World, world) -> float; conf/reward gives them weights.

The formulas of distance, rotation, opening, finger, bonus and action are those of IsaacLab 2.3's direct task
"Isaac-Franka-Cabinet-Direct-v0", with which the paper trains.
"""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import warp as wp

from s2a.tasks.mdp.carrying import position_error
from s2a.tasks.mdp.grasp import firmness, frames, opening_at, opening_of, tool_distance
from s2a.tasks.state import Carried, Grasped, State, World, finger_position

wp.set_module_options({"enable_backward": False})  # half the time to compile


@wp.func
def distance(s: State, w: World, world: int):
    """Weight of the tool being near the grasp point: 1 / (1 + d²)², twice that within task.close_distance."""
    d = tool_distance(frames(s, w, world))
    near = 1.0 / (1.0 + d * d)
    return near * near * wp.where(d <= w.number.close_distance, 2.0, 1.0)


@wp.func
def signed_square(x: float):
    """Return the square of x with x's sign."""
    return wp.sign(x) * x * x


@wp.func
def rotation(s: State, w: World, world: int):
    """Weight of the tool being turned as the grasp is, from -1 to 1."""
    f = frames(s, w, world)
    z, y = wp.vec3(0.0, 0.0, 1.0), wp.vec3(0.0, 1.0, 0.0)
    forward = wp.dot(wp.transform_vector(f.tool, z), wp.transform_vector(f.grasp, z))
    upward = wp.dot(wp.transform_vector(f.tool, y), wp.transform_vector(f.grasp, y))
    return 0.5 * (signed_square(forward) + signed_square(upward))


@wp.func
def opening(s: State, w: World, world: int):
    """Weight of how far the part is open, as the path of its grasp point [m]."""
    return opening_of(s, w, world)


@wp.func
def ajar(s: State, w: World, world: int):
    """Weight of how far the part is open [m]; below 0: a cost."""
    return wp.max(opening_of(s, w, world), 0.0)


@wp.func
def finger(s: State, w: World, world: int):
    """Weight of the fingers standing on the wrong sides of the grasp point: how far [m], below 0."""
    f = frames(s, w, world)
    point, up = wp.transform_get_translation(f.grasp), wp.transform_vector(f.grasp, wp.vec3(0.0, 1.0, 0.0))
    return wp.min(wp.dot(f.left - point, up), 0.0) + wp.min(-wp.dot(f.right - point, up), 0.0)


@wp.func
def bonus(s: State, w: World, world: int):
    """Weight of each of task.bonus_openings that is passed."""
    passed = float(0.0)
    for i in range(3):
        passed += wp.where(opening_of(s, w, world) > w.scale[world] * w.number.bonus[i], 1.0, 0.0)
    return passed


@wp.func
def sum_of_squares(values: wp.array2d(dtype=float), world: int, count: int):
    """Return the sum of the squares of a world's first values [world column]."""
    squares = float(0.0)
    for i in range(count):
        squares += values[world, i] * values[world, i]
    return squares


@wp.func
def action(s: State, w: World, world: int):
    """Weight of the sum of the squared actions; below 0: a cost."""
    return sum_of_squares(s.action, world, s.action.shape[1])


@wp.func
def grip(s: State, w: World, world: int):
    """Weight of both fingers pressing on the grasp region, 0 or 1."""
    return wp.where(wp.min(w.region_force[world, 0], w.region_force[world, 1]) >= w.number.contact_force, 1.0, 0.0)


@wp.func
def pinch(s: State, w: World, world: int):
    """Weight of how firmly the target is grasped (`s2a.tasks.mdp.grasp.firmness`), from 0 to 1."""
    return firmness(w, world)


@wp.func
def grasped_opening(s: State, w: World, world: int):
    """Weight of how far the part was opened while it was grasped, by how firmly [m]; never more than it is open."""
    return w.grasped[world, Grasped.opening]


@wp.func
def rewarded_path(w: World, world: int, opening: float):
    """Return how much of an opening lies on the path from the first to the second of task.bonus_openings [m]."""
    first, second = w.scale[world] * w.number.bonus[0], w.scale[world] * w.number.bonus[1]
    return wp.clamp(opening, first, second) - first


@wp.func
def grasped_path(s: State, w: World, world: int):
    """Weight of how much of that path the part was grasped over, by how firmly, at its first passing: from 0 to 1, squared.

    As in the metrics what was pushed is lost for the episode: to close the part and to open it again in a grasp has no reward.
    Squared, the last tenths count most.
    """
    path = w.grasped[world, Grasped.path] / wp.max(rewarded_path(w, world, wp.inf), 1.0e-6)
    return path * path


@wp.func
def closing(s: State, w: World, world: int):
    """Weight of how far both fingers have closed [m] around the grasp point, within task.close_distance of it."""
    f = frames(s, w, world)
    point, up = wp.transform_get_translation(f.grasp), wp.transform_vector(f.grasp, wp.vec3(0.0, 1.0, 0.0))
    between = wp.dot(f.left - point, up) > 0.0 and wp.dot(f.right - point, up) < 0.0
    closed = float(0.0)
    for i in range(s.arm, s.joints):
        closed += s.upper[i] - finger_position(s, world, i, s.joint_q[world, i])
    return wp.where(between and tool_distance(f) <= w.number.close_distance, closed, 0.0)


@wp.func
def joint_speed(s: State, w: World, world: int):
    """Weight of the sum of the squared speeds of the arm's joints [rad^2/s^2]; below 0: a cost."""
    return sum_of_squares(s.joint_qd, world, s.arm)


@wp.func
def torque(s: State, w: World, world: int):
    """Weight of the sum of the squared torques of the arm's drives [N^2 m^2]; below 0: a cost."""
    return sum_of_squares(s.torque, world, s.arm)


@wp.func
def contact_force(s: State, w: World, world: int):
    """Weight of how far the robot's max contact force of the step exceeds task.gentle_force [N]; below 0: a cost."""
    return wp.max(w.contacts.peak[world] - w.number.gentle_force, 0.0)


@wp.func
def place(s: State, w: World, world: int):
    """Weight of the object being near its place: 1 / (1 + 10 d)."""
    return 1.0 / (1.0 + 10.0 * position_error(s, w, world))


@wp.func
def rest(s: State, w: World, world: int):
    """Weight of the object resting at its place with the gripper gone, and its container shut where there is one, 0 or 1."""
    return wp.where(w.carried[world, Carried.still] > 0.0, 1.0, 0.0)


@wp.kernel
def accumulate_grasped_opening(s: State, w: World, joint_q: wp.array2d(dtype=float)):
    """Keep how far the part was opened while it was grasped; joint_q is that after the physics step."""
    world = wp.tid()
    now = opening_at(w, joint_q[world, w.target[world].coord], world)
    firm, maximum = firmness(w, world), w.grasped[world, Grasped.maximum]
    gained = firm * wp.max(now - w.grasped[world, Grasped.before], 0.0)
    opened = wp.clamp(w.grasped[world, Grasped.opening] + gained, 0.0, wp.max(now, 0.0))
    w.grasped[world, Grasped.opening] = opened
    w.grasped[world, Grasped.before] = now
    if now > maximum:
        w.grasped[world, Grasped.path] += firm * (rewarded_path(w, world, now) - rewarded_path(w, world, maximum))
        w.grasped[world, Grasped.maximum] = now


@wp.kernel
def begin_grasped(s: State, w: World):
    """Where an episode begins: a part that a demonstration has opened was grasped."""
    world = wp.tid()
    if s.done[world] == 1:
        now = opening_of(s, w, world)
        w.grasped[world, Grasped.before] = now
        w.grasped[world, Grasped.opening] = now
        w.grasped[world, Grasped.maximum] = now
        w.grasped[world, Grasped.path] = rewarded_path(w, world, now)
