"""The policy that follows planned trajectories in running worlds; the grip is friction alone, nothing is attached."""

import logging
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Protocol

import numpy as np
import torch
import warp as wp

from s2a.motion.correction import (
    Correction,
    Retries,
    TrackedPart,
    Worlds,
    lead_grasp,
    lead_handle,
    lead_held,
    lead_object,
    target_in_tool,
)
from s2a.motion.open import plan
from s2a.motion.trajectory import (
    Anchor,
    Demonstration,
    PlannerConfig,
    Trajectory,
    eased,
    limit_fractions,
    padded,
    reach_steps,
)
from s2a.robot.spec import JointLimits
from s2a.sim.simulation import Simulation

_log = logging.getLogger(__name__)
BEHIND = 3.0  # Steps at full velocity that a joint target may be behind the trajectory before the planner waits for it
# Of a planner that teaches: who sees the trajectory in no other way than by the room cannot learn to be on it within
# a step (0.007 rad). At a gain of 1 nearly all of the actions to imitate are at their limits
TEACHING_GAIN, TEACHING_BEHIND = 1 / 30, 10.0


# Steps of the trajectory, shape [world] -> what is added to the arm's targets there, shape [world arm]
Adding = Callable[[torch.Tensor], torch.Tensor | float]


class Pace:
    """The fraction of a step of the trajectory by which each world goes on in a control step.

    The trajectory and what is added to it keep the limits each, their sum need not. In windows that begin and end at rest the sum
    is followed more slowly, evenly, where it has to be.
    """

    def __init__(self, sim: Worlds, trajectory: Trajectory, limits: JointLimits, frequency: float) -> None:
        self._limits, self._frequency = limits, frequency
        self._arm = trajectory.targets[:, : len(sim.robot.arm_joints)]
        self._count, self._device = sim.num_envs, sim.device
        self._windows: dict[tuple[int, int], torch.Tensor] = {}

    def fit(self, window: tuple[int, int], worlds: torch.Tensor, added: Adding) -> None:
        """Choose the pace of some worlds (shape [world], bool) in a window: first and last step of what is added."""
        first, last = self._to_rest(*window)
        steps = [torch.full((self._count,), step, device=self._device) for step in range(first, last + 1)]
        total = torch.stack([torch.as_tensor(added(step))[worlds] for step in steps]).cpu().numpy()
        total = self._arm[first : last + 1, None] + total
        # Between two targets the arm goes straight: at a fraction s of the pace, accelerations fall with s, not with its square.
        fractions = [
            max(1.0, *limit_fractions(total[:, k], self._limits, self._frequency)) for k in range(total.shape[1])
        ]
        pace = self._windows.setdefault(
            (first, last), torch.ones(self._count, dtype=torch.float64, device=self._device)
        )
        pace[worlds] = torch.tensor(
            [1.0 / fraction for fraction in fractions], dtype=torch.float64, device=self._device
        )

    def _to_rest(self, first: int, last: int) -> tuple[int, int]:
        """Return a window that ends where the arm stands: a change of pace on the way would be a jump of velocity."""
        last = min(last, len(self._arm) - 1)
        stands = np.flatnonzero(np.append(np.abs(np.diff(self._arm[last:], axis=0)).max(axis=1) < 1e-9, True))
        return first, last + int(stands[0])

    def after(self, place: torch.Tensor) -> torch.Tensor:
        """Return where each world is a control step later; places on the trajectory in steps of it, shape [world]."""
        following = place + 1.0
        for (first, last), pace in self._windows.items():
            within = (place >= first) & (place < last)
            following = torch.where(within, torch.clamp(place + pace, max=float(last)), following)
        return following


class Corrections:
    """All corrections of a trajectory that is the same in all worlds, and how fast they follow it then."""

    def __init__(self, sim: Simulation, trajectory: Trajectory, frequency: float) -> None:
        """Take the anchors of a trajectory; there may be none."""
        self._sim, self._trajectory = sim, trajectory
        self._of: dict[str, Correction] = {
            each.to: Correction(sim, [trajectory], [each]) for each in trajectory.anchors
        }
        tracked = {each.part for each in trajectory.anchors if each.part}
        self._parts = {part: TrackedPart(sim, part) for part in tracked}
        shifted = self._of.get("object")
        self._retries = Retries(sim, trajectory, shifted) if shifted and trajectory.retry else None
        self._pace = Pace(sim, trajectory, sim.plan_limits, frequency)

    def begin(self, worlds: torch.Tensor) -> None:
        """See where the object stands in worlds whose episode begins, shape [world], bool."""
        if "object" in self._of and bool(worlds.any()):
            self._see("object", worlds)

    def see(self, step: torch.Tensor) -> None:
        """See the object in the gripper, and the part, in worlds that have come so far; steps, shape [world]."""
        for to in ("held", "handle"):
            if to in self._of and bool((worlds := step == self._of[to].anchors[0].begin).any()):
                self._see(to, worlds)
        worlds = self._retries.see(step) if self._retries else None
        if worlds is not None:
            self._see("object", worlds)

    def _see(self, to: str, worlds: torch.Tensor) -> None:
        """See what an anchor is to in some worlds [world], bool, and choose their pace."""
        correction, planned = self._of[to], self._trajectory.part
        anchor = correction.anchors[0]
        tracked = self._parts.get(anchor.part)
        if to == "object":
            lead_object(correction, self._sim, worlds)
        elif to == "held":
            off = tracked.off(float(planned[anchor.begin]), worlds) if tracked else None
            lead_held(correction, worlds, target_in_tool(self._sim, worlds), off)
        elif tracked is not None:
            lead_handle(correction, tracked, planned, worlds)
        self._pace.fit((anchor.begin, anchor.end), worlds, self)

    def after(self, place: torch.Tensor) -> torch.Tensor:
        """Return where on the trajectory each world is a control step later, shape [world]; whole where nothing is added."""
        following = self._pace.after(place)
        return self._retries.after(place, following) if self._retries else following

    def __call__(self, step: torch.Tensor) -> torch.Tensor | float:
        """Return what to add to the arm's targets, shape [world arm], at these steps of the trajectory, shape [world]."""
        added: torch.Tensor | float = 0.0
        for each in (*self._of.values(), self._retries):
            if each is not None:
                added = added + each(step)
        return added


class Env(Protocol):
    """The environment in which a policy acts, as `s2a.tasks.env.VecEnv` is one."""

    sim: Simulation
    task: Any
    state: Any
    num_envs: int
    max_episode_length: int
    action_step: torch.Tensor
    episode_step: torch.Tensor
    begun: torch.Tensor


class Planner:
    """A policy that follows planned trajectories, one a stage, the same in all its worlds from the point of approach on.

    Attributes:
        trajectories: joint targets after the reach, of each stage.
        grasp_steps: control steps until the gripper has closed, in the first stage.
        steps: control steps of the longest whole motion.
    """

    def __init__(
        self,
        env: Env,
        config: PlannerConfig,
        motions: Sequence[Demonstration] = (),
        gain: float = 1.0,
        behind: float = BEHIND,
        knows_grasp: bool = False,
        trajectory: Trajectory | None = None,
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
            trajectory: planned before for the only stage, which may drive the base.

        Raises:
            InputError: out of reach.
        """
        sim = self._sim = env.sim
        self._env = env
        planned = [from_home(sim, motion, config) for motion in motions]
        follows_path = partial(env.task.tool_path, config=env.task.config)
        given = [trajectory] if trajectory else planned
        self.trajectories = given or [env.task.trajectory(config) or plan(sim, config, follows_path)]
        self.grasp_steps = self.trajectories[0].reach_steps + self.trajectories[0].closed
        self.steps = max(each.reach_steps + len(each.targets) for each in self.trajectories)
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
        self._observed = None if knows_grasp or env.task.seen_grasp() is None else self._observing(stage)
        self._corrections = None
        if not motions:
            self._corrections = Corrections(sim, self.trajectories[0], sim.config.control_frequency)
        driven = self.trajectories[0].base
        self._base = None if driven is None else torch.tensor(_base(self.trajectories[0], driven), device=sim.device)
        self._start = self._last = sim.joint_target_q[:, : self._targets.shape[2]].clone()
        self._clock = torch.zeros(env.num_envs, dtype=torch.float64, device=sim.device)
        internal = wp.to_torch(env.state.internal)[:, None] == 1
        fingers = torch.arange(self._targets.shape[2], device=sim.device) >= self._arm
        self._sense = torch.where(internal & fingers, -1.0, 1.0)
        """Of each joint's action [world joint]: fingers that hold by opening are mirrored (`State.internal`)."""

    @property
    def episode_steps(self) -> int:
        """Control steps of an episode that holds the longest plan."""
        return self.steps + 1

    @property
    def cut(self) -> np.ndarray:
        """Indices of the plans that are longer than an episode."""
        lengths = np.array([each.reach_steps + len(each.targets) for each in self.trajectories])
        return np.flatnonzero(lengths >= self._env.max_episode_length)

    def warn_of_cut(self) -> None:
        """Warn of plans that are longer than an episode, which then ends before they do."""
        if len(self.cut):
            text = "an episode of %d steps cuts the plan off; give task.episode_steps=%d"
            _log.warning(text, self._env.max_episode_length, self.episode_steps)

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
        self._begin(began)
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
        if self._base is not None:
            self._drive(index)
        action = self._sense * (following - now - (1.0 - self._gain) * (self._last - now)) / self._env.action_step
        behind = (following - now)[:, : self._arm] / self._env.action_step[: self._arm]
        goes_on = behind.abs().amax(dim=1) <= self._behind
        self._clock = torch.where(goes_on, self._after(self._clock), self._clock)
        self._last = torch.where(goes_on[:, None], following, self._last)
        return action

    def _drive(self, index: torch.Tensor) -> None:
        """Lead the base of every world to where it is at these steps of the trajectory [world], at the velocity there."""
        assert self._base is not None
        last = self._base.shape[0] - 1
        now, then = self._base[index.clamp(max=last)], self._base[(index + 1).clamp(max=last)]
        moves = ((index < last) & (index + 1 < len(self.trajectories[0].targets)))[:, None]
        self._sim.base_target_q.copy_(now)
        rate = self._sim.config.control_frequency
        self._sim.base_target_qd.copy_(torch.where(moves, (then - now) * rate, torch.zeros_like(now)))

    def _observing(self, stage: np.ndarray) -> Correction:
        """Return the correction that leads to the grasp that the task observes; `stage`: of each world, shape [world]."""
        ends = [len(each.targets) - 1 for each in self.trajectories]
        return Correction(self._sim, self.trajectories, [Anchor("grasp", 0, 0, end, end) for end in ends], stage)

    def _begin(self, began: torch.Tensor) -> None:
        """See the grasp, and the object, in worlds whose episode begins, shape [world], bool."""
        if self._observed and bool(began.any()) and (seen := self._env.task.seen_grasp()) is not None:
            stages = self._sim.stages[: len(self.trajectories)]
            lead_grasp(self._observed, stages, [each.part for each in self.trajectories], began, seen)
        if self._corrections:
            self._corrections.begin(began)

    def _after(self, clock: torch.Tensor) -> torch.Tensor:
        """Return the clocks [world] of a control step later."""
        if not self._corrections:
            return clock + 1.0
        beginning = self._reach - 1.0
        return self._corrections.after(clock - beginning) + beginning

    def _target(self, step: torch.Tensor) -> torch.Tensor:
        """Return the targets of each world's trajectory [world joint] at these of its steps [world]."""
        targets = self._targets[self._stage, step]
        if self._observed:
            targets[:, : self._arm] += self._observed(step)
        if self._corrections:
            targets[:, : self._arm] += self._corrections(step)
        return targets


def _whole(trajectory: Trajectory) -> np.ndarray:
    """Return all targets [step joint] of a trajectory, those of its way back last."""
    return np.concatenate([trajectory.targets, *([trajectory.retry.targets] if trajectory.retry else [])])


def _base(trajectory: Trajectory, base: np.ndarray) -> np.ndarray:
    """Return targets of the base [step 4] for all targets of a trajectory; on its way back it stands where it picks."""
    picks = trajectory.anchor("object")
    back = len(trajectory.retry.targets) if trajectory.retry else 0
    return np.concatenate([base, np.tile(base[picks.last if picks else -1], (back, 1))]).astype(np.float32)


def from_home(sim: Simulation, motion: Demonstration, config: PlannerConfig) -> Trajectory:
    """Return a motion that was planned before as a trajectory from home."""
    home, arm = np.array(sim.robot.home), len(sim.robot.arm_joints)
    first, frequency = motion.targets[0, :arm], sim.config.control_frequency
    reach = reach_steps(home, first, config.start_noise, config.reach_time, sim.plan_limits, frequency)
    return Trajectory(motion.targets, motion.positions[:, -1], reach, motion.grasped)
