"""Articulate3D's annotations on a ScanNet++ mesh -> Scene.

Lenient where releases differ (missing optional keys, untidy labels, repeated records: a warning is logged), strict
where a guess would be wrong. What belongs to what comes from the labels of `<scene>_parts.json`, what moves from
`<scene>_artic.json`, and the rest of the room from ScanNet++'s own annotation.
"""

import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import numpy as np

from s2a.core.errors import InputError
from s2a.scan import fields, folder, labels, ply, rest
from s2a.scan.fields import Record
from s2a.scan.ply import ScanMesh
from s2a.scene import scene
from s2a.scene.scene import MAX_MASS, Joint, Scene

_log = logging.getLogger(__name__)

_KINDS = {"rotation": "revolute", "translation": "prismatic"}
TYPES = {kind: name for name, kind in _KINDS.items()}  # Names in the files of the kinds of joints
_FULL_TURN = 2 * math.pi + 0.01  # [rad]; the slack lets a rounded 6.28319 pass
_MIN_TURN = math.radians(5.0)  # [rad]; what opens turns by more, which tells 1.57 degrees from 1.57 radians
_SHORTEST_AXIS = 1e-6  # below this length an axis has no direction worth trusting


def read_joints(path: Path, labels: Mapping[int, str], origin: np.ndarray) -> dict[int, Joint]:
    """Read the joints of a scan from its `_artic.json`, by number of the part that moves.

    `origin`: translation [m], shape [3], float64, that the scene's coordinates lie below the file's.

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
    records: dict[int, Record] = {}
    for record in fields.load(path).record("data").records("articulations", "articulation"):
        number = record.integer("pid")
        if number not in labels:
            numbers = f"{min(labels)} to {max(labels)}" if labels else "none"
            record.refuse("pid", f"no part has this partId (found: {numbers}); take both files from one release")
        if number in records:
            _log.warning("%s: several articulations of part %d %r; the last one counts", path, number, labels[number])
        records[number] = Record(record.values, f"{path}, articulation of part {number} {labels[number]!r}")
    return records


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
        raise InputError(f"{path}: base forms a cycle: part {circle}; name what each is mounted on") from None


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


@dataclass(frozen=True)
class AnnotatedPart:
    """One annotated part."""

    label: str  # name and index path as annotated ("handle base.1.2.1")
    faces: np.ndarray  # indices into the scan's faces, shape [n], int64; may be empty
    mass: float | None  # [kg], or None where it is not annotated


def read_parts(path: Path, surface: ScanMesh) -> dict[int, AnnotatedPart]:
    """Read the parts of a scan from its `_parts.json`, by number, in the order of the file.

    Raises:
        InputError: the file was made for another mesh, two parts share a number, an index is out of range, wrong types.
    """
    data = fields.load(path).record("data")
    _check_mesh(data, surface)
    parts: dict[int, AnnotatedPart] = {}
    for record in data.records("annotations", "annotation"):
        number, label = record.integer("partId"), record.text("label")
        named = Record(record.values, f"{path}, part {number} {label!r}")
        if number in parts:
            named.refuse("partId", f"part {parts[number].label!r} has it already; every part needs a number of its own")
        parts[number] = AnnotatedPart(label, _faces(named, surface), _mass(named))
        if not len(parts[number].faces):
            _log.warning("%s has no faces; kept as an empty part", named.where)
    return parts


def owners(parts: Mapping[int, AnnotatedPart], depth: Mapping[int, int], face_count: int) -> np.ndarray:
    """Return for each face the position of the part that owns it, or -1, shape [face], int32.

    Where several parts list a face, the deepest wins (a handle's faces may be listed with its door's), then the last.
    """
    owner = np.full(face_count, -1, dtype=np.int32)
    for position, number in sorted(enumerate(parts), key=lambda item: depth[item[1]]):
        owner[parts[number].faces] = position
    return owner


def _check_mesh(data: Record, surface: ScanMesh) -> None:
    """Raise an InputError if the parts were annotated on another mesh, as far as its statistics tell."""
    if not data.has("stats"):
        return
    stats = data.record("stats")
    for key, count in (("totalFaces", len(surface.faces)), ("totalVertices", len(surface.vertices))):
        if stats.has(key) and stats.values[key] != count:
            stats.refuse(key, f"{surface.path} has {count}; take the mesh that was annotated")


def _faces(record: Record, surface: ScanMesh) -> np.ndarray:
    """Return the faces of a part: those listed, or where none are, those whose three vertices are all listed."""
    vertices = np.empty(0, dtype=np.int64)
    if record.has("vertIndices"):
        vertices = record.indices("vertIndices", len(surface.vertices), "vertices")
    if record.has("triIndices") or not record.has("vertIndices"):
        faces = record.indices("triIndices", len(surface.faces), "faces")
        if len(faces) or not len(vertices):
            return faces
    inside = np.zeros(len(surface.vertices), dtype=bool)
    inside[vertices] = True
    return np.flatnonzero(inside[surface.faces].all(axis=1))


def _mass(record: Record) -> float | None:
    if not record.has("mass"):
        return None
    mass = record.number("mass")
    if not 0 < mass <= MAX_MASS:
        record.refuse(
            "mass", f"kilograms above 0, up to {MAX_MASS:g}, belong here; leave the key out where it is unknown"
        )
    return mass


@dataclass(frozen=True)
class Overlap:
    """Faces that two parts list of which neither belongs to the other."""

    parts: tuple[str, str]  # their ids
    faces: int  # number of faces that both list
    fraction: float  # the same, as a fraction of the smaller part's faces


def read_overlaps(path: Path) -> list[Overlap]:
    """Return the overlaps of the scan in a folder, most faces first; none for a scan of another format.

    Raises:
        InputError: the folder holds a damaged annotation.
    """
    if not folder.is_articulate3d(path):
        return []
    records = fields.load(folder.find(path).parts).record("data").records("annotations", "annotation")
    names = {record.integer("partId"): record.text("label") for record in records}
    # Artefacts and parts that could not be annotated are no parts of the scene.
    names = {number: name for number, name in names.items() if not (labels.is_removed(name) or labels.is_split(name))}
    listed = {
        record.integer("partId"): np.unique(record.integers("triIndices"))
        for record in records
        if record.has("triIndices") and record.integer("partId") in names
    }
    return overlaps(names, listed)


def overlaps(names: Mapping[int, str], listed: Mapping[int, np.ndarray]) -> list[Overlap]:
    """Return the overlaps of parts, most faces first. `listed`: faces of each part, each once, shape [n], integers."""
    parent_of = labels.parents(names)
    numbers = np.repeat(list(listed), [len(faces) for faces in listed.values()])
    faces = np.concatenate([*listed.values(), np.empty(0, np.int64)])
    order = np.argsort(faces, kind="stable")
    faces, numbers = faces[order], numbers[order]
    counts: dict[tuple[int, int], int] = {}
    for ahead in range(1, len(listed)):
        same = faces[ahead:] == faces[:-ahead]
        if not same.any():
            break
        pairs = np.sort(np.stack([numbers[:-ahead][same], numbers[ahead:][same]], axis=1), axis=1)
        for (a, b), count in zip(*np.unique(pairs, axis=0, return_counts=True), strict=True):
            counts[int(a), int(b)] = counts.get((int(a), int(b)), 0) + int(count)
    ids = {number: labels.part_id(labels.split(name)[0], number) for number, name in names.items()}
    unrelated = [
        Overlap((ids[a], ids[b]), count, count / min(len(listed[a]), len(listed[b])))
        for (a, b), count in counts.items()
        if not (_above(a, b, parent_of) or _above(b, a, parent_of))
    ]
    return sorted(unrelated, key=lambda overlap: -overlap.faces)


def _above(upper: int, lower: int, parent_of: Mapping[int, int | None]) -> bool:
    parent = parent_of[lower]
    while parent is not None and parent != upper:
        parent = parent_of[parent]
    return parent == upper


NAME = "Articulate3D"
PRIORITY = 30


def recognise(path: Path) -> bool:
    """Return whether a folder holds any of Articulate3D's files, maybe not all."""
    return folder.is_articulate3d(path)


def read(path: Path) -> Scene:
    """Read the annotated scan in a folder.

    The scene holds Articulate3D's parts as their labels nest. Then follow, numbered on from the largest partId, fixed
    and flat: the ScanNet++ objects that those parts do not cover already, in the order of their file, and last, where
    faces are left over, one part "unannotated". Parts called REMOVE are left out with all that belongs
    to them; SPLIT ones that do not move are "unannotated".

    Raises:
        InputError: a file is missing, damaged, or does not belong to the others.
    """
    files = folder.find(path)
    surface = ply.read(files.mesh)
    annotated = read_parts(files.parts, surface)
    names = {number: part.label for number, part in annotated.items()}
    parent_of = labels.parents(names)
    moving = read_joints(files.articulations, names, surface.origin)
    owner = owners(annotated, labels.depths(parent_of), len(surface.faces))
    owner, parent_of = rest.staying(files.parts, names, parent_of, moving, owner)
    grasped = labels.grasped({number for number in moving if number in parent_of}, parent_of)
    facts = {
        number: {"motion": moving.get(number, "fixed"), "graspable": number in grasped, "mass": annotated[number].mass}
        for number in parent_of
    }
    return rest.scene(files.name, surface, owner, names, parent_of, facts, files.segments)
