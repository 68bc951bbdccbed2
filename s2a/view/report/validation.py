"""Validation reports of `s2a certify`: verdicts, and every number beside its bound."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from s2a.view.report.document import Document, Markup, table, text
from s2a.view.report.rates import provenance

BAR = 120
"""[px] Of a bar that reaches its bound."""


def report(values: Mapping[str, Any], path: Path) -> Document:
    """Return the page of a report.json."""
    reports = values["reports"]
    good = sum(bool(each["passed"]) for each in reports)
    overview = [
        (each["target"], _status("pass" if each["passed"] else "fail"), _grip(each), _failed(each)) for each in reports
    ]
    sections = [("Parts", table(("part", "verdict", "a parallel gripper", "failed checks"), overview))]
    for each in reports:
        header = ("check", "", "measured", "bound", "of the bound", "message", "remedy")
        sections.append((each["target"] or "stage", table(header, [_row(check) for check in each["checks"]])))
    stage = Path(reports[0]["stage"]).name if reports else path.parent.name
    about = provenance(reports[0].get("provenance") or {}) if reports else ""
    return Document(f"{stage}: {good} of {len(reports)} parts passed", about, tuple(sections))


def _row(check: Mapping[str, Any]) -> tuple[object, ...]:
    numbers = [
        None if check[key] is None else f"{check[key]:.4g} {check['unit']}".strip() for key in ("value", "bound")
    ]
    cells = [Markup(text(number or ""), "n") for number in numbers]
    return check["name"], _status(check["status"]), *cells, _bar(check), check["message"], check["remedy"]


def _bar(check: Mapping[str, Any]) -> Markup:
    """Return a bar of value over bound; what is larger than twice the bound is cut there."""
    value, bound = check["value"], check["bound"]
    if value is None or not bound or bound < 0:
        return Markup("")
    width = BAR * min(max(value / bound, 0.0), 2.0)
    colour = "#b3261e" if check["status"] == "fail" else "#2a8a3c"  # some bounds are the least that passes
    return Markup(
        f"<svg width='{2 * BAR}' height='12'><rect y='2' width='{width:.1f}' height='8' fill='{colour}'/>"
        f"<path d='M{BAR} 0V12' stroke='#1f2328'/></svg>"
    )


def _status(status: str) -> Markup:
    return Markup(f"<span class='{text(status)}'>{text(status)}</span>")


def _grip(report: Mapping[str, Any]) -> str:
    return {True: "can hold it", False: "cannot hold it", None: "not tested"}[report["graspable"]]


def _failed(report: Mapping[str, Any]) -> str:
    return ", ".join(check["name"] for check in report["checks"] if check["status"] == "fail")
