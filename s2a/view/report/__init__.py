"""Reports from files, by their contents."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import yaml

from s2a.core.errors import InputError
from s2a.scene import artefacts
from s2a.scene.artefacts import Artefact, values
from s2a.view.report import results
from s2a.view.report.document import Document

T = TypeVar("T")
RUNS = ("*", "*/*", "*/*/*")  # Where the runs of a sweep lie in its folder
RECORD = "report.json"
# What values of other types, or missing ones, raise while a page is made of them
DAMAGE = (
    KeyError,
    TypeError,
    ValueError,
    AttributeError,
    IndexError,
    ZeroDivisionError,
    RecursionError,
    yaml.YAMLError,
)


def read(path: Path) -> Document:
    """Return the report of a file or folder.

    Raises:
        InputError: it does not exist, is nothing that can be reported, or is damaged.
    """
    row = artefacts.recognised(path, "report")
    if row is None and path.is_file():
        _whole(path, _check_json)
    make = (row or artefacts.find(path, "report")).report
    assert make is not None
    return _whole(path, make)


def _whole(path: Path, make: Callable[[Path], T]) -> T:
    """Return what is made of a path; raise an InputError if it is damaged."""
    try:
        return make(path)
    except DAMAGE as error:
        problem = f"{type(error).__name__}: {error}"
        raise InputError(f"{path}: damaged, or of another version ({problem}); write it again") from error


def _check_json(path: Path) -> None:
    try:
        json.loads(path.read_text())
    except ValueError as error:
        raise InputError(f"{path}: not JSON ({error}); give a JSON file of results, or a folder of a run") from error


def _runs(path: Path) -> list[Path]:
    return sorted(file.parent for depth in RUNS for file in path.glob(f"{depth}/{results.SETTINGS}"))


def _sweep(path: Path) -> Document:
    runs = {str(folder.relative_to(path)): _whole(folder, results.of_folder) for folder in _runs(path)}
    given = {name: _overrides(path / name) for name in runs}
    swept = {name: values for name, values in given.items() if values is not None}
    rows = results.differing(runs, swept if len(swept) == len(runs) else {})
    count = len({run.name for run in rows})
    return results.compare(f"{path.name}: {count} settings, {len(rows)} trainings", rows)


def _overrides(run: Path) -> dict[str, str] | None:
    """Return the keys that the command line gave to a job of a sweep, as Hydra keeps them beside its run; None: it does not."""
    file = run.parent / ".hydra/overrides.yaml"
    if not file.is_file():
        return None
    pairs = (str(each).lstrip("+~").partition("=") for each in yaml.safe_load(file.read_text()))
    return {key: value for key, _, value in pairs}


def _metrics(path: Path) -> Document:
    file = path.with_name(results.SETTINGS)
    settings = json.loads(file.read_text()) if file.is_file() else {}
    return results.report(results.of_metrics(values(path), path.parent.name if settings else path.stem, settings))


def _has(path: Path, **kinds: type) -> bool:
    """Return whether a JSON file has these keys, with values of these types."""
    content = values(path)
    return all(key in content and isinstance(content[key], kind) for key, kind in kinds.items())


def _rows(path: Path, key: str) -> bool:
    """Return whether a JSON file has a list of records, with at least one, under a key."""
    return _has(path, **{key: list}) and isinstance(next(iter(values(path)[key]), None), dict)


artefacts.register(
    Artefact(
        "an index of s2a dataset",
        lambda path: _rows(path, "verdicts"),
        report=lambda path: results.rooms(values(path), path),
    ),
    Artefact(
        "a run of s2a train",
        lambda path: (path / results.SETTINGS).is_file(),
        report=lambda path: results.report(results.of_folder(path)),
    ),
    Artefact(
        "a folder of s2a certify",
        lambda path: (path / RECORD).is_file(),
        report=lambda path: results.validation_report(values(path / RECORD), path / RECORD),
    ),
    Artefact("a folder of runs", lambda path: path.is_dir() and bool(_runs(path)), report=_sweep),
    Artefact(
        "a report.json of s2a certify",
        lambda path: _has(path, reports=list),
        report=lambda path: results.validation_report(values(path), path),
    ),
    Artefact("a metrics.json of s2a train", lambda path: _has(path, curve=list, env_steps=object), report=_metrics),
    Artefact(
        "a JSON table of runs",
        lambda path: _rows(path, "runs"),
        report=lambda path: results.compare(
            path.stem.replace("_", " "), [results.of_table(run) for run in values(path)["runs"]]
        ),
    ),
    Artefact(
        "a JSON file of s2a bench",
        lambda path: _has(path, episodes_a_part=object, over_parts=dict),
        report=lambda path: results.benchmark(values(path), path),
    ),
    Artefact(
        "a JSON file of s2a evaluate",
        lambda path: _has(path, episodes=int),
        report=lambda path: results.evaluation(values(path), path),
    ),
    Artefact(
        "a JSON file of a study",
        lambda path: _rows(path, "rows"),
        report=lambda path: results.study_report(values(path), path),
    ),
)
