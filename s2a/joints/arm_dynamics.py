"""What a wrist feels, from an arm's positions and joint torques alone: inverse dynamics are MuJoCo's."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import mujoco
import numpy as np

from s2a.robot import urdf
from s2a.robot.spec import RobotSpec
from s2a.scene.usd.sim_stage import GRAVITY


class ArmDynamics:
    """An arm without shapes, its fingers where they are told to be.

    Attributes:
        spec: the robot.
    """

    def __init__(self, spec: RobotSpec) -> None:
        """Read the robot's URDF: masses and inertias of its links, no rotors, no friction."""
        self.spec = spec
        robot = urdf.without_colliders(urdf.arm(spec))
        extension = ElementTree.SubElement(robot, "mujoco")
        ElementTree.SubElement(extension, "compiler", discardvisual="true", fusestatic="false")
        self._model = mujoco.MjModel.from_xml_string(ElementTree.tostring(robot, encoding="unicode"))
        self._data = mujoco.MjData(self._model)
        self._dofs = [self._model.joint(name).dofadr[0] for name in spec.joints]
        self._tool = self._model.body(spec.tool_link).id

    def wrench(
        self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, torque: np.ndarray, point: np.ndarray, gravity: bool
    ) -> np.ndarray:
        """Return force and torque [N, N m] that the tool exerts about a point, shape [sample 6], in the base frame.

        Args:
            q: of `spec.joints`, shape [sample joint].
            qd: likewise.
            qdd: likewise.
            torque: of the arm joints, on the side of their links [N m], shape [sample arm].
            point: base frame [m], shape [sample 3].
            gravity: the torques carry the robot's weight too; else it is carried beside them.
        """
        model, data, arm = self._model, self._data, self._dofs[: len(self.spec.arm_joints)]
        model.opt.gravity[2] = -GRAVITY if gravity else 0.0
        found = np.empty((len(q), 6))
        jacobian = np.zeros((6, model.nv))
        for i in range(len(q)):
            data.qpos[self._dofs], data.qvel[self._dofs], data.qacc[self._dofs] = q[i], qd[i], qdd[i]
            mujoco.mj_inverse(model, data)
            mujoco.mj_jac(model, data, jacobian[:3], jacobian[3:], point[i], self._tool)
            left = torque[i] - data.qfrc_inverse[arm]
            found[i] = np.linalg.lstsq(jacobian[:, arm].T, left, rcond=None)[0]
        return found
