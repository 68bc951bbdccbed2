"""Names of the things in rooms."""

from __future__ import annotations

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
    "tv": ("television", "tv set", "television set", "flat screen", "screen"),
    "monitor": ("screen", "display", "computer screen", "computer monitor"),
    "microwave": ("microwave oven",),
    "floor": ("ground",),
    "toilet": ("cistern", "toilet tank", "wc"),
    "fridge": ("refrigerator",),
    "wardrobe": ("closet",),
}  # fmt: skip
"""Synonyms."""

BEDDING = ("blanket", "duvet", "mattress", "bedspread", "quilt")
"""What covers a bed."""


def is_kind_of(label: str, noun: str) -> bool:
    """Return True if a label names this kind of object: "office desk" is a desk."""
    label = label.lower().replace("_", " ")
    return any(label == name or label.endswith(f" {name}") for name in (noun, *SAME.get(noun, ())))
