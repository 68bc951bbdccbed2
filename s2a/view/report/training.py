"""Training: one run, a sweep of them, or the runs of a published table; the paper's figures beside those with its weights."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from s2a.core import aliases, errors
from s2a.core.config import leaves
from s2a.view.report import document
from s2a.view.report.document import Document, Markup, facts, table
from s2a.view.report.results import NAMES, is_rate, provenance, rates


@dataclass(frozen=True)
class Reported:
    """A row of the paper's table.

    Attributes:
        asset: what is opened.
        weights: of distance, rotation, opening and finger.
        opened: fraction of the episodes, in words.
        handle: "used" or "not used", by the robot.
    """

    asset: str
    weights: tuple[float, float, float, float]
    opened: str
    handle: str


TERMS = ("distance", "rotation", "opening", "finger")
TWIN, SCAN = "synthetic asset", "real scan"
TABLE = (
    Reported(TWIN, (1.5, 1.5, 10.0, 2.0), "98 %", "used"),
    Reported(SCAN, (1.5, 1.5, 10.0, 2.0), "87 to 88 %", "not used"),
    Reported(SCAN, (50.5, 50.5, 10.0, 50.0), "74 %", "used"),
)


def reported(reward: Mapping[str, Any], stage: str) -> Reported | None:
    """Return the row of the paper's table with the same weights, or None; further terms that weigh something make another reward.

    Args:
        reward: weights by term.
        stage: name of the file, "twin" in it for a CAD twin.
    """
    weights = tuple(float(reward.get(term, 0.0)) for term in TERMS)
    asset = TWIN if "twin" in stage else SCAN
    own = any(
        reward.get(term) for term in ("pinch", "grasped_opening", "grasped_path", "led_opening", "closing", "grip")
    )
    return None if own else next((row for row in TABLE if (row.asset, row.weights) == (asset, weights)), None)


SETTINGS, METRICS = "settings.json", "metrics.json"
SHOWN = ("success", "final_success", "handle_success", "grasp_success")
"""Fractions of the episodes that are drawn, in the order of their colours."""
COMPARED = (*SHOWN, "single_finger_success")
"""Fractions in the table of several runs."""
NOT_SETTINGS = ("out", "resume", "device", "export", "init", "planner")
"""Keys of `s2a train` in which the runs of a sweep may differ without a meaning."""


@dataclass(frozen=True)
class Run:
    """A training.

    Attributes:
        name: by which it is known among others.
        settings: nested, as `s2a train` keeps them; empty where nobody kept them.
        curve: columns by name, a value a logged iteration, NaN where none was logged; "env_steps" among them.
        recent: rates of the last episodes or of an evaluation, with intervals.
        about: seed, commit, versions, device.
        seconds: it took [s].
    """

    name: str
    settings: Mapping[str, Any]
    curve: Mapping[str, Sequence[float]]
    recent: Mapping[str, Any]
    about: Mapping[str, Any]
    seconds: float | None = None

    @property
    def millions(self) -> float:
        """Environment steps that it had, in millions."""
        return max(self.curve.get("env_steps", [0.0]), default=0.0) / 1e6

    @property
    def reported(self) -> Reported | None:
        """What the paper reports of a run with these weights."""
        return reported(self.settings.get("reward", {}), str(self.settings.get("stage", "")))


def of_folder(folder: Path) -> Run:
    """Read a run's folder; a run that was cut has no metrics.json, and its log is read instead."""
    settings = json.loads((folder / SETTINGS).read_text())
    aliases.complete(settings)
    if (folder / METRICS).is_file():
        return of_metrics(json.loads((folder / METRICS).read_text()), folder.name, settings)
    with errors.required():
        from s2a.learn.rl import run_folder

        rows, starts = run_folder.curve(folder), run_folder.starts(folder)
    steps = settings["num_envs"] * settings["ppo"]["num_steps_per_env"]
    about = {"seed": settings["seed"], **(starts[-1] if starts else {})}
    return Run(folder.name, settings, _columns(rows, steps), {}, about)


def of_metrics(metrics: Mapping[str, Any], name: str, settings: Mapping[str, Any]) -> Run:
    """Return the run of a metrics.json."""
    rows = metrics["curve"]
    last = max((row["iteration"] for row in rows), default=0)
    curve = _columns(rows, metrics["env_steps"] / (1 + last))
    return Run(name, settings, curve, metrics.get("recent", {}), metrics, metrics.get("seconds"))


def of_table(row: Mapping[str, Any]) -> Run:
    """Return a run of a table of experiments, whose rates are those of its evaluation."""
    logged = aliases.curve(row.get("curve", {}))
    curve = {k: [math.nan if v is None else v for v in values] for k, values in logged.items()}
    settings = {**row.get("settings", {}), "stage": row.get("stage", "")}
    name = row.get("about") or row.get("run") or row["row"]
    measured = aliases.renamed(row["evaluation"], aliases.METRICS)
    curve.setdefault("env_steps", [row["env_steps"]])
    return Run(name, settings, curve, measured, {**measured, "seed": row["seed"]})


def report(run: Run) -> Document:
    """Return the page of one run."""
    sections = [("Curves", curves([run]))]
    if measured := {name: value for name, value in run.recent.items() if is_rate(value)}:
        note = "<p>Exploration's noise and eased starts included; a policy is measured by s2a evaluate.</p>"
        sections.append(("Episodes at the end of the training", note + rates(measured)))
    sections += _beside([run])
    told = {"environment steps [millions]": run.millions or None, "seconds": run.seconds}
    told |= {"steps a second": run.about.get("env_steps_per_second"), "worlds": run.about.get("num_envs")}
    sections.append(("Effort", facts(told)))
    if run.settings:
        sections.append(("Settings", facts({key: str(value) for key, value in leaves(run.settings)})))
    cut = " (not finished)" if run.seconds is None else ""
    return Document(f"Training {run.name}{cut}", provenance(run.about), tuple(sections))


def compare(name: str, runs: Sequence[Run]) -> Document:
    """Return the page of several runs: those of one name are seeds of one row."""
    shown = [column for column in COMPARED if any(is_rate(run.recent.get(column)) for run in runs)]
    rows = []
    for row in dict.fromkeys(run.name for run in runs):
        seeds = [run for run in runs if run.name == row]
        cells = [_percents([run.recent.get(column) for run in seeds]) for column in shown]
        said = seeds[0].reported
        told = f"{said.opened}, handle {said.handle}" if said else ""
        rows.append((row, len(seeds), *cells, Markup(" / ".join(f"{run.millions:.3g}" for run in seeds), "n"), told))
    header = ("run", "seeds", *(NAMES[column] for column in shown), "steps [millions]", "paper")
    versions = sorted({int(run.about.get("metrics_version") or 1) for run in runs})
    about = f"{len(runs)} runs; metrics version {', '.join(map(str, versions))}; {provenance({**runs[0].about, 'seed': None})}"
    sections = [("All runs", table(header, rows)), *_beside(runs)]
    for row in dict.fromkeys(run.name for run in runs):
        if drawn := [run for run in runs if run.name == row and len(run.curve.get("env_steps", ())) > 1]:
            sections.append((row, curves(drawn)))
    return Document(name, about, tuple(sections))


def differing(named: Mapping[str, Run]) -> list[Run]:
    """Return runs whose names are the settings in which they differ from each other, the seed aside."""
    values = {name: dict(leaves(run.settings)) for name, run in named.items()}
    keys = sorted({key for each in values.values() for key in each})
    free = [key for key in keys if key.split(".")[0] not in (*NOT_SETTINGS, "seed")]
    differ = [key for key in free if len({str(each.get(key)) for each in values.values()}) > 1]
    told = {name: ", ".join(f"{key}={each.get(key)}" for key in differ) for name, each in values.items()}
    return [Run(told[n] or "all seeds", r.settings, r.curve, r.recent, r.about, r.seconds) for n, r in named.items()]


def curves(runs: Sequence[Run]) -> str:
    """Return figures of the fractions and of the mean reward over environment steps; a line a run."""
    figures = [
        _figure("fraction of recent training episodes [%]", [c for c in SHOWN if _logged(runs, c)], runs, 0.01, 100.0),
        _figure("mean reward of an episode", [c for c in ("reward",) if _logged(runs, c)], runs, 1.0, None),
    ]
    return f"<div class='grid'>{''.join(figures)}</div>"


def _figure(title: str, columns: list[str], runs: Sequence[Run], unit: float, top: float | None) -> str:
    series = [
        document.Line(
            NAMES.get(column, column),
            [x / 1e6 for x in run.curve["env_steps"]][: len(run.curve[column])],
            run.curve[column],
        )
        for column in columns
        for run in runs
        if column in run.curve
    ]
    return document.lines(title, "environment steps [millions]", series, unit, top) if series else ""


def _logged(runs: Sequence[Run], column: str) -> bool:
    return any(column in run.curve for run in runs)


def _columns(rows: Sequence[Mapping[str, float]], steps: float) -> dict[str, list[float]]:
    """Return the columns of a curve that was logged row by row."""
    names = dict.fromkeys(name for row in rows for name in row)
    columns = {name: [float(row.get(name, math.nan)) for row in rows] for name in names}
    return columns | {"env_steps": [steps * (1 + row["iteration"]) for row in rows]}


def _percents(values: Sequence[Any]) -> Markup:
    return Markup(" / ".join(f"{100 * value['rate']:.3g}" if is_rate(value) else "-" for value in values) + " %", "n")


def _beside(runs: Sequence[Run]) -> list[tuple[str, str]]:
    """Return the paper's table, if any run has its weights."""
    if not any(run.reported for run in runs):
        return []
    rows = [(row.asset, str(row.weights), row.opened, row.handle) for row in TABLE]
    note = "<p>1.2 billion steps of one real drawer; no intervals are given, nor when a handle counts as used.</p>"
    header = ("the paper's", "distance, rotation, opening, finger", "opened", "handle")
    return [("The paper's table", note + table(header, rows))]
