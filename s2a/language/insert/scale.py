"""Scale of an object: size ranges from a model, combined with the units that mesh files come in."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

from s2a.language.insert import prompts
from s2a.language.insert.placement import SCALE
from s2a.language.llm.ask import Model, Request, UsageLog, ValidationFeedback, ask, parse

Range = tuple[float, float]
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
"""Metres per unit of mesh files."""
MIN_SIZE, MAX_SIZE = 0.001, 4.0
"""Sizes of objects that fit into a room [m]."""
MAX_RATIO = {"height": 30.0, "longest": 12.0}
"""Largest ratio of max to min of an informative range: an envelope lies or is a stack, a battery lies or stands."""
FLAT = 1e-3
"""Smallest side as a fraction of the longest: a sheet has no thickness."""
SLACK = 1.15
"""Factor by which a size may be outside its range for a unit to be accepted: products differ, and so do models."""


@dataclass(frozen=True)
class Size:
    """Usual size of a kind of object.

    Attributes:
        noun: plain name of the kind; brands and rare words resolved.
        height: min and max in its orientation [m].
        longest: min and max of the longest side [m].
        unit: unit of the file, the model's guess.
        reason: in a few words.
    """

    noun: str
    height: Range
    longest: Range
    unit: Literal["m", "cm", "mm", "in", "ft", "unknown"]
    reason: str


@dataclass(frozen=True)
class ScaleFit:
    """Scale of an object file.

    Attributes:
        scale: metres per unit of the file.
        method: the file's unit that fits the ranges ("unit cm"), or "range" where none does.
    """

    scale: float
    method: str


def size(model: Model, facts: dict[str, Any], retries: int, usage: UsageLog) -> Size:
    """Ask a model for the size of an object.

    Args:
        model: the language model.
        facts: label, sides in the file, its height, the stated unit, the support and the neighbours.
        retries: answers that may be rejected.
        usage: log of the answers, appended to.

    Raises:
        InputError: no answer could be used.
    """
    request = Request("scale", prompts.SCALE, (("user", prompts.scale_question(facts)),), prompts.SCALE_SCHEMA, facts)
    doubted: set[str] = set()

    def accept(text: str) -> Size:
        answer = checked(parse(text, Size))
        doubt = doubts(answer, facts)
        if doubt and text not in doubted and not doubted:
            doubted.add(text)  # an answer that is repeated is meant
            raise ValidationFeedback(f"{doubt} Is the size in metres, and right? Answer again; repeat it if it is.")
        return answer

    return ask(model, request, accept, retries, usage)


def checked(answer: Size) -> Size:
    """Return a size if it is plausible.

    Raises:
        ValidationFeedback: what is wrong with it, for the model.
    """
    for name, (low, high) in (("height", answer.height), ("longest", answer.longest)):
        if not (math.isfinite(low) and math.isfinite(high) and MIN_SIZE <= low <= high <= MAX_SIZE):
            raise ValidationFeedback(
                f"{name} is {low:g} to {high:g}; give least and largest in metres, from {MIN_SIZE:g} to {MAX_SIZE:g}."
            )
        if high > MAX_RATIO[name] * low:
            raise ValidationFeedback(f"{name} {low:g} to {high:g} m says too little; give the usual range.")
    if answer.height[0] > answer.longest[1] * 1.01:
        raise ValidationFeedback("The height is more than the longest side, which cannot be.")
    if not answer.noun.strip() or len(answer.noun) > 60:
        raise ValidationFeedback("noun is empty or too long; give one plain English noun.")
    return answer


def doubts(answer: Size, facts: dict[str, Any]) -> str:
    """Return a contradiction between a size and the support or the neighbours; empty if there is none."""
    support = facts.get("support") or {}
    room, wide = support.get("room", math.inf), support.get("widest", math.inf)
    if answer.height[0] > room:
        return f"The support leaves {room:g} m of height, and the object would be {answer.height[0]:g} m high at least."
    if answer.longest[0] > 1.5 * wide:
        return f"The support is {wide:g} m long, and the object would be {answer.longest[0]:g} m long at least."
    for neighbour in facts.get("neighbours", ()):
        if neighbour["label"].lower() == answer.noun.lower():
            length = max(neighbour["size"])
            if not answer.longest[0] / 3 < length < answer.longest[1] * 3:
                return f"A {neighbour['label']} in this room is {length:g} m long."
    return ""


def fit_scale(answer: Size, height: float, longest: float, stated: float | None) -> ScaleFit:
    """Return the scale that matches an object file to its expected size.

    Meshes come in metres, centimetres, millimetres, inches or feet, or in a unit of their own. A unit that puts height and
    longest side where they are expected is taken for the file's, and the object has exactly its size; failing that, one
    that puts the longest side there, for a model may have another side in mind. Else the middle of the ranges is what there is.

    Args:
        answer: the expected ranges.
        height: of the object in the file's unit, upright.
        longest: its longest side, in the file's unit.
        stated: metres per unit as stated in the file, or None.
    """
    middle = math.sqrt(answer.longest[0] * answer.longest[1])
    units = dict(UNITS) if stated is None or stated in UNITS.values() else {"as stated": stated, **UNITS}
    far = {name: abs(math.log(metres * longest / middle)) for name, metres in units.items()}
    for sides in (((height, answer.height), (longest, answer.longest)), ((longest, answer.longest),)):
        fitting = [name for name, metres in units.items() if all(_within(metres * side, span) for side, span in sides)]
        if fitting:
            own = [name for name in fitting if units[name] == stated]
            name = own[0] if own else min(fitting, key=far.__getitem__)
            return ScaleFit(_short(units[name]), f"unit {name}")
    return ScaleFit(_short(_middle(answer, height, longest)), "range")


def _short(scale: float) -> float:
    return float(f"{scale:.{SCALE}g}")


def _within(value: float, span: Range) -> bool:
    return span[0] / SLACK <= value <= span[1] * SLACK


def _middle(answer: Size, height: float, longest: float) -> float:
    """Return the scale that brings both sides closest to the middle of their ranges, weighted by the ranges' precision."""
    total = weight = 0.0
    for side, (low, high) in ((max(height, FLAT * longest), answer.height), (longest, answer.longest)):
        surety = 1.0 / (math.log(high / low) + 0.1) ** 2
        total += surety * math.log(math.sqrt(low * high) / side)
        weight += surety
    return math.exp(total / weight)
