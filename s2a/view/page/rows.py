"""What the page says of a part: the row of its tree, and the card of the part that is selected."""

from __future__ import annotations

import html
from collections.abc import Iterable, Iterator

from s2a.scene.scene import Joint
from s2a.view.page.room import PagePart, PageRoom, unit

INDENT = "\u2003"
KINDS = {"prismatic": "slides", "revolute": "turns"}


def rows(room: PageRoom, parent: str | None = None, depth: int = 0) -> Iterator[tuple[str, int]]:
    """Yield the parts of a room's tree with their depth, each before its children."""
    waiting = [(part, 0) for part in reversed(room.children.get(None, ()))]  # no recursion: chains may be long
    while waiting:
        part, depth = waiting.pop()
        yield part, depth
        waiting += [(child, depth + 1) for child in reversed(room.children.get(part, ()))]


def row(room: PageRoom, part: str, depth: int) -> str:
    """Return the row of a part: indented id, and how it moves."""
    said = motion(room.parts[part])
    return f"{INDENT * depth}{part}" + (f" \u00b7 {said}" if said else "")


def motion(part: PagePart) -> str:
    """Return how a part moves, in a few words: "slides 0 to 400 mm"; nothing for what is fixed."""
    if isinstance(part.motion, Joint):
        name, size = unit(part.motion)
        low, high = (round(limit / size) for limit in part.motion.limits)
        return f"{KINDS[part.motion.kind]} {low} to {high} {name}"
    return "" if part.motion == "fixed" else part.motion


def card(room: PageRoom, part_id: str | None) -> str:
    """Return the facts about a part as HTML; None: what to do to see some."""
    if part_id is None:
        return "<div class='s2a-card'><em>Click a part, or its row, to see what it is.</em></div>"
    part = room.parts[part_id]
    facts = {
        "label": part.label or "none",
        "part of": part.parent,
        "motion": motion(part) or "fixed",
        "axis": _numbers(part.motion.axis) if isinstance(part.motion, Joint) else None,
        "moves with": part.mover if part.mover != part_id else None,
        "mass": None if part.mass is None else f"{part.mass:.3g} kg",
        "faces": f"{len(part.surface.faces):,}",
    }
    return _table(
        part_id, [(name, value) for name, value in facts.items() if value] + list(room.notes.get(part_id, ()))
    )


def noted(room: PageRoom) -> str:
    """Return what a validation report or an insertion says of each part as HTML."""
    return "".join(_table(part, said) for part, said in room.notes.items())


def step_card(part: str, name: str, value: str) -> str:
    """Return a step of an insertion as HTML."""
    return _table(part, [(name, value)])


def _table(title: str, values: Iterable[tuple[str, str]]) -> str:
    lines = (f"<tr><td>{html.escape(name)}</td><td>{html.escape(value)}</td></tr>" for name, value in values)
    return f"<div class='s2a-card'><b>{html.escape(title)}</b><table>{''.join(lines)}</table></div>"


def _numbers(values: tuple[float, ...]) -> str:
    return f"({', '.join(f'{round(value, 3) + 0.0:g}' for value in values)})"
