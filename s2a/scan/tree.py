"""Any scan or stage as a tree of text: parts, joints with their ranges, grasp points, sizes; bodies and colliders."""

from __future__ import annotations

import io
import math
from collections.abc import Iterable, Iterator
from pathlib import Path

from pxr import Gf, Usd, UsdGeom, UsdPhysics
from rich.console import Console
from rich.text import Text
from rich.tree import Tree

from s2a import scan
from s2a.scene.scene import Joint, Part, Scene
from s2a.scene.usd import descriptive, geometric
from s2a.scene.usd.joints import KINDS, joint_ends, read_joint, site_point
from s2a.scene.usd.stage import open_stage, read_attribute, reading


def tree(path: Path) -> str:
    """Return a scan's folder or a stage of any flavour as a tree, one line a part or prim.

    Raises:
        InputError: neither a readable scan nor a stage that s2a wrote.
    """
    if path.is_dir():
        return _print(_scene_tree(scan.read(path)))
    with reading(path):
        stage = open_stage(path)
        root = stage.GetDefaultPrim()
        geometric_one = read_attribute(root, "flavour", str) == geometric.FLAVOUR
        return _print(_scene_tree(geometric.read(path)) if geometric_one else _prim_tree(root))


def motion_text(joint: Joint) -> str:
    """Return a joint in words: "slides 0 to 400 mm along (...)", "turns 0 to 90 deg about (...) through (...)"."""
    axis = _numbers(joint.axis, 4)
    if joint.kind == "prismatic":
        lower, upper = (1000.0 * limit for limit in joint.limits)
        return f"slides {_number(lower, 1)} to {_number(upper, 1)} mm along {axis}"
    lower, upper = map(math.degrees, joint.limits)
    return f"turns {_number(lower, 1)} to {_number(upper, 1)} deg about {axis} through {_numbers(joint.origin)}"


def _scene_tree(scene: Scene) -> Tree:
    vertices = sum(len(part.mesh.vertices) for part in scene.parts.values())
    triangles = sum(len(part.mesh.faces) for part in scene.parts.values())
    counts = f"{len(scene.parts)} parts, {len(scene.movable)} jointed, {vertices:,} vertices, {triangles:,} triangles"
    root = Tree(Text(f"{scene.name}: {counts}"))
    branches: dict[str | None, Tree] = {None: root}
    for part_id, part in scene.parts.items():
        branches[part_id] = branches[part.parent].add(_line(part_id, _part_facts(scene, part_id, part)))
    return root


def _part_facts(scene: Scene, part_id: str, part: Part) -> Iterator[str]:
    """Yield the facts about a part."""
    yield repr(part.label)
    yield f"{len(part.mesh.faces):,} triangles"
    if part.mass is not None:
        yield f"{part.mass:.4g} kg"
    if part.graspable:
        yield "graspable"
    if isinstance(part.motion, Joint):
        yield motion_text(part.motion)
        point = site_point(scene, part_id)
        yield "nowhere to grasp" if point is None else f"grasp at {_numbers(point)}"
    elif part.motion == "free":
        yield "free"


def _prim_tree(root: Usd.Prim) -> Tree:
    """Return a prim and its descendants; colliders are summarized in the line of their parent."""
    whole = Tree("")
    waiting = [(root, whole)]  # no recursion: chains may be longer than a stack is deep
    while waiting:
        prim, parent = waiting.pop()
        children = prim.GetChildren()
        pieces = [child for child in children if child.HasAPI(UsdPhysics.CollisionAPI)]
        branch = parent.add(_line(prim.GetName(), [*_prim_facts(prim), *_collider_facts(pieces)]))
        waiting += [(child, branch) for child in reversed(children) if child not in pieces]
    return whole.children[0]


def _prim_facts(prim: Usd.Prim) -> Iterator[str]:
    """Yield the facts about a prim: its type, its physics, its s2a attributes."""
    if prim.GetTypeName() != "Xform":
        yield prim.GetTypeName()
    if prim.IsA(UsdGeom.Mesh):
        yield _triangles([prim])
    yield from _physics_facts(prim)
    if prim.GetAttribute("xformOp:translate"):
        yield f"at {_numbers(UsdGeom.Xformable(prim).GetLocalTransformation().ExtractTranslation())}"
    joint = _joint(prim)
    if joint is not None:
        yield motion_text(joint)
    for attribute in prim.GetAuthoredPropertiesInNamespace("s2a"):
        if joint is None or attribute.GetBaseName() not in ("motion", "movable", "axis", "origin", "limits"):
            yield f"{attribute.GetBaseName()} {_value(attribute.Get())}"


def _joint(prim: Usd.Prim) -> Joint | None:
    """Return the joint that a prim is or, in the descriptive flavour, that it describes."""
    return read_joint(prim) if prim.GetTypeName() in KINDS else descriptive.described_joint(prim)


def _physics_facts(prim: Usd.Prim) -> Iterator[str]:
    if prim.HasAPI(UsdPhysics.RigidBodyAPI):
        yield "articulation root" if prim.HasAPI(UsdPhysics.ArticulationRootAPI) else "body"
    if prim.HasAPI(UsdPhysics.MassAPI):
        yield f"{UsdPhysics.MassAPI(prim).GetMassAttr().Get():.4g} kg"
    if prim.IsA(UsdPhysics.Joint):
        yield " -> ".join(targets[0].name if targets else "world" for targets in joint_ends(prim))


def _collider_facts(pieces: list[Usd.Prim]) -> Iterator[str]:
    """Yield how convex hulls are shaped, how fine they are, and how many stand for which part."""
    if not pieces:
        return
    kinds = {UsdPhysics.MeshCollisionAPI(prim).GetApproximationAttr().Get() or prim.GetTypeName() for prim in pieces}
    yield f"{len(pieces)} {', '.join(sorted(kinds))}"
    yield _triangles(pieces)
    parts = [str(read_attribute(prim, "part", str, "?")) for prim in pieces]
    yield "for " + ", ".join(f"{part} ({parts.count(part)})" for part in dict.fromkeys(parts))


def _triangles(prims: Iterable[Usd.Prim]) -> str:
    meshes = (UsdGeom.Mesh(prim) for prim in prims if prim.IsA(UsdGeom.Mesh))
    return f"{sum(len(mesh.GetFaceVertexCountsAttr().Get() or []) for mesh in meshes):,} triangles"


def _value(value: object) -> str:
    """Return an attribute's value, numbers to the millimetre."""
    if isinstance(value, (Gf.Vec2d, Gf.Vec3d)):
        return _numbers(value)
    if isinstance(value, Gf.Quatd):
        return "xyzw " + _numbers((*value.GetImaginary(), value.GetReal()))
    return repr(value) if isinstance(value, str) else f"{value:.4g}" if isinstance(value, float) else str(value)


def _numbers(values: Iterable[float], decimals: int = 3) -> str:
    return f"({', '.join(_number(value, decimals) for value in values)})"


def _number(value: float, decimals: int) -> str:
    """Return a number without needless zeros, nor a minus before zero."""
    return f"{round(float(value), decimals) + 0.0:.10g}"


def _line(name: str, facts: Iterable[str]) -> Text:
    """Return a line; as Text, because rich takes brackets in a plain string for its markup."""
    return Text("  ".join([name, *facts]))


def _print(root: Tree) -> str:
    """Return the tree as plain text whose lines are as long as they need be."""
    out = io.StringIO()
    Console(file=out, width=10_000, color_system=None, legacy_windows=False).print(root)
    return "\n".join(line.rstrip() for line in out.getvalue().splitlines())
