"""Opening an articulated part by its handle."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import warp as wp

from s2a.core.bounds import AtLeast, Fraction, NotNegative, Positive
from s2a.motion.open import opening_path
from s2a.tasks.base import Instruction, MetricsConfig, PartMdp, Results, Task, terms
from s2a.tasks.mdp import observations, opening, rewards
from s2a.tasks.state import LIMITS, State, travel_scale


@dataclass(frozen=True)
class OpenPartConfig(PartMdp):
    """The decision process; lengths hold for a part whose grasp point travels `full_travel` or more.

    Attributes:
        close_distance: distance below which the distance term doubles and the closing term counts [m].
        gentle_force: contact force of the robot up to which nothing is subtracted [N].
        bonus_openings: openings that give a bonus of 1 each [m].
        termination_opening: opening that ends the episode [m]; infinite: never.
        full_travel: shorter travels scale all openings down in proportion [m].
        firm_angle: angle between the fingers' forces from which a grasp has its full reward [degree]; the reward grows from 120,
            where the metrics begin to count a grasp. 120: a step.
    """

    close_distance: NotNegative
    gentle_force: NotNegative
    bonus_openings: tuple[float, float, float]
    termination_opening: Positive
    full_travel: Positive
    firm_angle: Annotated[float, AtLeast(120.0, 180.0)]


@dataclass(frozen=True, kw_only=True)
class OpenPartMetrics(MetricsConfig):
    """Thresholds of what is reported; they change neither what the robot sees nor its reward.

    Attributes:
        success_opening: opening that counts as success [m].
        wide_opening: a wider one, `open_30cm` [m]. IsaacLab 3's manager-based task.
        full_travel: shorter travels scale both openings down in proportion [m].
        static_fraction: fraction of the travel at which a part that hardly moves counts as `open_75pct_static`.
            ManiSkill's OpenCabinetDrawer, with its speed.
        static_speed: max speed of the grasp point there [m/s].
        full_fraction: fraction of the travel that counts as `open_95pct`.
        contact_force: normal force from which a contact counts [N].
        grasp_fraction: fraction of the gained opening over which a grasp must have held for `grasp_success`.
        contact_fraction: fraction over which a contact must have held for the other success metrics.
    """

    success_opening: Positive
    wide_opening: Positive = 0.3
    full_travel: Positive
    static_fraction: Fraction = 0.75
    static_speed: NotNegative = 0.1
    full_fraction: Fraction = 0.95
    contact_force: NotNegative = 1.0
    grasp_fraction: Fraction
    contact_fraction: Fraction = 0.5


class OpenPart(Task):
    """Open the part of every world."""

    Config, Metrics = OpenPartConfig, OpenPartMetrics
    INSTRUCTION = Instruction(
        "open the {part}",
        takes=("part",),
        needs="It must be a part that opens, reachable, and shut.",
        phrases=("open up", "open", "pull open", "pull out", "slide open", "slide out", "lift up", "lift", "raise"),
        begins="shut",
        leaves="open",
    )
    REWARDS = terms(
        rewards.distance, rewards.rotation, rewards.opening, rewards.finger, rewards.bonus, rewards.action, rewards.grip,
        rewards.pinch, rewards.grasped_opening, rewards.grasped_path, rewards.closing, rewards.joint_speed, rewards.torque,
        rewards.contact_force,
    )  # fmt: skip
    OBSERVATIONS = observations.OF_PART
    CRITIC = {"describe_part": (*observations.PRIVILEGED, observations.grasped_opening, observations.grasped_path)}
    RESULTS = Results(
        rates=terms(
            opening.success,
            opening.final_success,
            opening.grasp_success,
            opening.handle_success,
            opening.single_finger_success,
            opening.off_handle_success,
            opening.body_success,
            opening.open_30cm,
            opening.final_open_30cm,
            opening.open_75pct_static,
            opening.final_open_75pct_static,
            opening.open_95pct,
            opening.final_open_95pct,
        ),  # fmt: skip
        values=terms(opening.opening, opening.grasped_fraction, opening.contact_force),
        logged=("grasp_success", "success", "final_success", "handle_success", "single_finger_success", "open_30cm"),
        success="final_success",
        # 2 took the scanned surface alone for the region, without the hulls that complete it; 1 counted
        # control steps instead of opening, no opposed forces, and no other links.
        version=3,
    )
    tool_path = staticmethod(opening_path)

    def bind(self) -> None:
        """Set the openings that count: where the travel is short, in proportion."""
        sim, config, metrics = self.sim, self.config, self.metrics
        travel = np.array([sim.stages[i].travel for i in sim.stage_of_env])
        scale = travel_scale(sim, metrics.full_travel)
        limits = [scale * metrics.success_opening, scale * metrics.wide_opening]
        limits += [travel * metrics.static_fraction, travel * metrics.full_fraction]
        self.world.limits = wp.array(np.stack(limits, axis=1), dtype=float)
        self.world.scale = wp.array(travel_scale(sim, config.full_travel), dtype=float)
        self.thresholds = {name: float(limit[0]) for name, limit in zip(LIMITS, limits, strict=True)}

    def reset(self, state: State) -> None:
        """Clear the last episode's progress; a part that a demonstration has opened was grasped."""
        super().reset(state)
        self.launch(opening.begin, state)
        self.launch(rewards.begin_grasped, state)

    def after_substep(self, state: State) -> None:
        """Attribute what the part gained to what held it."""
        super().after_substep(state)
        joint_q, _ = self.now(state)
        self.launch(rewards.accumulate_grasped_opening, state, joint_q)
        self.launch(opening.attribute, state, joint_q)

    def update(self, state: State) -> None:
        """Note whether the part stands open; end the episode where it is open far enough."""
        super().update(state)
        self.launch(opening.notice, state)
        self.launch(opening.end, state)


TASK = OpenPart
