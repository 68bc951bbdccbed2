"""Trained policies, from the checkpoints that training wrote."""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import torch
from tensordict import TensorDict
from torch import nn

from s2a.core import aliases, config
from s2a.core.errors import InputError
from s2a.env.vec_env import VecEnv
from s2a.learn.rl.adapter import RslRlEnv
from s2a.learn.rl.config import PpoConfig
from s2a.learn.rl.ppo import make_runner


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
        trained = config.load(PpoConfig, aliases.settings(values, "policy"))
    except (OSError, ValueError, AttributeError, InputError) as error:
        raise InputError(f"{file}: not what s2a train writes ({error}); train again") from error
    return replace(trained, cuda_graph=False, torch_compile_mode=None, fused_adam=False)
