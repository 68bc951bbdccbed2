"""A mesh file of a room -> SourceMesh, by the reader that its name's ending names (`s2a.scan.meshes`)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from s2a.core.errors import InputError
from s2a.scan import registry
from s2a.scan.source import SourceMesh


def endings() -> tuple[str, ...]:
    """Return the endings of the names of files that can be read."""
    return tuple(ending for reader in registry.formats("s2a.scan.meshes") for ending in reader.ENDINGS)  # type: ignore[attr-defined]


def read(path: Path) -> SourceMesh:
    """Read all triangles of a mesh file, in its order, with its own statement of frame and unit.

    A missing texture or material file is a warning; its faces become grey.

    Raises:
        InputError: no such file, another format, a damaged or compressed one, no faces, a vertex in use is not finite.
    """
    mesh = read_unchecked(path)
    _check(path, mesh)
    return mesh


def read_unchecked(path: Path) -> SourceMesh:
    """Read a mesh file whose vertices may not be finite, and whose faces may name vertices that do not exist."""
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "does not exist"
        raise InputError(f"mesh {str(path)!r} {what}; give one mesh file: {', '.join(endings())}")
    reader = next((each for each in registry.formats("s2a.scan.meshes") if each.recognise(path)), None)
    if reader is None:
        raise InputError(f"mesh {str(path)!r}: the ending {path.suffix!r} is unknown; possible: {', '.join(endings())}")
    if not path.stat().st_size:
        raise InputError(f"{path}: is empty; copy or export it again")
    mesh: SourceMesh = reader.read(path)
    return mesh


def _check(path: Path, mesh: SourceMesh) -> None:
    """Raise an InputError for a mesh that holds nothing, or numbers that cannot be right."""
    if not len(mesh.faces):
        raise InputError(f"{path}: holds no faces; export a mesh, not a point cloud")
    if not 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices):
        wrong = mesh.faces.max() if mesh.faces.min() >= 0 else mesh.faces.min()
        raise InputError(f"{path}: a face names vertex {wrong} of {len(mesh.vertices)}; export it again")
    finite = np.isfinite(mesh.vertices).all(axis=1)[mesh.faces].all(axis=1)
    if not finite.all():
        bad = np.flatnonzero(~finite)
        raise InputError(
            f"{path}: face {bad[0]} has a corner that is not finite ({len(bad)} such faces); remove them, or export it again"
        )
    if not np.ptp(mesh.vertices[mesh.faces].reshape(-1, 3), axis=0).max() > 0:
        raise InputError(f"{path}: all vertices lie in one point; export it again")
