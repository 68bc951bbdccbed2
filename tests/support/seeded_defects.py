"""Defects to seed into the stage of tests/cabinet.py, and the static rule that each of them breaks."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, Vt

from s2a.scene.scene import Mesh

TARGET, CARCASS, JOINT = "/scene/drawer_2", "/scene/cabinet_1", "/scene/joints/drawer_2"
BAR = f"{TARGET}/colliders/hull_00"


def edit(path: Path, change: Callable[[Usd.Stage], object]) -> None:
    """Change a stage on disk."""
    stage = Usd.Stage.Open(str(path))
    change(stage)
    stage.GetRootLayer().Save()


def attribute(stage: Usd.Stage, path: str, value: object) -> None:
    assert stage.GetAttributeAtPath(path).Set(value)


def reshape(stage: Usd.Stage, path: str, mesh: Mesh) -> None:
    """Give a piece that is a box the points of another box."""
    UsdGeom.Mesh(stage.GetPrimAtPath(path)).GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(mesh.vertices))
    corners = np.stack([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])
    UsdGeom.Mesh(stage.GetPrimAtPath(path)).GetExtentAttr().Set(Vt.Vec3fArray.FromNumpy(corners))


def wrong_units(stage: Usd.Stage) -> None:
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)


def missing_root(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath(CARCASS).RemoveAPI(UsdPhysics.ArticulationRootAPI)


def cabinet_not_fixed(stage: Usd.Stage) -> None:
    stage.RemovePrim("/scene/joints/cabinet_1")


def stale_anchor(stage: Usd.Stage) -> None:
    UsdPhysics.Joint(stage.GetPrimAtPath(JOINT)).GetBody0Rel().SetTargets([])


def no_rigid_body(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath(TARGET).RemoveAPI(UsdPhysics.RigidBodyAPI)


def renamed_part(stage: Usd.Stage) -> None:
    """The joint is called like another part than the one that it moves."""
    Sdf.CopySpec(stage.GetRootLayer(), JOINT, stage.GetRootLayer(), "/scene/joints/drawer_70")
    stage.RemovePrim(JOINT)


def detached_joint(stage: Usd.Stage) -> None:
    UsdPhysics.Joint(stage.GetPrimAtPath(JOINT)).GetBody0Rel().SetTargets(["/scene/cabinet_9"])


def second_joint(stage: Usd.Stage) -> None:
    Sdf.CopySpec(stage.GetRootLayer(), JOINT, stage.GetRootLayer(), f"{JOINT}_b")


def left_over_anchor(stage: Usd.Stage) -> None:
    """An anchor body that nothing hangs on any more."""
    UsdPhysics.RigidBodyAPI.Apply(UsdGeom.Xform.Define(stage, "/scene/drawer_9_anchor").GetPrim())


def nested_body(stage: Usd.Stage) -> None:
    inner = UsdGeom.Xform.Define(stage, f"{CARCASS}/shelf")
    UsdPhysics.RigidBodyAPI.Apply(inner.GetPrim())


def mirrored_body(stage: Usd.Stage) -> None:
    UsdGeom.Xformable(stage.GetPrimAtPath(TARGET)).AddScaleOp().Set(Gf.Vec3f(1, -1, 1))


def mirrored_frame(stage: Usd.Stage) -> None:
    attribute(stage, f"{JOINT}.physics:localRot1", Gf.Quatf(0, 0, 0, 1))


def axis_disagrees(stage: Usd.Stage) -> None:
    attribute(stage, f"{JOINT}.s2a:axis", Gf.Vec3d(math.cos(0.01), math.sin(0.01), 0.0))


def origin_disagrees(stage: Usd.Stage) -> None:
    attribute(stage, f"{JOINT}.physics:localPos0", Gf.Vec3f(0.351, 0.002, 0.7267))


def limits_in_centimetres(stage: Usd.Stage) -> None:
    attribute(stage, f"{JOINT}.s2a:limits", Gf.Vec2d(0.0, 40.0))
    attribute(stage, f"{JOINT}.physics:upperLimit", 40.0)


def limits_without_zero(stage: Usd.Stage) -> None:
    attribute(stage, f"{JOINT}.s2a:limits", Gf.Vec2d(0.1, 0.4))
    attribute(stage, f"{JOINT}.physics:lowerLimit", 0.1)


def one_flipped_limit(stage: Usd.Stage) -> None:
    attribute(stage, f"{JOINT}.physics:upperLimit", -0.4)


def limits_in_degrees(stage: Usd.Stage) -> None:
    """A door whose range was written as radians where UsdPhysics wants degrees."""
    joint = UsdPhysics.RevoluteJoint.Define(stage, JOINT)
    for end, value in (("lower", 0.0), ("upper", 1.57)):
        joint.GetPrim().CreateAttribute(f"physics:{end}Limit", Sdf.ValueTypeNames.Float).Set(value)
    attribute(stage, f"{JOINT}.s2a:limits", Gf.Vec2d(0.0, 1.57))


def zero_mass(stage: Usd.Stage) -> None:
    attribute(stage, f"{TARGET}.physics:mass", 0.0)


def impossible_inertia(stage: Usd.Stage) -> None:
    attribute(stage, f"{TARGET}.physics:diagonalInertia", Gf.Vec3f(0.1, 0.1, 0.3))


def dented_piece(stage: Usd.Stage) -> None:
    points = stage.GetAttributeAtPath(f"{BAR}.points")
    values = list(points.Get())
    values[0] = Gf.Vec3f(*(sum(v[i] for v in values) / len(values) for i in range(3)))
    points.Set(Vt.Vec3fArray(values))


def open_piece(stage: Usd.Stage) -> None:
    indices = stage.GetAttributeAtPath(f"{BAR}.faceVertexIndices")
    counts = stage.GetAttributeAtPath(f"{BAR}.faceVertexCounts")
    indices.Set(Vt.IntArray(list(indices.Get())[6:]))
    counts.Set(Vt.IntArray(list(counts.Get())[2:]))


def missing_collision(stage: Usd.Stage) -> None:
    for name in ("PhysicsCollisionAPI", "NewtonCollisionAPI", "NewtonMeshCollisionAPI"):
        stage.GetPrimAtPath(BAR).RemoveAppliedSchema(name)


def nan_point(stage: Usd.Stage) -> None:
    points = stage.GetAttributeAtPath(f"{BAR}.points")
    points.Set(Vt.Vec3fArray([Gf.Vec3f(math.nan), *list(points.Get())[1:]]))


def shifted_grasp(stage: Usd.Stage) -> None:
    attribute(stage, f"{TARGET}/grasp.xformOp:translate", Gf.Vec3d(0.351, 0.1, 0.7267))


def missing_grasp(stage: Usd.Stage) -> None:
    stage.RemovePrim(f"{TARGET}/grasp")


def missing_grasp_size(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath(f"{TARGET}/grasp").RemoveProperty("s2a:size")


def missing_region(stage: Usd.Stage) -> None:
    stage.RemovePrim(f"{TARGET}/region")


def empty_region(stage: Usd.Stage) -> None:
    """As a scan without a surface there is written: a Mesh without faces would be refused by Newton."""
    missing_region(stage)
    UsdGeom.Points.Define(stage, f"{TARGET}/region")


def missing_base(stage: Usd.Stage) -> None:
    stage.RemovePrim(f"{TARGET}/bases/panda")


def missing_base_turn(stage: Usd.Stage) -> None:
    base = UsdGeom.Xformable(stage.GetPrimAtPath(f"{TARGET}/bases/panda"))
    base.SetXformOpOrder(base.GetOrderedXformOps()[:1])


def far_frame(stage: Usd.Stage) -> None:
    """A free object whose frame is the scene's, 5 m from its centre of mass."""
    Sdf.CopySpec(stage.GetRootLayer(), TARGET, stage.GetRootLayer(), "/scene/cup_5")
    attribute(stage, "/scene/cup_5.physics:centerOfMass", Gf.Vec3f(5.0, 0.0, 0.0))


def external_reference(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/scene/static").GetReferences().AddReference("./other.usda", "/scene")


def payload(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath("/scene/static").GetPayloads().AddPayload("./other.usda", "/scene")


def instance(stage: Usd.Stage) -> None:
    prim = stage.OverridePrim("/scene/static/copy")
    prim.GetReferences().AddInternalReference("/scene/materials")
    prim.SetInstanceable(True)


def no_colliders(stage: Usd.Stage) -> None:
    stage.RemovePrim(f"{TARGET}/colliders")


STATIC_DEFECTS = {
    wrong_units: "units", external_reference: "self_contained", payload: "self_contained", instance: "self_contained",
    no_rigid_body: "target", renamed_part: "target", far_frame: "bodies", nested_body: "bodies", left_over_anchor: "bodies",
    mirrored_body: "bodies",
    missing_root: "root_joint", cabinet_not_fixed: "root_joint", stale_anchor: "target_joint",
    detached_joint: "target_joint", second_joint: "target_joint", limits_in_centimetres: "joint_limits",
    limits_without_zero: "joint_limits", one_flipped_limit: "joint_limits", limits_in_degrees: "joint_limits",
    mirrored_frame: "joint_frames", axis_disagrees: "joint_frames", origin_disagrees: "joint_frames",
    zero_mass: "mass", impossible_inertia: "mass", dented_piece: "convex",
    open_piece: "convex", missing_collision: "collision", nan_point: "finite", shifted_grasp: "grasp_site",
    no_colliders: "collider_count", missing_grasp: "grasp_and_base", missing_grasp_size: "grasp_and_base",
    missing_region: "grasp_and_base", empty_region: "grasp_and_base", missing_base: "grasp_and_base",
    missing_base_turn: "grasp_and_base",
}  # fmt: skip
