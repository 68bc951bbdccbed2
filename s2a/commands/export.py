"""Command `s2a export`: turn an annotated scan into two flavours of USD, descriptive and geometric."""

import logging
from dataclasses import dataclass
from pathlib import Path

from s2a.core import errors
from s2a.core.check import doubtful
from s2a.core.errors import InputError
from s2a.core.outputs import Output
from s2a.scan import export
from s2a.scan.evidence import Bounds
from s2a.scan.formats.articulate3d import read_overlaps
from s2a.scene.scene import Scene

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Config:
    """Keys of `s2a export`.

    Attributes:
        scan: folder of the scan.
        out: folder that receives descriptive.usda and geometric.usd.
        check: Print what `s2a check` finds as warnings; needs s2a[sim].
    """

    scan: Path
    out: Output
    check: bool
    evidence: Bounds = Bounds()  # what the surface may say about the annotation before a warning is printed


def run(config: Config) -> str:
    """Read the scan, write both flavours, and return a summary; what the surface says against the annotation is logged."""
    done = export(config.scan, config.out)
    scene = done.scene
    if config.check and scene.movable:
        _warn(config, scene)
    vertices = sum(len(part.mesh.vertices) for part in scene.parts.values())
    counts = f"{len(scene.parts)} parts, {vertices} vertices"
    joints = ", ".join(scene.movable) or "none"
    return f"{done.descriptive}, {done.geometric}: scene {scene.name}, {counts}; jointed: {joints}"


def _warn(config: Config, scene: Scene) -> None:
    """Log what the surface says against the annotation."""
    try:
        with errors.required():
            from s2a.scan.evidence import annotation  # of the extra "sim", without which a scan is exported unchecked
    except InputError as missing:
        _log.warning("the annotation is not checked against the surface: %s", missing)
        return
    for check in doubtful(annotation.check(scene, config.evidence, read_overlaps(config.scan))):
        _log.warning("%s: %s", check.name, check)
