"""The solver of physics: its settings, the layout of a world's coordinates, and the properties in which worlds differ."""

from dataclasses import dataclass, replace
from typing import Any, Literal

import mujoco_warp
import newton
import numpy as np

from s2a.core.bounds import Count, CountFromZero, NotNegative, Positive
from s2a.robot.spec import Gains, MotionLimits, RobotSpec
from s2a.sim.world import JointConfig, SimStage, axis_of, body_index


@dataclass(frozen=True)
class Layout:
    """Indices within a world."""

    # number of the robot's driven joints; they are coordinates 0 to robot_joints - 1, the arm's first
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
    left, right = (body_index(world, name) for name in robot.gripper.links)
    root = body_index(world, robot.root_link)
    return Layout(
        robot_joints=len(robot.joints),
        arm_joints=len(robot.arm_joints),
        home=robot.start,
        followers=tuple(
            (world.joint_q_start[leader], float(world.joint_mimic_coeffs[i][1]))
            for i, leader in enumerate(world.joint_mimic_joint)
            if leader >= 0 and world.joint_q_start[i] >= len(robot.joints)
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


def vary(model: newton.Model, layout: Layout, part_dof: np.ndarray, settings: Variation) -> None:
    """Multiply each world's values in a model that no solver has read yet.

    `part_dof`: the part's velocity in each world, shape [world].
    """
    worlds, random = len(part_dof), np.random.default_rng(settings.seed)

    def factors(limits: Range) -> np.ndarray:
        return np.exp(random.uniform(np.log(limits[0]), np.log(limits[1]), worlds))

    every, part = np.arange(worlds), (np.arange(worlds), part_dof)
    _multiply(model.joint_friction, worlds, part, factors(settings.joint_friction))
    _multiply(model.joint_target_kd, worlds, part, factors(settings.joint_damping))
    mass, body = factors(settings.mass), (every, layout.part_body)
    for array, power in (("body_mass", 1), ("body_inertia", 1), ("body_inv_mass", -1), ("body_inv_inertia", -1)):
        _multiply(getattr(model, array), worlds, body, mass**power)
    world = model.shape_world.numpy()
    friction = model.shape_material_mu.numpy()
    model.shape_material_mu.assign(friction * np.append(factors(settings.contact_friction), 1.0)[world])
    gains, arm = factors(settings.gains)[:, None], (every[:, None], np.arange(layout.arm_joints)[None])
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
        gravity_compensation: the robot's weight is carried.
        limits: limits to which the arm's controller keeps; null: none, and targets move as far as the task's action asks.
        joint: resistance of the target's joint.
        vary: differences between worlds; null: none.
        grip_stiffness: position gain of the finger joints [N/m], instead of that of the gains; null: theirs.
        coupled_fingers: one motor drives both, where the gripper has but one. Two that press with all their force yield to any
            push along their common axis. Motion limits with drives have it too.
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
        return gains if self.grip_stiffness is None else replace(gains, finger_stiffness=self.grip_stiffness)


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
