"""The geometric flavour: the whole scan in a stage for any viewer; `read` restores the scene exactly.

    /scene                      Xform: name, origin
    /scene/wall_1               Mesh: a part of the immovable room
    /scene/cabinet_3            Xform, rigid body, articulation root: the object that carries joints ...
    /scene/cabinet_3/visual     Mesh: ... and its own surface
    /scene/drawer_7             Xform, rigid body: a jointed part, beside its cabinet body, never below it
    /scene/drawer_7/visual      Mesh
    /scene/drawer_7/handle_9    Mesh: a part that moves along; `s2a:parent` says what it belongs to
    /scene/drawer_7/grasp       Sphere, site: where to take hold of it
    /scene/joints/cabinet_3     FixedJoint to the world
    /scene/joints/drawer_7      PrismaticJoint or RevoluteJoint

There are no colliders, and a mass only where one is annotated: this is a record of the room, not yet a simulation.
"""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdPhysics

from s2a.core.errors import InputError
from s2a.scene.scene import MAX_COORDINATE, MAX_MASS, Joint, Mesh, Motion, Part, Scene
from s2a.scene.usd.joints import (
    KINDS,
    is_body,
    placed,
    read_joint,
    site_point,
    write_body,
    write_fixed_joint,
    write_joint,
    write_site,
)
from s2a.scene.usd.stage import (
    ROOT,
    check_ids,
    new_stage,
    open_stage,
    read_attribute,
    read_mesh,
    reading,
    save,
    where,
    write_attribute,
    write_mesh,
)

FLAVOUR = "geometric"
JOINTS = f"{ROOT}/joints"

Types = Sdf.ValueTypeNames


def write(scene: Scene, path: Path) -> None:
    """Write a scene to exactly this path.

    `path`: ends in .usd or .usdc (binary, 4 times smaller, fast) or .usda (text).

    Raises:
        InputError: an id that cannot be a prim's name, another ending, or a path that cannot be written.
    """
    check_ids(scene)
    stage = new_stage()
    root = stage.GetDefaultPrim()
    write_attribute(root, "flavour", Types.String, FLAVOUR)
    write_attribute(root, "name", Types.String, scene.name)
    write_attribute(root, "origin", Types.Double3, scene.origin)
    UsdGeom.Scope.Define(stage, JOINTS)
    for order, part_id in enumerate(scene.parts):
        prim = _write_part(stage, scene, part_id)
        _write_attributes(prim, scene.parts[part_id], part_id, order)
    for part_id in scene.movable:
        _write_motion(stage, scene, part_id)
    save(stage, path)


def read(path: Path) -> Scene:
    """Read a scene that `write` wrote; `read(write(scene)) == scene`.

    Parts that somebody added to the stage follow after those of the scan. Where somebody transformed prims, or the whole
    scene, surfaces and joints are read as they stand now.

    Raises:
        InputError: not a stage of this flavour, or one in which a part, a joint or a mesh is missing or wrong, two prims
            stand for one part, or a moving part is scaled.
    """
    with reading(path):
        return _read_scene(open_stage(path), path)


def body_path(scene: Scene, part_id: str) -> str:
    """Return the path of the rigid body that a jointed part moves against: another part's, or an empty anchor's."""
    return f"{ROOT}/{scene.parent_body(part_id) or f'{part_id}_anchor'}"


def _write_part(stage: Usd.Stage, scene: Scene, part_id: str) -> Usd.Prim:
    """Define the prim that stands for a part: a mesh of the room, a body, or a mesh of a body."""
    body, mesh = scene.body(part_id), scene.parts[part_id].mesh
    if body != part_id:
        return write_mesh(stage, f"{ROOT}/{part_id}" if body is None else f"{ROOT}/{body}/{part_id}", mesh).GetPrim()
    motion = scene.parts[part_id].motion
    prim = write_body(stage, f"{ROOT}/{part_id}", root=not isinstance(motion, Joint)).GetPrim()
    write_mesh(stage, f"{ROOT}/{part_id}/visual", mesh)
    if motion == "fixed":
        write_fixed_joint(stage, f"{JOINTS}/{part_id}", f"{ROOT}/{part_id}")
    return prim


def _write_attributes(prim: Usd.Prim, part: Part, part_id: str, order: int) -> None:
    write_attribute(prim, "partId", Types.String, part_id)
    write_attribute(prim, "order", Types.Int, order)
    write_attribute(prim, "label", Types.String, part.label)
    write_attribute(prim, "motion", Types.Token, part.motion.kind if isinstance(part.motion, Joint) else part.motion)
    write_attribute(prim, "graspable", Types.Bool, part.graspable)
    if part.parent is not None:
        write_attribute(prim, "parent", Types.String, part.parent)
    if part.mass is not None:
        write_attribute(prim, "mass", Types.Double, part.mass)
        if is_body(prim):
            UsdPhysics.MassAPI.Apply(prim).CreateMassAttr(part.mass)


def _write_motion(stage: Usd.Stage, scene: Scene, part_id: str) -> None:
    """Define the joint and the grasp point of a jointed part, and an anchor where it belongs to no other part.

    The anchor is there because a joint straight to the world leaves the body's pose stale in Newton 1.8.
    """
    against = body_path(scene, part_id)
    if scene.parent_body(part_id) is None:
        write_body(stage, against, root=True)
        write_fixed_joint(stage, f"{JOINTS}/{part_id}_anchor", against)
    write_joint(stage, f"{JOINTS}/{part_id}", scene.joint(part_id), against, f"{ROOT}/{part_id}")
    point = site_point(scene, part_id)
    if point is not None:
        write_site(stage, f"{ROOT}/{part_id}/grasp", point)


def _read_scene(stage: Usd.Stage, path: Path) -> Scene:
    root = stage.GetDefaultPrim()
    flavour = read_attribute(root, "flavour", str, "unknown")
    if flavour != FLAVOUR:
        raise InputError(f"{path}: its flavour is {flavour!r}; expected {FLAVOUR!r}: give what `s2a export` wrote")
    prims = [prim for prim in Usd.PrimRange(root) if prim.HasAttribute("s2a:partId")]
    prims = sorted(prims, key=lambda prim: read_attribute(prim, "order", int, len(prims)))
    _check_once(prims)
    parts = {_id(prim): _read_part(stage, prim) for prim in prims}
    name, origin = read_attribute(root, "name", str, ""), read_attribute(root, "origin", tuple, (0.0, 0.0, 0.0))
    try:
        return Scene(name, parts, origin)
    except ValueError as error:
        raise InputError(f"{path}: {error}; export the scan again") from error


def _id(prim: Usd.Prim) -> str:
    return str(read_attribute(prim, "partId", str))


def _check_once(prims: Iterable[Usd.Prim]) -> None:
    """Raise an InputError if two prims stand for one part, as after "Duplicate" in an editor."""
    first: dict[str, Usd.Prim] = {}
    for prim in prims:
        other = first.setdefault(_id(prim), prim)
        if other != prim:
            raise InputError(
                f"{where(other)} and {prim.GetPath()} have the same s2a:partId {_id(prim)!r}; give one of them an id of "
                "its own, or delete it"
            )


def _read_part(stage: Usd.Stage, prim: Usd.Prim) -> Part:
    mass = read_attribute(prim, "mass", float)
    if mass is not None and not 0.0 < mass <= MAX_MASS:
        raise InputError(
            f"{where(prim)}: s2a:mass is {mass:g} kg; expected above 0 and up to {MAX_MASS:g}: correct it, or delete it"
        )
    return Part(
        label=read_attribute(prim, "label", str, ""),
        mesh=_read_surface(stage, prim),
        parent=read_attribute(prim, "parent", str),
        motion=_read_motion(stage, prim),
        graspable=read_attribute(prim, "graspable", bool, False),
        mass=mass,
    )


def _read_surface(stage: Usd.Stage, prim: Usd.Prim) -> Mesh:
    """Read the mesh of a part: the prim itself, or `visual` below its body."""
    if prim.IsA(UsdGeom.PointBased):
        return _near(prim, read_mesh(prim))
    visual = stage.GetPrimAtPath(prim.GetPath().AppendChild("visual"))
    if not visual:
        raise InputError(f"{where(prim)} has no visual Mesh; export the scan again")
    return _near(visual, read_mesh(visual))


def _near(prim: Usd.Prim, mesh: Mesh) -> Mesh:
    """Return a mesh, or raise an InputError if it reaches where no room is."""
    farthest = float(np.abs(mesh.vertices).max(initial=0.0))
    if farthest > MAX_COORDINATE:
        raise InputError(
            f"{where(prim)}: a point is {farthest:g} m from the origin; expected up to {MAX_COORDINATE:g} m: export again"
        )
    return mesh


def _read_motion(stage: Usd.Stage, prim: Usd.Prim) -> Motion:
    motion = read_attribute(prim, "motion", str, "fixed")
    if motion == "fixed" or motion == "free":
        return motion
    if motion not in KINDS.values():
        raise InputError(f"{where(prim)} has motion {motion!r}; possible: fixed, free, {', '.join(KINDS.values())}")
    joint = stage.GetPrimAtPath(f"{JOINTS}/{_id(prim)}")
    if not joint:
        raise InputError(f"{where(prim)} is {motion} but {JOINTS}/{_id(prim)} is missing; export the scan again")
    moved_joint = placed(read_joint(joint), prim)
    if max(map(abs, moved_joint.origin)) > MAX_COORDINATE:
        raise InputError(
            f"{where(joint)}: s2a:origin {moved_joint.origin} is beyond {MAX_COORDINATE:g} m; export the scan again"
        )
    return moved_joint
