"""Where parts are to each other: what belongs to which furniture, what is on top, in the middle, on the left."""

from __future__ import annotations

from collections.abc import Sequence

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
