"""Reports from files, by their contents."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from s2a.core.errors import InputError
from s2a.view.report import results
from s2a.view.report import results as training
from s2a.view.report.document import Document

T = TypeVar("T")
KINDS = (
    "a run of s2a train, a folder of such runs, a JSON file of s2a evaluate, s2a bench or experiments/results, "
    "or a folder or report.json of s2a certify"
)
RUNS = ("*", "*/*", "*/*/*")
"""Where the runs of a sweep lie in its folder."""
DAMAGE = (KeyError, TypeError, ValueError, AttributeError, IndexError, ZeroDivisionError, RecursionError)
"""What values of other types, or missing ones, raise while a page is made of them."""


def read(path: Path) -> Document:
    """Return the report of a file or folder.

    Raises:
        InputError: it does not exist, is nothing that can be reported, or is damaged.
    """
    if not path.exists():
        raise InputError(f"{path}: does not exist; give {KINDS}")
    return _whole(path, _folder if path.is_dir() else _file)


def _whole(path: Path, make: Callable[[Path], T]) -> T:
    """Return what is made of a path; raise an InputError if it is damaged."""
    try:
        return make(path)
    except DAMAGE as error:
        problem = f"{type(error).__name__}: {error}"
        raise InputError(f"{path}: damaged, or of another version ({problem}); write it again") from error


def _folder(path: Path) -> Document:
    if (path / training.SETTINGS).is_file():
        return training.report(training.of_folder(path))
    if (path / "report.json").is_file():
        return _file(path / "report.json")
    found = sorted(file.parent for depth in RUNS for file in path.glob(f"{depth}/{training.SETTINGS}"))
    if not found:
        raise InputError(f"{path}: holds no run and no validation report; give {KINDS}")
    runs = {str(folder.relative_to(path)): _whole(folder, training.of_folder) for folder in found}
    return training.compare(f"Sweep {path.name}", training.differing(runs))


def _file(path: Path) -> Document:
    values = _json(path)
    match values:
        case {"reports": list()}:
            return results.validation_report(values, path)
        case {"curve": list(), "env_steps": _}:
            settings = path.with_name(training.SETTINGS)
            kept = json.loads(settings.read_text()) if settings.is_file() else {}
            return training.report(training.of_metrics(values, path.parent.name if kept else path.stem, kept))
        case {"runs": [dict(), *_] as runs}:
            return training.compare(path.stem.replace("_", " "), [training.of_table(run) for run in runs])
        case {"episodes_a_part": _, "over_parts": dict()}:
            return results.benchmark(values, path)
        case {"episodes": int()}:
            return results.evaluation(values, path)
        case {"rows": [dict(), *_]}:
            return results.study_report(values, path)
    raise InputError(f"{path}: nothing that can be reported; give {KINDS}")


def _json(path: Path) -> dict[str, Any]:
    try:
        values = json.loads(path.read_text())
    except ValueError as error:
        raise InputError(f"{path}: not JSON ({error}); give {KINDS}") from error
    return values if isinstance(values, dict) else {}
