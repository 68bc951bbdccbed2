"""Command `s2a certify`: validate a simulation-ready stage or a third-party asset; exit with 1 if a check fails."""

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from s2a.certify import contents, repair, report
from s2a.certify.asset import certify_asset
from s2a.certify.check_suite import CertifyConfig, certify
from s2a.certify.contents import STRUCTURE
from s2a.certify.report import asset_images, images, png
from s2a.core.check import ValidationReport, no_problems
from s2a.core.errors import CheckFailed, InputError
from s2a.core.outputs import Output, atomic_write, refuse_loss
from s2a.core.provenance import provenance
from s2a.prepare.neighbours import split, trim_apart
from s2a.prepare.room_hulls import RoomConfig
from s2a.robot import Robot
from s2a.scene.geometry.camera import OrbitCamera
from s2a.scene.scene import Joint
from s2a.scene.usd.sim_scene import SimBody
from s2a.scene.usd.stamp import content_hash, files, require_stampable, write_stamp
from s2a.view.report.results import validation_report

RECORD = "report.json"


@dataclass(frozen=True)
class Config:
    """Keys of `s2a certify`.

    Attributes:
        stage: the sim.usd; null: `asset`.
        asset: a third-party URDF, MJCF or USD file of one object or a room, in place of a stage.
        repair: folder that receives a copy of the asset with all safe repairs; null: none.
        part: id of one articulated part, such as drawer_7; null: all of them.
        out: the folder to write, with report.json, .html, .sarif and .junit.xml; an earlier one of this stage and code is kept.
        stamp: write the verdicts into the stage too, with the hash of its content.
        robot: the robot that the stage was prepared for, such as panda or baxter.
        certify: the check suite and its bounds.
        camera: intrinsics and framing of the images.
    """

    stage: Path | None
    asset: Path | None
    repair: Output | None
    part: str | None
    out: Output
    stamp: bool
    robot: Robot
    certify: CertifyConfig
    camera: OrbitCamera


def run(config: Config) -> str:
    """Certify the parts, or keep an earlier run's reports; return the verdicts; CheckFailed: a check failed."""
    if (config.stage is None) == (config.asset is None):
        raise InputError("give stage=FILE, a sim.usd, or asset=FILE, a third-party URDF, MJCF or USD")
    if config.stage is None:
        return _asset(config)
    if not config.stage.is_file():
        what = "is a folder" if config.stage.is_dir() else "does not exist"
        raise InputError(f"stage {str(config.stage)!r} {what}; give a sim.usd, which s2a prepare writes")
    if config.repair is not None:
        raise InputError("key 'repair' applies to asset=FILE; leave it out, and change a stage with s2a prepare")
    settings = dataclasses.asdict(config.certify)
    refuse_loss(config.out, RECORD, files(config.stage))
    held = contents.read(config.stage, config.part)
    parts = [held.part] if config.part else list(contents.parts(held))
    done = report.kept(config.out / RECORD, content_hash(config.stage), settings, provenance("cpu"), parts)
    if config.stamp and not done:
        require_stampable(config.stage)
    results = done or _write(config, config.stage)
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


def _asset(config: Config) -> str:
    """Certify a third-party asset, and repair it where `repair` is given; return the verdicts; CheckFailed: a check failed."""
    assert config.asset is not None
    if config.part is not None:
        raise InputError(
            f"key 'part' is {config.part!r}, and an asset is certified whole; leave it out, or give stage=FILE"
        )
    refuse_loss(config.out, RECORD, [config.asset, *([config.repair / config.asset.name] if config.repair else [])])
    if config.repair:
        refuse_loss(config.repair, repair.HULL_FOLDER, [config.asset, config.out / RECORD])
    first, subject = certify_asset(config.asset)
    results = [replace(first, target="as given")]
    shown = {"as given": captioned(asset_images(subject.asset, config.camera))}
    if config.repair is not None:
        edits = repair.plan(subject, first, trimmed, split)
        with atomic_write(config.repair, earlier=repair.HULL_FOLDER) as folder:
            folder.mkdir()
            repair.write(subject.asset, edits, folder, config.repair)
        again, other = certify_asset(config.repair / config.asset.name)
        same = repair.same_visuals(subject.asset, other.asset)
        look = no_problems(
            "same_visuals", [] if same else [("", "it looks other, or moves about other axes")], "report it"
        )
        results.append(replace(again, target="repaired", checks=(*again.checks, look, *repair.described(edits))))
        shown["repaired"] = captioned(asset_images(other.asset, config.camera))
    with atomic_write(config.out, earlier=RECORD) as out:
        out.mkdir()
        _write_reports(out, results, config.asset, shown)
    lines = [report.verdict(each) for each in results]
    lines += [f"  repaired: {check.message}" for check in results[-1].checks if check.name == "repaired"]
    text = "\n".join([*lines, f"  {config.out}"])
    if not results[-1].passed:
        raise CheckFailed(text)
    return text


def trimmed(
    bodies: Mapping[str, SimBody], joints: Mapping[str, Joint], parents: Mapping[str, str]
) -> dict[str, SimBody]:
    """Return bodies without handles whose colliders are trimmed apart, with the settings of `s2a prepare`."""
    return trim_apart(bodies, joints, parents, {}, (), RoomConfig(resolution=1))


def _write(config: Config, stage: Path) -> list[ValidationReport]:
    """Certify the parts and write the folder."""
    with atomic_write(config.out, earlier=RECORD) as out:
        results = certify(stage, config.certify, config.part, config.robot.name)
        out.mkdir()
        shown = {c.target: captioned(images(stage, c.target, config.camera)) for c in results if _readable(c)}
        _write_reports(out, results, stage, shown)
    return results


def captioned(images: Mapping[str, np.ndarray]) -> list[tuple[str, bytes]]:
    """Return images by their captions as captions and PNG files."""
    return [(caption, png(image)) for caption, image in images.items()]


def _write_reports(
    out: Path, results: list[ValidationReport], stage: Path, shown: dict[str, list[tuple[str, bytes]]]
) -> None:
    """Write reports as JSON, as a page, as SARIF and as JUnit's XML."""
    record = report.to_json(results)
    (out / RECORD).write_text(record)
    (out / "report.html").write_text(validation_report(json.loads(record), stage, shown).html())
    (out / "report.sarif").write_text(report.to_sarif(results))
    (out / "report.junit.xml").write_text(report.to_junit(results))


def _readable(result: ValidationReport) -> bool:
    """Return whether a part is sound enough to be read by what trusts its file."""
    return not STRUCTURE.needed("images") & {check.name for check in result.failed}
