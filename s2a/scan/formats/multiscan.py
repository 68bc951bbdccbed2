"""MultiScan's annotated scans -> Scene.

Both schemas are read: the released one, whose mesh carries an objectId and a partId for each face, and the older one of
the documentation's sample, with the faces in `<scene>.semseg.json`. Angles are radians, ranges relative to the scanned
pose. Nothing is "free": "movable" tells of an object that it can be carried, but its scanned shell cannot be let fall.
MultiScan knows no handles, so a jointed part is grasped itself. What annotators named "remove" is left out, as by the dataset's
own tools; what they named "split" is "unannotated".
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from s2a.core.errors import InputError
from s2a.scan import fields, joint_records, labels, multiscan_objects, ply, rest
from s2a.scan.cut import cut
from s2a.scan.multiscan_objects import Annotated, Annotation
from s2a.scan.ply import ScanMesh
from s2a.scene.scene import Mesh, Part, Scene

_log = logging.getLogger(__name__)

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

    The scene holds every object followed by its parts, with numbers as in `multiscan_objects.Annotation`; last, where
    faces are left over, one part "unannotated".

    Raises:
        InputError: a file is missing (the mesh, say), damaged, or does not belong to the others.
    """
    files = _find(path)
    annotation = multiscan_objects.read(files.annotations)
    if not files.mesh.is_file():
        raise InputError(_no_mesh(files, annotation))
    older = annotation.by_ids is None
    surface = ply.read(files.mesh, () if older else ("objectId", "partId"))
    number = _numbers_by_label(files, annotation, surface) if older else _numbers_by_ids(files, annotation, surface)
    items = annotation.items
    removed, split = _marked(items)
    rest.warn_of_removed(files.annotations, int(np.isin(number, list(removed)).sum()))
    owner = np.where(number == 0, -1, np.searchsorted(list(items), number))  # the items' numbers ascend
    owner[np.isin(number, list(split))] = -1
    owner[np.isin(number, list(removed))] = rest.REMOVED
    further = rest.claim(surface, owner, len(items), None)
    meshes = cut(surface, owner, len(items) + len(further))
    parts = _parts(items, dict(zip(items, meshes[: len(items)], strict=True)), surface.origin, removed | split)
    flat = rest.parts(further, max(items, default=0) + 1, meshes[len(items) :])
    return Scene(files.name, parts | flat, tuple(surface.origin.tolist()))


def _find(path: Path) -> _Files:
    """Return the files of the one scan in a folder."""
    found = sorted(path.glob(f"[!.]*{ANNOTATIONS}"))
    if len(found) != 1:
        names = ", ".join(file.name for file in found[:4]) or "none"
        raise InputError(f"{path}: expected one <scene>{ANNOTATIONS} (found: {names}); give the folder of one scan")
    name = found[0].name.removesuffix(ANNOTATIONS)
    return _Files(name, found[0], path / f"{name}.ply", path / f"{name}.semseg.json")


def _no_mesh(files: _Files, annotation: Annotation) -> str:
    """Say that the mesh is missing."""
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
            known = ", ".join(list(annotation.by_label)[:5])
            raise InputError(f"{lists.where}: {label!r} is not in {files.annotations.name} (which has {known} ...)")
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


def _marked(items: Mapping[int, Annotated]) -> tuple[set[int], set[int]]:
    """Return the numbers of what annotators named "remove", with all that belongs to it, and of "split" ones without a joint."""
    removed = labels.artefacts(
        {n: item.label for n, item in items.items()}, {n: item.parent for n, item in items.items()}
    )
    split = {n for n, item in items.items() if item.articulation is None and labels.is_split(item.label)}
    return removed, split - removed


def _parts(
    items: Mapping[int, Annotated], mesh_of: Mapping[int, Mesh], origin: np.ndarray, gone: set[int]
) -> dict[str, Part]:
    """Return objects and parts by id, every object followed by what belongs to it; `gone` are left out."""
    parent_of = labels.without({number: item.parent for number, item in items.items()}, gone)
    name_of = {number: labels.split(item.label)[0] for number, item in items.items()}
    id_of = {number: labels.part_id(name, number) for number, name in name_of.items()}
    found: dict[str, Part] = {}
    for number in labels.parents_first(parent_of):
        item, parent = items[number], parent_of[number]
        record = item.articulation
        found[id_of[number]] = Part(
            label=name_of[number],
            mesh=mesh_of[number],
            parent=None if parent is None else id_of[parent],
            motion="fixed" if record is None else joint_records.joint(record, 1.0, origin),
            graspable=record is not None,
        )
    return found
