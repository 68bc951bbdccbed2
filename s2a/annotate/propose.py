"""Fronts proposed by geometry alone."""

from __future__ import annotations

from dataclasses import dataclass

from s2a.annotate.annotation import Item
from s2a.annotate.region import GrowConfig
from s2a.annotate.surface import Surface
from s2a.ranges import Positive


@dataclass(frozen=True)
class ProposeConfig:
    """How fronts are proposed.

    Attributes:
        cell: width of the cells of a plane's image [m].
    """

    cell: Positive


def propose(surface: Surface, config: ProposeConfig, grow: GrowConfig) -> tuple[Item, ...]:
    """Return proposed parts."""
    return ()
