"""Description of a robot: one arm with a gripper of two fingers, from one YAML file."""

import math
from dataclasses import dataclass, fields
from typing import Annotated

from s2a.core.bounds import Above, NotNegative, Numbers, Positive
from s2a.core.errors import InputError
from s2a.scene.scene import Vec3


@dataclass(frozen=True)
class Gains:
    """Position control of the joints.

    Attributes:
        arm_stiffness: position gain of the arm joints [N m/rad].
        arm_damping: velocity gain of the arm joints [N m s/rad].
        finger_stiffness: position gain of the finger joints [N/m or N m/rad].
        finger_damping: velocity gain of the finger joints [N s/m or N m s/rad].
        finger_effort: limit of a finger joint's force [N] or torque [N m].
        armature: rotor inertia added to every joint [kg m^2 or kg].
    """

    arm_stiffness: NotNegative
    arm_damping: NotNegative
    finger_stiffness: NotNegative
    finger_damping: NotNegative
    finger_effort: NotNegative
    armature: NotNegative


@dataclass(frozen=True)
class Drives:
    """Inertia of the motors and gears, seen from the joints; simulated instead of `Gains.armature` by MotionLimits.drives.

    Attributes:
        rotor_inertia: of each arm joint's drive [kg m^2].
        finger_mass: of the gripper's drive, for each finger joint [kg or kg m^2].
    """

    rotor_inertia: Numbers
    finger_mass: NotNegative


@dataclass(frozen=True)
class GripperSpec:
    """A gripper with two fingers, on slides or on hinges that may move further joints of a linkage.

    Its tool frame has its origin between the pads, z forward (the approach direction), y from the right finger to the left.
    A finger joint's coordinate is 0 where the pads touch and grows as the finger opens; the pads' distance is taken to grow
    evenly with it, which for fingers on hinges is right at both ends.

    Attributes:
        joints: finger joints (left, right): of a linkage those that carry the pads.
        links: finger links (left, right): those with the pads.
        body: link that carries the fingers.
        max_opening: between the pads, fully open [m].
        finger_joint_open: finger joint coordinate, fully open [m or rad].
        finger_joint_home: finger joint coordinate at the start of an episode [m or rad].
        finger_inset: how far each fingertip is mounted nearer to the middle than in the URDF [m].
        finger_box: extents of a fingertip along the tool frame's axes [m].
        tip_ahead: how far the fingertips reach past the tool frame's origin, where they reach farthest [m].
        body_box: extents of the gripper body along the tool frame's axes [m].
        body_behind: distance from the gripper body's front to the tool frame's origin [m].
        finger_speed: maximum speed of each finger joint [m/s or rad/s].
        coupled: one motor drives both fingers.
        closed: coordinates of the finger joints in the robot's file where the pads touch [m or rad].
    """

    joints: tuple[str, str]
    links: tuple[str, str]
    body: str
    max_opening: Positive
    finger_joint_open: Positive
    finger_joint_home: NotNegative
    finger_inset: NotNegative
    finger_box: Vec3
    tip_ahead: NotNegative
    body_box: Vec3
    body_behind: NotNegative
    finger_speed: Positive
    coupled: bool
    closed: tuple[float, float] = (0.0, 0.0)

    @property
    def ratio(self) -> float:
        """Path of a pad for a unit of its finger joint's coordinate [1 or m/rad]: 1 for a slide."""
        return 0.5 * self.max_opening / self.finger_joint_open

    def coordinate(self, opening: float) -> float:
        """Return the finger joints' coordinate [m or rad] at which the pads are at a distance [m]; within their range."""
        return min(max(opening / self.max_opening, 0.0), 1.0) * self.finger_joint_open


@dataclass(frozen=True)
class JointLimits:
    """What the arm's motors and their controller allow, per arm joint; position limits are the URDF's.

    Attributes:
        velocity: [rad/s].
        acceleration: [rad/s^2].
        torque: [N m].
    """

    velocity: Numbers
    acceleration: Numbers
    torque: Numbers


@dataclass(frozen=True)
class MotionLimits:
    """What the arm's controller keeps to, as a real one does.

    Attributes:
        velocity: fraction of the arm's velocity limits that an action of 1 asks for; the fingers' own speed counts whole.
        acceleration: fraction of its acceleration limits with which the commanded velocity changes.
        window: distance of a target from its joint's position at which it stops [rad, m].
        drives: Simulate the robot's drives too: their inertia (Drives), coupled fingers that a push as strong as their drive
            moves no faster than it does; and links that touch each other.
    """

    velocity: Annotated[float, Above(0.0, 1.0)]
    acceleration: Annotated[float, Above(0.0, 1.0)]
    window: Positive
    drives: bool

    def of(self, arm: JointLimits) -> JointLimits:
        """Return what the controller of an arm with these limits lets anyone ask for."""
        velocity = tuple(self.velocity * each for each in arm.velocity)
        return JointLimits(velocity, tuple(self.acceleration * each for each in arm.acceleration), arm.torque)

    def sustained(self, arm: JointLimits, gains: Gains) -> JointLimits:
        """Return what an arm keeps up: a joint at speed v is behind its target, and that may not be a window ahead.

        A position controller of stiffness k and damping d needs a lag of v d / k to overcome its damping; the target brakes at
        a when it is v^2 / (2 a) short of the window. So v d / k + v^2 / (2 a) = window.
        """
        limits, lag = self.of(arm), gains.arm_damping / gains.arm_stiffness
        fastest = [a * (math.sqrt(lag**2 + 2.0 * self.window / a) - lag) for a in limits.acceleration]
        velocity = tuple(min(v, most) for v, most in zip(limits.velocity, fastest, strict=True))
        return JointLimits(velocity, limits.acceleration, arm.torque)


@dataclass(frozen=True)
class BaseSpec:
    """What decides where the robot can stand.

    Attributes:
        shoulder_height: axis of the first joint that lifts the arm, above the base [m].
        upper_arm: from there to the far side of the elbow [m].
        reach: from the shoulder to the gripper body, stretched [m].
        radius: of the vertical column that foot and shoulder fill [m].
        distances: horizontal distances from the base to the grasp point to try, in this order [m].
    """

    shoulder_height: Positive
    upper_arm: Positive
    reach: Positive
    radius: Positive
    distances: Numbers


@dataclass(frozen=True)
class DriveSpec:
    """A base that drives in any direction on a level floor, and a lift on it that carries the arm.

    Its joints are x, y [m] and yaw [rad] of the base on the floor, and the lift's travel [m]. They are commanded by velocities.

    Attributes:
        chassis: extents of the base's box, on the floor, x ahead [m].
        mount: origin of the arm's root link in the frame of the base on the floor, the lift down [m]; its axes are the base's.
        lift: travel of the lift [m].
        column: half the width of the square column that the lift fills [m].
        mass: of the base, and of what the lift carries beside the arm [kg].
        velocity: of x, y, yaw and lift [m/s, rad/s].
        acceleration: likewise [m/s^2, rad/s^2].
        force: that the wheels transmit along x and y, about the vertical, and the lift's [N, N m].
    """

    chassis: Vec3
    mount: Vec3
    lift: Positive
    column: Positive
    mass: tuple[Positive, Positive]
    velocity: tuple[Positive, Positive, Positive, Positive]
    acceleration: tuple[Positive, Positive, Positive, Positive]
    force: tuple[Positive, Positive, Positive, Positive]


@dataclass(frozen=True)
class Attachment:
    """A second file, fixed to a link of the first: a gripper on an arm.

    Attributes:
        model: as RobotSpec.model.
        link: of the first file, to which the root of the second one is fixed.
        position: of that root in the link's frame [m].
        rpy: its rotation, fixed-axis angles as URDF's [rad].
        prefix: before the names of all links and joints of the second file, which the YAML then names so.
    """

    model: str
    link: str
    position: Vec3
    rpy: Vec3
    prefix: str


@dataclass(frozen=True)
class RobotSpec:
    """An arm with a gripper of two fingers.

    Attributes:
        name: of the robot.
        model: its URDF or MJCF, relative to the YAML, or below example-robot-data's folder `robots`.
        root_link: link that is fixed to the base; of the file only what hangs on it is loaded.
        arm_joints: from the base to the gripper.
        tool_offset: origin of the tool frame in the gripper body's frame, turned by `tool_rotation` [m].
        gripper: the parallel gripper.
        home: arm joints at the start of an episode [rad].
        gains: the robot's own controller.
        drives: what it drives beside the links.
        limits: of the arm joints.
        base: what decides where it can stand.
        attach: a second file, such as that of a gripper; null: none.
        tool_rotation: of the tool frame in the file's frame of the gripper body, fixed-axis angles as URDF's [rad].
        fixed_joints: (name, coordinate [rad or m]) of joints that are neither the arm's nor the gripper's; others are fixed at 0.
        drive: the base that drives; null: it stands still, on a pedestal of any height.
        like: robot of this package that has all values which the YAML does not give; empty: it gives all.
    """

    name: str
    model: str
    root_link: str
    arm_joints: tuple[str, ...]
    tool_offset: Vec3
    gripper: GripperSpec
    home: tuple[float, ...]
    gains: Gains
    drives: Drives
    limits: JointLimits
    base: BaseSpec
    attach: Attachment | None = None
    tool_rotation: Vec3 = (0.0, 0.0, 0.0)
    fixed_joints: tuple[tuple[str, float], ...] = ()
    drive: DriveSpec | None = None
    like: str = ""

    def __post_init__(self) -> None:
        """Raise InputError unless there is one value per arm joint."""
        lists = {"home": self.home, "drives.rotor_inertia": self.drives.rotor_inertia}
        lists |= {f"limits.{f.name}": getattr(self.limits, f.name) for f in fields(JointLimits)}
        for key, values in lists.items():
            if len(values) != len(self.arm_joints):
                raise InputError(
                    f"robot {self.name!r}: {key} has {len(values)} values; give one for each of the "
                    f"{len(self.arm_joints)} arm joints"
                )

    @property
    def base_joints(self) -> int:
        """Number of the joints of a base that drives: 4, or 0."""
        return 0 if self.drive is None else len(self.drive.velocity)

    @property
    def tool_link(self) -> str:
        """Link that carries the tool frame: the gripper body."""
        return self.gripper.body

    @property
    def joints(self) -> tuple[str, ...]:
        """All driven joints in the order of a world's coordinates: the arm, then the fingers."""
        return (*self.arm_joints, *self.gripper.joints)

    @property
    def recorded(self) -> tuple[str, ...]:
        """Columns of a recording: time [s]; all joints [rad, m]; the arm's torques, on the side of the links [N m]."""
        return ("time", *self.joints, *(f"{name}_torque" for name in self.arm_joints))

    @property
    def start(self) -> tuple[float, ...]:
        """Coordinates of `joints` at the start of an episode [rad, m]."""
        return (*self.home, *2 * (self.gripper.finger_joint_home,))
