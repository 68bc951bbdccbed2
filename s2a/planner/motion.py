"""Doing a task by plan: its tool path, a joint path that follows it, and a trajectory within the robot's limits.

The grip is friction alone; nothing is attached.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import torch

from s2a.env.starts import Demonstration, padded
from s2a.env.vec_env import VecEnv
from s2a.errors import InputError
from s2a.planner import pull_law
from s2a.planner.collision import most_clear
from s2a.planner.corrections import Corrections
from s2a.planner.part_reach import detour, preceded
from s2a.planner.seen_grasp import SeenGrasp
from s2a.planner.trajectory import Progress, Trajectory, closing, eased, reach_steps, sampled, timed
from s2a.ranges import Count, CountFromZero, NotNegative, Positive
from s2a.robot.joint_path import follow
from s2a.robot.kinematics import Kinematics, kinematics
from s2a.robot.tool_path import PathSettings, ToolPath, matrices
from s2a.robot.urdf import position_limits
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage

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
BEHIND = 3.0
"""Steps at full velocity that a joint target may be behind the trajectory before the planner waits for it."""
TEACHING_GAIN, TEACHING_BEHIND = 1 / 30, 10.0
"""Of a planner that teaches: who sees the trajectory in no other way than by the room cannot learn to be on it within a step
(0.007 rad). At a gain of 1 nearly all of the actions to imitate are at their limits."""


class Planner:
    """A policy that follows planned trajectories, one a stage, the same in all its worlds from the point of approach on.

    Attributes:
        trajectories: joint targets after the reach, of each stage.
        grasp_steps: control steps until the gripper has closed, in the first stage.
        steps: control steps of the longest whole motion.
    """

    def __init__(
        self,
        env: VecEnv,
        config: PlannerConfig,
        motions: Sequence[Demonstration] = (),
        gain: float = 1.0,
        behind: float = BEHIND,
        knows_grasp: bool = False,
    ) -> None:
        """Take motions that were planned before, one a stage, or plan for the only stage.

        Args:
            env: in which it acts.
            config: the motion in numbers.
            motions: planned before.
            gain: fraction of the distance from the last target of the trajectory that an action makes up for, beside the
                trajectory's own velocity.
            behind: steps at full velocity that a joint target may be behind the trajectory before this waits for it.
            knows_grasp: go to the true grasp, also where the task's observation has it elsewhere.

        Raises:
            InputError: out of reach.
        """
        sim = self._sim = env.sim
        self._env = env
        planned = [_from_home(sim, motion, config) for motion in motions]
        follows_path = partial(env.task.tool_path, config=env.task.config)
        self.trajectories = planned or [env.task.trajectory(config) or plan(sim, config, follows_path)]
        self.grasp_steps = self.trajectories[0].reach_steps + self.trajectories[0].closed
        self.steps = max(each.reach_steps + len(each.targets) for each in self.trajectories)
        if self.steps >= env.max_episode_length:
            text = "an episode of %d steps cuts the plan off; give task.episode_steps=%d"
            _log.warning(text, env.max_episode_length, self.steps + 1)
        stage = sim.stage_of_env if motions else np.zeros(sim.num_envs, dtype=int)
        self._targets = torch.tensor(
            padded([each.targets for each in self.trajectories]), dtype=torch.float32, device=sim.device
        )
        self._stage = torch.tensor(stage, device=sim.device)
        reaches = [each.reach_steps for each in self.trajectories]
        ramps = padded([eased(np.arange(1, steps + 1) / steps)[:, None] for steps in reaches])[..., 0]
        self._ramps = torch.tensor(ramps, dtype=torch.float32, device=sim.device)
        self._reach = torch.tensor(reaches, device=sim.device)[self._stage]
        self._gain, self._behind, self._arm = gain, behind, len(sim.robot.arm_joints)
        self._seen = (
            None if knows_grasp or env.task.seen_grasp() is None else SeenGrasp(sim, self.trajectories, self._stage)
        )
        self._corrections = None if motions else Corrections(sim, self.trajectories[0], _rate(sim))
        self._start = self._last = sim.joint_target_q[:, : self._targets.shape[2]].clone()
        self._clock = torch.zeros(env.num_envs, dtype=torch.float64, device=sim.device)

    def state_dict(self) -> dict[str, torch.Tensor]:
        """Return copies of what differs between control steps: where on its trajectory each world is, and where it began."""
        return {"clock": self._clock.clone(), "start": self._start.clone(), "last": self._last.clone()}

    def load_state_dict(self, state: Mapping[str, torch.Tensor]) -> None:
        """Go on from what `state_dict` returned."""
        self._clock, self._start, self._last = (state[name].clone() for name in ("clock", "start", "last"))

    def __call__(self, observation: torch.Tensor) -> torch.Tensor:
        """Return the action [world joint] that brings the joint targets onto the trajectory; observations are not needed.

        An episode that began on the demonstration goes on from there. The trajectory waits where a target is held back, by
        more than BEHIND: by a controller with limits for a joint that lags, or by somebody else who acts.
        """
        began, begun, reach = self._env.episode_step == 0, self._env.begun, self._reach
        now = self._sim.joint_target_q[:, : self._targets.shape[2]]
        self._start = torch.where(began[:, None], now, self._start)
        first = torch.where(begun < 0, 0, reach + begun)
        self._clock = torch.where(began, first.double(), self._clock)
        step = self._clock.floor().long()
        if self._seen and bool(began.any()) and (seen := self._env.task.seen_grasp()) is not None:
            self._seen.see(began, seen)
        if self._corrections:
            self._corrections.begin(began)
        fraction = self._ramps[self._stage, step.clamp(max=self._ramps.shape[1] - 1)][:, None]
        reaching = self._start + fraction * (self._target(torch.zeros_like(step)) - self._start)
        index = (step - reach + 1).clamp(0, self._targets.shape[1] - 1)
        if self._corrections:
            self._corrections.see(index)
        following = self._target(index)
        if self._corrections:
            past = (self._clock - step)[:, None].float()
            following = torch.lerp(following, self._target((index + 1).clamp(max=self._targets.shape[1] - 1)), past)
        following = torch.where((step < reach)[:, None], reaching, following)
        self._last = torch.where(began[:, None], now, self._last)
        action = (following - now - (1.0 - self._gain) * (self._last - now)) / self._env.action_step
        behind = (following - now)[:, : self._arm] / self._env.action_step[: self._arm]
        goes_on = behind.abs().amax(dim=1) <= self._behind
        self._clock = torch.where(goes_on, self._after(self._clock), self._clock)
        self._last = torch.where(goes_on[:, None], following, self._last)
        return action

    def _after(self, clock: torch.Tensor) -> torch.Tensor:
        """Return the clocks [world] of a control step later."""
        if not self._corrections:
            return clock + 1.0
        beginning = self._reach - 1.0
        return self._corrections.after(clock - beginning) + beginning

    def _target(self, step: torch.Tensor) -> torch.Tensor:
        """Return the targets of each world's trajectory [world joint] at these of its steps [world]."""
        targets = self._targets[self._stage, step]
        if self._seen:
            targets[:, : self._arm] += self._seen(step)
        if self._corrections:
            targets[:, : self._arm] += self._corrections(step)
        return targets


def _from_home(sim: Simulation, motion: Demonstration, config: PlannerConfig) -> Trajectory:
    """Return a motion that was planned before as a trajectory from home."""
    home, arm = np.array(sim.robot.home), len(sim.robot.arm_joints)
    reach = reach_steps(
        home, motion.targets[0, :arm], config.start_noise, config.reach_time, sim.plan_limits, _rate(sim)
    )
    return Trajectory(motion.targets, motion.positions[:, -1], reach, motion.grasped)


def demonstration(sim: Simulation, config: PlannerConfig, tool_path: Skill) -> Demonstration:
    """Return the planned motion as one on which episodes start.

    The fingers stand open until the part moves, then MARGIN off what they hold, on which they close at once.

    Raises:
        InputError: the arm cannot reach along the whole path.
    """
    trajectory, arm = plan(sim, config, tool_path), len(sim.robot.arm_joints)
    positions = np.concatenate([trajectory.targets, trajectory.part[:, None]], axis=1)
    opened, held = position_limits(sim.robot)[1][arm:], sim.stage.grasp_size[1] / 2 + MARGIN
    if trajectory.targets[0, arm:].any():  # what pushes is closed all the time
        positions[: trajectory.closed, arm:-1] = opened
        positions[trajectory.closed :, arm:-1] = np.minimum(held, opened)
    return Demonstration(trajectory.targets, positions, trajectory.closed)


def plan(sim: Simulation, config: PlannerConfig, tool_path: Skill) -> Trajectory:
    """Return the trajectory that does a task in a simulation's stage; InputError: out of reach."""
    path, arm = planned_path(sim, config, tool_path)
    trajectory = _trajectory(sim, path, arm, config)
    opened = 0.0 if path.pushes else None
    around = detour(sim.stage, sim.robot, arm[0], float(path.q[0]), config.start_noise, config.seed, opened)
    if around is None:
        return trajectory
    return preceded(trajectory, around, sim.robot, sim.plan_limits, _rate(sim), config.start_noise, config.reach_time)


def planned_path(sim: Simulation, config: PlannerConfig, tool_path: Skill) -> tuple[ToolPath, np.ndarray]:
    """Return a task's tool path in a simulation's stage and a joint path [pose arm] that follows it; InputError: out of reach."""
    path = tool_path(sim.stage, config)
    paths = joint_paths(kinematics(sim.robot), sim.stage, path, config)
    return path, paths[most_clear(sim, paths, path.q)]


def _rate(sim: Simulation) -> float:
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
    spec, limits, rate = sim.robot, sim.plan_limits, _rate(sim)
    approach = timed(arm[: path.grasp + 1], config.approach_time, limits, rate)
    # A finger target of zero presses the pads on the handle; where they stop is the handle's thickness.
    fingers = np.zeros(0) if path.pushes else closing(spec.gripper, config.close_time, rate)
    pull, progress = _pull(sim, path, arm[path.grasp :], config)
    arms = np.concatenate([arm[:1], approach, np.tile(arm[path.grasp], (len(fingers), 1)), pull])
    before = np.full(1 + len(approach), 0.0 if path.pushes else spec.gripper.finger_joint_open)
    both = np.concatenate([before, fingers, np.zeros(len(pull))])[:, None]
    reach = reach_steps(np.array(spec.home), arm[0], config.start_noise, config.reach_time, limits, rate)
    moved = sampled(path.q[path.grasp :, None], len(pull), lambda time: np.minimum(progress(time), 1.0))
    part = np.append(np.full(len(arms) - len(pull), path.q[path.grasp]), moved)
    return Trajectory(np.concatenate([arms, both, both], axis=1), part, reach, len(before) + len(fingers))


def _pull(sim: Simulation, path: ToolPath, arm: np.ndarray, config: PlannerConfig) -> tuple[np.ndarray, Progress]:
    """Return the targets of a pull along a joint path [pose arm], and their progress in time: the planner's own, or a law's."""
    limits, rate = sim.plan_limits, _rate(sim)
    if config.pull_law is None:
        return timed(arm, config.pull_time, limits, rate), eased
    law = pull_law.read(config.pull_law)
    length = abs(float(path.q[-1] - path.q[path.grasp])) * sim.stage.lever_arm
    if abs(length - law.goal) > SAME_GOAL:
        raise InputError(
            f"{config.pull_law}: a law for a pull of {law.goal:.3f} m; this one is {length:.3f} m long; give planner.opening, "
            "or make a law for this part"
        )
    targets = timed(arm, law.seconds, limits, rate, law.progress)
    if len(targets) > math.ceil(law.seconds * rate):
        text = "%s: the robot's limits stretch the pull from %.2f to %.2f s"
        _log.warning(text, config.pull_law, law.seconds, len(targets) / rate)
    return targets, law.progress
