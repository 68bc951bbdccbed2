"""STL and OFF -> SourceMesh, by trimesh's readers, which are right about these small formats."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from s2a.core.color_space import to_linear
from s2a.core.errors import InputError
from s2a.scan.source import SourceMesh, Stated

NAME = "STL and OFF"
ENDINGS = (".stl", ".off")


def recognise(path: Path) -> bool:
    """Return whether a file's name ends as those of STL or OFF do."""
    return path.suffix.lower() in ENDINGS


def read(path: Path) -> SourceMesh:
    """Read all triangles, in their order, with colours of vertices or faces where there are any.

    Raises:
        InputError: a truncated or damaged file.
    """
    try:
        mesh = trimesh.load_mesh(path, process=False)
        points, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)
        kind = mesh.visual.kind
        levels = mesh.visual.vertex_colors if kind == "vertex" else mesh.visual.face_colors if kind == "face" else None
    except Exception as error:  # trimesh raises whatever its parsers raise
        raise InputError(
            f"{path}: truncated or damaged ({' '.join(str(error).split())[:120]}); export it again"
        ) from error
    colors = np.full((*faces.shape, 3), np.nan, dtype=np.float32)
    if levels is not None and len(faces):
        light = to_linear(np.asarray(levels, dtype=np.uint8)[:, :3])
        colors = light[faces] if kind == "vertex" else np.repeat(light[:, None], 3, axis=1)
    return SourceMesh(points, faces, np.full((*faces.shape, 2), np.nan), colors, np.full(len(faces), -1), (), Stated())
