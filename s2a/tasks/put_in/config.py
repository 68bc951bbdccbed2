"""The numbers of putting into a part: of its decision process, and apart from them of what is reported."""

from __future__ import annotations

from dataclasses import dataclass

from s2a.core.bounds import Fraction, Positive
from s2a.tasks.pick_place.config import PickPlaceConfig, PickPlaceMetrics


@dataclass(frozen=True)
class PutInConfig(PickPlaceConfig):
    """The decision process; `start` is that of `PickPlaceConfig`, `place` the id of the part into which the object is put.

    Attributes:
        opening: to which the part is opened, path of its grasp point [m]; 95 % of the travel where that is less.
        closed_fraction: of its travel, up to which the part is shut.
    """

    opening: Positive
    closed_fraction: Fraction


@dataclass(frozen=True)
class PutInMetrics(PickPlaceMetrics):
    """What is reported of an episode.

    Attributes:
        min_ride: least path of the part towards shut with the object in it, untouched by the robot [m].
    """

    min_ride: Positive
