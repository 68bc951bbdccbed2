"""One part of a room, pulled by a force at its handle: in Newton, in MuJoCo and in PyBullet."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import pybullet
from scipy.spatial.transform import Rotation

from s2a.sim.simulation import Simulation
from s2a.sim.solver import SimConfig
from s2a.sim.world import SimStage, joint_index

SECONDS, RISE = 3.0, 0.5
"""[s] Length of a run, and until the force is full."""


@dataclass(frozen=True)
class Pull:
    """A part and how it is pulled.

    Attributes:
        stage: the part.
        config: how physics is stepped.
        force: full force [N], shape [3].
    """

    stage: SimStage
    config: SimConfig
    force: np.ndarray

    @property
    def steps(self) -> int:
        """Number of physics steps."""
        return round(SECONDS / self.config.dt)

    def at(self, step: int) -> np.ndarray:
        """Return the force in a physics step [N], shape [3]."""
        return min(1.0, step * self.config.dt / RISE) * self.force


def in_newton(pull: Pull) -> np.ndarray:
    """Return the joint's coordinate after every physics step [m or rad], shape [step]."""
    sim = Simulation(pull.stage, pull.config, 1, "cpu", with_robot=False)
    body = sim.body(pull.stage.target)
    center, handle = sim.model.body_com.numpy()[body], pull.stage.grasp[:3]
    found: list[float] = []

    def push() -> None:
        *position, x, y, z, w = sim.state.body_q.numpy()[body].astype(float)
        turn = Rotation.from_quat((x, y, z, w))
        force = pull.at(len(found))
        wrench = np.zeros((sim.model.body_count, 6), np.float32)
        wrench[body] = [*force, *np.cross(turn.apply(handle - center), force)]
        sim.state.body_f.assign(wrench)

    coordinate = sim.world.joint_q_start[joint_index(sim.world, pull.stage.target)]
    sim.before_substep = push
    sim.after_substep = lambda: found.append(float(sim.state.joint_q.numpy()[coordinate]))
    while len(found) < pull.steps:
        sim.step()
    return np.array(found)


def in_mujoco(model: mujoco.MjModel, pull: Pull) -> tuple[np.ndarray, np.ndarray]:
    """Return the coordinate, and the handle's place [m], after every physics step, shape [step] and [step 3]."""
    part, data = pull.stage.target, mujoco.MjData(model)
    site, body = model.site(f"{part}_grasp").id, model.body(part).id
    address = model.jnt_qposadr[model.joint(part).id]
    found, handle = [], []
    for step in range(pull.steps):
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        data.qfrc_applied[:] = 0.0
        mujoco.mj_applyFT(model, data, pull.at(step), np.zeros(3), data.site_xpos[site], body, data.qfrc_applied)
        mujoco.mj_step(model, data)
        found.append(data.qpos[address])
        mujoco.mj_kinematics(model, data)
        handle.append(data.site_xpos[site].copy())
    return np.array(found), np.array(handle)


def in_pybullet(folder: Path, pull: Pull) -> tuple[np.ndarray, np.ndarray]:
    """Return the coordinate, and the handle's place [m], after every physics step, shape [step] and [step 3]."""
    pybullet.connect(pybullet.DIRECT)
    try:
        room, joints = _load_in_pybullet(folder, pull)
        joint, stiffness = joints[pull.stage.target], pull.config.joint.stiffness
        handle = pull.stage.grasp[:3] - np.array(_link_pose(room, joint)[0])
        found, places = [], []
        for step in range(pull.steps):
            for spring in joints.values():  # which URDF cannot hold
                back = -stiffness * pybullet.getJointState(room, spring)[0]
                pybullet.setJointMotorControl2(room, spring, pybullet.TORQUE_CONTROL, force=back)
            place = _link_point(room, joint, handle)
            pybullet.applyExternalForce(room, joint, pull.at(step), place, pybullet.WORLD_FRAME)
            pybullet.stepSimulation()
            found.append(pybullet.getJointState(room, joint)[0])
            places.append(_link_point(room, joint, handle))
        return np.array(found), np.array(places)
    finally:
        pybullet.disconnect()


def _load_in_pybullet(folder: Path, pull: Pull) -> tuple[int, dict[str, int]]:
    """Load room.urdf as docs/other_simulators.md says; return its index, and those of its joints that move."""
    pybullet.setGravity(0.0, 0.0, -9.81)
    pybullet.setTimeStep(pull.config.dt)
    flags = pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_USE_SELF_COLLISION
    room = pybullet.loadURDF(str(folder / "room.urdf"), flags=flags)
    infos = [pybullet.getJointInfo(room, i) for i in range(pybullet.getNumJoints(room))]
    links = {info[12].decode(): info[0] for info in infos}
    for pair in ElementTree.parse(folder / "room.srdf").getroot():
        one, other = links[pair.get("link1")], links[pair.get("link2")]
        pybullet.setCollisionFilterPair(room, room, one, other, enableCollision=0)
    moving = {info[1].decode(): info[0] for info in infos if info[2] != pybullet.JOINT_FIXED}
    for joint in range(-1, len(infos)):  # Bullet adds drag of its own
        pybullet.changeDynamics(room, joint, linearDamping=0.0, angularDamping=0.0)
    for joint in moving.values():  # dry friction is a motor that holds still
        pybullet.setJointMotorControl2(
            room, joint, pybullet.VELOCITY_CONTROL, targetVelocity=0.0, force=infos[joint][7]
        )
    return room, moving


def _link_pose(room: int, link: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the pose of a link's frame (not of its centre of mass): position [m] and quaternion xyzw."""
    return pybullet.getLinkState(room, link, computeForwardKinematics=True)[4:6]


def _link_point(room: int, link: int, point: np.ndarray) -> np.ndarray:
    """Return where a point in a link's frame is in the scene [m], shape [3]."""
    position, orientation = _link_pose(room, link)
    return Rotation.from_quat(orientation).apply(point) + position
