"""A mesh that nobody annotated -> Scene of one fixed part."""

from __future__ import annotations

from pathlib import Path

from s2a.scan import folder, rest
from s2a.scene.scene import Scene

NAME = "bare mesh"


def recognise(path: Path) -> bool:
    """Return whether a folder holds a PLY file, as `s2a import` writes it."""
    return folder.has_mesh(path)


def read(path: Path) -> Scene:
    """Read the only mesh in a folder as one part "unannotated", and log a warning.

    Raises:
        InputError: several meshes, or a damaged file.
    """
    return rest.read(folder.find_bare(path))
