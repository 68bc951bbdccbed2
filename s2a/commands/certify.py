"""Command `s2a certify`: validate a simulation-ready stage; exit with 1 if a check fails."""

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path

from s2a.certify import contents, report
from s2a.certify.check import ValidationReport
from s2a.certify.check_suite import CertifyConfig, certify
from s2a.certify.contents import STRUCTURE
from s2a.certify.report import images, png
from s2a.core.errors import CheckFailed, InputError
from s2a.core.outputs import Output, atomic_write, refuse_loss
from s2a.core.provenance import provenance
from s2a.robot import Robot
from s2a.scene.geometry.camera import OrbitCamera
from s2a.scene.usd.stamp import content_hash, files, require_stampable, write_stamp
from s2a.view.report.results import validation_report

RECORD = "report.json"


@dataclass(frozen=True)
class Config:
    """Keys of `s2a certify`.

    Attributes:
        stage: the sim.usd.
        part: id of one articulated part, such as drawer_7; null: all of them.
        out: the folder to write, with report.json and report.html; an earlier one of this stage and code is kept.
        stamp: write the verdicts into the stage too, with the hash of its content.
        robot: the robot that the stage was prepared for, such as panda or baxter.
        certify: the check suite and its bounds.
        camera: intrinsics and framing of the images.
    """

    stage: Path
    part: str | None
    out: Output
    stamp: bool
    robot: Robot
    certify: CertifyConfig
    camera: OrbitCamera


def run(config: Config) -> str:
    """Certify the parts, or keep an earlier run's reports; return the verdicts; CheckFailed: a check failed."""
    if not config.stage.is_file():
        what = "is a folder" if config.stage.is_dir() else "does not exist"
        raise InputError(f"stage {str(config.stage)!r} {what}; give a sim.usd, which s2a prepare writes")
    settings = dataclasses.asdict(config.certify)
    refuse_loss(config.out, RECORD, files(config.stage))
    held = contents.read(config.stage, config.part)
    parts = [held.part] if config.part else list(contents.parts(held))
    done = report.kept(config.out / RECORD, content_hash(config.stage), settings, provenance("cpu"), parts)
    if config.stamp and not done:
        require_stampable(config.stage)
    results = done or _write(config)
    if config.stamp and not done:
        write_stamp(config.stage, {result.target: result.passed for result in results})
    text = "\n".join([*map(report.summary, results), *report.skipped(results)])
    text += f"\n  kept from {config.out / RECORD}" if done else f"\n  {config.out}"
    text += f"\n{report.table(results)}" if len(results) > 1 else ""
    if not all(result.passed for result in results):
        raise CheckFailed(text)
    return text


def overview(folder: Path) -> str:
    """Return the reports below a folder as a table; empty if there is none."""
    results = [one for path in sorted(folder.rglob(RECORD)) for one in report.from_json(path.read_text())]
    return report.table(results) if results else ""


def _write(config: Config) -> list[ValidationReport]:
    """Certify the parts and write the folder."""
    with atomic_write(config.out, earlier=RECORD) as out:
        results = certify(config.stage, config.certify, config.part, config.robot.name)
        out.mkdir()
        shown = {
            c.target: [
                (caption, png(image)) for caption, image in images(config.stage, c.target, config.camera).items()
            ]
            for c in results
            if _readable(c)
        }
        record = report.to_json(results)
        (out / RECORD).write_text(record)
        page = validation_report(json.loads(record), config.stage, shown)
        (out / "report.html").write_text(page.html())
    return results


def _readable(result: ValidationReport) -> bool:
    """Return whether a part is sound enough to be read by what trusts its file."""
    return not STRUCTURE.needed("images") & {check.name for check in result.failed}
