"""Forward and inverse kinematics of any robot, for many poses at once; inverse kinematics are Newton's."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np
import warp as wp
from scipy.spatial.transform import Rotation

from s2a.robot import urdf
from s2a.robot.spec import DriveSpec, RobotSpec

if TYPE_CHECKING:
    import newton


class Kinematics:
    """Kinematics of a robot's arm; the fingers are fully open.

    Attributes:
        spec: the robot.
        links: names of its links.
        arm_group: for every link how many arm joints carry it, shape [link].
        shoulder: a point on the axis of the first joint, which is the base's z, in the base frame [m], shape [3].
        lower: position limits of the arm joints [rad], shape [arm].
        upper: likewise.
    """

    def __init__(self, spec: RobotSpec) -> None:
        """Read the robot's URDF; `kinematics` keeps one instance per robot."""
        self.spec = spec
        robot = urdf.arm(spec)
        limits = urdf.position_limits(spec)[:, : len(spec.arm_joints)]
        self.lower, self.upper = limits
        self._chain = _chain(robot, spec)
        self.links = tuple(link for link, _, _, _, _ in self._chain)
        self.arm_group = np.zeros(len(self.links), int)
        for i, (_, parent, _, _, joint) in enumerate(self._chain):
            self.arm_group[i] = 0 if parent < 0 else self.arm_group[parent] + (joint >= 0)
        first = next(i for i, (*_, joint) in enumerate(self._chain) if joint == 0)
        self.shoulder = self.frames(np.zeros((1, len(spec.arm_joints))))[0, first, :3, 3]
        self._tool_link = self.links.index(spec.tool_link)
        self._urdf = robot

    @cached_property
    def _ik_model(self) -> tuple[newton.Model, int]:
        """Newton's model of the arm; made when it is asked for, since Newton takes seconds to import."""
        return _ik_model(self._urdf, self.spec)

    def frames(self, q: np.ndarray) -> np.ndarray:
        """Return the poses of all links in the base frame, shape [pose link 4 4], for arm joints [pose arm]."""
        poses = np.empty((len(q), len(self.links), 4, 4))
        for i, (_, parent, fixed, moves, joint) in enumerate(self._chain):
            pose = fixed if joint < 0 else fixed @ urdf.motion(moves, q[:, joint])
            poses[:, i] = pose if parent < 0 else poses[:, parent] @ pose
        return poses

    def tool(self, q: np.ndarray) -> np.ndarray:
        """Return the poses of the tool frame in the base frame, shape [pose 4 4], for arm joints [pose arm]."""
        pose = self.frames(q)[:, self._tool_link].copy()
        pose[:, :3, 3] += pose[:, :3, :3] @ np.array(self.spec.tool_offset)
        return pose

    @cached_property
    def _straight(self) -> tuple[np.ndarray, float]:
        """Place of the last joint's link in the tool frame, [4], and its distance from the shoulder, at most [m]."""
        first, last = (next(i for i, (*_, k) in enumerate(self._chain) if k == j) for j in (0, len(self.lower) - 1))
        between, link = [first], last
        while link != first:
            between.append(link)
            link = self._chain[link][1]
        slides = any(self._chain[i][3].get("type") == "prismatic" for i in between)
        length = sum(float(np.linalg.norm(self._chain[i][2][:3, 3])) for i in between[1:])
        zero = np.zeros((1, len(self.lower)))
        end: np.ndarray = np.linalg.inv(self.tool(zero)[0]) @ self.frames(zero)[0, last, :, 3]
        return end, np.inf if slides else length + 1e-3

    def may_reach(self, targets: np.ndarray) -> np.ndarray:
        """Return False for poses of the tool frame in the base frame, [... 4 4], too far for a straight arm, shape [...].

        A pose says where the last joint is; no arm takes that farther from the first one than its links are long together.
        """
        end, length = self._straight
        return np.asarray(np.linalg.norm((targets @ end)[..., :3] - self.shoulder, axis=-1) <= length)

    def solve(
        self, targets: np.ndarray, start: np.ndarray, iterations: int, damping: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return arm joints [pose arm] that bring the tool frame to the targets, and what is left, shape [pose].

        Args:
            targets: poses of the tool frame in the base frame, shape [pose 4 4].
            start: arm joints to start from [rad], shape [pose arm].
            iterations: of Levenberg and Marquardt's method.
            damping: its first value; smaller for a start near the target.

        Returns:
            The joints, and the root of the sum of squared errors (m and rad; beyond a joint limit ten times so much).
        """
        n = len(targets)
        if n == 0:
            return start.copy(), np.zeros(0)
        import newton.ik as ik  # seconds to load, which what only reads a robot does without

        model, body = self._ik_model
        with wp.ScopedDevice("cpu"):
            quats = Rotation.from_matrix(targets[:, :3, :3]).as_quat().astype(np.float32)
            places = targets[:, :3, 3].astype(np.float32)
            position = ik.IKObjectivePosition(body, wp.vec3(*self.spec.tool_offset), wp.array(places, dtype=wp.vec3))
            rotation = ik.IKObjectiveRotation(body, wp.quat_identity(), wp.array(quats, dtype=wp.vec4))
            limits = ik.IKObjectiveJointLimit(model.joint_limit_lower, model.joint_limit_upper, weight=10.0)
            solver = ik.IKSolver(
                model,
                n,
                [position, rotation, limits],
                jacobian_mode=ik.IKJacobianType.ANALYTIC,
                lambda_initial=damping,
                lambda_min=1e-7,
            )
            q = wp.array(start.astype(np.float32))
            solver.step(q, q, iterations=iterations)
            return q.numpy().astype(float), np.sqrt(solver.costs.numpy()[:n])


def base_coordinates(drive: DriveSpec, base: np.ndarray, height: float) -> np.ndarray:
    """Return x, y, yaw and lift of a base [4] whose arm has its root link at a pose [4 4], so high above the floor [m]."""
    yaw = float(np.arctan2(base[1, 0], base[0, 0]))
    place = base[:2, 3] - base[:2, :2] @ np.array(drive.mount[:2])
    return np.array([*place, yaw, height - drive.mount[2]])


def arm_pose(drive: DriveSpec, q: np.ndarray, floor: float) -> np.ndarray:
    """Return the pose [4 4] of the arm's root link on a base at coordinates q [4] on a floor of this height [m]."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("z", q[2]).as_matrix()
    pose[:3, 3] = [*q[:2], floor + q[3]] + pose[:3, :3] @ np.array(drive.mount)
    return pose


@cache
def kinematics(spec: RobotSpec) -> Kinematics:
    """Return a robot's kinematics."""
    return Kinematics(spec)


def _chain(robot: ElementTree.Element, spec: RobotSpec) -> list[tuple[str, int, np.ndarray, ElementTree.Element, int]]:
    """Return every link, parents first: name, index of its parent, fixed pose in it, its joint, index of the arm joint or -1."""
    tree, gripper = urdf.children(robot), spec.gripper
    chain = [(spec.root_link, -1, np.eye(4), robot, -1)]
    for index, (link, *_) in enumerate(chain):
        for child, joint in tree.get(link, []):
            fixed, name, mimic = urdf.origin(joint), joint.get("name"), joint.find("mimic")
            if name in gripper.joints or mimic is not None:
                opened = gripper.finger_joint_open * (1.0 if mimic is None else float(mimic.get("multiplier", 1)))
                fixed = fixed @ urdf.motion(joint, np.array([opened]))[0]
            number = spec.arm_joints.index(name) if name in spec.arm_joints else -1
            chain.append((child, index, fixed, joint, number))
    return chain


def _ik_model(robot: ElementTree.Element, spec: RobotSpec) -> tuple[newton.Model, int]:
    """Return a model of the arm alone, without shapes, and the index of the body with the tool frame."""
    import newton  # seconds to load, as newton.ik

    bare = urdf.without_colliders(urdf.without(robot, urdf.below(robot, spec.tool_link) - {spec.tool_link}))
    builder = newton.ModelBuilder()
    builder.add_urdf(ElementTree.tostring(bare, encoding="unicode"), collapse_fixed_joints=False)
    body = next(i for i, label in enumerate(builder.body_label) if label.split("/")[-1] == spec.tool_link)
    return builder.finalize(device="cpu"), body
