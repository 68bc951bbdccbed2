"""Open a part and hold it open for a time: a task in one file, which docs/new_task.md explains."""

# Warp reads kernel annotations at run time, so a file with kernels does without "from __future__ import annotations".
from dataclasses import dataclass

import warp as wp

from s2a.core.bounds import Positive
from s2a.motion.open import opening_path
from s2a.tasks.base import Instruction, MetricsConfig, PartMdp, Results, Task, terms
from s2a.tasks.mdp import observations, opening, rewards
from s2a.tasks.mdp.grasp import is_grasped, opening_of
from s2a.tasks.state import State, World, columns, is_sound

OWN = ("steps", "held")
"""Columns of this task alone: control steps for which the part has been held by now; 1 where it was held long enough."""
Own = columns(OWN)


@dataclass(frozen=True)
class HoldConfig(PartMdp):
    """The decision process.

    Attributes:
        hold_opening: opening from which the part is to be held [m].
        hold_time: for how long [s].
    """

    hold_opening: Positive
    hold_time: Positive


@wp.func
def holding(s: State, w: World, world: int):
    """Weight of the part being held open now, 0 or 1."""
    return wp.where(w.own[world, Own.steps] > 0.0, 1.0, 0.0)


@wp.func
def success(s: State, w: World, world: int):
    """The part was held open for `hold_time`, and physics held."""
    return is_sound(s, world) * w.own[world, Own.held]


@wp.kernel
def count(s: State, w: World, least: float, steps: float):
    """Count the control steps for which the part is held, open by `least` [m]; end the episode after so many of them."""
    world = wp.tid()
    if opening_of(s, w, world) >= least and is_grasped(w, w.number.contact_force, 1.0, world):
        w.own[world, Own.steps] += 1.0
    else:
        w.own[world, Own.steps] = 0.0
    if w.own[world, Own.steps] >= steps:
        w.own[world, Own.held] = 1.0
        s.terminated[world] = 1


@wp.kernel
def begin(s: State, w: World):
    """Where an episode begins, nothing has been held."""
    world = wp.tid()
    if s.done[world] == 1:
        w.own[world, Own.steps] = 0.0
        w.own[world, Own.held] = 0.0


class OpenAndHold(Task):
    """Open the part of every world, and hold it open."""

    Config, Metrics, OWN = HoldConfig, MetricsConfig, OWN
    INSTRUCTION = Instruction(
        "open the {part} and hold it open", takes=("part",), phrases=("hold open", "keep open"), begins="shut", leaves="open",
        needs="Opens the part, which must be reachable and shut, and holds it open for a moment.",
    )  # fmt: skip
    REWARDS = terms(rewards.distance, rewards.pinch, rewards.opening, holding, rewards.action)
    OBSERVATIONS = observations.OF_PART
    CRITIC = {"describe_part": observations.PRIVILEGED}
    RESULTS = Results(terms(success), {"final_opening": opening.remaining}, ("success",), success="success", version=1)
    tool_path = staticmethod(opening_path)

    def reset(self, state: State) -> None:
        """Begin an episode."""
        super().reset(state)
        self.launch(begin, state)

    def update(self, state: State) -> None:
        """Follow how long the part is held."""
        super().update(state)
        self.launch(count, state, self.config.hold_opening, self.config.hold_time / self.world.number.control_step)


TASK = OpenAndHold
