"""A wish in words -> relations between the object and things of the room -> places that honour it, without a model."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

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


WORDS = {
    "seen from": r"seen from",
    "left": r"(?:to the |on the )?left(?: hand)?(?: side)? of",
    "right": r"(?:to the |on the )?right(?: hand)?(?: side)? of",
    "between": r"(?:in )?between",
    "front": r"in front of|before",
    "behind": r"behind|in back of",
    "above": r"above|over",
    "below": r"below|beneath|under(?:neath)?",
    "back edge": r"(?:at|on|along|near) the (?:back|rear|far)(?: edge| side| end| border)? of|at the back of",
    "front edge": r"(?:at|on|along|near) the front(?: edge| side| end| border)? of",
    "corner": r"(?:in|at|on) (?:the|a|one) corner of",
    "middle": r"(?:in|at|on) the (?:very )?(?:middle|centre|center) of",
    "top": r"on the (?:top|upper|highest|uppermost|topmost) (?:shelf|board|compartment|level)(?: of)?",
    "bottom": r"on the (?:bottom|lowest|lower|lowermost) (?:shelf|board|compartment|level)(?: of)?",
    "away": r"(?:far )?away from|far from|not (?:near|next to|beside|by)",
    "near": r"(?:with)?in (?:easy |arm s )?reach of|reach(?:able)?(?: it| this)? from|"
    r"next to|beside|near(?: to)?|close to|by|alongside|adjacent to|with|at",
    "against": r"against|leaning (?:against|on|at)",
    "in": r"inside(?: of)?|within|into|in",
    "on": r"on top of|onto|upon|atop|on",
}
"""Relations and the words for them; an earlier one is taken where several begin at the same place."""
HEIGHT = re.compile(r"\b(?:at )?(\d+(?:\.\d+)?) ?(m|cm|metres?|meters?)\b(?: high| above the floor| up| height)?")
EYE = re.compile(r"\bat eye (?:level|height)\b")
ARTICLE = r"(?:(?:the|a|an|my|your|our|this|that|one of the|some) )?"
STOPS = frozenset("and but so where which that please with facing then not if or to the a an at from its".split())
"""Words at which the name of a thing ends."""
NOWHERE = frozenset(
    "room kitchen office bathroom bedroom house home flat way air middle centre center corner side hand place spot left "
    "right top bottom front back reach sight view people person someone lid handle it them all".split()
)
"""Words after a preposition that name no thing."""
AFTER = frozenset(
    "please there here today now somewhere wherever anywhere again instead too as for like when while because though so far "
    "left right close well facing standing ok thanks thank you i we you he she they is are was will can could would should "
    "only just one ones high up down out".split()
)
"""Words after a name with which something else begins."""
SEEN = re.compile(
    r"\b(?:(?:be )?(?:seen|watched) (?:by|from)|visible (?:to|for|from)|in (?:full |plain )?(?:sight|view) (?:of|from)|"
    r"greets?|welcomes?|look(?:ing|s)? at)"
    r"(?: (?:people|those|persons?|guests|visitors|whoever|who|anybody|anyone|everybody|everyone|somebody|someone|me|us))?"
    r"(?: (?:who|that))?(?: (?:is|are|am))?(?: (?:sit|sits|sitting|lie|lies|lying|stand|stands|standing|sleep|sleeps|sleeping))?"
    r"(?: (?:on|in|at|by|from|before))?(?= (?:the|a|an|my|your|our) )"
)
"""Of what is seen from somewhere, in other words, up to the name of that."""
PEOPLE = re.compile(r"\b(?:who|whoever|whom)\b[^;]*")
"""What people do else says nothing of where the object is: "for those who like to sit on the couch"."""
NOT = re.compile(r"\b(?:not|never|don t put it|do not put it)(?: \w+){0,2}$")


@dataclass(frozen=True)
class Relation:
    """A relation of a wish.

    Attributes:
        kind: of `WORDS`, or "floor", "wall" or "height".
        part_ids: for each name in it, the ids of the parts that it may mean; empty for what has no name.
        words: as it was said.
        height: of the middle of the object above the floor [m], for kind "height".
        negated: True for "not on the floor".
    """

    kind: str
    part_ids: tuple[tuple[str, ...], ...]
    words: str
    height: float | None = None
    negated: bool = False


@dataclass(frozen=True)
class Wish:
    """A parsed wish.

    Attributes:
        relations: what was understood; empty if nothing was.
        missing: names of things that are not in the room.
    """

    relations: tuple[Relation, ...] = ()
    missing: tuple[str, ...] = ()


def parse_wish(text: str, labels: Mapping[str, str]) -> Wish:
    """Parse a wish for a room, given by the label of each part id."""
    words = " ".join(re.sub(r"[^a-z0-9_. ]", " ", text.lower()).replace(". ", " ; ").split()).rstrip(".")
    words = PEOPLE.sub(" ", SEEN.sub("seen from", words))
    relations, missing, at = _heights(words), [], 0
    pattern = re.compile("|".join(f"(?P<k{n}>\\b(?:{words})\\b)" for n, words in enumerate(WORDS.values())))
    while match := pattern.search(words, at):
        kind = list(WORDS)[int(str(match.lastgroup)[1:])]
        at = match.end()
        rest = words[at:].lstrip()
        names = _names(rest, kind == "between")
        meant = [_meant(name, labels) for name, _ in names]
        ids = [some for some, _ in meant]
        negated = bool(NOT.search(words[: match.start()].rstrip()))
        if kind in ("top", "bottom") and (not names or not ids[0]):
            # "on the top shelf": of whatever has shelves
            meant = [_meant("shelf", labels)]
            ids, names = [meant[0][0]], [("shelf", 0)]
            missing += [] if ids[0] else ["shelf"]
        if names and all(ids):
            phrase = f"{match[0]} {' and '.join(name for name, _ in names)}"
            relations.append(_relation(kind, ids, phrase, labels, negated))
            end, after = names[-1][1], meant[-1][1]
            at += len(words[at:]) - len(rest) + max(0, end - after)
        elif names and not negated and kind != "away":
            missing += [name for (name, _), some in zip(names, ids, strict=True) if not some and _a_thing(name, rest)]
    if re.search(r"\bhang(?:ing|s)?\b", words) and not any(one.kind == "wall" for one in relations):
        walls = tuple(part_id for part_id, label in labels.items() if label.lower().endswith("wall"))
        relations.append(Relation("wall", (walls,), "hanging"))
    return Wish(tuple(relations), tuple(dict.fromkeys(missing)))


def _relation(kind: str, ids: list[tuple[str, ...]], words: str, labels: Mapping[str, str], negated: bool) -> Relation:
    """Return a relation; what is on the floor or a wall has a kind of its own."""
    label = labels[ids[0][0]].lower()
    if kind in ("on", "in", "against") and label.endswith("wall") and kind != "against":
        kind = "wall"
    return Relation(kind, tuple(ids), words, None, negated)


def _heights(words: str) -> list[Relation]:
    """Return the heights that a wish names."""
    heights = [
        Relation("height", (), one[0], float(one[1]) / (100 if one[2] == "cm" else 1)) for one in HEIGHT.finditer(words)
    ]
    return heights + [Relation("height", (), one[0], 1.55) for one in EYE.finditer(words)]


def _names(rest: str, two: bool) -> list[tuple[str, int]]:
    """Return the names of things at the begin of a text, with where each ends; two for "between ... and ..."."""
    names, at = [], 0
    for _ in range(2 if two else 1):
        one = re.match(rf"\s*(?:and )?{ARTICLE}((?:[a-z_]+[a-z0-9_]*\s*){{1,5}})", rest[at:])
        if not one:
            break
        noun: list[str] = []
        for word in one[1].split():
            if word in STOPS or (noun and any(re.fullmatch(words, word) for words in WORDS.values())):
                break
            noun.append(word)
        if not noun:
            break
        at += one.start(1) + len(" ".join(noun))
        names.append((" ".join(noun), at))
    return names


def _meant(name: str, labels: Mapping[str, str]) -> tuple[tuple[str, ...], int]:
    """Return the ids of the parts that a name means, and how many letters come after its last word.

    Its head noun is its last word, before what does not belong to it: the wall safe is no wall, and a bedside lamp is a lamp.
    """
    words = name.split()
    words = words[:1] + list(itertools.takewhile(lambda word: word not in AFTER and not word.endswith("ly"), words[1:]))
    noun = " ".join(words)
    for first in range(len(words)):
        ending = " ".join(words[first:])
        for forms in ((ending,), _singular(ending)):
            exact = tuple(i for i, label in labels.items() if i.lower() in forms or label.lower() in forms)
            alike = exact or tuple(i for i, label in labels.items() if any(_kind(label, form) for form in forms))
            if alike:
                return alike, len(name) - len(noun)
    return (), 0


def _singular(name: str) -> tuple[str, ...]:
    if name.endswith("shelves"):
        return (name[:-3] + "f",)
    return (name[:-2], name[:-1]) if name.endswith("es") else (name[:-1],) if name.endswith("s") else ()


def _kind(label: str, name: str) -> bool:
    """Return True if a label is of the kind that a name says: "office desk" is a desk, and a couch is a sofa."""
    label = label.lower().replace("_", " ")
    same = {name, *SAME.get(name, ()), *(key for key, others in SAME.items() if name in others)}
    return any(label == one or label.endswith(f" {one}") for one in same)


def _a_thing(name: str, rest: str) -> bool:
    """Return True if a name after a preposition names a thing: it has an article, and is not "the room"."""
    return bool(re.match(r"(?:the|a|an|my|your|our|this|that) ", rest)) and name.split()[0] not in NOWHERE


Line = dict[str, Any]
DIRECT = ("on", "in", "against", "top", "bottom", "back edge", "front edge", "corner", "middle")
"""Relations to what carries the object."""
BESIDE = ("near", "left", "right", "front", "behind", "between")
"""Relations to what stands on the same support."""


@dataclass(frozen=True)
class PlacementHint:
    """What a wish says about the place.

    Attributes:
        near: id of the requested neighbour, or None.
        choices: places that honour the wish, in the form of a plan; empty if it names no place in the room.
    """

    near: str | None
    choices: list[dict[str, Any]]


def parse_hint(hint: str, room: list[Line], hangs: bool = False) -> PlacementHint:
    """Parse a wish for a room, given by the lines of `s2a.language.insert.describe`; `hangs` is set for what usually hangs."""
    relations = [
        one for one in parse_wish(hint, {line["id"]: line["label"] for line in room}).relations if not one.negated
    ]
    lines = {line["id"]: line for line in room}
    beside = [one for one in relations if one.kind in (*BESIDE, "above", "below")]
    near = beside[0].part_ids[0][0] if beside else None
    choices: list[dict[str, Any]] = []
    for relation in sorted(relations, key=lambda one: (one.kind != "wall", one.kind not in DIRECT)):
        choices = choices or _choices(relation, lines, hangs)
    return PlacementHint(near, choices[:3])


def _choices(relation: Relation, lines: dict[str, Line], hangs: bool) -> list[dict[str, Any]]:
    """Return the choices for one relation, one part that it may mean after the other."""
    if relation.kind == "wall" or (relation.kind in ("above", "near", "left", "right", "height") and hangs):
        walls = [line for line in lines.values() if line["label"].lower().endswith("wall")]
        named = {part_id for ids in relation.part_ids for part_id in ids}
        if relation.kind != "wall" and named:
            walls.sort(key=lambda wall: min(_apart(wall, lines[part_id]) for part_id in named))
        elif named:
            walls = [wall for wall in walls if wall["id"] in named]
        hanging = {"surface": "vertical", "relation": "hanging", "height": None, "reason": "as wished"}
        return [{"target": wall["id"], **hanging} for wall in walls]
    choices: list[dict[str, Any]] = []
    for part_id in relation.part_ids[0] if relation.part_ids else ():
        line = lines.get(part_id)
        if line is None:
            continue
        if relation.kind in DIRECT:
            choices += [one for part in (line, *_covers(line, lines)) for one in _places(part, relation.kind)]
        elif relation.kind in BESIDE:
            choices += _places(_below(line, lines), "on")
        elif relation.kind == "seen from":
            choices += [one for other in _around(line, lines) for one in _places(other, "on")[:1]]
        elif relation.kind == "above":
            choices += [one for other in lines.values() if _over(other, line) for one in _places(other, "on")]
        elif relation.kind == "below":
            choices += _places(_below(line, lines), "on")
    return choices


def _around(line: Line, lines: dict[str, Line]) -> list[Line]:
    """Return what carries things near a thing, the nearest first; not the floor."""
    others = [o for o in lines.values() if "supports" in o and o["id"] != line["id"] and o["label"] != "floor"]
    return sorted(others, key=lambda other: _apart(other, line))


def _below(line: Line, lines: dict[str, Line]) -> Line:
    """Return the line of what a thing stands on: the floor, if that is not known, or what it is a part of."""
    if line.get("on") in lines:
        return lines[line["on"]]
    if line.get("part_of") in lines and "supports" in lines[line["part_of"]]:
        return lines[line["part_of"]]
    around = [other for other in lines.values() if _holds(other, line)]
    if around:
        return min(around, key=lambda other: (_apart(other, line), other["size"][0] * other["size"][1]))
    return next((other for other in lines.values() if other["label"] == "floor"), line)


def _covers(line: Line, lines: dict[str, Line]) -> list[Line]:
    """Return what covers a part and carries things in its stead: the blanket of a bed."""
    if not is_kind_of(line["label"], "bed"):
        return []
    bedding = [other for other in lines.values() if other["label"].lower() in BEDDING and "supports" in other]
    return [other for other in bedding if other.get("on") == line["id"] or _apart(other, line) == 0.0]


def _holds(line: Line, thing: Line) -> bool:
    """Return True if a thing is let into a part or in a row with it: a sink and its counter. Boxes may be turned."""
    if (
        line["id"] == thing["id"]
        or line["label"] == "floor"
        or not ("supports" in line and "size" in line and "size" in thing)
    ):
        return False
    top = thing["center"][2] + thing["size"][2] / 2
    near = min(abs(s["height"] - top) for s in line["supports"])
    return bool(_apart(line, thing) < 0.05 and near < 0.3 and top > 0.3)


def _places(line: Line, kind: str) -> list[dict[str, Any]]:
    """Return the choices that a part offers, those of the wished kind alone, the most free area first."""
    supports = list(line.get("supports", []))
    if kind == "in":
        supports = [s for s in supports if s["kind"] != "horizontal"] or supports
    elif kind in ("top", "bottom"):
        supports.sort(key=lambda s: s["height"], reverse=kind == "top")
    else:
        supports = [s for s in supports if s["kind"] == "horizontal"] or supports
    how = kind if kind in ("in", "against") else "on"
    return [
        {
            "target": line["id"],
            "surface": "inside" if s["kind"] == "inside" else "horizontal",
            "relation": "in" if s["kind"] == "inside" and how == "on" else how,
            "height": s["height"],
            "reason": "as wished",
        }
        for s in supports[:3]
    ]


def _over(line: Line, thing: Line) -> bool:
    """Return True if a part carries things over another one."""
    if "supports" not in line or "size" not in thing or "size" not in line:
        return False
    off = np.abs(np.array(line["center"]) - thing["center"])[:2]
    reach = (np.array(line["size"]) + thing["size"])[:2] / 2
    top = thing["center"][2] + thing["size"][2] / 2
    return bool((off < reach).all() and max(s["height"] for s in line["supports"]) >= top - 0.01)


def _apart(line: Line, thing: Line) -> float:
    """Return the horizontal distance of the boxes of two parts [m]; 0 where it is not known."""
    if "size" not in line or "size" not in thing:
        return 0.0
    off = np.abs(np.array(line["center"]) - thing["center"])[:2]
    return float(np.linalg.norm(np.maximum(off - (np.array(line["size"]) + thing["size"])[:2] / 2, 0.0)))
