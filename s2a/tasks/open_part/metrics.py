"""How an episode of opening went: how far, and what moved the part.

The opening that is gained is attributed physics step by physics step to what held the part in that step, on its path from
START to 1 times the success opening; fractions of the *opening* count, not of the steps, so that slow first centimetres cannot
outvote a fling. See docs/metrics.md.
"""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".

import numpy as np
import warp as wp

from s2a.env.kernels import is_sound
from s2a.env.state import State
from s2a.env.task import columns
from s2a.sim.simulation import Simulation
from s2a.tasks.open_part.config import OpenPartMetrics
from s2a.tasks.open_part.mdp import OpenPart, travel_scale
from s2a.tasks.part_functions import is_grasped, opening_of, opening_speed

METRICS = (
    "success",
    "final_success",
    "grasp_success",
    "handle_success",
    "single_finger_success",
    "off_handle_success",
    "body_success",
    "open_30cm",
    "final_open_30cm",
    "open_75pct_static",
    "final_open_75pct_static",
    "open_95pct",
    "final_open_95pct",
    "opening",
    "grasped_fraction",
    "contact_force",
)
"""success: opened by `success_opening` at any time, and physics held; final_*: at the end. Of successes, by what held the part
over enough of the gained opening: grasp_success: a pinch (`is_grasped`); handle_success: both fingers on the region;
single_finger_success: a finger on it, and both over less than enough; off_handle_success: a finger on the part and none on
the region; body_success: any other link of the robot on the part, whatever the fingers did. opening: the maximum [m];
grasped_fraction: fraction of the gained opening over which the part was grasped; contact_force: the maximum of any contact of
the robot [N]."""
VERSION = 3
"""2 took the scanned surface alone for the region, without the hulls that complete it; 1 (until November 2026) counted control
steps instead of opening, no opposed forces, and no other links."""
START = wp.constant(0.1)
"""Fraction of the success opening from which gains count: before it a part may be jolted open in passing."""

Limit = columns(("success", "open_30cm", "open_75pct_static", "open_95pct"))
"""Columns of the thresholds [m]."""
Progress = columns(("max_opening", "gained", "grasped", "both", "any", "off", "body", "stood", "pushed", "force"))
"""What is kept of a running episode: its maximum opening [m]; the opening gained [m], in all and while grasped, with both
fingers on the region, with one or both, with a finger on the part but none on the region, pushed by another link of the
robot; whether the part ever stood open as `open_75pct_static` demands; whether another link touched the part last; the maximum
contact force [N]."""
Result = columns(METRICS)


def bind(sim: Simulation, h: OpenPart, config: OpenPartMetrics) -> dict[str, float]:
    """Add the metrics' arrays to a task's handles; return the thresholds [m] of the first stage by name."""
    travel = np.array([sim.stages[i].travel for i in sim.stage_of_env])
    scale = travel_scale(sim, config.full_travel)
    limits = [scale * config.success_opening, scale * config.wide_opening]
    limits += [travel * config.static_fraction, travel * config.full_fraction]
    h.limits = wp.array(np.stack(limits, axis=1), dtype=float)
    h.progress = wp.zeros((sim.num_envs, len(Progress)), dtype=float)
    h.force, h.static_speed = config.contact_force, config.static_speed
    h.grasp_fraction, h.contact_fraction = config.grasp_fraction, config.contact_fraction
    return {limit.name: float(limits[limit][0]) for limit in Limit}


@wp.func
def flag(yes: bool):
    """Return 1 or 0."""
    return wp.where(yes, 1.0, 0.0)


@wp.kernel
def attribute(joint_q: wp.array2d(dtype=float), h: OpenPart):
    """Attribute the opening that a physics step gained to what held the part in it; joint_q is that after the step."""
    world = wp.tid()
    c, force = h.p.contacts, h.force
    h.progress[world, Progress.force] = wp.max(h.progress[world, Progress.force], c.peak[world])
    left, right = c.on_region[world, 0], c.on_region[world, 1]
    on, off = wp.max(left, right) >= force, wp.max(c.off_region[world, 0], c.off_region[world, 1]) >= force
    # A light part that is pushed runs ahead of the link and is caught up again: its coasting is the push's.
    if c.other_links[world] >= force:
        h.progress[world, Progress.pushed] = 1.0
    elif on or off:
        h.progress[world, Progress.pushed] = 0.0
    now = joint_q[world, h.p.part[world].coord] * h.p.part[world].lever_arm
    before = h.progress[world, Progress.max_opening]
    if not (now > before and wp.isfinite(now)):  # an infinite opening would stay in the recent episodes' mean for ever
        return
    success = h.limits[world, Limit.success]
    gain = wp.min(now, success) - wp.max(before, START * success)
    h.progress[world, Progress.max_opening] = now
    if gain > 0.0:
        h.progress[world, Progress.gained] += gain
        h.progress[world, Progress.grasped] += gain * flag(is_grasped(h.p, force, 1.0, world))
        h.progress[world, Progress.both] += gain * flag(wp.min(left, right) >= force)
        h.progress[world, Progress.any] += gain * flag(on)
        h.progress[world, Progress.off] += gain * flag(off and not on)
        h.progress[world, Progress.body] += gain * h.progress[world, Progress.pushed]


@wp.kernel
def notice_standing(s: State, h: OpenPart):
    """Note whether the part stands open and hardly moves."""
    world = wp.tid()
    open_enough = opening_of(s, h.p, world) >= h.limits[world, Limit.open_75pct_static]
    if open_enough and wp.abs(opening_speed(s, h.p, world)) <= h.static_speed:
        h.progress[world, Progress.stood] = 1.0


@wp.func
def held(h: OpenPart, world: int, column: int, fraction: float):
    """Return 1 if what a column of Progress counts was so over a fraction of the gained opening or more."""
    gained = h.progress[world, Progress.gained]
    return flag(gained > 0.0 and h.progress[world, column] >= fraction * gained)


@wp.kernel
def write_result(s: State, h: OpenPart):
    """Write how the episodes that ended went."""
    world = wp.tid()
    if s.done[world] == 0:
        return
    sound, now, max_opening = is_sound(s, world), opening_of(s, h.p, world), h.progress[world, Progress.max_opening]
    still = wp.abs(opening_speed(s, h.p, world)) <= h.static_speed
    success_at, wide, static = (
        h.limits[world, Limit.success],
        h.limits[world, Limit.open_30cm],
        h.limits[world, Limit.open_75pct_static],
    )
    full = h.limits[world, Limit.open_95pct]
    success = sound * flag(max_opening >= success_at)
    both = held(h, world, int(Progress.both), h.contact_fraction)
    s.result[world, Result.success] = success
    s.result[world, Result.final_success] = sound * flag(now >= success_at)
    s.result[world, Result.grasp_success] = success * held(h, world, int(Progress.grasped), h.grasp_fraction)
    s.result[world, Result.handle_success] = success * both
    single = held(h, world, int(Progress.any), h.contact_fraction)
    s.result[world, Result.single_finger_success] = success * (1.0 - both) * single
    s.result[world, Result.off_handle_success] = success * held(h, world, int(Progress.off), h.contact_fraction)
    s.result[world, Result.body_success] = success * held(h, world, int(Progress.body), h.contact_fraction)
    s.result[world, Result.open_30cm] = sound * flag(max_opening >= wide)
    s.result[world, Result.final_open_30cm] = sound * flag(now >= wide)
    s.result[world, Result.open_75pct_static] = sound * h.progress[world, Progress.stood]
    s.result[world, Result.final_open_75pct_static] = sound * flag(now >= static and still)
    s.result[world, Result.open_95pct] = sound * flag(max_opening >= full)
    s.result[world, Result.final_open_95pct] = sound * flag(now >= full)
    s.result[world, Result.opening] = max_opening
    s.result[world, Result.contact_force] = h.progress[world, Progress.force]
    grasped = h.progress[world, Progress.grasped] / wp.max(h.progress[world, Progress.gained], 1.0e-9)
    s.result[world, Result.grasped_fraction] = grasped
