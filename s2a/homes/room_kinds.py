"""Rooms of every kind, furnished by rules: kitchens with fitted rows, rooms to live, to wash and to work in."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from s2a.homes import clutter, fittings, furniture, household, objects, storage
from s2a.homes import kitchen as units
from s2a.homes.clutter import Board
from s2a.homes.floor_plan import FloorPlan
from s2a.homes.fronts import Palette, Style, random_palette, random_style
from s2a.homes.kitchen import Fitted, fitted
from s2a.homes.solids import Piece, at, chance, integer, pick, random_color

# [m] Free floor before furniture that opens: in most rooms, where people wash, in hallways
STAND, WASH_STAND, HALL_STAND = 1.0, 0.9, 0.85
Family = Callable[[np.random.Generator, Style], Piece]


def _need(
    plan: FloorPlan,
    pieces: list[Piece],
    stand: float = STAND,
    attempts: int = 14,
    askew: float = 1.2,
    gap: float = 0.008,
) -> None:
    """Place a group at a wall as `FloorPlan.against` does; raise Crowded where it has no place."""
    plan.need(plan.against(pieces, stand, None, askew, gap, attempts))


def _more(
    plan: FloorPlan,
    colors: Palette,
    count: tuple[int, int],
    families: Sequence[Family],
    theme: str,
    top: str,
    drawers: str = "paper",
    stand: float = STAND,
) -> None:
    """Place so many pieces, from and to, of any of some families; those that have no place are left out."""
    rng = plan.rng
    for _ in range(integer(rng, *count)):
        plan.against([pick(rng, families)(rng, random_style(rng, colors, theme, top, drawers))], stand=stand)


def _finish(
    plan: FloorPlan,
    hung: tuple[int, int],
    kinds: Sequence[str],
    count: tuple[int, int],
    heater: bool = True,
    work: bool = False,
) -> None:
    """Place a radiator, what hangs on the walls, and things of some kinds on the floor; numbers from and to."""
    if heater:
        fittings.heater(plan)
    fittings.hang(plan, integer(plan.rng, *hung), work)
    fittings.floor_objects(plan, kinds, integer(plan.rng, *count))


def _rug(plan: FloorPlan, colors: Palette, probability: float) -> None:
    if chance(plan.rng, probability):
        fittings.rug(plan, colors.cloth)


def living_room(plan: FloorPlan, colors: Palette) -> None:
    """Place a sofa, a TV bench across from it, a low table between them, cabinets, shelves."""
    rng = plan.rng
    _seats(plan, colors)
    bench = storage.tv_bench(rng, random_style(rng, colors, "living", "nothing", "paper"))
    _need(plan, [_with_tv(rng, bench)])
    families = (storage.sideboard, storage.vitrine, storage.shelf, storage.chest, storage.sideboard, storage.trunk)
    _more(plan, colors, (3, 6), families, "living", "living", "paper")
    _finish(plan, (3, 7), ("plant", "lamp", "basket", "box", "bag", "plant"), (2, 7))
    _rug(plan, colors, 0.4)


def _with_tv(rng: np.random.Generator, bench: Piece) -> Piece:
    """Return a TV bench with a TV on it instead of other things."""
    high, wide = (float(np.ptp(bench.surface.vertices[:, i])) for i in (2, 1))
    tv = objects.tv(rng.uniform(0.6, min(1.5, 1.05 * wide))).moved(
        at(0.22, rng.uniform(-0.05, 0.05) * wide, high + 0.0003)
    )
    inside = tuple(thing for thing in bench.contents if thing.surface.vertices[:, 2].min() < high - 0.01)
    return Piece(bench.name, bench.surface, bench.children, contents=(*inside, tv), facts=bench.facts)


def _seats(plan: FloorPlan, colors: Palette) -> None:
    """Place a sofa with pillows at a wall with a low table before it, and an armchair."""
    rng = plan.rng
    sofa, width = furniture.sofa(rng, colors.cloth)
    count = integer(rng, 0, 3)
    places = (np.arange(count) + 0.5) / max(count, 1) * (width - 0.7) - (width - 0.7) / 2
    lean = [objects.pillow((0.36, 0.36, 0.12), random_color(rng, 60, 230)).moved(at(0.62, y, 0.44)) for y in places]
    tables = furniture.coffee_table(rng, random_style(rng, colors, "living", "bedroom", "paper"))
    deep = float(np.ptp(tables[0].surface.vertices[:, 0]))
    before = at(0.9 + rng.uniform(0.35, 0.45) + deep / 2, rng.uniform(-0.15, 0.15), 0, 0)
    group = [sofa, *lean, *(table.moved(before) for table in tables)]
    if plan.against(group, stand=0.6, attempts=16) is None:
        plan.need(plan.against([sofa, *lean], attempts=16))
    if chance(rng, 0.5):
        chair = furniture.armchair(random_palette(rng).cloth).moved(at(0.9, 0))
        plan.against([chair], askew=8, gap=0.15)


def dining_room(plan: FloorPlan, colors: Palette) -> None:
    """Place a table with chairs, a sideboard, a vitrine."""
    rng = plan.rng
    table = furniture.dining(rng, random_style(rng, colors, "dishes", "dishes"))
    families = (storage.sideboard, storage.vitrine, storage.sideboard, storage.chest, storage.shelf)
    _need(plan, [storage.sideboard(rng, random_style(rng, colors, "dishes", "living", "cutlery"))])
    plan.need(plan.anywhere(table, attempts=80))
    _more(plan, colors, (2, 5), families, "dishes", "living", "cutlery")
    _finish(plan, (2, 6), ("plant", "lamp", "chair", "basket", "box"), (1, 5))


def hallway(plan: FloorPlan, colors: Palette) -> None:
    """Place shoe cabinets, a wardrobe, a bench, hooks."""
    rng = plan.rng
    _need(plan, [storage.hall_cabinet(rng, random_style(rng, colors, "shoes", "living", "paper"))], HALL_STAND)
    families = (storage.hall_cabinet, storage.wardrobe, storage.trunk, storage.chest, storage.shelf, storage.nightstand)
    _more(plan, colors, (2, 5), families, "shoes", "living", "linen", stand=HALL_STAND)
    _finish(plan, (2, 6), ("shoes", "bag", "plant", "box", "shoes"), (2, 6), heater=False)


def bedroom(plan: FloorPlan, colors: Palette) -> None:
    """Place a bed with nightstands, a wardrobe, chests, a trunk."""
    rng = plan.rng
    style = random_style(rng, colors, "clothes", drawers="linen")
    pieces, half, sides = furniture.bed(rng, style, colors.cloth)
    night = random_style(rng, colors, "bedroom", "bedroom", "paper")
    for side in sorted(sides & set(pick(rng, ((-1, 1), (-1, 1), (1,), (-1,), ())))):
        stand = storage.nightstand(rng, night)
        wide = float(stand.size[1]) / 2
        pieces.append(stand.moved(at(0.0, side * (half + wide + rng.uniform(0.02, 0.12)))))
    _need(plan, pieces, 0.75)
    family = storage.sliding_wardrobe if chance(rng, 0.35) else storage.wardrobe
    _need(plan, [family(rng, random_style(rng, colors, "clothes", drawers="linen"))])
    families: tuple[Family, ...] = (storage.chest, storage.chest, storage.sideboard, storage.shelf, storage.trunk)
    families += (storage.nightstand, storage.tv_bench)
    for _ in range(integer(rng, 2, 5)):
        style = random_style(rng, colors, "clothes", "bedroom", "linen")
        plan.against([pick(rng, families)(rng, style)], stand=STAND)
    _finish(plan, (2, 6), ("plant", "box", "bag", "chair", "shoes", "basket", "teddy", "lamp"), (2, 7))
    _rug(plan, colors, 0.5)


def bathroom(plan: FloorPlan, colors: Palette) -> None:
    """Place a bathtub or none, a toilet, a vanity with a mirror cabinet, cupboards, a hamper."""
    rng = plan.rng
    style = random_style(rng, colors, "bath", "bath", "toiletries")
    vanity = units.vanity(rng, style)
    if chance(rng, 0.8):
        vanity.append(units.mirror_cabinet(rng, style))
    _need(plan, vanity, WASH_STAND, 16, askew=0.2)
    _need(plan, [units.toilet()], 0.45, 16, askew=0.3)
    if chance(rng, 0.6):
        tub = units.bathtub(rng.uniform(1.5, 1.8), rng.uniform(0.7, 0.8))
        plan.against([tub], attempts=16, askew=0.0, gap=0.004)
    if chance(rng, 0.45):
        plan.against([units.washer(rng)], stand=WASH_STAND, askew=0.5, gap=0.03)
    families = (units.tall_cupboard, storage.hamper, units.tall_cupboard)
    _more(plan, colors, (2, 4), families, "bath", "bath", "toiletries", stand=WASH_STAND)
    _small(plan)


def laundry(plan: FloorPlan, colors: Palette) -> None:
    """Place washing machine and dryer, tall cupboards, hampers, shelves."""
    rng = plan.rng
    machines = [units.washer(rng)]
    if chance(rng, 0.6):
        machines.append(units.washer(rng, "dryer").moved(at(0, rng.uniform(0.62, 0.7))))
    _need(plan, machines, WASH_STAND, 16, askew=0.4, gap=0.03)
    families = (units.tall_cupboard, storage.hamper, units.tall_cupboard, storage.hamper)
    _more(plan, colors, (3, 6), families, "linen", "linen", "linen", stand=WASH_STAND)
    style = random_style(rng, colors, "linen", "nothing", "linen")
    if chance(rng, 0.6):
        plan.against(units.vanity(rng, style), stand=WASH_STAND, askew=0.2)
    _small(plan)


def _small(plan: FloorPlan) -> None:
    """Place a bin, towels, mats and what else stands about."""
    rng = plan.rng
    if chance(rng, 0.8):
        plan.against([storage.bin_(rng)], askew=10, gap=0.04)
    if chance(rng, 0.6):
        place, width = at(0.07, 0, rng.uniform(1.15, 1.35)), rng.uniform(0.36, 0.6)
        towel = household.hanging_towel(rng, 0.7 * width, rng.uniform(0.4, 0.65))
        plan.against([household.towel_rail(width).moved(place), towel.moved(place)], gap=0.0, askew=0.0)
    if chance(rng, 0.5):
        plan.anywhere([household.mat(rng, 0.5, 0.8, "bath mat")])
    if chance(rng, 0.5):
        plan.against([household.stool().moved(at(0.2, 0))], gap=0.03)
    _finish(plan, (0, 2), ("basket", "crate", "box", "shoes"), (0, 4))


def office(plan: FloorPlan, colors: Palette) -> None:
    """Place one or two desks, filing and roller-shutter cabinets, lockers, shelves."""
    rng = plan.rng
    desk = random_style(rng, colors, "office", "office", "paper", panels=("slab",))
    for index in range(integer(rng, 1, 2)):
        pose = plan.against(furniture.desk(rng, desk), stand=0.35, attempts=14)
        if index == 0:
            plan.need(pose)
    first = pick(rng, (furniture.filing, furniture.cupboard, furniture.roller))
    _need(plan, [first(rng, random_style(rng, colors, "office", "office"))])
    families = (furniture.filing, furniture.roller, furniture.lockers, furniture.cupboard)
    _more(plan, colors, (4, 8), (*families, storage.shelf, furniture.wall_cupboard), "office", "office")
    _finish(plan, (2, 6), ("plant", "box", "bag", "can", "chair", "tower"), (2, 7), work=True)


def study(plan: FloorPlan, colors: Palette) -> None:
    """Place a desk, shelves with inserts, a chest or a sideboard."""
    rng = plan.rng
    _need(plan, furniture.desk(rng, random_style(rng, colors, "office", "office", "paper")), 0.35)
    _need(plan, [storage.shelf(rng, random_style(rng, colors, "office", "living"))])
    families = (storage.shelf, storage.chest, storage.sideboard, furniture.cupboard, furniture.filing)
    _more(
        plan, colors, (3, 6), (*families, storage.vitrine, furniture.wall_cupboard, storage.trunk), "office", "living"
    )
    _finish(plan, (2, 6), ("plant", "box", "lamp", "can", "bag", "basket", "tower"), (1, 6), work=True)
    _rug(plan, colors, 0.4)


def workshop(plan: FloorPlan, colors: Palette) -> None:
    """Place a workbench, tool cabinets, lockers, wall cupboards, shelves with crates."""
    rng = plan.rng
    bench = random_style(rng, colors, "tools", "tools", "toiletries", panels=("slab",))
    _need(plan, furniture.desk(rng, bench, "workbench"), 0.35)
    _need(plan, [furniture.tool_cabinet(rng, bench)])
    families: tuple[Family, ...] = (furniture.tool_cabinet, furniture.lockers, furniture.wall_cupboard, storage.shelf)
    families += (furniture.cupboard, furniture.roller, storage.trunk)
    _more(plan, colors, (4, 8), families, "tools", "tools", "toiletries")
    _finish(plan, (1, 4), ("tools", "crate", "box", "can", "crate", "tools"), (3, 8), heater=False, work=True)


ROW_STAND = 1.05  # [m] Free floor before a fitted row
# What makes each base unit, and its width [m]
UNITS = {
    "drawers": (units.drawers, (0.4, 1.0)),
    "cupboard": (units.cupboard, (0.3, 0.9)),
    "sink": (units.sink_unit, (0.5, 0.9)),
    "oven": (units.oven, (0.595, 0.605)),
    "dishwasher": (units.dishwasher, (0.445, 0.605)),
}


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
    main = row(rng, kitchen, rng.uniform(min(2.6, 0.8 * longest), min(4.6, longest - 0.1)), True)
    _need(plan, main, ROW_STAND, 16, askew=0.3, gap=0.002)
    fridge = units.fridge(rng, random_style(rng, colors, "pantry", "nothing", "cutlery"))
    _need(plan, [fridge], ROW_STAND, askew=0.5, gap=0.02)
    if chance(rng, 0.7):
        plan.against(row(rng, kitchen, rng.uniform(1.0, 2.2), False), stand=ROW_STAND, askew=0.3, gap=0.002)
    if chance(rng, 0.4) and plan.room.size[0] * plan.room.size[1] > 14:
        plan.anywhere(units.island(rng, kitchen.sizes, base, rng.uniform(1.0, 1.8)), stand=ROW_STAND, attempts=40)
    if chance(rng, 0.35):
        tall = units.tall_unit(rng, rng.uniform(0.4, 0.62), kitchen.sizes, base)
        plan.against([tall], stand=ROW_STAND, askew=0.3, gap=0.002)
    if chance(rng, 0.5):
        plan.anywhere(furniture.dining(rng, random_style(rng, colors, "dishes", "dishes")), attempts=40)
    if chance(rng, 0.4):
        plan.against([storage.shelf(rng, random_style(rng, colors, "pantry", "kitchen", "cutlery"))], stand=ROW_STAND)
    if chance(rng, 0.7):
        plan.against([storage.bin_(rng)], askew=10, gap=0.04)
    _finish(plan, (1, 4), ("plant", "box", "chair", "basket"), (2, 6))


def row(rng: np.random.Generator, kitchen: KitchenStyle, length: float, main: bool) -> list[Piece]:
    """Return base units side by side under one worktop, things on it, wall units above: a group centred in y.

    `length`: at most [m]; `main`: It has the sink, the oven and the dishwasher.
    """
    kinds = _order(rng, length, main)
    widths = np.array([wide for _, wide in kinds])
    starts = np.cumsum([0.0, *widths]) - widths.sum() / 2
    middles = {name: float(start + wide / 2) for (name, wide), start in zip(kinds, starts, strict=False)}
    pieces = [
        UNITS[name][0](rng, wide, kitchen.sizes, kitchen.base).moved(at(0, start + wide / 2))
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
    chosen = [(name, rng.uniform(*UNITS[name][1])) for name in wanted]
    while True:
        name = pick(rng, ("drawers", "drawers", "cupboard"))
        wide = rng.uniform(*UNITS[name][1])
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
            pot = household.pot(rng.uniform(0.08, 0.11), rng.uniform(0.08, 0.14))
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
            wide = min(rng.uniform(0.3, 0.95), high - y)
            wide = high - y if high - y - wide < 0.3 and high - y < 1.0 else wide
            if chance(rng, 0.88):
                pieces.append(units.wall_unit(rng, wide, kitchen.sizes, kitchen.wall).moved(at(0, y + wide / 2)))
            y += wide
    return pieces
