"""Rooms from any file that holds one: what is seen of them, and the same as a tree of text."""

import io
import math
import re
import textwrap
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from pxr import Gf, Usd, UsdGeom, UsdPhysics
from rich.console import Console
from rich.text import Text
from rich.tree import Tree

from s2a import scan
from s2a.core.errors import InputError
from s2a.scan.folder import mesh_remedy
from s2a.scene import artefacts
from s2a.scene.artefacts import Artefact
from s2a.scene.scene import Joint, Mesh, Part, Scene
from s2a.scene.usd import descriptive, geometric, sim_stage
from s2a.scene.usd.descriptive import DescribedPart
from s2a.scene.usd.joints import KINDS, is_body, joint_ends, read_joint, site_point
from s2a.scene.usd.sim_scene import SimRoom, in_scene
from s2a.scene.usd.stage import ENCODINGS, PACKAGE, open_stage, read_attribute, reading, xyzw


def read(path: Path) -> Scene | SimRoom | dict[str, DescribedPart]:
    """Read what is seen of a scan's folder, of a stage, or of another artefact with a room (`s2a.scene.artefacts`).

    Raises:
        InputError: no such file, one without a room, or a damaged one.
    """
    row = artefacts.recognised(path, "room")
    if row is None and path.is_file() and _is_stage(path):
        open_stage(path, payloads=False)  # says what is wrong with a damaged or foreign stage
    reader = (row or artefacts.find(path, "room")).room
    assert reader is not None
    return reader(path)


@dataclass(frozen=True)
class Visible:
    """Surfaces in scene coordinates."""

    name: str  # of the scan
    surfaces: dict[str, Mesh]  # what is seen, by the id of its part or the name of its prim
    # convex hulls with the part each stands for; none but in a simulation-ready stage
    colliders: tuple[tuple[str, Mesh], ...]
    jointed: tuple[str, ...]  # ids of the parts that move

    def part(self, part_id: str) -> list[Mesh]:
        """Return the surfaces that bear a part's name, or else its colliders; InputError where it has neither."""
        pieces = [mesh for part, mesh in self.colliders if part == part_id]
        meshes = [self.surfaces[part_id]] if part_id in self.surfaces else pieces
        meshes = [mesh for mesh in meshes if len(mesh.faces)]
        if not meshes:
            names = dict.fromkeys([*self.surfaces, *(part for part, _ in self.colliders)])
            raise InputError(f"part {part_id!r} has no surface in {self.name!r}; those with one: {', '.join(names)}")
        return meshes


def visible(path: Path) -> Visible:
    """Read what there is to see in a scan's folder, a geometric or a simulation-ready stage.

    Raises:
        InputError: another file, or a damaged one.
    """
    match read(path):
        case Scene() as scene:
            return Visible(scene.name, {i: part.mesh for i, part in scene.parts.items()}, (), scene.movable)
        case SimRoom() as room:
            return visible_room(room)
    raise InputError(f"{path}: holds no surfaces; give a scan's folder, a geometric or a simulation-ready stage")


def visible_room(room: SimRoom) -> Visible:
    """Return what there is to see in a simulation-ready room."""
    surfaces = {
        body.id: Mesh(in_scene(body, body.visual), body.visual.faces, body.visual.colors)
        for body in (*room.bodies.values(), *room.free.values())
        if len(body.visual.faces)
    }
    colliders = tuple((part, mesh) for _, part, mesh in hulls(room))
    return Visible(room.name, surfaces | {"static": room.static_visual}, colliders, tuple(room.articulations))


def hulls(room: SimRoom) -> Iterator[tuple[str, str, Mesh]]:
    """Yield the colliders of a simulation-ready room in scene coordinates: their body, their part, the hull."""
    for body in (*room.bodies.values(), *room.free.values()):
        for collider in body.colliders:
            yield body.id, collider.part, Mesh(in_scene(body, collider.mesh), collider.mesh.faces)
    for collider in room.static_colliders:
        yield "static", collider.part, collider.mesh


def tree(path: Path) -> str:
    """Return a scan's folder, a stage or another artefact with a room as a tree, one line a part or prim.

    Raises:
        InputError: neither a readable scan nor a stage that s2a wrote.
    """
    row = artefacts.recognised(path, "room") or artefacts.recognised(path, "tree") or artefacts.find(path, "room")
    if row.tree:
        return row.tree(path)
    assert row.room is not None
    return _print(_scene_tree(row.room(path)))


def fitted(text: str, columns: int) -> str:
    """Return the text of a tree in lines of so many columns; what is longer goes on below its branch."""
    lines: list[str] = []
    for line in text.splitlines():
        branch, label = re.match(r"((?:[│ ]   )*(?:[├└]── )?)(.*)", line).groups()  # type: ignore[union-attr]
        below = branch.replace("├──", "│  ").replace("└──", "   ") + "    "
        words = textwrap.wrap(label, max(20, columns - len(below)), break_long_words=False, break_on_hyphens=False)
        lines += [line] if len(line) <= columns else [branch + words[0], *(below + each for each in words[1:])]
    return "\n".join(lines)


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
    described = prim.GetTypeName() not in KINDS  # as the descriptive flavour has joints
    joint = descriptive.described_joint(prim) if described else read_joint(prim)
    if joint is not None:
        yield motion_text(joint)
    for attribute in prim.GetAuthoredPropertiesInNamespace("s2a"):
        if joint is None or attribute.GetBaseName() not in ("motion", "movable", "axis", "origin", "limits"):
            yield f"{attribute.GetBaseName()} {_value(attribute.Get())}"


def _physics_facts(prim: Usd.Prim) -> Iterator[str]:
    if is_body(prim):
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
        return "xyzw " + _numbers(xyzw(value))
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


def _prims(path: Path) -> str:
    """Return any stage that s2a wrote as the tree of its prims."""
    with reading(path):
        stage = open_stage(path)  # held, since its prims end with it
        return _print(_prim_tree(stage.GetDefaultPrim()))


def _flavour(path: Path) -> str | None:
    """Return the flavour that a stage states; None for any other file."""
    if not path.is_file():
        return None
    about = path.stat()
    return _stated(path, about.st_mtime_ns, about.st_size)


@lru_cache(maxsize=4)
def _stated(path: Path, changed: int, size: int) -> str | None:
    """Read a flavour once for all rows that ask for it; time and size of the file make a changed one another."""
    try:
        with reading(path):
            stage = open_stage(path, payloads=False)
            return read_attribute(stage.GetDefaultPrim(), "flavour", str)
    except InputError:
        return None


def _is_stage(path: Path) -> bool:
    """Return whether a file's name ends as those of USD do."""
    return path.suffix.lower() in (*ENCODINGS, PACKAGE)


def _room_of(path: Path) -> Path | None:
    """Return the simulation-ready stage whose visuals a file holds; None for any other file."""
    if not _is_stage(path) or not path.stem.endswith("_visuals"):
        return None
    room = path.with_name(path.stem.removesuffix("_visuals") + path.suffix)
    return room if room.suffix and _flavour(room) == sim_stage.FLAVOUR else None


artefacts.register(
    Artefact(
        "a mesh",
        lambda path: path.suffix.lower() != PACKAGE and mesh_remedy(path) is not None,
        instead=lambda path: f"{mesh_remedy(path)}, in a folder of its own, and give that folder",
    ),
    Artefact(
        "the mesh of a scan",
        lambda path: path.suffix.lower() == ".ply",
        instead=lambda path: f"is a mesh alone; give the folder of its scan, or s2a import mesh={path} out=FOLDER",
    ),
    Artefact("a scan's folder", Path.is_dir, room=lambda path: scan.read(path), fallback=True),
    Artefact(
        "a descriptive stage", lambda path: _flavour(path) == descriptive.FLAVOUR, room=descriptive.read, tree=_prims
    ),
    Artefact("a geometric stage", lambda path: _flavour(path) == geometric.FLAVOUR, room=geometric.read),
    Artefact(
        "a simulation-ready stage", lambda path: _flavour(path) == sim_stage.FLAVOUR, room=sim_stage.read, tree=_prims
    ),
    Artefact("another stage that s2a wrote", _is_stage, tree=_prims, fallback=True),
    Artefact(
        "the visuals of a room",
        lambda path: _room_of(path) is not None,
        instead=lambda path: f"holds the visuals of a room; give {_room_of(path)}",
    ),
)
