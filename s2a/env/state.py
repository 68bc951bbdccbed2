"""What an environment keeps of all worlds: one struct of array handles that every kernel takes."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import warp as wp

from s2a.sim.simulation import Simulation


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
    counts: wp.array(dtype=float)
    rng: wp.array(dtype=wp.uint32)


def allocate(sim: Simulation, observations: int, privileged: int, terms: int, columns: int, delays: int) -> State:
    """Return the arrays that live as long as an environment; a captured graph keeps their addresses.

    Args:
        sim: the worlds; coordinates, poses and targets are views of its own.
        observations: length of an observation.
        privileged: how many numbers a critic is told besides.
        terms: number of reward terms.
        columns: number of a finished episode's results.
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
    for name, width in (
        ("asked", s.joints),
        ("action", s.joints),
        ("observation", observations),
        ("privileged", privileged),
        ("terms", terms),
        ("result", columns),
    ):
        setattr(s, name, wp.zeros((n, width), dtype=float))
    s.reward, s.counts, s.rng = (
        wp.zeros(n, dtype=float),
        wp.zeros(1 + columns, dtype=float),
        wp.zeros(n, dtype=wp.uint32),
    )
    s.dropped = wp.zeros((n, 2), dtype=int)
    s.past = wp.zeros((n, delays + 1 if delays else 0, s.joints), dtype=float)
    for name in ("terminated", "done", "time_out", "step", "begun", "uncounted", "overflow", "delay"):
        setattr(s, name, wp.zeros(n, dtype=int))
    return s
