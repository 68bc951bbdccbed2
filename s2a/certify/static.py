"""Static rules for the prims of a sim.usd, independent of any simulator."""

from __future__ import annotations

import functools
import importlib.util
import logging
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdPhysics, UsdUtils

from s2a.certify.contents import Contents, ends, fixed_carrier
from s2a.core.check import Check, at_most, no_problems
from s2a.scene import scene
from s2a.scene.usd.joints import KINDS
from s2a.scene.usd.sim_scene import PREPARE_AGAIN
from s2a.scene.usd.stage import ROOT, broken_rules

EXACT = 1e-6
"""Largest difference of an exact value and its float32 copy [m or 1]."""
NEAR_CENTER = 0.05  # [m] between a free body's frame and its centre of mass; at 5 m a stapler's motion becomes NaN


def units(contents: Contents) -> Check:
    """Metres, kilograms, z up, gravity down."""
    stage, problems = contents.stage, []
    if UsdGeom.GetStageMetersPerUnit(stage) != 1.0:
        problems.append((ROOT, f"metersPerUnit is {UsdGeom.GetStageMetersPerUnit(stage):g}, not 1"))
    if UsdPhysics.GetStageKilogramsPerUnit(stage) != 1.0:
        problems.append((ROOT, f"kilogramsPerUnit is {UsdPhysics.GetStageKilogramsPerUnit(stage):g}, not 1"))
    if UsdGeom.GetStageUpAxis(stage) != UsdGeom.Tokens.z:
        problems.append((ROOT, f"upAxis is {UsdGeom.GetStageUpAxis(stage)}, not Z"))
    scenes = [UsdPhysics.Scene(prim) for prim in stage.Traverse() if prim.IsA(UsdPhysics.Scene)]
    down = [s for s in scenes if Gf.IsClose(s.GetGravityDirectionAttr().Get(), Gf.Vec3f(0, 0, -1), 1e-6)]
    if len(scenes) != 1 or not down:
        problems.append((ROOT, f"{len(scenes)} physics scenes, {len(down)} with gravity along -z; expected one"))
    return no_problems("units", problems, "convert the stage to metres, kilograms and z up", "metres, kilograms, z up")


def self_contained(contents: Contents) -> Check:
    """Nothing of the stage lies in another file, but the visuals in one beside it; nothing is instanced."""
    stage, problems = contents.stage, []
    for prim in stage.TraverseAll():
        if prim.IsInstance() or prim.IsPrototype():
            problems.append((str(prim.GetPath()), "an instance"))
        if prim.HasAuthoredReferences() or prim.HasAuthoredInherits():
            problems.append((str(prim.GetPath()), "a reference"))
        own = (spec for spec in prim.GetPrimStack() if spec.layer == stage.GetRootLayer())
        payloads = [arc.assetPath for spec in own for arc in spec.payloadList.GetAddedOrExplicitItems()]
        if payloads and (prim.GetName() != "visual" or any("/" in path.removeprefix("./") for path in payloads)):
            problems.append(
                (str(prim.GetPath()), f"a payload, {payloads[0]!r}, that is no visual in a file beside this one")
            )
    _, _, missing = UsdUtils.ComputeAllDependencies(stage.GetRootLayer().identifier)
    problems += [(ROOT, f"the file {name!r} cannot be found") for name in missing]
    remedy = "flatten the stage, or put its visuals beside it"
    return no_problems("self_contained", problems, remedy, "one file and its visuals, nothing instanced")


def target(contents: Contents) -> Check:
    """The part that the joint is named after is a rigid body."""
    name, problems = contents.part, []
    if not name:
        problems.append((f"{ROOT}/joints", "no joint moves anything"))
    elif not contents.target or not contents.target.HasAPI(UsdPhysics.RigidBodyAPI):
        problems.append((f"{ROOT}/{name}", f"the joint {name!r} has no rigid body of its name"))
    elif contents.joint and contents.joint.GetName() != name:
        problems.append((str(contents.joint.GetPath()), f"the joint that moves {name!r} has another name"))
    return no_problems("target", problems, PREPARE_AGAIN, f"{name!r} moves", f"{ROOT}/{name}")


def bodies(contents: Contents) -> Check:
    """Bodies are siblings; what hangs on a joint stands at the identity, what is free at its centre of mass."""
    problems = []
    moved = {path for joint in contents.joints for path in ends(joint)[1]}
    for body in contents.bodies:
        path, matrix = body.GetPath(), UsdGeom.Xformable(body).ComputeLocalToWorldTransform(Usd.TimeCode.Default())
        turn = np.array(matrix)[:3, :3]
        if path.GetParentPath() != ROOT:
            problems.append((str(path), "a body below another prim than the scene; bodies are siblings"))
        if path not in moved and not contents.colliders_of(body):
            problems.append((str(path), "no joint holds the body and it has no colliders: it falls through everything"))
        if not (np.abs(turn @ turn.T - np.eye(3)).max() <= EXACT and matrix.GetDeterminant() > 0):
            problems.append((str(path), "a transform of the body scales, shears or mirrors"))
        elif path in moved and not Gf.IsClose(matrix, Gf.Matrix4d(1.0), EXACT):
            problems.append((str(path), "a transform moves the body away from its joint's frame"))
        center = UsdPhysics.MassAPI(body).GetCenterOfMassAttr().Get()
        if path not in moved and center is not None and not np.linalg.norm(center) <= NEAR_CENTER:
            problems.append(
                (str(path), f"its frame is {np.linalg.norm(center):.2f} m off its centre of mass: it diverges")
            )
    return no_problems("bodies", problems, PREPARE_AGAIN, f"{len(contents.bodies)} bodies, siblings, each in its frame")


def root_joint(contents: Contents) -> Check:
    """What carries the part is fixed to the world and is the root of the articulation."""
    problems = []
    roots = [prim for prim in contents.stage.Traverse() if prim.HasAPI(UsdPhysics.ArticulationRootAPI)]
    carrier = fixed_carrier(contents)
    if carrier is None:
        problems.append((_path(contents.joint), "the part's joint has no body to move against"))
    else:
        here = carrier.GetPath()
        fixed = [j for j in contents.joints if j.IsA(UsdPhysics.FixedJoint) and ends(j) == ([], [here])]
        if len(fixed) != 1:
            problems.append((str(here), f"{len(fixed)} fixed joints hold what carries the part in the world, not one"))
        if not {p.GetPath() for p in roots} & {here, *(j.GetPath() for j in fixed)}:
            problems.append((str(here), "no articulation root: Newton would leave the joint outside of articulations"))
    return no_problems(
        "root_joint", problems, "fix the cabinet to the world and apply PhysicsArticulationRootAPI to it"
    )


def target_joint(contents: Contents) -> Check:
    """One slide or hinge moves the target, between two bodies of the stage."""
    problems = []
    moving = [j for j in contents.joints if contents.target and contents.target.GetPath() in ends(j)[1]]
    if len(moving) != 1:
        problems.append((_path(contents.target), f"{len(moving)} joints move the target, not one"))
    for joint in contents.joints:
        known = {body.GetPath() for body in contents.bodies}
        lost = [path for paths in ends(joint) for path in paths if path not in known]
        problems += [(str(joint.GetPath()), f"the joint holds {path}, which is no body") for path in lost]
    for joint in moving:
        if joint.GetTypeName() not in KINDS:
            problems.append((str(joint.GetPath()), f"a {joint.GetTypeName()} moves the target, not a slide or hinge"))
        if not ends(joint)[0]:
            text = "the joint hangs on the world itself: poses stay stale in Newton 1.8; hang it on an anchor body"
            problems.append((str(joint.GetPath()), text))
        if UsdPhysics.Joint(joint).GetJointEnabledAttr().Get() is False:
            problems.append((str(joint.GetPath()), "the joint is switched off"))
    return no_problems("target_joint", problems, PREPARE_AGAIN, prim=_path(contents.joint))


def joint_limits(contents: Contents) -> Check:
    """The exact limits are ordered, hold the scanned pose, are of a piece of furniture, and the physics limits agree."""
    name, joint = "joint_limits", contents.joint
    if joint is None or joint.GetTypeName() not in KINDS:
        return _unasked(name, "target_joint")
    low, high = joint.GetAttribute("s2a:limits").Get() or (math.nan, math.nan)
    turn = math.degrees(1.0) if joint.GetTypeName() == "PhysicsRevoluteJoint" else 1.0
    physics = [joint.GetAttribute(f"physics:{end}Limit").Get() for end in ("lower", "upper")]
    problems = scene.problems(KINDS[joint.GetTypeName()], low, high)
    if not all(
        value is not None and abs(value / turn - exact) <= EXACT * max(1.0, abs(exact))
        for value, exact in zip(physics, (low, high), strict=True)
    ):
        problems.append(f"physics limits {physics[0]} to {physics[1]} say other than s2a:limits {low:g} to {high:g}")
    path = str(joint.GetPath())
    remedy = "correct the annotation's range (metres or radians, from the scanned pose) and " + PREPARE_AGAIN
    return no_problems(name, [(path, text) for text in problems], remedy, f"{low:.3f} to {high:.3f}", path)


def joint_frames(contents: Contents) -> Check:
    """The exact axis and origin agree with the physics frames in both bodies."""
    name, joint = "joint_frames", contents.joint
    if joint is None:
        return _unasked(name, "target_joint")
    axis, origin = (joint.GetAttribute(f"s2a:{key}").Get() for key in ("axis", "origin"))
    letter = joint.GetAttribute("physics:axis").Get()
    worst = math.nan
    if axis is not None and origin is not None and letter in ("X", "Y", "Z"):
        physics, worst = UsdPhysics.Joint(joint), abs(float(np.linalg.norm(axis)) - 1.0)
        unit = Gf.Vec3d(*np.eye(3)["XYZ".index(letter)])
        for rotation, place in (
            (physics.GetLocalRot0Attr(), physics.GetLocalPos0Attr()),
            (physics.GetLocalRot1Attr(), physics.GetLocalPos1Attr()),
        ):
            # Not Gf.Rotation: it goes through the angle, of which acos loses half the digits near zero.
            turned = Gf.Quatd(rotation.Get() or Gf.Quatf(math.nan)).Transform(unit)
            scale = max(1.0, float(np.abs(origin).max()))
            away = np.subtract(place.Get() or [math.nan] * 3, origin) / scale
            worst = float(np.max([worst, np.abs(np.subtract(turned, axis)).max(), np.abs(away).max()]))
        # Frames turned against each other about the axis itself would move a hinge's zero.
        here, there = (np.array([q.GetReal(), *q.GetImaginary()]) for q in _turns(physics))
        worst = float(np.max([worst, min(np.abs(here - there).max(), np.abs(here + there).max())]))
    return at_most(
        name, worst, EXACT, prim=str(joint.GetPath()), message="axis and origin against the physics frames",
        remedy="write axis and origin through s2a, which keeps both in step; " + PREPARE_AGAIN,
    )  # fmt: skip


def mass(contents: Contents) -> Check:
    """Masses and principal moments are positive and possible: no moment is larger than the other two together."""
    problems = []
    for body in contents.bodies:
        api, path = UsdPhysics.MassAPI(body), str(body.GetPath())
        value, inertia = api.GetMassAttr().Get() or 0.0, sorted(api.GetDiagonalInertiaAttr().Get() or (0.0,) * 3)
        center = api.GetCenterOfMassAttr().Get()
        if not (math.isfinite(value) and value > 0):
            problems.append((path, f"a mass of {value:g} kg"))
        if not (np.isfinite(inertia).all() and inertia[0] > 0):
            problems.append((path, f"principal moments {np.round(inertia, 4).tolist()} kg m^2"))
        elif inertia[2] > (inertia[0] + inertia[1]) * (1.0 + 1e-5):
            problems.append((path, f"moments {np.round(inertia, 4).tolist()} that no body has (triangle inequality)"))
        if center is None or not np.isfinite(center).all():
            problems.append((path, f"the centre of mass is {center}"))
    return no_problems("mass", problems, "author mass, centre and inertia; " + PREPARE_AGAIN)


def usd(contents: Contents) -> Check:
    """Everything that usd-core itself checks."""
    problems = [(_mentioned(line), line) for line in broken_rules(contents.stage)]
    return no_problems("usd", problems, "see the rule's name in OpenUSD's documentation", "all validators of usd-core")


ROOM_RULES: tuple[Callable[[Contents], Check], ...] = (units, self_contained, bodies, mass, usd)
"""Rules about the whole room."""
PART_RULES: tuple[Callable[[Contents], Check], ...] = (
    target, root_joint, target_joint, joint_limits, joint_frames,
)  # fmt: skip
"""Rules about one articulated part, in the order in which a defect is best understood."""


def _turns(joint: UsdPhysics.Joint) -> tuple[Gf.Quatf, Gf.Quatf]:
    nothing = Gf.Quatf(math.nan)
    return joint.GetLocalRot0Attr().Get() or nothing, joint.GetLocalRot1Attr().Get() or nothing


def _unasked(name: str, needs: str) -> Check:
    return Check(name, "skipped", message=f"requires check {needs}")


def _path(prim: Usd.Prim | None) -> str:
    return str(prim.GetPath()) if prim else ROOT


def _mentioned(line: str) -> str:
    """Return the path of the first prim that a validator's message names."""
    words = (word.strip("<>'\"(),.;:") for word in line.split())
    return next((word for word in words if word.startswith(ROOT)), ROOT)


INSTALL = "pip install 's2a[simready]'"


@dataclass(frozen=True)
class FoundationConfig:
    """What is asked of SimReady.

    Attributes:
        profile: whose features are asked.
        version: of the profile.
        required: features that must pass; the others of the profile are reported.
    """

    profile: str = "Robotics-Prop"
    version: str = "4.0.0"
    required: tuple[str, ...] = ("FET_003_STANDARD", "FET_003_NEWTON", "FET_004_STANDARD", "FET_004_NEWTON")


def foundation(path: Path, config: FoundationConfig) -> list[Check]:
    """Return one check a feature of the profile; a single one that was not run where the validator is not installed."""
    if importlib.util.find_spec("simready") is None:
        text = "the package simready-validate is not installed"
        return [Check("simready", "skipped", message=text, remedy=INSTALL)]
    with _silent():
        validate = _validator()
        asked = validate.AssetValidationConfig(str(path), config.profile, config.version)
        result = validate.validate_asset(asked)
    if result is None:
        text = f"no profile {config.profile} {config.version} in the installed simready-foundation-tier-core"
        return [Check("simready", "skipped", message=text, remedy=INSTALL)]
    issues = [*result.issues, *result.soft_issues]
    features = sorted(result.features_summary.items(), key=lambda item: (item[0] not in config.required, item[0]))
    return [_check(name, summary, issues, name in config.required) for name, summary in features]


@functools.cache
def _validator() -> Any:
    """Import the validator and load the installed rules, which takes seconds."""
    import simready.validate as validate

    validate.initialize(rules_and_requirements_paths=[], features_paths=[], profiles_paths=[])
    return validate


def _check(name: str, summary: dict[str, Any], issues: list[Any], required: bool) -> Check:
    """Return the check of one feature; it names the broken rules and the first prim that breaks one."""
    title = f"simready:{name}"
    if summary["passed"]:
        return Check(title, "pass" if required else "info", 0.0, 0.0, "rules", message="passed")
    broken = f"{summary.get('failing requirements', '')}{summary.get('optional requirements', '')}"
    own = [issue for issue in issues if issue.requirement and f"'{issue.requirement.code}'" in broken]
    codes = sorted({str(issue.requirement.code).removeprefix("com.nvidia.") for issue in own})
    first = " ".join(str(own[0].message).split())[:200] if own else broken
    prim = str(getattr(own[0].at, "path", "")) if own else ""
    message = f"not passed: {', '.join(codes)}: {first}"
    remedy = "see the rule in NVIDIA's SimReady Foundation" if required else ""
    return Check(title, "fail" if required else "info", float(len(codes)), 0.0, "rules", prim, message, remedy)


@contextmanager
def _silent() -> Iterator[None]:
    """Keep the validator's log, which repeats what it returns, off the terminal."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        yield
    finally:
        logging.disable(before)
