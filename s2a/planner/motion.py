"""Doing a task by plan: its tool path, a joint path that follows it, and a trajectory within the robot's limits.

The grip is friction alone; nothing is attached.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
import torch
import warp as wp

from s2a.planner.corrections import Corrections
from s2a.planner.part_plan import PlannerConfig, plan, rate
from s2a.planner.seen_grasp import SeenGrasp
from s2a.planner.trajectory import Trajectory, eased, reach_steps
from s2a.sim.simulation import Simulation
from s2a.tasks.env import VecEnv
from s2a.tasks.starts import Demonstration, padded

_log = logging.getLogger(__name__)
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
            padded([_whole(each) for each in self.trajectories]), dtype=torch.float32, device=sim.device
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
        self._corrections = None if motions else Corrections(sim, self.trajectories[0], rate(sim))
        self._start = self._last = sim.joint_target_q[:, : self._targets.shape[2]].clone()
        self._clock = torch.zeros(env.num_envs, dtype=torch.float64, device=sim.device)
        internal = wp.to_torch(env.state.internal)[:, None] == 1
        fingers = torch.arange(self._targets.shape[2], device=sim.device) >= self._arm
        self._sense = torch.where(internal & fingers, -1.0, 1.0)
        """Of each joint's action [world joint]: fingers that hold by opening are mirrored (`State.internal`)."""

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
        action = self._sense * (following - now - (1.0 - self._gain) * (self._last - now)) / self._env.action_step
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


def _whole(trajectory: Trajectory) -> np.ndarray:
    """Return all targets [step joint] of a trajectory, those of its way back last."""
    return np.concatenate([trajectory.targets, *([trajectory.again.targets] if trajectory.again else [])])


def _from_home(sim: Simulation, motion: Demonstration, config: PlannerConfig) -> Trajectory:
    """Return a motion that was planned before as a trajectory from home."""
    home, arm = np.array(sim.robot.home), len(sim.robot.arm_joints)
    reach = reach_steps(
        home, motion.targets[0, :arm], config.start_noise, config.reach_time, sim.plan_limits, rate(sim)
    )
    return Trajectory(motion.targets, motion.positions[:, -1], reach, motion.grasped)
