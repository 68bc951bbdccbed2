"""sim.usd -> certificate.json and certificate.html: how ready for simulation it is."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

from s2a.certify import report
from s2a.certify.check_suite import CertifyConfig, certify, fingerprint
from s2a.certify.images import pictures
from s2a.errors import CheckFailed, InputError
from s2a.geometry.orbit_camera import OrbitCamera
from s2a.outputs import atomic_write, refuse_loss
from s2a.provenance import provenance
from s2a.usd.layer_files import files

RECORD = "certificate.json"


@dataclass(frozen=True)
class Config:
    """Keys of `s2a certify`.

    Attributes:
        stage: the sim.usd.
        out: the folder to write, with certificate.json and certificate.html; one of the same stage by the same code is kept.
        certify: what is asked, and the bounds.
        camera: intrinsics and framing of the images.
    """

    stage: Path
    out: Path
    certify: CertifyConfig
    camera: OrbitCamera


def run(config: Config) -> str:
    """Certify the stage, or keep what an earlier run found; return the verdict.

    Raises:
        NotPassed: a check failed.
    """
    if not config.stage.is_file():
        raise InputError(f"stage {str(config.stage)!r} does not exist; give a sim.usd, which s2a prepare writes")
    settings = dataclasses.asdict(config.certify)
    refuse_loss(config.out, RECORD, files(config.stage))
    done = report.kept(config.out / RECORD, fingerprint(config.stage), settings, provenance("cpu"))
    certificate = done or _write(config)
    said = report.summary(certificate) + (f"\n  kept from {config.out / RECORD}" if done else f"\n  {config.out}")
    if not certificate.passed:
        raise CheckFailed(said)
    return said


def overview(folder: Path) -> str:
    """Return the certificates below a folder as a table; empty if there is none."""
    found = [report.from_json(path.read_text()) for path in sorted(folder.rglob(RECORD))]
    return report.table(found) if found else ""


def _write(config: Config) -> report.Certificate:
    """Certify the stage and write the folder."""
    with atomic_write(config.out, earlier=RECORD) as out:
        certificate = certify(config.stage, config.certify)
        out.mkdir()
        # What is not sound enough to be read safely is not drawn either.
        broken = {"finite", "units", "target", "grasp_and_base"} & {check.name for check in certificate.failed}
        shown = {} if broken else pictures(config.stage, certificate.target, config.camera)
        (out / RECORD).write_text(report.to_json(certificate))
        (out / "certificate.html").write_text(report.to_html(certificate, shown))
    return certificate
