"""What was identified of a joint, as a small layer over its room: the room stays as it is, and without the layer nothing was."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

from s2a.scene.usd import resistance as joint_resistance
from s2a.scene.usd.resistance import Resistance
from s2a.scene.usd.sim_scene import Mass
from s2a.scene.usd.stage import ROOT, save_layer, write_attribute


def scaled(mass: Mass, factor: float) -> Mass:
    """Return a mass of another size and the same shape."""
    inertia = mass.inertia
    return replace(
        mass,
        mass=mass.mass * factor,
        inertia=(inertia[0] * factor, inertia[1] * factor, inertia[2] * factor),
        source="identified",
    )


def write(below: str, part: str, mass: Mass | None, friction: float | None, resistance: Resistance, path: Path) -> None:
    """Write a layer over a room in which a part's body and joint have other dynamics.

    Args:
        below: path of the simulation-ready file, or of another such layer, relative to the folder of the layer.
        part: id of the articulated part.
        mass: of its body; None: it stays.
        friction: dry friction of its joint in motion [N] or [N m]; None: it stays.
        resistance: what else resists.
        path: ends in .usda.

    Raises:
        InputError: the file cannot be written.
    """
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)  # of a stage the top layer alone says so
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    stage.SetDefaultPrim(stage.OverridePrim(ROOT))
    body, joint = stage.OverridePrim(f"{ROOT}/{part}"), stage.OverridePrim(f"{ROOT}/joints/{part}")
    if mass is not None:
        api = UsdPhysics.MassAPI(body)
        api.CreateMassAttr(mass.mass)
        api.CreateDiagonalInertiaAttr(Gf.Vec3f(*mass.inertia))
        write_attribute(body, "massSource", Sdf.ValueTypeNames.String, mass.source)
    if friction is not None:
        joint.CreateAttribute("newton:friction", Sdf.ValueTypeNames.Float).Set(friction)
    joint_resistance.write(joint, resistance)
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(stage.GetRootLayer())  # a layer alone opens nothing that it names
    layer.subLayerPaths.append(below)
    save_layer(layer, path)
