"""ScanNet++ instance annotations: what the room holds besides the parts that Articulate3D annotates."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from s2a.core.errors import InputError
from s2a.scan import fields
from s2a.scan.fields import Record

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


def read(segments_path: Path, groups_path: Path, vertex_count: int) -> list[Group]:
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
