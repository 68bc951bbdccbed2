"""Pulls by gradient: the set-points of an arm that bring parts to their goals at least cost."""

from collections.abc import Sequence
from dataclasses import dataclass

import newton
import numpy as np
import torch
import warp as wp
from scipy.interpolate import BSpline

from s2a.core.bounds import Count, NotNegative, Positive
from s2a.joints.dynamics import Bodies, bodies_at_grasp, joint_model, resisted, weight_of
from s2a.joints.identify import minimize_together
from s2a.joints.pulled import Pulled
from s2a.motion.trajectory import PullLaw, eased
from s2a.sim.solver import engaged

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".


STOP = wp.constant(2.0e4)  # [N/m] Of the stop of a closed part
# [N s/m^2] Of the same, by its depth (Hunt and Crossley's contact, which begins without a jump): nothing bounces off it
STOP_DAMPING = wp.constant(1.0e6)


@wp.struct
class Arms:
    """Bodies on their joints and the arms that pull them, a world each; all at the grasp point, s its path [m]."""

    bodies: Bodies  # that are pulled
    dynamics: wp.array2d(dtype=float)  # dynamics.PARAMETERS, shape [world parameter]
    # of the arm along the path at even places: stiffness [N/m], damping [N s/m], mass [kg], shape [world place] of vec3
    arm: wp.array2d(dtype=wp.vec3)
    spacing: wp.array(dtype=float)  # between the places [m], shape [world]


@wp.struct
class Rolled:
    """How the worlds moved."""

    opening: wp.array2d(dtype=float)  # at the beginning of a step [m], shape [step world]
    speed: wp.array2d(dtype=float)  # at its end [m/s], shape [step world]
    force: wp.array2d(dtype=float)  # of the gripper on the handle, along the path [N], shape [step world]


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
    gives it the acceleration of both. Velocities are those of half a step before; see `dynamics.drive`.
    """
    world = wp.tid()
    lever, inertia = h.bodies.lever[world], h.bodies.inertia[world]
    mass = h.dynamics[world, 0] * inertia
    s, v, arm = joint_q[world] * lever, joint_qd[world] * lever, arm_at(h, world, joint_q[world] * lever)
    weight = weight_of(h.bodies, world, joint_q[world])
    pulled = arm[0] * (setpoint[step, world] - s)
    force = pulled + h.dynamics[world, 0] * weight - h.dynamics[world, 4] * s + STOP * wp.max(-s, 0.0)
    acts = engaged(s, h.bodies.reach[world])
    force -= acts * h.dynamics[world, 5]
    inverse = dt / (mass + arm[2])
    damping, friction, breakaway = h.dynamics[world, 1] + arm[1], h.dynamics[world, 2], h.dynamics[world, 3]
    damping += wp.where(v < 0.0, acts * h.dynamics[world, 6], 0.0) + STOP_DAMPING * wp.max(-s, 0.0)
    force -= resisted(v, v + inverse * force, inverse, damping, friction, breakaway)
    a = force / (mass + arm[2])
    moved.opening[step, world] = s
    moved.speed[step, world] = v + dt * a
    moved.force[step, world] = pulled - arm[1] * (v + 0.5 * dt * a) - arm[2] * a
    joint_f[world] = (inertia * a - weight) * lever  # the solver adds the weight by itself


class ArmWorlds:
    """Parts that arms pull, a world each, all at rest at first: closed, or as far open as they are closed by.

    A world holds one body on its joint, as in `JointWorlds`, moved by the same solver against the same resistance. What pulls is
    an arm with a position controller (`pulled.Arm`): m a = F - d v - f(v) - k s, F = K(s) (u - s) - D(s) v - M(s) a.

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

        `setpoint`: path of the arm's set-point [m], from where the part begins, shape [step world].
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
    arms, h = [each.arm for each in pulled], Arms()
    count = max(len(arm.path) for arm in arms)
    rows = []
    for arm, closing in zip(arms, (each.closing for each in pulled), strict=True):
        even = np.linspace(0.0, arm.path[-1], count)
        row = np.array([np.interp(even, arm.path, each) for each in (arm.stiffness, arm.damping, arm.mass)])
        rows.append(row[:, ::-1] if closing else row)  # by the opening, which falls along a path that closes
    h.bodies = bodies_at_grasp([each.body for each in pulled])
    h.dynamics = wp.array(np.array([each.dynamics for each in pulled]), dtype=float)
    h.arm = wp.array(np.array(rows).transpose(0, 2, 1), dtype=wp.vec3)
    h.spacing = wp.array([arm.path[-1] / (count - 1) for arm in arms], dtype=float)
    return h


@dataclass(frozen=True, kw_only=True)
class PullConfig:
    """What a good pull is, and where it is looked for. Costs add up without a unit.

    Attributes:
        time: cost of a second until the set-point stands [1/s].
        energy: weight of the work done on the handle [1/J].
        peak: weight of the maximum force on the handle [1/N].
        rounds: evaluations of the loss and its gradient, at most.
    """

    time: NotNegative
    energy: NotNegative
    peak: NotNegative
    # distance from the goal that costs 1, root mean square from the end on [m]. Half a third of what a pull may miss
    end: Positive = 0.001
    end_speed: Positive = 0.005  # speed that costs 1, likewise [m/s]
    knots: Count = 16  # coefficients of the set-point's cubic B-spline
    min_seconds: Positive = 0.6  # time of the set-point's motion, at least [s]
    max_seconds: Positive = 4.0  # at most [s]; the same as `min_seconds` for a time that is given
    beyond: NotNegative = 0.03  # how far past the goal the set-point may go [m]
    # for how long after its motion the part shall stay at the goal [s]. The arm's own time constant is 0.2 s
    hold: Positive = 0.5
    rate: Positive = 60.0  # set-points a second [1/s], each for a step of physics. Of the controller
    rounds: Count


DEGREE = 3
NORM = 30.0  # The greatest force is the root of the mean of so high a power, which is smooth
SOON = 0.02  # [s] In which the end's cost sets in
ARREST = 0.1  # [s] A part that closes shall not be faster than its way to shut over this: it slams else
# Cost of a mean square of 1 by which the set-point exceeds the arm's speed and acceleration, in units of them
LIMIT = 1.0e3
ROOM = 0.9  # Fraction of them that is used: along a bent joint path there are further terms
SAMPLES = 200  # Of a spline, where it is looked up


class PullLoss:
    """The cost of pulls of many parts, a problem each.

    Attributes:
        variables: number of a problem's variables.
        evaluations: how often `__call__` was asked.
    """

    def __init__(
        self,
        pulled: Sequence[Pulled],
        config: PullConfig,
        seconds: np.ndarray | None = None,
        copies: int = 1,
        device: str = "cpu",
    ) -> None:
        """Build `copies` worlds for each part.

        Args:
            pulled: the parts.
            config: what a good pull is.
            seconds: given times, shape [problem]; None: free between the config's.
            copies: points of each problem that are evaluated at once.
            device: cpu or cuda:0.
        """
        self._config, self._copies, self.variables, self.evaluations = config, copies, config.knots - 2, 0
        bounds = (config.min_seconds, config.max_seconds)
        low, high = (np.full(len(pulled), x) if seconds is None else seconds for x in bounds)
        goal = np.array([each.goal for each in pulled])
        arms = [each.arm for each in pulled]
        end = goal - [each.offset for each in pulled]
        self._closing = torch.tensor(np.repeat([float(each.closing) for each in pulled], copies))
        columns = (low, high, goal, end, [arm.speed for arm in arms], [arm.acceleration for arm in arms])
        self._low, self._high, self._goal, self._end, self._speed, self._acceleration = (
            torch.tensor(np.repeat(np.asarray(x, float), copies)) for x in columns
        )
        steps = int(np.ceil((high.max() + config.hold) * config.rate))
        self._worlds = ArmWorlds([each for each in pulled for _ in range(copies)], steps, 1.0 / config.rate, device)
        self._begun = torch.arange(1, steps + 1, dtype=torch.float64)[:, None] / config.rate
        basis, time = _spline(config.knots), np.linspace(0.0, 1.0, SAMPLES)
        self._splines = tuple(torch.tensor((basis.derivative(i) if i else basis)(time)) for i in range(3))

    def __call__(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return costs, shape [point], and their gradients, shape [point variable], at points [point variable]."""
        self.evaluations += 1
        given = torch.tensor(x, requires_grad=True)
        seconds, path = self._law(given)
        setpoint = self._setpoints(seconds, path)
        moved = tuple(torch.tensor(y, requires_grad=True) for y in self._worlds.roll(setpoint.detach().numpy()))
        cost = self._cost(seconds, path, *moved)
        cost.sum().backward(retain_graph=True)
        by = self._worlds.back(*(y.grad.numpy() for y in moved))
        setpoint.backward(torch.tensor(by))
        return cost.detach().numpy(), given.grad.numpy()

    def costs(self, x: np.ndarray) -> np.ndarray:
        """Return costs alone, shape [point], at points [point variable]."""
        with torch.no_grad():
            seconds, path = self._law(torch.tensor(x))
            moved = self._worlds.roll(self._setpoints(seconds, path).numpy())
            return self._cost(seconds, path, *map(torch.tensor, moved)).numpy()

    def motions(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return openings [m], speeds [m/s] and forces [N] that the model predicts, shape [step point] each."""
        with torch.no_grad():
            return self._worlds.roll(self._setpoints(*self._law(torch.tensor(x))).numpy())

    def start(self) -> np.ndarray:
        """Return the point that is the planner's own ease to the goal, shape [point variable], in the middle of its times."""
        spline, time = self._splines[0].numpy(), np.linspace(0.0, 1.0, SAMPLES)
        free = np.concatenate([spline[:, 2:-2], spline[:, -2:].sum(axis=1, keepdims=True)], axis=1)
        shape = np.clip(np.linalg.lstsq(free, eased(time), rcond=None)[0], 0.0, 1.0)
        fraction = (self._goal / (self._goal + self._config.beyond)).numpy()
        return np.concatenate([np.full((len(fraction), 1), 0.5), fraction[:, None] * shape], axis=1)

    def laws(self, x: np.ndarray) -> list[PullLaw]:
        """Return the time laws of points [point variable], with a sample for each set-point or more."""
        with torch.no_grad():
            seconds, path = self._law(torch.tensor(x))
        spline = _spline(self._config.knots)
        laws = []
        for time, coefficients, goal in zip(seconds.tolist(), path.numpy(), self._goal.tolist(), strict=True):
            at = np.linspace(0.0, 1.0, int(np.ceil(time * self._config.rate)) + 1)
            laws.append(PullLaw(time, tuple((spline(at) @ coefficients).tolist()), goal))
        return laws

    def _law(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the times [s], shape [point], and the coefficients [m], shape [point knot], of points."""
        free = x[:, 1:] * (self._goal + self._config.beyond)[:, None]
        path = torch.cat([torch.zeros_like(free[:, :2]), free, free[:, -1:]], dim=1)
        return self._low + x[:, 0] * (self._high - self._low), path

    def _setpoints(self, seconds: torch.Tensor, path: torch.Tensor) -> torch.Tensor:
        """Return the set-points of every step [m], shape [step point]."""
        at = (self._begun / seconds).clamp(0.0, 1.0) * (SAMPLES - 1)
        values = path @ self._splines[0].T
        index = at.detach().floor().long().clamp(max=SAMPLES - 2)
        rows = torch.arange(len(path))[None]
        part = at - index
        return values[rows, index] * (1.0 - part) + values[rows, index + 1] * part

    def _cost(
        self, seconds: torch.Tensor, path: torch.Tensor, opening: torch.Tensor, speed: torch.Tensor, force: torch.Tensor
    ) -> torch.Tensor:
        """Return the costs, shape [point], of motions [step point]."""
        c, dt = self._config, self._worlds.dt
        after = torch.sigmoid((self._begun - dt - seconds) / SOON)
        missed = ((opening - self._end) / c.end) ** 2 + (speed / c.end_speed) ** 2
        end = (after * missed).sum(dim=0) / after.sum(dim=0)
        allowed = c.end_speed + torch.relu(self._end - opening) / ARREST
        slam = self._closing * ((torch.relu(speed - allowed) / c.end_speed) ** 2).sum(dim=0) * dt / ARREST
        work = torch.relu(force * speed).sum(dim=0) * dt
        scale = force.abs().amax(dim=0).detach().clamp(min=1e-6)
        peak = scale * ((force / scale).abs() ** NORM).mean(dim=0) ** (1.0 / NORM)
        fast = (path @ self._splines[1].T) / (seconds * ROOM * self._speed)[:, None]
        hard = (path @ self._splines[2].T) / (seconds**2 * ROOM * self._acceleration)[:, None]
        over = sum((torch.relu(x.abs() - 1.0) ** 2).mean(dim=1) for x in (fast, hard))
        return c.time * seconds + c.energy * work + c.peak * peak + end + slam + LIMIT * over


def _spline(knots: int) -> BSpline:
    """Return the basis of a cubic B-spline with so many coefficients, from 0 to 1."""
    inner = np.linspace(0.0, 1.0, knots - DEGREE + 1)
    return BSpline(np.concatenate([[0.0] * DEGREE, inner, [1.0] * DEGREE]), np.eye(knots), DEGREE)


@dataclass(frozen=True)
class Optimum:
    """A pull that was found."""

    law: PullLaw  # its time law
    cost: float  # of the model's motion
    opening: np.ndarray  # that the model predicts [m], shape [step]
    speed: np.ndarray  # likewise [m/s]
    force: np.ndarray  # on the handle [N]


def optimize(
    pulled: Sequence[Pulled], config: PullConfig, seconds: np.ndarray | None = None, device: str = "cpu"
) -> tuple[list[Optimum], int]:
    """Return the best pull of each part, and how often all were evaluated.

    Args:
        pulled: parts and arms.
        config: what a good pull is.
        seconds: given times, shape [part]; None: free.
        device: cpu or cuda:0.
    """
    loss = PullLoss(pulled, config, seconds, device=device)
    bounds = np.zeros(loss.variables), np.ones(loss.variables)
    minima = minimize_together(loss, loss.start(), *bounds, config.rounds, np.ones(len(pulled), bool))
    return optima(loss, minima.points), minima.rounds


def optima(loss: PullLoss, points: np.ndarray) -> list[Optimum]:
    """Return points [problem variable] of problems as pulls."""
    moved, costs = loss.motions(points), loss.costs(points)
    return [
        Optimum(law, float(cost), *(x[:, i] for x in moved))
        for i, (law, cost) in enumerate(zip(loss.laws(points), costs, strict=True))
    ]
