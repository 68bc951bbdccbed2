"""The two structs that kernels and terms of all tasks take, State of every environment and World of a task, and their binding."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
from collections.abc import Iterable, Sequence
from enum import IntEnum
from typing import Any

import numpy as np
import warp as wp

from s2a.scene.articulation import opening_sign
from s2a.sim.contacts import ContactSensor, PartContacts
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage

# Columns of a result after the task's: the episode was ended by a value that is not finite; its world dropped
# constraint rows, which ends it too; contacts were dropped in some step, whose pool all worlds share, so that it
# concerns all at once
ERRORS = ("invalid", "row_overflow", "contact_overflow")


def columns(names: Iterable[str]) -> Any:
    """Return an enumeration of columns by name, from 0, that kernels can use as indices."""
    return IntEnum("Column", list(names), start=0)


Error = columns(ERRORS)


@wp.struct
class State:
    """All worlds. Of the coordinates of a world the robot's come first: its arm, then its fingers."""

    joints: int  # number of the robot's joints; the first `arm` of them are the arm's
    arm: int
    # joint_q, joint_qd: coordinates [m or rad] and velocities, shape [world coord]
    joint_q: wp.array2d(dtype=float)
    joint_qd: wp.array2d(dtype=float)
    body_q: wp.array2d(dtype=wp.transform)  # poses, shape [world body]
    torque: wp.array2d(dtype=float)  # forces of the joints' drives [N m or N], shape [world dof]
    # lower, upper: limits of the robot's joints [rad, m], shape [joint]
    lower: wp.array(dtype=float)
    upper: wp.array(dtype=float)
    # 1 where the gripper holds by opening, shape [world]. There an action of the fingers, and what a policy
    # observes of them, are mirrored, so that they mean the same: an action of -1 grips, and a finger that grips
    # is seen to close
    internal: wp.array(dtype=int)
    target_q: wp.array2d(dtype=float)  # joint targets, shape [world coord]
    target_qd: wp.array2d(dtype=float)  # commanded velocities of the robot's joints [rad/s, m/s], shape [world dof]
    requested_qd: wp.array2d(dtype=float)  # those that the action requests
    action: wp.array2d(dtype=float)  # in [-1, 1], shape [world action]
    # the latest actions, the newest first, shape [world delay action]; none where no action comes late
    past: wp.array3d(dtype=float)
    delay: wp.array(dtype=int)  # by how many control steps actions come late, shape [world]
    observation: wp.array2d(dtype=float)  # shape [world observation]
    privileged: wp.array2d(dtype=float)  # what a critic is told besides, shape [world number]
    terms: wp.array2d(dtype=float)  # unweighted reward terms, shape [world term]
    reward: wp.array(dtype=float)  # their weighted sum, shape [world]
    terminated: wp.array(dtype=int)  # 1 where the task ends the episode, shape [world]
    # done, time_out: 1 where the episode ended, and where it did by its length alone, shape [world]
    done: wp.array(dtype=int)
    time_out: wp.array(dtype=int)
    step: wp.array(dtype=int)  # control steps since the reset, shape [world]
    # step of the demonstration on which the episode began, -1 where it began before the first, shape [world]
    begun: wp.array(dtype=int)
    uncounted: wp.array(dtype=int)  # 1 where the running episode shall not be counted, shape [world]
    overflow: wp.array(dtype=int)  # mujoco_warp's overflow bits since the last control step, shape [world]
    dropped: wp.array2d(dtype=int)  # 1 where the episode lost constraint rows (0), contacts (1), shape [world 2]
    # how the last finished episode went, shape [world column]: the task's columns, then ERRORS
    result: wp.array2d(dtype=float)
    errors: int  # column of the first of ERRORS
    # sums over finished episodes: their number, then the columns of `result`, shape [1 + column]
    counts: wp.array(dtype=float)
    rng: wp.array(dtype=wp.uint32)  # random streams, shape [world]


@wp.func
def sense(s: State, world: int, joint: int):
    """Return -1 for a finger that holds by opening, else 1."""
    return wp.where(joint >= s.arm and s.internal[world] == 1, -1.0, 1.0)


@wp.func
def finger_position(s: State, world: int, joint: int, position: float):
    """Return a joint's position [rad, m], that of a finger which holds by opening counted from its other limit."""
    if sense(s, world, joint) < 0.0:
        return s.lower[joint] + s.upper[joint] - position
    return position


@wp.func
def is_sound(s: State, world: int):
    """Return 1 where physics held in a finished episode, else 0: such an episode is no success."""
    broken = s.result[world, s.errors + Error.invalid] + s.result[world, s.errors + Error.row_overflow]
    return wp.where(broken > 0.0, 0.0, 1.0)


def allocate(sim: Simulation, observations: int, privileged: int, terms: int, results: int, delays: int) -> State:
    """Return the arrays that live as long as an environment; a captured graph keeps their addresses.

    Args:
        sim: the worlds; coordinates, poses and targets are views of its own.
        observations: length of an observation.
        privileged: how many numbers a critic is told besides.
        terms: number of reward terms.
        results: number of the task's results of a finished episode; ERRORS follow them.
        delays: greatest number of control steps by which an action comes late.
    """
    s, n = State(), sim.num_envs
    s.joints, s.arm = sim.layout.robot_joints, sim.layout.arm_joints
    s.joint_q, s.joint_qd = sim.of_worlds(sim.state.joint_q), sim.of_worlds(sim.state.joint_qd)
    s.body_q, s.target_q = sim.state.body_q.reshape((n, -1)), sim.of_worlds(sim.control.joint_target_q)
    s.torque = sim.of_worlds(sim.solver.mjw_data.qfrc_actuator)
    s.target_qd = sim.of_worlds(sim.control.joint_target_qd)
    of_robot = slice(sim.robot.base_joints, sim.robot.base_joints + s.joints)
    s.lower = wp.array(sim.model.joint_limit_lower.numpy()[of_robot], dtype=float)
    s.upper = wp.array(sim.model.joint_limit_upper.numpy()[of_robot], dtype=float)
    s.internal = wp.array([int(sim.stages[i].internal) for i in sim.stage_of_env], dtype=int)
    s.errors, width = results, results + len(ERRORS)
    widths = {"requested_qd": s.joints, "action": s.joints, "observation": observations, "privileged": privileged}
    for name, count in (widths | {"terms": terms, "result": width}).items():
        setattr(s, name, wp.zeros((n, count), dtype=float))
    s.reward, s.counts = wp.zeros(n, dtype=float), wp.zeros(1 + width, dtype=float)
    s.rng, s.dropped = wp.zeros(n, dtype=wp.uint32), wp.zeros((n, 2), dtype=int)
    s.past = wp.zeros((n, delays + 1 if delays else 0, s.joints), dtype=float)
    for name in ("terminated", "done", "time_out", "step", "begun", "uncounted", "overflow", "delay"):
        setattr(s, name, wp.zeros(n, dtype=int))
    return s


# Columns of `World.opened`: the maximum opening [m]; the opening gained [m], in all and while grasped, with both
# fingers on the region, with one or both, with a finger on the part but none on the region, pushed by another link of
# the robot; whether the part ever stood open as `open_75pct_static` demands; whether another link touched the part
# last; the maximum contact force [N]; whether the part was closed at any time
OPENED = ("maximum", "gained", "grasped", "both", "any", "off", "body", "stood", "pushed", "force", "closed")
# Columns of `World.grasped`: the opening of the last physics step, and how much of it the part was grasped over, by
# how firmly; the maximum opening so far, and how much of the path to it `grasped_path` rewards [m]
GRASPED = ("before", "opening", "maximum", "path")
# Columns of `World.carried`: the object's path while grasped and else [m]; control steps at rest at its place;
# displacement since the last touch [m]; of other bodies [m]; whether the robot touched the object in this control
# step; whether it was ever grasped; the container's path towards shut with the untouched object in it, and its
# coordinate a physics step ago [m or rad]
CARRIED = ("carried", "loose", "still", "drift", "disturbed", "touched", "grasped", "ride", "coordinate")
# Columns of `World.limits`: openings from which an episode counts [m]
LIMITS = ("success", "open_30cm", "open_75pct_static", "open_95pct")
Opened, Grasped, Carried, Limit = (columns(names) for names in (OPENED, GRASPED, CARRIED, LIMITS))


@wp.struct
class TaskTarget:
    """What a world's robot is to move: a part on a joint, or a free object."""

    free: int  # 1 for a free object, 0 for a part on a joint; the joint's numbers then mean nothing
    grasp: wp.transform  # grasp frame in the target's body; of a free object the body's own frame
    base: wp.quat  # world from the robot's base
    lever_arm: float  # opening per unit of the joint's coordinate [1 or m], positive opens
    # axis, origin: of the joint, world frame [1, m]
    axis: wp.vec3
    origin: wp.vec3
    slides: int  # 1 for a slide, 0 for a hinge
    # coord, dof: index of the target's first coordinate and of its velocity within the world
    coord: int
    dof: int
    travel: float  # opening at the open limit [m]
    size: wp.vec3  # extents of the grasp region along the grasp frame's axes [m]
    pinchable: int  # 1 where two fingers can hold the region: it is thinner than the gripper opens, or held from within


@wp.struct
class ObjectPlace:
    """Where an object is to be put."""

    # planned pose of the object; in the container's body frame where there is one, else in the world's
    goal: wp.transform
    object: wp.uint64  # its hulls, a mesh in its body frame
    container: int  # index within a world of the body that contains the place, -1 where the place is on a fixed support
    coord: int  # the container's coordinate
    hulls: wp.uint64  # the container's hulls, a mesh in its body frame
    inside: wp.transform  # pose of the middle of its inside, in its body frame
    half: wp.vec3  # half the extents of the inside [m]
    shut: float  # coordinate up to which the container is shut [m or rad]
    lever: float  # path of its grasp point per unit of the coordinate
    # rest_steps, settle_steps: of the settings, in control steps
    rest_steps: int
    settle_steps: int


@wp.struct
class Numbers:
    """Settings of tasks and metrics by their own names; those that a task has not are 0."""

    contact_force: float
    velocity_scale: float
    observation_limit: float
    close_distance: float  # -1 where a task has none
    gentle_force: float
    termination_opening: float
    firm: float  # cosine between the fingers' forces from which a grasp is rewarded in full
    bonus: wp.vec3  # openings that give a bonus [m]
    position_tolerance: float
    angle_tolerance: float
    rest_shift: float
    rest_turn: float
    clear_distance: float
    counted_force: float  # `contact_force` of the metrics: from which a contact counts in results [N]
    static_speed: float
    grasp_fraction: float
    contact_fraction: float
    closed_opening: float
    carried_fraction: float
    max_drift: float
    max_disturbance: float
    min_ride: float
    control_step: float  # [s]


@wp.struct
class World:
    """Robot, target, contacts, place and progress of all worlds. Arrays that a task does not use have no rows."""

    # tool_link, left, right: indices of bodies within a world: the tool's link and the fingers
    tool_link: int
    left: int
    right: int
    tool: wp.transform  # the tool frame in its link
    body: int  # index of the target's body within a world
    target: wp.array(dtype=TaskTarget)  # shape [world]
    contacts: PartContacts  # of the robot with the target in the last physics step
    # max force of the left and right finger on the region in the control step [N], shape [world 2]
    region_force: wp.array2d(dtype=float)
    # of the part's joint: dry friction [N or N m], damping [N s/m or N m s/rad]; log of its mass, shape [world]
    resistance: wp.array(dtype=wp.vec3)
    scale: wp.array(dtype=float)  # factor of all openings, below 1 where the part's travel is short, shape [world]
    limits: wp.array2d(dtype=float)  # thresholds of the metrics, shape [world LIMITS]
    place: ObjectPlace  # where an object is to be put
    others: wp.array(dtype=int)  # bodies that must not move, shape [other]
    seen: wp.array(dtype=wp.transform)  # the grasp that is seen, in the grasp frame, shape [world]
    opened: wp.array2d(dtype=float)  # how a part was opened in the running episode, shape [world OPENED]
    grasped: wp.array2d(dtype=float)  # how it was grasped, shape [world GRASPED]
    carried: wp.array2d(dtype=float)  # how an object was carried in the running episode, shape [world CARRIED]
    # last, released: the object's position where its path was last measured, and where the robot last touched it:
    # in the world (0) and in the container (1) [m], shape [world 2]
    last: wp.array2d(dtype=wp.vec3)
    released: wp.array2d(dtype=wp.vec3)
    rested: wp.array(dtype=wp.transform)  # the object's pose since which its steps at rest are counted, shape [world]
    middle: wp.array2d(dtype=wp.vec3)  # their centres of mass in their own frames [m], shape [world other]
    origin: wp.array2d(dtype=wp.vec3)  # where these were at the start, scene frame [m], shape [world other]
    own: wp.array2d(dtype=float)  # columns of one task alone, by its OWN, shape [world column]
    number: Numbers  # of the settings


# Arrays that a later step reads before it writes them
PERSISTENT = (
    "seen", "opened", "grasped", "carried", "last", "released", "rested", "origin", "own",
)  # fmt: skip


def bind(sim: Simulation, sensor: ContactSensor, config: Any, metrics: Any, own: int) -> World:
    """Return the struct of worlds with their robot, target and settings; a place is the task's to set.

    `config`: the task's settings; those that are called as fields of Numbers are in `World.number`.
    """
    w, n, layout = World(), sim.num_envs, sim.layout
    w.tool_link, (w.left, w.right), w.body = layout.tool_body, layout.finger_bodies, layout.part_body
    shift = getattr(config, "tcp_offset", (0.0, 0.0, 0.0))
    w.tool = wp.transform(wp.vec3(*np.add(sim.robot.tool_offset, shift)), wp.quat_identity())
    wide = sim.robot.gripper.max_opening
    targets = [
        _target(sim.stages[i], wide, *at) for i, *at in zip(sim.stage_of_env, sim.part_coord, sim.part_dof, strict=True)
    ]
    w.target, w.contacts = wp.array(targets, dtype=TaskTarget), sensor.found
    w.number = _numbers(sim, config, metrics)
    free = any(each.free for each in targets)
    _bind_part(w, sim, 0 if free else n)
    _bind_object(w, n if free else 0)
    w.own = wp.zeros((n if own else 0, own), dtype=float)
    return w


def _bind_part(w: World, sim: Simulation, rows: int) -> None:
    """Set what belongs to parts on joints, of so many worlds."""
    w.region_force = wp.zeros((rows, 2), dtype=float)
    w.opened = wp.zeros((rows, len(OPENED)), dtype=float)
    w.grasped = wp.zeros((rows, len(GRASPED)), dtype=float)
    w.seen = wp.array([wp.transform_identity()] * rows, dtype=wp.transform)
    w.resistance = wp.array(_resistance(sim) if rows else np.zeros((0, 3)), dtype=wp.vec3)


def _bind_object(w: World, rows: int) -> None:
    """Set what belongs to free objects, of so many worlds."""
    w.carried = wp.zeros((rows, len(CARRIED)), dtype=float)
    w.last, w.released = wp.zeros((rows, 2), dtype=wp.vec3), wp.zeros((rows, 2), dtype=wp.vec3)
    w.rested = wp.zeros(rows, dtype=wp.transform)


def _numbers(sim: Simulation, config: Any, metrics: Any) -> Numbers:
    """Return the settings that have a field of their name, and those that are computed from them."""
    number = Numbers()
    number.control_step, number.close_distance = sim.config.control_dt, -1.0
    for name in Numbers.vars:  # type: ignore[attr-defined]
        for settings in (config, metrics):
            if isinstance(value := getattr(settings, name, None), (int, float)) and not (
                settings is metrics and hasattr(config, name)
            ):
                setattr(number, name, value)
    number.counted_force = getattr(metrics, "contact_force", number.contact_force)
    number.firm = float(np.cos(np.deg2rad(getattr(config, "firm_angle", 120.0))))
    number.bonus = wp.vec3(*getattr(config, "bonus_openings", (0.0, 0.0, 0.0)))
    return number


def travel_scale(sim: Simulation, full_travel: float) -> np.ndarray:
    """Return the factor of all openings, below 1 where a part travels less than `full_travel` [m], shape [world]."""
    return np.minimum(1.0, np.array([sim.stages[i].travel for i in sim.stage_of_env]) / full_travel)


def watch_others(w: World, sim: Simulation, moves: Sequence[int]) -> None:
    """Set the bodies that must not move: all but the robot's, the target and `moves`."""
    mine = {*sim.layout.robot_bodies, w.body, *moves}
    others = [i for i in range(sim.model.body_count // sim.num_envs) if i not in mine]
    w.others = wp.array(others, dtype=int)
    middle = sim.model.body_com.numpy().reshape(sim.num_envs, -1, 3)[:, others]
    w.middle = wp.array(middle, dtype=wp.vec3, shape=(sim.num_envs, len(others)))
    w.origin = wp.zeros((sim.num_envs, max(1, len(others))), dtype=wp.vec3)


def _target(stage: SimStage, max_opening: float, coord: int, dof: int) -> TaskTarget:
    t, joint = TaskTarget(), stage.joint
    t.free = int(stage.target in stage.room.free)
    t.coord, t.dof = coord, dof
    t.base = wp.quat(*stage.base[3:])
    t.size = wp.vec3(*stage.grasp_size)
    if t.free:
        t.grasp, t.lever_arm, t.pinchable = wp.transform_identity(), 1.0, 1
        return t
    t.grasp = wp.transform(*stage.grasp[:3], *stage.grasp[3:])
    t.lever_arm, t.travel = opening_sign(joint) * stage.lever_arm, stage.travel
    t.axis, t.origin, t.slides = wp.vec3(*joint.axis), wp.vec3(*joint.origin), int(joint.kind == "prismatic")
    t.pinchable = int(stage.internal or stage.grasp_size[1] < max_opening)
    return t


def _resistance(sim: Simulation) -> np.ndarray:
    """Return dry friction and damping of each world's part, and the logarithm of its mass, shape [world 3]."""
    model, worlds = sim.model, np.arange(sim.num_envs)
    of_dof = [each.numpy().reshape(sim.num_envs, -1) for each in (model.joint_friction, model.joint_target_kd)]
    mass = model.body_mass.numpy().reshape(sim.num_envs, -1)[:, sim.layout.part_body]
    return np.stack([*(each[worlds, sim.robot.base_joints + sim.part_dof] for each in of_dof), np.log(mass)], axis=1)
