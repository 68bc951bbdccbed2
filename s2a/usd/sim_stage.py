"""The simulation-ready flavour: what a simulator needs to open one part of a scanned room, and nothing else.

Bodies are siblings whose points lie in scene coordinates; joints alone say what moves against what. Colliders are
convex pieces, because MuJoCo takes the convex hull of every mesh it is given.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, UsdShade, Vt

from s2a.usd.joints import write_body, write_fixed_joint, write_joint, write_site
from s2a.usd.sim_scene import Collider, Grasp, Quat, SimBody, SimScene
from s2a.usd.stage import ROOT, new_stage, save, write_attribute, write_mesh

Types = Sdf.ValueTypeNames

FLAVOUR = "simready"

GRAVITY = 9.81
"""[m/s^2], along -z."""
FRICTION = 1.0
"""Coulomb coefficient of every collider, as in the reference task (IsaacLab's Franka cabinet)."""


def write(sim_scene: SimScene, path: Path) -> None:
    """Write a simulation-ready scene to exactly this path.

    Args:
        sim_scene: what a simulator needs.
        path: ends in .usd or .usdc (binary) or .usda (text).

    Raises:
        InputError: another ending, or a path that cannot be written.
    """
    stage = new_stage()
    _write_root(stage, sim_scene)
    surface = _write_surface(stage)
    _write_static(stage, sim_scene)
    _write_colliders(stage, f"{ROOT}/static", sim_scene.static_colliders, surface, by_part=True)
    carcass, target = f"{ROOT}/{sim_scene.carcass.id}", f"{ROOT}/{sim_scene.target.id}"
    _write_body(stage, carcass, sim_scene.carcass, surface, root=True, is_target=False)
    _write_body(stage, target, sim_scene.target, surface, root=False, is_target=True)
    if sim_scene.filtered:
        # Simulators that do not leave out a joint's two bodies by themselves need to be told.
        pairs = UsdPhysics.FilteredPairsAPI.Apply(stage.GetPrimAtPath(target))
        pairs.CreateFilteredPairsRel().SetTargets([carcass])
    for body in sim_scene.free:
        _write_body(stage, f"{ROOT}/{body.id}", body, surface, root=False, is_target=False)
    _write_grasp(stage, target, sim_scene.grasp)
    UsdGeom.Scope.Define(stage, f"{ROOT}/joints")
    write_fixed_joint(stage, f"{ROOT}/joints/{sim_scene.carcass.id}", carcass)
    joint = write_joint(stage, f"{ROOT}/joints/{sim_scene.target.id}", sim_scene.joint, carcass, target).GetPrim()
    joint.ApplyAPI("NewtonJointAPI")
    joint.GetAttribute("newton:friction").Set(sim_scene.friction)
    save(stage, path)


def _write_root(stage: Usd.Stage, sim_scene: SimScene) -> None:
    root = stage.GetDefaultPrim()
    write_attribute(root, "flavour", Types.String, FLAVOUR)
    write_attribute(root, "name", Types.String, sim_scene.name)
    write_attribute(root, "target", Types.String, sim_scene.target.id)
    write_attribute(root, "basePosition", Types.Double3, sim_scene.base_position)
    x, y, z, w = sim_scene.base_orientation
    write_attribute(root, "baseOrientation", Types.Quatd, Gf.Quatd(w, x, y, z))
    write_attribute(root, "basePose", Types.String, sim_scene.base_reason)
    write_attribute(root, "baseFree", Types.Bool, sim_scene.base_free)
    write_attribute(root, "robot", Types.String, sim_scene.robot)
    write_attribute(root, "notes", Types.StringArray, list(sim_scene.notes))
    physics = UsdPhysics.Scene.Define(stage, f"{ROOT}/physics")
    physics.CreateGravityDirectionAttr((0.0, 0.0, -1.0))
    physics.CreateGravityMagnitudeAttr(GRAVITY)


def _write_static(stage: Usd.Stage, sim_scene: SimScene) -> None:
    """Write how the room looks, which part each face belongs to, and what decimation did to it."""
    room = UsdGeom.Xform.Define(stage, f"{ROOT}/static").GetPrim()
    for reduction in sim_scene.reductions:
        group = reduction.group
        write_attribute(room, f"{group}:facesBefore", Types.Int, reduction.before)
        write_attribute(room, f"{group}:facesAfter", Types.Int, reduction.after)
        write_attribute(room, f"{group}:facesAsked", Types.Int, reduction.asked)
        write_attribute(room, f"{group}:errorMean", Types.Double, reduction.mean)
        write_attribute(room, f"{group}:errorP99", Types.Double, reduction.p99)
        write_attribute(room, f"{group}:errorMax", Types.Double, reduction.max)
    visual = write_mesh(stage, f"{ROOT}/static/visual", sim_scene.static_visual)
    if sim_scene.static_face_part is None or not len(sim_scene.static_face_part):
        return
    write_attribute(visual.GetPrim(), "parts", Types.StringArray, list(sim_scene.static_parts))
    part = UsdGeom.PrimvarsAPI(visual).CreatePrimvar("s2a:part", Types.IntArray, UsdGeom.Tokens.uniform)
    part.Set(Vt.IntArray.FromNumpy(sim_scene.static_face_part.astype(np.int32)))


def _write_surface(stage: Usd.Stage) -> UsdShade.Material:
    """Define the physics material that all colliders share."""
    UsdGeom.Scope.Define(stage, f"{ROOT}/materials")
    material = UsdShade.Material.Define(stage, f"{ROOT}/materials/surface")
    physics = UsdPhysics.MaterialAPI.Apply(material.GetPrim())
    physics.CreateStaticFrictionAttr(FRICTION)
    physics.CreateDynamicFrictionAttr(FRICTION)
    physics.CreateRestitutionAttr(0.0)
    return material


def _write_body(
    stage: Usd.Stage, path: str, body: SimBody, surface: UsdShade.Material, *, root: bool, is_target: bool
) -> None:
    prim = write_body(stage, path, root=root).GetPrim()
    if is_target:
        write_attribute(prim, "target", Types.Int, 1)
    if body.mass.source:
        write_attribute(prim, "massSource", Types.String, body.mass.source)
    mass = UsdPhysics.MassAPI.Apply(prim)
    mass.CreateMassAttr(body.mass.mass)
    mass.CreateCenterOfMassAttr(Gf.Vec3f(*body.mass.center))
    mass.CreateDiagonalInertiaAttr(Gf.Vec3f(*body.mass.inertia))
    mass.CreatePrincipalAxesAttr(_quatf(body.mass.axes))
    if len(body.visual.faces):
        visual = write_mesh(stage, f"{path}/visual", body.visual)
        if body.completed:
            flag = UsdGeom.PrimvarsAPI(visual).CreatePrimvar("s2a:completed", Types.IntArray, UsdGeom.Tokens.uniform)
            scanned = len(body.visual.faces) - body.completed
            flag.Set(Vt.IntArray.FromNumpy((np.arange(len(body.visual.faces)) >= scanned).astype(np.int32)))
    _write_colliders(stage, path, body.colliders, surface, by_part=False)


def _write_colliders(
    stage: Usd.Stage, body: str, colliders: tuple[Collider, ...], surface: UsdShade.Material, *, by_part: bool
) -> None:
    """Write convex pieces below a body; their names count from 00, part by part or altogether."""
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


def _write_grasp(stage: Usd.Stage, body: str, grasp: Grasp) -> None:
    site = write_site(stage, f"{body}/grasp", np.array(grasp.point))
    site.AddOrientOp(UsdGeom.XformOp.PrecisionFloat).Set(_quatf(grasp.orientation))
    write_attribute(site.GetPrim(), "size", Types.Double3, grasp.size)
    write_mesh(stage, f"{body}/region", grasp.region, purpose=UsdGeom.Tokens.guide)


def _quatf(xyzw: Quat) -> Gf.Quatf:
    """Return USD's quaternion, which takes w first."""
    x, y, z, w = xyzw
    return Gf.Quatf(w, x, y, z)
