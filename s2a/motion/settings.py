"""The planner's motion in numbers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from s2a.core.bounds import Count, CountFromZero, NotNegative, Positive


@dataclass(frozen=True)
class PlannerConfig:
    """The motion in numbers; times are minima, which a limit of the robot may extend.

    Attributes:
        ik_seeds: starts of the inverse kinematics; each is followed along the whole tool path.
        approach: distance from which the gripper moves straight to a grasp, and back from it [m].
        depth: how far the pads reach past the grasp point, into the furniture [m].
        opening: path of the grasp point [m]; less where the joint ends earlier.
        start_noise: how far an episode may start from the home position [rad]; for the time of the first motion.
        reach_time: to the point of approach, and between others [s].
        approach_time: from there to the grasp [s].
        close_time: for the fingers to close [s].
        pull_time: to move the part along its joint by `opening` [s].
        pull_law: file of s2a optimize with a time law of that motion, in the place of `pull_time` and the planner's own; or null.
        seed: of the IK starts.
    """

    ik_seeds: Count
    approach: Positive
    depth: float
    opening: Positive
    start_noise: NotNegative
    reach_time: Positive
    approach_time: Positive
    close_time: Positive
    pull_time: Positive
    pull_law: Path | None
    seed: CountFromZero
