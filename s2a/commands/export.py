"""An annotated scan -> descriptive.usda and geometric.usd."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from s2a import scan
from s2a.outputs import atomic_write
from s2a.usd import descriptive, geometric


@dataclass(frozen=True)
class Config:
    """Keys of `s2a export`.

    Attributes:
        scan: folder of the scan.
        out: folder that receives descriptive.usda and geometric.usd.
    """

    scan: Path
    out: Path


def run(config: Config) -> str:
    """Read the scan, write both flavours, and return what was written."""
    scene = scan.read(config.scan)
    words, shapes = config.out / "descriptive.usda", config.out / "geometric.usd"
    with atomic_write(words) as words_aside, atomic_write(shapes) as shapes_aside:
        descriptive.write(scene, words_aside)
        geometric.write(scene, shapes_aside)
    vertices = sum(len(part.mesh.vertices) for part in scene.parts.values())
    counts = f"{len(scene.parts)} parts, {vertices} vertices"
    return f"{words}, {shapes}: scene {scene.name}, {counts}; jointed: {', '.join(scene.movable) or 'none'}"
