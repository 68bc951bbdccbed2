"""Offices, studies and workshops."""

from __future__ import annotations

from s2a.homes import styles
from s2a.homes.draw import chance, integer, pick
from s2a.homes.families import lids, storage
from s2a.homes.families import office as furniture
from s2a.homes.floor_plan import FloorPlan
from s2a.homes.furnishing import common
from s2a.homes.styles import Palette

STAND = 1.0
"""[m] Free floor before furniture that opens."""


def office(plan: FloorPlan, colors: Palette) -> None:
    """Place one or two desks, filing and roller-shutter cabinets, lockers, shelves."""
    rng = plan.rng
    desk = styles.style(rng, colors, "office", "office", "paper", panels=("slab",))
    for index in range(integer(rng, 1, 2)):
        found = plan.against(furniture.desk(rng, desk), stand=0.35, attempts=14)
        if index == 0:
            plan.need(found)
    first = pick(rng, (furniture.filing, furniture.cupboard, furniture.roller))
    plan.need(plan.against([first(rng, styles.style(rng, colors, "office", "office"))], stand=STAND, attempts=14))
    families = (
        furniture.filing,
        furniture.roller,
        furniture.lockers,
        furniture.cupboard,
        storage.shelf,
        furniture.wall_cupboard,
    )
    for _ in range(integer(rng, 4, 8)):
        plan.against([pick(rng, families)(rng, styles.style(rng, colors, "office", "office"))], stand=STAND)
    common.heater(plan)
    common.hang(plan, integer(rng, 2, 6), work=True)
    common.floor_objects(plan, ("plant", "box", "bag", "can", "chair", "tower"), integer(rng, 2, 7))


def study(plan: FloorPlan, colors: Palette) -> None:
    """Place a desk, shelves with inserts, a chest or a sideboard."""
    rng = plan.rng
    plan.need(
        plan.against(
            furniture.desk(rng, styles.style(rng, colors, "office", "office", "paper")), stand=0.35, attempts=14
        )
    )
    plan.need(
        plan.against([storage.shelf(rng, styles.style(rng, colors, "office", "living"))], stand=STAND, attempts=14)
    )
    families = (
        storage.shelf,
        storage.chest,
        storage.sideboard,
        furniture.cupboard,
        furniture.filing,
        storage.vitrine,
        furniture.wall_cupboard,
        lids.trunk,
    )
    for _ in range(integer(rng, 3, 6)):
        plan.against([pick(rng, families)(rng, styles.style(rng, colors, "office", "living"))], stand=STAND)
    common.heater(plan)
    common.hang(plan, integer(rng, 2, 6), work=True)
    common.floor_objects(plan, ("plant", "box", "lamp", "can", "bag", "basket", "tower"), integer(rng, 1, 6))
    if chance(rng, 0.4):
        common.rug(plan, colors.cloth)


def workshop(plan: FloorPlan, colors: Palette) -> None:
    """Place a workbench, tool cabinets, lockers, wall cupboards, shelves with crates."""
    rng = plan.rng
    bench = styles.style(rng, colors, "tools", "tools", "toiletries", panels=("slab",))
    plan.need(plan.against(furniture.desk(rng, bench, "workbench"), stand=0.35, attempts=14))
    plan.need(plan.against([furniture.tool_cabinet(rng, bench)], stand=STAND, attempts=14))
    families = (
        furniture.tool_cabinet,
        furniture.lockers,
        furniture.wall_cupboard,
        storage.shelf,
        furniture.cupboard,
        furniture.roller,
        lids.trunk,
    )
    for _ in range(integer(rng, 4, 8)):
        plan.against([pick(rng, families)(rng, styles.style(rng, colors, "tools", "tools", "toiletries"))], stand=STAND)
    common.hang(plan, integer(rng, 1, 4), work=True)
    common.floor_objects(plan, ("tools", "crate", "box", "can", "crate", "tools"), integer(rng, 3, 8))
