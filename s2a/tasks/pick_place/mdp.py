"""Picking and placing as a decision process: what is kept of an episode, reward terms, end, result."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import warp as wp

from s2a.env.kernels import is_sound
from s2a.env.state import State
from s2a.env.task import columns
from s2a.sim.contacts import PartContacts
from s2a.tasks.observation import observe_joints, observe_vector
from s2a.tasks.part_functions import OPPOSED, squared_action
from s2a.tasks.pick_place.start import start_of

METRICS = (
    "success",
    "placed",
    "carried",
    "released_at_rest",
    "undisturbed",
    "grasped",
    "position_error",
    "angle_error",
    "carried_fraction",
    "drift",
    "disturbance",
)
"""success: all of the next four, and physics held. placed: at the end for `rest_time` at its place, the gripper gone, and at
rest: not moved by more than `rest_shift` or turned by more than `rest_turn` in that time; what trembles in place rests too.
carried: a pinch held over enough of the object's path. released_at_rest: after the robot's last touch the object stayed where
it was. undisturbed: nothing else moved by more than `max_disturbance`. grasped: pinched at any time. Numbers at the end:
position_error [m], angle_error [rad], carried_fraction, drift [m], disturbance [m]."""
VALUES = METRICS[6:]
Result = columns(METRICS)
CARRIED, LOOSE, STILL, DRIFT, DISTURBED, TOUCHED, GRASPED = (wp.constant(i) for i in range(7))
"""Columns of `progress`: path while pinched and else [m]; steps at rest at the place; displacement since the last touch [m]; of
other bodies [m]; whether the robot touched the object in this control step; whether it was ever pinched."""
PROGRESS = 7
STRIDE = wp.constant(0.003)
"""[m] Of which the object's path is made: what stands trembles by less."""


@wp.struct
class PickPlace:
    """Handles of the task.

    Attributes:
        contacts: of the robot with the object.
        surface: the object's hulls, a mesh in its body frame.
        body, tool_link, left, right: indices of bodies within a world.
        tool: tool frame in its link.
        base: world from the robot's base.
        goal: planned pose of the object.
        others: bodies that must not move, shape [other].
        progress: of the running episode, shape [world column].
        last: the object's position where its path was last measured [m], shape [world].
        released: where the robot last touched it [m], shape [world].
        origin: where the others were at the start [m], shape [world other].
        rested: the object's pose since which its steps at rest are counted, shape [world].
        contact_force, velocity_scale, observation_limit, position_tolerance, angle_tolerance, rest_shift, rest_turn,
        clear_distance: of the settings.
        rest_steps, settle_steps: of the settings, in control steps.
        carried_fraction, max_drift, max_disturbance: of the metrics.
    """

    contacts: PartContacts
    surface: wp.uint64
    body: int
    tool_link: int
    left: int
    right: int
    tool: wp.transform
    base: wp.quat
    goal: wp.transform
    others: wp.array(dtype=int)
    progress: wp.array2d(dtype=float)
    last: wp.array(dtype=wp.vec3)
    released: wp.array(dtype=wp.vec3)
    origin: wp.array2d(dtype=wp.vec3)
    rested: wp.array(dtype=wp.transform)
    contact_force: float
    velocity_scale: float
    observation_limit: float
    position_tolerance: float
    angle_tolerance: float
    rest_shift: float
    rest_turn: float
    clear_distance: float
    rest_steps: int
    settle_steps: int
    carried_fraction: float
    max_drift: float
    max_disturbance: float


@wp.func
def is_pinched(h: PickPlace, world: int):
    """Return whether both fingers press on the object from opposed sides, and nothing else of the robot presses harder."""
    c = h.contacts
    left, right = c.normal[world, 0], c.normal[world, 1]
    force = wp.min(c.on_region[world, 0], c.on_region[world, 1])
    opposed = wp.dot(left, right) < OPPOSED * wp.length(left) * wp.length(right)
    return force >= h.contact_force and opposed and c.other_links[world] <= force


@wp.func
def position_error(s: State, h: PickPlace, world: int):
    """Return the distance of the object from its planned place [m]."""
    return wp.length(wp.transform_get_translation(s.body_q[world, h.body]) - wp.transform_get_translation(h.goal))


@wp.func
def angle_between(a: wp.transform, b: wp.transform):
    """Return the angle by which one pose is turned against another [rad]."""
    turn = wp.quat_inverse(wp.transform_get_rotation(a)) * wp.transform_get_rotation(b)
    return 2.0 * wp.atan2(wp.length(wp.vec3(turn[0], turn[1], turn[2])), wp.abs(turn[3]))


@wp.func
def angle_error(s: State, h: PickPlace, world: int):
    """Return the angle between the object's rotation and the planned one [rad]."""
    return angle_between(h.goal, s.body_q[world, h.body])


@wp.func
def steps_at_rest(s: State, h: PickPlace, before: float, there: bool, world: int):
    """Return the number of control steps for which the object has been at rest there, from that of the step before.

    It counts from a pose that is kept: a speed at an instant says that what trembles by a tenth of a millimetre moves.
    """
    now, since = s.body_q[world, h.body], h.rested[world]
    moved = wp.length(wp.transform_get_translation(now) - wp.transform_get_translation(since))
    if there and moved <= h.rest_shift and angle_between(since, now) <= h.rest_turn:
        return before + 1.0
    h.rested[world] = now
    return float(0.0)


@wp.func
def clearance(s: State, h: PickPlace, point: wp.vec3, world: int):
    """Return the distance of a point from the object's surface [m], up to 1."""
    local = wp.transform_point(wp.transform_inverse(s.body_q[world, h.body]), point)
    found = wp.mesh_query_point_no_sign(h.surface, local, 1.0)
    if not found.result:
        return float(1.0)
    return wp.length(wp.mesh_eval_position(h.surface, found.face, found.u, found.v) - local)


@wp.func
def tool_of(s: State, h: PickPlace, world: int):
    """Return the tool frame's origin [m]."""
    return wp.transform_get_translation(s.body_q[world, h.tool_link] * h.tool)


@wp.func
def gripper_clearance(s: State, h: PickPlace, world: int):
    """Return the smallest distance of tool and fingers from the object [m]."""
    left = wp.transform_get_translation(s.body_q[world, h.left])
    right = wp.transform_get_translation(s.body_q[world, h.right])
    fingers = wp.min(clearance(s, h, left, world), clearance(s, h, right, world))
    return wp.min(fingers, clearance(s, h, tool_of(s, h, world), world))


@wp.func
def distance(s: State, h: PickPlace, world: int):
    """Weight of the tool being near the object: 1 / (1 + d²)²."""
    d = wp.length(tool_of(s, h, world) - wp.transform_get_translation(s.body_q[world, h.body]))
    return 1.0 / ((1.0 + d * d) * (1.0 + d * d))


@wp.func
def pinch(s: State, h: PickPlace, world: int):
    """Weight of the object being pinched, 0 or 1."""
    return wp.where(is_pinched(h, world), 1.0, 0.0)


@wp.func
def place(s: State, h: PickPlace, world: int):
    """Weight of the object being near its place: 1 / (1 + 10 d)."""
    return 1.0 / (1.0 + 10.0 * position_error(s, h, world))


@wp.func
def rest(s: State, h: PickPlace, world: int):
    """Weight of the object resting at its place with the gripper gone, 0 or 1."""
    return wp.where(h.progress[world, STILL] > 0.0, 1.0, 0.0)


@wp.func
def action(s: State, h: PickPlace, world: int):
    """Weight of the sum of the squared actions; below 0: a cost."""
    return squared_action(s, world)


REWARDS = (distance, pinch, place, rest, action)


@wp.kernel
def reset(s: State, h: PickPlace, first: int):
    """Begin an episode: the object stands at its start, its coordinates from `first` on."""
    world = wp.tid()
    if s.done[world] == 1:
        for i in range(h.progress.shape[1]):
            h.progress[world, i] = 0.0
        h.last[world] = start_of(s, first, world)
        h.released[world] = start_of(s, first, world)


@wp.kernel
def begin(s: State, h: PickPlace):
    """Forget the touch of the control step before."""
    h.progress[wp.tid(), TOUCHED] = 0.0


@wp.kernel
def track(body_q: wp.array2d(dtype=wp.transform), h: PickPlace):
    """Attribute the object's path of a physics step to a pinch or to anything else; body_q is that after the step."""
    world = wp.tid()
    c = h.contacts
    now = wp.transform_get_translation(body_q[world, h.body])
    moved = wp.length(now - h.last[world])
    if moved > STRIDE:
        column = LOOSE
        if is_pinched(h, world):
            column = CARRIED
        h.progress[world, column] += moved
        h.last[world] = now
    if is_pinched(h, world):
        h.progress[world, GRASPED] = 1.0
    touch = c.on_region[world, 0] + c.on_region[world, 1] + c.off_region[world, 0] + c.off_region[world, 1]
    if touch + c.other_links[world] > 0.0:
        h.progress[world, TOUCHED] = 1.0
        h.progress[world, DRIFT] = 0.0
        h.released[world] = now
    h.progress[world, DRIFT] = wp.max(h.progress[world, DRIFT], wp.length(now - h.released[world]))


@wp.kernel
def update(s: State, h: PickPlace):
    """Count the steps in which the object rests at its place; end the episode after enough of them."""
    world = wp.tid()
    at_place = position_error(s, h, world) <= h.position_tolerance and angle_error(s, h, world) <= h.angle_tolerance
    gone = h.progress[world, TOUCHED] == 0.0 and gripper_clearance(s, h, world) >= h.clear_distance
    h.progress[world, STILL] = steps_at_rest(s, h, h.progress[world, STILL], at_place and gone, world)
    for i in range(h.others.shape[0]):
        at = wp.transform_get_translation(s.body_q[world, h.others[i]])
        if s.step[world] <= h.settle_steps:
            h.origin[world, i] = at
        else:
            away = wp.length(at - h.origin[world, i])
            h.progress[world, DISTURBED] = wp.max(h.progress[world, DISTURBED], away)
    s.terminated[world] = wp.where(h.progress[world, STILL] >= float(h.rest_steps), 1, 0)


@wp.kernel
def write_result(s: State, h: PickPlace):
    """Write how the episodes that ended went."""
    world = wp.tid()
    if s.done[world] == 1:
        path = h.progress[world, CARRIED] + h.progress[world, LOOSE]
        fraction = h.progress[world, CARRIED] / wp.max(path, 1e-6)
        placed = wp.where(h.progress[world, STILL] >= float(h.rest_steps), 1.0, 0.0)
        carried = wp.where(path > h.position_tolerance and fraction >= h.carried_fraction, 1.0, 0.0)
        released = wp.where(h.progress[world, DRIFT] <= h.max_drift, 1.0, 0.0)
        undisturbed = wp.where(h.progress[world, DISTURBED] <= h.max_disturbance, 1.0, 0.0)
        s.result[world, Result.success] = is_sound(s, world) * placed * carried * released * undisturbed
        s.result[world, Result.placed] = placed
        s.result[world, Result.carried] = carried
        s.result[world, Result.released_at_rest] = released
        s.result[world, Result.undisturbed] = undisturbed
        s.result[world, Result.grasped] = h.progress[world, GRASPED]
        s.result[world, Result.position_error] = position_error(s, h, world)
        s.result[world, Result.angle_error] = angle_error(s, h, world)
        s.result[world, Result.carried_fraction] = fraction
        s.result[world, Result.drift] = h.progress[world, DRIFT]
        s.result[world, Result.disturbance] = h.progress[world, DISTURBED]


@wp.kernel
def observe(s: State, h: PickPlace):
    """Write the observation, shape [world 2 * joints + 15].

    Joint positions scaled to their range and velocities; in the robot's base frame the vectors from tool to object and from
    object to place [m], the object's x and y axes, and the rotation vector from its orientation to the planned one.
    """
    world = wp.tid()
    limit = h.observation_limit
    observe_joints(s, world, h.velocity_scale, limit)
    pose, first = s.body_q[world, h.body], 2 * s.joints
    at, turn = wp.transform_get_translation(pose), wp.transform_get_rotation(pose)
    observe_vector(s, world, first, wp.quat_rotate_inv(h.base, at - tool_of(s, h, world)), limit)
    observe_vector(s, world, first + 3, wp.quat_rotate_inv(h.base, wp.transform_get_translation(h.goal) - at), limit)
    observe_vector(s, world, first + 6, wp.quat_rotate_inv(h.base, wp.quat_rotate(turn, wp.vec3(1.0, 0.0, 0.0))), limit)
    observe_vector(s, world, first + 9, wp.quat_rotate_inv(h.base, wp.quat_rotate(turn, wp.vec3(0.0, 1.0, 0.0))), limit)
    between = wp.transform_get_rotation(h.goal) * wp.quat_inverse(turn)
    side = wp.where(between[3] < 0.0, -2.0, 2.0)
    observe_vector(
        s, world, first + 12, wp.quat_rotate_inv(h.base, side * wp.vec3(between[0], between[1], between[2])), limit
    )
