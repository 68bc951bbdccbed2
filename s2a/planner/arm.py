"""An arm and its position controller as felt at the grasp point, along the path on which it pulls a part."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from s2a.planner.trajectory import USED
from s2a.robot.kinematics import Kinematics, kinematics
from s2a.robot.tool_path import ToolPath, matrices
from s2a.sim.simulation import Simulation

STEP = 1e-5
"""[rad] Of the differences that give a Jacobian."""


@dataclass(frozen=True)
class Arm:
    """A mass on a spring and a damper: K (u - s) - D v - M a, u being the set-point's path and s the grasp point's.

    Across the path the handle leaves the arm free, as a grip by friction on a bar nearly does: K, D and M are those of the tool
    frame's point, inverses of its mobility along the path.

    Attributes:
        path: of the grasp point [m], even, from 0 to the end of the pull, shape [pose].
        stiffness: [N/m], shape [pose].
        damping: against the ground, as the controller's [N s/m], shape [pose].
        mass: [kg], shape [pose].
        speed: largest of the set-point that keeps every joint's limits [m/s].
        acceleration: likewise, for a small speed [m/s^2].
    """

    path: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    mass: np.ndarray
    speed: float
    acceleration: float


def arm_along(sim: Simulation, path: ToolPath, arm: np.ndarray) -> Arm:
    """Return what pulls along a joint path [pose arm] that follows a tool path, from its grasp on."""
    joints, poses = arm[path.grasp :], path.poses[path.grasp :, :3, 3]
    along = np.abs(path.q[path.grasp :] - path.q[path.grasp]) * sim.stage.lever_arm
    tangent = np.gradient(poses, along, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    base = matrices(sim.stage.base[None])[0, :3, :3]
    pull = np.einsum("pi,ij,pjk->pk", tangent, base, _jacobians(kinematics(sim.robot), joints))
    gains, limits = sim.config.gains_of(sim.robot), sim.plan_limits
    mobility = np.array([row @ np.linalg.solve(_mass_matrix(sim, q), row) for row, q in zip(pull, joints, strict=True)])
    compliance, rate = (pull**2).sum(axis=1), np.abs(np.gradient(joints, along, axis=0)).max(axis=0)
    return Arm(
        path=along,
        stiffness=gains.arm_stiffness / compliance,
        damping=gains.arm_damping / compliance,
        mass=1.0 / mobility,
        speed=float((USED * np.array(limits.velocity) / rate).min()),
        acceleration=float((USED * np.array(limits.acceleration) / rate).min()),
    )


def _jacobians(kin: Kinematics, joints: np.ndarray) -> np.ndarray:
    """Return how the tool's point moves in the base frame by each joint [m/rad], shape [pose 3 arm]."""
    count, arm = joints.shape
    turned = STEP * np.eye(arm)
    ahead, behind = (kin.tool((joints[:, None] + sign * turned).reshape(-1, arm))[:, :3, 3] for sign in (1.0, -1.0))
    return ((ahead - behind) / (2 * STEP)).reshape(count, arm, 3).transpose(0, 2, 1)


def _mass_matrix(sim: Simulation, joints: np.ndarray) -> np.ndarray:
    """Return the arm's inertia at joints [arm], its rotors' included [kg m^2], shape [arm arm]."""
    model, arm = sim.solver.mj_model, len(joints)
    data = mujoco.MjData(model)
    data.qpos[:arm] = joints
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    return full[:arm, :arm]
