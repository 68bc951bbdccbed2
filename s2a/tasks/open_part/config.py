"""Opening an articulated part with a Franka: what is observed, rewarded and counted, and the numbers to tune.

The formulas are those of IsaacLab 2.3's direct task "Isaac-Franka-Cabinet-Direct-v0" (the one the paper trains with). They
refer to two frames. The hand frame: origin `hand_point` on the arm's last link, z forward, y from the right finger to the
left. The grasp frame: at the mean of the part's grasp region, z into the furniture, y across the region's thin side (the
world's up for a horizontal bar), moving with the part.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from s2a.ranges import AtLeast, Fraction, NotNegative, Positive
from s2a.sim.franka import JOINTS

OBSERVATIONS = 2 * JOINTS + 5
"""Joint positions (scaled to their range) and velocities, hand to grasp point (3, robot base frame), joint, its velocity."""
REWARD_MEANINGS = {
    "distance": "weight of the hand being near the grasp point: 1 / (1 + d²)², twice that within task.close_distance.",
    "rotation": "weight of the hand being turned as the grasp is, from -1 to 1.",
    "opening": "weight of how far the part is open, as a way of its grasp point [m].",
    "finger": "weight of the fingers standing on the wrong sides of the grasp point: how far [m], below 0.",
    "bonus": "weight of each of task.bonus_openings that is passed.",
    "action": "weight of the sum of the squared actions; below 0: a cost.",
    "grip": "weight of both fingers pressing on the grasp region, 0 or 1.",
    "led_opening": "weight of how far both fingers led the part by the grasp region [m]; never more than it is open.",
    "closing": "weight of how far both fingers have closed [m] around the grasp point, within task.close_distance of it.",
}
"""What the weight of each reward term is of. The first six terms are the reference's."""
REWARD_TERMS = tuple(REWARD_MEANINGS)
"""Names of the unweighted reward terms, in the order of the kernel's columns."""
RewardWeights = Annotated[dict[str, float], REWARD_MEANINGS]
"""Weights of all reward terms by name; the type tells `--help` what they are of."""
RESULTS = (
    "success",
    "final_success",
    "handle_success",
    "hook_success",
    "side_success",
    "wide",
    "final_wide",
    "static",
    "final_static",
    "full",
    "final_full",
    "opening",
    "invalid",
    "row_overflow",
    "contact_overflow",
)
"""How a finished episode went, in the order of the kernel's columns; each is 0 or 1 except "opening".

"success": reached `success_opening` at any time, "final_success": was there at the end; likewise "wide" (`wide_opening`),
"static" (`static_share` of the travel, moving no faster than `static_speed`) and "full" (`full_share` of the travel).
"handle_success": a success with both fingers on the grasp region in half or more of the steps in which the part moved there;
"hook_success": one with a finger on it in half or more of them, but both in fewer; "side_success": one with a finger on the part
and none on the grasp region in half or more of them. What went wrong in physics is no success. "opening": the largest [m].
"invalid": ended by a value of the state or the action that is not finite. "row_overflow": ended since the world had more
constraint rows than fit, and the rest was dropped; "contact_overflow": contacts were dropped in some step, whose pool all
worlds share, so that it concerns all at once.
"""
COUNTS = ("episodes", *RESULTS)
"""What is added up over finished episodes: their number, and the columns of RESULTS."""
TROUBLES = ("invalid", "row_overflow", "contact_overflow")
"""Columns of RESULTS that say that physics went wrong."""
LEVELS = ("wide_opening", "static_share", "static_speed", "full_share", "trouble_share")
"""Settings that say what is counted beside the success, and change neither what the robot sees nor what it is paid."""


@dataclass(frozen=True)
class OpenDrawerConfig:
    """The decision process in numbers; lengths hold for a part whose grasp point travels `full_travel` or more.

    Attributes:
        episode_steps: control steps after which an episode is cut.
        action_scale: speed of a joint target for an action of 1 [rad/s].
        finger_speed: share of it for the fingers.
        velocity_scale: factor of the joint velocities in the observation.
        observation_limit: observations are clamped to +- this.
        start_noise: half range of the uniform noise on the start position [rad, m].
        hand_point: origin of the hand frame in the frame of panda_link7 [m].
        close_distance: where the distance term doubles, and within which the closing term counts [m].
        bonus_openings: openings that give a bonus of 1 each [m].
        end_opening: opening that ends the episode [m]; infinite: never.
        success_opening: opening that counts as success [m].
        wide_opening: a larger one that is counted too [m].
        static_share: share of the travel at which a part that hardly moves is counted as static.
        static_speed: largest speed of the grasp point there [m/s].
        full_share: share of the travel that is counted as full.
        full_travel: shorter ways scale all openings down in proportion [m].
        trouble_share: share of the episodes from which infinite values, dropped rows and dropped contacts are warned of.
        touch_distance: how near a contact must be to the annotated region to count as on it [m].
        touch_force: normal force from which a contact counts [N].
    """

    episode_steps: Annotated[int, AtLeast(2)]
    action_scale: Positive
    finger_speed: Positive
    velocity_scale: float
    observation_limit: Positive
    start_noise: NotNegative
    hand_point: tuple[float, float, float]
    close_distance: NotNegative
    bonus_openings: tuple[float, float, float]
    end_opening: Positive
    success_opening: Positive
    wide_opening: Positive
    static_share: Fraction
    static_speed: NotNegative
    full_share: Fraction
    trouble_share: Fraction
    full_travel: Positive
    touch_distance: NotNegative
    touch_force: NotNegative
