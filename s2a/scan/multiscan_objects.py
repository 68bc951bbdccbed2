"""The annotated objects and parts of a MultiScan scan, from either schema of `<scene>.annotations.json`.

The released schema lists objects and parts by id; the older one, of the documentation's sample, names them by label
("wall_cabinet.1:door.10"). Both give an object a base part of its own name ("wall_cabinet.1:wall_cabinet.1"), which
is the object's own surface here, not a part of it; unless it moves and others do not: the leaf of an object "door.1".
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

from s2a.core.errors import InputError
from s2a.scan import fields, labels
from s2a.scan.fields import Record

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Annotated:
    """One object or part.

    Attributes:
        label: as annotated ("door.10").
        parent: number of what it belongs to, or None for an object.
        articulation: how it moves (type, origin, axis, rangeMin, rangeMax), or None.
    """

    label: str
    parent: int | None
    articulation: Record | None


@dataclass(frozen=True)
class Annotation:
    """All objects and parts of a scan.

    Attributes:
        items: by number, ascending. An object's number is its objectId (older schema: its place in the file,
            from 1); a part's is the largest of those plus its partId (older schema: its place among all parts).
        by_label: number by combined label ("bag.1", "wall_cabinet.1:door.10").
        by_ids: number by (objectId, partId), partId 0 being the object itself; None in the older schema.
    """

    items: dict[int, Annotated]
    by_label: dict[str, int]
    by_ids: dict[tuple[int, int], int] | None


@dataclass(frozen=True)
class _Piece:
    """One part of an object as the file has it; `parent` is another piece of the object."""

    label: str
    parent: int | None
    articulation: Record | None


def read(path: Path) -> Annotation:
    """Read a `<scene>.annotations.json`.

    Raises:
        InputError: wrong types, an id or label that is used twice or does not exist, parts that belong to each other
            in a circle.
    """
    top = fields.load(path)
    older = top.has("articulations") and not top.has("parts")
    annotation = _older(top) if older else _released(top)
    _check_circles(path, annotation.items)
    return annotation


def _released(top: Record) -> Annotation:
    """Return the annotation of the released schema."""
    objects, parts = _numbered(top, "objects", "object"), _numbered(top, "parts", "part")
    found = Annotation({}, {}, {})
    first = max(objects, default=0)
    owner: dict[int, str] = {}
    for number, record in objects.items():
        pieces = _released_pieces(record, parts, owner)
        _add(found, number, record.text("label"), pieces, {part_id: first + part_id for part_id in pieces})
    orphans = [parts[part_id].text("label") for part_id in parts if part_id not in owner]
    if orphans:
        _log.warning("%s: %d parts of no object are left out: %s", top.where, len(orphans), ", ".join(orphans[:5]))
    return Annotation(dict(sorted(found.items.items())), found.by_label, found.by_ids)


def _older(top: Record) -> Annotation:
    """Return the annotation of the older schema."""
    records, articulations = top.records("objects", "object"), top.record("articulations")
    found = Annotation({}, {}, {})
    following = len(records) + 1
    for number, record in enumerate(records, start=1):
        label = record.text("label")
        if label in found.by_label:
            record.refuse("label", "an object before it has this label; every object needs one of its own")
        moving = {key: articulations.record(key) for key in articulations.values if key.split(":")[0] == label}
        pieces = {
            following + i: _Piece(part, None, moving.get(f"{label}:{part}"))
            for i, part in enumerate(_texts(record, "parts"))
        }
        _add(found, number, label, pieces, {piece: piece for piece in pieces}, moving.get(label))
        following += len(pieces)
    unknown = next((key for key in articulations.values if key not in found.by_label), None)
    if unknown is not None:
        articulations.refuse(unknown, f"{unknown!r} is no object or part of the file; take an undamaged one")
    return Annotation(dict(sorted(found.items.items())), found.by_label, None)


def _add(
    found: Annotation,
    number: int,
    label: str,
    pieces: Mapping[int, _Piece],
    number_of: dict[int, int],
    articulation: Record | None = None,
) -> None:
    """Add an object with its parts to an annotation; its base part, if there is one, becomes the object itself."""
    base = _base(label, pieces)
    if base is not None:
        number_of = number_of | {base: number}
        articulation = articulation or pieces[base].articulation
    found.items[number] = Annotated(label, None, articulation)
    ids = {} if found.by_ids is None else found.by_ids
    found.by_label[label] = ids[number, 0] = number
    for key, piece in pieces.items():
        found.by_label[f"{label}:{piece.label}"] = ids[number, key] = number_of[key]
        if key != base:
            parent = number if piece.parent is None else number_of[piece.parent]
            found.items[number_of[key]] = Annotated(piece.label, parent, piece.articulation)


def _base(label: str, pieces: Mapping[int, _Piece]) -> int | None:
    """Return the part that stands for the object itself: of its name, on nothing, unmoving or the only one."""
    name = labels.split(label)[0]
    same = [key for key, piece in pieces.items() if labels.split(piece.label)[0] == name and piece.parent is None]
    return next((key for key in same if pieces[key].articulation is None or len(pieces) == 1), None)


def _released_pieces(record: Record, parts: Mapping[int, Record], owner: dict[int, str]) -> dict[int, _Piece]:
    """Return the parts of an object of the released schema by partId, and enter in owner whose they are."""
    found: dict[int, _Piece] = {}
    for part_id in record.integers("partIds").tolist() if record.has("partIds") else []:
        if part_id not in parts:
            record.refuse("partIds", f"{part_id} is no partId of the file; take an undamaged one")
        if part_id in owner:
            record.refuse("partIds", f"part {part_id} belongs to object {owner[part_id]!r} already")
        owner[part_id] = record.text("label")
        found[part_id] = _released_piece(parts[part_id])
    _check_parents(found, parts)
    return found


def _released_piece(record: Record) -> _Piece:
    """Return a part of the released schema."""
    parent = record.integer("parentId") if record.has("parentId") else 0
    articulations = record.records("articulations", "articulation") if record.has("articulations") else []
    if len(articulations) > 1:
        _log.warning("%s has %d articulations; the first one counts", record.where, len(articulations))
    return _Piece(record.text("label"), parent or None, articulations[0] if articulations else None)


def _numbered(top: Record, key: str, noun: str) -> dict[int, Record]:
    """Return the records of a list by their ids, named by id and label in messages."""
    found: dict[int, Record] = {}
    for record in top.records(key, noun):
        number, label = record.integer(f"{noun}Id"), record.text("label")
        named = Record(record.values, f"{top.where}, {noun} {number} {label!r}")
        if number == 0:
            named.refuse(f"{noun}Id", "ids count from 1; 0 means none")
        if number in found:
            named.refuse(f"{noun}Id", f"{found[number].text('label')!r} has it already; every {noun} needs its own")
        found[number] = named
    return found


def _texts(record: Record, key: str) -> list[str]:
    """Return a list of strings, each once; empty if the key is missing."""
    value = record.values.get(key) or []
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        record.refuse(key, "expected a list of labels")
    if len(set(value)) < len(value):
        record.refuse(key, "a label stands there twice; every part needs one of its own")
    return value


def _check_parents(pieces: Mapping[int, _Piece], parts: Mapping[int, Record]) -> None:
    """Raise an InputError if a part belongs to something that is no part of its object."""
    for part_id, piece in pieces.items():
        if piece.parent is not None and piece.parent not in pieces:
            known = ", ".join(map(str, sorted(pieces)))
            parts[part_id].refuse("parentId", f"not a part of the same object (its parts: {known})")


def _check_circles(path: Path, items: Mapping[int, Annotated]) -> None:
    """Raise an InputError if parts belong to each other in a circle."""
    try:
        TopologicalSorter({n: [item.parent] for n, item in items.items() if item.parent is not None}).prepare()
    except CycleError as error:
        circle = " -> ".join(repr(items[number].label) for number in reversed(error.args[1]))
        raise InputError(f"{path}: parentId runs in a circle: {circle}; take an undamaged file") from None
