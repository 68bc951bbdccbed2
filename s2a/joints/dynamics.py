"""The dynamics of a joint: what is known of them, and the layer that stores them over a room."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

from s2a.joints.joint_kernels import PARAMETERS
from s2a.scene.usd import resistance as joint_resistance
from s2a.scene.usd.resistance import Resistance
from s2a.scene.usd.sim_scene import Mass
from s2a.scene.usd.stage import ROOT, save_layer, write_attribute

TYPICAL = np.array([1.0, 5.0, 2.0, 1.0, 10.0, 5.0, 20.0])
"""Of PARAMETERS: unit of the variables that are searched, but for the mass, whose variable is its logarithm."""
LOWER = np.array([0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
UPPER = np.array([20.0, 200.0, 100.0, 50.0, 500.0, 100.0, 1000.0])
VAGUE = 0.5
"""Relative deviation of a mass that tells nothing."""
NINETY = 1.6449
"""Standard deviations of a normal distribution on either side of its mean that hold 90 %."""


@dataclass(frozen=True)
class Dynamics:
    """What resists at a joint's grasp point, as PARAMETERS name it.

    Attributes:
        values: shape [parameter].
        deviations: standard deviations, shape [parameter]; infinite where the recordings do not tell.
        misfit: mean square of the innovations over their expected variance: 1 where the model and the noise are right.
    """

    values: np.ndarray
    deviations: np.ndarray
    misfit: float

    @property
    def determined(self) -> np.ndarray:
        """Which parameters the recordings determine, shape [parameter]: of others 0 and more than TYPICAL are as likely."""
        half = NINETY * self.deviations
        told = ~((half >= self.values) & (half > TYPICAL))
        told[0] = self.deviations[0] <= VAGUE * self.values[0]
        return told

    def interval(self, name: str) -> tuple[float, float]:
        """Return the bounds between which a parameter lies with 90 %."""
        i = PARAMETERS.index(name)
        low, high = (float(self.values[i] + sign * NINETY * self.deviations[i]) for sign in (-1.0, 1.0))
        return max(low, float(LOWER[i])), min(high, float(UPPER[i]))


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
