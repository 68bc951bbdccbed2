"""Portability of a sim.usd: its physics as another simulator reads it, and NVIDIA's SimReady rules."""

import functools
import importlib.util
import logging
import math
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom, UsdPhysics, UsdShade

from s2a.certify.contents import STRUCTURE, Contents, ShapeConfig
from s2a.core.check import Check, no_problems
from s2a.core.errors import InputError
from s2a.scene.articulation import open_limit
from s2a.scene.usd.joints import joint_ends, read_joint
from s2a.scene.usd.sim_scene import PREPARE_AGAIN
from s2a.scene.usd.stage import world_points

STANDARD_GRAVITY = (9.78, 9.84)  # [m/s^2] On the Earth's surface, from the equator to the poles
# Coulomb coefficients of dry household materials on a gripper's rubber, from lacquer to rubber on rubber
FRICTION = (0.2, 1.5)
# [kg/m^3] Mass by the volume of a body's bounding box: from a paper lamp to a solid block of stone
DENSITY = (3.0, 3000.0)
DRY_FRICTION = 30.0  # [N] or [N m] Largest Coulomb friction of a joint: a hand opens furniture with less
NO_LIMIT = 1e30


@STRUCTURE.check("room", needed_for="nothing")
def gravity(contents: Contents, config: ShapeConfig) -> Check:
    """Gravity is the Earth's."""
    problems = []
    for prim in contents.stage.Traverse():
        if prim.IsA(UsdPhysics.Scene):
            magnitude = UsdPhysics.Scene(prim).GetGravityMagnitudeAttr().Get()
            earth = magnitude is not None and (magnitude < 0 or STANDARD_GRAVITY[0] <= magnitude <= STANDARD_GRAVITY[1])
            if not earth:  # a negative one is UsdPhysics' word for the Earth's
                problems.append((str(prim.GetPath()), f"gravity is {magnitude} m/s^2, expected 9.81"))
    return no_problems("gravity", problems, PREPARE_AGAIN, "9.81 m/s^2")


@STRUCTURE.check("room", needed_for="nothing")
def at_rest(contents: Contents, config: ShapeConfig) -> Check:
    """Bodies and joints begin at rest, at the scanned pose."""
    problems = []
    for body in contents.bodies:
        api = UsdPhysics.RigidBodyAPI(body)
        for name, value in (("velocity", api.GetVelocityAttr().Get()), ("turn", api.GetAngularVelocityAttr().Get())):
            if value is not None and not np.linalg.norm(value) == 0.0:
                problems.append((str(body.GetPath()), f"begins with a {name} of {np.linalg.norm(value):g}"))
    for joint in contents.joints:
        for attribute in joint.GetAttributes():
            state = attribute.GetName().startswith("state:") and attribute.Get()
            if state:
                problems.append((str(joint.GetPath()), f"begins with {attribute.GetName()} of {state:g}"))
    return no_problems("at_rest", problems, "remove the initial velocities; " + PREPARE_AGAIN)


@STRUCTURE.check("room", needed_for="nothing")
def passive_joints(contents: Contents, config: ShapeConfig) -> Check:
    """Nothing drives a joint of furniture, and nothing breaks or leaves it."""
    problems = []
    for joint in contents.joints:
        path, physics = str(joint.GetPath()), UsdPhysics.Joint(joint)
        drives = [name for name in joint.GetAppliedSchemas() if name.startswith("PhysicsDriveAPI")]
        problems += [(path, f"{name} drives it") for name in drives]
        for name, value in (
            ("breakForce", physics.GetBreakForceAttr().Get()),
            ("breakTorque", physics.GetBreakTorqueAttr().Get()),
        ):
            if value is not None and value < NO_LIMIT:
                problems.append((path, f"its {name} is {value:g}: it would come off"))
        if physics.GetExcludeFromArticulationAttr().Get():
            problems.append((path, "it is excluded from the articulation"))
        for name, bound in (("newton:friction", DRY_FRICTION), ("newton:armature", 1.0)):
            value = joint.GetAttribute(name).Get() if joint.HasAttribute(name) else None
            if value is not None and not 0.0 <= value <= bound:
                problems.append((path, f"its {name} is {value:g}, possible: 0 to {bound:g}"))
    return no_problems("passive_joints", problems, "remove drives and break forces; " + PREPARE_AGAIN)


@STRUCTURE.check("room", needed_for="nothing")
def collision_filters(contents: Contents, config: ShapeConfig) -> Check:
    """Nothing is kept from colliding but what prepare filters: bodies whose colliders overlap on the path of one of them."""
    problems = []
    bodies = {body.GetPath() for body in contents.bodies}
    for prim in contents.stage.Traverse():
        path = str(prim.GetPath())
        if prim.IsA(UsdPhysics.CollisionGroup):
            problems.append((path, "a collision group: a simulator would not let its members collide"))
        if prim.HasAPI(UsdPhysics.FilteredPairsAPI):
            others = UsdPhysics.FilteredPairsAPI(prim).GetFilteredPairsRel().GetTargets()
            noted = " ".join(prim.GetAttribute("s2a:notes").Get() or [])
            for other in others:
                if other not in bodies or prim.GetPath() not in bodies:
                    problems.append((path, f"contact with {other} is filtered, which is no body"))
                elif not _explained(other.name, noted):
                    problems.append((path, f"contact with {other.name} is filtered, and no overlap is noted"))
                elif not _near(contents, prim, contents.stage.GetPrimAtPath(other)):
                    problems.append((path, f"contact with {other.name} is filtered, and the two are apart"))
    return no_problems("collision_filters", problems, "remove groups and filters; " + PREPARE_AGAIN)


@STRUCTURE.check("room", needed_for="nothing")
def contact_material(contents: Contents, config: ShapeConfig) -> Check:
    """Every collider has a physics material with the friction of household things, and does not bounce."""
    problems = []
    for prim in contents.colliders:
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("physics")
        path = str(prim.GetPath())
        if not material or not material.GetPrim().HasAPI(UsdPhysics.MaterialAPI):
            problems.append((path, "no physics material is bound to it"))
            continue
        api = UsdPhysics.MaterialAPI(material.GetPrim())
        values = [api.GetStaticFrictionAttr().Get(), api.GetDynamicFrictionAttr().Get()]
        if any(value is None or not FRICTION[0] <= value <= FRICTION[1] for value in values):
            text = f"friction {values[0]} (static), {values[1]} (dynamic), possible: {FRICTION[0]} to {FRICTION[1]}"
            problems.append((str(material.GetPath()), text))
        if not 0.0 <= (api.GetRestitutionAttr().Get() or 0.0) <= 0.5:
            problems.append(
                (str(material.GetPath()), f"restitution {api.GetRestitutionAttr().Get():g}, possible: 0 to 0.5")
            )
    return no_problems("contact_material", problems, "bind a physics material to every collider; " + PREPARE_AGAIN)


@STRUCTURE.check("room", needed_for="nothing")
def mass_distribution(contents: Contents, config: ShapeConfig) -> Check:
    """Mass, centre and inertia of all that moves are of a body of this size; of what is fixed to the world they do nothing."""
    problems = []
    held = {
        path
        for j in contents.joints
        if j.IsA(UsdPhysics.FixedJoint) and not joint_ends(j)[0]
        for path in joint_ends(j)[1]
    }
    for body in (body for body in contents.bodies if body.GetPath() not in held):
        low, high = _bounds(contents, body)
        api, path = UsdPhysics.MassAPI(body), str(body.GetPath())
        mass, center = api.GetMassAttr().Get() or 0.0, api.GetCenterOfMassAttr().Get()
        size = high - low
        if not np.isfinite(size).all() or center is None or not np.isfinite(center).all() or not mass > 0.0:
            continue  # other rules name these
        density = mass / float(np.prod(np.maximum(size, 0.02)))
        if not DENSITY[0] <= density <= DENSITY[1]:
            text = f"{mass:g} kg in {' x '.join(f'{1000 * x:.0f}' for x in size)} mm: {density:.2g} kg/m^3"
            problems.append((path, f"{text}, possible: {DENSITY[0]:g} to {DENSITY[1]:g}"))
        matrix = np.array(UsdGeom.Xformable(body).ComputeLocalToWorldTransform(Usd.TimeCode.Default()))
        at = np.array(center) @ matrix[:3, :3] + matrix[3, :3]
        behind = _behind(contents, path)
        lowest, highest = low + np.minimum(behind, 0.0), high + np.maximum(behind, 0.0)
        away = float(np.linalg.norm(np.maximum(np.maximum(lowest - at, at - highest), 0.0)))
        if away > 0.02:
            problems.append((path, f"its centre of mass lies {away:.2f} m outside of it"))
        gyration = math.sqrt(max(api.GetDiagonalInertiaAttr().Get() or (0.0,)) / mass)
        if gyration > np.linalg.norm(size) / 2 + 0.02:
            problems.append(
                (path, f"its radius of gyration is {gyration:.2g} m, half its diagonal {np.linalg.norm(size) / 2:.2g}")
            )
    return no_problems("mass_distribution", problems, "let prepare estimate mass and inertia; " + PREPARE_AGAIN)


def _explained(body: str, notes: str) -> bool:
    return body in notes.replace(":", " ").replace(",", " ").split()


def _near(contents: Contents, first: Usd.Prim, second: Usd.Prim) -> bool:
    """Return whether the second body lies within the first one's diagonal of it, which its joint cannot move it beyond."""
    (low, high), (other_low, other_high) = _bounds(contents, first), _bounds(contents, second)
    gap = np.maximum(np.maximum(low - other_high, other_low - high), 0.0)
    return float(np.linalg.norm(gap)) <= float(np.linalg.norm(high - low))


def _behind(contents: Contents, path: str) -> np.ndarray:
    """Return how far a slide reaches behind its front [m], shape [3]: as deep as it slides; its box has no colliders."""
    for prim in contents.joints:
        if prim.IsA(UsdPhysics.PrismaticJoint) and path in map(str, joint_ends(prim)[1]):
            with suppress(InputError):  # other rules name a joint that cannot be read
                joint = read_joint(prim)
                return -open_limit(joint) * np.array(joint.axis)
    return np.zeros(3)


def _bounds(contents: Contents, body: Usd.Prim) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of the box around a body's colliders [m], scene coordinates; NaN if it has none."""
    clouds = [world_points(prim) for prim in contents.colliders_of(body)]
    clouds = [each for each in clouds if len(each)]
    if not clouds:
        return np.full(3, np.nan), np.full(3, np.nan)
    whole = np.concatenate(clouds)
    return whole.min(axis=0), whole.max(axis=0)


INSTALL = "pip install 's2a[simready]'"


@dataclass(frozen=True)
class FoundationConfig:
    """What is asked of SimReady."""

    profile: str = "Robotics-Prop"  # whose features are asked
    version: str = "4.0.0"  # of the profile
    # features that must pass; the others of the profile are reported
    required: tuple[str, ...] = ("FET_003_STANDARD", "FET_003_NEWTON", "FET_004_STANDARD", "FET_004_NEWTON")


def foundation(path: Path, config: FoundationConfig) -> list[Check]:
    """Return one check a feature of the profile; a single one that was not run where the validator is not installed."""
    if importlib.util.find_spec("simready") is None:
        text = "the package simready-validate is not installed"
        return [Check("simready", "skipped", message=text, remedy=INSTALL)]
    with _silent():
        validate = _validator()
        request = validate.AssetValidationConfig(str(path), config.profile, config.version)
        result = validate.validate_asset(request)
    if result is None:
        text = f"no profile {config.profile} {config.version} in the installed simready-foundation-tier-core"
        return [Check("simready", "skipped", message=text, remedy=INSTALL)]
    issues = [*result.issues, *result.soft_issues]
    features = sorted(result.features_summary.items(), key=lambda item: (item[0] not in config.required, item[0]))
    return [_check(name, summary, issues, name in config.required) for name, summary in features]


# Validators of others, run where they are installed: what they are given before the file, and the formats they read
PROGRAMS = {
    "simcheck": (("check", "-q", "--no-config", "--format", "json"), ("URDF", "MJCF")),
    "mjcf-doctor": (("check", "-q", "--json"), ("MJCF",)),
}
PATIENCE = 300.0  # [s] For one of them


def opinions(path: Path, kind: str) -> list[Check]:
    """Return what validators of others find in a URDF, MJCF or USD, as notes: their bounds are their own."""
    if kind == "USD":
        installed = importlib.util.find_spec("simready") is not None
        return [replace(each, status="info") for each in foundation(path, FoundationConfig())] if installed else []
    places = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    checks = []
    for name, (arguments, kinds) in PROGRAMS.items():
        program = shutil.which(name, path=places)
        if program is None or kind not in kinds:
            continue
        try:
            command = [program, *arguments, str(path)]
            done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
        except (OSError, subprocess.TimeoutExpired) as error:
            checks.append(Check(name, "skipped", message=" ".join(str(error).split())[:200]))
            continue
        count = len(re.findall(r'"(?:severity|level)": *"error"', done.stdout, re.I))
        words = f"{count} errors, exit code {done.returncode}: {' '.join(command[1:-1])}"
        checks.append(Check(name, "info", float(count), None, "errors", message=words))
    return checks


@functools.cache
def _validator() -> Any:
    """Import the validator and load the installed rules, which takes seconds."""
    import simready.validate as validate  # of the extra "simready", which is rarely there

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
