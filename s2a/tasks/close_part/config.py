"""The numbers of closing a part: of its decision process, and apart from them of what is reported."""

from __future__ import annotations

from dataclasses import dataclass

from s2a.core.bounds import Fraction, NotNegative, Positive
from s2a.tasks.part_handles import PartMdp


@dataclass(frozen=True)
class ClosePartConfig(PartMdp):
    """The decision process.

    Attributes:
        start_opening: opening at the start of an episode [m]; 95 % of the travel where that is less.
    """

    start_opening: Positive


@dataclass(frozen=True)
class ClosePartMetrics:
    """What is reported of an episode.

    Attributes:
        closed_opening: opening up to which the part counts as closed [m].
        error_fraction: fraction of the episodes from which infinite values, dropped rows and dropped contacts are warned of.
    """

    closed_opening: NotNegative
    error_fraction: Fraction
