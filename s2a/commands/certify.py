"""sim.usd -> certificate.json and certificate.html: how ready for simulation it is."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

from s2a import robot
from s2a.certify import contents, report
from s2a.certify.check import Certificate
from s2a.certify.check_suite import CertifyConfig, certify, fingerprint
from s2a.certify.images import pictures
from s2a.errors import CheckFailed, InputError
from s2a.geometry.orbit_camera import OrbitCamera
from s2a.outputs import atomic_write, refuse_loss
from s2a.provenance import provenance
from s2a.robot.spec import RobotSpec
from s2a.usd.layer_files import files

RECORD = "certificate.json"


@dataclass(frozen=True)
class Config:
    """Keys of `s2a certify`.

    Attributes:
        stage: the sim.usd.
        part: id of one articulated part, such as drawer_7; null: all of them.
        out: the folder to write, with certificate.json and certificate.html; one of the same stage by the same code is kept.
        robot: the robot that the stage was prepared for.
        certify: what is asked, and the bounds.
        camera: intrinsics and framing of the images.
    """

    stage: Path
    part: str | None
    out: Path
    robot: RobotSpec
    certify: CertifyConfig
    camera: OrbitCamera


def run(config: Config) -> str:
    """Certify the parts, or keep what an earlier run found; return the verdicts.

    Raises:
        NotPassed: a check failed.
    """
    if not config.stage.is_file():
        raise InputError(f"stage {str(config.stage)!r} does not exist; give a sim.usd, which s2a prepare writes")
    settings = dataclasses.asdict(config.certify)
    robot.check_unchanged(config.robot)
    refuse_loss(config.out, RECORD, files(config.stage))
    held = contents.read(config.stage, config.part)
    parts = [held.part] if config.part else list(contents.parts(held))
    done = report.kept(config.out / RECORD, fingerprint(config.stage), settings, provenance("cpu"), parts)
    certificates = done or _write(config)
    said = "\n".join(report.summary(certificate) for certificate in certificates)
    said += f"\n  kept from {config.out / RECORD}" if done else f"\n  {config.out}"
    said += f"\n{report.table(certificates)}" if len(certificates) > 1 else ""
    if not all(certificate.passed for certificate in certificates):
        raise CheckFailed(said)
    return said


def overview(folder: Path) -> str:
    """Return the certificates below a folder as a table; empty if there is none."""
    found = [one for path in sorted(folder.rglob(RECORD)) for one in report.from_json(path.read_text())]
    return report.table(found) if found else ""


def _write(config: Config) -> list[Certificate]:
    """Certify the parts and write the folder."""
    with atomic_write(config.out, earlier=RECORD) as out:
        certificates = certify(config.stage, config.certify, config.part, config.robot.name)
        out.mkdir()
        shown = {c.target: pictures(config.stage, c.target, config.camera) for c in certificates if _readable(c)}
        (out / RECORD).write_text(report.to_json(certificates))
        (out / "certificate.html").write_text(report.to_html(certificates, shown))
    return certificates


def _readable(certificate: Certificate) -> bool:
    """Return whether a part is sound enough to be read by what trusts its file."""
    broken = {"finite", "units", "target", "target_joint", "grasp_and_base", "self_contained"}
    return not broken & {check.name for check in certificate.failed}
