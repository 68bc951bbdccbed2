"""The Franka Panda: its description, gains and frames.

The URDF and meshes are example-robot-data's (panda_description, Apache-2.0).
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from importlib.metadata import files
from pathlib import Path

import newton
import warp as wp

from s2a.ranges import NotNegative

ARM_JOINTS = 7
"""Joints of the arm; coordinates 0 to 6 of a world."""
JOINTS = 9
"""Joints of the arm and the two fingers; coordinates 0 to 8 of a world."""
TOOL_OFFSET = 0.1034
"""[m] From the hand's frame forward to the point between the finger pads."""


@dataclass(frozen=True)
class FrankaConfig:
    """How the robot is driven.

    Attributes:
        arm_stiffness: position gain of the arm's joints [N m/rad].
        arm_damping: velocity gain of the arm's joints [N m s/rad].
        finger_stiffness: position gain of the fingers [N/m].
        finger_damping: velocity gain of the fingers [N s/m].
        finger_effort: largest force of a finger [N].
        armature: rotor inertia added to every joint [kg m^2 or kg].
        gravity_compensation: whether the robot's weight is taken off.
        start: joint positions at reset, seven of the arm [rad], two of the fingers [m].
    """

    arm_stiffness: NotNegative
    arm_damping: NotNegative
    finger_stiffness: NotNegative
    finger_damping: NotNegative
    finger_effort: NotNegative
    armature: NotNegative
    gravity_compensation: bool
    start: tuple[float, float, float, float, float, float, float, float, float]


def add_franka(builder: newton.ModelBuilder, config: FrankaConfig, base: wp.transform, visuals: bool = False) -> None:
    """Add the robot, fixed at `base`, as the first articulation of a world; with its looks, if a camera is to see it.

    Colliders are the convex hulls of its links' collision meshes; the links do not collide with each other. The fingers
    are driven one by one: the URDF's mimic joint would become a soft equality in MuJoCo.
    """
    first_body = _add_links(builder, _urdf(visuals), base)
    for i in range(JOINTS):
        arm = i < ARM_JOINTS
        builder.joint_target_ke[i] = config.arm_stiffness if arm else config.finger_stiffness
        builder.joint_target_kd[i] = config.arm_damping if arm else config.finger_damping
        builder.joint_armature[i] = config.armature
        builder.joint_target_mode[i] = newton.JointTargetMode.POSITION
        builder.joint_q[i] = builder.joint_target_q[i] = config.start[i]
        if not arm:
            builder.joint_effort_limit[i] = config.finger_effort
    if config.gravity_compensation:
        _hold_weight(builder, first_body)


def add_hand(builder: newton.ModelBuilder, pose: wp.transform) -> None:
    """Add the robot's hand alone, held at `pose`: two free fingers, convex colliders, no drive, weightless.

    Its frame is `panda_hand`: z forward, the fingers move along y, the point between their pads is TOOL_OFFSET ahead.
    """
    first_body = _add_links(builder, _hand_urdf(), pose)
    _hold_weight(builder, first_body)


def _add_links(builder: newton.ModelBuilder, urdf: str, pose: wp.transform) -> int:
    """Add a URDF's links at a pose, their collision meshes as convex hulls; return the index of the first body."""
    first_shape, first_body = builder.shape_count, builder.body_count
    builder.add_urdf(
        urdf,
        package_dirs=[str(_share())],
        xform=pose,
        enable_self_collisions=False,
        collapse_fixed_joints=False,
    )
    shapes = range(first_shape, builder.shape_count)
    meshes = [i for i in shapes if builder.shape_type[i] == newton.GeoType.MESH and _collides(builder, i)]
    builder.approximate_meshes("convex_hull", shape_indices=meshes)
    return first_body


def _hold_weight(builder: newton.ModelBuilder, first_body: int) -> None:
    """Let MuJoCo carry the weight of all bodies from the given one on."""
    compensation = builder.custom_attributes["mujoco:gravcomp"]
    compensation.values = {**(compensation.values or {}), **{i: 1.0 for i in range(first_body, builder.body_count)}}


def _hand_urdf() -> str:
    """Return the part of the URDF that is the hand and its fingers."""
    robot = ElementTree.fromstring(_urdf(visuals=False))
    kept = {"panda_hand", "panda_leftfinger", "panda_rightfinger"}
    for tag, names in (("link", lambda e: {e.get("name")}), ("joint", _ends)):
        for element in robot.findall(tag):
            if not names(element) <= kept:
                robot.remove(element)
    return ElementTree.tostring(robot, encoding="unicode")


def _ends(joint: ElementTree.Element) -> set[str | None]:
    return {link.get("link") for end in ("parent", "child") for link in joint.findall(end)}


def _collides(builder: newton.ModelBuilder, shape: int) -> bool:
    return bool(builder.shape_flags[shape] & newton.ShapeFlags.COLLIDE_SHAPES)


def _urdf(visuals: bool) -> str:
    """Return the robot's URDF as text, without the mimic tag, and without visuals (DAE files) where nobody looks."""
    path = _share() / "example-robot-data/robots/panda_description/urdf/panda.urdf"
    robot = ElementTree.parse(path).getroot()
    for link in robot.iter("link"):
        for visual in [] if visuals else link.findall("visual"):
            link.remove(visual)
    for joint in robot.iter("joint"):
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)
    return ElementTree.tostring(robot, encoding="unicode")


def _share() -> Path:
    """Return the folder that holds example-robot-data's packages."""
    for file in files("example-robot-data") or []:
        if file.name == "panda.urdf":
            return Path(str(file.locate())).parents[4]
    raise FileNotFoundError("panda.urdf of the package example-robot-data; reinstall the requirements")
