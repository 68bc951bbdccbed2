"""An annotated scan -> descriptive.usda and geometric.usd."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from s2a import api


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
    """Read the scan, write both flavours, and return a summary."""
    done = api.export(config.scan, config.out)
    scene = done.scene
    vertices = sum(len(part.mesh.vertices) for part in scene.parts.values())
    counts = f"{len(scene.parts)} parts, {vertices} vertices"
    joints = ", ".join(scene.movable) or "none"
    return f"{done.descriptive}, {done.geometric}: scene {scene.name}, {counts}; jointed: {joints}"
