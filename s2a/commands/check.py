"""Command `s2a check`: compare an annotated scan with its own surface; exit with 1 if they contradict each other."""

import json
from dataclasses import dataclass
from pathlib import Path

from s2a.core.check import as_json, failed, text
from s2a.core.errors import CheckFailed
from s2a.core.outputs import Output, atomic_write
from s2a.core.provenance import provenance
from s2a.scan import load_scene
from s2a.scan.evidence import Bounds, annotation
from s2a.scan.formats.articulate3d import read_overlaps


@dataclass(frozen=True)
class Config:
    """Keys of `s2a check`.

    Attributes:
        scan: folder of the scan, or the geometric.usd of one.
        out: JSON file to write with every check, also those that pass; or null.
    """

    scan: Path
    out: Output | None
    evidence: Bounds = Bounds()  # what the surface may say about the annotation


def run(config: Config) -> str:
    """Check the annotation; return what warns.

    Raises:
        CheckFailed: the surface contradicts the annotation.
        InputError: no scan, or a damaged one.
    """
    scene = load_scene(config.scan)
    listed = read_overlaps(config.scan) if config.scan.is_dir() else []
    checks = annotation.check(scene, config.evidence, listed)
    if config.out:
        about = {"scan": str(config.scan), "bounds": config.evidence, "provenance": provenance("cpu")}
        values = {"passed": not failed(checks), **about, "checks": checks}
        with atomic_write(config.out) as file:
            file.write_text(json.dumps(as_json(values), indent=1) + "\n")
    summary = f"{config.scan}: {len(scene.movable)} moving parts of {scene.name}\n{text(checks)}"
    summary += f"\n  {config.out}" if config.out else ""
    if failed(checks):
        raise CheckFailed(summary)
    return summary
