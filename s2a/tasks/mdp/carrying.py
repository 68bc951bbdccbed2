"""Metrics of carrying an object to its place: what held it on its path, where it came to rest, what else moved.

Inside of a container, which carries the object as it is shut, path and displacement of the object are those against the
container. Results are Warp functions (State, World, world) -> float, of an episode that ended.
"""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import warp as wp

from s2a.tasks.mdp.grasp import is_grasped, tool_point
from s2a.tasks.state import Carried, State, World, is_sound

wp.set_module_options({"enable_backward": False})  # half the time to compile

STRIDE = wp.constant(0.003)  # [m] Of which the object's path is made: what stands trembles by less
FAR = wp.constant(1.0)  # [m] Distances are measured up to it


@wp.func
def at_place(w: World, body_q: wp.array2d(dtype=wp.transform), world: int):
    """Return the object's pose in the frame of its place: the world's, or that of the container."""
    pose = body_q[world, w.body]
    if w.place.container < 0:
        return pose
    return wp.transform_inverse(body_q[world, w.place.container]) * pose


@wp.func
def is_inside(w: World, point: wp.vec3):
    """Return whether a point in the container's frame is inside of it; never without a container."""
    local, half = wp.transform_point(wp.transform_inverse(w.place.inside), point), w.place.half
    return (
        w.place.container >= 0
        and wp.abs(local[0]) <= half[0]
        and wp.abs(local[1]) <= half[1]
        and wp.abs(local[2]) <= half[2]
    )


@wp.func
def position_error(s: State, w: World, world: int):
    """Distance of the object from its planned place [m]."""
    now = at_place(w, s.body_q, world)
    return wp.length(wp.transform_get_translation(now) - wp.transform_get_translation(w.place.goal))


@wp.func
def angle_between(a: wp.transform, b: wp.transform):
    """Return the angle by which one pose is turned against another [rad]."""
    turn = wp.quat_inverse(wp.transform_get_rotation(a)) * wp.transform_get_rotation(b)
    return 2.0 * wp.atan2(wp.length(wp.vec3(turn[0], turn[1], turn[2])), wp.abs(turn[3]))


@wp.func
def angle_error(s: State, w: World, world: int):
    """Angle between the object's orientation and the planned one [rad]."""
    return angle_between(w.place.goal, at_place(w, s.body_q, world))


@wp.func
def clearance(hulls: wp.uint64, pose: wp.transform, point: wp.vec3):
    """Return the distance of a point from the surface of a body's hulls [m], up to FAR."""
    local = wp.transform_point(wp.transform_inverse(pose), point)
    nearest = wp.mesh_query_point_no_sign(hulls, local, FAR)
    if not nearest.result:
        return float(FAR)
    return wp.length(wp.mesh_eval_position(hulls, nearest.face, nearest.u, nearest.v) - local)


@wp.func
def gripper_clearance(s: State, w: World, world: int):
    """Return the smallest distance of tool and fingers from the object, and from the container where there is one [m]."""
    left = wp.transform_get_translation(s.body_q[world, w.left])
    right = wp.transform_get_translation(s.body_q[world, w.right])
    tool, pose = tool_point(s, w, world), s.body_q[world, w.body]
    fingers = wp.min(clearance(w.place.object, pose, left), clearance(w.place.object, pose, right))
    least = wp.min(fingers, clearance(w.place.object, pose, tool))
    if w.place.container >= 0:
        around, hulls = s.body_q[world, w.place.container], w.place.hulls
        of_container = wp.min(clearance(hulls, around, left), clearance(hulls, around, right))
        least = wp.min(least, wp.min(of_container, clearance(hulls, around, tool)))
    return least


@wp.func
def steps_at_rest(s: State, w: World, there: bool, world: int):
    """Return the number of control steps for which the object has been at rest there.

    It counts from a pose that is kept: a speed at an instant says that what trembles by a tenth of a millimetre moves.
    """
    now, since = s.body_q[world, w.body], w.rested[world]
    moved = wp.length(wp.transform_get_translation(now) - wp.transform_get_translation(since))
    if there and moved <= w.number.rest_shift and angle_between(since, now) <= w.number.rest_turn:
        return w.carried[world, Carried.still] + 1.0
    w.rested[world] = now
    return float(0.0)


@wp.kernel
def shift(s: State, w: World, far: float, turn: float):
    """Where an episode begins, shift the object by up to `far` [m] along x and y, and turn it by up to `turn` [rad] about z."""
    world = wp.tid()
    if s.done[world] == 1:
        rng = s.rng[world]  # by itself: as one of several it would not be a copy, which advances
        first = w.target[world].coord
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


@wp.kernel
def begin(s: State, w: World):
    """Begin an episode: the object stands at its start."""
    world = wp.tid()
    if s.done[world] == 1:
        for i in range(w.carried.shape[1]):
            w.carried[world, i] = 0.0
        first = w.target[world].coord
        start = wp.vec3(s.joint_q[world, first], s.joint_q[world, first + 1], s.joint_q[world, first + 2])
        for i in range(2):
            w.last[world, i] = start
            w.released[world, i] = start


@wp.kernel
def track(s: State, w: World, joint_q: wp.array2d(dtype=float), body_q: wp.array2d(dtype=wp.transform)):
    """Attribute the object's path of a physics step to a grasp or to anything else; coordinates and poses are those after it."""
    world = wp.tid()
    c, held = w.contacts, is_grasped(w, w.number.contact_force, 1.0, world)
    now = wp.transform_get_translation(body_q[world, w.body])
    now_in = wp.transform_get_translation(at_place(w, body_q, world))
    inside = is_inside(w, now_in)
    if inside:
        w.last[world, 0] = now
    else:
        w.last[world, 1] = now_in
    moved = wp.max(wp.length(now - w.last[world, 0]), wp.length(now_in - w.last[world, 1]))
    if moved > STRIDE:
        column = int(Carried.loose)
        if held:
            column = int(Carried.carried)
        w.carried[world, column] += moved
        w.last[world, 0] = now
        w.last[world, 1] = now_in
    if held:
        w.carried[world, Carried.grasped] = 1.0
    touch = c.on_region[world, 0] + c.on_region[world, 1] + c.off_region[world, 0] + c.off_region[world, 1]
    coordinate = float(0.0)
    if w.place.container >= 0:
        coordinate = wp.abs(joint_q[world, w.place.coord])
    if touch + c.other_links[world] > 0.0:
        w.carried[world, Carried.touched] = 1.0
        w.carried[world, Carried.drift] = 0.0
        w.released[world, 0] = now
        w.released[world, 1] = now_in
    elif inside:
        w.carried[world, Carried.ride] += wp.max(0.0, w.carried[world, Carried.coordinate] - coordinate)
    w.carried[world, Carried.coordinate] = coordinate
    away = wp.length(now - w.released[world, 0])
    if inside:
        away = wp.length(now_in - w.released[world, 1])
    w.carried[world, Carried.drift] = wp.max(w.carried[world, Carried.drift], away)


@wp.func
def is_stored(s: State, w: World, world: int):
    """Return whether the object is inside of the container, and that is shut; true without one."""
    if w.place.container < 0:
        return True
    inside = is_inside(w, wp.transform_get_translation(at_place(w, s.body_q, world)))
    return inside and wp.abs(s.joint_q[world, w.place.coord]) <= w.place.shut


@wp.kernel
def update(s: State, w: World):
    """Count the steps in which the object rests at its place; end the episode after enough of them."""
    world = wp.tid()
    number = w.number
    there = position_error(s, w, world) <= number.position_tolerance
    there = there and angle_error(s, w, world) <= number.angle_tolerance
    gone = w.carried[world, Carried.touched] == 0.0 and gripper_clearance(s, w, world) >= number.clear_distance
    there = there and gone and is_stored(s, w, world)
    w.carried[world, Carried.still] = steps_at_rest(s, w, there, world)
    for i in range(w.others.shape[0]):
        at = wp.transform_point(s.body_q[world, w.others[i]], w.middle[world, i])
        if s.step[world] <= w.place.settle_steps:
            w.origin[world, i] = at
        else:
            away = wp.length(at - w.origin[world, i])
            w.carried[world, Carried.disturbed] = wp.max(w.carried[world, Carried.disturbed], away)
    s.terminated[world] = wp.where(w.carried[world, Carried.still] >= float(w.place.rest_steps), 1, 0)


@wp.func
def path(w: World, world: int):
    """Return the length of the object's path [m]."""
    return w.carried[world, Carried.carried] + w.carried[world, Carried.loose]


@wp.func
def placed(s: State, w: World, world: int):
    """At the end for `rest_time` at its place, the gripper gone, its container shut where there is one, and at rest.

    At rest: not moved by more than `rest_shift` or turned by more than `rest_turn` in that time; what trembles in place rests.
    """
    return wp.where(w.carried[world, Carried.still] >= float(w.place.rest_steps), 1.0, 0.0)


@wp.func
def carried(s: State, w: World, world: int):
    """A grasp held over enough of the object's path."""
    enough = carried_fraction(s, w, world) >= w.number.carried_fraction
    return wp.where(path(w, world) > w.number.position_tolerance and enough, 1.0, 0.0)


@wp.func
def released_at_rest(s: State, w: World, world: int):
    """After the robot's last touch the object stayed where it was."""
    return wp.where(w.carried[world, Carried.drift] <= w.number.max_drift, 1.0, 0.0)


@wp.func
def shut_with_it(s: State, w: World, world: int):
    """The container was shut by `min_ride` or more with the object in it and untouched."""
    return wp.where(w.place.lever * w.carried[world, Carried.ride] >= w.number.min_ride, 1.0, 0.0)


@wp.func
def undisturbed(s: State, w: World, world: int):
    """Nothing else moved by more than `max_disturbance`."""
    return wp.where(w.carried[world, Carried.disturbed] <= w.number.max_disturbance, 1.0, 0.0)


@wp.func
def success(s: State, w: World, world: int):
    """Placed, carried, released at rest, undisturbed, shut with it where there is a container; and physics held."""
    rode = wp.where(w.place.container < 0, 1.0, shut_with_it(s, w, world))
    each = placed(s, w, world) * carried(s, w, world) * released_at_rest(s, w, world) * undisturbed(s, w, world)
    return is_sound(s, world) * each * rode


@wp.func
def grasped(s: State, w: World, world: int):
    """Grasped at any time."""
    return w.carried[world, Carried.grasped]


@wp.func
def remaining(s: State, w: World, world: int):
    """The container's coordinate at the end [m or rad]."""
    return wp.abs(s.joint_q[world, w.place.coord])


@wp.func
def carried_fraction(s: State, w: World, world: int):
    """Fraction of the object's path over which it was grasped."""
    return w.carried[world, Carried.carried] / wp.max(path(w, world), 1e-6)


@wp.func
def drift(s: State, w: World, world: int):
    """Displacement after the robot's last touch [m]."""
    return w.carried[world, Carried.drift]


@wp.func
def disturbance(s: State, w: World, world: int):
    """Largest displacement of anything else [m]."""
    return w.carried[world, Carried.disturbed]
