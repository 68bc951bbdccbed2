"""Annotated scans of real rooms: a scan directory -> Scene."""

from __future__ import annotations

from pathlib import Path

from s2a.scan import articulate3d, folder, multiscan, scannetpp
from s2a.scene.scene import Scene


def read(path: Path) -> Scene:
    """Read the scan in a folder: Articulate3D's, MultiScan's, ScanNet++'s alone, or a mesh that nobody annotated.

    The files' names tell which: `<scene>_parts.json`, `<scene>.annotations.json`, or else a mesh.

    Raises:
        InputError: the folder holds no such scan, several, or a damaged one.
    """
    path = Path(path)
    if folder.is_articulate3d(path):
        return articulate3d.read(path)
    if multiscan.is_scan(path):
        return multiscan.read(path)
    return scannetpp.read(path) if folder.has_mesh(path) else articulate3d.read(path)
