"""Fifty kinds of household objects that rooms are furnished with and that are not in the zoo, as untidy files.

Like the zoo's they have any unit, up axis, heading, origin and format. None was looked at when the table of the rules was written
or extended.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from twelve_at_once import CATEGORY

from s2a.homes import clutter, household, kitchen, objects
from s2a.homes.objects import pillow
from s2a.homes.solids import Piece, Surface, join
from s2a.homes.zoo.download import UNITS, WRITERS, Download, download
from s2a.homes.zoo.shapes import ZooObject

CREAM = (230, 220, 200)
Sampler = Callable[[np.random.Generator], Piece]
KINDS: dict[str, list[tuple[str, str, Sampler]]] = {
    "kitchen": [
        ("bread bin", "on", household.bread_bin),
        ("jar of jam", "on", household.jar),
        ("bottle of olive oil", "on", lambda rng: household.bottle(rng, 0.29)),
        ("mixing bowl", "on", lambda rng: household.bowl(float(rng.uniform(0.1, 0.13)), CREAM)),
        ("saucepan", "on", lambda rng: household.pot(float(rng.uniform(0.08, 0.11)), 0.11)),
        ("dinner plate", "on", lambda rng: household.plate(float(rng.uniform(0.12, 0.14)))),
        ("knife block", "on", lambda rng: household.knife_block()),
        ("roll of kitchen paper", "on", lambda rng: household.paper_roll(0.06, 0.25, "paper roll")),
        ("dish rack", "on", lambda rng: household.dish_rack()),
        ("microwave oven", "on", kitchen.microwave),
    ],
    "bathroom": [
        ("cup with toothbrushes", "on", household.toothbrush_cup),
        ("box of tissues", "on", household.tissue_box),
        ("stack of towels", "on", lambda rng: household.towel_stack(rng, 3)),
        ("shower gel", "on", lambda rng: household.bottle(rng, 0.2)),
        ("wall lamp", "hanging", lambda rng: household.wall_lamp(0.4)),
        ("stool", "on", lambda rng: household.stool()),
        ("pedal bin", "on", lambda rng: household.lidded_bin(0.11, 0.28, CREAM)),
        ("bathroom mirror", "hanging", lambda rng: objects.mirror(0.45, 0.6)),
        ("scented candle", "on", lambda rng: objects.candle(0.1)),
        ("wicker laundry basket", "on", household.laundry_basket),
    ],
    "office": [
        ("computer monitor", "on", lambda rng: objects.monitor()),
        ("keyboard", "on", lambda rng: objects.keyboard()),
        ("computer mouse", "on", lambda rng: objects.mouse()),
        ("mug", "on", objects.cup),
        ("desk lamp", "on", lambda rng: objects.table_lamp()),
        ("waste paper basket", "on", lambda rng: objects.trash_can()),
        ("potted plant", "on", lambda rng: objects.plant(rng, float(rng.uniform(0.25, 0.4)))),
        ("cardboard box", "on", lambda rng: objects.carton((0.4, 0.3, 0.3))),
        ("stack of paper", "on", objects.paper_stack),
        ("whiteboard", "hanging", lambda rng: objects.whiteboard(0.9, 0.6)),
    ],
    "living_room": [
        ("television", "on", lambda rng: objects.tv(0.8)),
        ("game console", "on", objects.console),
        ("remote control", "on", lambda rng: objects.remote_control()),
        ("flower vase", "on", lambda rng: objects.vase(rng, 0.28)),
        ("bowl of fruit", "on", objects.bowl),
        ("candle", "on", lambda rng: objects.candle(0.14)),
        ("loudspeaker", "on", lambda rng: objects.speaker(0.18, 0.3)),
        ("floor lamp", "on", lambda rng: objects.floor_lamp()),
        ("wicker basket", "on", lambda rng: objects.basket(0.17, 0.22)),
        ("picture", "hanging", lambda rng: objects.picture(rng, 0.6, 0.4)),
    ],
    "bedroom": [
        ("cushion", "on", lambda rng: pillow((0.45, 0.45, 0.14), CREAM)),
        ("table clock", "on", lambda rng: objects.alarm_clock()),
        ("framed photo", "on", objects.photo),
        ("notebook", "on", clutter.notebook),
        ("paperback", "on", lambda rng: objects.book(rng, standing=False)[0]),
        ("table lamp", "on", lambda rng: objects.table_lamp()),
        ("tissue box", "on", household.tissue_box),
        ("house slippers", "on", objects.slippers),
        ("backpack", "on", objects.bag),
        ("glass vase", "on", lambda rng: objects.vase(rng, 0.22)),
    ],
}
"""Label, placement in truth and what makes it, by the room it goes to."""


def other_objects(folder: Path, seed: int, draws: int) -> dict[str, list[tuple[Path, dict]]]:
    """Write the objects' files; return path and truth of each, by room: every kind once a draw, draws side by side."""
    rng = np.random.default_rng(seed)
    made = [(room, _object(*kind, room, rng)) for _ in range(draws) for room in KINDS for kind in KINDS[room]]
    found: dict[str, list[tuple[Path, dict]]] = {room: [] for room in KINDS}
    for number, ((room, _), item) in enumerate(zip(made, download([item for _, item in made], rng), strict=True)):
        path = folder / f"{number:03d}" / item.file
        path.parent.mkdir(parents=True, exist_ok=True)
        WRITERS[item.form][1](path, item.mesh(rng), UNITS[item.unit], item.up)
        found[room].append((path, _truth(item)))
    return {room: [own for pair in _pairs(items, draws) for own in pair] for room, items in found.items()}


def _pairs(items: list, draws: int) -> list[list]:
    """Return the draws of each kind next to each other."""
    kinds = len(items) // draws
    return [items[kind::kinds] for kind in range(kinds)]


def _object(label: str, placement: str, draw: Sampler, room: str, rng: np.random.Generator) -> ZooObject:
    """Return one object, on z = 0."""
    surface = _whole(draw(rng))
    surface.vertices[:, 2] -= surface.vertices[:, 2].min()
    return ZooObject(label, CATEGORY[room], surface, placement, False)


def _whole(piece: Piece) -> Surface:
    """Return the surfaces of a piece, its parts and what lies in it."""
    return join(piece.surface, *(_whole(part) for part in (*piece.children, *piece.contents)))


def _truth(item: Download) -> dict:
    return item.truth(np.ptp(item.object.surface.vertices, axis=0))
