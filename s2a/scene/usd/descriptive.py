"""The descriptive flavour: the room in words and boxes, for language models; a page of text without a single triangle.

Parts nest as they belong together. A flag that is absent is false, and a part without a motion stands still.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from s2a.core.errors import InputError
from s2a.scene.scene import Joint, Part, Scene, Vec3
from s2a.scene.upright_box import silhouette, upright_box
from s2a.scene.usd.joints import KINDS, site_point
from s2a.scene.usd.stage import ROOT, check_ids, new_stage, open_stage, read_attribute, reading, save, write_attribute

FLAVOUR = "descriptive"
# Decimals of lengths [m] and angles [rad], of unit vectors, and of yaw [deg]: a scan knows no more
MILLIMETRES, DIRECTION, DEGREES = 3, 4, 1

LEGEND = """A room, part by part: a prim inside another is a part of it. Metres, z up.
center, size: upright box around a part with all inside it; yaw: degrees its size[0] side is turned from x about z.
motion: prismatic (slides along axis), revolute (turns about axis through origin, right-handed) or free;
limits: m or rad from the pose shown; against: what it moves against. graspable: held here; grasp: where to hold.
Whatever is absent: false, fixed, not turned, unknown."""

Types = Sdf.ValueTypeNames


@dataclass(frozen=True)
class DescribedPart:
    """What the description says of a part."""

    label: str  # the annotator's name for it
    parent: str | None  # id of the part that it belongs to; None for an object
    motion: str  # "prismatic", "revolute", "free" or "fixed"
    graspable: bool  # a gripper holds the moving part here
    center: Vec3 | None  # of its upright box [m], scene coordinates; None where nothing was scanned of it
    size: Vec3 | None  # of that box [m]; the third is vertical
    yaw: float = 0.0  # how far its first side is turned from the x axis about z [rad]
    joint: Joint | None = None  # how it moves, rounded as it is described; None for what is fixed or free
    against: str | None = None  # id of the body that it moves against, or "world"; None for what has no joint
    mass: float | None = None  # [kg] if annotated, else None


def write(scene: Scene, path: Path) -> None:
    """Write the description of a scene to exactly this path, which ends in .usda.

    Raises:
        InputError: an id that cannot be a prim's name, or a path that cannot be written.
    """
    check_ids(scene)
    stage = new_stage()
    stage.GetRootLayer().documentation = LEGEND
    root = stage.GetDefaultPrim()
    write_attribute(root, "flavour", Types.String, FLAVOUR)
    write_attribute(root, "name", Types.String, scene.name)
    outlines = {part_id: silhouette(part.mesh.vertices) for part_id, part in scene.parts.items()}
    _write_box(root, list(outlines.values()))
    for part_id in scene.parts:
        prim = _write_part(stage, scene, part_id)
        _write_box(prim, [outlines[i] for i in (part_id, *scene.descendants(part_id))])
    save(stage, path)


def read(path: Path) -> dict[str, DescribedPart]:
    """Read the parts of a description by id, parents before children.

    Raises:
        InputError: no such file, not USD, or a stage of another flavour.
    """
    with reading(path):
        stage = open_stage(path)
        root = stage.GetDefaultPrim()
        flavour = read_attribute(root, "flavour", str)
        if flavour != FLAVOUR:
            raise InputError(f"{path}: flavour {flavour!r}; expected {FLAVOUR!r}: the descriptive.usda of s2a export")
        prims = [
            prim for prim in Usd.PrimRange(root) if prim != root and read_attribute(prim, "label", str) is not None
        ]
        return {prim.GetName(): _read_part(prim, root) for prim in prims}


def _read_part(prim: Usd.Prim, root: Usd.Prim) -> DescribedPart:
    parent = prim.GetParent()
    return DescribedPart(
        label=read_attribute(prim, "label", str),
        parent=None if parent == root else parent.GetName(),
        motion=read_attribute(prim, "motion", str, "fixed"),
        graspable=read_attribute(prim, "graspable", bool, False),
        center=read_attribute(prim, "center", tuple),
        size=read_attribute(prim, "size", tuple),
        yaw=math.radians(read_attribute(prim, "yaw", float, 0.0)),
        joint=described_joint(prim),
        against=read_attribute(prim, "against", str),
        mass=read_attribute(prim, "mass", float),
    )


def described_joint(prim: Usd.Prim) -> Joint | None:
    """Return the joint that a prim describes, or None."""
    kind, axis = read_attribute(prim, "motion", str), read_attribute(prim, "axis", tuple)
    if kind not in KINDS.values() or axis is None:
        return None
    # Rounded there, so no longer of unit length.
    unit = tuple(x / math.hypot(*axis) for x in axis)
    return Joint(kind, unit, read_attribute(prim, "origin", tuple), read_attribute(prim, "limits", tuple))


def prim_path(scene: Scene, part_id: str) -> str:
    """Return the path of the prim that describes a part: its ancestors, then itself."""
    return "/".join((ROOT, *reversed(scene.ancestors(part_id)), part_id))


def _write_part(stage: Usd.Stage, scene: Scene, part_id: str) -> Usd.Prim:
    part = scene.parts[part_id]
    prim = UsdGeom.Xform.Define(stage, prim_path(scene, part_id)).GetPrim()
    _describe(prim, "label", Types.String, part.label)
    if part.graspable:
        _describe(prim, "graspable", Types.Bool, True)
    if part.mass is not None:
        _describe(prim, "mass", Types.Double, round(part.mass, MILLIMETRES))
    _write_motion(prim, scene, part_id, part)
    return prim


def _write_box(prim: Usd.Prim, outlines: Sequence[np.ndarray]) -> None:
    """Describe the box around some outlines [n 3]; nothing where there is no point."""
    points = np.concatenate([np.zeros((0, 3)), *outlines])
    if not len(points):
        return
    box = upright_box(points)
    _describe(prim, "center", Types.Double3, _rounded(box.center))
    _describe(prim, "size", Types.Double3, _rounded(box.size))
    if yaw := round(math.degrees(box.yaw), DEGREES):
        _describe(prim, "yaw", Types.Double, yaw)


def _write_motion(prim: Usd.Prim, scene: Scene, part_id: str, part: Part) -> None:
    """Describe how a part moves, against what, and where to hold it; nothing for a fixed part."""
    if part.motion == "fixed":
        return
    _describe(prim, "movable", Types.Bool, True)
    _describe(prim, "motion", Types.Token, part.motion.kind if isinstance(part.motion, Joint) else part.motion)
    if not isinstance(part.motion, Joint):
        return
    _describe(prim, "against", Types.String, scene.parent_body(part_id) or "world")
    _describe(prim, "axis", Types.Double3, _rounded(part.motion.axis, DIRECTION))
    _describe(prim, "origin", Types.Double3, _rounded(part.motion.origin))
    _describe(prim, "limits", Types.Double2, _rounded(part.motion.limits))
    point = site_point(scene, part_id)
    if point is not None:
        _describe(prim, "grasp", Types.Double3, _rounded(point))


def _describe(prim: Usd.Prim, name: str, kind: Sdf.ValueTypeName, value: object) -> None:
    """Author an attribute in as few words as USD's text allows."""
    write_attribute(prim, name, kind, value, terse=True)


def _rounded(values: Sequence[float] | np.ndarray, decimals: int = MILLIMETRES) -> tuple[float, ...]:
    """Round, without negative zeros."""
    return tuple(round(float(value), decimals) + 0.0 for value in values)
