"""Placement hints in words, parsed without a model: "put it next to the keyboard", "in the sink"."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

NEAR = ("next to", "beside", "near", "close to", "by", "left of", "right of", "behind", "in front of", "with")
CARRIED = {
    "on top of": "on",
    "onto": "on",
    "upon": "on",
    "on": "on",
    "inside": "in",
    "into": "in",
    "in": "in",
    "against": "against",
}
"""Prepositions and the relation to the carrier that follows; longer ones first, for "on" is in "on top of"."""
SAME = {
    "counter": ("kitchen counter", "countertop", "worktop", "base cabinet", "kitchen unit", "kitchen island", "counter top"),
    "shelf": ("bookshelf", "bookcase", "shelves", "wall shelf", "rack", "shelving unit", "shelf unit"),
    "bookshelf": ("bookcase", "shelf", "shelves"),
    "sink": ("washbasin", "wash basin", "basin", "bathroom sink", "kitchen sink"),
    "washbasin": ("sink", "basin", "wash basin"),
    "vanity": ("bathroom cabinet", "sink cabinet", "vanity unit", "washstand", "bathroom counter"),
    "bathtub": ("bath", "tub", "bath tub"),
    "shower": ("shower tray", "shower cabin", "shower floor"),
    "sofa": ("couch", "settee", "loveseat"),
    "nightstand": ("bedside table", "bedside cabinet", "night stand", "night table"),
    "bedside table": ("nightstand", "night table"),
    "tv stand": ("tv cabinet", "tv bench", "media console", "lowboard", "tv unit", "tv table"),
    "tv cabinet": ("tv stand", "lowboard"),
    "dresser": ("chest of drawers", "drawer chest", "commode", "sideboard"),
    "cabinet": ("cupboard", "storage cabinet", "sideboard", "filing cabinet", "file cabinet", "drawer cabinet"),
    "stove": ("hob", "cooktop", "oven", "cooker", "range"),
    "table": ("dining table", "side table", "kitchen table", "end table", "meeting table"),
    "desk": ("office desk", "writing desk", "workbench", "office table"),
    "windowsill": ("window sill", "window ledge"),
    "armchair": ("easy chair", "recliner"),
    "keyboard": ("computer keyboard",),
    "floor": ("ground",),
    "toilet": ("cistern", "toilet tank", "wc"),
    "fridge": ("refrigerator",),
    "wardrobe": ("closet",),
}  # fmt: skip
"""Synonyms."""


@dataclass(frozen=True)
class PlacementHint:
    """A parsed placement hint.

    Attributes:
        near: id of the requested neighbour, or None.
        choices: places that honour the hint, in the form of a plan; empty if it names no carrier in the room.
    """

    near: str | None
    choices: list[dict[str, Any]]


def parse_hint(hint: str, room: list[dict[str, Any]]) -> PlacementHint:
    """Parse a placement hint for a room, given by the lines of `s2a.insert.describe`."""
    words = " ".join(re.sub(r"[^a-z0-9_ ]", " ", hint.lower()).split())
    if not words:
        return PlacementHint(None, [])
    near = _named(words, NEAR, room)
    for word, relation in CARRIED.items():
        carrier = _named(words, (word,), room)
        if carrier:
            return PlacementHint(None if near is None else near["id"], _places(carrier, relation))
    if near is None:
        return PlacementHint(None, [])
    carrier = near.get("on")
    below = [line for line in room if line["id"] == carrier or (not carrier and line["label"] == "floor")]
    return PlacementHint(near["id"], _places(below[0], "on") if below else [])


def is_kind_of(label: str, noun: str) -> bool:
    """Return True if a label names this kind of object: "office desk" is a desk."""
    label = label.lower().replace("_", " ")
    return any(label == name or label.endswith(f" {name}") for name in (noun, *SAME.get(noun, ())))


def _named(words: str, before: tuple[str, ...], room: list[dict[str, Any]]) -> dict[str, Any] | None:
    """Return the line of the part that is named after one of some words, the one with the longest label."""
    found = []
    for line in room:
        names = {line["label"].lower(), line["id"].lower()}
        names |= {other for name in (line["label"].lower(),) for other in SAME.get(name, ())}
        hits = [
            name
            for name in names
            # Substring test first: compiling a pattern for every part took half a second.
            if name in words and re.search(rf"\b(?:{'|'.join(before)}) (?:the |a |an |my )?{re.escape(name)}\b", words)
        ]
        found += [(max(map(len, hits)), line)] if hits else []
    return max(found, key=lambda pair: pair[0])[1] if found else None


def _places(line: dict[str, Any], relation: str) -> list[dict[str, Any]]:
    """Return the choices that a part offers, the support with the most free area first."""
    supports = line.get("supports", [])
    if relation == "in":
        supports = [s for s in supports if s["kind"] != "horizontal"] or supports
    else:
        supports = [s for s in supports if s["kind"] == "horizontal"] or supports
    reason = "as wished"
    return [
        {
            "target": line["id"],
            "surface": "inside" if s["kind"] == "inside" else "horizontal",
            "relation": relation,
            "height": s["height"],
            "reason": reason,
        }
        for s in supports[:3]
    ]
