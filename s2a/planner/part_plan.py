"""The plan of a task with a part: its tool path, a joint path that follows it, and a trajectory within the robot's limits."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from s2a.core.bounds import Count, CountFromZero, NotNegative, Positive
from s2a.core.errors import InputError
from s2a.planner import pull_law
from s2a.planner.collision import most_clear
from s2a.planner.part_reach import detour, preceded
from s2a.planner.trajectory import Progress, Trajectory, closing, eased, reach_steps, sampled, timed
from s2a.robot.kinematics import Kinematics, kinematics
from s2a.robot.tool_path import PathSettings, ToolPath, follow, matrices
from s2a.robot.urdf import position_limits
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage
from s2a.tasks.starts import Demonstration

_log = logging.getLogger(__name__)
Skill = Callable[[SimStage, PathSettings], ToolPath]
"""A task's tool path in a stage: `Task.tool_path` of its settings."""


@dataclass(frozen=True)
class PlannerConfig:
    """The motion in numbers; times are minima, which a limit of the robot may extend.

    Attributes:
        ik_seeds: starts of the inverse kinematics; each is followed along the whole tool path.
        approach: distance from which the gripper moves straight to the grasp [m].
        depth: how far the pads reach past the grasp point, into the furniture [m].
        opening: path of the grasp point [m]; less where the joint ends earlier.
        start_noise: how far an episode may start from the home position [rad]; for the time of the first motion.
        reach_time: to the point of approach [s].
        approach_time: from there to the grasp [s].
        close_time: for the fingers to close [s].
        pull_time: to move the part along its joint by `opening` [s].
        pull_law: file of s2a optimize with a time law of that motion, in the place of `pull_time` and the planner's own; or null.
        seed: of the IK starts.
    """

    ik_seeds: Count
    approach: Positive
    depth: float
    opening: Positive
    start_noise: NotNegative
    reach_time: Positive
    approach_time: Positive
    close_time: Positive
    pull_time: Positive
    pull_law: Path | None
    seed: CountFromZero


MARGIN = 0.002
"""[m] Between a finger and the handle, whose hull may bulge by so much, where an episode starts in the grip."""
SAME_GOAL = 1e-3
"""[m] By which the goal of a pull law may be off the end of the path."""


def demonstration(sim: Simulation, config: PlannerConfig, tool_path: Skill) -> Demonstration:
    """Return the planned motion as one on which episodes start.

    The fingers stand open until the part moves, then MARGIN off what they hold, on which they close at once; those that hold a
    pocket from within stand closed, then MARGIN off its walls.

    Raises:
        InputError: the arm cannot reach along the whole path.
    """
    trajectory, arm = plan(sim, config, tool_path), len(sim.robot.arm_joints)
    positions = np.concatenate([trajectory.targets, trajectory.part[:, None]], axis=1)
    opened, held = position_limits(sim.robot)[1][arm:], sim.stage.grasp_size[1] / 2 + MARGIN
    if trajectory.targets[:, arm:].any():  # what pushes is closed all the time
        before, after = (0.0, held_from_within(sim)) if sim.stage.internal else (opened, np.minimum(held, opened))
        positions[: trajectory.closed, arm:-1] = before
        positions[trajectory.closed :, arm:-1] = after
    return Demonstration(trajectory.targets, positions, trajectory.closed)


def held_from_within(sim: Simulation) -> float:
    """Return the finger joints' coordinate at which the fingers are MARGIN off the walls of the pocket that they hold [m]."""
    gripper = sim.robot.gripper
    return float(np.clip(sim.stage.grasp_size[1] / 2 - gripper.finger_box[1] - MARGIN, 0.0, gripper.finger_joint_open))


def plan(sim: Simulation, config: PlannerConfig, tool_path: Skill) -> Trajectory:
    """Return the trajectory that does a task in a simulation's stage; InputError: out of reach."""
    path, arm = planned_path(sim, config, tool_path)
    trajectory = _trajectory(sim, path, arm, config)
    opened = 0.0 if path.pushes or sim.stage.internal else None
    around = detour(sim.stage, sim.robot, arm[0], float(path.q[0]), config.start_noise, config.seed, opened)
    if around is None:
        return trajectory
    return preceded(trajectory, around, sim.robot, sim.plan_limits, rate(sim), config.start_noise, config.reach_time)


def planned_path(sim: Simulation, config: PlannerConfig, tool_path: Skill) -> tuple[ToolPath, np.ndarray]:
    """Return a task's tool path in a simulation's stage and a joint path [pose arm] that follows it; InputError: out of reach."""
    path = tool_path(sim.stage, config)
    paths = joint_paths(kinematics(sim.robot), sim.stage, path, config)
    return path, paths[most_clear(sim, paths, path.q)]


def rate(sim: Simulation) -> float:
    """Return the control steps a second."""
    return 1.0 / (sim.config.dt * sim.config.substeps)


def joint_paths(kin: Kinematics, stage: SimStage, path: ToolPath, config: PlannerConfig) -> np.ndarray:
    """Return the joint paths along a tool path, shape [path pose arm], the best first.

    They are ordered by how far they keep from the joint limits and how near home they begin.

    Raises:
        InputError: there is none.
    """
    (paths,) = follow(kin, path.poses, matrices(stage.base[None]), config.ik_seeds, config.seed)
    if not len(paths):
        raise InputError(
            f"{stage.path}: the arm cannot follow part {stage.target!r} from its base at {np.round(stage.base[:3], 2)} m; "
            f"give search_base=true to s2a evaluate, or prepare the stage again, with robot={stage.robot}"
        )
    distance = np.abs(paths[:, 0] - np.array(kin.spec.home)).max(axis=1)
    margin = np.minimum(paths - kin.lower, kin.upper - paths).min(axis=(1, 2))
    jump = np.abs(np.diff(paths, axis=1)).max(axis=(1, 2))
    return paths[np.argsort(distance + jump - 2.0 * np.clip(margin, 0.0, 0.2), kind="stable")]


def _trajectory(sim: Simulation, path: ToolPath, arm: np.ndarray, config: PlannerConfig) -> Trajectory:
    """Return a joint path [pose arm] in time: approach, close, pull."""
    spec, limits, frequency = sim.robot, sim.plan_limits, rate(sim)
    approach = timed(arm[: path.grasp + 1], config.approach_time, limits, frequency)
    # A finger target of zero presses the pads on the handle; where they stop is the handle's thickness.
    fingers = np.zeros(0) if path.pushes else closing(spec.gripper, config.close_time, frequency)
    pull, progress = _pull(sim, path, arm[path.grasp :], config)
    arms = np.concatenate([arm[:1], approach, np.tile(arm[path.grasp], (len(fingers), 1)), pull])
    opened = spec.gripper.finger_joint_open
    before = np.full(1 + len(approach), 0.0 if path.pushes else opened)
    both = np.concatenate([before, fingers, np.zeros(len(pull))])[:, None]
    if sim.stage.internal and not path.pushes:  # they go in closed and press outwards
        both = opened - both
    reach = reach_steps(np.array(spec.home), arm[0], config.start_noise, config.reach_time, limits, frequency)
    moved = sampled(path.q[path.grasp :, None], len(pull), lambda time: np.minimum(progress(time), 1.0))
    part = np.append(np.full(len(arms) - len(pull), path.q[path.grasp]), moved)
    return Trajectory(np.concatenate([arms, both, both], axis=1), part, reach, len(before) + len(fingers))


def _pull(sim: Simulation, path: ToolPath, arm: np.ndarray, config: PlannerConfig) -> tuple[np.ndarray, Progress]:
    """Return the targets of a pull along a joint path [pose arm], and their progress in time: the planner's own, or a law's."""
    limits, frequency = sim.plan_limits, rate(sim)
    if config.pull_law is None:
        return timed(arm, config.pull_time, limits, frequency), eased
    law = pull_law.read(config.pull_law)
    length = abs(float(path.q[-1] - path.q[path.grasp])) * sim.stage.lever_arm
    if abs(length - law.goal) > SAME_GOAL:
        raise InputError(
            f"{config.pull_law}: a law for a pull of {law.goal:.3f} m; this one is {length:.3f} m long; give planner.opening, "
            "or make a law for this part"
        )
    targets = timed(arm, law.seconds, limits, frequency, law.progress)
    if len(targets) > math.ceil(law.seconds * frequency):
        text = "%s: the robot's limits stretch the pull from %.2f to %.2f s"
        _log.warning(text, config.pull_law, law.seconds, len(targets) / frequency)
    return targets, law.progress
