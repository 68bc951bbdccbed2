"""Settings of pulls that are optimised."""

from __future__ import annotations

from dataclasses import dataclass

from s2a.core.ranges import Count, NotNegative, Positive


@dataclass(frozen=True)
class PullConfig:
    """What a good pull is, and where it is looked for. Costs add up without a unit.

    Attributes:
        time: cost of a second until the set-point stands [1/s].
        energy: of the work done on the handle [1/J].
        peak: of the greatest force on the handle [1/N].
        end: distance from the goal that costs 1, root mean square from the end on [m].
        end_speed: speed that costs 1, likewise [m/s].
        knots: coefficients of the set-point's cubic B-spline.
        min_seconds: time of the set-point's motion, at least [s].
        max_seconds: at most [s]; the same as `min_seconds` for a time that is given.
        beyond: how far past the goal the set-point may go [m].
        hold: for how long after its motion the part shall stay at the goal [s].
        rate: set-points a second [1/s], each for a step of physics.
        rounds: evaluations of the loss and its gradient, at most.
    """

    time: NotNegative
    energy: NotNegative
    peak: NotNegative
    end: Positive
    end_speed: Positive
    knots: Count
    min_seconds: Positive
    max_seconds: Positive
    beyond: NotNegative
    hold: Positive
    rate: Positive
    rounds: Count
