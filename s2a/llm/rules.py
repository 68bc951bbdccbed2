"""The rule-based fallback: answers the questions for models from a table of usual places and sizes.

`rules.csv` has one kind of object per line: name, synonyms, ranges of height and longest side [cm] that hold for nine of ten,
and places, best first: "on desk", "in sink" (a basin), "inside shelf" (a compartment), "against wall" (on the floor before
it), "hanging wall". `brands.csv` maps brands to kinds. Both were written from memory before any test object was seen.
"""

from __future__ import annotations

import csv
import difflib
import json
import math
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from s2a.insert.axes import AXES, sideways
from s2a.insert.hints import is_kind_of
from s2a.insert.placement import Placement
from s2a.insert.scale import FLAT, Range
from s2a.insert.script import write_script
from s2a.insert.wishes.choices import parse_hint
from s2a.llm.ask import Answer, Request

FOLDER = Path(__file__).parent
LIKE = 0.86
"""Similarity (difflib's ratio) from which a word is a misspelling of another."""
UNKNOWN_HEIGHT, UNKNOWN_LONGEST = (0.03, 0.35), (0.06, 0.4)
"""Ranges for unknown objects [m]: hand-held."""
FIRM = 0.15
"""Tilt margin, as a fraction of a right angle, beyond which more does not matter: a bottle has 0.1, a cube 0.5."""
ANYWHERE = ("on table", "on desk", "on counter", "on shelf", "inside shelf", "on cabinet", "on nightstand", "on floor")
"""Places for unknown objects, and for those none of whose places exist in the room."""


@dataclass(frozen=True)
class ObjectKind:
    """A kind of object.

    Attributes:
        noun: its name.
        names: its name and synonyms.
        height: min and max [m].
        longest: min and max of the longest side [m].
        places: (relation, carrier), best first, such as ("on", "desk").
    """

    noun: str
    names: tuple[str, ...]
    height: Range
    longest: Range
    places: tuple[tuple[str, str], ...]


@cache
def table() -> tuple[ObjectKind, ...]:
    """Return the table."""
    with (FOLDER / "rules.csv").open(newline="") as file:
        return tuple(_entry(row) for row in csv.DictReader(file, delimiter=";"))


@cache
def brands() -> dict[str, str]:
    """Return the noun for each brand, by its lower-case name."""
    with (FOLDER / "brands.csv").open(newline="") as file:
        return {row["word"]: row["noun"] for row in csv.DictReader(file, delimiter=";")}


def rules(request: Request) -> Answer:
    """Answer a question from the table."""
    if request.step == "script":
        return Answer(write_script(_placement(request.facts)), "rules")
    entry = known(str(request.facts["label"]))
    said = _plan(request.facts, entry) if request.step == "plan" else _size(request.facts, entry)
    return Answer(json.dumps(said), "rules")


def known(label: str) -> ObjectKind | None:
    """Return the kind of a label: by a name equal to it, at its end or in it, by a brand, or by a misspelt name."""
    words = _words(label)
    names = {name: entry for entry in table() for name in entry.names}
    if words in names:
        return names[words]
    # Substring test first: compiling more than a thousand patterns took a quarter of a second.
    inside = [name for name in names if name in words and re.search(rf"\b{re.escape(name)}(e?s)?\b", words)]
    if inside:
        # The head noun comes last in English (but "mug with a flower"), and longer names are more specific.
        head = re.split(r"\b(?:with|of|for|from|in|and)\b", words)[0].strip()
        return names[max(inside, key=lambda name: (head.endswith((name, f"{name}s")), len(name)))]
    made = [brand for brand in brands() if brand in words and re.search(rf"\b{re.escape(brand)}", words)]
    if made:
        return names[brands()[max(made, key=len)]]
    close = difflib.get_close_matches(words, names, n=1, cutoff=LIKE)
    close = close or difflib.get_close_matches(words.split()[-1] if words else "", names, n=1, cutoff=LIKE)
    return names[close[0]] if close else None


def _words(label: str) -> str:
    """Return a label in lower case, its words separated by blanks, without version numbers."""
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", label)
    words = re.sub(r"[_\-/,.()]+", " ", words.lower()) if words.lower() not in brands() else words.lower()
    return " ".join(re.sub(r"\b(?:v?\d+\w*|lowpoly|low poly|3d|model|free|obj|glb|final|new)\b", " ", words).split())


def _entry(row: dict[str, str]) -> ObjectKind:
    names = (row["noun"], *filter(None, row["also"].split("|")))
    places = tuple((how, where) for how, _, where in (place.partition(" ") for place in row["places"].split("|")))
    return ObjectKind(row["noun"], names, _range(row["height_cm"]), _range(row["longest_cm"]), places)


def _range(text: str) -> Range:
    """Read centimetres, "7.5-12", as metres."""
    low, high = text.split("-")
    return float(low) / 100, float(high) / 100


def _size(facts: Any, entry: ObjectKind | None) -> dict[str, Any]:
    """Answer the question about the size."""
    height, longest = (entry.height, entry.longest) if entry else (UNKNOWN_HEIGHT, UNKNOWN_LONGEST)
    reason = "the table says so" if entry else "the table does not know it: something hand-held"
    noun = entry.noun if entry else str(facts["label"])[:60]
    return {"noun": noun, "height": height, "longest": longest, "unit": "unknown", "reason": reason}


def _plan(facts: Any, entry: ObjectKind | None) -> dict[str, Any]:
    """Answer the question about the place."""
    up = _up(facts, entry)
    hangs = bool(entry and entry.places[0][0] == "hanging")
    hint = parse_hint(facts.get("wish") or "", facts["room"], hangs)
    choices = hint.choices or _choices(facts["room"], entry.places if entry else (), _breadth(facts, entry, up))
    if up == facts.get("tried_up", up):
        choices = [one for one in choices if (one["target"], one["height"]) not in facts.get("tried", ())] or choices
    front = {"+z": "-y", "+y": "+z"}.get(up, sideways(up)[0])
    if choices and choices[0]["relation"] == "hanging":
        up, front = _flat(facts)
    return {"up": up, "front": front, "near": hint.near, "choices": choices[:3]}


def _breadth(facts: Any, entry: ObjectKind | None, up: str) -> float:
    """Estimate the width of an object's footprint [m]: the shorter of its horizontal sides."""
    low, high = entry.longest if entry else UNKNOWN_LONGEST
    level = [side for side, axis in zip(facts["sides"], "xyz", strict=True) if axis != up[1]]
    return math.sqrt(low * high) * min(level) / max(facts["sides"])


def _choices(room: list[dict[str, Any]], places: tuple[tuple[str, str], ...], breadth: float) -> list[dict[str, Any]]:
    """Return the places that exist in the room, those first whose free circle has the footprint's width [m]."""
    found: list[dict[str, Any]] = []
    for some in (places, tuple((how, where) for how, _, where in (place.partition(" ") for place in ANYWHERE))):
        own: list[dict[str, Any]] = []
        for how, where in some:
            lines = [line for line in room if is_kind_of(line["label"], where)]
            options = [option for line in lines for option in _options(line, how, room)]
            options.sort(key=lambda option: (option["circle"] < breadth, -option["free"]))
            own += [option for option in options[:1] if option not in own + found]
        found += sorted(own, key=lambda option: option["circle"] < breadth)
    return [{key: value for key, value in option.items() if key not in ("free", "circle")} for option in found]


def _options(line: dict[str, Any], how: str, room: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the choices that a part offers for a relation of the table, with their free area and free circle."""
    target = {"target": line["id"], "reason": f"the table says: {how} {line['label']}"}
    if how == "hanging" and "size" in line:
        high, wide = line["size"][2], max(line["size"][:2])
        free = {"free": high * wide, "circle": min(high, wide)}
        return [{**target, "surface": "vertical", "relation": "hanging", "height": None, **free}]
    if how == "against":
        floors = [other for other in room if other["label"] == "floor" and "supports" in other]
        against = {**target, "surface": "horizontal", "relation": "against", "height": None}
        return [{**against, "target": floor["id"], **_free(floor["supports"][0])} for floor in floors[:1]]
    kinds = {"on": ("horizontal",), "in": ("basin", "inside"), "inside": ("inside",)}.get(how, ())
    surface = {"horizontal": "horizontal", "basin": "horizontal", "inside": "inside"}
    relation = "on" if how == "on" else "in"
    return [
        {**target, "surface": surface[s["kind"]], "relation": relation, "height": s["height"], **_free(s)}
        for s in line.get("supports", ())
        if s["kind"] in kinds
    ]


def _free(support: dict[str, Any]) -> dict[str, float]:
    return {key: support[key] for key in ("free", "circle")}


def _up(facts: Any, entry: ObjectKind | None) -> str:
    """Return the up axis with the best tilt margin among those whose proportions match the table."""
    sides = dict(zip("xyz", facts["sides"], strict=True))
    longest = max(sides.values())

    def merit(axis: str) -> float:
        ratio, misfit = max(sides[axis[1]] / longest, FLAT), 1.0
        if entry:
            low, high = entry.height[0] / entry.longest[1], entry.height[1] / entry.longest[0]
            misfit = min(ratio / low, high / ratio, 1.0)
        # Containers have their opening up.
        mouth = 0.4 * (facts["hollow"].get(axis, 0.0) - facts["hollow"].get(_opposite(axis), 0.0))
        habit = {"+z": 0.1, "+y": 0.08, "+x": 0.04}.get(axis, 0.0) + (0.3 if axis == facts["up"] else 0.0)
        return (min(1.0, facts["feet"].get(axis, 0.0) / FIRM) + mouth) * misfit**2 + habit

    if facts.get("unstable"):
        # It did not stay: take the other axis on which it stands most firmly.
        return max((axis for axis in AXES if axis != facts["tried_up"]), key=lambda axis: facts["feet"].get(axis, 0.0))
    return max(AXES, key=merit)


def _opposite(axis: str) -> str:
    return axis.translate(str.maketrans("+-", "-+"))


def _flat(facts: Any) -> tuple[str, str]:
    """Return the up axis and the front of a hanging object: it faces along its thinnest side."""
    sides = dict(zip("xyz", facts["sides"], strict=True))
    thin = min(sides, key=sides.__getitem__)
    axes = [axis for axis in ("+z", "+y", "+x") if axis[1] != thin]
    up = facts["up"] if facts["up"] in axes else axes[0]
    return up, {"x": "+x", "y": "-y", "z": "+z"}[thin]


def _placement(facts: Any) -> Placement:
    """Read the placement from the facts of a script."""
    return Placement(
        facts["id"],
        facts["label"],
        facts["reference"],
        tuple(facts["translate"]),
        tuple(facts["orient"]),
        facts["scale"],
    )
