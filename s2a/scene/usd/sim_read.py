"""The reader of the simulation-ready flavour; its layout is documented in `s2a.scene.usd.sim_stage`, which writes it."""

from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdPhysics

from s2a.core.errors import InputError
from s2a.scene.scene import Mesh, Vec3
from s2a.scene.usd import sim_scene as rooms
from s2a.scene.usd.joints import KINDS, is_body, joint_ends, read_joint, read_refinement, read_resistance
from s2a.scene.usd.stage import ROOT, open_stage, read_attribute, read_mesh, where, xyzw

FLAVOUR = "simready"
EMPTY = Mesh(np.zeros((0, 3)), np.zeros((0, 3)))


def open_physics(path: Path) -> Usd.Stage:
    """Open a simulation-ready file without its visuals.

    Raises:
        InputError: no such file, not USD, another kind of stage, or one of an older layout.
    """
    return _checked(open_stage(path, payloads=False), path)


def read(path: Path, *, visuals: bool = True) -> rooms.SimRoom:
    """Read a simulation-ready file; equal to what was written.

    `visuals`: read the surfaces too; without them they are empty, and nothing but physics is loaded.

    Raises:
        InputError: no such file, another kind of stage, or a damaged one.
    """
    stage = _checked(open_stage(path), path) if visuals else open_physics(path)
    root, static = stage.GetDefaultPrim(), stage.GetPrimAtPath(f"{ROOT}/static")
    joints = {prim.GetName(): prim for prim in stage.GetPrimAtPath(f"{ROOT}/joints").GetChildren()}
    prims = {prim.GetName(): prim for prim in root.GetChildren() if is_body(prim)}
    bodies = {name: _body(prim) for name, prim in prims.items()}
    visual = static.GetChild("visual")
    for part in (i for i in prims if _moves(joints.get(i))):
        _refuse_loose(part, joints, path)
    return rooms.SimRoom(
        name=read_attribute(root, "name", str, ""),
        bodies={name: body for name, body in bodies.items() if name in joints},
        articulations={i: _articulation(prims[i], joints[i]) for i in prims if _moves(joints.get(i))},
        static_visual=_mesh(visual, static),
        static_colliders=_colliders(static),
        free={name: body for name, body in bodies.items() if name not in joints},
        notes=_strings(root, "notes"),
        static_parts=_strings(visual, "parts") if visual else (),
        static_face_part=_face_part(visual),
        reductions=tuple(r for r in (_reduction(static, group) for group in ("structure", "other")) if r is not None),
    )


def _checked(stage: Usd.Stage, path: Path) -> Usd.Stage:
    """Return a stage if it is of this flavour and layout, else raise an InputError."""
    root = stage.GetDefaultPrim()
    require_flavour(root, path)
    if missing := [name for name in ("static", "joints") if not root.GetChild(name)]:
        raise InputError(f"{path}: {ROOT}/{missing[0]} is missing; {rooms.PREPARE_AGAIN}")
    return stage


def require_flavour(root: Usd.Prim, path: Path) -> None:
    """Raise an InputError unless the root prim of a stage states this flavour."""
    if not root or root.GetAttribute("s2a:flavour").Get() != FLAVOUR:
        raise InputError(f"{path}: not a simulation-ready stage (no s2a:flavour {FLAVOUR!r}); run s2a prepare")


def _moves(joint: Usd.Prim | None) -> bool:
    return joint is not None and joint.GetTypeName() in KINDS


def _body(prim: Usd.Prim) -> rooms.SimBody:
    """Read a body, its points in its own frame."""
    api = UsdPhysics.MassAPI(prim)
    x, y, z, w = xyzw(api.GetPrincipalAxesAttr().Get() or Gf.Quatf(1.0))
    mass = rooms.Mass(
        _required(api.GetMassAttr()),
        tuple(_required(api.GetCenterOfMassAttr())),
        tuple(_required(api.GetDiagonalInertiaAttr())),
        (x, y, z, w),
        read_attribute(prim, "massSource", str, ""),
    )
    position, orientation = _pose(prim)
    return rooms.SimBody(
        id=prim.GetName(),
        visual=_mesh(prim.GetChild("visual"), prim),
        colliders=_colliders(prim),
        mass=mass,
        completed=read_attribute(prim, "completed", int, 0),
        position=position,
        orientation=orientation,
    )


def _refuse_loose(part: str, joints: dict[str, Usd.Prim], path: Path) -> None:
    """Raise an InputError where no chain of joints holds an articulated part to the world."""
    carriers = [part]
    while _moves(joints.get(carriers[-1])):
        carriers.append(_parent(joints[carriers[-1]]))
        if carriers[-1] in carriers[:-1] or carriers[-1] not in joints:
            raise InputError(
                f"{path}: {part!r} is jointed to {carriers[-1]!r}, which nothing fixes; {rooms.PREPARE_AGAIN}"
            )


def _parent(joint: Usd.Prim) -> str:
    """Return the id of the body that a joint hangs on."""
    parents = UsdPhysics.Joint(joint).GetBody0Rel().GetTargets()
    if len(parents) != 1:
        raise InputError(f"{where(joint)} is jointed to {len(parents)} bodies, not on one; {rooms.PREPARE_AGAIN}")
    return parents[0].name


def _articulation(prim: Usd.Prim, joint: Usd.Prim) -> rooms.Articulation:
    """Read how a body moves and how it is grasped."""
    pairs = (
        UsdPhysics.FilteredPairsAPI(prim).GetFilteredPairsRel() if prim.HasAPI(UsdPhysics.FilteredPairsAPI) else None
    )
    moved = read_joint(joint)
    return rooms.Articulation(
        joint=moved,
        parent=_parent(joint),
        grasp=_grasp(prim),
        bases=dict(_base(child) for child in _children(prim, "bases")),
        friction=joint.GetAttribute("newton:friction").Get() or 0.0,
        filtered=tuple(path.name for path in pairs.GetTargets()) if pairs else (),
        notes=_strings(prim, "notes"),
        resistance=read_resistance(joint),
        refinement=read_refinement(prim, moved),
    )


def _grasp(prim: Usd.Prim) -> rooms.Grasp:
    site, region = prim.GetChild("grasp"), prim.GetChild("region")
    size = read_attribute(site, "size", tuple) if site else None
    if size is None or not region:
        raise InputError(f"{where(prim)} moves, but lacks a grasp with s2a:size and a region; {rooms.PREPARE_AGAIN}")
    point, orientation = _pose(site)
    return rooms.Grasp(point, orientation, size, read_mesh(region), read_attribute(site, "internal", bool, False))


def _base(prim: Usd.Prim) -> tuple[str, rooms.Base]:
    """Read the name of a robot, and where it stands."""
    position, orientation = _pose(prim)
    values = {"reason": str, "free": bool, "pedestal": float, "radius": float, "assumed_floor": bool}
    attributes = {name: read_attribute(prim, name, kind) for name, kind in values.items()}
    given = {name: value for name, value in attributes.items() if value is not None}
    return read_attribute(prim, "robot", str, prim.GetName()), rooms.Base(position, orientation, **given)


def _colliders(prim: Usd.Prim) -> tuple[rooms.Collider, ...]:
    return tuple(
        rooms.Collider(read_attribute(p, "part", str, "?"), _mesh(p, prim), read_attribute(p, "structure", bool, False))
        for p in _children(prim, "colliders")
        if p.HasAPI(UsdPhysics.CollisionAPI)
    )


def _mesh(prim: Usd.Prim | None, body: Usd.Prim) -> Mesh:
    """Read a surface in the frame of its body, bit for bit where no editor moved it in there; empty if there is none."""
    if not prim or not prim.IsLoaded():
        return EMPTY
    if not prim.IsA(UsdGeom.PointBased):
        raise InputError(
            f"{where(prim)}: the visuals are missing; put {_payload(prim)}, which s2a prepare wrote, beside this file"
        )
    return read_mesh(prim, frame=body)


def _payload(prim: Usd.Prim) -> str:
    """Return the name of the file that a prim's payload should come from."""
    items = [item for spec in prim.GetPrimStack() for item in spec.payloadList.GetAddedOrExplicitItems()]
    return items[0].assetPath.removeprefix("./") if items else "the file of its visuals"


def _face_part(visual: Usd.Prim | None) -> np.ndarray | None:
    primvar = UsdGeom.PrimvarsAPI(visual).GetPrimvar("s2a:part") if visual and visual.IsLoaded() else None
    return np.asarray(primvar.Get(), np.int32) if primvar and primvar.HasValue() else None


def _reduction(prim: Usd.Prim, group: str) -> rooms.Reduction | None:
    """Return what decimation did to a group of surfaces, or None."""
    counts = {n: prim.GetAttribute(f"s2a:{group}:faces{n.capitalize()}").Get() for n in ("before", "after", "asked")}
    errors = {n: prim.GetAttribute(f"s2a:{group}:error{n.capitalize()}").Get() for n in ("mean", "p99", "max")}
    return None if None in {**counts, **errors}.values() else rooms.Reduction(group, **counts, **errors)


def _strings(prim: Usd.Prim, name: str) -> tuple[str, ...]:
    return tuple(prim.GetAttribute(f"s2a:{name}").Get() or ())


def _children(prim: Usd.Prim, name: str) -> list[Usd.Prim]:
    scope = prim.GetChild(name)
    return list(scope.GetChildren()) if scope else []


def _required(attribute: Usd.Attribute) -> Any:
    value = attribute.Get()
    if value is None:
        raise InputError(f"{where(attribute.GetPrim())} has no {attribute.GetName()}; {rooms.PREPARE_AGAIN}")
    return value


def _pose(prim: Usd.Prim) -> tuple[Vec3, rooms.Quat]:
    """Return a prim's position [m] and orientation: exactly what was written, or what an editor's transforms come to."""
    ops = {op.GetOpName(): op.Get() for op in UsdGeom.Xformable(prim).GetOrderedXformOps()}
    matrix = UsdGeom.Xformable(prim).GetLocalTransformation()
    if not ops.keys() <= {"xformOp:translate", "xformOp:orient"}:
        ops = {"xformOp:translate": matrix.ExtractTranslation(), "xformOp:orient": matrix.ExtractRotationQuat()}
    x, y, z = ops.get("xformOp:translate", (0.0, 0.0, 0.0))
    return (x, y, z), xyzw(ops.get("xformOp:orient", Gf.Quatd(1.0)))


def refuse_unphysical(path: Path, room: rooms.SimRoom | None = None) -> None:
    """Raise an InputError for a stage with NaN, a mass that no body has, a joint without bodies or a hull without volume.

    `room`: what `read` returned for the path; None: it is read.
    """
    stage = open_physics(path)  # which must outlive its prims
    for prim in stage.Traverse():
        _check_numbers(prim)
        if prim.IsA(UsdPhysics.Joint):
            _check_joint(prim)
    room = room or read(path, visuals=False)
    for body in (*room.bodies.values(), *room.free.values()):
        _check_body(body, path)
    _check_hulls([collider.mesh.vertices for collider in room.static_colliders], f"{path}: the room")


def _check_numbers(prim: Usd.Prim) -> None:
    """Raise if an authored number of a prim is NaN; infinity may stand for "no limit"."""
    for attribute in prim.GetAuthoredAttributes():
        try:
            numbers = np.asarray(attribute.Get(), dtype=np.float64)
        except (TypeError, ValueError):  # a text, or something else that is no number
            continue
        if np.isnan(numbers).any() and attribute.Get() is not None:
            raise InputError(f"{where(prim)}: {attribute.GetName()} is not a number; {rooms.PREPARE_AGAIN}")


def _check_joint(prim: Usd.Prim) -> None:
    """Raise unless a joint moves a body, against another one or the world."""
    stage = prim.GetStage()
    against, moved = joint_ends(prim)
    bodies = [stage.GetPrimAtPath(path) for path in (*moved, *against)]
    if len(moved) != 1 or len(against) > 1 or not all(map(is_body, bodies)):
        given = ", ".join(map(str, (*moved, *against))) or "nothing"
        raise InputError(f"{where(prim)} joins {given}; expected rigid bodies of the stage: {rooms.PREPARE_AGAIN}")


def _check_body(body: rooms.SimBody, path: Path) -> None:
    """Raise if a body has no mass and inertia, or no hull with a volume."""
    mass, inertia = body.mass.mass, np.array(body.mass.inertia)
    if not 0.0 < mass < np.inf or not ((inertia > 0.0) & (inertia < np.inf)).all():
        given = ", ".join(f"{moment:g}" for moment in inertia)
        raise InputError(
            f"{path}: {body.id} has mass {mass:g} kg and inertia {given}; expected numbers above 0: {rooms.PREPARE_AGAIN}"
        )
    _check_hulls([collider.mesh.vertices for collider in body.colliders], f"{path}: {body.id}")


def _check_hulls(hulls: list[np.ndarray], owner: str) -> None:
    """Raise if a hull has no volume."""
    for points in hulls:
        if len(points) < 4 or np.linalg.matrix_rank(points - points.mean(axis=0), tol=1e-9) < 3:
            raise InputError(
                f"{owner} has a collision hull of {len(points)} points without volume; {rooms.PREPARE_AGAIN}"
            )
