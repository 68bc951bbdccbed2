"""The articulations of an Articulate3D scan: what moves, how, and how far."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import numpy as np

from s2a.core.errors import InputError
from s2a.scan import fields
from s2a.scan.fields import Record
from s2a.scene import scene
from s2a.scene.scene import Joint

_log = logging.getLogger(__name__)

_KINDS = {"rotation": "revolute", "translation": "prismatic"}
TYPES = {kind: name for name, kind in _KINDS.items()}
"""Names in the files of the kinds of joints."""
_FULL_TURN = 2 * math.pi + 0.01  # [rad]; the slack lets a rounded 6.28319 pass
_MIN_TURN = math.radians(5.0)  # [rad]; what opens turns by more, which tells 1.57 degrees from 1.57 radians
_SHORTEST_AXIS = 1e-6  # below this length an axis has no direction worth trusting


def read(path: Path, labels: Mapping[int, str], origin: np.ndarray) -> dict[int, Joint]:
    """Read the joints of a scan from its `_artic.json`, by number of the part that moves.

    Args:
        path: the file.
        labels: label of every annotated part by its number.
        origin: translation [m], shape [3], float64, that the scene's coordinates lie below the file's.

    Raises:
        InputError: a record names no annotated part, an unknown kind, a zero axis, a number that is not finite, limits
            in the wrong order, or parts that move against each other in a circle.
    """
    records = _last_records(path, labels)
    _check_bases(path, records, labels)
    units = _angle_units(path, records)
    return {number: joint(record, units[number], origin) for number, record in records.items()}


def joint(record: Record, angle_unit: float, origin: np.ndarray) -> Joint:
    """Return the joint that a record describes by type, axis, origin, rangeMin and rangeMax.

    A range that no robot can use is kept, since the part may only stand around, and a warning is logged.

    Args:
        record: the record, in the file's coordinates.
        angle_unit: what the file counts angles in [rad].
        origin: translation [m], shape [3], float64, that the scene's coordinates lie below the file's.

    Raises:
        InputError: an unknown type, a zero axis, a number that is not finite, limits in the wrong order.
    """
    if record.text("type") not in _KINDS:
        record.refuse("type", f"possible: {', '.join(_KINDS)}")
    kind = _KINDS[record.text("type")]
    axis = record.vector("axis")
    length = float(np.linalg.norm(axis))
    if not _SHORTEST_AXIS < length < math.inf:
        record.refuse("axis", "expected a direction of length 1")
    unit = angle_unit if kind == "revolute" else 1.0
    limits = record.number("rangeMin") * unit, record.number("rangeMax") * unit
    if limits[0] > limits[1]:
        record.refuse("rangeMin", f"above rangeMax {record.number('rangeMax')}; swap them")
    if wrong := scene.problems(kind, *limits):
        text = "%s: %s; s2a prepare will refuse this part: fix rangeMin and rangeMax"
        _log.warning(text, record.where, " and ".join(wrong))
    return Joint(kind, tuple(axis / length), tuple(record.vector("origin") - origin), limits)  # type: ignore[arg-type]


def _last_records(path: Path, labels: Mapping[int, str]) -> dict[int, Record]:
    """Return the last record of every moving part."""
    found: dict[int, Record] = {}
    for record in fields.load(path).record("data").records("articulations", "articulation"):
        number = record.integer("pid")
        if number not in labels:
            numbers = f"{min(labels)} to {max(labels)}" if labels else "none"
            record.refuse("pid", f"no part has this partId (found: {numbers}); take both files from one release")
        if number in found:
            _log.warning("%s: several articulations of part %d %r; the last one counts", path, number, labels[number])
        found[number] = Record(record.values, f"{path}, articulation of part {number} {labels[number]!r}")
    return found


def _check_bases(path: Path, records: Mapping[int, Record], labels: Mapping[int, str]) -> None:
    """Raise an InputError if parts move against each other in a circle; the label tree alone says what carries what."""
    graph = {number: record.integers("base").tolist() for number, record in records.items() if record.has("base")}
    for number, bases in graph.items():
        unknown = [base for base in bases if base not in labels]
        if unknown:
            _log.warning("%s: part %d has base %s, which no part is; ignored", path, number, unknown)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        circle = " -> ".join(f"{number} {labels.get(number, '')!r}" for number in reversed(error.args[1]))
        raise InputError(f"{path}: base runs in a circle: part {circle}; name what each is mounted on") from None


def _angle_units(path: Path, records: Mapping[int, Record]) -> dict[int, float]:
    """Return each record's unit of angle [rad]: 1, or a degree.

    The files count in radians. Degrees are taken for the whole file where more of its rotations make sense in degrees than in
    radians, and else for each rotation beyond a full turn alone: one screw cap does not turn every door into a slit.
    """
    turns = {
        number: max(abs(record.number("rangeMin")), abs(record.number("rangeMax")))
        for number, record in records.items()
        if record.text("type") == "rotation"
    }
    in_radians = sum(_MIN_TURN <= turn <= _FULL_TURN for turn in turns.values())
    in_degrees = sum(math.degrees(_MIN_TURN) <= turn <= 360.5 for turn in turns.values())
    widest = max(turns, key=turns.__getitem__, default=None)
    if widest is None or turns[widest] <= _FULL_TURN:
        return dict.fromkeys(records, 1.0)
    if in_degrees > in_radians:
        text = "%s: part %d turns by %g, more than 2 pi; all rotations of the file are taken as degrees"
        _log.warning(text, path, widest, turns[widest])
        return dict.fromkeys(records, math.pi / 180)
    large = [number for number, turn in turns.items() if turn > _FULL_TURN]
    for number in large:
        text = "%s: part %d turns by %g, more than 2 pi; it alone is taken as degrees: write radians"
        _log.warning(text, path, number, turns[number])
    return {number: math.pi / 180 if number in large else 1.0 for number in records}
