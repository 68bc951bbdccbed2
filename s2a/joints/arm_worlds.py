"""Joints that a robot's arm pulls, many at once, and the gradient of their motion by the set-points of the arm.

A world holds one body on its joint, as in `s2a.joints.joint_worlds`, moved by the same solver against the same resistance. What
pulls is an arm with a position controller (`s2a.joints.pulled`): m a = F - d v - f(v) - k s, F = K(s) (u - s) - D(s) v - M(s) a.
"""

from __future__ import annotations

from collections.abc import Sequence

import newton
import numpy as np
import warp as wp

from s2a.joints.arm_kernels import Arms, Rolled, pull
from s2a.joints.joint_worlds import joint_model
from s2a.joints.pulled import Pulled


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
