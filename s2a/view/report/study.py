"""Studies of many objects, such as insertions: what the table says, and every row of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from s2a.core.config import leaves
from s2a.view.report import chart
from s2a.view.report.document import Document, Markup, facts, table, text
from s2a.view.report.rates import provenance

MAX_ROWS = 500
COUNTS = ("scale", "free", "stable", "openings")
"""Columns of an insertion's table: how many have the right size, collide with nothing, stay, and leave all parts free to open."""
PAPER = {
    "category": "the paper's own scans",
    "method": "as published",
    "n": 100,
    "success": 80,
    "low": 0.711,
    "high": 0.867,
}
"""Table of insertions in "From Scan to Action", Halacheva et al., CVPR Workshops 2025; Wilson interval of 80 of 100."""


def report(values: Mapping[str, Any], path: Path) -> Document:
    """Return the page of a study: a summary, its table, all rows."""
    sections = []
    for key in ("summary", "total"):
        if isinstance(values.get(key), dict):
            sections.append(("Summary", facts({name: value for name, value in leaves(values[key])})))
    if rows := values.get("table"):
        header = ("category", "method", "of", "", "right [95 %]", *COUNTS)
        sections.append(("By category", table(header, [_counted(row) for row in [*rows, PAPER]])))
    sections.append((f"All {len(values['rows'])} rows", _every(values["rows"])))
    kind = {name: values.get(name) for name in ("llm", "virtual", "num_envs")}
    about = "; ".join([*(f"{name} {value}" for name, value in kind.items() if value is not None), provenance(values)])
    return Document(path.stem.replace("_", " "), about, tuple(sections))


def _counted(row: Mapping[str, Any]) -> tuple[object, ...]:
    bar = chart.interval(row["success"] / row["n"], float(row["low"]), float(row["high"]))
    return row["category"], row["method"], row["n"], *bar, *(row.get(name) for name in COUNTS)


def _every(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return a table of all rows, in which what is false stands out; what is the same in all of them stands above."""
    names = [*dict.fromkeys(name for row in rows for name, value in row.items() if not isinstance(value, (dict, list)))]
    same = [name for name in names if len(rows) > 1 and len({str(row.get(name)) for row in rows}) == 1]
    names = [name for name in names if name not in same]
    for name in tuple(names):
        if any(_repeated(name, other, rows) for other in names if other != name):
            names.remove(name)
    common = ", ".join(f"{name} {rows[0][name]}" for name in same)
    note = f"<p>The same in all rows: {text(common)}.</p>" if same else ""
    left = f"<p>{len(rows) - MAX_ROWS} further rows are in the file.</p>" if len(rows) > MAX_ROWS else ""
    cells = [[_value(row.get(name)) for name in names] for row in rows[:MAX_ROWS]]
    return note + table(names, cells, dense=True) + left


def _repeated(name: str, other: str, rows: Sequence[Mapping[str, Any]]) -> bool:
    """Return True if one column's texts, some of them, are all within another's, which says the same or more."""
    texts = [(row.get(name), row.get(other)) for row in rows if row.get(name) not in (None, "")]
    return bool(texts) and all(isinstance(a, str) and isinstance(b, str) and a in b for a, b in texts)


def _value(value: object) -> object:
    return Markup("<span class='fail'>no</span>") if value is False else value
