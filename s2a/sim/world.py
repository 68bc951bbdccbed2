"""sim.usd -> one Newton world: the robot, the manipulated object, the room's colliders."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import newton
import newton_usd_schemas  # noqa: F401  registers Newton's USD schemas, which must precede the registry's first use
import numpy as np
import warp as wp
from pxr import Usd, UsdGeom

from s2a.articulation import lever_arm, travel
from s2a.errors import InputError
from s2a.ranges import NotNegative
from s2a.robot.model import add_robot
from s2a.robot.spec import Gains, RobotSpec
from s2a.scene import Joint, Mesh
from s2a.usd.joints import read_joint
from s2a.usd.stage import open_stage, read_mesh


@dataclass(frozen=True)
class JointConfig:
    """How the target's joint resists, beside the dry friction that the stage gives it.

    Attributes:
        stiffness: of the spring that draws the part to its scanned pose [N/m] or [N m/rad].
        damping: [N s/m] or [N m s/rad].
    """

    stiffness: NotNegative
    damping: NotNegative


@dataclass(frozen=True)
class SimStage:
    """What sim.usd says beside the physics that Newton reads by itself.

    Attributes:
        path: the file.
        target: id of the part to manipulate.
        joint: how it moves, scene frame.
        base: pose of the robot's base, 7-vector, scene frame.
        grasp: pose of the grasp frame at joint zero, 7-vector, scene frame: z into the furniture, y across the grasp
            region's thin side.
        grasp_size: extents of the grasp region along the grasp frame's axes [m], shape [3].
        region: the annotated grasp region's surface in the part's body frame, its scene pose at joint zero.
        robot: name of the robot that the base pose is for.
    """

    path: Path
    target: str
    joint: Joint
    base: np.ndarray
    grasp: np.ndarray
    grasp_size: np.ndarray
    region: Mesh
    robot: str = "panda"

    @property
    def lever(self) -> float:
        """Path of the grasp point per unit of the joint's coordinate: 1, or the radius [m] of a hinge."""
        return lever_arm(self.joint, self.grasp[:3])

    @property
    def travel(self) -> float:
        """Path length of the grasp point from the scanned pose to the open limit [m]."""
        return travel(self.joint, self.grasp[:3])


def read_stage(path: Path, part: str | None = None) -> SimStage:
    """Read what the simulation needs from a sim.usd; InputError if the file is missing or is another kind of stage."""
    stage = open_stage(path)
    scene = stage.GetDefaultPrim()
    target = part or (scene.GetAttribute("s2a:target").Get() if scene else None)
    joint = stage.GetPrimAtPath(f"/scene/joints/{target}")
    grasp = stage.GetPrimAtPath(f"/scene/{target}/grasp")
    if not target or not joint or not grasp:
        raise InputError(
            f"{path}: not a simulation-ready stage (no s2a:target with a joint and a grasp); run s2a prepare"
        )
    place = UsdGeom.Xformable(grasp).ComputeLocalToWorldTransform(Usd.TimeCode.Default())
    rotation = place.ExtractRotationQuat()
    base = scene.GetAttribute("s2a:baseOrientation").Get()
    return SimStage(
        path=path,
        target=target,
        joint=read_joint(joint),
        base=np.array([*scene.GetAttribute("s2a:basePosition").Get(), *base.GetImaginary(), base.GetReal()]),
        grasp=np.array([*place.ExtractTranslation(), *rotation.GetImaginary(), rotation.GetReal()]),
        grasp_size=np.array(grasp.GetAttribute("s2a:size").Get()),
        region=read_mesh(stage.GetPrimAtPath(f"/scene/{target}/region")),
        robot=scene.GetAttribute("s2a:robot").Get() or "panda",
    )


def build_world(
    stage: SimStage,
    joint: JointConfig,
    dt: float,
    *,
    robot: RobotSpec | None = None,
    gains: Gains | None = None,
    gravity_compensation: bool = True,
    room: bool = True,
    realistic: bool = False,
) -> newton.ModelBuilder:
    """Return a builder of one world.

    Args:
        stage: the stage to load.
        joint: how the target's joint resists.
        dt: physics time step [s]; sets how stiff the joint's limits can be.
        robot: the robot, or None for a world without it.
        gains: of its position controller; None: its own.
        gravity_compensation: its weight is carried.
        room: load the room's colliders.
        realistic: make the robot's joint limits stiff; see add_robot for the rest.
    """
    builder = newton.ModelBuilder()
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    # The default of 0.1 m makes contact candidates of everything within reach of the hand.
    builder.rigid_gap = 0.01
    builder.default_shape_cfg.mu = 1.0
    if robot is not None:
        base = wp.transform(*stage.base[:3], *stage.base[3:])
        add_robot(builder, robot, base, gains=gains, gravity_compensation=gravity_compensation, realistic=realistic)
        for robot_dof in range(len(robot.joints) if realistic else 0):
            stiffen(builder, robot_dof, dt)
    ignore = [] if room else ["/scene/static"]
    builder.add_usd(str(stage.path), ignore_paths=ignore, load_visual_shapes=False)
    dof = builder.joint_qd_start[joint_index(builder, stage.target)]
    builder.joint_target_mode[dof] = newton.JointTargetMode.POSITION
    builder.joint_target_ke[dof] = joint.stiffness
    builder.joint_target_kd[dof] = joint.damping
    stiffen(builder, dof, dt)
    return builder


def body_index(builder: newton.ModelBuilder, name: str) -> int:
    """Return the index of the body whose label ends in `name`."""
    return next(i for i, label in enumerate(builder.body_label) if label.split("/")[-1] == name)


def joint_index(builder: newton.ModelBuilder, name: str) -> int:
    """Return the index of the joint whose label ends in `name`."""
    return next(i for i, label in enumerate(builder.joint_label) if label.split("/")[-1] == name)


def stiffen(builder: newton.ModelBuilder, dof: int, dt: float) -> None:
    """Make one joint's limits and its dry friction as stiff as the time step allows.

    Newton's default limit is so soft that a drawer pulled by 30 N passes it by 0.2 m. MuJoCo's default friction lets an
    oven door creep by 0.4 mm/s though it weighs a third of what the friction holds. MuJoCo keeps a constraint stable down
    to a time constant of two steps; "mode 1" hands solref over unscaled.
    """
    fast = wp.vec2(2.0 * dt, 1.0)
    raw = {"solreflimit": fast, "solreflimit_mode": 1, "solimplimit": (0.99, 0.999, 0.0005, 0.5, 2.0)}
    raw |= {"solreffriction": fast, "solimpfriction": (0.99, 0.999, 0.0005, 0.5, 2.0)}
    for name, value in raw.items():
        attribute = builder.custom_attributes[f"mujoco:{name}"]
        attribute.values = {**(attribute.values or {}), dof: value}
