"""Training a policy by proximal policy optimisation: rsl-rl around the environment."""

from __future__ import annotations

import contextlib
import copy
import io
import json
import os
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import torch
from tensordict import TensorDict
from torch import nn

from s2a.core import config
from s2a.core.errors import InputError
from s2a.core.progress import track
from s2a.learn.rl import config as processes
from s2a.learn.rl import run_folder
from s2a.learn.rl.adapter import RslRlEnv
from s2a.learn.rl.config import PpoConfig, rsl_rl_settings
from s2a.learn.rl.run_folder import ADDED
from s2a.learn.rl.runner import Runner
from s2a.motion.policy import Planner
from s2a.tasks.env import VecEnv
from s2a.tasks.state import ERRORS


def make_runner(env: RslRlEnv, config: PpoConfig, log_dir: Path | None) -> Runner:
    """Return rsl-rl's runner, which holds actor, critic, optimiser and normaliser."""
    torch.backends.cuda.matmul.allow_tf32 = config.tf32
    settings = copy.deepcopy(rsl_rl_settings(config, env.env.task.privileged > 0))
    runner = Runner(env, settings, str(log_dir) if log_dir else None, device=str(env.device))
    if config.fused_adam and not config.cuda_graph:  # rsl-rl knows an optimiser by its name alone
        groups = runner.alg.optimizer.param_groups
        runner.alg.optimizer = torch.optim.Adam(groups[0]["params"], lr=config.learning_rate, fused=True)
    return runner


def train(
    env: VecEnv,
    config: PpoConfig,
    out: Path,
    checkpoint: Path | None = None,
    init: Path | None = None,
    teacher: Planner | None = None,
) -> dict[str, Any]:
    """Train a policy and write checkpoints, the TensorBoard log and rsl-rl's own report (train.log) into `out`.

    Args:
        env: the worlds of this process.
        config: rsl-rl's settings.
        out: the folder.
        checkpoint: one in `out`, after which training goes on; None: it begins.
        teacher: whom the policy imitates in the first iterations, if it does.
        init: of another run, with whose networks a training begins that does not go on; None: with random ones.

    Returns:
        The iteration it began with, environment steps (of all processes), seconds, environment steps a second of this
        process's training, the finished episodes and how many had each of ERRORS, the sums over recent episodes by name (of
        all processes; zeros before the worlds are warm), and the curve: what was logged, a row an iteration.
    """
    lead = processes.rank() == 0
    first = run_folder.iteration(checkpoint) + 1 if checkpoint else 0
    if lead:
        out.mkdir(parents=True, exist_ok=True)
        run_folder.cut(out, first)
        (out / "policy.json").write_text(json.dumps(asdict(config), indent=1))
    todo = max(0, config.iterations - first)
    steps = iter(track(range(todo * config.num_steps_per_env), "train") if lead else range(0))
    with Path(out / "train.log" if lead else os.devnull).open("a") as log, contextlib.redirect_stdout(log):
        each = config.num_steps_per_env
        adapter = RslRlEnv(env, config.reward_scale, lambda: next(steps, None), log_every=each, teacher=teacher)
        runner = make_runner(adapter, config, out)
        if checkpoint:
            runner.resume(checkpoint)
        elif init:
            runner.begin_with(init)
        if init:
            runner.keep_normalizer()
        before = runner.seconds
        if todo:
            runner.learn(todo, init_at_random_ep_len=True)
    next(steps, None)
    counted = dict(zip(adapter.names, processes.add_up(adapter.counted).tolist(), strict=True))
    recent = processes.add_up(adapter.recent * adapter.warm)
    processes.part()
    batch = config.num_steps_per_env * env.num_envs * processes.count()
    return {
        "first_iteration": first,
        "env_steps": (first + todo) * batch,
        "seconds": runner.seconds,
        "env_steps_per_second": todo * batch / max(runner.seconds - before, 1e-9),
        **{name: int(counted[name]) for name in ("episodes", *ERRORS)},
        "recent": dict(zip(adapter.names, recent.tolist(), strict=True)),
        "curve": run_folder.curve(out) if lead else [],
    }


def load_model(env: VecEnv, checkpoint: Path) -> nn.Module:
    """Return a trained policy's network with its normaliser; nothing in the file is executed.

    Raises:
        InputError: the checkpoint, or the policy.json that train writes beside it, is missing, damaged or of another kind.
    """
    settings = checkpoint.parent / "policy.json"
    missing = [str(file) for file in (checkpoint, settings) if not file.is_file()]
    if missing:
        raise InputError(
            f"checkpoint {str(checkpoint)!r}: {missing[0]}: no such file; give the model_N.pt in a folder that s2a train wrote"
        )
    trained = _settings(settings)
    with contextlib.redirect_stdout(io.StringIO()):
        runner = make_runner(RslRlEnv(env, trained.reward_scale), trained, None)
    try:
        runner.load(str(checkpoint), {"actor": True}, map_location=str(env.sim.device))
    except Exception as error:  # of torch, pickle, zipfile: whatever a damaged or hostile file makes them raise
        why = (str(error) or "empty").splitlines()[0]
        raise InputError(f"{checkpoint}: not a checkpoint of this policy ({why})") from error
    return runner.get_inference_policy(device=str(env.sim.device))


def load_policy(env: VecEnv, checkpoint: Path) -> Callable[[torch.Tensor], torch.Tensor]:
    """Return a trained policy's mean action [world action] for an observation; InputError as load_model."""
    policy = load_model(env, checkpoint)
    return lambda observation: policy(TensorDict({"policy": observation}, batch_size=[len(observation)]))


def _settings(file: Path) -> PpoConfig:
    """Return how a policy was trained, without what only makes training fast."""
    try:
        values = json.loads(file.read_text())
        added = {key.removeprefix("ppo."): value for key, value in ADDED.items() if key.startswith("ppo.")}
        trained = config.load(PpoConfig, added | values)
    except (OSError, ValueError, AttributeError, TypeError, InputError) as error:
        raise InputError(f"{file}: not what s2a train writes ({error}); train again") from error
    return replace(trained, cuda_graph=False, torch_compile_mode=None, fused_adam=False)
