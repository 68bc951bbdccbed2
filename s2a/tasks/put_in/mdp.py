"""Putting into a part as a decision process: what is kept of an episode, reward terms, end, result.

Where the object is inside of the part, its path and displacement are those against the part, which carries it as it is shut.
"""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import warp as wp

from s2a.env.kernels import is_sound
from s2a.env.state import State
from s2a.env.task import columns
from s2a.tasks.part_functions import squared_action
from s2a.tasks.pick_place.mdp import STRIDE, is_pinched, steps_at_rest, tool_of
from s2a.tasks.pick_place.start import start_of
from s2a.tasks.put_in.handles import Progress, PutIn, gripper_clearance, in_part, is_inside, place_error, turn_error

METRICS = (
    "success",
    "stored",
    "carried",
    "released_at_rest",
    "shut_with_it",
    "undisturbed",
    "grasped",
    "remaining",
    "position_error",
    "angle_error",
    "carried_fraction",
    "drift",
    "disturbance",
)
"""success: all of the next five, and physics held. stored: at the end, for `rest_time`, the object is at rest at its place
inside the part, the part shut and the gripper gone from both. carried, released_at_rest, undisturbed, grasped: as pick_place has
them, against the part where the object is in it. shut_with_it: the part was shut by `min_ride` or more with the object in it and
untouched. Numbers at the end: remaining [m or rad], the part's coordinate; position_error [m] and angle_error [rad] against the
part; carried_fraction, drift [m], disturbance [m]."""
VALUES = METRICS[7:]
Result = columns(METRICS)


@wp.func
def distance(s: State, h: PutIn, world: int):
    """Weight of the tool being near the object: 1 / (1 + d²)²."""
    d = wp.length(tool_of(s, h.p, world) - wp.transform_get_translation(s.body_q[world, h.p.body]))
    return 1.0 / ((1.0 + d * d) * (1.0 + d * d))


@wp.func
def pinch(s: State, h: PutIn, world: int):
    """Weight of the object being pinched, 0 or 1."""
    return wp.where(is_pinched(h.p, world), 1.0, 0.0)


@wp.func
def place(s: State, h: PutIn, world: int):
    """Weight of the object being near its place in the part: 1 / (1 + 10 d)."""
    return 1.0 / (1.0 + 10.0 * place_error(s, h, world))


@wp.func
def stored(s: State, h: PutIn, world: int):
    """Weight of the object resting at its place in the shut part with the gripper gone, 0 or 1."""
    return wp.where(h.progress[world, Progress.still] > 0.0, 1.0, 0.0)


@wp.func
def action(s: State, h: PutIn, world: int):
    """Weight of the sum of the squared actions; below 0: a cost."""
    return squared_action(s, world)


REWARDS = (distance, pinch, place, stored, action)


@wp.kernel
def reset(s: State, h: PutIn, first: int):
    """Begin an episode: the object stands at its start, its coordinates from `first` on; the part is shut."""
    world = wp.tid()
    if s.done[world] == 1:
        for i in range(h.progress.shape[1]):
            h.progress[world, i] = 0.0
        at = start_of(s, first, world)
        h.last[world] = at
        h.last_in[world] = at
        h.released[world] = at
        h.released_in[world] = at


@wp.kernel
def begin(s: State, h: PutIn):
    """Forget the touch of the control step before."""
    h.progress[wp.tid(), Progress.touched] = 0.0


@wp.kernel
def track(body_q: wp.array2d(dtype=wp.transform), joint_q: wp.array2d(dtype=float), h: PutIn):
    """Attribute the object's path of a physics step to a pinch or to anything else; poses are those after the step."""
    world = wp.tid()
    c = h.p.contacts
    now = wp.transform_get_translation(body_q[world, h.p.body])
    now_in = wp.transform_get_translation(in_part(body_q[world, h.p.body], body_q[world, h.part]))
    inside = is_inside(h, now_in)
    if inside:
        h.last[world] = now
    else:
        h.last_in[world] = now_in
    moved = wp.max(wp.length(now - h.last[world]), wp.length(now_in - h.last_in[world]))
    if moved > STRIDE:
        column = int(Progress.loose)
        if is_pinched(h.p, world):
            column = int(Progress.carried)
        h.progress[world, column] += moved
        h.last[world] = now
        h.last_in[world] = now_in
    if is_pinched(h.p, world):
        h.progress[world, Progress.grasped] = 1.0
    touch = c.on_region[world, 0] + c.on_region[world, 1] + c.off_region[world, 0] + c.off_region[world, 1]
    coordinate = wp.abs(joint_q[world, h.coord])
    if touch + c.other_links[world] > 0.0:
        h.progress[world, Progress.touched] = 1.0
        h.progress[world, Progress.drift] = 0.0
        h.released[world] = now
        h.released_in[world] = now_in
    elif inside:
        h.progress[world, Progress.ride] += wp.max(0.0, h.progress[world, Progress.coordinate] - coordinate)
    h.progress[world, Progress.coordinate] = coordinate
    away = wp.length(now - h.released[world])
    if inside:
        away = wp.length(now_in - h.released_in[world])
    h.progress[world, Progress.drift] = wp.max(h.progress[world, Progress.drift], away)


@wp.kernel
def update(s: State, h: PutIn):
    """Count the steps in which the object rests at its place in the shut part; end the episode after enough of them."""
    world = wp.tid()
    p = h.p
    now = in_part(s.body_q[world, p.body], s.body_q[world, h.part])
    at_place = place_error(s, h, world) <= p.position_tolerance and turn_error(s, h, world) <= p.angle_tolerance
    at_place = at_place and is_inside(h, wp.transform_get_translation(now))
    shut = wp.abs(s.joint_q[world, h.coord]) <= h.shut
    gone = h.progress[world, Progress.touched] == 0.0 and gripper_clearance(s, h, world) >= p.clear_distance
    there = at_place and gone and shut
    h.progress[world, Progress.still] = steps_at_rest(s, p, h.progress[world, Progress.still], there, world)
    for i in range(h.others.shape[0]):
        at = wp.transform_get_translation(s.body_q[world, h.others[i]])
        if s.step[world] <= p.settle_steps:
            h.origin[world, i] = at
        else:
            away = wp.length(at - h.origin[world, i])
            h.progress[world, Progress.disturbed] = wp.max(h.progress[world, Progress.disturbed], away)
    s.terminated[world] = wp.where(h.progress[world, Progress.still] >= float(p.rest_steps), 1, 0)


@wp.kernel
def write_result(s: State, h: PutIn):
    """Write how the episodes that ended went."""
    world = wp.tid()
    if s.done[world] == 1:
        p = h.p
        path = h.progress[world, Progress.carried] + h.progress[world, Progress.loose]
        fraction = h.progress[world, Progress.carried] / wp.max(path, 1e-6)
        stored_ = wp.where(h.progress[world, Progress.still] >= float(p.rest_steps), 1.0, 0.0)
        carried = wp.where(path > p.position_tolerance and fraction >= p.carried_fraction, 1.0, 0.0)
        released = wp.where(h.progress[world, Progress.drift] <= p.max_drift, 1.0, 0.0)
        undisturbed = wp.where(h.progress[world, Progress.disturbed] <= p.max_disturbance, 1.0, 0.0)
        rode = wp.where(h.lever * h.progress[world, Progress.ride] >= h.min_ride, 1.0, 0.0)
        s.result[world, Result.success] = is_sound(s, world) * stored_ * carried * released * undisturbed * rode
        s.result[world, Result.stored] = stored_
        s.result[world, Result.carried] = carried
        s.result[world, Result.released_at_rest] = released
        s.result[world, Result.shut_with_it] = rode
        s.result[world, Result.undisturbed] = undisturbed
        s.result[world, Result.grasped] = h.progress[world, Progress.grasped]
        s.result[world, Result.remaining] = wp.abs(s.joint_q[world, h.coord])
        s.result[world, Result.position_error] = place_error(s, h, world)
        s.result[world, Result.angle_error] = turn_error(s, h, world)
        s.result[world, Result.carried_fraction] = fraction
        s.result[world, Result.drift] = h.progress[world, Progress.drift]
        s.result[world, Result.disturbance] = h.progress[world, Progress.disturbed]


@wp.kernel
def observe_part(s: State, h: PutIn, first: int):
    """Write the part's coordinate as the number after those of picking and placing."""
    world = wp.tid()
    limit = h.p.observation_limit
    s.observation[world, first] = wp.clamp(s.joint_q[world, h.coord], -limit, limit)
