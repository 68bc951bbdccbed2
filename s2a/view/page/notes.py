"""What a validation report or an insertion says of the parts of a room, for their cards."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from s2a.core.errors import InputError
from s2a.scene.usd.stamp import content_hash

Note = tuple[tuple[str, str], ...]
"""Names and values that a card shows."""
REPORT, INSERTION, LAYER = "report.json", "insert.json", "insert.usda"
PLACE = "place"
"""The step of an insertion from which on its object is there."""
DAMAGE = (KeyError, TypeError, ValueError, AttributeError, IndexError, RecursionError)
"""What values of other types, or missing ones, raise while notes are made of them."""


def of_path(path: Path) -> tuple[Path, dict[str, Note]]:
    """Return the stage to show, and what is noted of its parts: a folder of s2a certify or s2a insert has both.

    Raises:
        InputError: a damaged file, or one whose stage does not exist.
    """
    for name, read in ((REPORT, _validation), (INSERTION, _insertion)):
        if (path / name).is_file():
            return _read(path / name, read)
    return path, {}


def inserted(path: Path, noted: Mapping[str, Note]) -> tuple[str, ...]:
    """Return the ids of what an insertion put there, in its order; none for other paths."""
    return tuple(noted) if (path / INSERTION).is_file() and not (path / REPORT).is_file() else ()


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
    return tuple((name, str(told)) for name, told in steps.items() if told)


def _lengths(values: list[float]) -> str:
    return " x ".join(f"{side:.3g}" for side in values)
