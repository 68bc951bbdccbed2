"""Metrics of opening and closing a part: how far, and what moved it.

The opening that is gained is attributed physics step by physics step to what held the part in that step, on its path from
START to 1 times the success opening; fractions of the *opening* count, not of the steps, so that slow first centimetres cannot
outvote a fling. See docs/metrics.md. Results are Warp functions (State, World, world) -> float, of an episode that ended.
"""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import warp as wp

from s2a.tasks.mdp.grasp import is_grasped, opening_at, opening_of, opening_speed
from s2a.tasks.state import Limit, Opened, State, World, is_sound

wp.set_module_options({"enable_backward": False})  # half the time to compile

# Fraction of the success opening from which gains count: before it a part may be jolted open in passing
START = wp.constant(0.1)


@wp.func
def flag(yes: bool):
    """Return 1 or 0."""
    return wp.where(yes, 1.0, 0.0)


@wp.kernel
def begin(s: State, w: World):
    """Clear the last episode's progress."""
    world = wp.tid()
    if s.done[world] == 1:
        for i in range(w.opened.shape[1]):
            w.opened[world, i] = 0.0


@wp.kernel
def attribute(s: State, w: World, joint_q: wp.array2d(dtype=float)):
    """Attribute the opening that a physics step gained to what held the part in it; joint_q is that after the step."""
    world = wp.tid()
    c, force = w.contacts, w.number.counted_force
    w.opened[world, Opened.force] = wp.max(w.opened[world, Opened.force], c.peak[world])
    left, right = c.on_region[world, 0], c.on_region[world, 1]
    on, off = wp.max(left, right) >= force, wp.max(c.off_region[world, 0], c.off_region[world, 1]) >= force
    # A light part that is pushed runs ahead of the link and is caught up again: its coasting is the push's.
    if c.other_links[world] >= force:
        w.opened[world, Opened.pushed] = 1.0
    elif on or off:
        w.opened[world, Opened.pushed] = 0.0
    now = opening_at(w, joint_q[world, w.target[world].coord], world)
    before = w.opened[world, Opened.maximum]
    if not (now > before and wp.isfinite(now)):  # an infinite opening would stay in the recent episodes' mean for ever
        return
    least = w.limits[world, Limit.success]
    gain = wp.min(now, least) - wp.max(before, START * least)
    w.opened[world, Opened.maximum] = now
    if gain > 0.0:
        w.opened[world, Opened.gained] += gain
        w.opened[world, Opened.grasped] += gain * flag(is_grasped(w, force, 1.0, world))
        w.opened[world, Opened.both] += gain * flag(wp.min(left, right) >= force)
        w.opened[world, Opened.any] += gain * flag(on)
        w.opened[world, Opened.off] += gain * flag(off and not on)
        w.opened[world, Opened.body] += gain * w.opened[world, Opened.pushed]


@wp.func
def is_still(s: State, w: World, world: int):
    """Return whether the part hardly moves."""
    return wp.abs(opening_speed(s, w, world)) <= w.number.static_speed


@wp.kernel
def notice(s: State, w: World):
    """Note whether the part stands open and hardly moves, and whether it is closed."""
    world = wp.tid()
    now = opening_of(s, w, world)
    if w.limits.shape[0] > 0:
        if now >= w.limits[world, Limit.open_75pct_static] and is_still(s, w, world):
            w.opened[world, Opened.stood] = 1.0
    if now <= w.number.closed_opening:
        w.opened[world, Opened.closed] = 1.0


@wp.kernel
def end(s: State, w: World):
    """End the episode where the part is open by more than task.termination_opening."""
    world = wp.tid()
    beyond = opening_of(s, w, world) > w.scale[world] * w.number.termination_opening
    s.terminated[world] = wp.where(beyond, 1, 0)


@wp.func
def held(w: World, world: int, column: int, fraction: float):
    """Return 1 if what a column of OPENED counts was so over a fraction of the gained opening or more."""
    gained = w.opened[world, Opened.gained]
    return flag(gained > 0.0 and w.opened[world, column] >= fraction * gained)


@wp.func
def reached(s: State, w: World, world: int, limit: int):
    """Return 1 if the part was opened up to a limit at any time, and physics held."""
    return is_sound(s, world) * flag(w.opened[world, Opened.maximum] >= w.limits[world, limit])


@wp.func
def stays(s: State, w: World, world: int, limit: int):
    """Return 1 if the part is open up to a limit at the end, and physics held."""
    return is_sound(s, world) * flag(opening_of(s, w, world) >= w.limits[world, limit])


@wp.func
def success(s: State, w: World, world: int):
    """Opened by `success_opening` at any time, and physics held."""
    return reached(s, w, world, int(Limit.success))


@wp.func
def final_success(s: State, w: World, world: int):
    """Open by `success_opening` at the end, and physics held."""
    return stays(s, w, world, int(Limit.success))


@wp.func
def grasp_success(s: State, w: World, world: int):
    """A success over enough of whose gained opening the part was grasped (`is_grasped`)."""
    return success(s, w, world) * held(w, world, int(Opened.grasped), w.number.grasp_fraction)


@wp.func
def handle_success(s: State, w: World, world: int):
    """A success with both fingers on the region."""
    return success(s, w, world) * held(w, world, int(Opened.both), w.number.contact_fraction)


@wp.func
def single_finger_success(s: State, w: World, world: int):
    """A success with a finger on the region, and both over less than enough."""
    both = held(w, world, int(Opened.both), w.number.contact_fraction)
    return success(s, w, world) * (1.0 - both) * held(w, world, int(Opened.any), w.number.contact_fraction)


@wp.func
def off_handle_success(s: State, w: World, world: int):
    """A success with a finger on the part and none on the region."""
    return success(s, w, world) * held(w, world, int(Opened.off), w.number.contact_fraction)


@wp.func
def body_success(s: State, w: World, world: int):
    """A success with any other link of the robot on the part, whatever the fingers did."""
    return success(s, w, world) * held(w, world, int(Opened.body), w.number.contact_fraction)


@wp.func
def open_30cm(s: State, w: World, world: int):
    """Opened by 30 cm at any time."""
    return reached(s, w, world, int(Limit.open_30cm))


@wp.func
def final_open_30cm(s: State, w: World, world: int):
    """Open by 30 cm at the end."""
    return stays(s, w, world, int(Limit.open_30cm))


@wp.func
def open_75pct_static(s: State, w: World, world: int):
    """Open by 75 % of the travel and hardly moving, at any time."""
    return is_sound(s, world) * w.opened[world, Opened.stood]


@wp.func
def final_open_75pct_static(s: State, w: World, world: int):
    """Open by 75 % of the travel and hardly moving at the end."""
    return stays(s, w, world, int(Limit.open_75pct_static)) * flag(is_still(s, w, world))


@wp.func
def open_95pct(s: State, w: World, world: int):
    """Opened by 95 % of the travel at any time."""
    return reached(s, w, world, int(Limit.open_95pct))


@wp.func
def final_open_95pct(s: State, w: World, world: int):
    """Open by 95 % of the travel at the end."""
    return stays(s, w, world, int(Limit.open_95pct))


@wp.func
def opening(s: State, w: World, world: int):
    """The maximum opening [m]."""
    return w.opened[world, Opened.maximum]


@wp.func
def grasped_fraction(s: State, w: World, world: int):
    """Fraction of the gained opening over which the part was grasped."""
    return w.opened[world, Opened.grasped] / wp.max(w.opened[world, Opened.gained], 1.0e-9)


@wp.func
def contact_force(s: State, w: World, world: int):
    """The maximum force of any contact of the robot [N]."""
    return w.opened[world, Opened.force]


@wp.func
def closed(s: State, w: World, world: int):
    """Closed at any time, and physics held."""
    return is_sound(s, world) * w.opened[world, Opened.closed]


@wp.func
def final_closed(s: State, w: World, world: int):
    """Closed at the end, and physics held."""
    return is_sound(s, world) * flag(opening_of(s, w, world) <= w.number.closed_opening)


@wp.func
def remaining(s: State, w: World, world: int):
    """The opening at the end [m]."""
    return opening_of(s, w, world)
