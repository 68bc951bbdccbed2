"""The numbers of opening a part: of its decision process, and apart from them of what is reported."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from s2a.core.bounds import AtLeast, Fraction, NotNegative, Positive
from s2a.tasks.part_handles import PartMdp


@dataclass(frozen=True)
class OpenPartConfig(PartMdp):
    """The decision process; lengths hold for a part whose grasp point travels `full_travel` or more.

    Attributes:
        close_distance: where the distance term doubles, and within which the closing term counts [m].
        gentle_force: contact force of the robot that costs nothing yet [N].
        bonus_openings: openings that give a bonus of 1 each [m].
        termination_opening: opening that ends the episode [m]; infinite: never.
        full_travel: shorter travels scale all openings down in proportion [m].
        firm_angle: between the fingers' forces, from which a grasp is paid in full [degree]; less from 120 on, from which
            the metrics count one. 120: all or nothing, as in runs from before this key.
    """

    close_distance: NotNegative
    gentle_force: NotNegative
    bonus_openings: tuple[float, float, float]
    termination_opening: Positive
    full_travel: Positive
    firm_angle: Annotated[float, AtLeast(120.0, 180.0)] = 120.0


@dataclass(frozen=True)
class OpenPartMetrics:
    """What is reported of an episode; it changes neither what the robot sees nor what it is paid.

    Attributes:
        success_opening: opening that counts as success [m].
        wide_opening: a wider one, `open_30cm` [m].
        full_travel: shorter travels scale both down in proportion [m].
        static_fraction: fraction of the travel at which a part that hardly moves counts as `open_75pct_static`.
        static_speed: max speed of the grasp point there [m/s].
        full_fraction: fraction of the travel that counts as `open_95pct`.
        contact_force: normal force from which a contact counts [N].
        grasp_fraction: fraction of the gained opening over which a grasp must have held for `grasp_success`.
        contact_fraction: that over which a contact must have held for the other success metrics.
        error_fraction: fraction of the episodes from which infinite values, dropped rows and dropped contacts are warned of.
    """

    success_opening: Positive
    wide_opening: Positive
    full_travel: Positive
    static_fraction: Fraction
    static_speed: NotNegative
    full_fraction: Fraction
    contact_force: NotNegative
    grasp_fraction: Fraction
    contact_fraction: Fraction
    error_fraction: Fraction
