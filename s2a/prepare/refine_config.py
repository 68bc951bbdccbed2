"""Settings of the refinement of joints."""

from __future__ import annotations

from dataclasses import dataclass

from s2a.core.ranges import Fraction, NotNegative, Positive


@dataclass(frozen=True)
class RefineConfig:
    """How far furniture and annotations are trusted. Standard deviations unless said otherwise.

    Attributes:
        parallel: of an axis or a front against its furniture's [rad].
        level: of furniture against gravity [rad].
        hang: of an axis against its own front [rad].
        edge: of a hinge line's distance from the edge, in the front's plane [m].
        inset: mean of that distance, into the front [m].
        depth: of a hinge line's distance from the front's face [m].
        flush: of closed fronts of one piece of furniture from one plane [m].
        ajar: largest distance of a front before the others that is taken for standing ajar [m].
        axis: of the annotated axes where a room has too few joints to tell, each of two components [rad].
        arm: annotated lines err by so much per error of their axis [m/rad]: both come from two points that someone picked.
        zero: of the closed coordinate of a slide [m].
        zero_angle: the same of a hinge [rad].
        penetration: of a part into the rest of the scan on its path [m].
        cut: residual from which a term counts less and less, in standard deviations.
        known: largest fraction of the annotation's standard deviation that is left where a direction counts as known.
        worse: an axis may get farther from the true one by this [rad] where the annotation happened to be good.
        regret: getting farther by more counts as much as being off by this [rad]; moves are shortened accordingly.
        sure: a closed coordinate is changed from so many standard deviations on.
    """

    parallel: Positive
    level: Positive
    hang: Positive
    edge: Positive
    inset: float
    depth: Positive
    flush: Positive
    ajar: Positive
    axis: Positive
    arm: Positive
    zero: Positive
    zero_angle: Positive
    penetration: Positive
    cut: Positive
    known: Fraction
    worse: NotNegative
    regret: NotNegative
    sure: Positive
