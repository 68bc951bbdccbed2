"""What "simulation-ready" means, measured: a stage's structure, its surfaces, and what it does under physics."""

from __future__ import annotations

import dataclasses
import hashlib
import time
from dataclasses import dataclass
from pathlib import Path

from s2a.certify import contents, foundation, shapes, static
from s2a.certify.check import Certificate, Check
from s2a.certify.foundation import FoundationConfig
from s2a.certify.shapes import ShapeConfig
from s2a.provenance import provenance


@dataclass(frozen=True)
class CertifyConfig:
    """What is asked of a stage.

    Attributes:
        shapes: bounds of the static rules about surfaces.
        foundation: what is asked of NVIDIA's SimReady rules.
    """

    shapes: ShapeConfig
    foundation: FoundationConfig


def certify(path: Path, config: CertifyConfig) -> Certificate:
    """Ask everything of a sim.usd; physics only where its structure is sound, since a simulator trusts what it reads.

    Raises:
        InputError: no such file, or a stage of another flavour.
    """
    start = time.perf_counter()
    held = contents.read(path)
    structure = [rule(held) for rule in static.RULES] + [rule(held, config.shapes) for rule in shapes.RULES]
    checks = [*structure, *foundation.foundation(path, config.foundation)]
    return Certificate(
        stage=str(path),
        sha256=fingerprint(path),
        target=held.target.GetName() if held.target else "",
        checks=tuple(checks),
        graspable=None,
        settings=dataclasses.asdict(config),
        seconds=round(time.perf_counter() - start, 2),
        provenance=provenance("cpu"),
    )


def fingerprint(path: Path) -> str:
    """Return the SHA-256 of a file's content."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


__all__ = ["Certificate", "CertifyConfig", "Check", "certify", "fingerprint"]
