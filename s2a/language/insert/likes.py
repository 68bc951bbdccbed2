"""Things of which people keep one at a place: a second television does not go beside the first."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from s2a.language.insert.hints import is_kind_of
from s2a.language.insert.place.fit import NoRoom
from s2a.language.insert.plan import Choice, Plan

SINGLE = (
    "tv", "keyboard", "microwave", "kettle", "toaster", "coffee maker", "coffee machine", "printer", "record player",
    "bread bin", "dish rack", "knife block", "toaster oven",
)  # fmt: skip
"""Kinds of which one table or counter has one."""


def like_on(target: str, label: str, lines: list[dict[str, Any]]) -> str | None:
    """Return the id of a thing on a support that is of the same single kind as a label; None if there is none.

    Args:
        target: id of the support.
        label: of the object.
        lines: of the room, see `s2a.language.insert.describe.describe`.
    """
    kinds = [kind for kind in SINGLE if is_kind_of(label, kind)]
    standing = (line for line in lines if line.get("on") == target)
    return next((line["id"] for line in standing if any(is_kind_of(line["label"], kind) for kind in kinds)), None)


def apart_from_likes(plan: Plan, label: str, lines: list[dict[str, Any]], last: bool) -> Plan:
    """Return a plan without the supports that carry a like of the object, or with these at the end if it is the last one.

    Raises:
        NoRoom: nothing is left, and it is not the last plan.
    """
    likes = {choice: like_on(choice.target, label, lines) for choice in plan.choices}
    free = tuple(choice for choice in plan.choices if likes[choice] is None)
    if not free and not last:
        raise NoRoom("; ".join(_clause(choice, like) for choice, like in likes.items()))
    return replace(plan, choices=free + tuple(choice for choice in plan.choices if last and choice not in free))


def _clause(choice: Choice, like: str | None) -> str:
    return (
        f"{choice.relation} {choice.target}: {like} is there already, and people keep one such thing at a place; repeat it if "
        "there is no better place for a second one"
    )
