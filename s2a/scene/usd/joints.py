"""Joints, bodies and grasp points in UsdPhysics and Newton's schemas, with the exact values as attributes.

Bodies stand at the identity, so a joint's frame is the same in both bodies: its origin, turned so that X is the axis.
Where an editor moved a body afterwards, the joint goes with the body that it moves, as that one's surface does.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

from s2a.core.errors import InputError
from s2a.scene.scene import Joint, Scene
from s2a.scene.usd.stage import ROOT, placement, read_attribute, where, write_attribute

Types = Sdf.ValueTypeNames
# Fields that are numbers, and the attributes that hold them
NUMBERS = {"angle": "angle", "shift": "shift", "zero": "zero", "angle_sigma": "angleSigma", "shift_sigma": "shiftSigma"}


@dataclass(frozen=True)
class Refinement:
    """How far a joint was moved from its annotation by what the scan shows."""

    annotated: Joint  # the joint as it was annotated
    angle: float  # by which its axis was turned [rad]
    shift: float  # by which its line was moved, at the annotated origin [m]; 0 for a slide, which has no place
    # the coordinate at which the part is closed, where it was scanned ajar [m] or [rad]; 0: as it was annotated
    zero: float
    angle_sigma: float  # standard deviation of the axis, of the worse of its two directions [rad]
    shift_sigma: float  # the same of the line [m]; 0 for a slide
    unknown: tuple[str, ...] = ()  # what the scan does not tell, in words: there the annotation stays


def write_refinement(prim: Usd.Prim, refinement: Refinement) -> None:
    """Author what was done to a joint on the prim of its part."""
    annotated = refinement.annotated
    for name, kind in (("axis", Types.Double3), ("origin", Types.Double3), ("limits", Types.Double2)):
        write_attribute(prim, f"annotated:{name}", kind, getattr(annotated, name))
    for field, name in NUMBERS.items():
        write_attribute(prim, f"refined:{name}", Types.Double, getattr(refinement, field))
    write_attribute(prim, "refined:unknown", Types.StringArray, list(refinement.unknown))


def read_refinement(prim: Usd.Prim, joint: Joint) -> Refinement | None:
    """Return what was done to a joint, or None where it is as annotated."""
    given = {name: read_attribute(prim, f"annotated:{name}", tuple) for name in ("axis", "origin", "limits")}
    numbers = {field: read_attribute(prim, f"refined:{name}", float) for field, name in NUMBERS.items()}
    if None in {**given, **numbers}.values():
        return None
    unknown = tuple(prim.GetAttribute("s2a:refined:unknown").Get() or ())
    return Refinement(Joint(joint.kind, **given), **numbers, unknown=unknown)


SETTINGS = ("damping", "stiffness")  # What the simulation's settings say where a joint does not
SOFT_CLOSE = ("force", "damping", "reach")


@dataclass(frozen=True)
class SoftClose:
    """A mechanism that draws a part in before it is shut, and damps it there as it closes; per unit of its coordinate."""

    force: float  # that draws it in [N] or [N m]
    damping: float  # while it closes [N s/m] or [N m s/rad]
    reach: float  # the coordinate from which on it acts, as a distance from zero [m] or [rad]


@dataclass(frozen=True)
class Resistance:
    """What was identified of a joint beside its dry friction in motion, per unit of its coordinate."""

    # [N s/m] or [N m s/rad]; None: what the simulation's settings say, as with `stiffness`
    damping: float | None = None
    stiffness: float | None = None  # of the spring that draws the part to its scanned pose [N/m] or [N m/rad]
    breakaway: float = 0.0  # how much more dry friction holds it at rest [N] or [N m]
    soft_close: SoftClose | None = None  # None: it has none


def write_resistance(joint: Usd.Prim, resistance: Resistance) -> None:
    """Write on a joint what resists, and nothing of what it does not say."""
    kind = Sdf.ValueTypeNames.Double
    for name in SETTINGS:
        if (value := getattr(resistance, name)) is not None:
            write_attribute(joint, name, kind, value)
    if resistance.breakaway:
        write_attribute(joint, "breakaway", kind, resistance.breakaway)
    for name in SOFT_CLOSE if resistance.soft_close else ():
        write_attribute(joint, f"softClose:{name}", kind, getattr(resistance.soft_close, name))


def read_resistance(joint: Usd.Prim) -> Resistance | None:
    """Return what was written on a joint; None where nothing was.

    Raises:
        InputError: a number below 0 or infinite, or a soft close of which one is missing.
    """
    names = (*SETTINGS, "breakaway", *(f"softClose:{name}" for name in SOFT_CLOSE))
    values = {name: read_attribute(joint, name, float) for name in names}
    for name, value in values.items():
        if value is not None and not (0.0 <= value < math.inf):
            raise InputError(f"{where(joint)}: s2a:{name} is {value:g}; expected 0 or more: identify the joint again")
    if set(values.values()) == {None}:
        return None
    closes = [values[name] for name in names[3:]]
    if None in closes and set(closes) != {None}:
        missing = names[3 + closes.index(None)]
        raise InputError(f"{where(joint)} has a soft close without s2a:{missing}; identify the joint again")
    soft = None if None in closes else SoftClose(*closes)
    return Resistance(values["damping"], values["stiffness"], values["breakaway"] or 0.0, soft)


SITE_RADIUS = 0.01  # [m]; what a grasp point looks like, without effect
# Largest departure of a matrix from a rotation: single precision and rounded digits, but no scale that is meant
RIGID = 1e-4

EPSILON = 1e-14  # An axis this close to -X (by its cosine) is -X itself

KINDS = {"PhysicsPrismaticJoint": "prismatic", "PhysicsRevoluteJoint": "revolute"}


def frame(axis: Sequence[float]) -> Gf.Quatf:
    """Return the shortest rotation that takes X to a unit axis [3]; the turned X is the axis within 1e-6.

    Not `Gf.Rotation(x, axis)`: that takes directions less than 4.5e-4 rad apart for the same.
    """
    x, y, z = axis
    if x < -1.0 + EPSILON:  # half a turn, about z as well as about any other axis across X
        return Gf.Quatf(0.0, 0.0, 0.0, 1.0)
    # (1 + cos, sin * turning axis) is the half-angle quaternion before normalization; sin * turning axis = X x axis.
    w, i, j, k = np.array([1.0 + x, 0.0, -z, y]) / math.hypot(1.0 + x, y, z)
    return Gf.Quatf(w, i, j, k)


def write_joint(stage: Usd.Stage, path: str, joint: Joint, parent: str, child: str) -> UsdPhysics.Joint:
    """Define a PrismaticJoint or RevoluteJoint between two bodies whose points lie in scene coordinates.

    `joint`: axis, origin and limits; kept as doubles beside the physics frames, which are float32.
    """
    schema = UsdPhysics.PrismaticJoint if joint.kind == "prismatic" else UsdPhysics.RevoluteJoint
    prim = schema.Define(stage, path)
    _connect(prim, parent, child, Gf.Vec3f(*joint.origin), frame(joint.axis))
    # UsdPhysics turns by degrees.
    lower, upper = joint.limits if joint.kind == "prismatic" else map(math.degrees, joint.limits)
    prim.CreateAxisAttr(UsdPhysics.Tokens.x)
    prim.CreateLowerLimitAttr(lower)
    prim.CreateUpperLimitAttr(upper)
    write_attribute(prim.GetPrim(), "axis", Types.Double3, joint.axis)
    write_attribute(prim.GetPrim(), "origin", Types.Double3, joint.origin)
    write_attribute(prim.GetPrim(), "limits", Types.Double2, joint.limits)
    return prim


def write_fixed_joint(stage: Usd.Stage, path: str, child: str) -> UsdPhysics.FixedJoint:
    """Define a FixedJoint that holds a body where it is in the room.

    It names the room's root, which is no body and so stands for a place: without it the joint would pull a room that another
    stage puts elsewhere back to the world's origin.
    """
    prim = UsdPhysics.FixedJoint.Define(stage, path)
    _connect(prim, ROOT, child, Gf.Vec3f(0.0), Gf.Quatf(1.0))
    return prim


def is_body(prim: Usd.Prim) -> bool:
    """Return True for a rigid body: a prim to which physics was applied as one, wherever it is in the stage."""
    return bool(prim) and prim.HasAPI(UsdPhysics.RigidBodyAPI)


def joint_ends(prim: Usd.Prim) -> tuple[list[Sdf.Path], list[Sdf.Path]]:
    """Return the paths of the bodies that a joint hangs on (none: the room itself) and that it moves."""
    joint = UsdPhysics.Joint(prim)
    above, moved = joint.GetBody0Rel().GetTargets(), joint.GetBody1Rel().GetTargets()
    return [path for path in above if path != ROOT], list(moved)


def read_joint(prim: Usd.Prim) -> Joint:
    """Read a joint that `write_joint` wrote, exactly.

    Raises:
        InputError: another type of joint, or axis, origin or limits missing or wrong.
    """
    kind = KINDS.get(prim.GetTypeName())
    if kind is None:
        raise InputError(
            f"{where(prim)} is a {prim.GetTypeName() or 'prim without type'}; possible: {', '.join(KINDS)}"
        )
    values = {name: read_attribute(prim, name, tuple) for name in ("axis", "origin", "limits")}
    if missing := [name for name, value in values.items() if value is None]:
        raise InputError(f"{where(prim)} has no s2a:{missing[0]}; export the scan again")
    try:
        return Joint(kind, **values)  # type: ignore[arg-type]
    except ValueError as error:
        raise InputError(f"{where(prim)}: {error}; export the scan again") from error


def placed(joint: Joint, body: Usd.Prim) -> Joint:
    """Return a joint as the transform of the body that it moves takes it along; the same joint where there is none.

    The limits stay: they count from the pose in which the body stands, wherever that is.

    Raises:
        InputError: the transform is no rotation and translation: ranges and masses would no longer be those of the surface.
    """
    matrix = placement(body)
    if matrix is None:
        return joint
    turn, shift = matrix[:3, :3], matrix[3, :3]
    if not (np.isfinite(matrix).all() and np.abs(turn @ turn.T - np.eye(3)).max() <= RIGID and np.linalg.det(turn) > 0):
        raise InputError(
            f"{where(body)}: a transform of it or of what is above it scales, shears or mirrors, which its joint cannot "
            "follow; move and turn it only, and scale the scan before s2a export"
        )
    axis = np.array(joint.axis) @ turn
    return replace(joint, axis=tuple(axis / np.linalg.norm(axis)), origin=tuple(joint.origin @ turn + shift))


def write_body(stage: Usd.Stage, path: str, *, root: bool = False) -> UsdGeom.Xform:
    """Define a rigid body."""
    body = UsdGeom.Xform.Define(stage, path)
    UsdPhysics.RigidBodyAPI.Apply(body.GetPrim())
    if root:
        UsdPhysics.ArticulationRootAPI.Apply(body.GetPrim())
    return body


def site_point(scene: Scene, part_id: str) -> np.ndarray | None:
    """Return the grasp point of an articulated part [3] (scene coordinates, m); None if no surface is annotated there."""
    if not any(scene.parts[i].mesh.face_areas.any() for i in scene.handle_parts(part_id)):
        return None
    return scene.grasp_point(part_id)


def write_site(stage: Usd.Stage, path: str, point: np.ndarray) -> UsdGeom.Sphere:
    """Define a grasp point [3] (scene coordinates, m): a Sphere without collision that Newton reads as a site."""
    site = UsdGeom.Sphere.Define(stage, path)
    site.CreateRadiusAttr(SITE_RADIUS)
    site.CreateExtentAttr([Gf.Vec3f(-SITE_RADIUS), Gf.Vec3f(SITE_RADIUS)])
    site.CreatePurposeAttr(UsdGeom.Tokens.guide)
    site.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*map(float, point)))
    site.GetPrim().ApplyAPI("NewtonSiteAPI")
    return site


def _connect(joint: UsdPhysics.Joint, parent: str, child: str, origin: Gf.Vec3f, turn: Gf.Quatf) -> None:
    """Author the two ends of a joint and its frame, the same in both."""
    joint.CreateBody0Rel().SetTargets([parent])
    joint.CreateBody1Rel().SetTargets([child])
    joint.CreateLocalPos0Attr(origin)
    joint.CreateLocalPos1Attr(origin)
    joint.CreateLocalRot0Attr(turn)
    joint.CreateLocalRot1Attr(turn)
