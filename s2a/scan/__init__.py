"""Annotated scans of real rooms: a scan directory -> Scene, and its two flavours of USD."""

from dataclasses import dataclass
from pathlib import Path

from s2a.core.outputs import atomic_write
from s2a.scan import folder
from s2a.scene.scene import Scene
from s2a.scene.usd import descriptive, geometric


def read(path: Path) -> Scene:
    """Read the scan in a folder with the first format that recognises it (`s2a.scan.formats`).

    Raises:
        InputError: the folder holds no such scan, several, or a damaged one.
    """
    path = Path(path)
    readers = [reader for reader in folder.formats("s2a.scan.formats") if path.is_dir() and reader.recognise(path)]
    if not readers:
        raise folder.no_scan(path)
    return readers[0].read(path)


def load_scene(path: Path) -> Scene:
    """Read a scene from the folder of a scan, or from a geometric stage; InputError: neither, or a damaged one."""
    return read(path) if path.is_dir() else geometric.read(path)


@dataclass(frozen=True)
class Export:
    """Result of an export."""

    scene: Scene  # the scene that was read
    descriptive: Path  # the descriptive.usda that was written: labels, boxes and joints in words
    geometric: Path  # the geometric.usd that was written: surfaces and joints


def export(path: Path, out: Path) -> Export:
    """Write the scan in a folder as descriptive.usda and geometric.usd in another.

    Raises:
        InputError: the folder holds no scan, or a damaged one; nothing is written.
    """
    written = Export(read(path), out / "descriptive.usda", out / "geometric.usd")
    with atomic_write(written.descriptive) as words, atomic_write(written.geometric) as shapes:
        descriptive.write(written.scene, words)
        geometric.write(written.scene, shapes)
    return written
