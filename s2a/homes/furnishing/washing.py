"""Bathrooms and laundries."""

from __future__ import annotations

import numpy as np

from s2a.homes import household, styles, toiletries
from s2a.homes import sanitary as classic
from s2a.homes.draw import chance, integer, pick, uniform
from s2a.homes.families import lids, sanitary
from s2a.homes.floor_plan import FloorPlan
from s2a.homes.furnishing import common
from s2a.homes.solids import Piece, at
from s2a.homes.styles import Palette

STAND = 0.9
"""[m] Free floor before furniture that opens."""


def bathroom(plan: FloorPlan, colors: Palette) -> None:
    """Place a bathtub or none, a toilet, a vanity with a mirror cabinet, cupboards, a hamper."""
    rng = plan.rng
    style = styles.style(rng, colors, "bath", "bath", "toiletries")
    vanity = sanitary.vanity(rng, style)
    if chance(rng, 0.8):
        vanity.append(sanitary.mirror_cabinet(rng, style))
    plan.need(plan.against(vanity, stand=STAND, attempts=16, askew=0.2))
    plan.need(plan.against([classic.toilet()], stand=0.45, attempts=16, askew=0.3))
    if chance(rng, 0.6):
        tub = classic.bathtub(uniform(rng, (1.5, 1.8)), uniform(rng, (0.7, 0.8)))
        plan.against([tub], attempts=16, askew=0.0, gap=0.004)
    if chance(rng, 0.45):
        plan.against([sanitary.washer(rng)], stand=STAND, askew=0.5, gap=0.03)
    families = (sanitary.tall_cupboard, lids.hamper, sanitary.tall_cupboard)
    for _ in range(integer(rng, 2, 4)):
        plan.against([pick(rng, families)(rng, styles.style(rng, colors, "bath", "bath", "toiletries"))], stand=STAND)
    _small(plan)


def laundry(plan: FloorPlan, colors: Palette) -> None:
    """Place washing machine and dryer, tall cupboards, hampers, shelves."""
    rng = plan.rng
    machines = [sanitary.washer(rng)]
    if chance(rng, 0.6):
        machines.append(sanitary.washer(rng, "dryer").moved(at(0, uniform(rng, (0.62, 0.7)))))
    plan.need(plan.against(machines, stand=STAND, askew=0.4, gap=0.03, attempts=16))
    families = (sanitary.tall_cupboard, lids.hamper, sanitary.tall_cupboard, lids.hamper)
    for _ in range(integer(rng, 3, 6)):
        plan.against([pick(rng, families)(rng, styles.style(rng, colors, "linen", "linen", "linen"))], stand=STAND)
    style = styles.style(rng, colors, "linen", "nothing", "linen")
    if chance(rng, 0.6):
        plan.against(sanitary.vanity(rng, style), stand=STAND, askew=0.2)
    _small(plan)


def _small(plan: FloorPlan) -> None:
    """Place a bin, towels, mats and what else stands about."""
    rng = plan.rng
    if chance(rng, 0.8):
        plan.against([lids.bin_(rng)], askew=10, gap=0.04)
    if chance(rng, 0.6):
        place = at(0.07, 0, uniform(rng, (1.15, 1.35)))
        plan.against([piece.moved(place) for piece in _rail(rng)], gap=0.0, askew=0.0)
    if chance(rng, 0.5):
        plan.anywhere([household.mat(rng, 0.5, 0.8, "bath mat")])
    if chance(rng, 0.5):
        stool = toiletries.stool()
        plan.against([stool.moved(at(0.2, 0))], gap=0.03)
    common.heater(plan)
    common.hang(plan, integer(rng, 0, 2))
    common.floor_objects(plan, ("basket", "crate", "box", "shoes"), integer(rng, 0, 4))


def _rail(rng: np.random.Generator) -> list[Piece]:
    """Return a towel rail with a towel."""
    width = uniform(rng, (0.36, 0.6))
    return [household.towel_rail(width), household.hanging_towel(rng, 0.7 * width, uniform(rng, (0.4, 0.65)))]
