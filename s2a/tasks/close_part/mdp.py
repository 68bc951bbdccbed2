"""Closing a part: reward terms, reset, and what an episode came to."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import warp as wp

from s2a.env.kernels import is_sound
from s2a.env.state import State
from s2a.env.task import columns
from s2a.tasks.part_functions import frames, opening_of, squared_action, tool_distance
from s2a.tasks.part_handles import PartHandles

METRICS = ("success", "final_success", "remaining")
"""success: closed at any time, and physics held; final_success: at the end; remaining: (a number) the opening at the end [m]."""
Result = columns(METRICS)


@wp.struct
class ClosePart:
    """Handles of the task: `closed`, 1 once the part was closed, shape [world], at `closed_opening` [m] or less."""

    p: PartHandles
    closed: wp.array(dtype=float)
    closed_opening: float


@wp.func
def distance(s: State, h: ClosePart, world: int):
    """Weight of the tool being near the grasp point: 1 / (1 + d²)²."""
    d = tool_distance(frames(s, h.p, world))
    return 1.0 / ((1.0 + d * d) * (1.0 + d * d))


@wp.func
def opening(s: State, h: ClosePart, world: int):
    """Weight of how far the part is open [m]; below 0: a cost."""
    return wp.max(opening_of(s, h.p, world), 0.0)


@wp.func
def action(s: State, h: ClosePart, world: int):
    """Weight of the sum of the squared actions; below 0: a cost."""
    return squared_action(s, world)


REWARDS = (distance, opening, action)


@wp.kernel
def reset(s: State, h: ClosePart):
    """Forget that the part was closed."""
    world = wp.tid()
    if s.done[world] == 1:
        h.closed[world] = 0.0


@wp.kernel
def update(s: State, h: ClosePart):
    """Note whether the part was closed."""
    world = wp.tid()
    if opening_of(s, h.p, world) <= h.closed_opening:
        h.closed[world] = 1.0


@wp.kernel
def write_result(s: State, h: ClosePart):
    """Write how the episodes that ended went."""
    world = wp.tid()
    if s.done[world] == 1:
        now, sound = opening_of(s, h.p, world), is_sound(s, world)
        s.result[world, Result.success] = sound * h.closed[world]
        s.result[world, Result.final_success] = sound * wp.where(now <= h.closed_opening, 1.0, 0.0)
        s.result[world, Result.remaining] = now
