"""MultiScan's annotated scans -> Scene.

Both schemas are read: the released one, whose mesh carries an objectId and a partId for each face, and the older one of
the documentation's sample, with the faces in `<scene>.semseg.json`. Angles are radians, ranges relative to the scanned
pose. Nothing is "free": "movable" tells of an object that it can be carried, but its scanned shell cannot be let fall.
MultiScan knows no handles, so a jointed part is grasped itself. What annotators named "remove" is left out, as by the dataset's
own tools; what they named "split" is "unannotated".
"""

import logging
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

import numpy as np

from s2a.core.errors import InputError
from s2a.scan import fields, labels, ply, rest
from s2a.scan.fields import Record
from s2a.scan.formats import articulate3d
from s2a.scan.ply import ScanMesh
from s2a.scene.scene import Scene

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Annotated:
    """One object or part."""

    label: str  # as annotated ("door.10")
    parent: int | None  # number of what it belongs to, or None for an object
    articulation: Record | None  # how it moves (type, origin, axis, rangeMin, rangeMax), or None


@dataclass(frozen=True)
class Annotation:
    """All objects and parts of a scan."""

    # by number, ascending. An object's number is its objectId (older schema: its place in the file, from 1); a
    # part's is the largest of those plus its partId (older schema: its place among all parts)
    items: dict[int, Annotated]
    by_label: dict[str, int]  # number by combined label ("bag.1", "wall_cabinet.1:door.10")
    # number by (objectId, partId), partId 0 being the object itself; None in the older schema
    by_ids: dict[tuple[int, int], int] | None


@dataclass(frozen=True)
class _Piece:
    """One part of an object as the file has it; `parent` is another piece of the object."""

    label: str
    parent: int | None
    articulation: Record | None


def read_objects(path: Path) -> Annotation:
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
    objects, parts = _numbered(top, "objects", "object"), _numbered(top, "parts", "part")
    annotation = Annotation({}, {}, {})
    first = max(objects, default=0)
    owner: dict[int, str] = {}
    for number, record in objects.items():
        pieces = _released_pieces(record, parts, owner)
        _add(annotation, number, record.text("label"), pieces, {part_id: first + part_id for part_id in pieces})
    orphans = [parts[part_id].text("label") for part_id in parts if part_id not in owner]
    if orphans:
        _log.warning("%s: %d parts of no object are left out: %s", top.where, len(orphans), ", ".join(orphans[:5]))
    return Annotation(dict(sorted(annotation.items.items())), annotation.by_label, annotation.by_ids)


def _older(top: Record) -> Annotation:
    records, articulations = top.records("objects", "object"), top.record("articulations")
    annotation = Annotation({}, {}, {})
    following = len(records) + 1
    for number, record in enumerate(records, start=1):
        label = record.text("label")
        if label in annotation.by_label:
            record.refuse("label", "an object before it has this label; every object needs one of its own")
        moving = {key: articulations.record(key) for key in articulations.values if key.split(":")[0] == label}
        pieces = {
            following + i: _Piece(part, None, moving.get(f"{label}:{part}"))
            for i, part in enumerate(_texts(record, "parts"))
        }
        _add(annotation, number, label, pieces, {piece: piece for piece in pieces}, moving.get(label))
        following += len(pieces)
    unknown = next((key for key in articulations.values if key not in annotation.by_label), None)
    if unknown is not None:
        articulations.refuse(unknown, f"{unknown!r} is not an object or part of the file; take an undamaged one")
    return Annotation(dict(sorted(annotation.items.items())), annotation.by_label, None)


def _add(
    annotation: Annotation,
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
    annotation.items[number] = Annotated(label, None, articulation)
    ids = {} if annotation.by_ids is None else annotation.by_ids
    annotation.by_label[label] = ids[number, 0] = number
    for key, piece in pieces.items():
        annotation.by_label[f"{label}:{piece.label}"] = ids[number, key] = number_of[key]
        if key != base:
            parent = number if piece.parent is None else number_of[piece.parent]
            annotation.items[number_of[key]] = Annotated(piece.label, parent, piece.articulation)


def _base(label: str, pieces: Mapping[int, _Piece]) -> int | None:
    """Return the part that stands for the object itself: of its name, on nothing, unmoving or the only one."""
    name = labels.split(label)[0]
    same = [key for key, piece in pieces.items() if labels.split(piece.label)[0] == name and piece.parent is None]
    return next((key for key in same if pieces[key].articulation is None or len(pieces) == 1), None)


def _released_pieces(record: Record, parts: Mapping[int, Record], owner: dict[int, str]) -> dict[int, _Piece]:
    """Return the parts of an object of the released schema by partId, and enter in owner whose they are."""
    pieces: dict[int, _Piece] = {}
    for part_id in record.integers("partIds").tolist() if record.has("partIds") else []:
        if part_id not in parts:
            record.refuse("partIds", f"{part_id} is not a partId of the file; take an undamaged one")
        if part_id in owner:
            record.refuse("partIds", f"part {part_id} belongs to object {owner[part_id]!r} already")
        owner[part_id] = record.text("label")
        pieces[part_id] = _released_piece(parts[part_id])
    _check_parents(pieces, parts)
    return pieces


def _released_piece(record: Record) -> _Piece:
    parent = record.integer("parentId") if record.has("parentId") else 0
    articulations = record.records("articulations", "articulation") if record.has("articulations") else []
    if len(articulations) > 1:
        _log.warning("%s has %d articulations; the first one counts", record.where, len(articulations))
    return _Piece(record.text("label"), parent or None, articulations[0] if articulations else None)


def _numbered(top: Record, key: str, noun: str) -> dict[int, Record]:
    """Return the records of a list by their ids, named by id and label in messages."""
    records: dict[int, Record] = {}
    for record in top.records(key, noun):
        number, label = record.integer(f"{noun}Id"), record.text("label")
        named = Record(record.values, f"{top.where}, {noun} {number} {label!r}")
        if number == 0:
            named.refuse(f"{noun}Id", "ids count from 1; 0 means none")
        if number in records:
            named.refuse(f"{noun}Id", f"{records[number].text('label')!r} has it already; every {noun} needs its own")
        records[number] = named
    return records


def _texts(record: Record, key: str) -> list[str]:
    """Return a list of strings, each once; empty if the key is missing."""
    value = record.values.get(key) or []
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        record.refuse(key, "expected a list of labels")
    if len(set(value)) < len(value):
        record.refuse(key, "a label occurs twice; every part needs one of its own")
    return value


def _check_parents(pieces: Mapping[int, _Piece], parts: Mapping[int, Record]) -> None:
    """Raise an InputError if a part belongs to something that is no part of its object."""
    for part_id, piece in pieces.items():
        if piece.parent is not None and piece.parent not in pieces:
            siblings = ", ".join(map(str, sorted(pieces)))
            parts[part_id].refuse("parentId", f"not a part of the same object (its parts: {siblings})")


def _check_circles(path: Path, items: Mapping[int, Annotated]) -> None:
    """Raise an InputError if parts belong to each other in a circle."""
    try:
        TopologicalSorter({n: [item.parent] for n, item in items.items() if item.parent is not None}).prepare()
    except CycleError as error:
        circle = " -> ".join(repr(items[number].label) for number in reversed(error.args[1]))
        raise InputError(f"{path}: parentId forms a cycle: {circle}; take an undamaged file") from None


NAME = "MultiScan"
PRIORITY = 20
ANNOTATIONS = ".annotations.json"
_MOSTLY = 0.5  # with more than this share of the faces' ids unknown, mesh and annotation do not belong together


@dataclass(frozen=True)
class _Files:
    """The files of one scan; the last two may not exist."""

    name: str
    annotations: Path
    mesh: Path
    faces: Path


def recognise(path: Path) -> bool:
    """Return whether a folder holds a MultiScan annotation."""
    return any(path.glob(f"[!.]*{ANNOTATIONS}"))


def read(path: Path) -> Scene:
    """Read the annotated scan in a folder: `<scene>.annotations.json` and `<scene>.ply` (older: `.semseg.json` too).

    The scene holds every object followed by its parts, with numbers as in `Annotation`; last, where
    faces are left over, one part "unannotated".

    Raises:
        InputError: a file is missing (the mesh, say), damaged, or does not belong to the others.
    """
    files = _find(path)
    annotation = read_objects(files.annotations)
    if not files.mesh.is_file():
        raise InputError(_no_mesh(files, annotation))
    older = annotation.by_ids is None
    surface = ply.read(files.mesh, () if older else ("objectId", "partId"))
    number = _numbers_by_label(files, annotation, surface) if older else _numbers_by_ids(files, annotation, surface)
    items = annotation.items
    owner = np.where(number == 0, -1, np.searchsorted(list(items), number))  # the items' numbers ascend
    names = {number: item.label for number, item in items.items()}
    parents = {number: item.parent for number, item in items.items()}
    moving = {number for number, item in items.items() if item.articulation is not None}
    owner, parent_of = rest.staying(files.annotations, names, parents, moving, owner)
    further = facts(items, parent_of, surface.origin)
    return rest.scene(files.name, surface, owner, names, parent_of, further, None)


def facts(items: Mapping[int, Annotated], numbers: Iterable[int], origin: np.ndarray) -> dict[int, dict[str, Any]]:
    """Return motion and grasp region of some objects and parts, with the origin [m], shape [3], taken off joints."""
    articulations = {number: items[number].articulation for number in numbers}
    return {
        number: {
            "motion": "fixed" if record is None else articulate3d.joint(record, 1.0, origin),
            "graspable": record is not None,
        }
        for number, record in articulations.items()
    }


def _find(path: Path) -> _Files:
    files = sorted(path.glob(f"[!.]*{ANNOTATIONS}"))
    if len(files) != 1:
        names = ", ".join(file.name for file in files[:4]) or "none"
        raise InputError(f"{path}: expected one <scene>{ANNOTATIONS} (found: {names}); give the folder of one scan")
    name = files[0].name.removesuffix(ANNOTATIONS)
    return _Files(name, files[0], path / f"{name}.ply", path / f"{name}.semseg.json")


def _no_mesh(files: _Files, annotation: Annotation) -> str:
    items = annotation.items.values()
    objects = sum(item.parent is None for item in items)
    moving = sum(item.articulation is not None for item in items)
    return (
        f"{files.mesh.parent}: {files.mesh.name} is missing; the annotation ({objects} objects, {moving} joints) has no "
        "surface of its own; download the scan's mesh into this folder"
    )


def _numbers_by_label(files: _Files, annotation: Annotation, surface: ScanMesh) -> np.ndarray:
    """Return the number of the object or part of each face, or 0, from the older schema's lists of faces."""
    if not files.faces.is_file():
        raise InputError(f"{files.annotations}: {files.faces.name} is missing, which lists the faces of this schema")
    lists = fields.load(files.faces).record("triIndices")
    number = np.zeros(len(surface.faces), dtype=np.int64)
    for label in lists.values:
        faces = lists.indices(label, len(surface.faces), "faces")
        if label not in annotation.by_label:
            examples = ", ".join(list(annotation.by_label)[:5])
            raise InputError(f"{lists.where}: {label!r} is not in {files.annotations.name} (which has {examples} ...)")
        number[faces] = annotation.by_label[label]
    return number


def _numbers_by_ids(files: _Files, annotation: Annotation, surface: ScanMesh) -> np.ndarray:
    """Return the number of the object or part of each face, or 0, from the ids that the mesh's faces carry."""
    ids = np.stack([surface.face_numbers["objectId"], surface.face_numbers["partId"]], axis=1)
    pairs, pair_of = np.unique(ids, axis=0, return_inverse=True)
    by_ids = annotation.by_ids or {}
    number = np.array([by_ids.get((a, b), 0) for a, b in pairs.tolist()])[pair_of.ravel()]
    labelled = ids[:, 0] != 0
    stray = np.flatnonzero(labelled & (number == 0))
    if not len(stray):
        return number
    where = (
        f"{files.mesh}: {len(stray)} of {labelled.sum()} labelled faces have ids that {files.annotations.name} lacks"
    )
    first = f"face {stray[0]}: objectId {ids[stray[0], 0]}, partId {ids[stray[0], 1]}"
    if len(stray) > _MOSTLY * labelled.sum():
        raise InputError(f"{where} ({first}); take both files from one scan")
    _log.warning("%s (%s); they are taken as unannotated", where, first)
    return number
