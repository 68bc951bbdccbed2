"""A policy as TorchScript and ONNX."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from counting_env import CountingEnv
from onnx.reference import ReferenceEvaluator
from settings import load

from s2a.learn.rl.config import PpoConfig
from s2a.learn.rl.policy_file import export
from s2a.learn.rl.ppo import load_model, load_policy, train


@pytest.mark.slow
def test_both_exports_act_as_the_policy_does_for_any_number_of_worlds(tmp_path: Path) -> None:
    small = {
        "num_steps_per_env": 8,
        "iterations": 2,
        "num_learning_epochs": 1,
        "num_mini_batches": 2,
        "hidden_dims": [16, 8],
    }
    train(CountingEnv(), load(PpoConfig, "ppo/default", **small), tmp_path)
    checkpoint = tmp_path / "model_1.pt"
    script, graph = export(load_model(CountingEnv(), checkpoint), checkpoint)
    assert (script.name, graph.name) == ("model_1.torchscript", "model_1.onnx")
    onnx.checker.check_model(onnx.load(graph))
    for worlds in (1, 5):
        # Off the training's mean by ten: without the normaliser the actions would be others.
        observation = torch.randn(worlds, 23, generator=torch.Generator().manual_seed(0)) + 10.0
        expected = load_policy(CountingEnv(), checkpoint)(observation).detach().numpy()
        assert np.allclose(torch.jit.load(script)(observation).detach().numpy(), expected, atol=1e-5)
        actions = ReferenceEvaluator(onnx.load(graph)).run(["actions"], {"obs": observation.numpy()})[0]
        assert np.allclose(actions, expected, atol=1e-5)
        assert np.abs(expected).max() > 1e-2
