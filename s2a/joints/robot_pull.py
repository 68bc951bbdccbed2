"""Recordings of a robot that pulls a part, its joints and their torques, as pulls of that part: no force sensor needed."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from scipy.signal import savgol_filter
from scipy.spatial.transform import Rotation

from s2a.core.errors import InputError
from s2a.joints.pull import Pull, tables
from s2a.joints.pulled import Moving
from s2a.robot import urdf
from s2a.robot.kinematics import kinematics
from s2a.robot.spec import RobotSpec
from s2a.scene.articulation import displace
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


SMOOTHED = 0.08
"""[s] Length of the cubic by which positions are differentiated twice (Savitzky and Golay's filter)."""
AT_REST = 0.002
"""[m] As long as the tool has moved less along the part's path, the pull has not begun."""
BEFORE = 0.3
"""[s] Of rest before the pull that belong to it."""
FAR = 0.03
"""[m] The tool's largest distance from the part's path during a pull; farther, it does not hold the part."""


@dataclass(frozen=True)
class Recording:
    """An arm's motion at one rate.

    Attributes:
        q: of the robot's joints, its fingers among them [rad, m], shape [sample joint].
        torque: of the arm joints, on the side of their links [N m], shape [sample arm].
        step: time between samples [s].
    """

    q: np.ndarray
    torque: np.ndarray
    step: float


def read(path: Path, spec: RobotSpec, episodes: Sequence[int] = ()) -> list[Recording]:
    """Read recordings with the columns `spec.recorded`; see `s2a.joints.pull.tables`."""
    joints = len(spec.joints)
    found = tables(path, spec.recorded, episodes)
    return [Recording(rows[:, 1 : 1 + joints], rows[:, 1 + joints :], step) for rows, step in found]


def pull(recording: Recording, spec: RobotSpec, base: np.ndarray, body: Moving, gravity: bool) -> Pull:
    """Return how the tool pulled a part: what it holds moves with it, and what it feels is what the part resists.

    The opening is how far the tool went along the part's path; the force is the work that it does along it, which counts its
    torque about a hinge's axis too.

    Args:
        recording: from before the grasp or from the grasp on, to the end of the pull.
        spec: the robot.
        base: pose of its base, scene frame, shape [7].
        body: the part; it was closed before.
        gravity: the torques carry the robot's weight too.

    Raises:
        InputError: the tool does not move along the part's path.
    """
    window = max(5, round(SMOOTHED / recording.step) | 1)
    if len(recording.q) < window:
        raise InputError(f"a recording of {len(recording.q)} samples; give {window} or more, {SMOOTHED} s")
    q, qd, qdd = (
        savgol_filter(recording.q, window, 3, deriv=order, delta=recording.step, axis=0) for order in range(3)
    )
    turn = Rotation.from_quat(base[3:])
    in_base = kinematics(spec).tool(recording.q[:, : len(spec.arm_joints)])[:, :3, 3]
    tool = turn.apply(in_base) + base[:3]
    opening, off = along(tool, body)
    held = slice(_first(opening, off, round(BEFORE / recording.step)), None)
    wrench = ArmDynamics(spec).wrench(q[held], qd[held], qdd[held], recording.torque[held], in_base[held], gravity)
    force, torque = turn.apply(wrench[:, :3]), turn.apply(wrench[:, 3:])
    return Pull(opening[held] - opening[held][0], _work(force, torque, tool[held], body), recording.step)


def along(points: np.ndarray, body: Moving) -> tuple[np.ndarray, np.ndarray]:
    """Return how far along the path of a part's grasp point other points [point 3] are [m], and how far from it [m].

    Each has shape [point]; the path is a line or a circle, without an end.
    """
    joint, axis = body.joint, np.array(body.joint.axis)
    if joint.kind == "prismatic":
        q = (points - body.point) @ axis
    else:
        start = _across(body.point - joint.origin, axis)
        arm = _across(points - joint.origin, axis)
        q = np.arctan2(np.cross(start, arm) @ axis, arm @ start)
    path = np.array([displace(body.point[None], joint, each)[0] for each in q])
    return q * body.lever, np.linalg.norm(points - path, axis=1)


def _across(arm: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Return what of an arm [.. 3] stands across an axis."""
    return arm - (arm @ axis)[..., None] * axis


def _first(opening: np.ndarray, off: np.ndarray, before: int) -> int:
    """Return the sample with which a pull begins: so many before the tool, near the part's path to the end, leaves the grasp."""
    away = np.flatnonzero(off > FAR)
    near = int(away[-1]) + 1 if len(away) else 0
    if near == len(off) or np.ptp(opening[near:]) < 5 * AT_REST:
        raise InputError(
            f"the tool ends {off[-1]:.3f} m from where the part's grasp point goes, or does not move along it; "
            "record a pull that holds the part, from where it is closed"
        )
    rest = near + np.flatnonzero(opening[near:] < opening[near:].min() + AT_REST)
    return max(int(rest[-1]) - before, int(rest[0]))


def _work(force: np.ndarray, torque: np.ndarray, points: np.ndarray, body: Moving) -> np.ndarray:
    """Return the work of forces and torques about points, each [sample 3], by the path of the grasp point [N], shape [sample]."""
    axis = np.array(body.joint.axis)
    if body.joint.kind == "prismatic":
        return force @ axis / body.lever
    return (np.cross(points - body.joint.origin, force) + torque) @ axis / body.lever
