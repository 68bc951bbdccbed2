"""Settings of the proposals; values and reasons are in conf/annotate.yaml."""

from __future__ import annotations

from dataclasses import dataclass

from s2a.ranges import Count, Fraction, Positive


@dataclass(frozen=True)
class ProposeConfig:
    """How fronts are proposed.

    Attributes:
        cell: width of the cells of a plane's image [m].
        density: points that stand for a surface, per m^2.
        layer: points this near to a plane belong to it [m].
        min_layer: smallest area of a plane [m^2].
        color: largest difference of colour between neighbouring cells of one patch, Euclidean in RGB.
        min_fill: smallest fraction of its rectangle that a patch covers.
        relief: height over a plane from which a cell is a handle's [m].
        sharp: standard deviation of a plane's heights, in the median, up to which a scan shows handles by their shape [m].
        contrast: least difference of a handle's colour from what is around it, where a scan smears handles, Euclidean in RGB.
        max_handle: largest length and width of a handle [m].
        min_front: smallest width and height of a front [m].
        min_middle: smallest height of a front's middle over the floor: below are plinths [m].
        max_front: largest width and height of a front [m].
        max_patch: largest width and height of a patch with several fronts: larger ones are walls [m].
        max_fronts: in one patch; more handles are a pattern.
    """

    cell: Positive
    density: Positive
    layer: Positive
    min_layer: Positive
    color: Positive
    min_fill: Fraction
    relief: Positive
    sharp: Positive
    contrast: Positive
    max_handle: tuple[Positive, Positive]
    min_front: tuple[Positive, Positive]
    min_middle: Positive
    max_front: tuple[Positive, Positive]
    max_patch: tuple[Positive, Positive]
    max_fronts: Count
