"""Kitchens: fitted rows, a row that turns the corner, an island, a table."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from s2a.homes import clutter, household, styles
from s2a.homes.clutter import Board
from s2a.homes.draw import chance, integer, pick, uniform
from s2a.homes.families import beds, storage
from s2a.homes.families import kitchen as units
from s2a.homes.families.kitchen import Fitted, fitted
from s2a.homes.floor_plan import FloorPlan
from s2a.homes.furnishing import common
from s2a.homes.solids import Piece, at
from s2a.homes.styles import Palette, Style

STAND = 1.05
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
    base = styles.style(rng, colors, "pantry", "nothing", "cutlery", panels=("slab", "framed", "grooved", "slab"))
    kitchen = KitchenStyle(
        fitted(rng),
        base,
        base if chance(rng, 0.6) else styles.style(rng, colors, "kitchen", panels=("slab", "glazed", "framed")),
    )
    # Doors of wall units stop at the hood, which is deeper than they are.
    kitchen = replace(kitchen, wall=replace(kitchen.wall, angle=min(kitchen.wall.angle, 1.5)))
    longest = max(side.length for side in plan.room.sides)
    plan.need(
        plan.against(
            row(rng, kitchen, uniform(rng, (min(2.6, 0.8 * longest), min(4.6, longest - 0.1))), True),
            stand=STAND,
            attempts=16,
            askew=0.3,
            gap=0.002,
        )
    )
    fridge = units.fridge(rng, styles.style(rng, colors, "pantry", "nothing", "cutlery"))
    plan.need(plan.against([fridge], stand=STAND, askew=0.5, gap=0.02, attempts=14))
    if chance(rng, 0.7):
        plan.against(row(rng, kitchen, uniform(rng, (1.0, 2.2)), False), stand=STAND, askew=0.3, gap=0.002)
    if chance(rng, 0.4) and plan.room.size[0] * plan.room.size[1] > 14:
        plan.anywhere(units.island(rng, kitchen.sizes, base, uniform(rng, (1.0, 1.8))), stand=STAND, attempts=40)
    if chance(rng, 0.35):
        plan.against(
            [units.tall_unit(rng, uniform(rng, (0.4, 0.62)), kitchen.sizes, base)], stand=STAND, askew=0.3, gap=0.002
        )
    if chance(rng, 0.5):
        plan.anywhere(beds.dining(rng, styles.style(rng, colors, "dishes", "dishes")), attempts=40)
    if chance(rng, 0.4):
        plan.against([storage.shelf(rng, styles.style(rng, colors, "pantry", "kitchen", "cutlery"))], stand=STAND)
    if chance(rng, 0.7):
        plan.against([storage.bin_(rng)], askew=10, gap=0.04)
    common.heater(plan)
    common.hang(plan, integer(rng, 1, 4))
    common.floor_objects(plan, ("plant", "box", "chair", "basket"), integer(rng, 2, 6))


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
