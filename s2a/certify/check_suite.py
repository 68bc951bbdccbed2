"""The check suite: all checks of a stage, as one validation report a part."""

import dataclasses
import math
import time
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco

from s2a.certify import contents, grasp, static  # noqa: F401  (static registers its checks, the first ones)
from s2a.certify.contents import STRUCTURE, Contents, ShapeConfig
from s2a.certify.grasp import Gap, GapConfig, GripConfig, GripTest
from s2a.certify.physics import MOTION, MotionConfig, MujocoWorld, PhysicsConfig
from s2a.certify.portability import FoundationConfig, foundation
from s2a.certify.scan_evidence import REASON, Evidence, EvidenceConfig, doubts
from s2a.core.check import Check, Status, ValidationReport, at_most
from s2a.core.errors import InputError
from s2a.core.progress import track
from s2a.core.provenance import provenance
from s2a.scene.usd.stage import ROOT
from s2a.scene.usd.stamp import content_hash


@dataclass(frozen=True, kw_only=True)
class CertifyConfig:
    """Settings of the check suite.

    Attributes:
        physics: how physics is stepped.
        motion: bounds of the checks without a gripper.
    """

    shapes: ShapeConfig = ShapeConfig()  # bounds of the static rules about surfaces
    foundation: FoundationConfig = FoundationConfig()  # profile of NVIDIA's SimReady rules
    evidence: EvidenceConfig = EvidenceConfig()  # bounds of what the scanned surface may say
    gap: GapConfig = GapConfig()  # bounds on the finger gap
    physics: PhysicsConfig
    motion: MotionConfig
    grip: GripConfig = GripConfig()  # the grasp-hold test


def certify(
    path: Path, config: CertifyConfig, part: str | None = None, robot: str | None = None
) -> list[ValidationReport]:
    """Ask everything of the articulated parts of a sim.usd; physics only where the structure is sound, which simulators trust.

    Args:
        path: the file.
        config: what is asked.
        part: id of one part; None: all of them, a report each.
        robot: name of the robot whose gripper is tried; None: one that the part was prepared for.

    Raises:
        InputError: no such file, a stage of another flavour, or no such part.
    """
    start = time.perf_counter()
    held = contents.read(path, part)
    room = STRUCTURE.ask(held, config.shapes, "room")
    evidence = _evidence(path)
    foundation_checks = foundation(path, config.foundation)
    seconds, reports = time.perf_counter() - start, []
    for one in track([held.part] if part else contents.parts(held) or [""], "certify"):
        begun = time.perf_counter()
        checks, graspable = _part(path, contents.about(held, one), room, config, robot, evidence)
        reports.append(
            ValidationReport(
                stage=str(path),
                sha256=content_hash(path),
                target=one,
                checks=(*foundation_checks, *checks),
                graspable=graspable,
                settings=dataclasses.asdict(config),
                seconds=round(seconds + time.perf_counter() - begun, 2),
                provenance=provenance("cpu"),
            )
        )
    return reports


def _part(
    path: Path, held: Contents, room: list[Check], config: CertifyConfig, robot: str | None, evidence: Evidence | Check
) -> tuple[list[Check], bool | None]:
    """Return the checks of one part, those of the room first, and whether a gripper can hold it."""
    checks, graspable = [*room, *STRUCTURE.ask(held, config.shapes)], None
    needed = STRUCTURE.needed("physics", "images")
    broken = [check.name for check in checks if check.status != "pass" and check.name in needed]
    if broken:
        text = f"failed checks would make the simulation meaningless: {', '.join(broken)}"
        return [*checks, Check("physics", "skipped", message=text)], None
    if isinstance(evidence, Check):
        return [*checks, evidence], None
    seen = evidence.checks(held.part, config.evidence, robot)
    physics, graspable = _physics(path, held, config, robot, seen)
    return [*checks, *seen, *physics], graspable


def _evidence(path: Path) -> Evidence | Check:
    """Return the scanned surface of a stage, or the check that says why there is none."""
    try:
        return Evidence(path)
    except InputError as error:
        return Check("scan_evidence", "fail", prim=ROOT, message=str(error), remedy="run s2a prepare again")


def _physics(
    path: Path, held: Contents, config: CertifyConfig, robot: str | None, seen: list[Check]
) -> tuple[list[Check], bool | None]:
    """Return the checks that need a simulator, on one model of the stage, and whether a gripper can hold the part."""
    try:
        world = MujocoWorld(path, config.physics, held.part, robot=robot)
    except (ValueError, RuntimeError, mujoco.FatalError, InputError) as error:
        text = " ".join(str(error).split())[:300]
        return [Check("newton_import", "fail", prim="/scene", message=text, remedy="see Newton's error")], None
    room, attempt = grasp.gap(path, held, world.robot.gripper), grasp.grip(world, config.grip)
    return [
        *MOTION.ask(world, config.motion),
        *_fingers(world.stage.target, room, attempt, config, seen),
    ], attempt.holds


def _fingers(target: str, room: Gap, attempt: GripTest, config: CertifyConfig, seen: list[Check]) -> list[Check]:
    """Return the checks of the finger gap and of the grasp; where the scan says why no gripper could hold it, neither fails."""
    fits, region = room.graspable(config.gap), f"/scene/{target}/region"
    text = f"{room.free_fraction:.0%} of the finger gap is free as scanned; the region is {1000 * room.thickness:.0f} mm thick"
    if math.isnan(room.fill_ratio):
        filled = Check("finger_gap", "info", prim=region, message=text)
    else:
        remedy = "prepare with colliders that keep the gap free (prepare=handle)"
        filled = at_most(
            "finger_gap", room.fill_ratio, config.gap.max_fill_ratio, "", prim=region, message=text, remedy=remedy
        )
        filled = filled if fits else replace(filled, status="info", remedy="")
    message = attempt.message if attempt.holds else f"not graspable by a parallel gripper: {attempt.message}"
    why = [*doubts(seen, (REASON,)), *room.reasons(config.gap)]
    message += f"; {'; '.join(why)}" if why and not attempt.holds else ""
    status: Status = "pass" if attempt.holds else "info" if why else "fail"
    fix = "inspect the colliders of the grasp region and around it" if status == "fail" else ""
    hold = Check("grasp_hold", status, attempt.slip, config.grip.slip, "m", attempt.prim, message, fix)
    return [filled, hold]


__all__ = ["ValidationReport", "CertifyConfig", "Check", "certify"]
