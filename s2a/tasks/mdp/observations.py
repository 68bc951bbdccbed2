"""Observation terms of all tasks: Warp functions of (State, World, world), one number or one vector each.

A term that takes a joint, too, gives a number a joint. `observation_kernel` writes them side by side.
The first paragraph of a term's docstring has its unit in brackets, and its frame and range where it has them;
`tools/observation_tables.py` lists them for users.
"""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import warp as wp

from s2a.tasks.mdp.grasp import frames, is_grasped, seen_part, tool_point
from s2a.tasks.state import Grasped, State, World, finger_position, sense

# [m] Observed as 1 by `fine_point`; from FINE_LIMIT of it on it tells the direction alone
FINE_LENGTH = wp.constant(0.02)
FINE_LIMIT = wp.constant(2.5)
FORCE = wp.constant(0.05)  # [1/N] Scale of the fingers' forces for a critic


@wp.func
def clamped_vector(v: wp.vec3, limit: float):
    """Return a vector whose components are clamped to +- a limit."""
    return wp.vec3(wp.clamp(v[0], -limit, limit), wp.clamp(v[1], -limit, limit), wp.clamp(v[2], -limit, limit))


@wp.func
def joint_positions(s: State, w: World, world: int, joint: int) -> float:
    """Position of each joint, -1 to 1 over its range [1].

    That of a finger that holds by opening is mirrored (`State.internal`).
    """
    position = finger_position(s, world, joint, s.joint_q[world, joint])
    return 2.0 * (position - s.lower[joint]) / (s.upper[joint] - s.lower[joint]) - 1.0


@wp.func
def joint_velocities(s: State, w: World, world: int, joint: int) -> float:
    """Velocity of each joint, times task.velocity_scale [rad/s, m/s]."""
    return sense(s, world, joint) * w.number.velocity_scale * s.joint_qd[world, joint]


@wp.func
def target_lead(s: State, w: World, world: int, joint: int) -> float:
    """Lead of each joint's target over the joint, times 10 [rad, m]."""
    return 10.0 * sense(s, world, joint) * (s.target_q[world, joint] - s.joint_q[world, joint])


@wp.func
def target_velocities(s: State, w: World, world: int, joint: int) -> float:
    """Velocity of each joint's target, times task.velocity_scale [rad/s, m/s]."""
    return w.number.velocity_scale * sense(s, world, joint) * s.target_qd[world, joint]


@wp.func
def to_grasp(s: State, w: World, world: int) -> wp.vec3:
    """Vector from the tool to the grasp, in the robot's base frame [m]."""
    f, d = frames(s, w, world), seen_part(s, w, world)
    between = wp.transform_get_translation(d.grasp) - wp.transform_get_translation(f.tool)
    return wp.quat_rotate_inv(w.target[world].base, between)


@wp.func
def coordinate(s: State, w: World, world: int) -> float:
    """Joint coordinate of the part [m or rad]."""
    d = seen_part(s, w, world)
    return d.coordinate


@wp.func
def velocity(s: State, w: World, world: int) -> float:
    """Joint velocity of the part [m/s or rad/s]."""
    d = seen_part(s, w, world)
    return d.velocity


@wp.func
def seen_grasp(s: State, w: World, world: int):
    """Return the seen grasp in the tool frame."""
    f, d = frames(s, w, world), seen_part(s, w, world)
    return wp.transform_inverse(f.tool) * d.grasp


@wp.func
def grasp_point(s: State, w: World, world: int) -> wp.vec3:
    """Point of the grasp, in the tool frame [m]."""
    return wp.transform_get_translation(seen_grasp(s, w, world))


@wp.func
def grasp_y(s: State, w: World, world: int) -> wp.vec3:
    """Axis of the grasp along which the fingers close, in the tool frame: a unit vector [1]."""
    return wp.transform_vector(seen_grasp(s, w, world), wp.vec3(0.0, 1.0, 0.0))


@wp.func
def grasp_z(s: State, w: World, world: int) -> wp.vec3:
    """Approach axis of the grasp, in the tool frame: a unit vector [1]."""
    return wp.transform_vector(seen_grasp(s, w, world), wp.vec3(0.0, 0.0, 1.0))


@wp.func
def joint_axis(s: State, w: World, world: int) -> wp.vec3:
    """Axis of the part's joint, positive opens, in the robot's base frame: a unit vector [1]."""
    d = seen_part(s, w, world)
    return wp.quat_rotate_inv(w.target[world].base, d.axis)


@wp.func
def opening_direction(s: State, w: World, world: int) -> wp.vec3:
    """Direction in which the grasp point moves when the part opens, in the robot's base frame: a unit vector [1]."""
    d = seen_part(s, w, world)
    return wp.quat_rotate_inv(w.target[world].base, d.along)


@wp.func
def grasp_size(s: State, w: World, world: int) -> wp.vec3:
    """Extents of the grasp region along the axes of the grasp, in the grasp frame [m]."""
    d = seen_part(s, w, world)
    return d.size


@wp.func
def joint_kind(s: State, w: World, world: int) -> wp.vec3:
    """1 for a slide, 0 for a hinge; lever arm of a hinge, 0 for a slide; travel of the grasp point [1, m, m]."""
    d = seen_part(s, w, world)
    return wp.vec3(d.slides, d.lever_arm, d.travel)


@wp.func
def opening(s: State, w: World, world: int) -> float:
    """Opening of the part at the grasp point [m]."""
    d = seen_part(s, w, world)
    return d.opening


@wp.func
def fine_point(s: State, w: World, world: int) -> wp.vec3:
    """Point of the grasp in units of 20 mm, -2.5 to 2.5, in the tool frame [20 mm].

    Among distances of half a metre a network hardly sees that the fingers are still a centimetre outside of a pocket.
    """
    return clamped_vector(grasp_point(s, w, world) / FINE_LENGTH, FINE_LIMIT)


@wp.func
def holds_from_within(s: State, w: World, world: int) -> float:
    """0 or 1: the gripper holds the part from within, by opening [1]."""
    return float(s.internal[world])


@wp.func
def true_grasp(s: State, w: World, world: int):
    """Return the true grasp in the tool frame."""
    f = frames(s, w, world)
    return wp.transform_inverse(f.tool) * f.grasp


@wp.func
def true_point(s: State, w: World, world: int) -> wp.vec3:
    """Point of the true grasp, in the tool frame [m]."""
    return clamped_vector(wp.transform_get_translation(true_grasp(s, w, world)), w.number.observation_limit)


@wp.func
def true_y(s: State, w: World, world: int) -> wp.vec3:
    """Closing axis of the true grasp, in the tool frame: a unit vector [1]."""
    return wp.transform_vector(true_grasp(s, w, world), wp.vec3(0.0, 1.0, 0.0))


@wp.func
def true_z(s: State, w: World, world: int) -> wp.vec3:
    """Approach axis of the true grasp, in the tool frame: a unit vector [1]."""
    return wp.transform_vector(true_grasp(s, w, world), wp.vec3(0.0, 0.0, 1.0))


@wp.func
def left_force(s: State, w: World, world: int) -> float:
    """Force of the left finger on the region [20 N]."""
    return wp.min(FORCE * w.contacts.on_region[world, 0], w.number.observation_limit)


@wp.func
def right_force(s: State, w: World, world: int) -> float:
    """Force of the right finger on the region [20 N]."""
    return wp.min(FORCE * w.contacts.on_region[world, 1], w.number.observation_limit)


@wp.func
def grasped(s: State, w: World, world: int) -> float:
    """0 or 1: the part is grasped [1]."""
    return wp.where(is_grasped(w, w.number.contact_force, 1.0, world), 1.0, 0.0)


@wp.func
def resistance(s: State, w: World, world: int) -> wp.vec3:
    """Dry friction and damping of the joint, logarithm of the part's mass [N or N m, N s/m or N m s/rad, log kg]."""
    return w.resistance[world]


@wp.func
def action_delay(s: State, w: World, world: int) -> float:
    """Delay of the actions [control steps]."""
    return float(s.delay[world])


@wp.func
def grasped_opening(s: State, w: World, world: int) -> float:
    """Opening gained in a grasp, over the second of task.bonus_openings [1].

    It and the next are rewarded in every step that follows: a critic that does not know them credits a grasp for twenty steps.
    """
    return w.grasped[world, Grasped.opening] / (w.scale[world] * w.number.bonus[1])


@wp.func
def grasped_path(s: State, w: World, world: int) -> float:
    """Path between the bonus openings gained in a grasp, over the second of them [1]."""
    return w.grasped[world, Grasped.path] / (w.scale[world] * w.number.bonus[1])


@wp.func
def to_object(s: State, w: World, world: int) -> wp.vec3:
    """Vector from the tool to the object, in the robot's base frame [m]."""
    between = wp.transform_get_translation(s.body_q[world, w.body]) - tool_point(s, w, world)
    return wp.quat_rotate_inv(w.target[world].base, between)


@wp.func
def to_place(s: State, w: World, world: int) -> wp.vec3:
    """Vector from the object to its place, a container at zero, in the robot's base frame [m]."""
    at = wp.transform_get_translation(s.body_q[world, w.body])
    return wp.quat_rotate_inv(w.target[world].base, wp.transform_get_translation(w.place.goal) - at)


@wp.func
def object_x(s: State, w: World, world: int) -> wp.vec3:
    """Axis x of the object, in the robot's base frame: a unit vector [1]."""
    turn = wp.transform_get_rotation(s.body_q[world, w.body])
    return wp.quat_rotate_inv(w.target[world].base, wp.quat_rotate(turn, wp.vec3(1.0, 0.0, 0.0)))


@wp.func
def object_y(s: State, w: World, world: int) -> wp.vec3:
    """Axis y of the object, in the robot's base frame: a unit vector [1]."""
    turn = wp.transform_get_rotation(s.body_q[world, w.body])
    return wp.quat_rotate_inv(w.target[world].base, wp.quat_rotate(turn, wp.vec3(0.0, 1.0, 0.0)))


@wp.func
def turn_to_place(s: State, w: World, world: int) -> wp.vec3:
    """Rotation vector from the object's orientation to the planned one, in the robot's base frame [rad]."""
    turn = wp.transform_get_rotation(s.body_q[world, w.body])
    between = wp.transform_get_rotation(w.place.goal) * wp.quat_inverse(turn)
    side = wp.where(between[3] < 0.0, -2.0, 2.0)
    return wp.quat_rotate_inv(w.target[world].base, side * wp.vec3(between[0], between[1], between[2]))


@wp.func
def container_coordinate(s: State, w: World, world: int) -> float:
    """Coordinate of the part into which the object is put [m or rad]."""
    return s.joint_q[world, w.place.coord]


JOINTS = (joint_positions, joint_velocities)
PART = (*JOINTS, to_grasp, coordinate, velocity)  # The reference's observation
# For a policy of many parts: what tells one from another
DESCRIPTION = (
    target_lead, target_velocities, grasp_point, grasp_y, grasp_z, joint_axis, opening_direction, grasp_size, joint_kind,
    opening,
)  # fmt: skip
FINE = (fine_point, holds_from_within)
# For a critic: what no sensor tells
PRIVILEGED = (true_point, true_y, true_z, left_force, right_force, grasped, resistance, action_delay)
# All that a policy observes of a part, by the setting that turns it on
OF_PART = {"": PART, "describe_part": DESCRIPTION, "fine_grasp": FINE}
OBJECT = (*JOINTS, to_object, to_place, object_x, object_y, turn_to_place)
