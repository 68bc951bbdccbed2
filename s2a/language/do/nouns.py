"""Which part of a room do words mean? "the top drawer of the desk" -> drawer_17, or why none or several."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from s2a.language.do.facts import Facts, RoomPart
from s2a.language.do.where import POSITIONS, Unresolved, belongs, positioned

ARTICLES = frozenset("the a an my your this that its some".split())
RELATIONS = ("of", "in", "on", "from", "at", "under", "below", "beneath", "inside")
UNREAD = re.compile(
    r"\b(next to|beside|near|behind|between|in front of|opposite|closest to|nearest to|above|over|with)\b"
)
SAME = (
    ("cabinet", "cupboard"),
    ("wardrobe", "closet"),
    ("cup", "mug"),
    ("sofa", "couch"),
    ("refrigerator", "fridge"),
    ("nightstand", "bedside table", "night stand"),
    ("trash can", "bin", "waste bin", "dustbin"),
    ("television", "tv"),
    ("dresser", "chest of drawers"),
    ("counter", "countertop", "worktop"),
    ("bookshelf", "bookcase"),
)
"""Nouns that annotators and people use for one another."""
GLUE = "~"
"""Stands for a blank within a label that holds a relation, such as "chest of drawers"."""


@dataclass(frozen=True)
class Phrase:
    """Words for a part.

    Attributes:
        noun: without articles and positions.
        positions: such as "top" and "left".
        context: words for what it belongs to or stands on; empty where none are given.
    """

    noun: str
    positions: tuple[str, ...]
    context: str


def phrase(words: str, labels: Iterable[str]) -> Phrase:
    """Read words for a part: "the top drawer of the desk", "the desk's top drawer"; names of several words stay whole."""
    for label in {*labels, *(name for group in SAME for name in group)}:
        if re.search(r"\sof\s|'s\s", label):
            words = words.replace(label, label.replace(" ", GLUE))
    if owner := re.fullmatch(r"(.+?)'s? (.+)", words):
        words = f"{owner[2]} of {owner[1]}"
    if unread := UNREAD.search(words):
        raise Unresolved("impossible", f"the rules do not read {unread[0]!r}; name the part by its id")
    head, context = words, ""
    if found := re.search(rf"\s(?:{'|'.join(RELATIONS)})\s", words):
        head, context = words[: found.start()], words[found.end() :]
    tokens = [token for token in re.findall(rf"[\w'{GLUE}-]+", head) if token not in ARTICLES]
    if context.split() and set(re.findall(r"[\w-]+", context)) <= ARTICLES | POSITIONS | {"side"}:  # "on the left"
        tokens, context = [*(t for t in context.split() if t in POSITIONS), *tokens], ""
    positions = tuple(token for token in tokens if token in POSITIONS)
    noun = " ".join(token for token in tokens if token not in POSITIONS)
    return Phrase(noun.replace(GLUE, " "), positions, context.replace(GLUE, " "))


def resolve(words: str, facts: Facts, fits: Callable[[RoomPart], bool], what: str, *, all_fit: bool = False) -> str:
    """Return the id of the one part that words mean.

    Args:
        words: in lower case.
        facts: the room.
        fits: which parts can be meant at all, such as those that open; of furniture, its parts that fit are meant.
        what: these in words, for refusals.
        all_fit: What does not fit may be meant too: of two cups, one of which is fixed, either.

    Raises:
        Unresolved: none or several are meant.
    """
    exact = [i for i in facts if i.lower() in words.split()]
    if len(exact) == 1 and fits(facts[exact[0]]):
        return exact[0]
    said = phrase(words, _labels(facts))
    named = _named(said, facts)
    if not named:
        raise Unresolved("unknown", f"nothing in the room is called {said.noun or words!r}")
    found = [i for i in named if fits(facts[i])] or _fitting_parts(said.noun, named, facts, fits)
    if not found:
        raise Unresolved("impossible", f"{said.noun!r} is nothing that {what}", named)
    if all_fit:
        found = named if set(found) <= set(named) else found
    for position in said.positions:
        found = positioned(found, position, facts)
    if len(found) > 1:
        raise Unresolved("ambiguous", f"{len(found)} parts fit {words!r}", found)
    if not fits(facts[found[0]]):
        raise Unresolved("impossible", f"{found[0]} is nothing that {what}", found)
    return found[0]


def _fitting_parts(noun: str, named: list[str], facts: Facts, fits: Callable[[RoomPart], bool]) -> list[str]:
    """Return the parts of furniture that fit; the one that bears its name, if there is one: the oven door of an oven."""
    parts = [i for i in facts if fits(facts[i]) and belongs(i, named, facts)]
    nouns = _nouns(noun)
    return [i for i in parts if any(facts[i].label.lower().startswith(f"{n} ") for n in nouns)] or parts


def _named(said: Phrase, facts: Facts) -> list[str]:
    """Return the parts that a noun names, those in its context where it has one."""
    found = _called(said.noun, facts)
    contexts = [said.context] if said.context else []
    if not found and " " in said.noun:  # "desk drawer"
        first, _, last = said.noun.rpartition(" ")
        found, contexts = _called(last, facts), [first, *contexts]
    for context in contexts:
        inner = phrase(context, _labels(facts))
        around = _named(inner, facts)
        if not around:
            raise Unresolved("unknown", f"nothing in the room is called {inner.noun!r}")
        within = [i for i in found if belongs(i, around, facts)]
        if not within and found:
            raise Unresolved("unknown", f"no {said.noun!r} belongs to {inner.noun!r}", found)
        found = within
    return found


def _called(noun: str, facts: Facts) -> list[str]:
    """Return the part of an id, or those whose label ends in a noun ("cabinet": a "wall cabinet"), else begins with it."""
    if noun in facts:
        return [noun]
    nouns, labels = _nouns(noun), {i: thing.label.lower() for i, thing in facts.items()}
    found = [i for i, label in labels.items() if any(label == n or label.endswith(f" {n}") for n in nouns)]
    return found or [i for i, label in labels.items() if any(label.startswith(f"{n} ") for n in nouns)]


def _nouns(noun: str) -> set[str]:
    """Return a noun, its singular, and what else people call it; nothing for no noun."""
    singular = {noun, noun.removesuffix("s"), noun.removesuffix("es")} - {""}
    return singular | {other for group in SAME for name in singular if name in group for other in group}


def _labels(facts: Facts) -> set[str]:
    return {thing.label.lower() for thing in facts.values()}
