"""Closing an articulated part that stands open."""

from dataclasses import dataclass, replace

import numpy as np

from s2a.core.bounds import NotNegative, Positive
from s2a.motion.open import closing_path
from s2a.robot.tool_path import opening_coordinate
from s2a.tasks.base import Instruction, MetricsConfig, PartMdp, Results, Task
from s2a.tasks.mdp import observations, opening, rewards
from s2a.tasks.state import State


@dataclass(frozen=True)
class ClosePartConfig(PartMdp):
    """The decision process.

    Attributes:
        start_opening: opening at the start of an episode [m]; 95 % of the travel where that is less.
    """

    start_opening: Positive


@dataclass(frozen=True)
class ClosePartMetrics(MetricsConfig):
    """Thresholds of what is reported.

    Attributes:
        closed_opening: opening up to which the part counts as closed [m].
    """

    closed_opening: NotNegative


class ClosePart(Task):
    """Close the part of every world."""

    Config, Metrics = ClosePartConfig, ClosePartMetrics
    INSTRUCTION = Instruction(
        "close the {part}",
        takes=("part",),
        needs="It must be a part that opens, reachable, and open: it stands so, or an earlier skill opened it.",
        phrases=("close", "shut", "push shut", "push in", "slide shut"),
        begins="open",
        leaves="shut",
    )
    PUSHES = True
    REWARDS = {"distance": rewards.distance, "opening": rewards.ajar, "action": rewards.action}
    OBSERVATIONS = observations.OF_PART
    CRITIC = {"describe_part": observations.PRIVILEGED}
    RESULTS = Results(
        rates={"success": opening.closed, "final_success": opening.final_closed},
        values={"remaining": opening.remaining},
        logged=("final_success", "success"),
        success="final_success",
        version=1,
    )

    tool_path = staticmethod(closing_path)

    @staticmethod
    def requested(config: ClosePartConfig, place: str | None, opened: float) -> ClosePartConfig:
        """Return the settings with the part open as far as it is."""
        return replace(config, start_opening=max(opened, 1e-3))

    def bind(self) -> None:
        """Set what is reported."""
        self.thresholds = {"closed": self.metrics.closed_opening}

    def start(self, coords: np.ndarray) -> np.ndarray:
        """Return the coordinates with the part open."""
        starts = [opening_coordinate(s.joint, s.grasp[:3], self.config.start_opening) for s in self.sim.stages]
        coords = coords.copy()
        coords[np.arange(len(coords)), self.sim.part_coord] = [starts[i] for i in self.sim.stage_of_env]
        return coords

    def reset(self, state: State) -> None:
        """Clear the last episode's progress."""
        super().reset(state)
        self.launch(opening.begin, state)

    def after_substep(self, state: State) -> None:
        """Read the contacts, which a critic alone needs."""
        if self.privileged:
            super().after_substep(state)

    def update(self, state: State) -> None:
        """Note whether the part was closed."""
        super().update(state)
        self.launch(opening.notice, state)


TASK = ClosePart
