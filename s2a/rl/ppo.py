"""Training a policy by proximal policy optimisation: rsl-rl around the environment."""

from __future__ import annotations

import contextlib
import copy
import json
import os
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from rsl_rl.env import VecEnv
from rsl_rl.runners import OnPolicyRunner
from tensordict import TensorDict

from s2a.env.vec_env import OpenDrawerEnv
from s2a.errors import InputError
from s2a.outputs import atomic_write
from s2a.progress import track
from s2a.rl import processes, run_folder
from s2a.rl.config import BROKEN, PpoConfig, rsl_rl_settings
from s2a.rl.logger import LazyLogger
from s2a.tasks.open_part.config import COUNTS, REWARD_TERMS, TROUBLES

RECENT = 0.999
"""Factor a control step by which finished episodes count less in the logged rates: about two episodes' length."""
LOGGED = ("success", "final_success", "wide", "final_wide", "static", "full", *TROUBLES)
"""Columns whose rates over the recent episodes are logged."""


class RslRlEnv(VecEnv):
    """The environment as rsl-rl sees it.

    Observations and rewards are copies: rsl-rl keeps the observation it acted on across the step, which overwrites the
    environment's own buffer in place.

    Attributes:
        counted: sums over all finished episodes, in the order of COUNTS, shape [16], float64.
        recent: the same, where an episode that ended k control steps ago counts as RECENT ** k, float32.
    """

    def __init__(
        self,
        env: OpenDrawerEnv,
        reward_scale: float,
        on_step: Callable[[], object] = lambda: None,
        log_every: int = 1,
    ) -> None:
        """Wrap an environment; `on_step` is called after every control step, every `log_every`th one is logged."""
        self.env, self._reward_scale, self._on_step = env, reward_scale, on_step
        self.num_envs, self.num_actions = env.num_envs, env.num_actions
        self.max_episode_length = env.max_episode_length
        self.device = env.sim.device
        self.cfg: dict = {}
        self.counted = torch.zeros(len(COUNTS), device=self.device, dtype=torch.float64)
        self.recent = torch.zeros(len(COUNTS), device=self.device)
        self._terms = torch.zeros(len(REWARD_TERMS), device=self.device)
        self._log_every, self._steps = log_every, 0

    @property
    def episode_length_buf(self) -> torch.Tensor:
        """Control steps since each world's reset; assigning copies, and leaves the episodes that it cuts short uncounted."""
        return self.env.episode_step

    @episode_length_buf.setter
    def episode_length_buf(self, value: torch.Tensor) -> None:
        self.env.episode_step.copy_(value)
        self.env.midway.fill_(1)

    @property
    def warm(self) -> bool:
        """Whether more than an episode's time has passed; what ends earlier is what succeeded early."""
        return self._steps > self.max_episode_length

    def get_observations(self) -> TensorDict:
        """Return a copy of the observation [world 23]."""
        return TensorDict({"policy": self.env.observation.clone()}, batch_size=[self.num_envs])

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict]:
        """Apply actions [world 9]; return observations, rewards, dones, and what is logged."""
        env = self.env
        env.step(actions)
        self.counted.add_(env.counts)
        self.recent.mul_(RECENT).add_(env.counts)
        env.counts.zero_()
        self._terms.add_(env.terms.mean(dim=0))
        self._on_step()
        self._steps += 1
        extras: dict[str, Any] = {"time_outs": env.time_out.float()}
        if self._steps % self._log_every == 0:
            extras["log"] = self._log()
        return self.get_observations(), env.reward * self._reward_scale, env.done.long(), extras

    def _log(self) -> dict[str, torch.Tensor]:
        """Return rates over the recent episodes, and the mean of each unweighted reward term.

        Rates are not a number before the worlds are warm.
        """
        known = self.recent if self.warm else torch.full_like(self.recent, torch.nan)
        recent = dict(zip(COUNTS, known.unbind(), strict=True))
        episodes, successes = recent["episodes"], recent["success"]
        terms = (self._terms / self._log_every).unbind()
        self._terms = torch.zeros_like(self._terms)
        return {
            **{f"/{name}": recent[name] / episodes for name in LOGGED},
            "/handle_use_of_successes": recent["handle_success"] / successes,
            "/side_grasps_of_successes": recent["side_success"] / successes,
            "/opening": recent["opening"] / episodes,
            **{f"/term/{n}": v for n, v in zip(REWARD_TERMS, terms, strict=True)},
        }


class Runner(OnPolicyRunner):
    """rsl-rl's runner, whose checkpoints appear whole or not at all, and whose processes may be on a CPU.

    Attributes:
        seconds: of training so far, in the processes before this one too.
    """

    env: RslRlEnv
    seconds = 0.0
    _clock: float

    def __init__(self, env: RslRlEnv, settings: dict[str, Any], log_dir: str | None, device: str) -> None:
        """Build what learns and what logs."""
        super().__init__(env, settings, log_dir, device)
        place = (self.is_distributed, self.gpu_world_size, self.gpu_global_rank)
        self.logger = LazyLogger(log_dir, self.cfg, env.cfg, env.num_envs, *place, device)

    def learn(self, num_learning_iterations: int, init_at_random_ep_len: bool = False) -> None:
        """Train, and keep the time."""
        self._clock = time.perf_counter()
        super().learn(num_learning_iterations, init_at_random_ep_len)
        self._keep_time()

    def save(self, path: str, infos: dict | None = None) -> None:
        """Write a checkpoint, with the time and the episodes that it took; InputError for a policy that is no number any more."""
        self._keep_time()
        if not all(bool(p.isfinite().all()) for group in self.alg.optimizer.param_groups for p in group["params"]):
            raise InputError(BROKEN)
        counted = dict(zip(COUNTS, self.env.counted.tolist(), strict=True))
        with atomic_write(Path(path)) as out:
            super().save(str(out), {"seconds": self.seconds, "counted": counted})

    def resume(self, checkpoint: Path) -> None:
        """Go on after the iteration that a checkpoint was written in."""
        infos = self.load(str(checkpoint), map_location=str(self.device))
        self.current_learning_iteration += 1
        self.seconds = infos["seconds"]
        if not isinstance(infos["counted"], dict):
            raise InputError(f"{checkpoint} is of an earlier version of s2a train; train again, into another folder")
        self.env.counted.copy_(torch.tensor([infos["counted"].get(name, 0.0) for name in COUNTS]))
        batch = self.cfg["num_steps_per_env"] * self.env.num_envs * self.gpu_world_size
        self.logger.tot_timesteps = self.current_learning_iteration * batch
        self.logger.tot_time = self.seconds

    def _keep_time(self) -> None:
        now = time.perf_counter()
        self.seconds += now - self._clock
        self._clock = now

    def _configure_multi_gpu(self) -> None:
        """Join the other processes, on CPUs too, where rsl-rl itself refuses."""
        if processes.count() == 1 or torch.device(self.device).type != "cpu":
            super()._configure_multi_gpu()
            return
        rank, count = processes.rank(), processes.count()
        self.gpu_world_size, self.gpu_global_rank, self.gpu_local_rank, self.is_distributed = count, rank, rank, True
        self.cfg["multi_gpu"] = {"global_rank": rank, "local_rank": rank, "world_size": count}
        torch.distributed.init_process_group(backend="gloo", rank=rank, world_size=count)


def make_runner(env: RslRlEnv, config: PpoConfig, log_dir: Path | None) -> Runner:
    """Return rsl-rl's runner, which holds actor, critic, optimiser and normaliser."""
    settings = copy.deepcopy(rsl_rl_settings(config))
    runner = Runner(env, settings, str(log_dir) if log_dir else None, device=str(env.device))
    if config.fused_adam and not config.graph:  # rsl-rl knows an optimiser by its name alone
        groups = runner.alg.optimizer.param_groups
        runner.alg.optimizer = torch.optim.Adam(groups[0]["params"], lr=config.learning_rate, fused=True)
    return runner


def train(env: OpenDrawerEnv, config: PpoConfig, out: Path, checkpoint: Path | None = None) -> dict[str, Any]:
    """Train a policy and write checkpoints, the TensorBoard log and rsl-rl's own report (train.log) into `out`.

    Args:
        env: the worlds of this process.
        config: rsl-rl's settings.
        out: the folder.
        checkpoint: one in `out`, after which training goes on; None: it begins.

    Returns:
        The iteration it began with, environment steps (of all processes), seconds, environment steps a second of this
        process's training, the finished episodes and how many had each of TROUBLES, the recent sums of COUNTS (of all
        processes; zeros before the worlds are warm), and the curve: per iteration success, handle use, opening, reward and
        others.
    """
    lead = processes.rank() == 0
    first = run_folder.iteration(checkpoint) + 1 if checkpoint else 0
    if lead:
        out.mkdir(parents=True, exist_ok=True)
        run_folder.cut(out, first)
        (out / "policy.json").write_text(json.dumps(asdict(config), indent=1))
    todo = max(0, config.iterations - first)
    steps = iter(track(range(todo * config.steps), "train") if lead else range(0))
    with Path(out / "train.log" if lead else os.devnull).open("a") as log, contextlib.redirect_stdout(log):
        adapter = RslRlEnv(env, config.reward_scale, lambda: next(steps, None), log_every=config.steps)
        runner = make_runner(adapter, config, out)
        if checkpoint:
            runner.resume(checkpoint)
        before = runner.seconds
        if todo:
            runner.learn(todo, init_at_random_ep_len=True)
    next(steps, None)
    counted = processes.add_up(adapter.counted)
    recent = processes.add_up(adapter.recent * adapter.warm)
    processes.part()
    batch = config.steps * env.num_envs * processes.count()
    return {
        "first_iteration": first,
        "env_steps": (first + todo) * batch,
        "seconds": runner.seconds,
        "env_steps_per_second": todo * batch / max(runner.seconds - before, 1e-9),
        **{name: int(n) for name, n in zip(COUNTS, counted, strict=True) if name in ("episodes", *TROUBLES)},
        "recent": dict(zip(COUNTS, recent.tolist(), strict=True)),
        "curve": run_folder.curve(out) if lead else [],
    }
