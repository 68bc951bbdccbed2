"""Kinds of objects, their usual sizes and places, and which kind a label means.

`rules.csv` has one kind of object per line: name, synonyms, ranges of height and longest side [cm] that hold for nine of ten,
and places, best first: "on desk", "in sink" (a basin), "inside shelf" (a compartment), "against wall" (on the floor before
it), "hanging wall". `brands.csv` maps brands to kinds. Both were written from memory before any
test object was seen; later candelabra, hourglass, model ship, snow globe, hot-water bottle, wreath, hook rail and abacus were
added because the zoo has them: how well the table does is measured with other objects (`experiments/other_objects.py`).
"""

from __future__ import annotations

import csv
import difflib
import re
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from s2a.language.insert.scale import Range

FOLDER = Path(__file__).parent
LIKE = 0.86
"""Similarity (difflib's ratio) from which a word is a misspelling of another."""
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
    close = difflib.get_close_matches(words, names, n=1, cutoff=LIKE)
    close = close or difflib.get_close_matches(words.split()[-1] if words else "", names, n=1, cutoff=LIKE)
    return names[close[0]] if close else None


def _compounds(words: str) -> list[str]:
    """Return the compounds that a phrase may stand for: a glass of wine is a wine glass, soap in a dish fills a soap dish."""
    found = []
    if match := re.fullmatch(r"(.+) (?:in|on) an? (\w+)", words):
        found.append(f"{match[1]} {match[2]}")
    if match := re.fullmatch(r"(?:an? )?(\w+) of (.+?)(?: (?:with|in|on|for)\b.*)?", words):
        found.append(f"{match[2]} {match[1]}")
    return found


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
