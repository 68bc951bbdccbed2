"""Annotated scans of real rooms: a scan directory -> Scene."""

from __future__ import annotations

from pathlib import Path

from s2a.scan import folder, registry
from s2a.scene.scene import Scene


def read(path: Path) -> Scene:
    """Read the scan in a folder with the first format that recognises it (`s2a.scan.formats`).

    Raises:
        InputError: the folder holds no such scan, several, or a damaged one.
    """
    path = Path(path)
    readers = [reader for reader in registry.formats("s2a.scan.formats") if path.is_dir() and reader.recognise(path)]
    if not readers:
        raise folder.no_scan(path)
    return readers[0].read(path)
