"""Rooms but kitchens: living room, dining room, hallway, bedroom, bathroom, laundry, office, study, workshop."""

from __future__ import annotations

import numpy as np

from s2a.homes import decor, household, styles
from s2a.homes import decor as cloth
from s2a.homes.draw import chance, integer, pick, uniform
from s2a.homes.families import beds, sanitary, storage
from s2a.homes.families import office as furniture
from s2a.homes.families.storage import sliding_wardrobe
from s2a.homes.floor_plan import FloorPlan
from s2a.homes.furnishing import common
from s2a.homes.solids import Piece, at
from s2a.homes.styles import Palette

STAND = 1.0
"""[m] Free floor before furniture that opens."""
Labels = tuple[str, ...]


def living_room(plan: FloorPlan, colors: Palette) -> None:
    """Place a sofa, a TV bench across from it, a low table between them, cabinets, shelves."""
    rng = plan.rng
    _seats(plan, colors)
    bench = storage.tv_bench(rng, styles.style(rng, colors, "living", "nothing", "paper"))
    pieces = [_with_tv(rng, bench)]
    plan.need(plan.against(pieces, stand=STAND, attempts=14))
    families = (storage.sideboard, storage.vitrine, storage.shelf, storage.chest, storage.sideboard, storage.trunk)
    for _ in range(integer(rng, 3, 6)):
        plan.against([pick(rng, families)(rng, styles.style(rng, colors, "living", "living", "paper"))], stand=STAND)
    common.heater(plan)
    common.hang(plan, integer(rng, 3, 7))
    common.floor_objects(plan, ("plant", "lamp", "basket", "box", "bag", "plant"), integer(rng, 2, 7))
    if chance(rng, 0.4):
        common.rug(plan, colors.cloth)


def _with_tv(rng: np.random.Generator, bench: Piece) -> Piece:
    """Return a TV bench with a TV on it instead of other things."""
    high, wide = (float(np.ptp(bench.surface.vertices[:, i])) for i in (2, 1))
    tv = decor.tv(uniform(rng, (0.6, min(1.5, 1.05 * wide)))).moved(
        at(0.22, uniform(rng, (-0.05, 0.05)) * wide, high + 0.0003)
    )
    inside = tuple(thing for thing in bench.contents if thing.surface.vertices[:, 2].min() < high - 0.01)
    return Piece(bench.name, bench.surface, bench.children, contents=(*inside, tv), facts=bench.facts)


def _seats(plan: FloorPlan, colors: Palette) -> None:
    """Place a sofa with pillows at a wall with a low table before it, and an armchair."""
    rng = plan.rng
    sofa, width = beds.sofa(rng, colors.cloth)
    count = integer(rng, 0, 3)
    places = (np.arange(count) + 0.5) / max(count, 1) * (width - 0.7) - (width - 0.7) / 2
    lean = [_pillow(rng).moved(at(0.62, y, 0.44)) for y in places]
    tables = beds.coffee_table(rng, styles.style(rng, colors, "living", "bedroom", "paper"))
    deep = float(np.ptp(tables[0].surface.vertices[:, 0]))
    before = at(0.9 + uniform(rng, (0.35, 0.45)) + deep / 2, uniform(rng, (-0.15, 0.15)), 0, 0)
    group = [sofa, *lean, *(table.moved(before) for table in tables)]
    if plan.against(group, stand=0.6, attempts=16) is None:
        plan.need(plan.against([sofa, *lean], attempts=16))
    if chance(rng, 0.5):
        chair = cloth.armchair(styles.palette(rng).cloth).moved(at(0.9, 0))
        plan.against([chair], askew=8, gap=0.15)


def _pillow(rng: np.random.Generator) -> Piece:
    red, green, blue = rng.integers(60, 230, 3).tolist()
    return cloth.pillow((0.36, 0.36, 0.12), (red, green, blue))


def dining_room(plan: FloorPlan, colors: Palette) -> None:
    """Place a table with chairs, a sideboard, a vitrine."""
    rng = plan.rng
    table = beds.dining(rng, styles.style(rng, colors, "dishes", "dishes"))
    families = (storage.sideboard, storage.vitrine, storage.sideboard, storage.chest, storage.shelf)
    first = storage.sideboard(rng, styles.style(rng, colors, "dishes", "living", "cutlery"))
    plan.need(plan.against([first], stand=STAND, attempts=14))
    plan.need(plan.anywhere(table, attempts=80))
    for _ in range(integer(rng, 2, 5)):
        plan.against([pick(rng, families)(rng, styles.style(rng, colors, "dishes", "living", "cutlery"))], stand=STAND)
    common.heater(plan)
    common.hang(plan, integer(rng, 2, 6))
    common.floor_objects(plan, ("plant", "lamp", "chair", "basket", "box"), integer(rng, 1, 5))


def hallway(plan: FloorPlan, colors: Palette) -> None:
    """Place shoe cabinets, a wardrobe, a bench, hooks."""
    rng = plan.rng
    plan.need(
        plan.against(
            [storage.hall_cabinet(rng, styles.style(rng, colors, "shoes", "living", "paper"))], stand=0.85, attempts=14
        )
    )
    families = (storage.hall_cabinet, storage.wardrobe, storage.trunk, storage.chest, storage.shelf, storage.nightstand)
    for _ in range(integer(rng, 2, 5)):
        plan.against([pick(rng, families)(rng, styles.style(rng, colors, "shoes", "living", "linen"))], stand=0.85)
    common.hang(plan, integer(rng, 2, 6))
    common.floor_objects(plan, ("shoes", "bag", "plant", "box", "shoes"), integer(rng, 2, 6))


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
        storage.trunk,
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


WASH_STAND = 0.9
"""[m] Free floor before furniture that opens."""


def bathroom(plan: FloorPlan, colors: Palette) -> None:
    """Place a bathtub or none, a toilet, a vanity with a mirror cabinet, cupboards, a hamper."""
    rng = plan.rng
    style = styles.style(rng, colors, "bath", "bath", "toiletries")
    vanity = sanitary.vanity(rng, style)
    if chance(rng, 0.8):
        vanity.append(sanitary.mirror_cabinet(rng, style))
    plan.need(plan.against(vanity, stand=WASH_STAND, attempts=16, askew=0.2))
    plan.need(plan.against([sanitary.toilet()], stand=0.45, attempts=16, askew=0.3))
    if chance(rng, 0.6):
        tub = sanitary.bathtub(uniform(rng, (1.5, 1.8)), uniform(rng, (0.7, 0.8)))
        plan.against([tub], attempts=16, askew=0.0, gap=0.004)
    if chance(rng, 0.45):
        plan.against([sanitary.washer(rng)], stand=WASH_STAND, askew=0.5, gap=0.03)
    families = (sanitary.tall_cupboard, storage.hamper, sanitary.tall_cupboard)
    for _ in range(integer(rng, 2, 4)):
        plan.against(
            [pick(rng, families)(rng, styles.style(rng, colors, "bath", "bath", "toiletries"))], stand=WASH_STAND
        )
    _small(plan)


def laundry(plan: FloorPlan, colors: Palette) -> None:
    """Place washing machine and dryer, tall cupboards, hampers, shelves."""
    rng = plan.rng
    machines = [sanitary.washer(rng)]
    if chance(rng, 0.6):
        machines.append(sanitary.washer(rng, "dryer").moved(at(0, uniform(rng, (0.62, 0.7)))))
    plan.need(plan.against(machines, stand=WASH_STAND, askew=0.4, gap=0.03, attempts=16))
    families = (sanitary.tall_cupboard, storage.hamper, sanitary.tall_cupboard, storage.hamper)
    for _ in range(integer(rng, 3, 6)):
        plan.against([pick(rng, families)(rng, styles.style(rng, colors, "linen", "linen", "linen"))], stand=WASH_STAND)
    style = styles.style(rng, colors, "linen", "nothing", "linen")
    if chance(rng, 0.6):
        plan.against(sanitary.vanity(rng, style), stand=WASH_STAND, askew=0.2)
    _small(plan)


def _small(plan: FloorPlan) -> None:
    """Place a bin, towels, mats and what else stands about."""
    rng = plan.rng
    if chance(rng, 0.8):
        plan.against([storage.bin_(rng)], askew=10, gap=0.04)
    if chance(rng, 0.6):
        place = at(0.07, 0, uniform(rng, (1.15, 1.35)))
        plan.against([piece.moved(place) for piece in _rail(rng)], gap=0.0, askew=0.0)
    if chance(rng, 0.5):
        plan.anywhere([household.mat(rng, 0.5, 0.8, "bath mat")])
    if chance(rng, 0.5):
        stool = household.stool()
        plan.against([stool.moved(at(0.2, 0))], gap=0.03)
    common.heater(plan)
    common.hang(plan, integer(rng, 0, 2))
    common.floor_objects(plan, ("basket", "crate", "box", "shoes"), integer(rng, 0, 4))


def _rail(rng: np.random.Generator) -> list[Piece]:
    """Return a towel rail with a towel."""
    width = uniform(rng, (0.36, 0.6))
    return [household.towel_rail(width), household.hanging_towel(rng, 0.7 * width, uniform(rng, (0.4, 0.65)))]


def office(plan: FloorPlan, colors: Palette) -> None:
    """Place one or two desks, filing and roller-shutter cabinets, lockers, shelves."""
    rng = plan.rng
    desk = styles.style(rng, colors, "office", "office", "paper", panels=("slab",))
    for index in range(integer(rng, 1, 2)):
        pose = plan.against(furniture.desk(rng, desk), stand=0.35, attempts=14)
        if index == 0:
            plan.need(pose)
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
        storage.trunk,
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
        storage.trunk,
    )
    for _ in range(integer(rng, 4, 8)):
        plan.against([pick(rng, families)(rng, styles.style(rng, colors, "tools", "tools", "toiletries"))], stand=STAND)
    common.hang(plan, integer(rng, 1, 4), work=True)
    common.floor_objects(plan, ("tools", "crate", "box", "can", "crate", "tools"), integer(rng, 3, 8))
