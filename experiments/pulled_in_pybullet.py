"""One part of a room, pulled by a force at its handle, in PyBullet 3.2.7, which no other program here needs."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pybullet
from pulled_parts import Pull
from scipy.spatial.transform import Rotation


def in_pybullet(folder: Path, pull: Pull) -> tuple[np.ndarray, np.ndarray]:
    """Return the coordinate, and the handle's place [m], after every physics step, shape [step] and [step 3]."""
    pybullet.connect(pybullet.DIRECT)
    try:
        room, joints = _load_in_pybullet(folder, pull)
        joint, parts = joints[pull.stage.target], pull.stage.room.articulations
        springs = {index: pull.config.joint.joint_stiffness(parts[name]) for name, index in joints.items()}
        handle = pull.stage.grasp[:3] - np.array(_link_pose(room, joint)[0])
        found, places = [], []
        for step in range(pull.steps):
            for spring, stiffness in springs.items():  # which URDF cannot hold
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
    pybullet.performCollisionDetection()
    for contact in pybullet.getContactPoints(
        room, room
    ):  # hulls are 1 mm thicker here: what is near overlaps from the start
        if contact[8] < 0.0:
            pybullet.setCollisionFilterPair(room, room, contact[3], contact[4], enableCollision=0)
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
