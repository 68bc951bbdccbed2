"""What the scanned surface in a sim.usd says about its joints, grasps, colliders and base poses."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from s2a import robot
from s2a.certify.check import Check, Status
from s2a.certify.fidelity import FidelityConfig, collider_fidelity, scanned
from s2a.certify.grasp_frame import grasp_frame
from s2a.certify.robot_base import BaseCheckConfig, robot_base
from s2a.scan.evidence.annotation import moving_part
from s2a.scan.evidence.bounds import Bounds
from s2a.scan.evidence.finding import Finding
from s2a.scan.evidence.front import Front, front
from s2a.scan.evidence.room import findings as room_findings
from s2a.scan.evidence.surface import ScanSurface
from s2a.scene.geometry.mesh_ops import keep
from s2a.scene.scene import Joint, Mesh, Part, Scene
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import SimRoom, in_scene
from s2a.scene.usd.stage import ROOT

REASON = "handle_relief"
"""A doubt that is no failure by itself: why a part cannot be held. Every other doubt about a part is one: it would move as no
such part does, or through what was scanned. None is raised by a right annotation of the virtual rooms
(experiments/wrong_annotations.py)."""
OWN = "grasp_on_region"
"""Asked of the grasp point that the file names (`grasp_frame`), not of the region's mean."""


@dataclass(frozen=True)
class EvidenceConfig:
    """What is asked of the scanned surface.

    Attributes:
        joints: bounds of what it may say about an annotation, those of `s2a check`.
        fidelity: bounds on the distance between colliders and surface.
        base: bounds on where a robot stands.
    """

    joints: Bounds
    fidelity: FidelityConfig
    base: BaseCheckConfig


class Evidence:
    """The scanned surface of a sim.usd, read once for all its parts."""

    def __init__(self, path: Path) -> None:
        """Read a stage whose structure is sound, with its visuals; InputError for any other."""
        self.room = sim_stage.read(path)
        self._surface = ScanSurface(as_scene(self.room))
        self._whole: dict[Bounds, list[Finding]] = {}

    def checks(self, part: str, config: EvidenceConfig, only: str | None = None) -> list[Check]:
        """Return all checks of an articulated part against the scanned surface; `only` names the one robot that is asked for."""
        findings = [*self._of_room(config.joints), *moving_part(self._surface, part, self._fronts[part], config.joints)]
        articulation, path = self.room.articulations[part], f"{ROOT}/{part}"
        robots = {only} if only in articulation.bases else set(articulation.bases)
        widest = max(robot.load(name).gripper.max_opening for name in robots)
        checks = [_check(finding) for finding in findings if finding.verdict != "unknown" and finding.check != OWN]
        checks += collider_fidelity(self.room, part, config.fidelity)
        checks += grasp_frame(path, articulation.grasp, scanned(self.room, part), config.joints.grasp_gap, widest)
        point = np.array(articulation.grasp.point)
        for name in sorted(robots):
            base, spec = articulation.bases[name], robot.load(name)
            checks += robot_base(f"{path}/bases/{name}", base, point, self._surface.tree, spec, config.base)
        return checks

    @cached_property
    def _fronts(self) -> dict[str, Front | None]:
        """The fronts of all articulated parts by id."""
        return {part: front(self._surface, part) for part in self.room.articulations}

    def _of_room(self, bounds: Bounds) -> list[Finding]:
        """Return what the surface says about the whole room, asked once for all its parts."""
        if bounds not in self._whole:
            self._whole[bounds] = room_findings(self._surface, self._fronts, bounds)
        return self._whole[bounds]


def as_scene(room: SimRoom) -> Scene:
    """Return the scanned surfaces of a simulation-ready room as a scene, without what was added, nothing cut away."""
    parts: dict[str, Part] = {}
    for index, part in enumerate(room.static_parts):
        if room.static_face_part is not None:
            parts[part] = _part(part, keep(room.static_visual, room.static_face_part == index))
    if not room.static_parts:
        parts["static"] = _part("static", room.static_visual)
    for body in room.bodies:
        parts |= _body(room, body)
    for free in room.free.values():
        parts[free.id] = _part(free.id, Mesh(in_scene(free, free.visual), free.visual.faces))
    return Scene(room.name, parts)


def _body(room: SimRoom, body: str) -> dict[str, Part]:
    """Return a body and, as a part of its own, the region where it is grasped."""
    surface = scanned(room, body)
    articulation = room.articulations.get(body)
    if articulation is None:
        return {body: _part(body, surface)}
    region = articulation.grasp.region
    rest = without(surface, region)
    if not rest.face_areas.sum() > 0:
        return {body: _part(body, surface, articulation.parent, articulation.joint, graspable=True)}
    handle = f"handle_of_{body}"
    return {
        body: _part(body, rest, articulation.parent, articulation.joint),
        handle: Part("handle", region, body, "fixed", True),
    }


def without(surface: Mesh, region: Mesh) -> Mesh:
    """Return the faces of a surface that are not a region's, whose vertices are the same bit for bit."""
    own = {bytes(vertex) for vertex in region.vertices}
    shared = np.array([bytes(vertex) in own for vertex in surface.vertices], bool)
    return keep(surface, ~shared[surface.faces].all(axis=1))


def _part(
    name: str, mesh: Mesh, parent: str | None = None, motion: Joint | None = None, *, graspable: bool = False
) -> Part:
    label = re.sub(r"_\d+$", "", name).replace("_", " ")
    return Part(label, Mesh(mesh.vertices, mesh.faces), parent, motion or "fixed", graspable)


def _check(finding: Finding) -> Check:
    """Return a finding about an annotation as a check of the stage."""
    severe = finding.verdict == "fail" or (finding.verdict == "warn" and bool(finding.part) and finding.check != REASON)
    status: Status = "fail" if severe else "info" if finding.verdict == "warn" else "pass"
    value, bound = (None if math.isnan(x) else x for x in (finding.value, finding.bound))
    prim = f"{ROOT}/joints/{finding.part}" if finding.part else ROOT
    message = "" if status == "pass" else finding.message
    return Check(finding.check, status, value, bound, finding.unit, prim, message, finding.remedy if severe else "")


def doubts(checks: Sequence[Check], names: Sequence[str]) -> list[str]:
    """Return the messages of those checks that did not pass."""
    return [check.message for check in checks if check.name in names and check.status in ("fail", "info")]
