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
from s2a.homes.fronts import TOP, cabinet_body, hinged, lid, open_box, panel
from s2a.homes.grips import QUARTER, bar, knob
from s2a.homes.household import BLACK as DARK
from s2a.homes.household import CHROME, pipe, plate
from s2a.homes.household import WHITE as IVORY
from s2a.homes.objects import BLACK, SPINES, STEEL, pillow
from s2a.homes.solids import FABRIC, WOOD, Color, Piece, Surface, at, box, cylinder, join, lathe, rotation
from s2a.homes.zoo.download import UNITS, WRITERS, Download, download
from s2a.homes.zoo.shapes import ZooObject


def bread_bin(rng: np.random.Generator) -> Piece:
    """Return a bread bin, 0.38 m wide; its front lifts up about its upper edge by a knob."""
    color = (178, 60, 48) if rng.uniform() < 0.5 else (90, 120, 130)
    deep, wide, high = 0.25, 0.38, 0.2
    body = join(*(board.moved(at(deep - 0.012, 0)) for board in cabinet_body((deep - 0.012, wide, high), 0.01, color)))
    leaf = hinged(
        "lid", panel((0.01, wide - 0.004, high - 0.006), color), TOP, knob(0.014, 0.026).moved(at(0, 0, -0.05))
    )
    return Piece("bread bin", body, (leaf.moved(at(deep, 0, high / 2)),))


def lidded_bin(radius: float, height: float, color: Color) -> Piece:
    """Return a round waste bin with a hinged lid and a pedal; its back is at x = -radius."""
    wall = 0.006
    body = lathe(
        [(0, 0), (radius, 0), (radius, height), (radius - wall, height), (radius - wall, wall), (0, wall)], color
    )
    pedal = box((radius - 0.01, radius + 0.04), (-0.03, 0.03), (0.01, 0.022), DARK)
    cover = lathe([(0, -0.03), (radius, -0.03), (radius, -0.012), (0.8 * radius, 0), (0, 0)], color)
    return Piece("trash can", join(body, pedal), (lid("trash can lid", cover).moved(at(0, 0, height + 0.032)),))


def laundry_basket(rng: np.random.Generator) -> Piece:
    """Return a wicker basket, 0.42 m wide and 0.62 m high, whose lid opens up by a bar; its back is at x = -0.17."""
    size = (0.34, 0.42, 0.6)
    color = (188, 158, 116)
    slats = [
        box((0.17, 0.174), (-0.21, 0.21), (z, z + 0.04), (160, 130, 92), FABRIC) for z in np.arange(0.05, 0.55, 0.1)
    ]
    grip = bar(0.12, 0.014, 0.012, 0.024, 0.012, DARK).moved(at(0, 0, -0.12))
    cover = box((-0.17, 0.17), (-0.21, 0.21), (-0.018, 0), color, WOOD)
    return Piece(
        "laundry basket",
        join(open_box(size, 0.012, color, FABRIC), *slats),
        (lid("lid", cover, grip).moved(at(0, 0, 0.621)),),
    )


def knife_block() -> Piece:
    """Return a slanted block with five knives in it."""
    block = box((-0.06, 0.06), (-0.05, 0.05), (0, 0.2), (120, 82, 50), WOOD)
    grips = [
        box((x, x + 0.02), (y, y + 0.014), (0.2, 0.29), DARK) for x in (-0.04, 0.015) for y in (-0.035, 0.0, 0.024)
    ]
    return Piece("knife block", join(block, *grips[:5]))


def paper_roll(radius: float, height: float, name: str) -> Piece:
    """Return an upright roll of paper on a foot with a rod through it."""
    foot, rod = cylinder(1.2 * radius, 0.012, CHROME), cylinder(0.008, height + 0.05, CHROME)
    return Piece(name, join(foot, rod, cylinder(radius, height, IVORY, FABRIC).moved(at(0, 0, 0.013))))


def dish_rack() -> Piece:
    """Return a draining rack with four plates in it."""
    rods = [pipe([(-0.15, y, z), (0.15, y, z)], 0.005, CHROME, 8) for y in (-0.17, 0.17) for z in (0.015, 0.1)] + [
        pipe([(x, -0.17, 0.015), (x, 0.17, 0.015)], 0.005, CHROME, 8) for x in (-0.15, -0.075, 0.0, 0.075, 0.15)
    ]
    posts = [pipe([(x, y, 0), (x, y, 0.1)], 0.005, CHROME, 8) for x in (-0.15, 0.15) for y in (-0.17, 0.17)]
    upright = rotation((QUARTER - 0.15, 0.0, 0.0))
    plates = [plate(0.11).surface.moved(at(0, y, 0.128) @ upright) for y in (-0.12, -0.06, 0.0, 0.06)]
    return Piece("dish rack", join(*rods, *posts, *plates))


def wall_lamp(width: float) -> Piece:
    """Return a lamp, long along y, on a plate at the wall x = 0."""
    tube = cylinder(0.03, width, (250, 248, 238)).moved(at(0.08, -width / 2) @ rotation((-QUARTER, 0, 0)))
    return Piece(
        "wall lamp",
        join(
            box((0, 0.02), (-0.06, 0.06), (-0.03, 0.03), CHROME),
            tube,
            box((0.02, 0.06), (-0.02, 0.02), (-0.01, 0.01), CHROME),
        ),
    )


def table_lamp() -> Piece:
    """Return a desk lamp with a cone-shaped shade."""
    shade = lathe([(0.11, 0.3), (0.06, 0.44), (0.05, 0.44), (0.1, 0.3), (0.11, 0.3)], (236, 214, 160))
    return Piece(
        "table lamp", join(cylinder(0.08, 0.02, STEEL), cylinder(0.009, 0.42, STEEL).moved(at(0, 0, 0.02)), shade)
    )


def speaker(width: float, height: float) -> Piece:
    """Return a loudspeaker box, 1.3 times as deep as wide, with two round membranes; its front is at x = 0."""
    case = box((-1.3 * width, 0), (-width / 2, width / 2), (0, height), (64, 50, 42), WOOD)
    disks = [
        cylinder(r * width, 0.006, BLACK).moved(at(0, 0, z) @ rotation((0, QUARTER, 0)))
        for r, z in ((0.38, height - 0.65 * width), (0.2, height - 0.2 * width))
    ]
    return Piece("speaker", join(case, *disks))


def console(rng: np.random.Generator) -> Piece:
    """Return a game console or receiver, 0.3 m wide."""
    tone = int(rng.integers(30, 70))
    case = box((-0.24, 0), (-0.15, 0.15), (0.006, 0.06), (tone, tone, tone + 4))
    feet = box((-0.2, -0.04), (-0.12, 0.12), (0, 0.006), BLACK)
    return Piece("game console", join(case, feet, box((0, 0.002), (-0.12, 0.0), (0.03, 0.036), STEEL)))


def remote_control() -> Piece:
    """Return a remote control, long along x."""
    keys = [
        box((x, x + 0.008), (y - 0.004, y + 0.004), (0.016, 0.019), (150, 150, 154))
        for x in np.arange(-0.06, 0.06, 0.02)
        for y in (-0.01, 0.01)
    ]
    return Piece("remote control", join(box((-0.09, 0.09), (-0.022, 0.022), (0, 0.016), BLACK), *keys))


def vase(rng: np.random.Generator, height: float) -> Piece:
    """Return a vase with a few dry twigs."""
    r, color = 0.28 * height, SPINES[rng.integers(len(SPINES))]
    profile = [
        (0, 0),
        (0.5 * r, 0),
        (r, 0.4),
        (0.35 * r, 0.85),
        (0.5 * r, 1.0),
        (0.4 * r, 1.0),
        (0.2 * r, 0.8),
        (0, 0.8),
    ]
    body = lathe([(radius, z * height) for radius, z in profile], color)
    twigs = [
        cylinder(0.004, 0.9 * height, (132, 100, 66), sides=8).moved(
            at(0, 0, 0.8 * height, 72 * i) @ rotation((0, rng.uniform(0.1, 0.4), 0))
        )
        for i in range(5)
    ]
    return Piece("vase", join(body, *twigs))


def basket(radius: float, height: float) -> Piece:
    """Return an open wicker basket."""
    profile = [
        (0, 0),
        (0.8 * radius, 0),
        (radius, height),
        (radius - 0.012, height),
        (0.8 * radius - 0.01, 0.01),
        (0, 0.01),
    ]
    return Piece("laundry basket", lathe(profile, (176, 144, 98), FABRIC))


CREAM = (230, 220, 200)
Sampler = Callable[[np.random.Generator], Piece]
KINDS: dict[str, list[tuple[str, str, Sampler]]] = {
    "kitchen": [
        ("bread bin", "on", bread_bin),
        ("jar of jam", "on", household.jar),
        ("bottle of olive oil", "on", lambda rng: household.bottle(rng, 0.29)),
        ("mixing bowl", "on", lambda rng: household.bowl(float(rng.uniform(0.1, 0.13)), CREAM)),
        ("saucepan", "on", lambda rng: household.pot(float(rng.uniform(0.08, 0.11)), 0.11)),
        ("dinner plate", "on", lambda rng: household.plate(float(rng.uniform(0.12, 0.14)))),
        ("knife block", "on", lambda rng: knife_block()),
        ("roll of kitchen paper", "on", lambda rng: paper_roll(0.06, 0.25, "paper roll")),
        ("dish rack", "on", lambda rng: dish_rack()),
        ("microwave oven", "on", kitchen.microwave),
    ],
    "bathroom": [
        ("cup with toothbrushes", "on", household.toothbrush_cup),
        ("box of tissues", "on", household.tissue_box),
        ("stack of towels", "on", lambda rng: household.towel_stack(rng, 3)),
        ("shower gel", "on", lambda rng: household.bottle(rng, 0.2)),
        ("wall lamp", "hanging", lambda rng: wall_lamp(0.4)),
        ("stool", "on", lambda rng: household.stool()),
        ("pedal bin", "on", lambda rng: lidded_bin(0.11, 0.28, CREAM)),
        ("bathroom mirror", "hanging", lambda rng: objects.mirror(0.45, 0.6)),
        ("scented candle", "on", lambda rng: objects.candle(0.1)),
        ("wicker laundry basket", "on", laundry_basket),
    ],
    "office": [
        ("computer monitor", "on", lambda rng: objects.monitor()),
        ("keyboard", "on", lambda rng: objects.keyboard()),
        ("computer mouse", "on", lambda rng: objects.mouse()),
        ("mug", "on", objects.cup),
        ("desk lamp", "on", lambda rng: table_lamp()),
        ("waste paper basket", "on", lambda rng: objects.trash_can()),
        ("potted plant", "on", lambda rng: objects.plant(rng, float(rng.uniform(0.25, 0.4)))),
        ("cardboard box", "on", lambda rng: objects.carton((0.4, 0.3, 0.3))),
        ("stack of paper", "on", objects.paper_stack),
        ("whiteboard", "hanging", lambda rng: objects.whiteboard(0.9, 0.6)),
    ],
    "living_room": [
        ("television", "on", lambda rng: objects.tv(0.8)),
        ("game console", "on", console),
        ("remote control", "on", lambda rng: remote_control()),
        ("flower vase", "on", lambda rng: vase(rng, 0.28)),
        ("bowl of fruit", "on", objects.bowl),
        ("candle", "on", lambda rng: objects.candle(0.14)),
        ("loudspeaker", "on", lambda rng: speaker(0.18, 0.3)),
        ("floor lamp", "on", lambda rng: objects.floor_lamp()),
        ("wicker basket", "on", lambda rng: basket(0.17, 0.22)),
        ("picture", "hanging", lambda rng: objects.picture(rng, 0.6, 0.4)),
    ],
    "bedroom": [
        ("cushion", "on", lambda rng: pillow((0.45, 0.45, 0.14), CREAM)),
        ("table clock", "on", lambda rng: objects.alarm_clock()),
        ("framed photo", "on", objects.photo),
        ("notebook", "on", clutter.notebook),
        ("paperback", "on", lambda rng: objects.book(rng, standing=False)[0]),
        ("table lamp", "on", lambda rng: table_lamp()),
        ("tissue box", "on", household.tissue_box),
        ("house slippers", "on", objects.slippers),
        ("backpack", "on", objects.bag),
        ("glass vase", "on", lambda rng: vase(rng, 0.22)),
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
