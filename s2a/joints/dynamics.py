"""The dynamics of a joint: recorded pulls, many at once, how well parameters explain them, and the layer over a room."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import newton
import numpy as np
import warp as wp
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics
from scipy.linalg import solve_discrete_are

from s2a.joints.pull import Noise, Pull
from s2a.joints.pulled import Moving, inertia_tensor
from s2a.scene.usd import joints
from s2a.scene.usd.joints import Resistance
from s2a.scene.usd.sim_scene import Mass
from s2a.scene.usd.stage import ROOT, referable, save_layer, write_attribute
from s2a.sim.solver import engaged, held

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".


# Factor of the stage's mass; [N s/m]; dry friction in motion [N]; how much more of it at rest [N]; closing spring
# [N/m]; of a soft close: the force with which it draws the part in [N], its damping while the part closes [N s/m]
PARAMETERS = ("mass", "damping", "friction", "breakaway", "spring", "pull_in", "closing")
# How sharply dry friction goes over from what holds a body to what it is in motion; an infinite one is Coulomb's law
SHARPNESS = wp.constant(6.0)


@wp.struct
class Bodies:
    """Bodies on their joints, a world each, as they are at the grasp point."""

    lever: wp.array(dtype=float)  # path of the grasp point by the coordinate, shape [world]
    inertia: wp.array(dtype=float)  # mass at the grasp point, of the stage's mass [kg], shape [world]
    turns: wp.array(dtype=float)  # 1 for a hinge, 0 for a slide, shape [world]
    # force along the path [N], of the stage's mass: g0 cos(turns q) + g1 sin(turns q), shape [world] of vec2
    gravity: wp.array(dtype=wp.vec2)
    reach: wp.array(dtype=float)  # opening below which a soft close acts [m], shape [world]


@wp.struct
class Recordings:
    """Recorded pulls, a world each."""

    bodies: Bodies  # that were pulled
    # opening, force: shape [sample world]; NaN past a recording's end
    opening: wp.array2d(dtype=float)
    force: wp.array2d(dtype=float)
    joint: wp.array(dtype=int)  # index of each world's joint, shape [world]
    gain: wp.array2d(dtype=float)  # corrections of opening [1] and speed [1/s] by innovation, shape [world 2]
    weight: wp.array(dtype=float)  # 1 / (2 variance) of an innovation [1/m^2], shape [world]


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


@wp.func
def weight_of(bodies: Bodies, world: int, q: float):
    """Return the force of a body's weight along the path of its grasp point [N], of the stage's mass."""
    turn, g = bodies.turns[world] * q, bodies.gravity[world]
    return g[0] * wp.cos(turn) + g[1] * wp.sin(turn)


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
    joint, lever = r.joint[world], r.bodies.lever[world]
    s, v = joint_q[world] * lever, joint_qd[world] * lever
    pulled = (1.0 - later) * r.force[sample, world] + later * r.force[sample + 1, world]
    acts = engaged(s, r.bodies.reach[world])
    force = wp.where(wp.isnan(pulled), 0.0, pulled) - parameters[joint, 4] * s - parameters[joint, 5] * acts
    inverse = dt / (parameters[joint, 0] * r.bodies.inertia[world])
    weight = parameters[joint, 0] * weight_of(r.bodies, world, joint_q[world])  # the solver adds it by itself
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
    lever, seen = r.bodies.lever[world], r.opening[sample, world]
    missed = wp.where(wp.isnan(seen), 0.0, seen - joint_q[world] * lever)
    wp.atomic_add(loss, r.joint[world], r.weight[world] * missed * missed)
    next_q[world] = joint_q[world] + r.gain[world, 0] * missed / lever
    next_qd[world] = joint_qd[world] + r.gain[world, 1] * missed / lever


# Of PARAMETERS: unit of the variables that are searched, but for the mass, whose variable is its logarithm
TYPICAL = np.array([1.0, 5.0, 2.0, 1.0, 10.0, 5.0, 20.0])
LOWER = np.array([0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
UPPER = np.array([20.0, 200.0, 100.0, 50.0, 500.0, 100.0, 1000.0])
VAGUE = 0.5  # Relative deviation of a mass that tells nothing
NINETY = 1.6449  # Standard deviations of a normal distribution on either side of its mean that hold 90 %


@dataclass(frozen=True)
class Dynamics:
    """What resists at a joint's grasp point, as PARAMETERS name it."""

    values: np.ndarray  # shape [parameter]
    deviations: np.ndarray  # standard deviations, shape [parameter]; infinite where the recordings do not tell
    # mean square of the innovations over their expected variance: 1 where the model and the noise are right
    misfit: float

    @property
    def determined(self) -> np.ndarray:
        """Which parameters the recordings determine, shape [parameter]: of others 0 and more than TYPICAL are as likely."""
        half = NINETY * self.deviations
        narrow = ~((half >= self.values) & (half > TYPICAL))
        narrow[0] = self.deviations[0] <= VAGUE * self.values[0]
        return narrow

    def interval(self, name: str) -> tuple[float, float]:
        """Return the bounds between which a parameter lies with 90 %."""
        i = PARAMETERS.index(name)
        low, high = (float(self.values[i] + sign * NINETY * self.deviations[i]) for sign in (-1.0, 1.0))
        return max(low, float(LOWER[i])), min(high, float(UPPER[i]))


def scaled(mass: Mass, factor: float) -> Mass:
    """Return a mass of another size and the same shape."""
    x, y, z = mass.inertia
    inertia = x * factor, y * factor, z * factor
    return replace(mass, mass=mass.mass * factor, inertia=inertia, source="identified")


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
    layer.subLayerPaths.append(referable(below))
    save_layer(layer, path)


RATE = 120.0  # [Hz] Physics steps are no longer than this


class JointWorlds:
    """Recorded pulls of many joints, a world each, and the gradient of how well their dynamics explain them.

    A world holds one body on its joint. Newton's Featherstone solver moves it, wp.Tape goes back; contacts are none. What resists
    is a kernel here: m a = F - d v - f(v) - k s, all at the grasp point, s its path; near shut a soft close adds its force and,
    while the part closes, its damping. Mass is a factor of the stage's; the other forces are divided by it, so that one model of
    unit factor serves all.

    The force that drives a world is measured, with noise whose double integral would soon outweigh that of the positions. So
    samples correct the world as a steady Kalman filter would; what it had predicted wrongly, the innovation, is white where
    the dynamics are right, and its sum of squares is the loss (prediction-error method: Ljung, System Identification, 2nd ed.,
    chapter 7).

    Attributes:
        joints: number of joints.
        evaluations: how often the loss was asked for.
    """

    def __init__(
        self, bodies: Sequence[Moving], pulls: Sequence[Sequence[Pull]], step: float, noise: Noise, device: str = "cpu"
    ) -> None:
        """Build a world for each pull of each body; `step` is the time between samples [s]."""
        self.joints, self.evaluations = len(bodies), 0
        owner = [i for i, own in enumerate(pulls) for _ in own]
        self._substeps = max(1, int(np.ceil(step * RATE - 1e-6)))
        self._dt = step / self._substeps
        with wp.ScopedDevice(device):
            self._model = joint_model([bodies[i] for i in owner], device)
            # A joint's inertia never changes; made once it is in the tape once, as the solver's one buffer demands.
            self._solver = newton.solvers.SolverFeatherstone(self._model, update_mass_matrix_interval=2**31)
            self._record = _record(bodies, [pull for own in pulls for pull in own], owner, step, noise)
            samples = self._record.opening.shape[0]
            self._starts = [self._model.state(requires_grad=True) for _ in range(samples)]
            self._moved = [
                [self._model.state(requires_grad=True) for _ in range(self._substeps)] for _ in range(samples - 1)
            ]
            self._controls = [[self._model.control() for _ in each] for each in self._moved]
            first = self._record.opening.numpy()[0] / [bodies[i].lever for i in owner]
            self._starts[0].joint_q.assign(first.astype(np.float32))
            self._given = wp.zeros((self.joints, len(PARAMETERS)), dtype=float, requires_grad=True)
            self._loss = wp.zeros(self.joints, dtype=float, requires_grad=True)
            self._gradient, self._ones = wp.zeros_like(self._given, requires_grad=False), wp.full(self.joints, 1.0)
            self._differentiate()  # loads every kernel, which capture forbids
            with wp.ScopedCapture() as capture:
                self._differentiate()
        self._graph = capture.graph

    def loss(self, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return each joint's loss, shape [joint], and its gradient, shape [joint parameter].

        `parameters`: PARAMETERS, shape [joint parameter].
        """
        self.evaluations += 1
        self._given.assign(parameters.astype(np.float32))
        wp.capture_launch(self._graph)  # some ten thousand launches: from Python fifty times as long, on a CPU too
        return self._loss.numpy().astype(float), self._gradient.numpy().astype(float)

    def _differentiate(self) -> None:
        """Roll all worlds forth and back, from the given parameters to the gradient."""
        self._loss.zero_()
        with wp.Tape() as tape:
            self._roll(self._given, self._loss)
        tape.backward(grads={self._loss: self._ones})
        wp.copy(self._gradient, self._given.grad)
        tape.zero()

    def _roll(self, parameters: wp.array, loss: wp.array) -> None:
        self._solver._step = 0  # the mass matrix is made in the first step, which the tape has to see
        with wp.ScopedDevice(self._model.device):
            for sample, (between, controls) in enumerate(zip(self._moved, self._controls, strict=True)):
                state = self._starts[sample]
                for i, (moved, control) in enumerate(zip(between, controls, strict=True)):
                    later = i / self._substeps
                    self._launch(
                        drive, parameters, sample, later, self._dt, state.joint_q, state.joint_qd, control.joint_f
                    )
                    self._solver.step(state, moved, control, None, self._dt)
                    state = moved
                later = self._starts[sample + 1]
                self._launch(correct, sample + 1, state.joint_q, state.joint_qd, later.joint_q, later.joint_qd, loss)

    def _launch(self, kernel: wp.Kernel, *inputs: object) -> None:
        wp.launch(kernel, dim=self._model.world_count, inputs=[self._record, *inputs])


def joint_model(bodies: Sequence[Moving], device: str) -> newton.Model:
    """Return a model with a world for each body."""
    builder = newton.ModelBuilder()
    for body in bodies:
        builder.begin_world()
        joint, origin = body.joint, wp.transform(wp.vec3(*body.joint.origin), wp.quat_identity())
        link = builder.add_link(
            mass=body.mass.mass, com=wp.vec3(*body.mass.center), inertia=wp.mat33(*inertia_tensor(body.mass).ravel())
        )
        add = builder.add_joint_prismatic if joint.kind == "prismatic" else builder.add_joint_revolute
        free = {"limit_lower": -1e6, "limit_upper": 1e6, "limit_ke": 0.0, "limit_kd": 0.0}
        index = add(-1, link, axis=wp.vec3(*joint.axis), parent_xform=origin, child_xform=origin, **free)
        builder.add_articulation([index])
        builder.end_world()
    return builder.finalize(device=device, requires_grad=True)


def bodies_at_grasp(bodies: Sequence[Moving]) -> Bodies:
    """Return bodies as arrays, a world each."""
    b = Bodies()
    b.lever = wp.array([body.lever for body in bodies], dtype=float)
    b.inertia = wp.array([body.inertia for body in bodies], dtype=float)
    b.turns = wp.array([float(body.joint.kind == "revolute") for body in bodies], dtype=float)
    b.gravity = wp.array([body.gravity for body in bodies], dtype=wp.vec2)
    b.reach = wp.array([body.reach for body in bodies], dtype=float)
    return b


def _record(
    bodies: Sequence[Moving], pulls: Sequence[Pull], owner: Sequence[int], step: float, noise: Noise
) -> Recordings:
    """Return recordings as arrays, with the filter of each."""
    longest = max(len(pull.opening) for pull in pulls)
    opening, force = np.full((2, longest, len(pulls)), np.nan, np.float32)
    for i, pull in enumerate(pulls):
        opening[: len(pull.opening), i], force[: len(pull.force), i] = pull.opening, pull.force
    filters = np.array([kalman(bodies[i].inertia, step, noise) for i in owner])
    r = Recordings()
    r.opening, r.force = wp.array(opening, dtype=float), wp.array(force, dtype=float)
    r.joint = wp.array(owner, dtype=int)
    r.bodies = bodies_at_grasp([bodies[i] for i in owner])
    r.gain = wp.array(filters[:, :2], dtype=float)
    r.weight = wp.array(0.5 / filters[:, 2], dtype=float)
    return r


def kalman(mass: float, step: float, noise: Noise) -> tuple[float, float, float]:
    """Return the steady filter of a mass [kg] whose force and opening are known but for noise.

    Args:
        mass: at the grasp point.
        step: between samples [s].
        noise: of force and opening.

    Returns:
        Correction of opening [1] and speed [1/s] by innovation; variance of the innovation [m^2].
    """
    moves = np.array([[1.0, step], [0.0, 1.0]])
    pushed = np.array([step**2 / 2, step]) * noise.force / mass
    seen = np.array([[1.0, 0.0]])
    variance = np.array([[noise.opening**2]])
    tiny = np.diag([1e-14, 1e-12])
    prior = solve_discrete_are(moves.T, seen.T, np.outer(pushed, pushed) + tiny, variance)
    innovation = float((seen @ prior @ seen.T + variance)[0, 0])
    gain = prior[:, 0] / innovation
    return float(gain[0]), float(gain[1]), innovation
