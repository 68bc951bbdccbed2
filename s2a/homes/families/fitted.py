"""Sizes that all units of a fitted kitchen share.

Ranges: upper face of the worktop 0.87 to 1.0 m high, worktop 20 to 40 mm thick, base units 0.56 to 0.6 m deep, plinth 0.15 m
(coleccionplanta29.com, sizes in the UK); wall units 0.5 to 0.6 m above the worktop (house-forum.com, on IKEA Metod). Common
sizes: plinths from 0.08 m, wall units 0.32 to 0.38 m deep and 0.5 to 0.9 m high. EN 1116, which sets such sizes, was not
opened.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.homes.draw import uniform


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
    top, thick = uniform(rng, (0.85, 0.93)), uniform(rng, (0.02, 0.04))
    upper = top + thick + uniform(rng, (0.5, 0.6))
    wall = uniform(rng, (0.5, min(0.9, 2.25 - upper))), uniform(rng, (0.32, 0.38))
    return Fitted(uniform(rng, (0.56, 0.6)), uniform(rng, (0.08, 0.16)), top, thick, upper, wall)
