"""What the annotation page says: what to do next, facts about the selected part, the checks."""

from __future__ import annotations

import html
from collections.abc import Sequence

from s2a.annotate.annotation import Draft, Item
from s2a.scan.evidence.finding import Finding
from s2a.view.page import panel
from s2a.view.page.room import unit

FRONT, HINGE, LINE, HANDLE, RECTANGLE = "front", "hinge", "line", "handle", "rectangle"
"""What the next click, or drag, means."""
HINTS = {
    FRONT: "Click a front. Shift and drag: a rectangle around it.",
    HINGE: "Click the edge about which it turns.",
    LINE: "Click two points of the hinge line.",
    HANDLE: "Click the handle, or the place where one is.",
    RECTANGLE: "Shift and drag a rectangle around the front.",
}
MARKS = {"pass": "\u2713", "warn": "\u26a0", "fail": "\u2717", "unknown": "?"}
COLORS = {"pass": "seagreen", "warn": "darkorange", "fail": "crimson", "unknown": "gray"}
NONE = "none"
STYLE = f"""<style>
{panel.MARKS}
.s2a-card {{ padding: 0 0.75em 0.3em; font-size: 0.875em; line-height: 1.4; overflow-wrap: anywhere; }}
.s2a-hint {{ font-weight: 600; }}
</style>"""


def hint(mode: str, item: Item | None) -> str:
    """Return what to do next, as HTML."""
    text = HINTS[mode]
    if mode == FRONT and item is not None and item.joint is None:
        text = "Does it slide or turn? If the region is wrong: shift and drag a rectangle."
    elif mode == FRONT and item is not None and item.proposed:
        text = "A proposal: accept it, edit it, or remove it."
    return f"<div class='s2a-card s2a-hint'>{html.escape(text)}</div>"


def row(index: int, item: Item) -> str:
    """Return a part's entry in the list of parts."""
    moves = {None: "joint?", "prismatic": "slides", "revolute": "turns"}[item.joint.kind if item.joint else None]
    handle = item.completed and f"{item.completed} added" or ("handle" if len(item.handle) else "no handle")
    return f"{index + 1} {item.name}: {moves}, {handle}" + (" (proposed)" if item.proposed else "")


def rows(annotation: Draft) -> tuple[str, ...]:
    """Return the entries of all parts, after the one for no part."""
    return (NONE, *(row(i, item) for i, item in enumerate(annotation.items)))


def facts(item: Item | None) -> str:
    """Return size and motion of the selected part, as HTML."""
    if item is None:
        return ""
    width, height = item.region.size
    text = f"{1000 * width:.0f} x {1000 * height:.0f} mm, {len(item.front):,} faces"
    if item.joint is not None:
        name, size = unit(item.joint)
        text += f"; opens by {item.joint.limits[1] / size:.0f} {name}"
    return f"<div class='s2a-card'>{text}</div>"


def checks(findings: Sequence[Finding]) -> str:
    """Return findings as HTML: those that fail or warn in full, of the others the names."""
    bad = [f for verdict in ("fail", "warn") for f in findings if f.verdict == verdict]
    lines = [_line(f.verdict, f"{f.check}: {f.message}" + (f"; {f.remedy}" if f.remedy else "")) for f in bad]
    for verdict in ("pass", "unknown"):
        if names := [f.check for f in findings if f.verdict == verdict]:
            lines.append(_line(verdict, ", ".join(names)))
    return f"<div class='s2a-card'>{''.join(lines)}</div>"


def _line(verdict: str, text: str) -> str:
    return f"<div><span style='color:{COLORS[verdict]}'>{MARKS[verdict]}</span> {html.escape(text)}</div>"
