"""Training a policy by proximal policy optimisation: rsl-rl around the environment."""

from __future__ import annotations

import contextlib
import copy
import io
import json
import pickle
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from rsl_rl.env import VecEnv
from rsl_rl.runners import OnPolicyRunner
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tensordict import TensorDict

from s2a.errors import InputError
from s2a.progress import track
from s2a.task.env import OpenDrawerEnv
from s2a.task.open_drawer import COUNTS, REWARD_TERMS

RECENT = 0.999
"""Factor a control step by which finished episodes count less in the logged rates: about two episodes' length."""


@dataclass(frozen=True)
class PpoConfig:
    """rsl-rl's settings.

    Attributes:
        iterations: of collecting and learning.
        steps: control steps a world collects for an iteration.
        epochs: passes over them.
        mini_batches: parts of a pass.
        learning_rate: at the start; adapted to keep the divergence at `desired_kl`.
        desired_kl: divergence of a policy from the one before it.
        gamma: discount of a control step.
        lam: of the generalised advantage estimate.
        clip: of the probability ratio, and of the value's change where `clip_value` is true.
        clip_value: whether the value's change is clipped. It is clipped in units of the return, so that returns in the hundreds
            are learned slowly.
        reward_scale: factor of the reward that rsl-rl is given.
        value_loss: weight of the value's loss.
        entropy: weight of the entropy.
        max_grad_norm: where the gradient is cut.
        hidden: widths of the layers of actor and critic (ELU).
        init_std: standard deviation of the first policy's actions.
        save_interval: iterations between checkpoints.
    """

    iterations: int
    steps: int
    epochs: int
    mini_batches: int
    learning_rate: float
    desired_kl: float
    gamma: float
    lam: float
    clip: float
    clip_value: bool
    reward_scale: float
    value_loss: float
    entropy: float
    max_grad_norm: float
    hidden: tuple[int, ...]
    init_std: float
    save_interval: int


class RslRlEnv(VecEnv):
    """The environment as rsl-rl sees it.

    Observations and rewards are copies: rsl-rl keeps the observation it acted on across the step, which overwrites the
    environment's own buffer in place.
    """

    def __init__(self, env: OpenDrawerEnv, reward_scale: float, on_step: Callable[[], object] = lambda: None) -> None:
        """Wrap an environment; `on_step` is called after every control step."""
        self.env, self._reward_scale, self._on_step = env, reward_scale, on_step
        self.num_envs, self.num_actions = env.num_envs, env.num_actions
        self.max_episode_length = env.max_episode_length
        self.device = env.sim.device
        self.cfg: dict = {}
        self._recent = torch.zeros(len(COUNTS), device=self.device)

    @property
    def episode_length_buf(self) -> torch.Tensor:
        """Control steps since each world's reset; assigning copies, and leaves the episodes that it cuts short uncounted."""
        return self.env.episode_step

    @episode_length_buf.setter
    def episode_length_buf(self, value: torch.Tensor) -> None:
        self.env.episode_step.copy_(value)
        self.env.midway.fill_(1)

    def get_observations(self) -> TensorDict:
        """Return a copy of the observation [world 23]."""
        return TensorDict({"policy": self.env.observation.clone()}, batch_size=[self.num_envs])

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict]:
        """Apply actions [world 9]; return observations, rewards, dones, and what is logged."""
        env = self.env
        env.step(actions)
        self._recent.mul_(RECENT).add_(env.counts)
        env.counts.zero_()
        self._on_step()
        extras = {"time_outs": env.time_out.float(), "log": self._log()}
        return self.get_observations(), env.reward * self._reward_scale, env.done.long(), extras

    def _log(self) -> dict[str, torch.Tensor]:
        """Return rates over the recent episodes, of those that finished, and the mean of each unweighted reward term."""
        recent = dict(zip(COUNTS, self._recent.unbind(), strict=True))
        episodes = recent["episodes"].clamp(min=1e-6)
        successes = recent["success"].clamp(min=1e-6)
        return {
            "/success": recent["success"] / episodes,
            "/final_success": recent["final_success"] / episodes,
            "/handle_use_of_successes": recent["handle_success"] / successes,
            "/side_grasps_of_successes": recent["side_success"] / successes,
            **{f"/{name}": recent[name] / episodes for name in ("wide", "final_wide", "static", "full")},
            "/opening": recent["opening"] / episodes,
            "/invalid": recent["invalid"] / episodes,
            **{f"/term/{n}": v for n, v in zip(REWARD_TERMS, self.env.terms.mean(dim=0).unbind(), strict=True)},
        }


def make_runner(env: RslRlEnv, config: PpoConfig, log_dir: Path | None) -> OnPolicyRunner:
    """Return rsl-rl's runner, which holds actor, critic, optimiser and normaliser."""
    return OnPolicyRunner(env, copy.deepcopy(_settings(config)), log_dir and str(log_dir), device=str(env.device))


def train(env: OpenDrawerEnv, config: PpoConfig, out: Path) -> dict[str, Any]:
    """Train a policy and write checkpoints, the TensorBoard log and rsl-rl's own report (train.log) into `out`.

    Returns:
        Seconds, environment steps a second, and the curve: per logged iteration success, handle use, opening, reward.
    """
    out.mkdir(parents=True, exist_ok=True)
    steps = iter(track(range(config.iterations * config.steps), "train"))
    (out / "policy.json").write_text(json.dumps(asdict(config), indent=1))
    with (out / "train.log").open("w") as log, contextlib.redirect_stdout(log):
        runner = make_runner(RslRlEnv(env, config.reward_scale, lambda: next(steps, None)), config, out)
        begin = time.perf_counter()
        runner.learn(config.iterations, init_at_random_ep_len=True)
    seconds = time.perf_counter() - begin
    next(steps, None)
    env_steps = config.iterations * config.steps * env.num_envs
    return {
        "env_steps": env_steps,
        "seconds": seconds,
        "env_steps_per_second": env_steps / seconds,
        "curve": _curve(out),
    }


def load_policy(env: OpenDrawerEnv, checkpoint: Path) -> Callable[[torch.Tensor], torch.Tensor]:
    """Return a trained policy's mean action [world 9] for an observation [world 23].

    Raises:
        InputError: the checkpoint, or the policy.json that train writes beside it, is missing or of another kind.
    """
    settings = checkpoint.parent / "policy.json"
    for file in (checkpoint, settings):
        if not file.is_file():
            raise InputError(f"{file}: no such file; give the model_N.pt in a folder that s2a train wrote")
    values = json.loads(settings.read_text())
    with contextlib.redirect_stdout(io.StringIO()):
        config = PpoConfig(**{**values, "hidden": tuple(values["hidden"])})
        runner = make_runner(RslRlEnv(env, config.reward_scale), config, None)
    try:
        runner.load(str(checkpoint), map_location=str(env.sim.device))
    except (KeyError, RuntimeError, EOFError, pickle.UnpicklingError) as error:
        raise InputError(
            f"{checkpoint}: not a checkpoint of this policy ({(str(error) or 'empty').splitlines()[0]})"
        ) from error
    policy = runner.get_inference_policy(device=str(env.sim.device))
    return lambda observation: policy(TensorDict({"policy": observation}, batch_size=[env.num_envs]))


def _settings(config: PpoConfig) -> dict[str, Any]:
    """Return the settings under rsl-rl's names."""
    network = {
        "class_name": "MLPModel",
        "hidden_dims": list(config.hidden),
        "activation": "elu",
        "obs_normalization": True,
    }
    distribution = {"class_name": "GaussianDistribution", "init_std": config.init_std, "std_type": "scalar"}
    return {
        "num_steps_per_env": config.steps,
        "save_interval": config.save_interval,
        "obs_groups": {"actor": ["policy"], "critic": ["policy"]},
        "check_for_nan": False,  # the environment resets worlds that are not finite, and counts them
        "algorithm": {
            "class_name": "PPO",
            "num_learning_epochs": config.epochs,
            "num_mini_batches": config.mini_batches,
            "learning_rate": config.learning_rate,
            "schedule": "adaptive",
            "desired_kl": config.desired_kl,
            "gamma": config.gamma,
            "lam": config.lam,
            "clip_param": config.clip,
            "use_clipped_value_loss": config.clip_value,
            "value_loss_coef": config.value_loss,
            "entropy_coef": config.entropy,
            "max_grad_norm": config.max_grad_norm,
        },
        "actor": {**network, "distribution_cfg": distribution},
        "critic": network,
    }


def _curve(out: Path) -> list[dict[str, float]]:
    """Return what TensorBoard logged, a row an iteration."""
    events = EventAccumulator(str(out), size_guidance={"scalars": 0})
    events.Reload()
    names = {
        "success": "/success",
        "final_success": "/final_success",
        "handle_use_of_successes": "/handle_use_of_successes",
    }
    names |= {"opening": "/opening", "reward": "Train/mean_reward", "invalid": "/invalid"}
    rows: dict[int, dict[str, float]] = {}
    for name, tag in names.items():
        for event in _scalars(events, tag):
            rows.setdefault(event.step, {"iteration": event.step})[name] = event.value
    return [rows[i] for i in sorted(rows)]


def _scalars(events: EventAccumulator, tag: str) -> Iterator[Any]:
    """Return a tag's events; none if it was never logged."""
    yield from events.Scalars(tag) if tag in events.Tags()["scalars"] else []
