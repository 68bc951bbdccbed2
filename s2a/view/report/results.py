"""Tables of results: rates of episodes, studies of many objects, validation reports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from s2a.core.config import leaves
from s2a.view.report import document
from s2a.view.report.document import Document, Markup, facts, images, table, text

NAMES = {
    "success": "opened",
    "final_success": "open at the end",
    "grasp_success": "opened, grasped",
    "handle_success": "both fingers on the handle",
    "single_finger_success": "one finger on the handle",
    "off_handle_success": "a finger beside the handle",
    "body_success": "pushed by another link",
}
"""Rates in words; others are shown by their names."""
BY_GROUP = ("success", "grasp_success")
"""Rates that are shown by groups of parts, where a result has them."""
GROUPS = {"kind": "kind of joint", "handle": "handle", "room": "room"}
NEVER = 0.05
"""Fraction of the episodes up to which a part counts as never opened."""
BEFORE_AFTER = ("before.png", "after.png")


def is_rate(value: object) -> bool:
    """Return True for a fraction with its interval."""
    return isinstance(value, dict) and {"rate", "low", "high"} <= value.keys()


def rates(values: Mapping[str, Any]) -> str:
    """Return a table of the fractions with intervals among some values."""
    rows = [(NAMES.get(name, name), *_interval(value)) for name, value in values.items() if is_rate(value)]
    return table(("", "", "rate [95 %]"), rows)


def provenance(values: Mapping[str, Any]) -> str:
    """Return commit, versions and device in one line."""
    versions = ", ".join(f"{name} {version}" for name, version in (values.get("versions") or {}).items())
    told = {
        "seed": values.get("seed"),
        "commit": values.get("commit"),
        "device": values.get("device"),
        "": versions or None,
    }
    return "; ".join(f"{name} {value}".strip() for name, value in told.items() if value is not None)


def evaluation(values: Mapping[str, Any], path: Path) -> Document:
    """Return the report of one evaluation, with the images that lie beside it."""
    sections = [("Rates", rates(values))]
    if numbers := [
        (name, *(float(value[key]) for key in ("mean", "min", "max")))
        for name, value in values.items()
        if isinstance(value, dict) and {"mean", "min", "max"} <= value.keys()
    ]:
        sections.append(("Numbers", table(("", "mean", "min", "max"), numbers)))
    if use := values.get("limit_use"):
        shown = [(name.replace("_", " "), f"{100 * float(value):.0f} %") for name, value in use.items()]
        sections.append(("The robot's limits, used at most", table(("", "of the limit"), shown)))
    if thresholds := values.get("thresholds"):
        sections.append(("Thresholds", facts(thresholds)))
    if over := values.get("over_parts"):
        sections += _over_parts(over, values["parts"])
    if shown_images := [path.with_name(name) for name in BEFORE_AFTER if path.with_name(name).is_file()]:
        sections.append(("The first world before, and at the widest opening", images(shown_images)))
    title = (
        f"{values.get('policy') or 'Evaluation'}: {values['episodes']} episodes in {values.get('stage') or path.stem}"
    )
    about = f"metrics version {values.get('metrics_version', 1)}; {provenance(values)}"
    return Document(title, about, tuple(sections))


def benchmark(values: Mapping[str, Any], path: Path) -> Document:
    """Return the report of a benchmark."""
    parts = values["parts"]
    title = f"{values['policy']}: {len(parts)} parts, {values['episodes_a_part']} episodes each"
    asked = {name: values.get(name) for name in ("perception", "grasp_error", "grasp_turn")}
    about = "; ".join([path.name, *(f"{n} {v}" for n, v in asked.items() if v is not None), provenance(values)])
    return Document(title, about, tuple(_over_parts(values["over_parts"], parts)))


def _over_parts(over: Mapping[str, Any], parts: list[Mapping[str, Any]]) -> list[tuple[str, str]]:
    """Return the sections of means over parts, of groups of parts, and of the parts that are never opened."""
    sections = [(f"Over {over['all']['parts']} parts", rates(over["all"]))]
    for key, name in GROUPS.items():
        shown = [rate for rate in BY_GROUP if rate in over["all"]]
        rows = [
            (group, row["parts"], *(cell for rate in shown for cell in _interval(row[rate])))
            for group, row in over.get(key, {}).items()
        ]
        titles = [title for rate in shown for title in ("", f"{NAMES[rate]} [95 %]")]
        sections.append((f"By {name}", table((name, "parts", *titles), rows)))
    never = [
        (row["room"], row["part"], row["kind"], row["handle"], f"{100 * row['success']:.0f} %")
        for row in parts
        if row.get("success", 1.0) <= NEVER
    ]
    title = f"Opened in {100 * NEVER:.0f} % of the episodes or fewer: {len(never)} parts"
    return [*sections, (title, table(("room", "part", "joint", "handle", "opened"), never))]


def _interval(value: Mapping[str, Any]) -> tuple[Markup, Markup]:
    return document.interval(float(value["rate"]), float(value["low"]), float(value["high"]))


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


def study_report(values: Mapping[str, Any], path: Path) -> Document:
    """Return the page of a study: a summary, its table, all rows."""
    sections = []
    for key in ("summary", "total"):
        if isinstance(values.get(key), dict):
            sections.append(("Summary", facts({name: value for name, value in leaves(values[key])})))
    if rows := values.get("table"):
        header = ("category", "method", "of", "", "right [95 %]", *COUNTS)
        sections.append(("By category", table(header, [_counted(row) for row in [*rows, PAPER]])))
    sections.append((f"All {len(values['rows'])} rows", _every(values["rows"])))
    kind = {name: values.get(name) for name in ("llm", "num_envs")}
    about = "; ".join([*(f"{name} {value}" for name, value in kind.items() if value is not None), provenance(values)])
    return Document(path.stem.replace("_", " "), about, tuple(sections))


def _counted(row: Mapping[str, Any]) -> tuple[object, ...]:
    bar = document.interval(row["success"] / row["n"], float(row["low"]), float(row["high"]))
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


BAR = 120
"""[px] Of a bar that reaches its bound."""


def validation_report(values: Mapping[str, Any], path: Path) -> Document:
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
