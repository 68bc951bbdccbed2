"""Scenes from files, and the export of a scan as the two flavours of USD."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from s2a import scan
from s2a.core.outputs import atomic_write
from s2a.scene.scene import Scene
from s2a.scene.usd import descriptive, geometric


@dataclass(frozen=True)
class Export:
    """Result of an export.

    Attributes:
        scene: the scene that was read.
        descriptive: the descriptive.usda that was written: labels, boxes and joints in words.
        geometric: the geometric.usd that was written: surfaces and joints.
    """

    scene: Scene
    descriptive: Path
    geometric: Path


def load_scene(path: Path) -> Scene:
    """Read a scene from the folder of a scan, or from a geometric stage; InputError: neither, or a damaged one."""
    return scan.read(path) if path.is_dir() else geometric.read(path)


def export(folder: Path, out: Path) -> Export:
    """Write the scan in a folder as descriptive.usda and geometric.usd in another.

    Raises:
        InputError: the folder holds no scan, or a damaged one; nothing is written.
    """
    written = Export(scan.read(folder), out / "descriptive.usda", out / "geometric.usd")
    with atomic_write(written.descriptive) as words, atomic_write(written.geometric) as shapes:
        descriptive.write(written.scene, words)
        geometric.write(written.scene, shapes)
    return written
