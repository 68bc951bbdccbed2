"""Defects of a simulation-ready file itself: edits of a stage and a part's id.

Their names say what they do; `EDITS` lists them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, Vt

Edit = Callable[[Usd.Stage, str], object]


def joint_prim(stage: Usd.Stage, part: str) -> Usd.Prim:
    return stage.GetPrimAtPath(f"/scene/joints/{part}")


def drive(stage: Usd.Stage, part: str, target: float) -> None:
    kind = "linear" if joint_prim(stage, part).IsA(UsdPhysics.PrismaticJoint) else "angular"
    api = UsdPhysics.DriveAPI.Apply(joint_prim(stage, part), kind)
    api.CreateStiffnessAttr(1e4)
    api.CreateTargetPositionAttr(target)


def collision_group(stage: Usd.Stage, part: str) -> None:
    group = UsdPhysics.CollisionGroup.Define(stage, "/scene/group")
    group.CreateFilteredGroupsRel().SetTargets(["/scene/group"])
    Usd.CollectionAPI.Apply(group.GetPrim(), "colliders").CreateIncludesRel().SetTargets(
        [f"/scene/{part}", "/scene/static"]
    )


def filtered(stage: Usd.Stage, part: str, other: str) -> None:
    api = UsdPhysics.FilteredPairsAPI.Apply(stage.GetPrimAtPath(f"/scene/{part}"))
    api.CreateFilteredPairsRel().AddTarget(other)


def friction(stage: Usd.Stage, part: str, value: float) -> None:
    surface(stage, part).GetStaticFrictionAttr().Set(value)
    surface(stage, part).GetDynamicFrictionAttr().Set(value)


def newton_attribute(stage: Usd.Stage, part: str, name: str, value: float) -> None:
    joint_prim(stage, part).CreateAttribute(name, Sdf.ValueTypeNames.Float).Set(value)


def bodies(stage: Usd.Stage, part: str, first: str, second: str) -> None:
    joint = UsdPhysics.Joint(joint_prim(stage, part))
    ends = {"parent": joint.GetBody0Rel().GetTargets(), "part": joint.GetBody1Rel().GetTargets()}
    joint.GetBody0Rel().SetTargets(ends[first])
    joint.GetBody1Rel().SetTargets(ends[second])


def swap_limits(stage: Usd.Stage, part: str) -> None:
    prim = joint_prim(stage, part)
    low, high = prim.GetAttribute("s2a:limits").Get()
    prim.GetAttribute("s2a:limits").Set(Gf.Vec2d(high, low))
    physics = [prim.GetAttribute(f"physics:{end}Limit") for end in ("lower", "upper")]
    values = [attribute.Get() for attribute in physics]
    for attribute, value in zip(physics, reversed(values), strict=True):
        attribute.Set(value)


def units(stage: Usd.Stage, part: str) -> None:
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)


def dent_hull(stage: Usd.Stage, part: str) -> None:
    points = UsdGeom.Mesh(stage.GetPrimAtPath(f"/scene/{part}/colliders/hull_00")).GetPointsAttr()
    values = np.array(points.Get())
    values[0] = values.mean(axis=0)
    points.Set(Vt.Vec3fArray.FromNumpy(values))


def another_body(stage: Usd.Stage, part: str) -> str:
    paths = [str(prim.GetPath()) for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.RigidBodyAPI)]
    return next(path for path in paths if path != f"/scene/{part}")


def remove(stage: Usd.Stage, keep: Callable[[Usd.Prim], bool]) -> None:
    for path in [prim.GetPath() for prim in stage.Traverse() if not keep(prim)]:
        stage.RemovePrim(path)


def no_roots(stage: Usd.Stage, part: str) -> None:
    for prim in stage.Traverse():
        prim.RemoveAPI(UsdPhysics.ArticulationRootAPI)


def scene(stage: Usd.Stage, part: str) -> UsdPhysics.Scene:
    return UsdPhysics.Scene(stage.GetPrimAtPath("/scene/physics"))


def body(stage: Usd.Stage, part: str) -> UsdPhysics.RigidBodyAPI:
    return UsdPhysics.RigidBodyAPI(stage.GetPrimAtPath(f"/scene/{part}"))


def mass(stage: Usd.Stage, part: str) -> UsdPhysics.MassAPI:
    return UsdPhysics.MassAPI(stage.GetPrimAtPath(f"/scene/{part}"))


def joint(stage: Usd.Stage, part: str) -> UsdPhysics.Joint:
    return UsdPhysics.Joint(joint_prim(stage, part))


def hull(stage: Usd.Stage, part: str) -> UsdPhysics.CollisionAPI:
    return UsdPhysics.CollisionAPI(stage.GetPrimAtPath(f"/scene/{part}/colliders/hull_00"))


def place(stage: Usd.Stage, part: str) -> UsdGeom.Xformable:
    return UsdGeom.Xformable(stage.GetPrimAtPath(f"/scene/{part}"))


def surface(stage: Usd.Stage, part: str) -> UsdPhysics.MaterialAPI:
    return UsdPhysics.MaterialAPI(stage.GetPrimAtPath("/scene/materials/surface"))


EDITS: dict[str, Edit] = {
    "limits_swapped": swap_limits,
    "drive_to_0": partial(drive, target=0.0),
    "drive_to_0.2": partial(drive, target=0.2),
    "collision_group": collision_group,
    "filtered_with_static": partial(filtered, other="/scene/static"),
    "filtered_with_another_body": lambda s, p: filtered(s, p, another_body(s, p)),
    "gravity_0": lambda s, p: scene(s, p).GetGravityMagnitudeAttr().Set(0.0),
    "gravity_981": lambda s, p: scene(s, p).GetGravityMagnitudeAttr().Set(981.0),
    "gravity_up": lambda s, p: scene(s, p).GetGravityDirectionAttr().Set(Gf.Vec3f(0, 0, 1)),
    "friction_0": partial(friction, value=0.0),
    "friction_10": partial(friction, value=10.0),
    "restitution_1": lambda s, p: surface(s, p).GetRestitutionAttr().Set(1.0),
    "no_material": lambda s, p: s.RemovePrim("/scene/materials"),
    "joint_friction_500": partial(newton_attribute, name="newton:friction", value=500.0),
    "armature_1e3": partial(newton_attribute, name="newton:armature", value=1e3),
    "initial_velocity": lambda s, p: body(s, p).CreateVelocityAttr(Gf.Vec3f(1, 0, 0)),
    "initial_turn": lambda s, p: body(s, p).CreateAngularVelocityAttr(Gf.Vec3f(0, 0, 90)),
    "break_force": lambda s, p: joint(s, p).CreateBreakForceAttr(1e-3),
    "break_torque": lambda s, p: joint(s, p).CreateBreakTorqueAttr(1e-3),
    "excluded": lambda s, p: joint(s, p).CreateExcludeFromArticulationAttr(True),
    "joint_off": lambda s, p: joint(s, p).CreateJointEnabledAttr(False),
    "bodies_swapped": partial(bodies, first="part", second="parent"),
    "body_is_itself": partial(bodies, first="part", second="part"),
    "no_parent": lambda s, p: joint(s, p).GetBody0Rel().SetTargets([]),
    "rigid_body_off": lambda s, p: body(s, p).CreateRigidBodyEnabledAttr(False),
    "kinematic": lambda s, p: body(s, p).CreateKinematicEnabledAttr(True),
    "axes_0": lambda s, p: mass(s, p).GetPrincipalAxesAttr().Set(Gf.Quatf(0, 0, 0, 0)),
    "units_cm_y_up": units,
    "no_grasp": lambda s, p: s.RemovePrim(f"/scene/{p}/grasp"),
    "no_region": lambda s, p: s.RemovePrim(f"/scene/{p}/region"),
    "no_bases": lambda s, p: s.RemovePrim(f"/scene/{p}/bases"),
    "no_colliders": lambda s, p: s.RemovePrim(f"/scene/{p}/colliders"),
    "hull_dented": dent_hull,
    "collision_off": lambda s, p: hull(s, p).CreateCollisionEnabledAttr(False),
    "mass_nan": lambda s, p: mass(s, p).GetMassAttr().Set(float("nan")),
    "no_articulation_root": no_roots,
    "cabinet_not_fixed": lambda s, p: remove(s, lambda prim: not prim.IsA(UsdPhysics.FixedJoint)),
    "part_moved": lambda s, p: place(s, p).AddTranslateOp().Set(Gf.Vec3d(0.02, 0.0, 0.0)),
    "part_scaled": lambda s, p: place(s, p).AddScaleOp().Set(Gf.Vec3f(1.05, 1.05, 1.05)),
    "no_visuals": lambda s, p: remove(s, lambda prim: prim.GetName() != "visual"),
}
"""Edits of the file itself."""
