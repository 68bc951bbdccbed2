"""The dynamics of a joint: what is known of them, and the layer that stores them over a room."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import warp as wp
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

from s2a.scene.usd import joints
from s2a.scene.usd.joints import Resistance
from s2a.scene.usd.sim_scene import Mass
from s2a.scene.usd.stage import ROOT, save_layer, write_attribute
from s2a.sim.resistance import engaged, held

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".


PARAMETERS = ("mass", "damping", "friction", "breakaway", "spring", "pull_in", "closing")
"""Factor of the stage's mass; [N s/m]; dry friction in motion [N]; how much more of it at rest [N]; closing spring [N/m]; of a
soft close: the force with which it draws the part in [N], its damping while the part closes [N s/m]."""
SHARPNESS = wp.constant(6.0)
"""How sharply dry friction goes over from what holds a body to what it is in motion; an infinite one is Coulomb's law."""


@wp.struct
class Recordings:
    """Recorded pulls, a world each.

    Attributes:
        opening, force: shape [sample world]; NaN past a recording's end.
        joint: index of each world's joint, shape [world].
        lever: path of the grasp point by the coordinate, shape [world].
        inertia: mass at the grasp point, of the stage's mass [kg], shape [world].
        turns: 1 for a hinge, 0 for a slide, shape [world].
        gravity: force along the path [N], of the stage's mass: g0 cos(turns q) + g1 sin(turns q), shape [world] of vec2.
        reach: opening below which a soft close acts [m], shape [world].
        gain: corrections of opening [1] and speed [1/s] by innovation, shape [world 2].
        weight: 1 / (2 variance) of an innovation [1/m^2], shape [world].
    """

    opening: wp.array2d(dtype=float)
    force: wp.array2d(dtype=float)
    joint: wp.array(dtype=int)
    lever: wp.array(dtype=float)
    inertia: wp.array(dtype=float)
    turns: wp.array(dtype=float)
    gravity: wp.array(dtype=wp.vec2)
    reach: wp.array(dtype=float)
    gain: wp.array2d(dtype=float)
    weight: wp.array(dtype=float)


@wp.func
def resisted(before: float, free: float, inverse: float, damping: float, friction: float, breakaway: float):
    """Return the mean force [N] of damping and dry friction in a step, against a motion at the grasp point.

    Damping acts on the mean of the speeds before and after: a light body stays stable, and a damped one does not seem to have
    another mass; then dry friction, which stops the body at most: u f / (u^n + f^n)^(1/n), u being the force that stops it.

    Args:
        before: speed before the step [m/s].
        free: speed after it without damping and friction [m/s].
        inverse: length of the step over the mass [s/kg].
        damping: [N s/m].
        friction: in motion [N].
        breakaway: how much more at rest [N].
    """
    half = 0.5 * inverse * damping
    damped = (free - half * before) / (1.0 + half)
    u = damped * (1.0 + half) / inverse
    most = friction + breakaway * held(damped) + 1.0e-4
    both = wp.pow(wp.pow(wp.abs(u), SHARPNESS) + wp.pow(most, SHARPNESS), 1.0 / SHARPNESS)
    return (free - damped) / inverse + u * most / both / (1.0 + half)


@wp.kernel
def drive(
    r: Recordings,
    parameters: wp.array2d(dtype=float),
    sample: int,
    later: float,
    dt: float,
    joint_q: wp.array(dtype=float),
    joint_qd: wp.array(dtype=float),
    joint_f: wp.array(dtype=float),
):
    """Set the joint's force of a physics step that begins `later` after a sample, in times between samples.

    The body has the stage's own mass. Velocities are those of half a step before (the solver's Euler steps are then a leapfrog),
    which makes openings accurate to the second order.
    """
    world = wp.tid()
    joint, lever = r.joint[world], r.lever[world]
    s, v = joint_q[world] * lever, joint_qd[world] * lever
    pulled = (1.0 - later) * r.force[sample, world] + later * r.force[sample + 1, world]
    acts = engaged(s, r.reach[world])
    force = wp.where(wp.isnan(pulled), 0.0, pulled) - parameters[joint, 4] * s - parameters[joint, 5] * acts
    inverse = dt / (parameters[joint, 0] * r.inertia[world])
    turn, g = r.turns[world] * joint_q[world], r.gravity[world]
    weight = parameters[joint, 0] * (g[0] * wp.cos(turn) + g[1] * wp.sin(turn))  # the solver adds it by itself
    free = v + inverse * (force + weight)
    damping = parameters[joint, 1] + wp.where(v < 0.0, parameters[joint, 6] * acts, 0.0)
    force -= resisted(v, free, inverse, damping, parameters[joint, 2], parameters[joint, 3])
    joint_f[world] = force * lever / parameters[joint, 0]


@wp.kernel
def correct(
    r: Recordings,
    sample: int,
    joint_q: wp.array(dtype=float),
    joint_qd: wp.array(dtype=float),
    next_q: wp.array(dtype=float),
    next_qd: wp.array(dtype=float),
    loss: wp.array(dtype=float),
):
    """Compare a world with a sample, add to its joint's loss, and correct it."""
    world = wp.tid()
    lever, seen = r.lever[world], r.opening[sample, world]
    missed = wp.where(wp.isnan(seen), 0.0, seen - joint_q[world] * lever)
    wp.atomic_add(loss, r.joint[world], r.weight[world] * missed * missed)
    next_q[world] = joint_q[world] + r.gain[world, 0] * missed / lever
    next_qd[world] = joint_qd[world] + r.gain[world, 1] * missed / lever


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
    joints.write_resistance(joint, resistance)
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(stage.GetRootLayer())  # a layer alone opens nothing that it names
    layer.subLayerPaths.append(below)
    save_layer(layer, path)
