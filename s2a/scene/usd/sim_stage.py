"""The simulation-ready flavour: every articulated part and free object of a scanned room, ready for a simulator.

    /scene/<body>               rigid bodies, siblings: cabinets, articulated parts, free objects
    /scene/<body>/colliders/*   its convex hulls (MuJoCo takes the convex hull of every mesh that it is given)
    /scene/<body>/visual        its surface, a payload in a file beside: physics loads without it
    /scene/<part>/grasp         of an articulated part: grasp frame, `region` its annotated surface, `bases/<robot>` base poses
    /scene/joints/<body>        what moves, or fixes, a body
    /scene/static/colliders/*   the rest of the room, `visual` its surface

Points lie in scene coordinates, but those of a free object in a frame at its centre of mass. This module is the only one that
writes and reads the layout; `s2a.certify.contents` reads what may be damaged.
"""

import os
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, UsdShade, Vt

from s2a.core.locks import start_of
from s2a.scene.scene import Mesh
from s2a.scene.usd import joints
from s2a.scene.usd.joints import write_body, write_fixed_joint, write_joint, write_site
from s2a.scene.usd.sim_read import FLAVOUR, open_physics, read
from s2a.scene.usd.sim_scene import Articulation, Base, Collider, Grasp, Quat, Reduction, SimBody, SimRoom
from s2a.scene.usd.stage import ROOT, new_stage, referable, save, write_attribute, write_mesh

__all__ = ["FLAVOUR", "GRAVITY", "open_physics", "read", "visuals_file", "write"]

Types = Sdf.ValueTypeNames

GRAVITY = 9.81  # [m/s^2], along -z
FRICTION = 1.0  # Coulomb coefficient of every collider, as in the reference task (IsaacLab's Franka cabinet)
VISUALS = "/visuals"  # Default prim of the file of the visuals; below it one surface for each body, and `static`


def visuals_file(path: Path) -> Path:
    """Return where the visuals of a simulation-ready file lie: beside it.

    Raises:
        InputError: the file's name holds a control character.
    """
    name = referable(f"{path.stem}_visuals{path.suffix}")
    return path.with_name(name if len(os.fsencode(name)) <= 255 else f"{start_of(path)}_visuals{path.suffix}")


def write(room: SimRoom, path: Path, visuals: Path | None = None) -> None:
    """Write a room to exactly this path, and its visuals to another.

    `visuals`: the file of the visuals, which has to end up beside the other; None: `visuals_file(path)`.

    Raises:
        InputError: another ending, or a path that cannot be written.
    """
    visuals = visuals or visuals_file(path)
    _write_visuals(room, visuals)
    stage = new_stage()
    stage.SetLoadRules(Usd.StageLoadRules.LoadNone())  # else each payload would be looked for while it is authored
    payload = f"./{visuals.name}"
    _write_root(stage, room)
    surface = _write_surface(stage)
    static = UsdGeom.Xform.Define(stage, f"{ROOT}/static").GetPrim()
    for reduction in room.reductions:
        _write_reduction(static, reduction)
    _write_payload(stage, f"{ROOT}/static", payload, room.static_visual)
    _write_colliders(stage, f"{ROOT}/static", room.static_colliders, surface, by_part=True)
    for body in (*room.bodies.values(), *room.free.values()):
        _write_body(stage, body, surface, payload, root=body.id in room.fixed)
    UsdGeom.Scope.Define(stage, f"{ROOT}/joints")
    for body_id in room.fixed:
        write_fixed_joint(stage, f"{ROOT}/joints/{body_id}", f"{ROOT}/{body_id}")
    for part, articulation in room.articulations.items():
        _write_articulation(stage, part, articulation)
    save(stage, path)


def _write_root(stage: Usd.Stage, room: SimRoom) -> None:
    root = stage.GetDefaultPrim()
    write_attribute(root, "flavour", Types.String, FLAVOUR)
    write_attribute(root, "name", Types.String, room.name)
    write_attribute(root, "notes", Types.StringArray, list(room.notes))
    physics = UsdPhysics.Scene.Define(stage, f"{ROOT}/physics")
    physics.CreateGravityDirectionAttr((0.0, 0.0, -1.0))
    physics.CreateGravityMagnitudeAttr(GRAVITY)


def _write_visuals(room: SimRoom, path: Path) -> None:
    """Write the file of the visuals: one surface for each body, and the room's with the part of each face."""
    stage = new_stage()
    root = UsdGeom.Xform.Define(stage, VISUALS).GetPrim()
    stage.RemovePrim(ROOT)
    stage.SetDefaultPrim(root)
    for body in (*room.bodies.values(), *room.free.values()):
        if len(body.visual.faces):
            prim = write_mesh(stage, f"{VISUALS}/{body.id}", body.visual).GetPrim()
            if body.completed:
                added = np.arange(len(body.visual.faces)) >= len(body.visual.faces) - body.completed
                _write_per_face(prim, "completed", added)
    if len(room.static_visual.faces):
        prim = write_mesh(stage, f"{VISUALS}/static", room.static_visual).GetPrim()
        if room.static_face_part is not None and len(room.static_face_part):
            write_attribute(prim, "parts", Types.StringArray, list(room.static_parts))
            _write_per_face(prim, "part", room.static_face_part)
    save(stage, path)


def _write_per_face(prim: Usd.Prim, name: str, values: np.ndarray) -> None:
    """Author the primvar `s2a:<name>`, one number a face."""
    primvar = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(f"s2a:{name}", Types.IntArray, UsdGeom.Tokens.uniform)
    primvar.Set(Vt.IntArray.FromNumpy(values.astype(np.int32)))


def _write_payload(stage: Usd.Stage, owner: str, file: str, visual: Mesh) -> None:
    """Define the prim that takes its surface from the file of the visuals; none where there is nothing to see."""
    if len(visual.faces):
        prim = stage.DefinePrim(f"{owner}/visual")
        prim.GetPayloads().AddPayload(file, f"{VISUALS}/{owner.removeprefix(f'{ROOT}/')}")


def _write_reduction(prim: Usd.Prim, reduction: Reduction) -> None:
    """Write what decimation did to one group of surfaces."""
    for name in ("before", "after", "asked"):
        write_attribute(prim, f"{reduction.group}:faces{name.capitalize()}", Types.Int, getattr(reduction, name))
    for name in ("mean", "p99", "max"):
        write_attribute(prim, f"{reduction.group}:error{name.capitalize()}", Types.Double, getattr(reduction, name))


def _write_surface(stage: Usd.Stage) -> UsdShade.Material:
    """Define the physics material that all colliders share."""
    UsdGeom.Scope.Define(stage, f"{ROOT}/materials")
    material = UsdShade.Material.Define(stage, f"{ROOT}/materials/surface")
    physics = UsdPhysics.MaterialAPI.Apply(material.GetPrim())
    physics.CreateStaticFrictionAttr(FRICTION)
    physics.CreateDynamicFrictionAttr(FRICTION)
    physics.CreateRestitutionAttr(0.0)
    return material


def _write_body(stage: Usd.Stage, body: SimBody, surface: UsdShade.Material, payload: str, *, root: bool) -> None:
    path = f"{ROOT}/{body.id}"
    xform = write_body(stage, path, root=root)
    prim = xform.GetPrim()
    if body.position != (0.0, 0.0, 0.0):
        xform.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*body.position))
    if body.orientation != (0.0, 0.0, 0.0, 1.0):
        xform.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(_quat(Gf.Quatd, body.orientation))
    if body.mass.source:
        write_attribute(prim, "massSource", Types.String, body.mass.source)
    if body.completed:
        write_attribute(prim, "completed", Types.Int, body.completed)
    mass = UsdPhysics.MassAPI.Apply(prim)
    mass.CreateMassAttr(body.mass.mass)
    mass.CreateCenterOfMassAttr(Gf.Vec3f(*body.mass.center))
    mass.CreateDiagonalInertiaAttr(Gf.Vec3f(*body.mass.inertia))
    mass.CreatePrincipalAxesAttr(_quat(Gf.Quatf, body.mass.axes))
    _write_payload(stage, path, payload, body.visual)
    _write_colliders(stage, path, body.colliders, surface, by_part=False)


def _write_colliders(
    stage: Usd.Stage, body: str, colliders: tuple[Collider, ...], surface: UsdShade.Material, *, by_part: bool
) -> None:
    """Write convex hulls below a body; their names count from 00, part by part or altogether."""
    UsdGeom.Xform.Define(stage, f"{body}/colliders")
    counts: dict[str, int] = {}
    for collider in colliders:
        stem = collider.part if by_part else "hull"
        path = f"{body}/colliders/{stem}_{counts.setdefault(stem, 0):02d}"
        counts[stem] += 1
        prim = write_mesh(stage, path, collider.mesh, purpose=UsdGeom.Tokens.guide).GetPrim()
        UsdPhysics.CollisionAPI.Apply(prim)
        UsdPhysics.MeshCollisionAPI.Apply(prim).CreateApproximationAttr(UsdPhysics.Tokens.convexHull)
        # What NVIDIA's SimReady asks of a collider for Newton; the values stay Newton's own.
        prim.ApplyAPI("NewtonCollisionAPI")
        prim.ApplyAPI("NewtonMeshCollisionAPI")
        binding = UsdShade.MaterialBindingAPI.Apply(prim)
        binding.Bind(surface, UsdShade.Tokens.weakerThanDescendants, "physics")
        write_attribute(prim, "part", Types.String, collider.part)
        if collider.structure:
            write_attribute(prim, "structure", Types.Bool, True)


def _write_articulation(stage: Usd.Stage, part: str, articulation: Articulation) -> None:
    """Write joint, grasp, base poses and notes of a part whose body is there."""
    path, parent = f"{ROOT}/{part}", f"{ROOT}/{articulation.parent}"
    joint = write_joint(stage, f"{ROOT}/joints/{part}", articulation.joint, parent, path).GetPrim()
    joint.ApplyAPI("NewtonJointAPI")
    joint.GetAttribute("newton:friction").Set(articulation.friction)
    if articulation.resistance is not None:
        joints.write_resistance(joint, articulation.resistance)
    prim = stage.GetPrimAtPath(path)
    write_attribute(prim, "notes", Types.StringArray, list(articulation.notes))
    if articulation.refinement is not None:
        joints.write_refinement(prim, articulation.refinement)
    if articulation.filtered:
        # Simulators that do not leave out a joint's two bodies by themselves need the filter.
        pairs = UsdPhysics.FilteredPairsAPI.Apply(prim)
        pairs.CreateFilteredPairsRel().SetTargets([f"{ROOT}/{other}" for other in articulation.filtered])
    _write_grasp(stage, path, articulation.grasp)
    UsdGeom.Scope.Define(stage, f"{path}/bases")
    for robot, base in articulation.bases.items():
        _write_base(stage, f"{path}/bases/{robot}", robot, base)


def _write_grasp(stage: Usd.Stage, body: str, grasp: Grasp) -> None:
    site = write_site(stage, f"{body}/grasp", np.array(grasp.point))
    site.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(_quat(Gf.Quatd, grasp.orientation))
    write_attribute(site.GetPrim(), "size", Types.Double3, grasp.size)
    if grasp.internal:
        write_attribute(site.GetPrim(), "internal", Types.Bool, True)
    write_mesh(stage, f"{body}/region", grasp.region, purpose=UsdGeom.Tokens.guide)


def _write_base(stage: Usd.Stage, path: str, robot: str, base: Base) -> None:
    frame = UsdGeom.Xform.Define(stage, path)
    frame.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*base.position))
    frame.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(_quat(Gf.Quatd, base.orientation))
    write_attribute(frame.GetPrim(), "robot", Types.String, robot)
    write_attribute(frame.GetPrim(), "reason", Types.String, base.reason)
    write_attribute(frame.GetPrim(), "free", Types.Bool, base.free)
    write_attribute(frame.GetPrim(), "pedestal", Types.Double, base.pedestal)
    write_attribute(frame.GetPrim(), "radius", Types.Double, base.radius)
    if base.assumed_floor:
        write_attribute(frame.GetPrim(), "assumed_floor", Types.Bool, True)


def _quat(kind: type, xyzw: Quat) -> Gf.Quatd | Gf.Quatf:
    """Return USD's quaternion, which takes w first."""
    x, y, z, w = xyzw
    return kind(w, x, y, z)
