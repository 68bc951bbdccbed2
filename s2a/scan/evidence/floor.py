"""Was there a floor where a robot is to stand?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.core.bounds import Fraction, Positive
from s2a.scene.geometry.mesh_query import Forest, RayMesh, first_hits

HEAD = 0.3
"""[m] From here above the base the floor is looked for."""
RING = 8
"""Places around the base's middle where the floor is looked for, besides the middle."""


@dataclass(frozen=True)
class FloorConfig:
    """When a robot stands on scanned floor.

    Attributes:
        tolerance: how far the scanned floor may be from the foot of what stands there [m].
        min_fraction: fraction of its footprint with floor below.
    """

    tolerance: Positive
    min_fraction: Fraction


def floor_fraction(
    base: np.ndarray, pedestal: float, radius: float, surface: RayMesh | Forest, tolerance: float
) -> float:
    """Return the fraction of a base's footprint below which a surface is at the height of its foot, 0 to 1.

    Args:
        base: position of the base [m], scene coordinates, shape [3].
        pedestal: height of what it stands on [m].
        radius: of the footprint [m].
        surface: everything that was scanned.
        tolerance: see FloorConfig [m].
    """
    angle = np.arange(RING) * 2.0 * np.pi / RING
    ring = radius * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    starts = base + np.concatenate([np.zeros((1, 3)), ring]) + [0.0, 0.0, HEAD]
    down = np.tile([0.0, 0.0, -1.0], (len(starts), 1))
    foot = starts[:, 2] - first_hits(surface, starts, down)
    return float((np.abs(foot - (base[2] - pedestal)) < tolerance).mean())
