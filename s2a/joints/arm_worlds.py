"""Joints that a robot's arm pulls, many at once, and the gradient of their motion by the set-points of the arm.

A world holds one body on its joint, as in `s2a.joints.joint_worlds`, moved by the same solver against the same resistance. What
pulls is an arm with a position controller (`s2a.joints.pulled`): m a = F - d v - f(v) - k s, F = K(s) (u - s) - D(s) v - M(s) a.
"""

from collections.abc import Sequence

import newton
import numpy as np
import warp as wp

from s2a.joints.dynamics import resisted
from s2a.joints.joint_worlds import joint_model
from s2a.joints.pulled import Pulled
from s2a.sim.resistance import engaged

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".


STOP = wp.constant(2.0e4)
"""[N/m] Of the stop of a closed part."""
STOP_DAMPING = wp.constant(1.0e6)
"""[N s/m^2] Of the same, by its depth (Hunt and Crossley's contact, which begins without a jump): nothing bounces off it."""


@wp.struct
class Arms:
    """Bodies on their joints and the arms that pull them, a world each; all at the grasp point, s its path [m].

    Attributes:
        lever: path of the grasp point by the coordinate, shape [world].
        inertia: mass at the grasp point, of the stage's mass [kg], shape [world].
        turns: 1 for a hinge, 0 for a slide, shape [world].
        gravity: force along the path [N], of the stage's mass: g0 cos(turns q) + g1 sin(turns q), shape [world] of vec2.
        dynamics: joint_kernels.PARAMETERS, shape [world parameter].
        reach: opening below which a soft close acts [m], shape [world].
        arm: of the arm along the path at even places: stiffness [N/m], damping [N s/m], mass [kg], shape [world place] of vec3.
        spacing: between the places [m], shape [world].
    """

    lever: wp.array(dtype=float)
    inertia: wp.array(dtype=float)
    turns: wp.array(dtype=float)
    gravity: wp.array(dtype=wp.vec2)
    dynamics: wp.array2d(dtype=float)
    reach: wp.array(dtype=float)
    arm: wp.array2d(dtype=wp.vec3)
    spacing: wp.array(dtype=float)


@wp.struct
class Rolled:
    """How the worlds moved.

    Attributes:
        opening: at the beginning of a step [m], shape [step world].
        speed: at its end [m/s], shape [step world].
        force: of the gripper on the handle, along the path [N], shape [step world].
    """

    opening: wp.array2d(dtype=float)
    speed: wp.array2d(dtype=float)
    force: wp.array2d(dtype=float)


@wp.func
def arm_at(h: Arms, world: int, s: float):
    """Return stiffness, damping and mass of the arm where the grasp point is."""
    last = h.arm.shape[1] - 2
    at = wp.clamp(s / h.spacing[world], 0.0, float(last + 1))
    i = wp.min(int(at), last)
    return wp.lerp(h.arm[world, i], h.arm[world, i + 1], at - float(i))


@wp.kernel
def pull(
    h: Arms,
    setpoint: wp.array2d(dtype=float),
    step: int,
    dt: float,
    joint_q: wp.array(dtype=float),
    joint_qd: wp.array(dtype=float),
    joint_f: wp.array(dtype=float),
    moved: Rolled,
):
    """Set the joint's force of a physics step in which the arm pulls the part to a set-point, and keep how both move.

    Arm and part move as one body, M + m at the grasp point; the solver's has the stage's mass m alone, so that the joint's force
    gives it the acceleration of both. Velocities are those of half a step before; see `joint_kernels.drive`.
    """
    world = wp.tid()
    lever, mass = h.lever[world], h.dynamics[world, 0] * h.inertia[world]
    s, v, arm = joint_q[world] * lever, joint_qd[world] * lever, arm_at(h, world, joint_q[world] * lever)
    turn, g = h.turns[world] * joint_q[world], h.gravity[world]
    weight = g[0] * wp.cos(turn) + g[1] * wp.sin(turn)
    pulled = arm[0] * (setpoint[step, world] - s)
    force = pulled + h.dynamics[world, 0] * weight - h.dynamics[world, 4] * s + STOP * wp.max(-s, 0.0)
    acts = engaged(s, h.reach[world])
    force -= acts * h.dynamics[world, 5]
    inverse = dt / (mass + arm[2])
    damping, friction, breakaway = h.dynamics[world, 1] + arm[1], h.dynamics[world, 2], h.dynamics[world, 3]
    damping += wp.where(v < 0.0, acts * h.dynamics[world, 6], 0.0) + STOP_DAMPING * wp.max(-s, 0.0)
    force -= resisted(v, v + inverse * force, inverse, damping, friction, breakaway)
    a = force / (mass + arm[2])
    moved.opening[step, world] = s
    moved.speed[step, world] = v + dt * a
    moved.force[step, world] = pulled - arm[1] * (v + 0.5 * dt * a) - arm[2] * a
    joint_f[world] = (h.inertia[world] * a - weight) * lever  # the solver adds the weight by itself


class ArmWorlds:
    """Parts that arms pull, a world each, all at rest at first: closed, or as far open as they are closed by.

    Attributes:
        dt: length of a physics step, which has one set-point [s].
    """

    def __init__(self, pulled: Sequence[Pulled], steps: int, dt: float, device: str = "cpu") -> None:
        """Build a world for each part, for motions of so many steps."""
        self.dt, self._steps, shape = dt, steps, (steps, len(pulled))
        self._start = np.array([each.goal if each.closing else 0.0 for each in pulled])
        self._sign = np.array([-1.0 if each.closing else 1.0 for each in pulled])
        with wp.ScopedDevice(device):
            self._model = joint_model([each.body for each in pulled], device)
            # As in JointWorlds: made once, the mass matrix is in the tape once.
            self._solver = newton.solvers.SolverFeatherstone(self._model, update_mass_matrix_interval=2**31)
            self._arms, self._moved = _arms(pulled), Rolled()
            for name in ("opening", "speed", "force"):
                setattr(self._moved, name, wp.zeros(shape, dtype=float, requires_grad=True))
            self._setpoint = wp.zeros(shape, dtype=float, requires_grad=True)
            self._states = [self._model.state(requires_grad=True) for _ in range(steps + 1)]
            lever, start = np.array([each.body.lever for each in pulled]), self._start
            self._states[0].joint_q.assign((start / lever).astype(np.float32))
            self._controls = [self._model.control() for _ in range(steps)]
            self._by = [wp.zeros(shape, dtype=float) for _ in range(3)]
            self._gradient = wp.zeros(shape, dtype=float)
            self._back(self._forth())  # loads every kernel, which capture forbids
            with wp.ScopedCapture() as forth:
                tape = self._forth()
            with wp.ScopedCapture() as back:
                self._back(tape)
        self._graphs = forth.graph, back.graph

    def roll(self, setpoint: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return path [m] and speed [m/s] of the parts and force on their handles along it [N], shape [step world] each.

        Args:
            setpoint: path of the arm's set-point [m], from where the part begins, shape [step world].
        """
        self._setpoint.assign((self._start + self._sign * setpoint).astype(np.float32))
        wp.capture_launch(self._graphs[0])
        opening, speed, force = (x.numpy() for x in (self._moved.opening, self._moved.speed, self._moved.force))
        return self._sign * (opening - self._start), self._sign * speed, self._sign * force

    def back(self, path: np.ndarray, speed: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Return the derivative of a loss by the set-points, shape [step world], from those by what `roll` returned last."""
        for array, given in zip(self._by, (path, speed, force), strict=True):
            array.assign((self._sign * given).astype(np.float32))
        wp.capture_launch(self._graphs[1])
        return self._sign * self._gradient.numpy()

    def _forth(self) -> wp.Tape:
        self._solver._step = 0  # the mass matrix is made in the first step, which the tape has to see
        with wp.Tape() as tape:
            self._move()
        return tape

    def _back(self, tape: wp.Tape) -> None:
        moved = self._moved
        tape.backward(grads=dict(zip((moved.opening, moved.speed, moved.force), self._by, strict=True)))
        wp.copy(self._gradient, self._setpoint.grad)
        tape.zero()

    def _move(self) -> None:
        with wp.ScopedDevice(self._model.device):
            for step, control in enumerate(self._controls):
                before, after = self._states[step], self._states[step + 1]
                inputs = [self._arms, self._setpoint, step, self.dt, before.joint_q, before.joint_qd, control.joint_f]
                wp.launch(pull, dim=self._model.world_count, inputs=[*inputs, self._moved])
                self._solver.step(before, after, control, None, self.dt)


def _arms(pulled: Sequence[Pulled]) -> Arms:
    """Return bodies and arms as arrays; the arms at as many even places as the most have."""
    bodies, arms, h = [each.body for each in pulled], [each.arm for each in pulled], Arms()
    count = max(len(arm.path) for arm in arms)
    rows = []
    for arm, closing in zip(arms, (each.closing for each in pulled), strict=True):
        even = np.linspace(0.0, arm.path[-1], count)
        row = np.array([np.interp(even, arm.path, each) for each in (arm.stiffness, arm.damping, arm.mass)])
        rows.append(row[:, ::-1] if closing else row)  # by the opening, which falls along a path that closes
    h.lever = wp.array([body.lever for body in bodies], dtype=float)
    h.inertia = wp.array([body.inertia for body in bodies], dtype=float)
    h.turns = wp.array([float(body.joint.kind == "revolute") for body in bodies], dtype=float)
    h.gravity = wp.array([body.gravity for body in bodies], dtype=wp.vec2)
    h.reach = wp.array([body.reach for body in bodies], dtype=float)
    h.dynamics = wp.array(np.array([each.dynamics for each in pulled]), dtype=float)
    h.arm = wp.array(np.array(rows).transpose(0, 2, 1), dtype=wp.vec3)
    h.spacing = wp.array([arm.path[-1] / (count - 1) for arm in arms], dtype=float)
    return h
