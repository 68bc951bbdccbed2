"""State of all worlds that every task has: robot, action, observation, reward, episode."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
from collections.abc import Iterable
from enum import IntEnum
from typing import Any

import warp as wp

from s2a.sim.simulation import Simulation

ERRORS = ("invalid", "row_overflow", "contact_overflow")
"""Columns of a result after the task's: the episode was ended by a value that is not finite; its world dropped constraint
rows, which ends it too; contacts were dropped in some step, whose pool all worlds share, so that it concerns all at once."""


def columns(names: Iterable[str]) -> Any:
    """Return an enumeration of columns by name, from 0, that kernels can use as indices."""
    return IntEnum("Column", list(names), start=0)


Error = columns(ERRORS)


@wp.struct
class State:
    """All worlds. Of the coordinates of a world the robot's come first: its arm, then its fingers.

    Attributes:
        joints: number of the robot's joints; the first `arm` of them are the arm's.
        joint_q, joint_qd: coordinates [m or rad] and velocities, shape [world coord].
        body_q: poses, shape [world body].
        torque: forces of the joints' drives [N m or N], shape [world dof].
        lower, upper: limits of the robot's joints [rad, m], shape [joint].
        internal: 1 where the gripper holds by opening, shape [world]. There an action of the fingers, and what a policy observes
            of them, are mirrored, so that they mean the same: an action of -1 grips, and a finger that grips is seen to close.
        target_q: joint targets, shape [world coord].
        target_qd: commanded velocities of the robot's joints [rad/s, m/s], shape [world dof].
        asked: those that the action asks for.
        action: in [-1, 1], shape [world action].
        past: the latest actions, the newest first, shape [world delay action]; none where no action comes late.
        delay: by how many control steps actions come late, shape [world].
        observation: shape [world observation].
        privileged: what a critic is told besides, shape [world number].
        terms: unweighted reward terms, shape [world term].
        reward: their weighted sum, shape [world].
        terminated: 1 where the task ends the episode, shape [world].
        done, time_out: 1 where the episode ended, and where it did by its length alone, shape [world].
        step: control steps since the reset, shape [world].
        begun: step of the demonstration on which the episode began, -1 where it began before the first, shape [world].
        uncounted: 1 where the running episode shall not be counted, shape [world].
        overflow: mujoco_warp's overflow bits since the last control step, shape [world].
        dropped: 1 where the episode lost constraint rows (0), contacts (1), shape [world 2].
        result: how the last finished episode went, shape [world column]: the task's columns, then ERRORS.
        errors: column of the first of ERRORS.
        counts: sums over finished episodes: their number, then the columns of `result`, shape [1 + column].
        rng: random streams, shape [world].
    """

    joints: int
    arm: int
    joint_q: wp.array2d(dtype=float)
    joint_qd: wp.array2d(dtype=float)
    body_q: wp.array2d(dtype=wp.transform)
    torque: wp.array2d(dtype=float)
    lower: wp.array(dtype=float)
    upper: wp.array(dtype=float)
    internal: wp.array(dtype=int)
    target_q: wp.array2d(dtype=float)
    target_qd: wp.array2d(dtype=float)
    asked: wp.array2d(dtype=float)
    action: wp.array2d(dtype=float)
    past: wp.array3d(dtype=float)
    delay: wp.array(dtype=int)
    observation: wp.array2d(dtype=float)
    privileged: wp.array2d(dtype=float)
    terms: wp.array2d(dtype=float)
    reward: wp.array(dtype=float)
    terminated: wp.array(dtype=int)
    done: wp.array(dtype=int)
    time_out: wp.array(dtype=int)
    step: wp.array(dtype=int)
    begun: wp.array(dtype=int)
    uncounted: wp.array(dtype=int)
    overflow: wp.array(dtype=int)
    dropped: wp.array2d(dtype=int)
    result: wp.array2d(dtype=float)
    errors: int
    counts: wp.array(dtype=float)
    rng: wp.array(dtype=wp.uint32)


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
    s.joint_q, s.joint_qd = sim.state.joint_q.reshape((n, -1)), sim.state.joint_qd.reshape((n, -1))
    s.body_q, s.target_q = sim.state.body_q.reshape((n, -1)), sim.control.joint_target_q.reshape((n, -1))
    s.torque = sim.solver.mjw_data.qfrc_actuator
    s.target_qd = sim.control.joint_target_qd.reshape((n, -1))
    s.lower = wp.array(sim.model.joint_limit_lower.numpy()[: s.joints], dtype=float)
    s.upper = wp.array(sim.model.joint_limit_upper.numpy()[: s.joints], dtype=float)
    s.internal = wp.array([int(sim.stages[i].internal) for i in sim.stage_of_env], dtype=int)
    s.errors, width = results, results + len(ERRORS)
    for name, columns_ in (
        ("asked", s.joints),
        ("action", s.joints),
        ("observation", observations),
        ("privileged", privileged),
        ("terms", terms),
        ("result", width),
    ):
        setattr(s, name, wp.zeros((n, columns_), dtype=float))
    s.reward, s.counts, s.rng = (
        wp.zeros(n, dtype=float),
        wp.zeros(1 + width, dtype=float),
        wp.zeros(n, dtype=wp.uint32),
    )
    s.dropped = wp.zeros((n, 2), dtype=int)
    s.past = wp.zeros((n, delays + 1 if delays else 0, s.joints), dtype=float)
    for name in ("terminated", "done", "time_out", "step", "begun", "uncounted", "overflow", "delay"):
        setattr(s, name, wp.zeros(n, dtype=int))
    return s
