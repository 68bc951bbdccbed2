"""ScanNet scans -> Scene of flat, fixed parts: the decimated mesh, its segments and their aggregation."""

from __future__ import annotations

from pathlib import Path

from s2a.scan import folder, rest
from s2a.scene.scene import Scene

NAME = "ScanNet"
PRIORITY = 10


def recognise(path: Path) -> bool:
    """Return whether a folder holds ScanNet's decimated mesh, `<scene>_vh_clean_2.ply`."""
    return folder.scannet_mesh(path) is not None


def read(path: Path) -> Scene:
    """Read the scan in a folder: its objects, numbered from 1 in the order of their file, then "unannotated" faces.

    Raises:
        InputError: several meshes, or a damaged file.
    """
    return rest.read(folder.find_bare(path))
