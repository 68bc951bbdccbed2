"""The rule-based fallback: answers to the questions for models, from a table of usual places and sizes."""

from __future__ import annotations

import csv
import difflib
import json
import math
import re
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from s2a.language.ask import Answer, Request
from s2a.language.grammar import BEDDING, MISSPELLED, is_kind_of
from s2a.language.insert.plan import CHOICES, FLAT, Range
from s2a.language.insert.prompts import write_script
from s2a.language.insert.stable_pose import AXES, sideways
from s2a.scan.rest import UNANNOTATED

FOLDER = Path(__file__).parent
BULK = frozenset(
    "cardboard storage shipping moving wooden wood plastic metal big large empty delivery parcel postal amazon file archive toy "
    "tool glass water wine beer ikea card board".split()
)
"""Words before "box" or "crate" that do not say what it holds; others are of goods, as shops sell them."""
GOODS = {"box": "grocery box", "carton": "grocery box", "package": "grocery box", "packet": "grocery box"}
"""Kinds of packages by their head noun, when a word before it says what is in them."""
MOUNTED = re.compile(r"\b(?:wall|wall mounted|hanging|framed|bathroom|hall|hallway)\b")
"""Words before a noun that say that it hangs, as mirrors and lamps do in bathrooms and halls."""
HANGING_SIZES: dict[str, tuple[Range, Range]] = {
    "mirror": ((0.5, 1.3), (0.5, 1.3)),
    "desk lamp": ((0.05, 0.3), (0.2, 0.6)),
}
"""Height and longest side [m] of what is larger or smaller where it hangs."""


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


def known(label: str) -> ObjectKind | None:
    """Return the kind of a label by its head noun, as what is before that noun says.

    A gelatin box is no cardboard box, and a wall mirror hangs.
    """
    kind, words = _by_noun(label), _words(label)
    if kind is None or words in kind.names:
        return kind
    before = words[: -len(words.split()[-1])].split() if words else []
    goods = GOODS.get(words.split()[-1]) if kind.noun == "box" else None
    if goods and before and not BULK & set(before):
        return next(entry for entry in table() if entry.noun == goods)
    mounted = MOUNTED.search(" ".join(before)) and kind.places[0][0] != "hanging"
    if not mounted or ("hanging" not in (how for how, _ in kind.places) and kind.noun not in HANGING_SIZES):
        return kind
    height, longest = HANGING_SIZES.get(kind.noun, (kind.height, kind.longest))
    return replace(kind, height=height, longest=longest, places=(("hanging", "wall"),))


def _by_noun(label: str) -> ObjectKind | None:
    """Return the kind of a label: by a name equal to it, at its end or in it, by a brand, or by a misspelt name."""
    words = _words(label)
    names = {name: entry for entry in table() for name in entry.names}
    if words in names:
        return names[words]
    for compound in _compounds(words):
        ends = [name for name in names if " " in name and (compound == name or compound.endswith(f" {name}"))]
        if ends:
            return names[max(ends, key=len)]
    # Substring test first: compiling more than a thousand patterns took a quarter of a second.
    inside = [name for name in names if name in words and re.search(rf"\b{re.escape(name)}(e?s)?\b", words)]
    if inside:
        # The head noun comes last in English (but "mug with a flower"), and longer names are more specific.
        head = re.split(r"\b(?:with|of|for|from|in|and)\b", words)[0].strip()
        return names[max(inside, key=lambda name: (head.endswith((name, f"{name}s")), len(name)))]
    made = [brand for brand in brands() if brand in words and re.search(rf"\b{re.escape(brand)}", words)]
    if made:
        return names[brands()[max(made, key=len)]]
    close = difflib.get_close_matches(words, names, n=1, cutoff=MISSPELLED)
    close = close or difflib.get_close_matches(words.split()[-1] if words else "", names, n=1, cutoff=MISSPELLED)
    return names[close[0]] if close else None


def _compounds(words: str) -> list[str]:
    """Return the compounds that a phrase may stand for: a glass of wine is a wine glass, soap in a dish fills a soap dish."""
    compounds = []
    if match := re.fullmatch(r"(.+) (?:in|on) an? (\w+)", words):
        compounds.append(f"{match[1]} {match[2]}")
    if match := re.fullmatch(r"(?:an? )?(\w+) of (.+?)(?: (?:with|in|on|for)\b.*)?", words):
        compounds.append(f"{match[2]} {match[1]}")
    return compounds


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


UNKNOWN_HEIGHT, UNKNOWN_LONGEST = (0.03, 0.35), (0.06, 0.4)
"""Ranges for unknown objects [m]: hand-held."""
FIRM = 0.08
"""Tilt margin, as a fraction of a right angle, beyond which more does not matter: a bottle has 0.1, a cube 0.5."""
FIRMER, FIRMEST = 0.6, 0.3
"""Weight of the tilt margin itself, and the margin beyond which more does not matter."""
MOUTH = 0.8
"""Weight of the hollow at an end: that of a mug outweighs its handle."""
LOW, STEADY = 0.35, 0.4
"""Height over longest side of what lies, and the tilt margin beyond which more does not matter for that."""
SPREAD, UPRIGHT_SPREAD = 0.4, 0.2
"""Standard deviation of the logarithm of height over longest side, within a kind; of one whose height is its longest side."""
MIRRORED, MOST = 2.0, 0.2
"""Weight of what differs along an axis between its ends, and the most that counts: few objects are the same above and below."""
ROUND, ALIKE, FULL = 0.5, 0.05, 0.95
"""Weight of two sides that are alike, to that fraction, as of cups and tins, and how much of its box a carton fills, which may
lie on any side."""
STATED = 0.2
"""Weight of the up axis that the file states."""
ANYWHERE = tuple("on table|on desk|on counter|on shelf|inside shelf|on cabinet|on nightstand|on dresser".split("|"))
"""Places for unknown objects, and for hand-held ones none of whose places exist in the room; never the floor."""
COLOURED = 8.0
"""Difference in the spread of colours, of 255, that tells a front from a back."""
FLATTER, FRAMED = 0.05, 0.3
"""Differences of a front and a back: of the tilt margins, as fractions of a right angle, and of the hollow fractions."""
UNEVEN = 0.5
"""Difference of the cross-sections at the ends of an axis, two slices each, from which it is the one from front to back."""
SHEET = 0.15
"""Thinnest side over the longest below which what hangs is a sheet, which faces along it."""
SOFT = ("bed", "sofa", "armchair", "couch", "chair", "bench")
"""What carries pillows and blankets, which belong on no table."""
LOW_TABLE = 0.56
"""Height below which a table is a coffee table [m]."""
HAND_HELD = 0.6
"""Longest side of what may be put down anywhere [m]."""


def rules(request: Request) -> Answer:
    """Answer a question from the table."""
    if request.step == "script":
        return write_scripts(request)
    entry = known(str(request.facts["label"]))
    answer = _plan(request.facts, entry) if request.step == "plan" else _size(request.facts, entry)
    return Answer(json.dumps(answer), "rules")


def _size(facts: Any, entry: ObjectKind | None) -> dict[str, Any]:
    """Answer the question about the size."""
    height, longest = (entry.height, entry.longest) if entry else (UNKNOWN_HEIGHT, UNKNOWN_LONGEST)
    reason = "the table says so" if entry else "not in the table: taken as something hand-held"
    noun = entry.noun if entry else str(facts["label"])[:60]
    return {"noun": noun, "height": height, "longest": longest, "unit": "unknown", "reason": reason}


def write_scripts(request: Request) -> Answer:
    """Answer a question for a script: it copies the plan."""
    return Answer(write_script(request.facts["plan"]), "plan")


def _plan(facts: Any, entry: ObjectKind | None) -> dict[str, Any]:
    """Answer the question about the place."""
    up = _up(facts, entry)
    hangs = bool(entry and entry.places[0][0] == "hanging")
    wished = facts["wished"](hangs) if facts.get("wished") else {"choices": [], "near": None}
    choices = wished["choices"] or _choices(facts["room"], entry, _breadth(facts, entry, up))
    if up == facts.get("tried_up", up):
        choices = [one for one in choices if (one["target"], one["height"]) not in facts.get("tried", ())] or choices
    front = _front(facts, up)
    if choices and choices[0]["relation"] == "hanging":
        up, front = _flat(facts, entry)
    plan = {"up": up, "front": front, "near": wished["near"], "choices": choices[:CHOICES]}
    if choices:
        return plan
    places = ", ".join(f"{how} {where}" for how, where in (entry.places if entry else map(_place, ANYWHERE)))
    return {**plan, "declined": f"the room has none of its usual places: {places}"}


def _breadth(facts: Any, entry: ObjectKind | None, up: str) -> float:
    """Estimate the width of an object's footprint [m]: the shorter of its horizontal sides."""
    low, high = entry.longest if entry else UNKNOWN_LONGEST
    level = [side for side, axis in zip(facts["sides"], "xyz", strict=True) if axis != up[1]]
    return math.sqrt(low * high) * min(level) / max(facts["sides"])


def _choices(room: list[dict[str, Any]], entry: ObjectKind | None, breadth: float) -> list[dict[str, Any]]:
    """Return the places that exist in the room, those first whose free circle has the footprint's width [m].

    What belongs to none of them is put anywhere only if it is hand-held: the rest is refused rather than misplaced.
    """
    own = _existing(room, entry.places if entry else (), breadth)
    soft = entry is not None and all(where in SOFT for _, where in entry.places)
    anywhere = entry is None or (entry.longest[1] <= HAND_HELD and not soft and _stands(entry))
    others = _existing(room, tuple(_place(place) for place in ANYWHERE), breadth) if anywhere else []
    options = own + [one for one in others if one not in own]
    return [{key: value for key, value in option.items() if key not in ("free", "circle")} for option in options]


def _stands(entry: ObjectKind) -> bool:
    """Return True for what is kept on furniture, not on the floor or on a wall."""
    return entry.places[0][0] in ("on", "in", "inside") and entry.places[0][1] != "floor"


def _place(text: str) -> tuple[str, str]:
    how, _, where = text.partition(" ")
    return how, where


def _existing(room: list[dict[str, Any]], places: tuple[tuple[str, str], ...], breadth: float) -> list[dict[str, Any]]:
    """Return the options that a room has for some places, wide enough ones first."""
    best: list[dict[str, Any]] = []
    seconds: list[dict[str, Any]] = []
    named = [
        [option for line in room if _is_meant(line, where) for option in _options(line, how, room)]
        for how, where in places
    ]
    if not any(named):
        named = [[option for line in room for option in _alike(line, how, where, room)] for how, where in places]
    for (_, where), options in zip(places, named, strict=True):
        high = HIGHEST if where in ALIKE_KINDS["table-like"] else math.inf
        options.sort(key=lambda o: (o["circle"] < breadth, (o["height"] or 0.0) > high, -o["free"]))
        best += [option for option in options[:1] if option not in best]
        seconds += options[1:3]
    best += [option for option in seconds if option not in best]
    return sorted(best, key=lambda option: option["circle"] < breadth)


def _is_meant(line: dict[str, Any], where: str) -> bool:
    """Return True if a part is what the table names; a bed is slept on with its blanket on it."""
    covers = where == "bed" and line["label"].lower() in BEDDING and max(line.get("size", (0.0,))[:2]) > 0.9
    # Captures label a coffee table as a table.
    heights = [one["height"] for one in line.get("supports", ())]
    low = where == "coffee table" and line["label"] == "table" and max(heights, default=LOW_TABLE) < LOW_TABLE
    return covers or low or is_kind_of(line["label"], where)


def _options(line: dict[str, Any], how: str, room: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the choices that a part offers for a relation of the table, with their free area and free circle."""
    target = {"target": line["id"], "reason": f"the table says: {how} {line['label']}"}
    if how == "hanging" and "size" in line:
        high, wide = line["size"][2], max(line["size"][:2])
        wide = line.get("free", (0.0,))[0] if "along" in line else wide  # a wall has gaps, or none at eye level
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


HIGHEST = 1.25
"""Above this no surface of a table or of what is like one is taken where it has a lower one [m]: a hand hardly reaches there."""
WALL_HEIGHT = 1.5
"""Least height of a part without a name that may have walls [m]."""
SEAT = 0.2
"""Free area from which a surface at the height of a seat is more than a chair [m^2]."""
# What surfaces without a name may stand for
ALIKE_KINDS = {
    "floor-like": ("floor",),
    "seat-like": ("bed", "sofa", "armchair", "couch", "chair", "coffee table", "bench"),
    "table-like": ("table", "desk", "nightstand", "dresser", "cabinet", "counter", "kitchen counter"),
    "counter-like": ("counter", "kitchen counter", "cabinet", "dresser", "desk", "table"),
    "shelf-like": ("shelf", "bookshelf", "cabinet"),
}


def _alike(line: dict[str, Any], how: str, where: str, room: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the choices for a relation of the table on surfaces without a name, where the room has no named one."""
    if how == "hanging":
        tall = line["label"] == UNANNOTATED and line.get("size", (0.0,) * 3)[2] >= WALL_HEIGHT
        return _options(line, how, room) if where == "wall" and tall else []
    fitting = [s for s in line.get("supports", ()) if where in ALIKE_KINDS.get(s.get("like", ""), ())]
    fitting = [s for s in fitting if s["like"] != "seat-like" or s["free"] >= SEAT or where in ("armchair", "chair")]
    return _options(line | {"supports": fitting}, how, room) if fitting else []


def _free(support: dict[str, Any]) -> dict[str, float]:
    return {key: support[key] for key in ("free", "circle")}


def _up(facts: Any, entry: ObjectKind | None) -> str:
    """Return the up axis that suits the table's proportions, on which it stands, and along which its ends differ."""
    merits = {axis: _merit(facts, entry, axis) for axis in AXES}
    if facts.get("unstable"):
        # It did not stay: take another axis, on which it stands firmly.
        del merits[facts["tried_up"]]
        merits = {axis: merit * min(1.0, facts["feet"].get(axis, 0.0) / STEADY) for axis, merit in merits.items()}
    return max(merits, key=merits.__getitem__)


def _merit(facts: Any, entry: ObjectKind | None, axis: str) -> float:
    """Return how well an axis suits as the one that points up."""
    flat = entry is not None and _usual(entry) < LOW
    feet = facts["feet"].get(axis, 0.0)
    firm = min(1.0, feet / (STEADY if flat else FIRM)) + FIRMER * min(feet, FIRMEST)
    # Containers have their opening up, and lamps their shade.
    mouth = MOUTH * (facts["hollow"].get(axis, 0.0) - facts["hollow"].get(_opposite(axis), 0.0))
    slices = facts.get("slices", {}).get(axis[1], ())
    if slices and entry is not None and entry.noun.endswith("lamp"):
        mouth = MOUTH * (sum(slices[3:]) - sum(slices[:2])) * (1.0 if axis[0] == "+" else -1.0)
        if facts["up"] and facts["up"][1] == axis[1]:  # lava lamps have a wide base: the file tells the ends apart
            mouth = min(max(mouth, -STATED / 3), STATED / 3)
    ends = MIRRORED * min(MOST, sum(abs(one - other) for one, other in zip(slices, slices[::-1], strict=True)) / 5)
    one, other = (side for name, side in zip("xyz", facts["sides"], strict=True) if name != axis[1])
    carton = entry is not None and entry.noun == "box" and max(slices, default=0.0) >= FULL
    turned = ROUND if abs(one - other) <= ALIKE * max(one, other) and not carton else 0.0
    habit = {"+z": 0.1, "+y": 0.08, "+x": 0.04}.get(axis, 0.0) + (STATED if axis == facts["up"] else 0.0)
    return (firm + mouth + ends + turned) * _fit(facts, entry, axis) + habit


def _fit(facts: Any, entry: ObjectKind | None, axis: str) -> float:
    """Return how well the proportions suit the table with an axis up, 0 to 1."""
    if entry is None:
        return 1.0
    side, longest = facts["sides"]["xyz".index(axis[1])], max(facts["sides"])
    ratio = max(side / longest, FLAT)
    low, high = entry.height[0] / entry.longest[1], min(1.0, entry.height[1] / entry.longest[0])
    spread = UPRIGHT_SPREAD if entry.height == entry.longest else SPREAD
    off = math.log(ratio / _usual(entry)) / spread
    return min(ratio / low, high / ratio, 1.0) ** 2 * math.exp(-(off**2) / 2)


def _usual(entry: ObjectKind) -> float:
    """Return the usual height of a kind over its longest side."""
    return min(1.0, math.sqrt(entry.height[0] * entry.height[1] / (entry.longest[0] * entry.longest[1])))


def _opposite(axis: str) -> str:
    return axis.translate(str.maketrans("+-", "-+"))


def _front(facts: Any, up: str) -> str:
    """Return the front of what stands: where its colours tell it from the back, as faces and prints do; else by habit."""
    varied = {axis: facts.get("varied", {}).get(axis, 0.0) for axis in AXES}
    most = max(sideways(up), key=varied.__getitem__)
    if varied[most] - varied[_opposite(most)] > COLOURED:
        return most
    return {"+z": "-y", "+y": "+z"}.get(up, sideways(up)[0])


def _flat(facts: Any, entry: ObjectKind | None) -> tuple[str, str]:
    """Return the up axis and the front of a hanging object, which faces away from its back."""
    depth = _depth(facts)
    axes = [axis for axis in ("+z", "+y", "+x") if axis[1] != depth]
    up = facts["up"] if facts["up"] in axes else max(axes, key=lambda axis: _fit(facts, entry, axis))
    usual = {"x": "+x", "y": "-y", "z": "+z"}[depth]
    other = _opposite(usual)

    def more(name: str) -> float:
        fractions = facts.get(name, {})
        return float(fractions.get(other, 0.0) - fractions.get(usual, 0.0))

    # A framed image has its colours in front, a frame its hollow, and what lies firmly on its back has a flat one.
    for name, least in (("varied", COLOURED), ("hollow", FRAMED)) if _is_sheet(facts) else ():
        if abs(more(name)) > least:
            return up, other if more(name) > 0 else usual
    return up, other if more("feet") > FLATTER else usual


def _depth(facts: Any) -> str:
    """Return the axis along which a hanging object faces: its thinnest; of a thick one that along which its ends differ most."""
    sides, slices = dict(zip("xyz", facts["sides"], strict=True)), facts.get("slices", {})
    uneven = {axis: abs(sum(areas[:2]) - sum(areas[3:])) for axis, areas in slices.items()}
    if _is_sheet(facts) or max(uneven.values(), default=0.0) < UNEVEN:
        return min(sides, key=sides.__getitem__)
    return max(uneven, key=uneven.__getitem__)


def _is_sheet(facts: Any) -> bool:
    return bool(min(facts["sides"]) < SHEET * max(facts["sides"]))
