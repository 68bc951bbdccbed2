"""Joints that are pulled, many at once, and the gradient of how well their dynamics explain it.

A world holds one body on its joint. Newton's Featherstone solver moves it, wp.Tape goes back; contacts are none. What resists is
a kernel here: m a = F - d v - f(v) - k s, all at the grasp point, s its path. Mass is a factor of the stage's; the other forces
are divided by it, so that one model of unit factor serves all.

The force that drives a world is measured, with noise whose double integral would soon outweigh that of the positions. So samples
correct the world as a steady Kalman filter would; what it had predicted wrongly, the innovation, is white where the dynamics are
right, and its sum of squares is the loss (prediction-error method: Ljung, System Identification, 2nd ed., chapter 7).
"""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
from collections.abc import Sequence
from dataclasses import dataclass

import newton
import numpy as np
import warp as wp
from scipy.linalg import solve_discrete_are
from scipy.spatial.transform import Rotation

from s2a.articulation import lever_arm, open_limit
from s2a.diff.pull import Noise, Pull
from s2a.scene import Joint
from s2a.usd.sim_scene import Mass, SimRoom
from s2a.usd.sim_stage import GRAVITY

PARAMETERS = ("mass", "damping", "friction", "breakaway", "spring")
"""Factor of the stage's mass; [N s/m]; dry friction in motion [N]; how much more of it at rest [N]; closing spring [N/m]."""
SHARPNESS = wp.constant(6.0)
"""How sharply dry friction goes over from what holds a body to what it is in motion; an infinite one is Coulomb's law."""
STRIBECK = wp.constant(0.05)
"""[m/s] From rest, where it is greatest, dry friction falls to that in motion: exp(-(v / STRIBECK)^2)."""
RATE = 120.0
"""[Hz] Physics steps are no longer than this."""


@dataclass(frozen=True)
class Moving:
    """A body that moves on its joint.

    Attributes:
        joint: scene coordinates.
        mass: of all that moves, in the same frame.
        point: grasp point [m], shape [3].
    """

    joint: Joint
    mass: Mass
    point: np.ndarray

    @property
    def lever(self) -> float:
        """Path of the grasp point by the joint's coordinate, with the sign of opening [1 or m]."""
        return float(np.copysign(lever_arm(self.joint, self.point), open_limit(self.joint)))

    @property
    def inertia(self) -> float:
        """Mass at the grasp point that resists like the body [kg]."""
        if self.joint.kind == "prismatic":
            return self.mass.mass
        axis = np.array(self.joint.axis)
        arm = np.cross(np.array(self.mass.center) - self.joint.origin, axis)
        return float((axis @ _inertia(self.mass) @ axis + self.mass.mass * arm @ arm) / self.lever**2)

    @property
    def gravity(self) -> tuple[float, float]:
        """Force of the weight along the path of the grasp point [N]: the first number times cos q, plus the second times sin q.

        For a slide q counts as 0.
        """
        weight, axis = -self.mass.mass * GRAVITY / self.lever, np.array(self.joint.axis)
        if self.joint.kind == "prismatic":
            return weight * axis[2], 0.0
        first = np.cross(axis, np.array(self.mass.center) - self.joint.origin)
        return weight * first[2], weight * np.cross(axis, first)[2]


def moving(room: SimRoom, part: str) -> Moving:
    """Return an articulated part of a room as a body on its joint; what carries it stands still."""
    found = room.articulations[part]
    return Moving(found.joint, room.bodies[part].mass, np.array(found.grasp.point))


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
    u, slow = damped * (1.0 + half) / inverse, damped / STRIBECK
    most = friction + breakaway * wp.exp(-slow * slow) + 1.0e-4
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
    force = wp.where(wp.isnan(pulled), 0.0, pulled) - parameters[joint, 4] * s
    inverse = dt / (parameters[joint, 0] * r.inertia[world])
    turn, g = r.turns[world] * joint_q[world], r.gravity[world]
    weight = parameters[joint, 0] * (g[0] * wp.cos(turn) + g[1] * wp.sin(turn))  # the solver adds it by itself
    free = v + inverse * (force + weight)
    force -= resisted(v, free, inverse, parameters[joint, 1], parameters[joint, 2], parameters[joint, 3])
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


class JointWorlds:
    """Recorded pulls of many joints, a world each.

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
            self._model = _model([bodies[i] for i in owner], device)
            # A joint's inertia never changes; made once it is in the tape once, as the solver's one buffer demands.
            self._solver = newton.solvers.SolverFeatherstone(self._model, update_mass_matrix_interval=2**31)
            self._record = _record(bodies, [pull for own in pulls for pull in own], owner, step, noise)
            samples = self._record.opening.shape[0]
            self._starts = [self._model.state(requires_grad=True) for _ in range(samples)]
            self._moved = [
                [self._model.state(requires_grad=True) for _ in range(self._substeps)] for _ in range(samples - 1)
            ]
            self._controls = [[self._model.control() for _ in each] for each in self._moved]
            first = self._record.opening.numpy()[0] / self._record.lever.numpy()
            self._starts[0].joint_q.assign(first.astype(np.float32))

    def loss(self, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return each joint's loss, shape [joint], and its gradient, shape [joint parameter].

        Args:
            parameters: PARAMETERS, shape [joint parameter].
        """
        given = wp.array(parameters.astype(np.float32), dtype=float, device=self._model.device, requires_grad=True)
        loss = wp.zeros(self.joints, dtype=float, device=self._model.device, requires_grad=True)
        self.evaluations += 1
        with wp.Tape() as tape:
            self._roll(given, loss)
        tape.backward(grads={loss: wp.ones_like(loss, requires_grad=False)})
        found = loss.numpy().astype(float), given.grad.numpy().astype(float)
        tape.zero()
        return found

    def _roll(self, parameters: wp.array, loss: wp.array) -> None:
        """Move all worlds through their recordings."""
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


def _model(bodies: Sequence[Moving], device: str) -> newton.Model:
    """Return a model with a world for each body."""
    builder = newton.ModelBuilder()
    for body in bodies:
        builder.begin_world()
        joint, origin = body.joint, wp.transform(wp.vec3(*body.joint.origin), wp.quat_identity())
        link = builder.add_link(
            mass=body.mass.mass, com=wp.vec3(*body.mass.center), inertia=wp.mat33(*_inertia(body.mass).ravel())
        )
        add = builder.add_joint_prismatic if joint.kind == "prismatic" else builder.add_joint_revolute
        free = {"limit_lower": -1e6, "limit_upper": 1e6, "limit_ke": 0.0, "limit_kd": 0.0}
        index = add(-1, link, axis=wp.vec3(*joint.axis), parent_xform=origin, child_xform=origin, **free)
        builder.add_articulation([index])
        builder.end_world()
    return builder.finalize(device=device, requires_grad=True)


def _inertia(mass: Mass) -> np.ndarray:
    """Return the inertia about the centre of mass [kg m^2], shape [3 3], in the body's frame."""
    axes = Rotation.from_quat(mass.axes).as_matrix()
    return axes @ np.diag(mass.inertia) @ axes.T


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
    r.lever = wp.array([bodies[i].lever for i in owner], dtype=float)
    r.inertia = wp.array([bodies[i].inertia for i in owner], dtype=float)
    r.turns = wp.array([float(bodies[i].joint.kind == "revolute") for i in owner], dtype=float)
    r.gravity = wp.array([bodies[i].gravity for i in owner], dtype=wp.vec2)
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
