"""Command `s2a check`: compare an annotated scan with its own surface; exit with 1 if they contradict each other."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

from s2a.core.errors import CheckFailed
from s2a.core.outputs import atomic_write
from s2a.core.provenance import provenance
from s2a.scan import load_scene
from s2a.scan.evidence import annotation, finding
from s2a.scan.evidence.finding import Bounds
from s2a.scan.formats.articulate3d import read_overlaps


@dataclass(frozen=True)
class Config:
    """Keys of `s2a check`.

    Attributes:
        scan: folder of the scan, or the geometric.usd of one.
        out: JSON file to write with every finding, also those that pass; or null.
        evidence: what the surface may say about the annotation.
    """

    scan: Path
    out: Path | None
    evidence: Bounds


def run(config: Config) -> str:
    """Check the annotation; return what warns.

    Raises:
        CheckFailed: the surface contradicts the annotation.
        InputError: no scan, or a damaged one.
    """
    scene = load_scene(config.scan)
    listed = read_overlaps(config.scan) if config.scan.is_dir() else []
    findings = annotation.check(scene, config.evidence, listed)
    if config.out:
        bounds = dataclasses.asdict(config.evidence)
        with atomic_write(config.out) as file:
            file.write_text(
                finding.to_json(findings, scan=str(config.scan), bounds=bounds, provenance=provenance("cpu"))
            )
    said = f"{config.scan}: {len(scene.movable)} moving parts of {scene.name}\n{finding.text(findings)}"
    said += f"\n  {config.out}" if config.out else ""
    if finding.failed(findings):
        raise CheckFailed(said)
    return said
