"""Parts of a scan's mesh: one mesh a part, ScanNet++'s instances, and the flat, fixed parts that no hierarchy covers."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from s2a.core.errors import InputError
from s2a.scan import fields, labels
from s2a.scan.fields import Record
from s2a.scan.ply import ScanMesh
from s2a.scene.scene import Mesh, Part


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
    return [group for group in groups if _share(group, taken) <= _MOSTLY]


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


def _share(group: Group, taken: np.ndarray) -> float:
    """Return the share of a group's vertices that are taken; vertices of no face count as free."""
    inside = group.vertices[group.vertices < len(taken)]
    return float(taken[inside].sum() / len(group.vertices))


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
    found: list[str] = []
    free = owner == -1
    if files is not None:
        groups = read_segments(*files, len(surface.vertices))
        groups = unclaimed(groups, surface.faces, owner >= 0)
        group = face_groups(groups, surface.faces[free], len(surface.vertices))
        place = _places([each.label for each in groups], count, found)
        owner[free] = np.append(place, -1)[group]
        warn_of_removed(files[1], int((owner == REMOVED).sum()))
    if (owner == -1).any():
        owner[owner == -1] = count + len(found)
        found.append(UNANNOTATED)
    return found


def warn_of_removed(path: Path, faces: int) -> None:
    """Log how many faces annotators marked to be removed, if there are any."""
    if faces:
        _log.warning("%s: %d faces that annotators named 'remove' are left out: artefacts of the scan", path, faces)


def parts(names: list[str], first_number: int, meshes: list[Mesh]) -> dict[str, Part]:
    """Return flat, fixed parts by id, numbered from first_number on."""
    numbered = enumerate(zip(names, meshes, strict=True), start=first_number)
    return {labels.part_id(name, number): Part(name, mesh) for number, (name, mesh) in numbered}


def _places(names: list[str], count: int, found: list[str]) -> np.ndarray:
    """Return the part of each group, REMOVED, or -1 for "unannotated", shape [group]; append labels of parts to `found`."""
    place = np.full(len(names), -1, dtype=np.int64)
    for position, name in enumerate(names):
        if labels.is_removed(name):
            place[position] = REMOVED
        elif not labels.is_split(name):
            place[position] = count + len(found)
            found.append(name)
    return place
