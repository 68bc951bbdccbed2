"""Bedrooms."""

from __future__ import annotations

from s2a.homes import styles
from s2a.homes.draw import chance, integer, pick, uniform
from s2a.homes.families import beds, lids, storage
from s2a.homes.families.sliding import sliding_wardrobe
from s2a.homes.floor_plan import FloorPlan
from s2a.homes.furnishing import common
from s2a.homes.solids import at
from s2a.homes.styles import Palette

STAND = 1.0
"""[m] Free floor before furniture that opens."""


def bedroom(plan: FloorPlan, colors: Palette) -> None:
    """Place a bed with nightstands, a wardrobe, chests, a trunk."""
    rng = plan.rng
    style = styles.style(rng, colors, "clothes", drawers="linen")
    pieces, half, sides = beds.bed(rng, style, colors.cloth)
    night = styles.style(rng, colors, "bedroom", "bedroom", "paper")
    for side in sorted(sides & set(pick(rng, ((-1, 1), (-1, 1), (1,), (-1,), ())))):
        stand = storage.nightstand(rng, night)
        wide = float(stand.size[1]) / 2
        pieces.append(stand.moved(at(0.0, side * (half + wide + uniform(rng, (0.02, 0.12))))))
    plan.need(plan.against(pieces, stand=0.75, attempts=14))
    family = sliding_wardrobe if chance(rng, 0.35) else storage.wardrobe
    wardrobe = family(rng, styles.style(rng, colors, "clothes", drawers="linen"))
    plan.need(plan.against([wardrobe], stand=STAND, attempts=14))
    more = (
        storage.chest,
        storage.chest,
        storage.sideboard,
        storage.shelf,
        lids.trunk,
        storage.nightstand,
        storage.tv_bench,
    )
    for _ in range(integer(rng, 2, 5)):
        style = styles.style(rng, colors, "clothes", "bedroom", "linen")
        plan.against([pick(rng, more)(rng, style)], stand=STAND)
    common.heater(plan)
    common.hang(plan, integer(rng, 2, 6))
    common.floor_objects(plan, ("plant", "box", "bag", "chair", "shoes", "basket", "teddy", "lamp"), integer(rng, 2, 7))
    if chance(rng, 0.5):
        common.rug(plan, colors.cloth)
