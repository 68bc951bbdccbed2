"""Comparison of the stage that a script saved with the plan.

The bytes come from a process that the script may have bent to its will, so their nesting is bounded before USD parses them,
and no other file is opened: a layer is read, never a stage composed of what it refers to. USD's parser may crash all the
same; `s2a.language.sandbox.jail.Sandbox.compare` runs this module in a process of its own.
"""

import math
import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom

from s2a.core.errors import InputError
from s2a.language.sandbox.operations import PolicyViolation
from s2a.scene.scene import Vec3
from s2a.scene.usd.stage import RESERVED, ROOT

MAX_LABEL = 200
# Decimals of a position [m] and of a quaternion, and digits of a scale: no more than a model can copy
POSITION, ORIENTATION, SCALE = 5, 7, 6


@dataclass(frozen=True)
class Placement:
    """One object in the room.

    Attributes:
        part_id: what its prim will be called; new in the stage.
        label: what it is, in plain words.
        reference: path of its USD file, relative to the overlay's folder, with / between folders.
        position: of its origin, world frame [m].
        orientation: unit quaternion xyzw, object to world.
        scale: factor on its size.

    Raises:
        InputError: one of them is not so.
    """

    part_id: str
    label: str
    reference: str
    position: Vec3
    orientation: tuple[float, float, float, float]
    scale: float

    def __post_init__(self) -> None:
        if not Sdf.Path.IsValidIdentifier(self.part_id) or self.part_id in RESERVED or self.part_id.startswith("_"):
            raise InputError(f"id {self.part_id!r} cannot name a prim; use letters, digits and _, a letter first")
        folders = self.reference.split("/")
        if (
            not self.reference.isprintable()
            or set('@\\:"[]') & set(self.reference)
            or ".." in folders
            or not folders[0]
        ):
            raise InputError(f"reference {self.reference!r}: give a plain path below the overlay's folder")
        if not all(map(math.isfinite, (*self.position, *self.orientation, self.scale))) or not self.scale > 0.0:
            raise InputError(
                f"{self.part_id}: its pose {self.position}, {self.orientation}, {self.scale} is not finite"
            )
        if abs(math.hypot(*self.orientation) - 1.0) > 1e-6:
            raise InputError(f"{self.part_id}: its orientation {self.orientation} is not of unit length")
        check_label(self.label)

    def matrix(self) -> np.ndarray:
        """Return the transform from object to world, shape [4 4], for column vectors, as USD makes it of these numbers.

        USD takes the angle from w, which in a rounded quaternion of a small turn is off by more than its other numbers.
        """
        x, y, z, w = self.orientation
        turn = Gf.Matrix4d(Gf.Rotation(Gf.Quatd(w, x, y, z)), Gf.Vec3d(*self.position))
        matrix = np.array(turn).T
        matrix[:3, :3] *= self.scale
        return matrix


def check_label(label: str) -> None:
    """Raise an InputError unless a label can stand in a stage, a script and a line of a terminal."""
    if not label.strip() or not label.isprintable() or len(label) > MAX_LABEL:
        given = f"{label[:40]!r}..." if len(label) > MAX_LABEL else repr(label)
        raise InputError(
            f"label {given} is empty, not printable or longer than {MAX_LABEL} letters; name the object in plain words"
        )


TAXONOMY = "class"  # Of the semantic label: `semantics:labels:class`
# A prim's `kind` that says nothing of consequence; it may be left out
KINDS = ("component", "subcomponent", "prop", "model")
NESTING = 32  # Brackets within brackets; USD's parser calls itself for each, and a stage of ours has 6
# Texts, files and comments of USD's text, whose brackets are none, and the brackets
TOKENS = re.compile(
    rb""""{3}(?:[^\\]|\\.)*?"{3}|'{3}(?:[^\\]|\\.)*?'{3}|"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)*"""
    rb"""'|@@@.*?@@@|@[^@\n]*@|\#[^\n]*|//[^\n]*|/\*.*?\*/|[][(){}]""",
    re.DOTALL,
)
TOLERANCE = 1e-6  # Tolerance of the pose: metres, and fractions of the scale
VECTORS, SCALARS = ("float3", "double3", "half3"), ("float", "double", "half")
# Transform operations with the types that USD gives them
OPERATIONS = {
    r"xformOp:(translate|scale|rotate(XYZ|XZY|YXZ|YZX|ZXY|ZYX))(:\w+)?": VECTORS,
    r"xformOp:rotate[XYZ](:\w+)?": SCALARS,
    r"xformOp:orient(:\w+)?": ("quatf", "quatd", "quath"),
    r"xformOp:transform(:\w+)?": ("matrix4d",),
}
PRIM_FIELDS = ("specifier", "typeName", "references", "apiSchemas", "kind")
ATTRIBUTE_FIELDS = ("custom", "typeName", "variability", "default")


def compare(saved: bytes, geometry_free_text: str, plan: Placement) -> Sdf.Layer:
    """Return a layer that holds the planned prim as the script wrote it.

    Raises:
        PolicyViolation: something is missing, or anything else differs from the given stage; the message names the first.
    """
    try:
        return _compared(saved, geometry_free_text, plan)
    except PolicyViolation:
        raise
    except Exception as error:  # of USD, NumPy or Python: whatever a value of an unexpected type makes them raise
        raise _violation(
            f"the saved stage holds a value that cannot be compared ({type(error).__name__}): write what is planned, no more"
        ) from error


def _compared(saved: bytes, geometry_free_text: str, plan: Placement) -> Sdf.Layer:
    """Compare; other errors than violations may come of values that nobody expects."""
    before, after = _parse(geometry_free_text.encode()), _parse(saved)
    path = Sdf.Path(f"{ROOT}/{plan.part_id}")
    if not after.GetPrimAtPath(path):
        raise _violation(f"{path} is missing: define an Xform there and save the stage")
    _refuse_changes(_opinions(before), _opinions(after), path)
    _check_prim(after.GetPrimAtPath(path), plan)
    return _alone(after, path)


def _parse(text: bytes) -> Sdf.Layer:
    """Read USD's text into a layer of its own, without opening anything that it names."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    try:
        if not text.startswith(b"#usda 1.0\n") or not _flat(text) or not layer.ImportFromString(text.decode()):
            raise _violation("the saved stage is not USD text as USD writes it: save it, do not rewrite it")
    except (UnicodeDecodeError, Tf.ErrorException) as error:
        raise _violation("the saved stage cannot be read") from error
    return layer


def _flat(text: bytes) -> bool:
    """Return True if brackets match and do not nest too deeply."""
    depth = 0
    for token in TOKENS.findall(text):
        depth += (token in b"([{") - (token in b")]}")
        if not 0 <= depth <= NESTING:
            return False
    return True


def _opinions(layer: Sdf.Layer) -> dict[tuple[Sdf.Path, str], Any]:
    """Return every value in a layer by the path and the field it stands at."""
    opinions: dict[tuple[Sdf.Path, str], Any] = {}

    def note(path: Sdf.Path) -> None:
        spec = layer.GetObjectAtPath(path)
        for field in spec.ListInfoKeys():
            opinions[path, field] = _value(spec, field)
        opinions[path, "kind of spec"] = type(spec).__name__

    layer.Traverse(Sdf.Path.absoluteRootPath, note)
    return opinions


def _value(spec: Sdf.Spec, field: str) -> Any:
    """Return what a field says; of those that Python cannot read (offsets of sublayers), that it is there."""
    try:
        return spec.GetInfo(field)
    except TypeError:
        return "unreadable"


def _refuse_changes(before: dict, after: dict, path: Sdf.Path) -> None:
    """Raise if anything outside `path` is not as it was."""
    for key in sorted({**before, **after}):
        if key[0].HasPrefix(path):
            continue
        if key not in before or key not in after or before[key] != after[key]:
            change = "adds" if key not in before else "removes" if key not in after else "changes"
            raise _violation(f"it {change} {key[1]!r} at {key[0]}; only {path} may be added, and nothing else changed")


def _check_prim(prim: Sdf.PrimSpec, plan: Placement) -> None:
    """Raise if a prim is anything but an Xform with the planned reference, pose, label and semantics."""
    _refuse_fields(prim, PRIM_FIELDS)
    if prim.nameChildren or prim.relationships or prim.variantSets:
        raise _violation(
            f"{prim.path} may have no children, relationships or variants: the reference brings its geometry"
        )
    if prim.specifier != Sdf.SpecifierDef or prim.typeName != "Xform":
        raise _violation(f"{prim.path} is {prim.specifier.displayName} {prim.typeName!r}; define an Xform")
    if prim.kind and prim.kind not in KINDS:
        raise _violation(f"{prim.path} has kind {prim.kind!r}; leave it out, or give {', '.join(KINDS)}")
    _check_lists(prim, plan)
    operations = _check_attributes(prim, plan)
    _check_pose(prim, operations, plan)


def _check_lists(prim: Sdf.PrimSpec, plan: Placement) -> None:
    """Raise unless the one reference is the planned one, and the one applied schema the semantic label."""
    items = _items(prim.GetInfo("references"))
    if items != [Sdf.Reference(plan.reference)]:
        given = ", ".join(f"{item.assetPath}{item.primPath}" for item in items) or "nothing"
        raise _violation(
            f"{prim.path} references {given}; expected {plan.reference} alone, its default prim, without offset"
        )
    if _items(prim.GetInfo("apiSchemas")) != [f"SemanticsLabelsAPI:{TAXONOMY}"]:
        raise _violation(f"{prim.path}: apply UsdSemantics.LabelsAPI with {TAXONOMY!r}, and no other schema")


def _items(listed: Any) -> list:
    """Return what a list edit adds; nothing if it also deletes or reorders."""
    if listed is None or listed.deletedItems or listed.orderedItems:
        return []
    return [*listed.explicitItems, *listed.prependedItems, *listed.addedItems, *listed.appendedItems]


def _check_attributes(prim: Sdf.PrimSpec, plan: Placement) -> list[str]:
    """Raise unless the planned attributes are there with their values; return the names of the pose's operations."""
    expected = {"s2a:partId": plan.part_id, "s2a:label": plan.label, f"semantics:labels:{TAXONOMY}": [plan.label]}
    for attribute in prim.attributes:
        _refuse_fields(attribute, ATTRIBUTE_FIELDS)
    values = {attribute.name: attribute.default for attribute in prim.attributes}
    types = {attribute.name: str(attribute.typeName) for attribute in prim.attributes}
    for name, value in expected.items():
        given = values.pop(name, None)
        given = list(given) if isinstance(value, list) and types.get(name) == "token[]" and given is not None else given
        if type(given) is not type(value) or given != value:
            raise _violation(f"{prim.path}.{name} is {str(given)[:80]!r}; expected {value!r}")
    if types.get("xformOpOrder", "token[]") != "token[]":
        raise _violation(f"{prim.path}.xformOpOrder is {types['xformOpOrder']}; expected token[]")
    order = list(values.pop("xformOpOrder", None) or [])
    if others := sorted(name for name in values if not _operation(name, types[name])):
        raise _violation(f"{prim.path} has {types[others[0]]} {others[0]!r}, which is not planned")
    if len(order) > 3 or len(set(order)) != len(order) or set(order) != set(values):
        raise _violation(f"{prim.path}: xformOpOrder is {', '.join(order)[:80]}; expected translate, orient, scale")
    return order


def _operation(name: str, kind: str) -> bool:
    """Return True for an attribute that USD reads as a transform operation."""
    return any(re.fullmatch(pattern, name) and kind in kinds for pattern, kinds in OPERATIONS.items())


def _refuse_fields(spec: Sdf.Spec, harmless: tuple[str, ...]) -> None:
    """Raise if a prim or an attribute says anything that is not known to be harmless."""
    if others := sorted(set(spec.ListInfoKeys()) - set(harmless)):
        raise _violation(f"{spec.path} has {others[0]!r}, which is not planned; possible: {', '.join(harmless)}")


def _check_pose(prim: Sdf.PrimSpec, operations: list[str], plan: Placement) -> None:
    """Raise if the transform is not the planned one."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    bare = Sdf.CreatePrimInLayer(layer, "/object")
    bare.specifier, bare.typeName = Sdf.SpecifierDef, "Xform"
    for name in (*operations, "xformOpOrder"):
        if name in prim.attributes:
            Sdf.CopySpec(prim.layer, prim.path.AppendProperty(name), layer, bare.path.AppendProperty(name))
    stage = Usd.Stage.Open(layer)
    given = np.array(UsdGeom.Xformable(stage.GetPrimAtPath("/object")).GetLocalTransformation()).T
    off = np.abs(given - plan.matrix())
    off[:3, :3] /= plan.scale
    if not off.max() <= TOLERANCE:
        what = "position" if not off[:3, 3].max() <= TOLERANCE else "orientation or scale"
        raise _violation(
            f"{prim.path}: its {what} is off by {off.max():.3g}; planned are translate {plan.position}, "
            f"orient {plan.orientation} (x y z w), scale {plan.scale}, in this order"
        )


def _alone(layer: Sdf.Layer, path: Sdf.Path) -> Sdf.Layer:
    """Return a layer with a copy of one prim, its parents without opinions."""
    alone = Sdf.Layer.CreateAnonymous(".usda")
    Sdf.CreatePrimInLayer(alone, path.GetParentPath())
    Sdf.CopySpec(layer, path, alone, path)
    return alone


def _violation(reason: str) -> PolicyViolation:
    return PolicyViolation("comparison", reason)
