"""sim.usd -> one Newton world: the robot, the manipulated object, the room's colliders."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import newton
import newton_usd_schemas  # noqa: F401  registers Newton's USD schemas, which must precede the registry's first use
import numpy as np
import warp as wp

from s2a.core.bounds import NotNegative
from s2a.core.errors import InputError
from s2a.robot import load, names
from s2a.robot.model import add_robot
from s2a.robot.spec import Gains, RobotSpec
from s2a.scene.articulation import lever_arm, travel
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.mesh_query import nearest_faces, ray_mesh
from s2a.scene.scene import Joint, Mesh
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import ALL, DEFAULT_ROBOT, Articulation, Base, SimRoom
from s2a.sim.room import Workspace, add_pedestal, add_room, kept_bodies, pedestal, workspace

OPPOSED = -0.5  # Cosine between the forces of both fingers below which they pinch: more than 120 degrees apart
SECTION = 0.03  # [m] A handle's section is no thicker, so that its unseen side is no farther from the seen one
# [N/m] Stiffness of what lies free at a point of contact. Ten times as much made a bottle of 170 g tremble between
# the pads, and fall: the solver did not converge
SURFACE = 3e4
# [m] Depth in which the stiffness is reached. What is as stiff from the surface on sinks in by so little under its
# own weight that contacts come and go: a wine glass of 24 g falls over by itself
SKIN = 0.0003
# Impedances of MuJoCo's constraints: its default's lower end, and where rows become too stiff for single precision
SOFTEST, HARDEST = 0.9, 0.999
RAW = 1  # Newton's `solref_mode` that hands solref over unscaled


def stiffen(builder: newton.ModelBuilder, dof: int, dt: float) -> None:
    """Make one joint's limits and its dry friction as stiff as the time step allows.

    Newton's default limit is so soft that a drawer pulled by 30 N passes it by 0.2 m. MuJoCo's default friction lets an
    oven door creep by 0.4 mm/s though it weighs a third of what the friction holds. MuJoCo keeps a constraint stable down
    to a time constant of two steps.
    """
    fast = wp.vec2(2.0 * dt, 1.0)
    raw = {"solreflimit": fast, "solreflimit_mode": RAW, "solimplimit": (0.99, 0.999, 0.0005, 0.5, 2.0)}
    raw |= {"solreffriction": fast, "solimpfriction": (0.99, 0.999, 0.0005, 0.5, 2.0)}
    for name, value in raw.items():
        _set(builder, name, dof, value)


def harden(builder: newton.ModelBuilder, body: int, dt: float) -> None:
    """Give a body that lies free a stiffness of SURFACE at each point of contact, as near as the time step allows.

    MuJoCo's contacts are springs in proportion to the mass that they move: by default pads that press an eraser of 20 g with
    20 N sink in by 5 mm each, and squeeze it out. A constraint of impedance d and time constant t that moves a mass m has a
    stiffness of m d / ((1 - d) t^2), up to a factor of d^2 (MuJoCo's documentation, "Modeling", solver parameters).
    """
    time = 2.0 * dt
    ratio = SURFACE * time**2 / builder.body_mass[body]
    impedance = min(max(ratio / (1.0 + ratio), SOFTEST), HARDEST)
    raw = {"solref": wp.vec2(time, 1.0), "solref_mode": RAW, "geom_solimp": (SOFTEST, impedance, SKIN, 0.5, 2.0)}
    for shape in builder.body_shapes[body]:
        for name, value in (raw | {"geom_priority": 1}).items():
            _set(builder, name, shape, value)


def _set(builder: newton.ModelBuilder, name: str, index: int, value: object) -> None:
    attribute = builder.custom_attributes[f"mujoco:{name}"]
    attribute.values = {**(attribute.values or {}), index: value}


LOCKED_ARMATURE = 1e6  # [kg or kg m^2] Of an axis that only fills a place


@dataclass(frozen=True)
class JointConfig:
    """How the target's joint resists, beside the dry friction that the stage gives it, unless a stage has what was identified.

    Attributes:
        stiffness: stiffness of the spring that draws the part to its scanned pose [N/m]; of `spring` "joint" [N/m] or [N m/rad].
        damping: viscous damping of the part's joint [N s/m] or [N m s/rad].
        spring: "grasp": the spring's force grows with the path of the grasp point, on every lever arm alike; "joint": with
            the joint's coordinate.
    """

    stiffness: NotNegative
    damping: NotNegative
    spring: Literal["grasp", "joint"]

    def joint_stiffness(self, part: Articulation) -> float:
        """Return the spring of a part's joint, per unit of its coordinate [N/m] or [N m/rad]: the stage's, if it has one.

        A force of k s at the grasp point, s = L q along its path, turns a hinge of lever arm L by the moment k L^2 q. For a
        slide L is 1.
        """
        if part.resistance is not None and part.resistance.stiffness is not None:
            return part.resistance.stiffness
        arm = lever_arm(part.joint, np.array(part.grasp.point)) if self.spring == "grasp" else 1.0
        return self.stiffness * arm**2

    def joint_damping(self, part: Articulation) -> float:
        """Return the damping of a part's joint [N s/m] or [N m s/rad]: the stage's, if it has one."""
        identified = None if part.resistance is None else part.resistance.damping
        return self.damping if identified is None else identified


@dataclass(frozen=True)
class SimStage:
    """One articulated part of a simulation-ready room, and what a robot needs to know of it."""

    path: Path  # the file
    target: str  # id of the part
    joint: Joint  # how it moves, scene frame
    base: np.ndarray  # pose of the robot's base, 7-vector, scene frame
    # pose of the grasp frame at joint zero, 7-vector, scene frame: z into the furniture, y across the grasp
    # region's thin side
    grasp: np.ndarray
    grasp_size: np.ndarray  # extents of the grasp region along the grasp frame's axes [m], shape [3]
    region: Mesh  # the annotated surface to grasp, in the target's body frame, which at joint zero is the scene's
    # height and radius of the column under the robot's base [m]; no height: it stands on the floor
    pedestal: tuple[float, float] = (0.0, 0.0)
    robot: str = DEFAULT_ROBOT  # name of the robot that the base pose is for
    # ids of further parts and free objects that move, ALL for every one; everything else of the room is frozen at its
    # scanned pose
    also: tuple[str, ...] = ()
    # pose of the tool, closed, in which it pushes the part instead of holding it, at joint zero, 7-vector, scene frame
    push: np.ndarray | None = None
    internal: bool = False  # the gripper holds the region from within, by opening
    room: SimRoom = field(kw_only=True, repr=False)  # all of the file but its visuals

    @property
    def is_live(self) -> bool:
        """Whether everything in the room that can move does."""
        return ALL in self.also

    @property
    def active(self) -> tuple[str, ...]:
        """Ids of all that moves, the target first."""
        also = (*self.also, *self.room.movable) if self.is_live else self.also
        return tuple(i for i in dict.fromkeys((self.target, *also)) if i != ALL)

    @property
    def lever_arm(self) -> float:
        """Path of the grasp point per unit of the joint's coordinate: 1, or the radius [m] of a hinge."""
        return lever_arm(self.joint, self.grasp[:3])

    @property
    def travel(self) -> float:
        """Path length of the grasp point from the scanned pose to the open limit [m]."""
        return travel(self.joint, self.grasp[:3])

    def workspace(self) -> Workspace:
        """Return where something can be touched: near which colliders of the room are loaded, unless it is live."""
        return workspace(self.room, self.active, self.base, self.robot)


def read_stage(path: Path, part: str | None = None, *, robot: str | None = None, also: Sequence[str] = ()) -> SimStage:
    """Read what a simulation needs to know of one articulated part.

    Args:
        path: a simulation-ready room.
        part: id of the part; None: the only one of the room.
        robot: name of the robot; None: the one that the part was prepared for, the default robot if for several.
        also: ids of further parts and free objects that move; [ALL]: every one.

    Raises:
        InputError: no such file, or another kind of stage; no such part, or none is named where the room has several; no
            base pose for the robot; an id of `also` that cannot move.
    """
    return stage_of(path, sim_stage.read(path, visuals=False), part, robot=robot, also=also)


def stage_of(
    path: Path, room: SimRoom, part: str | None, *, robot: str | None = None, also: Sequence[str] = ()
) -> SimStage:
    """Return what `read_stage` does, of a room that was read from `path`."""
    target = room.part(part)
    articulation = room.articulations[target]
    kept_bodies(room, (target, *(i for i in also if i != ALL)))
    bases = articulation.bases
    robot = robot or (DEFAULT_ROBOT if DEFAULT_ROBOT in bases or not bases else next(iter(bases)))
    drives = robot in names() and load(robot).drive is not None
    if robot not in bases and not drives:
        others = f", but for: {', '.join(bases)}; give robot={next(iter(bases))}" if bases else ""
        raise InputError(
            f"{path}: part {target!r} has no base pose for robot {robot!r}{others}, or run s2a prepare robot={robot}"
        )
    # One that drives finds its own.
    base, grasp = Base((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)) if drives else bases[robot], articulation.grasp
    return SimStage(
        path=path,
        target=target,
        joint=articulation.joint,
        base=np.array([*base.position, *base.orientation]),
        grasp=np.array([*grasp.point, *grasp.orientation]),
        grasp_size=np.array(grasp.size),
        region=grasp.region,
        internal=grasp.internal,
        pedestal=(base.pedestal, base.radius),
        robot=robot,
        also=tuple(also),
        room=room,
    )


def build_world(
    stage: SimStage,
    joint: JointConfig,
    dt: float,
    *,
    robot: RobotSpec | None = None,
    gains: Gains | None = None,
    gravity_compensation: bool = True,
    static_colliders: bool = True,
    realistic: bool = False,
    coupled_fingers: bool = False,
    both_kinds: bool = False,
) -> newton.ModelBuilder:
    """Return a builder of one world.

    Args:
        stage: the stage to load.
        joint: how the target's joint resists.
        dt: physics time step [s]; sets how stiff the joint's limits can be.
        robot: the robot, or None for a world without it.
        gains: of its position controller; None: its own.
        gravity_compensation: its weight is carried.
        static_colliders: Load the room's colliders.
        realistic: simulate the robot's drives too; see add_robot.
        coupled_fingers: couple the fingers also where drives are not simulated.
        both_kinds: give the target a slide and a hinge, one of them locked: all worlds of a batch need the same joints.
    """
    builder = empty_world()
    if robot is not None:
        base = wp.transform(*stage.base[:3], *stage.base[3:])
        add_robot(
            builder,
            robot,
            base,
            gains=gains,
            gravity_compensation=gravity_compensation,
            realistic=realistic,
            coupled_fingers=coupled_fingers,
            height=stage.pedestal[0],
        )
    _add_room(builder, stage, static=static_colliders, both_kinds=both_kinds)
    for part in stage.active:
        if part in stage.room.free:
            harden(builder, body_index(builder, part), dt)
        if part in stage.room.articulations:
            dof = axis_of(builder, part, stage.room.articulations[part].joint.kind)[1]
            builder.joint_target_mode[dof] = newton.JointTargetMode.POSITION
            builder.joint_target_ke[dof] = joint.joint_stiffness(stage.room.articulations[part])
            builder.joint_target_kd[dof] = joint.joint_damping(stage.room.articulations[part])
            stiffen(builder, dof, dt)
    if both_kinds:
        locked = axis_of(builder, stage.target, "revolute" if stage.joint.kind == "prismatic" else "prismatic")[1]
        builder.joint_armature[locked] = LOCKED_ARMATURE
        builder.joint_target_mode[locked] = (
            newton.JointTargetMode.POSITION
        )  # of no stiffness: what one world drives, all do
        stiffen(builder, locked, dt)
    return builder


def empty_world() -> newton.ModelBuilder:
    """Return a builder that can read MuJoCo's attributes, with the contacts of all worlds."""
    builder = newton.ModelBuilder()
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    # The default of 0.1 m makes contact candidates of everything within reach of the gripper.
    builder.rigid_gap = 0.01
    builder.default_shape_cfg.mu = 1.0
    return builder


def _add_room(builder: newton.ModelBuilder, stage: SimStage, *, static: bool, both_kinds: bool) -> None:
    """Add what is active of a room, what it hangs on, and the colliders near it."""
    space = None if stage.is_live else stage.workspace()
    doubled = [stage.target] if both_kinds else []
    opened = sim_stage.open_physics(stage.path)
    add_room(builder, stage.room, opened, stage.active, space=space, static=static, both_kinds=doubled)
    drives = load(stage.robot).drive is not None
    stand = None if drives else pedestal(stage.base, *stage.pedestal)
    if static and stand is not None:
        add_pedestal(builder, stand)


def body_index(builder: newton.ModelBuilder, name: str) -> int:
    """Return the index of the body whose label ends in `name`."""
    return next(i for i, label in enumerate(builder.body_label) if label.split("/")[-1] == name)


def joint_index(builder: newton.ModelBuilder, name: str) -> int:
    """Return the index of the joint whose label ends in `name`."""
    return next(i for i, label in enumerate(builder.joint_label) if label.split("/")[-1] == name)


def axis_of(builder: newton.ModelBuilder, part: str, kind: str) -> tuple[int, int]:
    """Return coordinate and velocity of a part's slide or hinge within a world; of two axes the slide is the first."""
    body = body_index(builder, part)  # a free joint has no name of its own
    joint = builder.joint_child.index(body)
    further = int(kind == "revolute" and sum(builder.joint_dof_dim[joint]) == 2)
    return builder.joint_q_start[joint] + further, builder.joint_qd_start[joint] + further


def touched(stage: SimStage) -> Mesh:
    """Return the surface on which a contact is on the grasp region: what was scanned of it, and hulls that complete it.

    No scanner sees behind a handle, where a finger presses. A hull completes the region if it stands for another part than the
    target, which is the handle's way to be one, and lies nowhere farther than SECTION from the scanned region.
    """
    hulls = [c.mesh for c in (stage.room.bodies | stage.room.free)[stage.target].colliders if c.part != stage.target]
    surface = ray_mesh(stage.region.vertices, stage.region.faces)
    return merge([stage.region, *(h for h in hulls if (nearest_faces(surface, h.vertices, SECTION)[0] >= 0).all())])
