"""Surfaces outside every hierarchy: ScanNet++'s objects and unannotated faces, as flat, fixed parts."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from s2a.scan import labels, segments
from s2a.scan.ply import ScanMesh
from s2a.scene.scene import Mesh, Part

UNANNOTATED = "unannotated"  # label of the part that takes the faces nobody annotated


def claim(surface: ScanMesh, owner: np.ndarray, count: int, files: tuple[Path, Path] | None) -> list[str]:
    """Give the faces without owner to further parts: ScanNet++'s objects, and "unannotated" for what is left then.

    Args:
        surface: the whole scan.
        owner: the part of each face, shape [face], integers; its -1 are replaced in place, by positions from count on.
        count: number of parts so far.
        files: ScanNet++'s segments and groups of segments, or None.

    Returns:
        The labels of the further parts, in the order of their positions.
    """
    found: list[str] = []
    free = owner < 0
    if files is not None:
        groups = segments.read(*files, len(surface.vertices))
        groups = segments.unclaimed(groups, surface.faces, ~free)
        group = segments.face_groups(groups, surface.faces[free], len(surface.vertices))
        owner[free] = np.where(group < 0, -1, group + count)
        found = [group.label for group in groups]
    if (owner < 0).any():
        owner[owner < 0] = count + len(found)
        found.append(UNANNOTATED)
    return found


def parts(names: list[str], first_number: int, meshes: list[Mesh]) -> dict[str, Part]:
    """Return flat, fixed parts by id, numbered from first_number on."""
    numbered = enumerate(zip(names, meshes, strict=True), start=first_number)
    return {labels.part_id(name, number): Part(name, mesh) for number, (name, mesh) in numbered}
