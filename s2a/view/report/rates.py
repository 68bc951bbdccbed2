"""Rates of episodes: of one evaluation, and of a benchmark part by part."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from s2a.core import aliases
from s2a.view.report import chart
from s2a.view.report.document import Document, Markup, facts, images, table

NAMES = {
    "success": "opened",
    "final_success": "open at the end",
    "grasp_success": "opened, grasped",
    "handle_success": "both fingers on the handle",
    "single_finger_success": "one finger on the handle",
    "off_handle_success": "a finger beside the handle",
    "body_success": "pushed by another link",
}
"""Columns of open_part in words; others are shown by their names."""
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
    values = aliases.renamed(values, aliases.METRICS)
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
        rows = [
            (group, row["parts"], *_interval(row["success"]), *_interval(row["grasp_success"]))
            for group, row in over.get(key, {}).items()
        ]
        sections.append((f"By {name}", table((name, "parts", "", "opened [95 %]", "", "grasped [95 %]"), rows)))
    never = [
        (row["room"], row["part"], row["kind"], row["handle"], f"{100 * row['success']:.0f} %")
        for row in parts
        if row["success"] <= NEVER
    ]
    title = f"Opened in {100 * NEVER:.0f} % of the episodes or fewer: {len(never)} parts"
    return [*sections, (title, table(("room", "part", "joint", "handle", "opened"), never))]


def _interval(value: Mapping[str, Any]) -> tuple[Markup, Markup]:
    return chart.interval(float(value["rate"]), float(value["low"]), float(value["high"]))
