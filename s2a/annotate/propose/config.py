"""Settings of the proposals; values and reasons are in conf/annotate.yaml."""

from __future__ import annotations

from dataclasses import dataclass

from s2a.core.ranges import Fraction, Positive


@dataclass(frozen=True)
class ProposeConfig:
    """How fronts are proposed.

    Attributes:
        cell: width of the cells of a plane's image [m].
        density: points that stand for a surface, per m^2.
        layer: points this near to a plane belong to it [m].
        min_layer: smallest area of a plane [m^2].
        min_front: smallest width and height of a front [m].
        min_score: probability from which on a front is proposed.
    """

    cell: Positive
    density: Positive
    layer: Positive
    min_layer: Positive
    min_front: tuple[Positive, Positive]
    min_score: Fraction
