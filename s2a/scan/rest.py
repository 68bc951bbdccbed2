"""Flat, fixed parts of a scan, which no hierarchy covers: ScanNet's and ScanNet++'s objects, and unannotated faces."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from s2a.scan import labels, ply, segments
from s2a.scan.cut import cut
from s2a.scan.folder import BareFiles
from s2a.scan.ply import ScanMesh
from s2a.scene.scene import Mesh, Part, Scene

_log = logging.getLogger(__name__)

UNANNOTATED = "unannotated"  # label of the part that takes the faces nobody annotated
REMOVED = -2
"""Owner of faces that annotators marked as artefacts of the reconstruction; no part gets them."""


def read(files: BareFiles) -> Scene:
    """Read a scan whose motions nobody annotated.

    With segments the scene holds their objects, numbered from 1 in the order of their file, and last, where faces are left
    over, one part "unannotated". A mesh alone becomes that one part, and a warning is logged.

    Raises:
        InputError: a damaged file.
    """
    surface = ply.read(files.mesh)
    owner = np.full(len(surface.faces), -1, dtype=np.int32)
    names = claim(surface, owner, 0, files.segments)
    if names == [UNANNOTATED]:
        _log.warning("%s: nothing is annotated; the whole room is one static part %r", files.mesh, UNANNOTATED)
    return Scene(files.name, parts(names, 1, cut(surface, owner, len(names))), tuple(surface.origin.tolist()))


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
        groups = segments.read(*files, len(surface.vertices))
        groups = segments.unclaimed(groups, surface.faces, owner >= 0)
        group = segments.face_groups(groups, surface.faces[free], len(surface.vertices))
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
