"""ScanNet++ scans without Articulate3D's annotation -> Scene of flat, fixed parts."""

from __future__ import annotations

from pathlib import Path

from s2a.scan import folder, rest
from s2a.scene.scene import Scene

NAME = "ScanNet++"
PRIORITY = 10


def recognise(path: Path) -> bool:
    """Return whether a folder holds ScanNet++'s segments, or groups of them, and a mesh."""
    return folder.has_mesh(path) and folder.has_segments(path)


def read(path: Path) -> Scene:
    """Read the scan in a folder: its objects, numbered from 1 in the order of their file, then "unannotated" faces.

    Raises:
        InputError: no mesh there, several, or a damaged file.
    """
    return rest.read(folder.find_bare(path))
