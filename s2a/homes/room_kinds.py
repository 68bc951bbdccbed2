"""Rooms of every kind, furnished by rules: kitchens with fitted rows, rooms to live, to wash and to work in."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from s2a.homes import beds, clutter, fittings, household, objects, sanitary, storage
from s2a.homes import kitchen as units
from s2a.homes import office as furniture
from s2a.homes.clutter import Board
from s2a.homes.draw import chance, integer, pick, uniform
from s2a.homes.floor_plan import FloorPlan
from s2a.homes.fronts import Palette, Style, random_palette, random_style
from s2a.homes.kitchen import Fitted, fitted
from s2a.homes.solids import Piece, at
from s2a.homes.storage import sliding_wardrobe

STAND = 1.0
"""[m] Free floor before furniture that opens."""
Labels = tuple[str, ...]


def living_room(plan: FloorPlan, colors: Palette) -> None:
    """Place a sofa, a TV bench across from it, a low table between them, cabinets, shelves."""
    rng = plan.rng
    _seats(plan, colors)
    bench = storage.tv_bench(rng, random_style(rng, colors, "living", "nothing", "paper"))
    pieces = [_with_tv(rng, bench)]
    plan.need(plan.against(pieces, stand=STAND, attempts=14))
    families = (storage.sideboard, storage.vitrine, storage.shelf, storage.chest, storage.sideboard, storage.trunk)
    for _ in range(integer(rng, 3, 6)):
        plan.against([pick(rng, families)(rng, random_style(rng, colors, "living", "living", "paper"))], stand=STAND)
    fittings.heater(plan)
    fittings.hang(plan, integer(rng, 3, 7))
    fittings.floor_objects(plan, ("plant", "lamp", "basket", "box", "bag", "plant"), integer(rng, 2, 7))
    if chance(rng, 0.4):
        fittings.rug(plan, colors.cloth)


def _with_tv(rng: np.random.Generator, bench: Piece) -> Piece:
    """Return a TV bench with a TV on it instead of other things."""
    high, wide = (float(np.ptp(bench.surface.vertices[:, i])) for i in (2, 1))
    tv = objects.tv(uniform(rng, (0.6, min(1.5, 1.05 * wide)))).moved(
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
    tables = beds.coffee_table(rng, random_style(rng, colors, "living", "bedroom", "paper"))
    deep = float(np.ptp(tables[0].surface.vertices[:, 0]))
    before = at(0.9 + uniform(rng, (0.35, 0.45)) + deep / 2, uniform(rng, (-0.15, 0.15)), 0, 0)
    group = [sofa, *lean, *(table.moved(before) for table in tables)]
    if plan.against(group, stand=0.6, attempts=16) is None:
        plan.need(plan.against([sofa, *lean], attempts=16))
    if chance(rng, 0.5):
        chair = objects.armchair(random_palette(rng).cloth).moved(at(0.9, 0))
        plan.against([chair], askew=8, gap=0.15)


def _pillow(rng: np.random.Generator) -> Piece:
    red, green, blue = rng.integers(60, 230, 3).tolist()
    return objects.pillow((0.36, 0.36, 0.12), (red, green, blue))


def dining_room(plan: FloorPlan, colors: Palette) -> None:
    """Place a table with chairs, a sideboard, a vitrine."""
    rng = plan.rng
    table = beds.dining(rng, random_style(rng, colors, "dishes", "dishes"))
    families = (storage.sideboard, storage.vitrine, storage.sideboard, storage.chest, storage.shelf)
    first = storage.sideboard(rng, random_style(rng, colors, "dishes", "living", "cutlery"))
    plan.need(plan.against([first], stand=STAND, attempts=14))
    plan.need(plan.anywhere(table, attempts=80))
    for _ in range(integer(rng, 2, 5)):
        plan.against([pick(rng, families)(rng, random_style(rng, colors, "dishes", "living", "cutlery"))], stand=STAND)
    fittings.heater(plan)
    fittings.hang(plan, integer(rng, 2, 6))
    fittings.floor_objects(plan, ("plant", "lamp", "chair", "basket", "box"), integer(rng, 1, 5))


def hallway(plan: FloorPlan, colors: Palette) -> None:
    """Place shoe cabinets, a wardrobe, a bench, hooks."""
    rng = plan.rng
    plan.need(
        plan.against(
            [storage.hall_cabinet(rng, random_style(rng, colors, "shoes", "living", "paper"))], stand=0.85, attempts=14
        )
    )
    families = (storage.hall_cabinet, storage.wardrobe, storage.trunk, storage.chest, storage.shelf, storage.nightstand)
    for _ in range(integer(rng, 2, 5)):
        plan.against([pick(rng, families)(rng, random_style(rng, colors, "shoes", "living", "linen"))], stand=0.85)
    fittings.hang(plan, integer(rng, 2, 6))
    fittings.floor_objects(plan, ("shoes", "bag", "plant", "box", "shoes"), integer(rng, 2, 6))


def bedroom(plan: FloorPlan, colors: Palette) -> None:
    """Place a bed with nightstands, a wardrobe, chests, a trunk."""
    rng = plan.rng
    style = random_style(rng, colors, "clothes", drawers="linen")
    pieces, half, sides = beds.bed(rng, style, colors.cloth)
    night = random_style(rng, colors, "bedroom", "bedroom", "paper")
    for side in sorted(sides & set(pick(rng, ((-1, 1), (-1, 1), (1,), (-1,), ())))):
        stand = storage.nightstand(rng, night)
        wide = float(stand.size[1]) / 2
        pieces.append(stand.moved(at(0.0, side * (half + wide + uniform(rng, (0.02, 0.12))))))
    plan.need(plan.against(pieces, stand=0.75, attempts=14))
    family = sliding_wardrobe if chance(rng, 0.35) else storage.wardrobe
    wardrobe = family(rng, random_style(rng, colors, "clothes", drawers="linen"))
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
        style = random_style(rng, colors, "clothes", "bedroom", "linen")
        plan.against([pick(rng, more)(rng, style)], stand=STAND)
    fittings.heater(plan)
    fittings.hang(plan, integer(rng, 2, 6))
    fittings.floor_objects(
        plan, ("plant", "box", "bag", "chair", "shoes", "basket", "teddy", "lamp"), integer(rng, 2, 7)
    )
    if chance(rng, 0.5):
        fittings.rug(plan, colors.cloth)


WASH_STAND = 0.9
"""[m] Free floor before furniture that opens."""


def bathroom(plan: FloorPlan, colors: Palette) -> None:
    """Place a bathtub or none, a toilet, a vanity with a mirror cabinet, cupboards, a hamper."""
    rng = plan.rng
    style = random_style(rng, colors, "bath", "bath", "toiletries")
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
            [pick(rng, families)(rng, random_style(rng, colors, "bath", "bath", "toiletries"))], stand=WASH_STAND
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
        plan.against([pick(rng, families)(rng, random_style(rng, colors, "linen", "linen", "linen"))], stand=WASH_STAND)
    style = random_style(rng, colors, "linen", "nothing", "linen")
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
    fittings.heater(plan)
    fittings.hang(plan, integer(rng, 0, 2))
    fittings.floor_objects(plan, ("basket", "crate", "box", "shoes"), integer(rng, 0, 4))


def _rail(rng: np.random.Generator) -> list[Piece]:
    """Return a towel rail with a towel."""
    width = uniform(rng, (0.36, 0.6))
    return [household.towel_rail(width), household.hanging_towel(rng, 0.7 * width, uniform(rng, (0.4, 0.65)))]


def office(plan: FloorPlan, colors: Palette) -> None:
    """Place one or two desks, filing and roller-shutter cabinets, lockers, shelves."""
    rng = plan.rng
    desk = random_style(rng, colors, "office", "office", "paper", panels=("slab",))
    for index in range(integer(rng, 1, 2)):
        pose = plan.against(furniture.desk(rng, desk), stand=0.35, attempts=14)
        if index == 0:
            plan.need(pose)
    first = pick(rng, (furniture.filing, furniture.cupboard, furniture.roller))
    plan.need(plan.against([first(rng, random_style(rng, colors, "office", "office"))], stand=STAND, attempts=14))
    families = (
        furniture.filing,
        furniture.roller,
        furniture.lockers,
        furniture.cupboard,
        storage.shelf,
        furniture.wall_cupboard,
    )
    for _ in range(integer(rng, 4, 8)):
        plan.against([pick(rng, families)(rng, random_style(rng, colors, "office", "office"))], stand=STAND)
    fittings.heater(plan)
    fittings.hang(plan, integer(rng, 2, 6), work=True)
    fittings.floor_objects(plan, ("plant", "box", "bag", "can", "chair", "tower"), integer(rng, 2, 7))


def study(plan: FloorPlan, colors: Palette) -> None:
    """Place a desk, shelves with inserts, a chest or a sideboard."""
    rng = plan.rng
    plan.need(
        plan.against(
            furniture.desk(rng, random_style(rng, colors, "office", "office", "paper")), stand=0.35, attempts=14
        )
    )
    plan.need(
        plan.against([storage.shelf(rng, random_style(rng, colors, "office", "living"))], stand=STAND, attempts=14)
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
        plan.against([pick(rng, families)(rng, random_style(rng, colors, "office", "living"))], stand=STAND)
    fittings.heater(plan)
    fittings.hang(plan, integer(rng, 2, 6), work=True)
    fittings.floor_objects(plan, ("plant", "box", "lamp", "can", "bag", "basket", "tower"), integer(rng, 1, 6))
    if chance(rng, 0.4):
        fittings.rug(plan, colors.cloth)


def workshop(plan: FloorPlan, colors: Palette) -> None:
    """Place a workbench, tool cabinets, lockers, wall cupboards, shelves with crates."""
    rng = plan.rng
    bench = random_style(rng, colors, "tools", "tools", "toiletries", panels=("slab",))
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
        plan.against([pick(rng, families)(rng, random_style(rng, colors, "tools", "tools", "toiletries"))], stand=STAND)
    fittings.hang(plan, integer(rng, 1, 4), work=True)
    fittings.floor_objects(plan, ("tools", "crate", "box", "can", "crate", "tools"), integer(rng, 3, 8))


ROW_STAND = 1.05
"""[m] Free floor before a fitted row."""
WIDTHS = {
    "drawers": (0.4, 1.0),
    "cupboard": (0.3, 0.9),
    "sink": (0.5, 0.9),
    "oven": (0.595, 0.605),
    "dishwasher": (0.445, 0.605),
}
"""Of base units [m]."""


@dataclass(frozen=True)
class KitchenStyle:
    """What a kitchen's units share: sizes, style of the base units, style of the wall units."""

    sizes: Fitted
    base: Style
    wall: Style


def kitchen(plan: FloorPlan, colors: Palette) -> None:
    """Place one or two fitted rows with wall units, a fridge, an island or a table."""
    rng = plan.rng
    base = random_style(rng, colors, "pantry", "nothing", "cutlery", panels=("slab", "framed", "grooved", "slab"))
    kitchen = KitchenStyle(
        fitted(rng),
        base,
        base if chance(rng, 0.6) else random_style(rng, colors, "kitchen", panels=("slab", "glazed", "framed")),
    )
    # Doors of wall units stop at the hood, which is deeper than they are.
    kitchen = replace(kitchen, wall=replace(kitchen.wall, angle=min(kitchen.wall.angle, 1.5)))
    longest = max(side.length for side in plan.room.sides)
    plan.need(
        plan.against(
            row(rng, kitchen, uniform(rng, (min(2.6, 0.8 * longest), min(4.6, longest - 0.1))), True),
            stand=ROW_STAND,
            attempts=16,
            askew=0.3,
            gap=0.002,
        )
    )
    fridge = units.fridge(rng, random_style(rng, colors, "pantry", "nothing", "cutlery"))
    plan.need(plan.against([fridge], stand=ROW_STAND, askew=0.5, gap=0.02, attempts=14))
    if chance(rng, 0.7):
        plan.against(row(rng, kitchen, uniform(rng, (1.0, 2.2)), False), stand=ROW_STAND, askew=0.3, gap=0.002)
    if chance(rng, 0.4) and plan.room.size[0] * plan.room.size[1] > 14:
        plan.anywhere(units.island(rng, kitchen.sizes, base, uniform(rng, (1.0, 1.8))), stand=ROW_STAND, attempts=40)
    if chance(rng, 0.35):
        plan.against(
            [units.tall_unit(rng, uniform(rng, (0.4, 0.62)), kitchen.sizes, base)],
            stand=ROW_STAND,
            askew=0.3,
            gap=0.002,
        )
    if chance(rng, 0.5):
        plan.anywhere(beds.dining(rng, random_style(rng, colors, "dishes", "dishes")), attempts=40)
    if chance(rng, 0.4):
        plan.against([storage.shelf(rng, random_style(rng, colors, "pantry", "kitchen", "cutlery"))], stand=ROW_STAND)
    if chance(rng, 0.7):
        plan.against([storage.bin_(rng)], askew=10, gap=0.04)
    fittings.heater(plan)
    fittings.hang(plan, integer(rng, 1, 4))
    fittings.floor_objects(plan, ("plant", "box", "chair", "basket"), integer(rng, 2, 6))


def row(rng: np.random.Generator, kitchen: KitchenStyle, length: float, main: bool) -> list[Piece]:
    """Return base units side by side under one worktop, things on it, wall units above: a group centred in y.

    Args:
        rng: the order and widths of the units.
        kitchen: of the kitchen.
        length: at most [m].
        main: It has the sink, the oven and the dishwasher.
    """
    kinds = _order(rng, length, main)
    widths = np.array([wide for _, wide in kinds])
    starts = np.cumsum([0.0, *widths]) - widths.sum() / 2
    make = {
        "drawers": units.drawers,
        "cupboard": units.cupboard,
        "sink": units.sink_unit,
        "oven": units.oven,
        "dishwasher": units.dishwasher,
    }
    middles = {name: float(start + wide / 2) for (name, wide), start in zip(kinds, starts, strict=False)}
    pieces = [
        make[name](rng, wide, kitchen.sizes, kitchen.base).moved(at(0, start + wide / 2))
        for (name, wide), start in zip(kinds, starts, strict=False)
    ]
    ends = (float(starts[0]), float(starts[-1]))
    sink = (middles["sink"], min(0.5, dict(kinds)["sink"] - 0.14)) if "sink" in middles else None
    top = pick(rng, ((112, 104, 98), (60, 60, 64), (206, 200, 190), kitchen.base.top))
    pieces += units.worktop(ends, kitchen.sizes, sink, top, 0)
    pieces += _on_top(rng, kitchen, ends, middles)
    if chance(rng, 0.85 if main else 0.6):
        pieces += _wall_units(rng, kitchen, ends, middles.get("oven"))
    return pieces


def _order(rng: np.random.Generator, length: float, main: bool) -> list[tuple[str, float]]:
    """Return kinds and widths of base units that together are at most so long [m]."""
    wanted = ["sink", "oven"] if main else []
    wanted += ["dishwasher"] if main and chance(rng, 0.7) else []
    chosen = [(name, uniform(rng, WIDTHS[name])) for name in wanted]
    while True:
        name = pick(rng, ("drawers", "drawers", "cupboard"))
        wide = uniform(rng, WIDTHS[name])
        if sum(w for _, w in chosen) + wide > length:
            break
        chosen.append((name, wide))
    if not chosen:
        chosen = [("drawers", length)]
    return [chosen[i] for i in rng.permutation(len(chosen)).tolist()]


def _on_top(
    rng: np.random.Generator, kitchen: KitchenStyle, ends: tuple[float, float], middles: dict[str, float]
) -> list[Piece]:
    """Return the hob, and what stands on the worktop left and right of sink and hob."""
    z = kitchen.sizes.top + kitchen.sizes.counter
    pieces: list[Piece] = []
    busy = []
    if "oven" in middles:
        hob = at(0.31, middles["oven"], z)
        pieces.append(units.hob().moved(hob))
        busy.append((middles["oven"] - 0.3, middles["oven"] + 0.3))
        if chance(rng, 0.6):
            pot = household.pot(uniform(rng, (0.08, 0.11)), uniform(rng, (0.08, 0.14)))
            pieces.append(pot.moved(at(0.42, middles["oven"] - 0.14, z + 0.0078)))
    if "sink" in middles:
        busy.append((middles["sink"] - 0.3, middles["sink"] + 0.3))
    cuts = [ends[0], *(y for span in sorted(busy) for y in span), ends[1]]
    for low, high in zip(cuts[::2], cuts[1::2], strict=True):
        if high - low > 0.56 and chance(rng, 0.35):
            oven = units.microwave(rng).moved(at(0.03, high - 0.29, z + 0.0003))
            pieces.append(oven)
            high -= 0.58
        if high - low > 0.14:
            board = Board((0.04, kitchen.sizes.depth - 0.06), (low, high), z, kitchen.sizes.upper - z)
            pieces += clutter.fill(rng, board, "kitchen", int(4 * (high - low)) + 1)
    return pieces


def _wall_units(
    rng: np.random.Generator, kitchen: KitchenStyle, ends: tuple[float, float], oven: float | None
) -> list[Piece]:
    """Return wall units above a row, and a hood above the hob."""
    pieces = []
    spans = [ends]
    if oven is not None:
        spans = [(ends[0], oven - 0.31), (oven + 0.31, ends[1])]
        pieces.append(units.extractor(0.3).moved(at(0, oven, kitchen.sizes.upper)))
    for low, high in spans:
        y = low
        while high - y > 0.3:
            wide = min(uniform(rng, (0.3, 0.95)), high - y)
            wide = high - y if high - y - wide < 0.3 and high - y < 1.0 else wide
            if chance(rng, 0.88):
                pieces.append(units.wall_unit(rng, wide, kitchen.sizes, kitchen.wall).moved(at(0, y + wide / 2)))
            y += wide
    return pieces
