"""Trained policies, from the checkpoints that training wrote."""

from __future__ import annotations

import contextlib
import io
import json
import pickle
from collections.abc import Callable
from pathlib import Path

import torch
from tensordict import TensorDict
from torch import nn

from s2a.env.vec_env import OpenDrawerEnv
from s2a.errors import InputError
from s2a.rl.config import PpoConfig
from s2a.rl.ppo import RslRlEnv, make_runner


def load_model(env: OpenDrawerEnv, checkpoint: Path) -> nn.Module:
    """Return a trained policy's network with its normaliser.

    Raises:
        InputError: the checkpoint, or the policy.json that train writes beside it, is missing or of another kind.
    """
    settings = checkpoint.parent / "policy.json"
    missing = [str(file) for file in (checkpoint, settings) if not file.is_file()]
    if missing:
        raise InputError(
            f"checkpoint {str(checkpoint)!r}: {missing[0]}: no such file; give the model_N.pt in a folder that s2a train wrote"
        )
    values = json.loads(settings.read_text())
    with contextlib.redirect_stdout(io.StringIO()):
        config = PpoConfig(
            **{**values, "hidden": tuple(values["hidden"]), "graph": False, "compile": None, "fused_adam": False}
        )
        runner = make_runner(RslRlEnv(env, config.reward_scale), config, None)
    try:
        runner.load(str(checkpoint), {"actor": True}, map_location=str(env.sim.device))
    except (KeyError, RuntimeError, EOFError, pickle.UnpicklingError) as error:
        raise InputError(
            f"{checkpoint}: not a checkpoint of this policy ({(str(error) or 'empty').splitlines()[0]})"
        ) from error
    return runner.get_inference_policy(device=str(env.sim.device))


def load_policy(env: OpenDrawerEnv, checkpoint: Path) -> Callable[[torch.Tensor], torch.Tensor]:
    """Return a trained policy's mean action [world 9] for an observation [world 23]; InputError as load_model."""
    policy = load_model(env, checkpoint)
    return lambda observation: policy(TensorDict({"policy": observation}, batch_size=[len(observation)]))
