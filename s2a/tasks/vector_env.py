"""The environment's public face: a `gymnasium.vector.VectorEnv` on torch tensors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from s2a import tasks
from s2a.core import config
from s2a.core.errors import InputError
from s2a.motion.settings import PlannerConfig
from s2a.sim.simulation import SimConfig, Simulation, device_of
from s2a.tasks.env import VecEnv


class TaskVectorEnv(VectorEnv[torch.Tensor, torch.Tensor, torch.Tensor]):
    """Worlds of a task; observations, rewards and flags are tensors on the simulation's device.

    A world whose episode ends is reset within the step that ends it (AutoresetMode.SAME_STEP): the returned observation is the
    first of its next episode, and `info["final_obs"]` [world observation] holds the last one of the old episode where
    `info["_final_obs"]` [world] is true. `info["episode"]` holds the task's metrics of these episodes by name, shape [world].
    Of a termination and a truncation in the same step the termination counts. `unwrapped.worlds` is the `VecEnv` itself.
    """

    metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}

    def __init__(self, worlds: VecEnv) -> None:
        """Wrap an environment that keeps final observations."""
        self.worlds, self.num_envs = worlds, worlds.num_envs
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
    ) -> tuple[torch.Tensor, dict[str, Any]]:
        """Start a new episode in every world; return observations [world observation] and an empty info.

        Args:
            seed: of the start noise of all worlds; None: the random streams go on. A list's first entry counts.
            options: none are known.

        Raises:
            InputError: options were given.
        """
        if options:
            raise InputError(f"reset options {options!r} are unknown; there are none")
        first = seed[0] if isinstance(seed, list) else seed
        self.worlds.reset_all(None if first is None else int(first))
        return self.worlds.observation.clone(), {}

    def step(
        self, actions: torch.Tensor | np.ndarray
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor, dict[str, Any]]:
        """Apply actions [world action] in [-1, 1] for one control step.

        Returns:
            Observations [world observation], rewards [world], terminated [world], truncated [world], info.
        """
        worlds = self.worlds
        worlds.step(torch.as_tensor(actions, dtype=torch.float32, device=self.device))
        done, truncated = worlds.done.bool(), worlds.time_out.bool()
        info = {
            "final_obs": worlds.final_observation.clone(),
            "_final_obs": done,
            "episode": dict(zip(worlds.columns, worlds.result.clone().unbind(1), strict=True)),
            "_episode": done,
        }
        return worlds.observation.clone(), worlds.reward.clone(), done & ~truncated, truncated, info


def make(
    task: str,
    room: str | Path,
    part: str | None = None,
    num_envs: int = 1024,
    device: str = "auto",
    seed: int = 0,
    overrides: tuple[str, ...] | list[str] = (),
) -> TaskVectorEnv:
    """Return a task in worlds of a simulation-ready room, or of the parts of many; arguments as of `s2a.api.make`."""
    kind = tasks.task(task)
    values = config.compose("train", [f"task={task}", "stage=-", "out=-", *overrides])
    mdp = config.load(kind.Config, values["task"])
    metrics: Any = config.load(kind.Metrics, values["metrics"])
    asked = any(each.startswith("robot=") for each in overrides)  # else the one that the room was prepared for
    motion, robot = config.load(PlannerConfig, values["planner"]), values["robot"]["name"] if asked else None
    stages = tasks.read_stages(kind, Path(room), part, robot, (), mdp, motion)
    sim = Simulation(stages, config.load(SimConfig, values["sim"]), num_envs, device_of(device))
    return TaskVectorEnv(tasks.make_env(sim, mdp, metrics, values["reward"], seed, final_observation=True))
