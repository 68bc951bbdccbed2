"""Joints that are pulled, many at once, and the gradient of how well their dynamics explain it.

A world holds one body on its joint. Newton's Featherstone solver moves it, wp.Tape goes back; contacts are none. What resists is
a kernel here: m a = F - d v - f(v) - k s, all at the grasp point, s its path; near shut a soft close adds its force and, while
the part closes, its damping. Mass is a factor of the stage's; the other forces are divided by it, so that one model of unit
factor serves all.

The force that drives a world is measured, with noise whose double integral would soon outweigh that of the positions. So samples
correct the world as a steady Kalman filter would; what it had predicted wrongly, the innovation, is white where the dynamics are
right, and its sum of squares is the loss (prediction-error method: Ljung, System Identification, 2nd ed., chapter 7).
"""

from __future__ import annotations

from collections.abc import Sequence

import newton
import numpy as np
import warp as wp
from scipy.linalg import solve_discrete_are

from s2a.joints.dynamics import PARAMETERS, Recordings, correct, drive
from s2a.joints.pull import Noise, Pull
from s2a.joints.pulled import Moving, inertia_tensor

RATE = 120.0
"""[Hz] Physics steps are no longer than this."""


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
            first = self._record.opening.numpy()[0] / self._record.lever.numpy()
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

        Args:
            parameters: PARAMETERS, shape [joint parameter].
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
    r.reach = wp.array([bodies[i].reach for i in owner], dtype=float)
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
