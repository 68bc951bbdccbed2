"""Living rooms, dining rooms and hallways."""

from __future__ import annotations

import numpy as np

from s2a.homes import cloth, decor, soft_furniture, styles
from s2a.homes.draw import chance, integer, pick, uniform
from s2a.homes.families import beds, lids, storage
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
    families = (storage.sideboard, storage.vitrine, storage.shelf, storage.chest, storage.sideboard, lids.trunk)
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
        chair = soft_furniture.armchair(styles.palette(rng).cloth).moved(at(0.9, 0))
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
    families = (storage.hall_cabinet, storage.wardrobe, lids.trunk, storage.chest, storage.shelf, storage.nightstand)
    for _ in range(integer(rng, 2, 5)):
        plan.against([pick(rng, families)(rng, styles.style(rng, colors, "shoes", "living", "linen"))], stand=0.85)
    common.hang(plan, integer(rng, 2, 6))
    common.floor_objects(plan, ("shoes", "bag", "plant", "box", "shoes"), integer(rng, 2, 6))
