"""Annotated scans of real rooms: a scan directory -> Scene."""

from __future__ import annotations

from pathlib import Path

from s2a.scan import articulate3d
from s2a.scene import Scene


def read(path: Path) -> Scene:
    """Read the annotated scan in a folder: Articulate3D's files on a ScanNet++ mesh.

    Raises:
        InputError: the folder holds no such scan, several, or a damaged one.
    """
    return articulate3d.read(Path(path))
