"""The environment: physics and a task's kernels in all worlds, one graph launch a control step; it knows no task.

A control step: clamp the action and move the joint targets; `substeps` physics steps, after each of which overflows are kept
and the task reads the contacts; the task's update, then reward terms and their sum; episodes that end, their results, the
counts; the reset of these worlds; observations. Nothing is allocated and nothing waits for the device.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import newton
import numpy as np
import torch
import warp as wp
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from s2a.core.errors import InputError
from s2a.motion.trajectory import Demonstration, padded
from s2a.sim.simulation import Simulation
from s2a.tasks import kernels
from s2a.tasks.base import Task, weights_of
from s2a.tasks.state import ERRORS, allocate

Policy = Callable[[torch.Tensor], torch.Tensor]  # Observation [world observation] -> action [world action]
FINGER_TIME = 0.05  # [s] In which a finger reaches its speed; no maker says


@dataclass(frozen=True)
class DemoStarts:
    """How many episodes start on a demonstration."""

    demonstrations: Sequence[Demonstration]  # one a stage
    fraction: float  # of the episodes that start on it
    moved_fraction: float  # of these, the fraction that starts where the part is already moved; they are not counted


class VecEnv:
    """Worlds in which a robot does a task.

    Attributes:
        sim: the worlds.
        task: what is done in them.
        num_envs, num_actions, max_episode_length: as a vectorised environment has them.
        action_step: change of each joint target for an action of 1 [rad or m], shape [action].
        observation: shape [world observation], overwritten by every step.
        privileged: what a critic is told besides, shape [world number].
        final_observation: the same before the reset of the worlds whose episode ended, where it is kept.
        reward: shape [world].
        done, time_out: 0 or 1, shape [world], int32; a time-out is not a termination.
        terms: unweighted reward terms, shape [world term].
        columns: names of `result`: the task's RESULTS, then ERRORS.
        result: how each world's last finished episode went, shape [world column].
        counts: number of finished episodes, then the sums of `result`, since they were last set to zero, shape [1 + column].
        episode_step: control steps since the reset, shape [world], int32.
        begun: step of the demonstration on which the episode began, -1 where it began before the first, shape [world], int32.
        uncounted: 1 where the running episode shall not be counted, shape [world], int32.
    """

    def __init__(
        self,
        sim: Simulation,
        task: Task,
        weights: Mapping[str, float],
        seed: int,
        graph: bool = True,
        demo: DemoStarts | None = None,
        final_observation: bool = False,
        continues: bool = False,
    ) -> None:
        """Allocate, reset all worlds, and capture the step.

        Args:
            sim: the worlds.
            task: bound to them.
            weights: of the task's reward terms by name; a term that is not given weighs 0.
            seed: of the start noise.
            graph: capture the step; without, every kernel is launched from Python, ten to a hundred times as slowly on a CPU.
            demo: episodes that start on a demonstration; None: none does.
            final_observation: keep the last observation of every episode.
            continues: episodes begin where the worlds are, and end without a reset of robot and room.

        Raises:
            InputError: episodes continue, and are to start elsewhere.
        """
        moved = [name for name in ("start_shift", "start_turn") if getattr(task.config, name, 0.0)]
        if continues and (demo or moved):
            reason = "demonstrations" if demo else f"key 'task.{moved[0]}'"
            raise InputError(f"{reason} would move what episodes that continue begin with; leave it out")
        self.sim, self.task, self.columns = sim, task, (*task.RESULTS.names, *ERRORS)
        self.num_envs, self.num_actions = sim.num_envs, sim.layout.robot_joints
        self.max_episode_length, self.seed, self._graph = task.config.episode_steps, seed, graph
        with wp.ScopedDevice(sim.device):
            weighted = weights_of(task.REWARDS, weights)
            lengths = task.observations, task.privileged, len(task.REWARDS), len(task.RESULTS.names)
            self.state = allocate(sim, *lengths, delays=task.config.action_delay[1])
            self._weights = wp.array(weighted, dtype=float)
            self._compute_reward = kernels.reward_kernel(list(task.REWARDS.values()))
            self._motion = _motion(sim, task, demo)
            self._motion.continues = int(continues)
            self._world_mask = wp.zeros(sim.num_envs + 1, dtype=bool)
            articulations = sim.model.articulation_count // sim.num_envs
            self._articulation_mask = wp.zeros((sim.num_envs, articulations), dtype=bool)
            self._final = wp.zeros_like(self.state.observation) if final_observation else None
            self._launch(kernels.seed_envs, seed, self.state.rng)
        self._share_with_torch()
        self.action_step = _action_step(self._motion, sim)
        if self._motion.limited:
            sim.before_substep.append(self._before_substep)
        sim.after_substep.append(self._after_substep)
        self._begin()

    def lengthen(self, steps: int) -> None:
        """Let an episode last at least `steps` control steps; a longer one begins all worlds again: an episode's start."""
        if steps <= self.max_episode_length:
            return
        self.max_episode_length = steps
        with wp.ScopedDevice(self.sim.device):
            self._launch(kernels.seed_envs, self.seed, self.state.rng)
        self._begin()

    def _begin(self) -> None:
        """Capture the step, in which the length of an episode is a constant, and reset all worlds."""
        worlds = self.sim.snapshot()
        self._whole_step = self.sim.capture(self._step) if self._graph else self._step
        self.sim.restore(worlds)
        self.reset_all()

    def step(self, action: torch.Tensor) -> None:
        """Apply an action [world action] in [-1, 1] for one control step; worlds whose episode ends are reset within it."""
        self._action.copy_(action)
        self._whole_step()

    def reset_all(self, seed: int | None = None) -> None:
        """Start a new episode in every world, of new random streams where there is a seed; counts begin at zero."""
        self.done.fill_(1)
        self.uncounted.zero_()
        with wp.ScopedDevice(self.sim.device):
            if seed is not None:
                self._launch(kernels.seed_envs, seed, self.state.rng)
            self._reset_and_observe()
        self.done.zero_()
        self.counts.zero_()

    def state_dict(self) -> dict[str, torch.Tensor]:
        """Return copies of all that differs between control steps, to go on from exactly here; see `load_state_dict`."""
        return {name: wp.to_torch(array).clone() for name, array in self._persistent().items()}

    def load_state_dict(self, state: Mapping[str, torch.Tensor]) -> None:
        """Go on from what `state_dict` returned for as many worlds of the same stages.

        Raises:
            InputError: it is of another number of worlds, or of another task.
        """
        for name, array in self._persistent().items():
            mine = wp.to_torch(array)
            if name not in state or state[name].shape != mine.shape:
                given = tuple(state[name].shape) if name in state else "missing"
                raise InputError(
                    f"the saved worlds' {name} is {given}, expected {tuple(mine.shape)}; use the same num_envs and task"
                )
            mine.copy_(state[name])

    def _persistent(self) -> dict[str, wp.array]:
        """Return every array that a later step reads before it is written, by name."""
        s, arrays = self.state, self.sim.persistent()
        names = ["past", "delay"] if s.past.size else []
        names += ["privileged"] if self.task.privileged else []
        names += "action observation step begun uncounted dropped overflow result counts rng".split()
        arrays |= {name: getattr(s, name) for name in names}
        return arrays | {f"task.{name}": array for name, array in self.task.persistent().items()}

    def _step(self) -> None:
        state, task = self.state, self.task
        with wp.ScopedDevice(self.sim.device):
            self._launch(kernels.act, state, self._motion)
            task.before_step(state)
            self.sim.step()
            task.update(state)
            self._launch(self._compute_reward, state, task.world, self._weights)
            self._launch(kernels.finish, state, self.max_episode_length)
            task.result(state)
            self._launch(kernels.count, state)
            if self._final is not None:
                task.observe(state)
                wp.copy(self._final, state.observation)
            self._reset_and_observe()

    def _before_substep(self) -> None:
        """Let the targets move as the controller would."""
        now = self.sim.of_worlds(self.sim.state.joint_q)
        self._launch(kernels.move_targets, self.state, self._motion, now)

    def _after_substep(self) -> None:
        """Keep what the solver forgets in its next step."""
        self._launch(kernels.accumulate_overflow, self.sim.solver.mjw_data.overflow, self.state)
        self.task.after_substep(self.state)

    def _reset_and_observe(self) -> None:
        """Reset the worlds that are done, then write every world's observation."""
        sim = self.sim
        self._launch(kernels.reset, self.state, self._motion, self._world_mask, self._articulation_mask)
        self.task.reset(self.state)
        if self._motion.continues:
            self.task.observe(self.state)
            return
        # Clears warm starts and forces; the coordinates were just written (flags=0 leaves them alone).
        sim.solver.reset(sim.state, world_mask=self._world_mask, flags=0)
        mask = self._articulation_mask.flatten()
        newton.eval_fk(sim.model, sim.state.joint_q, sim.state.joint_qd, sim.state, mask=mask)
        self.task.observe(self.state)

    def _launch(self, kernel: wp.Kernel, *inputs: object) -> None:
        wp.launch(kernel, dim=self.num_envs, inputs=list(inputs))

    def _share_with_torch(self) -> None:
        s = self.state
        self._action, self.observation, self.terms = map(wp.to_torch, (s.action, s.observation, s.terms))
        self.reward, self.done, self.time_out = map(wp.to_torch, (s.reward, s.done, s.time_out))
        self.result, self.counts = map(wp.to_torch, (s.result, s.counts))
        self.final_observation = wp.to_torch(self._final if self._final is not None else s.observation)
        self.privileged = wp.to_torch(s.privileged)
        self.episode_step, self.begun, self.uncounted = map(wp.to_torch, (s.step, s.begun, s.uncounted))


def _motion(sim: Simulation, task: Task, demo: DemoStarts | None) -> kernels.Motion:
    """Return how actions move the targets and where episodes start."""
    m, config, limits = kernels.Motion(), task.config, sim.config.limits
    m.dt = sim.config.dt
    m.step = config.action_scale * sim.config.control_dt
    m.finger_step, m.limited = config.finger_speed * m.step, int(limits is not None)
    m.coupled = int(limits is not None or sim.config.coupled_fingers)
    if limits is not None:
        arm, fingers = sim.arm_limits, [sim.robot.gripper.finger_speed] * 2
        m.velocity = wp.array([*arm.velocity, *fingers], dtype=float)
        m.acceleration = wp.array([*arm.acceleration, *(each / FINGER_TIME for each in fingers)], dtype=float)
        m.window = limits.window
    m.delay = wp.vec2i(*config.action_delay)
    m.home, m.noise = wp.array(sim.layout.home, dtype=float), config.start_noise
    m.leader = wp.array([leader for leader, _ in sim.layout.followers], dtype=int)
    m.multiplier = wp.array([ratio for _, ratio in sim.layout.followers], dtype=float)
    coords = sim.of_worlds(sim.model.joint_q).numpy()
    m.start, m.part_coord = wp.array(task.start(coords), dtype=float), wp.array(sim.part_coord, dtype=int)
    m.stage = wp.array(sim.stage_of_env if demo else np.zeros(sim.num_envs), dtype=int)
    home = np.array([sim.layout.home])
    demo = demo or DemoStarts([Demonstration(home, np.append(home, [[0.0]], axis=1), 1)], 0.0, 0.0)  # nothing moves
    each = demo.demonstrations
    m.demo_targets = wp.array(padded([d.targets for d in each]), dtype=float)
    m.demo_positions = wp.array(padded([d.positions for d in each]), dtype=float)
    m.demo_grasped = wp.array([d.grasped for d in each], dtype=int)
    m.demo_steps = wp.array([len(d.targets) for d in each], dtype=int)
    m.demo_fraction, m.moved_fraction = demo.fraction, demo.moved_fraction
    return m


def _action_step(m: kernels.Motion, sim: Simulation) -> torch.Tensor:
    """Return the change of each joint target in a control step for an action of 1 [rad or m], shape [action]."""
    arm, fingers = sim.layout.arm_joints, sim.layout.robot_joints - sim.layout.arm_joints
    if m.limited:
        return wp.to_torch(m.velocity) * sim.config.control_dt
    return torch.tensor([m.step] * arm + [m.finger_step] * fingers, device=sim.device)


class TaskVectorEnv(VectorEnv[Any, Any, Any]):
    """Worlds of a task; observations, rewards and flags are tensors on the simulation's device, or NumPy arrays.

    A world whose episode ends is reset within the step that ends it (AutoresetMode.SAME_STEP): the returned observation is the
    first of its next episode, and `info["final_obs"]` [world observation] holds the last one of the old episode where
    `info["_final_obs"]` [world] is true. `info["metrics"]` holds the task's metrics of these episodes by name, shape [world].
    `info` always holds NumPy arrays, as Gymnasium's wrappers want them. Of a termination and a truncation in the same step the
    termination counts. `unwrapped.worlds` is the `VecEnv` itself.
    """

    metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}

    def __init__(self, worlds: VecEnv, numpy: bool = False) -> None:
        """Wrap an environment that keeps final observations.

        `worlds`: the environment; `numpy`: return NumPy arrays for tensors.
        """
        self.worlds, self.num_envs, self._numpy, self._is_reset = worlds, worlds.num_envs, numpy, False
        self.single_action_space = Box(-1.0, 1.0, (worlds.num_actions,), np.float32)
        self.single_observation_space = Box(-np.inf, np.inf, (worlds.task.observations,), np.float32)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)

    @property
    def device(self) -> str:
        """Where all tensors are."""
        return self.worlds.sim.device

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start a new episode in every world; return observations [world observation] and an empty info.

        `seed`: of the start noise of all worlds; None: the random streams go on. A list's first entry counts.

        Raises:
            InputError: options were given.
        """
        if options:
            raise InputError(f"reset options {options!r} are unknown; there are none")
        first = seed[0] if isinstance(seed, list) else seed
        self.worlds.reset_all(None if first is None else int(first))
        self._is_reset = True
        return self._array(self.worlds.observation), {}

    def step(self, actions: torch.Tensor | np.ndarray) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Apply actions [world action] in [-1, 1] for one control step.

        Returns:
            Observations [world observation], rewards [world], terminated [world], truncated [world], info.

        Raises:
            InputError: before the first reset; actions of another shape, or that are not finite. No world has moved.
        """
        worlds = self.worlds
        worlds.step(self._checked(actions))
        done, truncated = worlds.done.bool(), worlds.time_out.bool()
        ended = _host(done)
        info = {
            "final_obs": _host(worlds.final_observation),
            "_final_obs": ended,
            "metrics": dict(zip(worlds.columns, _host(worlds.result).T.copy(), strict=True)),
            "_metrics": ended.copy(),
        }
        flags = self._array(done & ~truncated), self._array(truncated)
        return self._array(worlds.observation), self._array(worlds.reward), *flags, info

    def _checked(self, actions: torch.Tensor | np.ndarray) -> torch.Tensor:
        """Return actions as a tensor on the device; errors as of `step`."""
        if not self._is_reset:
            raise InputError("step() before reset(); call reset() first")
        try:
            tensor = torch.as_tensor(actions, dtype=torch.float32, device=self.device)
        except (TypeError, ValueError, RuntimeError) as error:
            raise InputError(f"actions are no array of numbers ({error}); give {self.action_space.shape}") from error
        if tensor.shape != self.action_space.shape:
            raise InputError(
                f"actions have the shape {tuple(tensor.shape)}, expected {self.action_space.shape}: "
                f"{self.num_envs} worlds with {self.worlds.num_actions} actions each"
            )
        finite = tensor.isfinite().all(dim=1)
        if not finite.all():
            first = int(torch.nonzero(~finite)[0])
            raise InputError(
                f"actions of {int((~finite).sum())} worlds are not finite, first in world {first}; give -1 to 1"
            )
        return tensor

    def _array(self, tensor: torch.Tensor) -> Any:
        """Return a copy of what the worlds overwrite."""
        return _host(tensor) if self._numpy else tensor.clone()


def _host(tensor: torch.Tensor) -> np.ndarray:
    array: np.ndarray = tensor.cpu().numpy().copy()
    return array
