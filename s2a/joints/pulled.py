"""A part on its joint, its resistance and the arm that pulls it, as a simulation has them."""

from dataclasses import dataclass, replace

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from s2a.motion.trajectory import USED
from s2a.robot.kinematics import Kinematics, kinematics
from s2a.robot.tool_path import ToolPath, matrix
from s2a.scene.articulation import lever_arm, open_limit
from s2a.scene.scene import Joint
from s2a.scene.usd.joints import Resistance, SoftClose
from s2a.scene.usd.sim_scene import Mass, SimRoom
from s2a.scene.usd.sim_stage import GRAVITY
from s2a.sim.simulation import Simulation

REACH = 0.04  # [m] Of a soft close of which nothing is known


@dataclass(frozen=True)
class Moving:
    """A body that moves on its joint."""

    joint: Joint  # scene coordinates
    mass: Mass  # of all that moves, in the same frame
    point: np.ndarray  # grasp point [m], shape [3]
    reach: float = REACH  # path of the grasp point from shut over which a soft close acts, if the part has one [m]

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
        return float((axis @ inertia_tensor(self.mass) @ axis + self.mass.mass * arm @ arm) / self.lever**2)

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


def moving(room: SimRoom, part: str, reach: float = REACH) -> Moving:
    """Return an articulated part of a room as a body on its joint; what carries it stands still.

    `reach`: of a soft close [m], where the stage says nothing of it.
    """
    articulation = room.articulations[part]
    body = Moving(articulation.joint, room.bodies[part].mass, np.array(articulation.grasp.point), reach)
    soft = articulation.resistance and articulation.resistance.soft_close
    return replace(body, reach=soft.reach * abs(body.lever)) if soft else body


def inertia_tensor(mass: Mass) -> np.ndarray:
    """Return the inertia about the centre of mass [kg m^2], shape [3 3], in the body's frame."""
    axes = Rotation.from_quat(mass.axes).as_matrix()
    return axes @ np.diag(mass.inertia) @ axes.T


STEP = 1e-5  # [rad] Of the differences that give a Jacobian


@dataclass(frozen=True)
class Arm:
    """A mass on a spring and a damper: K (u - s) - D v - M a, u being the set-point's path and s the grasp point's.

    Across the path the handle leaves the arm free, as a grip by friction on a bar nearly does: K, D and M are those of the tool
    frame's point, inverses of its mobility along the path.
    """

    path: np.ndarray  # of the grasp point [m], even, from 0 to the end of the pull, shape [pose]
    stiffness: np.ndarray  # [N/m], shape [pose]
    damping: np.ndarray  # against the ground, as the controller's [N s/m], shape [pose]
    mass: np.ndarray  # [kg], shape [pose]
    speed: float  # largest of the set-point that keeps every joint's limits [m/s]
    acceleration: float  # likewise, for a small speed [m/s^2]


@dataclass(frozen=True)
class Pulled:
    """A part and the arm that pulls it."""

    body: Moving  # with the stage's mass
    dynamics: tuple[float, ...]  # what resists at its grasp point, as dynamics.PARAMETERS name it
    arm: Arm  # the arm along the part's path
    # how much farther than predicted an earlier pull of the part ended [m]: a grip off the handle's
    # middle bends the arm
    offset: float = 0.0
    # The path leads from the goal's distance to shut, else from shut to the goal; openings are along it
    closing: bool = False

    @property
    def goal(self) -> float:
        """How far the part shall go [m]."""
        return float(self.arm.path[-1])


def pulled(sim: Simulation, path: ToolPath, arm: np.ndarray, offset: float = 0.0) -> Pulled:
    """Return the target of a simulation's stage, of which a joint path [pose arm] follows a tool path.

    Its dynamics are the simulation's own: those identified where the stage has them.
    """
    stage, config = sim.stage, sim.config.joint
    part, body = stage.room.articulations[stage.target], moving(stage.room, stage.target)
    damping, spring = (x / body.lever**2 for x in (config.joint_damping(part), config.joint_stiffness(part)))
    resistance, lever = part.resistance or Resistance(), abs(body.lever)
    soft = resistance.soft_close or SoftClose(0.0, 0.0, 0.0)
    dry = (part.friction / lever, resistance.breakaway / lever)
    dynamics = (1.0, damping, *dry, spring, soft.force / lever, soft.damping / lever**2)
    closing = abs(float(path.q[-1])) < abs(float(path.q[path.grasp]))
    return Pulled(body, dynamics, arm_along(sim, path, arm), offset, closing)


def arm_along(sim: Simulation, path: ToolPath, arm: np.ndarray) -> Arm:
    """Return what pulls along a joint path [pose arm] that follows a tool path, from its grasp on."""
    joints, poses = arm[path.grasp :], path.poses[path.grasp :, :3, 3]
    along = np.abs(path.q[path.grasp :] - path.q[path.grasp]) * sim.stage.lever_arm
    tangent = np.gradient(poses, along, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    base = matrix(sim.stage.base)[:3, :3]
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
