"""The solver of physics: settings, a world's coordinates, properties in which worlds differ, resistance that MuJoCo lacks."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import mujoco_warp
import newton
import numpy as np
import warp as wp

from s2a.core.bounds import Count, CountFromZero, NotNegative, Positive
from s2a.robot.spec import Gains, MotionLimits, RobotSpec
from s2a.scene.articulation import lever_arm, opening_sign
from s2a.scene.usd.joints import SoftClose
from s2a.sim.world import JointConfig, SimStage, axis_of, body_index


@dataclass(frozen=True)
class Layout:
    """Indices within a world."""

    # number of the robot's driven joints; they are coordinates 0 to robot_joints - 1, the arm's first: those of a base
    # that drives are not counted
    robot_joints: int
    arm_joints: int  # number of the arm's
    home: tuple[float, ...]  # coordinates of the robot at the start of an episode [rad, m], shape [robot_joints]
    # joints that mimic one of these, the next coordinates: index of that joint, and multiplier
    followers: tuple[tuple[int, float], ...]
    robot_bodies: tuple[int, ...]  # all its links
    finger_bodies: tuple[int, int]  # left, right
    tool_body: int  # the link that carries the tool frame
    part_body: int  # the part that is to be moved
    part_coord: int  # its coordinate
    part_dof: int  # its velocity


def layout(world: newton.ModelBuilder, robot: RobotSpec, stage: SimStage) -> Layout:
    """Return the indices of a world with a robot, built of a stage."""
    coord, dof = axis_of(world, stage.target, stage.joint.kind)
    coord, dof = coord - robot.base_joints, dof - robot.base_joints
    left, right = (body_index(world, name) for name in robot.gripper.links)
    root = body_index(world, "drive_base" if robot.drive else robot.root_link)
    return Layout(
        robot_joints=len(robot.joints),
        arm_joints=len(robot.arm_joints),
        home=robot.start,
        followers=tuple(
            (world.joint_q_start[leader] - robot.base_joints, float(world.joint_mimic_coeffs[i][1]))
            for i, leader in enumerate(world.joint_mimic_joint)
            if leader >= 0 and world.joint_q_start[i] >= robot.base_joints + len(robot.joints)
        ),
        robot_bodies=tuple(_below(world, root)),
        finger_bodies=(left, right),
        tool_body=body_index(world, robot.tool_link),
        part_body=body_index(world, stage.target),
        part_coord=coord,
        part_dof=dof,
    )


def _below(world: newton.ModelBuilder, root: int) -> list[int]:
    """Return a body and all that hang on it."""
    bodies = [root]
    for parent, child in sorted(zip(world.joint_parent, world.joint_child, strict=True)):
        if parent in bodies and child not in bodies:
            bodies.append(child)
    return bodies


Range = tuple[Positive, Positive]  # Least and greatest factor; drawn evenly on a logarithmic scale


@dataclass(frozen=True)
class Variation:
    """By what each world's values are multiplied; drawn once, so that they stay as long as the worlds.

    Attributes:
        joint_friction: dry friction of the part's joint.
        joint_damping: damping of the part's joint.
        mass: mass of the part.
        contact_friction: friction of all surfaces of a world.
        gains: stiffness and damping of the arm's position controller.
        seed: seed of the draws.
    """

    joint_friction: Range
    joint_damping: Range
    mass: Range
    contact_friction: Range
    gains: Range
    seed: CountFromZero


def vary(model: newton.Model, layout: Layout, first: int, part_dof: np.ndarray, settings: Variation) -> None:
    """Multiply each world's values in a model that no solver has read yet.

    `first`: number of the joints of a base that drives, which come before all others; `part_dof`: the part's velocity in each
    world, shape [world].
    """
    worlds, random = len(part_dof), np.random.default_rng(settings.seed)

    def factors(limits: Range) -> np.ndarray:
        return np.exp(random.uniform(np.log(limits[0]), np.log(limits[1]), worlds))

    every, part = np.arange(worlds), (np.arange(worlds), first + part_dof)
    _multiply(model.joint_friction, worlds, part, factors(settings.joint_friction))
    _multiply(model.joint_target_kd, worlds, part, factors(settings.joint_damping))
    mass, body = factors(settings.mass), (every, layout.part_body)
    for array, power in (("body_mass", 1), ("body_inertia", 1), ("body_inv_mass", -1), ("body_inv_inertia", -1)):
        _multiply(getattr(model, array), worlds, body, mass**power)
    world = model.shape_world.numpy()
    friction = model.shape_material_mu.numpy()
    model.shape_material_mu.assign(friction * np.append(factors(settings.contact_friction), 1.0)[world])
    gains, arm = factors(settings.gains)[:, None], (every[:, None], first + np.arange(layout.arm_joints)[None])
    for array in ("joint_target_ke", "joint_target_kd"):
        _multiply(getattr(model, array), worlds, arm, gains)


def _multiply(array, worlds: int, index: tuple, factor: np.ndarray) -> None:
    """Multiply some values of an array that has as many entries for every world."""
    values = array.numpy()
    each = values.reshape(worlds, -1, *values.shape[1:])
    each[index] *= factor.reshape(*factor.shape, *[1] * (each[index].ndim - factor.ndim))
    array.assign(values)


# Reports that are switched off: reaching the iteration limits is meant, they are set low; capacities stay reported
IGNORED_OVERFLOWS = mujoco_warp.OverflowType.ITERATIONS | mujoco_warp.OverflowType.LS_ITERATIONS


@dataclass(frozen=True)
class SimConfig:
    """How physics is stepped.

    Attributes:
        dt: physics time step [s].
        substeps: physics steps per control step; even, so that a captured step ends in the buffer it began with.
        iterations: iterations of the constraint solver.
        ls_iterations: iterations of its line search.
        cone: friction cone.
        impratio: ratio of friction to normal impedance; higher slips less.
        njmax: constraint rows per world.
        nconmax: contacts per world.
        multiccd: Enable several contacts per pair of hulls.
        load_static_colliders: Load the room's colliders.
        gains: gains of the robot's position controller; null: the robot's own.
        gravity_compensation: Compensate the robot's weight.
        limits: limits to which the arm's controller keeps; null: none, and targets move as far as the task's action asks.
        joint: resistance of the target's joint.
        vary: differences between worlds; null: none.
        grip_stiffness: position gain of each finger at its pad [N/m], instead of that of the gains; null: theirs.
        coupled_fingers: Couple the fingers, where one motor drives both. Uncoupled fingers at their maximum force yield to any
            push along their common axis. `limits.drives` couples them too.
    """

    dt: Positive
    substeps: Count
    iterations: Count
    ls_iterations: Count
    cone: Literal["elliptic", "pyramidal"]
    impratio: Positive
    njmax: Count
    nconmax: Count
    multiccd: bool
    load_static_colliders: bool
    gains: Gains | None
    gravity_compensation: bool
    limits: MotionLimits | None
    joint: JointConfig
    vary: Variation | None
    grip_stiffness: NotNegative | None
    coupled_fingers: bool

    @property
    def control_dt(self) -> float:
        """Time of a control step [s]."""
        return self.dt * self.substeps

    @property
    def control_frequency(self) -> float:
        """Control steps a second [Hz]."""
        return 1.0 / self.control_dt

    def gains_of(self, robot: RobotSpec) -> Gains:
        """Return the gains of a robot's position controller."""
        gains = self.gains or robot.gains
        if self.grip_stiffness is None:
            return gains
        return replace(gains, finger_stiffness=self.grip_stiffness * robot.gripper.ratio**2)


def make_solver(model: newton.Model, config: SimConfig, **options: Any) -> newton.solvers.SolverMuJoCo:
    """Return MuJoCo's solver of a model; `options` are further ones of `newton.solvers.SolverMuJoCo`."""
    return newton.solvers.SolverMuJoCo(
        model,
        solver="newton",
        integrator="implicitfast",
        cone=config.cone,
        impratio=config.impratio,
        iterations=config.iterations,
        ls_iterations=config.ls_iterations,
        njmax=config.njmax,
        nconmax=config.nconmax,
        enable_multiccd=config.multiccd,
        **options,
    )


# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".


# [m/s] From rest, where it is greatest, dry friction falls to that in motion: exp(-(v / STRIBECK)^2),
# v at the grasp point
STRIBECK = wp.constant(0.05)
EDGE = wp.constant(0.25)  # Fraction of a soft close's reach over which its force and damping set in
INDICES = ("world", "coord", "dof", "solver_dof")  # Of Resisting, what are integers
NONE = SoftClose(0.0, 0.0, 1.0)


@wp.func
def held(speed: float):
    """Return the fraction of breakaway that holds at a speed [m/s] of the grasp point."""
    slow = speed / STRIBECK
    return wp.exp(-slow * slow)


@wp.func
def engaged(opening: float, reach: float):
    """Return the fraction of a soft close that acts at an opening: 1 near shut, 0 beyond its reach."""
    return wp.clamp((reach - opening) / (EDGE * reach), 0.0, 1.0)


@wp.struct
class Resisting:
    """Joints of all worlds, each of shape [joint]; forces, damping and reach per unit of the coordinate."""

    world: wp.array(dtype=int)  # index of its world
    coord: wp.array(dtype=int)  # of its coordinate among all worlds'
    dof: wp.array(dtype=int)  # of its velocity likewise
    solver_dof: wp.array(dtype=int)  # of its velocity within a world, as MuJoCo counts
    sign: wp.array(dtype=float)  # 1 where it opens upwards
    lever: wp.array(dtype=float)  # path of the grasp point by the coordinate
    friction: wp.array(dtype=float)  # in motion
    breakaway: wp.array(dtype=float)  # how much more at rest
    damping: wp.array(dtype=float)  # everywhere
    force: wp.array(dtype=float)  # of the soft close
    closing: wp.array(dtype=float)  # its damping
    reach: wp.array(dtype=float)  # of the soft close


@wp.kernel
def resist(
    r: Resisting,
    joint_q: wp.array(dtype=float),
    joint_qd: wp.array(dtype=float),
    dof_friction: wp.array2d(dtype=float),
    dof_damping: wp.array2d(dtype=float),
    joint_f: wp.array(dtype=float),
):
    """Give the joints of a physics step their dry friction and damping, which the solver takes implicitly, and their force."""
    i = wp.tid()
    world, dof, sign = r.world[i], r.solver_dof[i], r.sign[i]
    speed, acts = sign * joint_qd[r.dof[i]], engaged(sign * joint_q[r.coord[i]], r.reach[i])
    dof_friction[world, dof] = r.friction[i] + r.breakaway[i] * held(speed * r.lever[i])
    dof_damping[world, dof] = r.damping[i] + wp.where(speed < 0.0, acts * r.closing[i], 0.0)
    joint_f[r.dof[i]] = -sign * acts * r.force[i]


def hooks(simulation: Any, worlds: Sequence[newton.ModelBuilder]) -> list[Callable[[], None]]:
    """Return what a simulation calls before every physics step: nothing where none of its stages has breakaway or a soft close.

    What is called owns the joint forces of the joints concerned.
    """
    places = [_joints(stage, world) for stage, world in zip(simulation.stages, worlds, strict=True)]
    if not any(places):
        return []
    model = simulation.solver.mjw_model
    r = _resisting(places, worlds, simulation.stage_of_env, simulation.solver)

    def before_substep() -> None:
        state, force = simulation.state, simulation.control.joint_f
        inputs = [r, state.joint_q, state.joint_qd, model.dof_frictionloss, model.dof_damping, force]
        wp.launch(resist, dim=r.world.shape[0], inputs=inputs, device=r.world.device)

    return [before_substep]


def _resisting(
    places: Sequence[list[tuple[dict[str, float], int, int]]],
    worlds: Sequence[newton.ModelBuilder],
    stage_of_env: np.ndarray,
    solver: newton.solvers.SolverMuJoCo,
) -> Any:
    """Return the joints of all worlds as a Resisting; `places` are those of each stage."""
    rows: list[dict[str, float]] = []
    to_newton = solver.mjc_dof_to_newton_dof.numpy()
    friction, damping = (x.numpy() for x in (solver.mjw_model.dof_frictionloss, solver.mjw_model.dof_damping))
    for env, stage in enumerate(stage_of_env):
        world = worlds[stage]
        for row, coord, own in places[stage]:
            dof = env * world.joint_dof_count + own
            solver_dof = int(np.flatnonzero(to_newton[env] == dof)[0])
            now = {"friction": friction[env, solver_dof], "damping": damping[env, solver_dof]}
            where = {"coord": env * world.joint_coord_count + coord, "dof": dof, "solver_dof": solver_dof}
            rows.append({**row, **now, **where, "world": env})
    r = Resisting()
    for name in rows[0]:
        setattr(r, name, wp.array([row[name] for row in rows], dtype=int if name in INDICES else float))
    return r


def _joints(stage: SimStage, world: newton.ModelBuilder) -> list[tuple[dict[str, float], int, int]]:
    """Return what a stage's active joints have of this, and their coordinate and velocity within a world."""
    rows = []
    for part in stage.active:
        joint = stage.room.articulations.get(part)
        if joint is None or joint.resistance is None:
            continue
        own, soft = joint.resistance, joint.resistance.soft_close or NONE
        if own.breakaway or soft is not NONE:
            lever = lever_arm(joint.joint, np.array(joint.grasp.point))
            row = {"sign": opening_sign(joint.joint), "lever": lever, "breakaway": own.breakaway}
            row |= {"force": soft.force, "closing": soft.damping, "reach": soft.reach}
            rows.append((row, *axis_of(world, part, joint.joint.kind)))
    return rows
