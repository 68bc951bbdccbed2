"""Pages of results: runs and sweeps, rates of episodes, studies of many objects, validation reports."""

import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from s2a.core.config import leaves
from s2a.core.provenance import curve as logged
from s2a.core.provenance import starts
from s2a.view.report import document
from s2a.view.report.document import Document, Markup, facts, images, table, text

# Rates in words; others are shown by their meanings, where a file has them, or names
NAMES = {
    "success": "opened",
    "final_success": "open at the end",
    "grasp_success": "opened, grasped",
    "handle_success": "both fingers on the handle",
    "single_finger_success": "one finger on the handle",
    "off_handle_success": "a finger beside the handle",
    "body_success": "pushed by another link",
}
BY_GROUP = ("success", "grasp_success")  # Rates that are shown by groups of parts, where a result has them
GROUPS = {"kind": "kind of joint", "handle": "handle", "room": "room"}
NEVER = 0.05  # Fraction of the episodes up to which a part counts as never opened
# Thresholds in metres
LENGTHS = ("success", "open_30cm", "open_75pct_static", "open_95pct", "closed", "drift", "disturbance")
BEFORE_AFTER = ("before.png", "after.png")


def is_rate(value: object) -> bool:
    """Return True for a fraction with its interval."""
    return isinstance(value, dict) and {"rate", "low", "high"} <= value.keys()


def rates(values: Mapping[str, Any]) -> str:
    """Return a table of the fractions with intervals among some values; of an evaluation without those beyond its plan."""
    shown = {
        name: value for name, value in values.items() if is_rate(value) and name not in values.get("beyond_plan", ())
    }
    rows = [(_words(name, values), *_interval(value)) for name, value in shown.items()]
    note = ""
    if beyond := values.get("beyond_plan"):
        names = text(", ".join(_words(name, values).lower() for name in beyond))
        note = f"<p>Not reachable by the plan, which ends at planner.opening: {names}.</p>"
    return table(("", "", "rate [95 %]"), rows) + note


def _words(name: str, values: Mapping[str, Any]) -> str:
    """Return the name of a metric in words."""
    return NAMES.get(name) or (values.get("meanings") or {}).get(name, "").split(". ")[0].rstrip(".") or name


def provenance(values: Mapping[str, Any]) -> str:
    """Return commit, versions and device in one line."""
    versions = ", ".join(f"{name} {version}" for name, version in (values.get("versions") or {}).items())
    about = {name: values.get(name) for name in ("seed", "commit", "device")} | {"": versions or None}
    return "; ".join(f"{name} {value}".strip() for name, value in about.items() if value is not None)


def evaluation(values: Mapping[str, Any], path: Path) -> Document:
    """Return the report of one evaluation, with the images that lie beside it."""
    sections = [("Rates", rates(values))]
    if numbers := [
        (_words(name, values), *(float(value[key]) for key in ("mean", "min", "max")))
        for name, value in values.items()
        if isinstance(value, dict) and {"mean", "min", "max"} <= value.keys()
    ]:
        sections.append(("Numbers", table(("", "mean", "min", "max"), numbers)))
    if use := values.get("limit_use"):
        shown = [(name.replace("_", " "), f"{100 * float(value):.0f} %") for name, value in use.items()]
        sections.append(("Peak use of the robot's limits", table(("", "of the limit"), shown)))
    if thresholds := values.get("thresholds"):
        units = {name: " [m]" if name in LENGTHS else "" for name in thresholds}
        lengths = {_words(name, values) + units[name]: value for name, value in thresholds.items()}
        sections.append(("Thresholds", facts(lengths)))
    if over := values.get("over_parts"):
        sections += _over_parts(over, values["parts"])
    if shown_images := [path.with_name(name) for name in BEFORE_AFTER if path.with_name(name).is_file()]:
        sections.append(("The first world before, and at the widest opening", images(shown_images)))
    policy, stage = values.get("policy") or "Evaluation", values.get("stage") or path.stem
    title = f"{policy}: {values['episodes']} episodes in {stage}"
    request = {name: values.get(name) for name in ("part", "robot", "task", "episode_steps")}
    about = [f"{name.replace('_', ' ')} {value}" for name, value in request.items() if value is not None]
    if "variation" in values:
        about.append(f"worlds differ in: {', '.join(values['variation']) or 'nothing, they are copies'}")
    about += [f"metrics version {values.get('metrics_version', 1)}", provenance(values)]
    return Document(title, "; ".join(about), tuple(sections))


def benchmark(values: Mapping[str, Any], path: Path) -> Document:
    """Return the report of a benchmark."""
    parts = values["parts"]
    title = f"{values['policy']}: {len(parts)} parts, {values['episodes_a_part']} episodes each"
    request = {name: values.get(name) for name in ("grasp_error", "grasp_turn")}
    about = "; ".join([path.name, *(f"{n} {v}" for n, v in request.items() if v is not None), provenance(values)])
    if cut := values.get("plans_cut"):
        about += f"; cut by the end of the episode, and counted as failures: the plans of {', '.join(cut)}"
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
# Columns of an insertion's table: how many have the right size, collide with nothing, stay,
# and leave all parts free to open
COUNTS = ("scale", "free", "stable", "openings")
# Table of insertions in "From Scan to Action", Halacheva et al., CVPR Workshops 2025; Wilson interval of 80 of 100
PAPER = dict(category="the paper's own scans", method="as published", n=100, success=80, low=0.711, high=0.867)


def study_report(values: Mapping[str, Any], path: Path) -> Document:
    """Return the page of a study: a summary, its table, all rows."""
    sections = []
    for key in ("summary", "total"):
        if isinstance(values.get(key), dict):
            sections.append(("Summary", facts({name: value for name, value in leaves(values[key])})))
    if isinstance(rows := values.get("table"), dict):
        sections.append(("Table", facts({name: value for name, value in leaves(rows)})))
    elif rows and "success" in rows[0]:
        header = ("category", "method", "of", "", "right [95 %]", *COUNTS)
        sections.append(("By category", table(header, [_counted(row) for row in [*rows, PAPER]])))
    elif rows:
        sections.append(("Table", _every(rows)))
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


OPENED = 0.5  # Fraction of the planner's episodes from which on a part counts as opened


def rooms(values: Mapping[str, Any], path: Path) -> Document:
    """Return the page of a data set: a verdict a room, an image of each, its parts, and why others were left out."""
    rows = values["verdicts"]
    # Those of a row that key 'leave_out' names are not in the index.
    files = Counter(part["room"] for part in values["parts"])
    counts = [sum(files[room] for room in {part["room"] for part in row["parts"]}) for row in rows]
    overview = [_room(row, count) for row, count in zip(rows, counts, strict=True)]
    header = ("room", "", "parts that move", "in the index", "certified", "opened by the planner", "minutes", "reason")
    minutes = sum(sum(row["seconds"].values()) for row in rows) / 60
    sections = [(f"{len(rows)} rooms", table(header, overview))]
    shown = [
        (f"{row['name']}: {_verdict(row, count)}", file.read_bytes())
        for row, count in zip(rows, counts, strict=True)
        if row["image"] and (file := path.parent / row["image"]).is_file()
    ]
    if shown:
        note = "<p>Fronts: green, opened by the planner; blue, in the index; red, left out.</p>"
        sections.append(("Images", note + document.figures(shown)))
    stages = list(dict.fromkeys(stage for row in rows for stage in row["seconds"]))
    seconds = [(row["name"], *(row["seconds"].get(stage) for stage in stages)) for row in rows]
    parts = [
        (row["name"], part, *(verdict.get(key) for key in ("success", "grasp_success", "certified", "failed_checks")))
        for row in rows
        for part, verdict in row["verdicts"].items()
    ]
    sections.append(("Parts", table(("room", "part", "opened", "grasped", "certified", "failed checks"), parts)))
    sections.append(("Left out", table(("room/part", "reason"), list(values["left_out"].items()))))
    sections.append(("Seconds a stage", table(("room", *stages), seconds)))
    bad = sum(bool(row["failed"]) for row in rows)
    title = f"{len(values['parts'])} parts of {len(rows)} rooms"
    return Document(title, f"{bad} rooms failed; {minutes:.1f} minutes; {provenance(values)}", tuple(sections))


def _room(row: Mapping[str, Any], count: int) -> tuple[object, ...]:
    verdicts = row["verdicts"].values()
    certified = [verdict["certified"] for verdict in verdicts if "certified" in verdict]
    opened = [verdict["success"] >= OPENED for verdict in verdicts if "success" in verdict]
    return (
        row["name"],
        _status("fail" if row["failed"] else "pass"),
        len(row["parts"]) + len(row["left_out"]),
        count,
        f"{sum(certified)} of {len(certified)}" if certified else None,
        f"{sum(opened)} of {len(opened)}" if opened else None,
        round(sum(row["seconds"].values()) / 60, 1),
        row["failed"],
    )


def _verdict(row: Mapping[str, Any], count: int) -> str:
    """Return in a few words what became of a room, of which `count` parts are in the index."""
    if row["failed"]:
        return f"failed, {row['failed']}"
    rates = [verdict["success"] for verdict in row["verdicts"].values() if "success" in verdict]
    opened = f", {sum(rate >= OPENED for rate in rates)} opened" if rates else ""
    return f"{count} parts{opened}; {len(row['left_out'])} left out"


BAR = 120  # [px] Of a bar that reaches its bound


def validation_report(
    values: Mapping[str, Any], path: Path, shown: Mapping[str, Sequence[tuple[str, bytes]]] | None = None
) -> Document:
    """Return the page of a report.json. `shown`: captions and image files of each part, above its checks."""
    reports = values["reports"]
    good = sum(bool(each["passed"]) for each in reports)
    verdicts = [_status("pass" if each["passed"] else "fail") for each in reports]
    overview = [
        (e["target"], verdict, _grip(e), _failed(e), e.get("seconds"))
        for e, verdict in zip(reports, verdicts, strict=True)
    ]
    sections = [("Parts", table(("part", "verdict", "a parallel gripper", "failed checks", "seconds"), overview))]
    for each in reports:
        header = ("check", "", "measured", "bound", "of the bound", "prim", "message", "remedy")
        figures = document.figures((shown or {}).get(each["target"], ()))
        checks = table(header, [_row(check) for check in each["checks"]])
        sections.append((each["target"] or "stage", figures + checks))
    stage = Path(reports[0]["stage"]).name if reports else path.parent.name
    about = provenance(reports[0].get("provenance") or {}) if reports else ""
    if reports and (sha256 := reports[0].get("sha256")):
        about = f"{reports[0]['stage']}, SHA-256 {sha256}; {about}"
    return Document(f"{stage}: {good} of {len(reports)} parts passed", about, tuple(sections))


def _row(check: Mapping[str, Any]) -> tuple[object, ...]:
    numbers = [
        None if check[key] is None else f"{check[key]:.4g} {check['unit']}".strip() for key in ("value", "bound")
    ]
    cells = [Markup(text(number or ""), "n") for number in numbers]
    return (
        check["name"],
        _status(check["status"]),
        *cells,
        _bar(check),
        check["prim"],
        check["message"],
        check["remedy"],
    )


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


@dataclass(frozen=True)
class Reported:
    """A row of the paper's table."""

    asset: str  # what is opened
    weights: tuple[float, float, float, float]  # of distance, rotation, opening and finger
    opened: str  # fraction of the episodes, in words
    handle: str  # "used" or "not used", by the robot


TERMS = ("distance", "rotation", "opening", "finger")
TWIN, SCAN = "synthetic asset", "real scan"
TABLE = (
    Reported(TWIN, (1.5, 1.5, 10.0, 2.0), "98 %", "used"),
    Reported(SCAN, (1.5, 1.5, 10.0, 2.0), "87 to 88 %", "not used"),
    Reported(SCAN, (50.5, 50.5, 10.0, 50.0), "74 %", "used"),
)


def reported(reward: Mapping[str, Any], stage: str) -> Reported | None:
    """Return the row of the paper's table with the same weights, or None; further terms that weigh something make another reward.

    `reward`: weights by term; `stage`: name of the file, "twin" in it for a CAD twin.
    """
    weights = tuple(float(reward.get(term, 0.0)) for term in TERMS)
    asset = TWIN if "twin" in stage else SCAN
    further = ("pinch", "grasped_opening", "grasped_path", "led_opening", "closing", "grip")
    own = any(reward.get(term) for term in further)
    return None if own else next((row for row in TABLE if (row.asset, row.weights) == (asset, weights)), None)


SETTINGS, METRICS = "settings.json", "metrics.json"
# Fractions of the episodes that are drawn, in the order of their colours
SHOWN = ("success", "final_success", "handle_success", "grasp_success")
COMPARED = (*SHOWN, "single_finger_success")  # Fractions in the table of several runs
# Keys of `s2a train` in which the runs of a sweep may differ without a meaning
NOT_SETTINGS = ("out", "resume", "device", "export", "init", "planner")


@dataclass(frozen=True)
class Run:
    """A training."""

    name: str  # by which it is known among others
    settings: Mapping[str, Any]  # nested, as `s2a train` keeps them; empty where nobody kept them
    # columns by name, a value a logged iteration, NaN where none was logged; "env_steps" among them
    curve: Mapping[str, Sequence[float]]
    recent: Mapping[str, Any]  # rates of the last episodes or of an evaluation, with intervals
    about: Mapping[str, Any]  # seed, commit, versions, device
    seconds: float | None = None  # it took [s]

    @property
    def millions(self) -> float:
        """Environment steps that it had, in millions."""
        return float(self.about.get("env_steps") or max(self.curve.get("env_steps", [0.0]), default=0.0)) / 1e6

    @property
    def reported(self) -> Reported | None:
        """What the paper reports of a run with these weights."""
        return reported(self.settings.get("reward", {}), str(self.settings.get("stage", "")))


def of_folder(folder: Path) -> Run:
    """Read a run's folder; a run that was cut has no metrics.json, and its log is read instead."""
    settings = json.loads((folder / SETTINGS).read_text())
    if (folder / METRICS).is_file():
        return of_metrics(json.loads((folder / METRICS).read_text()), folder.name, settings)
    rows, begun = logged(folder), starts(folder)
    steps = settings["num_envs"] * settings["ppo"]["num_steps_per_env"]
    about = {"seed": settings["seed"], **(begun[-1] if begun else {})}
    return Run(folder.name, settings, _columns(rows, steps), {}, about)


def of_metrics(metrics: Mapping[str, Any], name: str, settings: Mapping[str, Any]) -> Run:
    """Return the run of a metrics.json."""
    rows = metrics["curve"]
    last = max((row["iteration"] for row in rows), default=0)
    curve = _columns(rows, metrics["env_steps"] / (1 + last))
    return Run(name, settings, curve, metrics.get("recent", {}), metrics, metrics.get("seconds"))


def of_table(row: Mapping[str, Any]) -> Run:
    """Return a run of a table of experiments, whose rates are those of its evaluation."""
    curve = {k: [math.nan if v is None else v for v in values] for k, values in row.get("curve", {}).items()}
    settings = {**row.get("settings", {}), "stage": row.get("stage", "")}
    name = row.get("about") or row.get("run") or row["row"]
    measured = row["evaluation"]
    curve.setdefault("env_steps", [row["env_steps"]])
    return Run(name, settings, curve, measured, {**measured, "seed": row["seed"]})


def report(run: Run) -> Document:
    """Return the page of one run."""
    sections = [("Curves", curves([run]))]
    if measured := {name: value for name, value in run.recent.items() if is_rate(value)}:
        note = (
            "<p>With exploration noise and starts on the planner's motion; s2a evaluate measures a policy without.</p>"
        )
        sections.append(("Episodes at the end of the training", note + rates(measured)))
    sections += _beside([run])
    effort = {"environment steps [millions]": run.millions or None, "seconds": run.seconds}
    effort |= {"steps a second": run.about.get("env_steps_per_second"), "worlds": run.about.get("num_envs")}
    sections.append(("Effort", facts(effort)))
    if run.settings:
        sections.append(("Settings", facts({key: str(value) for key, value in leaves(run.settings)})))
    cut = " (not finished)" if run.seconds is None else ""
    return Document(f"Training {run.name}{cut}", provenance(run.about), tuple(sections))


def compare(name: str, runs: Sequence[Run]) -> Document:
    """Return the page of several runs: those of one name are seeds of one row; the paper's figure stands beside measured ones."""
    shown = [column for column in COMPARED if any(is_rate(run.recent.get(column)) for run in runs)]
    rows = []
    for row in dict.fromkeys(run.name for run in runs):
        seeds = [run for run in runs if run.name == row]
        cells = [_percents([run.recent.get(column) for run in seeds]) for column in shown]
        published = seeds[0].reported if any(is_rate(run.recent.get("success")) for run in seeds) else None
        paper = f"{published.opened}, handle {published.handle}" if published else ""
        rows.append((row, len(seeds), *cells, Markup(" / ".join(f"{run.millions:.3g}" for run in seeds), "n"), paper))
    header = ("run", "seeds", *(NAMES[column] for column in shown), "steps [millions]", "paper")
    versions = sorted({int(run.about.get("metrics_version") or 1) for run in runs})
    about = f"{len(runs)} runs; metrics version {', '.join(map(str, versions))}; {provenance({**runs[0].about, 'seed': None})}"
    unfinished = [f"{run.name}, seed {run.about.get('seed')}" for run in runs if not is_rate(run.recent.get("success"))]
    note = f"<p>No rates yet: {text('; '.join(unfinished))}. Too few episodes have ended.</p>" if unfinished else ""
    sections = [("All runs", table(header, rows) + note), *_beside(runs)]
    for row in dict.fromkeys(run.name for run in runs):
        if drawn := [run for run in runs if run.name == row and len(run.curve.get("env_steps", ())) > 1]:
            sections.append((row, curves(drawn)))
    return Document(name, about, tuple(sections))


def differing(named: Mapping[str, Run], swept: Mapping[str, Mapping[str, object]]) -> list[Run]:
    """Return runs whose names are the settings in which they differ from each other, the seed aside.

    Args:
        named: the runs by folder.
        swept: overrides of the command line, by folder; where they are known for all, they are the settings.
    """
    values = {name: dict(swept[name] if name in swept else leaves(run.settings)) for name, run in named.items()}
    keys = list(dict.fromkeys(key for each in values.values() for key in each))
    free = [key for key in keys if key.split(".")[0] not in (*NOT_SETTINGS, "seed")]
    differ = [key for key in free if len({str(each.get(key)) for each in values.values()}) > 1]
    names = {name: ", ".join(f"{key}={each.get(key)}" for key in differ) for name, each in values.items()}
    return [Run(names[n] or "all seeds", r.settings, r.curve, r.recent, r.about, r.seconds) for n, r in named.items()]


def curves(runs: Sequence[Run]) -> str:
    """Return figures of the fractions and of the mean reward over environment steps; a line a run."""
    figures = [
        _figure("fraction of recent training episodes [%]", [c for c in SHOWN if _logged(runs, c)], runs, 0.01, 100.0),
        _figure("mean reward of an episode", [c for c in ("reward",) if _logged(runs, c)], runs, 1.0, None),
    ]
    return f"<div class='grid'>{''.join(figures)}</div>"


def _figure(title: str, columns: list[str], runs: Sequence[Run], unit: float, top: float | None) -> str:
    series = []
    for column, run in ((column, run) for column in columns for run in runs if column in run.curve):
        x, y = [steps / 1e6 for steps in run.curve["env_steps"]], run.curve[column]
        series.append(document.Line(NAMES.get(column, column), x[: len(y)], y))
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
