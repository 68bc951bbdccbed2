"""How physics is stepped: the settings, and the solver with them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import mujoco_warp
import newton

from s2a.core.ranges import Count, NotNegative, Positive
from s2a.robot.spec import Gains, MotionLimits, RobotSpec
from s2a.sim.vary import Variation
from s2a.sim.world import JointConfig

IGNORED_OVERFLOWS = mujoco_warp.OverflowType.ITERATIONS | mujoco_warp.OverflowType.LS_ITERATIONS
"""Reports that are switched off: reaching the iteration limits is meant, they are set low; capacities stay reported."""


@dataclass(frozen=True)
class SimConfig:
    """How physics is stepped.

    Attributes:
        dt: physics time step [s].
        substeps: physics steps a control step; even, so that a captured step ends in the buffer it began with.
        iterations: of the constraint solver.
        ls_iterations: of its line search.
        cone: friction cone.
        impratio: ratio of friction to normal impedance; higher slips less.
        njmax: constraint rows a world.
        nconmax: contacts a world.
        multiccd: Enable several contacts a pair of hulls.
        load_static_colliders: Load the room's colliders.
        gains: of the robot's position controller; null: the robot's own.
        gravity_compensation: the robot's weight is carried.
        limits: what the arm's controller keeps to; null: nothing, and targets move as far as the task's action asks.
        joint: how the target's joint resists.
        vary: by what worlds differ; null: by nothing.
        grip_stiffness: position gain of the finger joints [N/m], instead of that of the gains; null: theirs, as in runs from
            before this key.
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
    grip_stiffness: NotNegative | None = None
    coupled_fingers: bool = False

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
