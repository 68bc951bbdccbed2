"""Parts of a scan's mesh: one mesh a part, annotated ones by their hierarchy, and flat, fixed ones for the rest."""

from __future__ import annotations

import logging
from collections.abc import Container, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from s2a.core.errors import InputError
from s2a.scan import fields, labels
from s2a.scan.fields import Record
from s2a.scan.ply import ScanMesh
from s2a.scene.scene import Mesh, Part, Scene


def cut(surface: ScanMesh, owner: np.ndarray, count: int) -> list[Mesh]:
    """Cut a surface into the meshes of parts 0 to count - 1; vertices on a border go to both sides.

    Args:
        surface: the whole scan.
        owner: the part of each face, shape [face], integers; -1 for none.
        count: number of parts; one that owns nothing gets an empty mesh.

    Returns:
        Meshes that keep the order of the scan's faces and vertices.
    """
    by_owner = np.argsort(owner, kind="stable")
    borders = np.searchsorted(owner[by_owner], np.arange(count + 1))
    return [_piece(surface, by_owner[borders[i] : borders[i + 1]]) for i in range(count)]


def _piece(surface: ScanMesh, chosen: np.ndarray) -> Mesh:
    """Return the mesh of some faces and of the vertices they use."""
    faces = surface.faces[chosen]
    if not len(faces):
        return Mesh(np.empty((0, 3)), faces, None if surface.colors is None else np.empty((0, 3)))
    # A table over the range of vertices in use is several times faster here than np.unique, which sorts.
    low = faces.min()
    used = np.zeros(faces.max() - low + 1, dtype=bool)
    used[faces - low] = True
    new_number = np.cumsum(used) - 1
    old = np.flatnonzero(used) + low
    colors = None if surface.colors is None else surface.colors[old]
    return Mesh(surface.vertices[old], new_number[faces - low], colors)


_MOSTLY = 0.5  # an object with more than this share of its vertices in annotated parts is annotated already


@dataclass(frozen=True)
class Group:
    """One annotated object.

    Attributes:
        label: what it is ("office chair").
        vertices: indices into the scan's vertices, ascending, each once, shape [n], int64.
    """

    label: str
    vertices: np.ndarray


def read_segments(segments_path: Path, groups_path: Path, vertex_count: int) -> list[Group]:
    """Read the objects of a scan from `segments.json` (a segment for each vertex) and `segments_anno.json`.

    Raises:
        InputError: another number of vertices than the mesh has, a group of segments that do not exist, wrong types.
    """
    segments = fields.load(segments_path).integers("segIndices")
    if len(segments) != vertex_count:
        raise InputError(
            f"{segments_path}: segIndices counts {len(segments)} vertices, the mesh has {vertex_count}; "
            "take all files from one release"
        )
    records = fields.load(groups_path).records("segGroups", "group")
    # In ScanNet++ every vertex is its own segment as a rule: then segment numbers are vertex numbers.
    each_its_own = np.array_equal(segments, np.arange(vertex_count))
    groups = [_group(record, segments, each_its_own) for record in records]
    return [group for group in groups if len(group.vertices)]


def unclaimed(groups: list[Group], faces: np.ndarray, claimed: np.ndarray) -> list[Group]:
    """Return the groups with at most half their vertices on claimed faces (mask, shape [face]), in their order."""
    taken = np.zeros(int(faces.max()) + 1, dtype=bool)
    taken[faces[claimed]] = True
    # Vertices of no face lie beyond the mask, and count as free.
    return [
        each
        for each in groups
        if taken[each.vertices[each.vertices < len(taken)]].sum() <= _MOSTLY * len(each.vertices)
    ]


def face_groups(groups: list[Group], faces: np.ndarray, vertex_count: int) -> np.ndarray:
    """Return for each face the position of its group, or -1, shape [face], int32.

    A vertex of several groups belongs to the smallest of them (a cushion on a sofa). A face goes where two of its
    vertices belong, or else with its first.
    """
    group_of = np.full(vertex_count, -1, dtype=np.int32)
    for i in sorted(range(len(groups)), key=lambda i: len(groups[i].vertices), reverse=True):
        group_of[groups[i].vertices] = i
    first, second, third = group_of[faces].T
    return np.where(second == third, second, first)


def _group(record: Record, segments: np.ndarray, each_its_own: bool) -> Group:
    """Return a group with the vertices of its segments."""
    label = " ".join(record.text("label").split())  # a label is one line
    named = Record(record.values, f"{record.where} {label!r}")
    if each_its_own:
        return Group(label, np.unique(named.indices("segments", len(segments), "vertices")))
    wanted = named.integers("segments")
    unknown = wanted[~np.isin(wanted, segments)]
    if len(unknown):
        raise InputError(
            f"{named.where}: segments holds {unknown[0]}, which no vertex has; take both files from one release"
        )
    return Group(label, np.flatnonzero(np.isin(segments, wanted)))


_log = logging.getLogger(__name__)

UNANNOTATED = "unannotated"  # label of the part that takes the faces nobody annotated
REMOVED = -2
"""Owner of faces that annotators marked as artefacts of the reconstruction; no part gets them."""


def claim(surface: ScanMesh, owner: np.ndarray, count: int, files: tuple[Path, Path] | None) -> list[str]:
    """Give the faces without owner to further parts: annotated objects, and "unannotated" for what is left then.

    Objects that annotators call REMOVE are artefacts, whose faces are left out with a warning; SPLIT ones are objects that could
    not be annotated, and stay "unannotated".

    Args:
        surface: the whole scan.
        owner: the part of each face, shape [face], integers; its -1 are replaced in place, by positions from count on or REMOVED.
        count: number of parts so far.
        files: segments and groups of segments, or None.

    Returns:
        The labels of the further parts, in the order of their positions.
    """
    names: list[str] = []
    free = owner == -1
    if files is not None:
        groups = read_segments(*files, len(surface.vertices))
        groups = unclaimed(groups, surface.faces, owner >= 0)
        place: list[int] = []
        for label in (group.label for group in groups):
            place.append(REMOVED if labels.is_removed(label) else -1 if labels.is_split(label) else count + len(names))
            names += [label] if place[-1] >= 0 else []
        owner[free] = np.array([*place, -1])[face_groups(groups, surface.faces[free], len(surface.vertices))]
        _warn_of_removed(files[1], owner)
    if (owner == -1).any():
        owner[owner == -1] = count + len(names)
        names.append(UNANNOTATED)
    return names


def staying(
    path: Path,
    names: Mapping[int, str],
    parent_of: Mapping[int, int | None],
    moving: Container[int],
    owner: np.ndarray,
) -> tuple[np.ndarray, dict[int, int | None]]:
    """Return annotated parts without artefacts of the scan, which are counted in a warning, and without what was not annotated.

    Args:
        path: of the annotation.
        names: label of each part by its number.
        parent_of: number of each part's parent.
        moving: numbers of the parts with a joint; others that annotators call SPLIT could not be annotated.
        owner: position of the part of each face among `names`, -1 for none, shape [face].

    Returns:
        The same of each face among the parts that stay, REMOVED for artefacts; and the parents of those parts.
    """
    removed = labels.artefacts(names, parent_of)
    split = {number for number, name in names.items() if number not in moving and labels.is_split(name)}
    left = labels.without(parent_of, removed | split)
    order = np.cumsum([number in left for number in names]) - 1
    place = [REMOVED if number in removed else -1 if number in split else order[i] for i, number in enumerate(names)]
    owner = np.array([*place, -1])[owner]
    _warn_of_removed(path, owner)
    return owner, left


def scene(
    name: str,
    surface: ScanMesh,
    owner: np.ndarray,
    names: Mapping[int, str],
    parent_of: Mapping[int, int | None],
    facts: Mapping[int, Mapping[str, Any]],
    files: tuple[Path, Path] | None,
) -> Scene:
    """Return a scan as a scene: annotated parts, each followed by what belongs to it; then flat, fixed ones for the rest.

    Args:
        name: of the scan.
        surface: all of it.
        owner: position of the part of each face among `parent_of`, -1 for none, or REMOVED, shape [face].
        names: label of each part by its number, also of those that are left out; further parts are numbered after them.
        parent_of: number of each part's parent.
        facts: further attributes of each `Part`.
        files: as in `claim`.
    """
    further = claim(surface, owner, len(parent_of), files)
    meshes = cut(surface, owner, len(parent_of) + len(further))
    mesh_of = dict(zip(parent_of, meshes, strict=False))
    name_of = {number: labels.split(names[number])[0] for number in parent_of}
    id_of = {number: labels.part_id(name_of[number], number) for number in parent_of}
    parts = {
        id_of[number]: Part(
            label=name_of[number],
            mesh=mesh_of[number],
            parent=None if (parent := parent_of[number]) is None else id_of[parent],
            **facts[number],
        )
        for number in labels.parents_first(parent_of)
    }
    first = max(names, default=0) + 1
    for number, (label, mesh) in enumerate(zip(further, meshes[len(parent_of) :], strict=True), start=first):
        parts[labels.part_id(label, number)] = Part(label, mesh)
    return Scene(name, parts, tuple(surface.origin.tolist()))


def _warn_of_removed(path: Path, owner: np.ndarray) -> None:
    if faces := int((owner == REMOVED).sum()):
        _log.warning("%s: %d faces that annotators named 'remove' are left out: artefacts of the scan", path, faces)
