"""What the paper reports of the same experiment: "From Scan to Action", Halacheva et al., CVPR Workshops 2025, reward weights."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Reported:
    """A row of the paper's table.

    Attributes:
        asset: what is opened.
        weights: of distance, rotation, opening and finger.
        opened: fraction of the episodes, in words.
        handle: "used" or "not used", by the robot.
    """

    asset: str
    weights: tuple[float, float, float, float]
    opened: str
    handle: str


TERMS = ("distance", "rotation", "opening", "finger")
TWIN, SCAN = "synthetic asset", "real scan"
TABLE = (
    Reported(TWIN, (1.5, 1.5, 10.0, 2.0), "98 %", "used"),
    Reported(SCAN, (1.5, 1.5, 10.0, 2.0), "87 to 88 %", "not used"),
    Reported(SCAN, (50.5, 50.5, 10.0, 50.0), "74 %", "used"),
)


def reported(reward: Mapping[str, Any], stage: str) -> Reported | None:
    """Return the row of the paper's table with the same weights, or None; further terms that weigh something make another reward.

    Args:
        reward: weights by term.
        stage: name of the file, "twin" in it for a CAD twin.
    """
    weights = tuple(float(reward.get(term, 0.0)) for term in TERMS)
    asset = TWIN if "twin" in stage else SCAN
    own = any(
        reward.get(term) for term in ("pinch", "grasped_opening", "grasped_path", "led_opening", "closing", "grip")
    )
    return None if own else next((row for row in TABLE if (row.asset, row.weights) == (asset, weights)), None)
