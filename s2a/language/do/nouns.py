"""Parts of a room from words: "the top drawer of the desk" -> drawer_17, or the reason for none or several."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from s2a.language.do.facts import Facts, RoomPart

HIGH = frozenset("top upper uppermost topmost highest first".split())
LOW = frozenset("bottom lower lowermost bottommost lowest last".split())
MIDDLE = frozenset("middle center centre central".split())
LEFT, RIGHT = frozenset("left leftmost left-hand".split()), frozenset("right rightmost right-hand".split())
ORDINALS = {"second": 1, "2nd": 1, "third": 2, "3rd": 2, "fourth": 3, "4th": 3}
"""From the top; 0 is the first."""
POSITIONS = HIGH | LOW | MIDDLE | LEFT | RIGHT | set(ORDINALS)
LEVEL = 0.04
"""[m] Up to which two fronts are equally high, or equally far left."""
BELOW = 0.05
"""[m] By which furniture that stands under other furniture may rise above its top, or stick out of its outline."""


class Unresolved(Exception):
    """Words that mean no part, or several.

    Attributes:
        kind: "ambiguous", "unknown" or "impossible".
        reason: in a few words.
        options: ids that fit.
    """

    def __init__(self, kind: str, reason: str, options: Sequence[str] = ()) -> None:
        """Keep why."""
        super().__init__(reason)
        self.kind, self.reason, self.options = kind, reason, tuple(options)


def belongs(part: str, around: Sequence[str], facts: Facts) -> bool:
    """Return True for what is a part of some furniture, stands on it, or belongs to furniture that stands below it."""
    above: list[str] = []
    at: str | None = part
    while at is not None and at in facts:
        above.append(at)
        at = facts[at].parent
    if set(above[1:]) & set(around) or facts[part].on in around:
        return True
    return any(facts[part].moves and _under(facts[above[-1]], facts[other]) for other in around if other in facts)


def _under(low: RoomPart, high: RoomPart) -> bool:
    """Return True for furniture that stands below other furniture, such as a cabinet below a desk."""
    if low.id == high.id or not (low.center and low.size and high.center and high.size):
        return False
    beside = np.abs(np.subtract(low.center, high.center))[:2] - 0.5 * np.array(high.size)[:2]
    tops = low.center[2] + low.size[2] / 2, high.center[2] + high.size[2] / 2
    return bool((beside <= BELOW).all() and tops[0] <= tops[1] + BELOW and high.size[2] > low.size[2] / 2)


def positioned(found: list[str], position: str, facts: Facts) -> list[str]:
    """Return those of some parts that stand in a position; all where it does not tell them apart."""
    if len(found) < 2:
        return found
    if position in LEFT | RIGHT:
        if not _alike(found, facts):
            raise Unresolved("ambiguous", f"{position!r} needs fronts that face alike", found)
        x, y = facts[found[0]].facing or (1.0, 0.0)
        along = {i: float(np.dot(facts[i].center or (0, 0, 0), (-y, x, 0.0))) for i in found}
        return _extreme(found, along, largest=position in RIGHT)
    if len({_root(i, facts) for i in found}) > 1:
        raise Unresolved("ambiguous", f"several pieces of furniture have such a part; which one's {position!r}?", found)
    height = {i: (facts[i].center or (0, 0, 0))[2] for i in found}
    if position in HIGH | LOW:
        return _extreme(found, height, largest=position in HIGH)
    ranks = sorted(found, key=lambda i: -height[i])
    levels: list[list[str]] = []
    for i in ranks:
        if levels and abs(height[levels[-1][0]] - height[i]) <= LEVEL:
            levels[-1].append(i)
        else:
            levels.append([i])
    rank = (len(levels) - 1) / 2 if position in MIDDLE else ORDINALS[position]
    if rank != int(rank) or rank >= len(levels):
        raise Unresolved("unknown", f"of {len(levels)} levels none is {position!r}", found)
    return levels[int(rank)]


def _extreme(found: list[str], values: dict[str, float], *, largest: bool) -> list[str]:
    """Return the parts with the largest or smallest value, and those within LEVEL of it."""
    best = (max if largest else min)(values[i] for i in found)
    return [i for i in found if abs(values[i] - best) <= LEVEL]


def _alike(found: list[str], facts: Facts) -> bool:
    """Return True for fronts that face in one direction, within some 25 degrees."""
    facings = [facts[i].facing or (0.0, 0.0) for i in found]
    return all(float(np.dot(facings[0], other)) > 0.9 for other in facings)


def _root(part: str, facts: Facts) -> str:
    """Return the furniture that a part belongs to."""
    while (parent := facts[part].parent) is not None and parent in facts:
        part = parent
    return part


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
