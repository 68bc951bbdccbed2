"""Sizes that all units of a fitted kitchen share.

Ranges: co-ordinating sizes of EN 1116 (worktop 0.82 to 0.96 m high, 0.6 m deep; wall units 0.3 to 0.4 m deep, 0.45 to 0.65 m
above the worktop; plinths 0.08 to 0.16 m).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.synth.draw import uniform


@dataclass(frozen=True)
class Fitted:
    """What all units of one kitchen have in common [m].

    Attributes:
        depth: of the base units with fronts.
        plinth: its height.
        top: lower face of the worktop.
        counter: thickness of the worktop.
        upper: lower edge of the wall units.
        wall: height and depth of the wall units.
    """

    depth: float
    plinth: float
    top: float
    counter: float
    upper: float
    wall: tuple[float, float]


def fitted(rng: np.random.Generator) -> Fitted:
    """Return the drawn sizes of a kitchen."""
    top, thick = uniform(rng, (0.78, 0.9)), uniform(rng, (0.02, 0.05))
    upper = top + thick + uniform(rng, (0.45, 0.62))
    wall = uniform(rng, (0.5, min(0.9, 2.25 - upper))), uniform(rng, (0.32, 0.38))
    return Fitted(uniform(rng, (0.56, 0.62)), uniform(rng, (0.08, 0.16)), top, thick, upper, wall)
