"""A robot in a Newton model: arm and gripper, or the gripper alone."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence

import newton
import numpy as np
import warp as wp
from scipy.spatial.transform import Rotation

from s2a.core.errors import InputError
from s2a.robot import urdf
from s2a.robot.collision import base_solids
from s2a.robot.kinematics import base_coordinates
from s2a.robot.spec import DriveSpec, Gains, RobotSpec


def add_robot(
    builder: newton.ModelBuilder,
    spec: RobotSpec,
    base: wp.transform,
    *,
    gains: Gains | None = None,
    gravity_compensation: bool = True,
    visuals: bool = False,
    realistic: bool = False,
    coupled_fingers: bool = False,
    height: float = 0.0,
) -> None:
    """Add a robot, fixed at `base`, as the first articulation of a world.

    Its coordinates are `spec.joints`, at `spec.start`; then the joints that mimic a finger joint, undriven. Those of a base that
    drives come before them: x, y, yaw and lift. Colliders are the convex hulls of its links' collision meshes.

    Args:
        builder: an empty world.
        spec: the robot.
        base: pose of its root link.
        gains: of the position controller; None: the robot's own.
        gravity_compensation: MuJoCo carries the robot's weight.
        visuals: load visual meshes too.
        realistic: let links touch each other, except NEIGHBOURS; drives have their inertia; couple the fingers if one motor
            drives both, let them follow target velocities too, and yield no faster than at their speed to the drive's own force.
        coupled_fingers: couple them so in any case.
        height: of the root link above the floor on which a base drives [m].

    Raises:
        InputError: the URDF's joints are not those of the spec, in this order.
    """
    gains, first_joint, lift = gains or spec.gains, builder.joint_count, -1
    if spec.drive is not None:
        lift, first_joint = _add_drive(builder, spec.drive, base, height), first_joint + 2
    first_body = _add_links(builder, urdf.arm(spec, visuals), base if lift < 0 else wp.transform_identity(), lift)
    joints = range(first_joint, builder.joint_count)
    moving = [i for i in joints if builder.joint_type[i] != newton.JointType.FIXED]
    names = tuple(builder.joint_label[i].split("/")[-1] for i in moving)[: len(spec.joints)]
    if names != spec.joints:
        raise InputError(
            f"robot {spec.name!r}: the URDF's joints are {', '.join(names)}; arm_joints and gripper.joints are "
            f"{', '.join(spec.joints)}"
        )
    moving, arm = moving[: len(names)], len(spec.arm_joints)
    drives, finger_damping = spec.drives, gains.finger_damping
    armature = (gains.armature,) * len(moving)
    if realistic:
        armature = (*drives.rotor_inertia, *2 * (drives.finger_mass,))
        finger_damping = gains.finger_effort / spec.gripper.finger_speed
    modes = [newton.JointTargetMode.POSITION] * len(moving)
    if realistic:
        modes[arm:] = [newton.JointTargetMode.POSITION_VELOCITY] * 2
    efforts = (*spec.limits.torque, *2 * (gains.finger_effort,))
    for k, (i, start) in enumerate(zip(moving, spec.start, strict=True)):
        dof = builder.joint_qd_start[i]
        builder.joint_target_ke[dof] = gains.arm_stiffness if k < arm else gains.finger_stiffness
        builder.joint_target_kd[dof] = gains.arm_damping if k < arm else finger_damping
        builder.joint_armature[dof] = armature[k]
        builder.joint_effort_limit[dof] = efforts[k]
        builder.joint_target_mode[dof] = modes[k]
        builder.joint_q[builder.joint_q_start[i]] = builder.joint_target_q[dof] = start
    _follow(builder, first_body)
    if gravity_compensation:
        _compensate_gravity(builder, first_body)
    if realistic:
        _allow_self_collision(builder, first_body)
    if realistic or coupled_fingers:
        _couple_fingers(builder, spec, moving)


STIFF = 2.0 * np.pi * 4.0  # [rad/s] Natural frequency, critically damped, with which a base's joints hold their targets
CARRIED = 25.0  # [kg] What the arm adds to a base's mass as its joints are tuned


def _add_drive(builder: newton.ModelBuilder, drive: DriveSpec, base: wp.transform, height: float) -> int:
    """Add a base that drives and its lift, so that the arm's root link is at a pose; return the index of the lift's body.

    The arm's root link has the frame of that body.
    """
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.from_quat(np.array(base.q)).as_matrix(), np.array(base.p)
    first, floor = builder.joint_count, float(pose[2, 3]) - height
    box, column = base_solids(drive)
    bodies = []
    for name, mass, solid in (("drive_base", drive.mass[0], box), ("drive_lift", drive.mass[1], column)):
        solid.density = mass / solid.volume
        inertia = wp.mat33(solid.moment_inertia)
        center = wp.vec3(solid.center_mass)
        body = builder.add_link(label=name, mass=mass, com=center, inertia=inertia, lock_inertia=True)
        mesh = newton.Mesh(solid.vertices, solid.faces.ravel(), compute_inertia=False)
        builder.add_shape_convex_hull(body, mesh=mesh)
        bodies.append(body)
    slide, turn = newton.ModelBuilder.JointDofConfig, newton.ModelBuilder.JointDofConfig
    axes = [slide(axis=newton.Axis.X), slide(axis=newton.Axis.Y)]
    there, up = (
        wp.transform(wp.vec3(0.0, 0.0, floor), wp.quat_identity()),
        wp.transform(drive.mount, wp.quat_identity()),
    )
    builder.add_joint_d6(
        -1, bodies[0], linear_axes=axes, angular_axes=[turn(axis=newton.Axis.Z)], parent_xform=there, label="drive"
    )
    limits = {"limit_lower": 0.0, "limit_upper": drive.lift}
    builder.add_joint_prismatic(bodies[0], bodies[1], parent_xform=up, axis=newton.Axis.Z, label="lift", **limits)
    builder.add_articulation([first, first + 1], label="robot")
    mass = sum(drive.mass) + CARRIED
    across = drive.chassis[0] ** 2 + drive.chassis[1] ** 2
    loads = mass, mass, mass * across / 12.0, drive.mass[1] + CARRIED
    start = base_coordinates(drive, pose, height)
    for k, (load, at) in enumerate(zip(loads, start, strict=True)):
        dof = builder.joint_qd_start[first] + k
        builder.joint_target_mode[dof] = newton.JointTargetMode.POSITION_VELOCITY
        builder.joint_target_ke[dof], builder.joint_target_kd[dof] = load * STIFF**2, 2.0 * load * STIFF
        builder.joint_effort_limit[dof] = drive.force[k]
        builder.joint_q[builder.joint_q_start[first] + k] = builder.joint_target_q[dof] = float(at)
    _compensate_gravity(builder, bodies[1])
    return bodies[1]


# Links with so few driven joints between them do not touch each other: their hulls overlap around the joints
NEIGHBOURS = 2


def _allow_self_collision(builder: newton.ModelBuilder, first_body: int) -> None:
    """Let the links of a robot touch each other, except those that are NEIGHBOURS."""
    depth = dict.fromkeys(range(first_body, builder.body_count), 0)
    for parent, child, kind in zip(builder.joint_parent, builder.joint_child, builder.joint_type, strict=True):
        if child >= first_body:
            depth[child] = depth.get(parent, 0) + (kind != newton.JointType.FIXED)
    link = dict(enumerate(builder.shape_body))
    builder.shape_collision_filter_pairs[:] = [
        (a, b)
        for a, b in builder.shape_collision_filter_pairs
        if link[a] not in depth or link[b] not in depth or abs(depth[link[a]] - depth[link[b]]) <= NEIGHBOURS
    ]


# [kg m^2] Of a joint that mimics another: MuJoCo's equality is the stiffer the more inertia it moves. That of the
# drivers in menagerie's 2F-85
FOLLOWER_ARMATURE = 0.005


def _follow(builder: newton.ModelBuilder, first_body: int) -> None:
    """Let joints that mimic others be undriven, and begin where those are."""
    for i, child in enumerate(builder.joint_child):
        if child >= first_body and (leader := builder.joint_mimic_joint[i]) >= 0:
            dof, (offset, multiplier) = builder.joint_qd_start[i], builder.joint_mimic_coeffs[i]
            builder.joint_target_mode[dof] = newton.JointTargetMode.NONE
            builder.joint_armature[dof] = FOLLOWER_ARMATURE
            builder.joint_target_ke[dof] = builder.joint_target_kd[dof] = 0.0
            leading = builder.joint_q[builder.joint_q_start[leader]]
            builder.joint_q[builder.joint_q_start[i]] = offset + multiplier * leading


def _couple_fingers(builder: newton.ModelBuilder, spec: RobotSpec, moving: Sequence[int]) -> None:
    """Let the right finger follow the left one, if one motor drives both; what mimics the right one then mimics the left one."""
    if spec.gripper.coupled:
        left, right = moving[-2:]
        for joint, leader in enumerate(builder.joint_mimic_joint):
            if leader == right:
                builder.set_joint_mimic(joint, left, coeffs=builder.joint_mimic_coeffs[joint])
        builder.set_joint_mimic(right, left)


def add_gripper(builder: newton.ModelBuilder, spec: RobotSpec, pose: wp.transform) -> None:
    """Add the gripper alone, its body held at `pose`: two free fingers, convex colliders, no drive, weightless."""
    _compensate_gravity(builder, _add_links(builder, urdf.gripper(spec), pose))


def _add_links(builder: newton.ModelBuilder, robot: ElementTree.Element, pose: wp.transform, parent: int = -1) -> int:
    """Add a URDF's links at a pose, their collision meshes as convex hulls; return the index of the first body.

    `parent`: body to which the first one is fixed, in whose frame the pose is then; -1: the world.
    """
    first_shape, first_body = builder.shape_count, builder.body_count
    builder.add_urdf(
        ElementTree.tostring(urdf.followers_last(robot), encoding="unicode"),
        package_dirs=[str(urdf.description_folder())],
        xform=pose,
        parent_body=parent,
        enable_self_collisions=False,
        collapse_fixed_joints=False,
        joint_ordering=None if robot.find("joint/mimic") is not None else "dfs",
    )
    shapes = range(first_shape, builder.shape_count)
    meshes = [i for i in shapes if builder.shape_type[i] == newton.GeoType.MESH and _collides(builder, i)]
    builder.approximate_meshes("convex_hull", shape_indices=meshes)
    return first_body


def _compensate_gravity(builder: newton.ModelBuilder, first_body: int) -> None:
    """Let MuJoCo carry the weight of all bodies from the given one on."""
    compensation = builder.custom_attributes["mujoco:gravcomp"]
    compensation.values = {**(compensation.values or {}), **{i: 1.0 for i in range(first_body, builder.body_count)}}


def _collides(builder: newton.ModelBuilder, shape: int) -> bool:
    return bool(builder.shape_flags[shape] & newton.ShapeFlags.COLLIDE_SHAPES)
