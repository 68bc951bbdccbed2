"""Cards of parts on the page: their row in the tree, and the remarks of reports and insertions."""

import html
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from s2a.core.errors import InputError
from s2a.scene import artefacts
from s2a.scene.artefacts import Artefact
from s2a.scene.scene import Joint
from s2a.scene.usd.stamp import content_hash
from s2a.view.page.room import PagePart, PageRoom, unit

Note = tuple[tuple[str, str], ...]  # Names and values that a card shows
REPORT, INSERTION, LAYER = "report.json", "insert.json", "insert.usda"
PLACE = "place"  # The step of an insertion from which on its object is there
# What values of other types, or missing ones, raise while notes are made of them
DAMAGE = (KeyError, TypeError, ValueError, AttributeError, IndexError, RecursionError)


def of_path(path: Path) -> tuple[Path, dict[str, Note]]:
    """Return the stage to show, and what is noted of its parts: a folder of s2a certify or s2a insert has both.

    Raises:
        InputError: a damaged file, or one whose stage does not exist.
    """
    row = artefacts.recognised(path, "notes")
    return row.notes(path) if row and row.notes else (path, {})


def inserted(path: Path, noted: Mapping[str, Note]) -> tuple[str, ...]:
    """Return the ids of what an insertion put there, in its order; none for other paths."""
    row = artefacts.recognised(path, "notes")
    return tuple(noted) if row and row.name == INSERTED else ()


def _read(
    file: Path, read: Callable[[Path, Mapping[str, Any]], tuple[Path, dict[str, Note]]]
) -> tuple[Path, dict[str, Note]]:
    try:
        stage, notes = read(file, json.loads(file.read_text()))
    except DAMAGE as error:
        raise InputError(
            f"{file}: damaged, or of another version ({type(error).__name__}: {error}); write it again"
        ) from error
    if not stage.is_file():
        raise InputError(f"{file}: is of {stage}, which does not exist here; give path= the stage itself")
    return stage, notes


def _validation(file: Path, values: Mapping[str, Any]) -> tuple[Path, dict[str, Note]]:
    reports = values["reports"]
    stage = Path(reports[0]["stage"])
    changed = stage.is_file() and content_hash(stage) != reports[0]["sha256"]
    return stage, {str(each["target"]): _verdict(each, changed) for each in reports}


def _verdict(report: Mapping[str, Any], changed: bool) -> Note:
    checks = report["checks"]
    failed = [check for check in checks if check["status"] == "fail"]
    verdict = f"{'failed' if failed else 'passed'}, {len(checks)} checks" + ", before the file was changed" * changed
    return (("validation", verdict), *((str(check["name"]), _measured(check)) for check in failed))


def _measured(check: Mapping[str, Any]) -> str:
    number = "" if check["value"] is None else f"{check['value']:.4g} {check['unit']}".strip()
    bound = "" if check["bound"] is None else f", bound {check['bound']:.4g}"
    return f"{number}{bound}: {check['message']}; {check['remedy']}".strip(": ;")


def _insertion(file: Path, values: Mapping[str, Any]) -> tuple[Path, dict[str, Note]]:
    done = [each for each in values["objects"] if not each["problem"]]
    return file.with_name(LAYER), {str(each["id"]): _steps(each) for each in done}


def _steps(record: Mapping[str, Any]) -> Note:
    """Return the steps of an insertion in their order; those that it does not have are left out."""
    plan, scale, surface, pose, rest = (record.get(key, {}) for key in ("plan", "scale", "surface", "pose", "verify"))
    first = (plan.get("choices") or [{}])[0]
    steps = {
        "placement hint": record.get("hint"),
        "plan": plan
        and f"{first.get('relation', 'on')} {first.get('target')}, near {plan.get('near')}: {first.get('reason')}",
        "size": scale and f"{_lengths(scale['size'])} m, {scale.get('method')}: {scale.get('reason')}",
        "surface": surface and f"{surface.get('kind')}, of {surface.get('target')}, at {surface.get('height'):.3g} m",
        PLACE: pose and f"({', '.join(f'{x:.2f}' for x in pose['position'])}) m",
        "at rest": rest and f"moved {1000 * rest['drift']:.1f} mm, tilted {math.degrees(rest['tilt']):.1f} degrees",
    }
    return tuple((name, str(value)) for name, value in steps.items() if value)


def _lengths(values: list[float]) -> str:
    return " x ".join(f"{side:.3g}" for side in values)


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
    movement = motion(room.parts[part])
    return f"{INDENT * depth}{part}" + (f" \u00b7 {movement}" if movement else "")


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
    return "".join(_table(part, note) for part, note in room.notes.items())


def step_card(part: str, name: str, value: str) -> str:
    """Return a step of an insertion as HTML."""
    return _table(part, [(name, value)])


def _table(title: str, values: Iterable[tuple[str, str]]) -> str:
    lines = (f"<tr><td>{html.escape(name)}</td><td>{html.escape(value)}</td></tr>" for name, value in values)
    return f"<div class='s2a-card'><b>{html.escape(title)}</b><table>{''.join(lines)}</table></div>"


def _numbers(values: tuple[float, ...]) -> str:
    return f"({', '.join(f'{round(value, 3) + 0.0:g}' for value in values)})"


INSERTED = "a folder of s2a insert"
artefacts.register(
    Artefact(
        "a folder of s2a certify",
        lambda path: (path / REPORT).is_file(),
        notes=lambda path: _read(path / REPORT, _validation),
    ),
    Artefact(
        INSERTED, lambda path: (path / INSERTION).is_file(), notes=lambda path: _read(path / INSERTION, _insertion)
    ),
)
