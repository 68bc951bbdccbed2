"""A trained policy for those who have neither s2a nor rsl-rl: TorchScript and ONNX, the normaliser within."""

from __future__ import annotations

import logging
import warnings
from pathlib import Path

import torch
from torch import nn

from s2a.core.outputs import atomic_write
from s2a.learn.rl import run_world
from s2a.learn.rl.policy_file import forget_source, note_world


def export(model: nn.Module, checkpoint: Path) -> list[Path]:
    """Write model_N.torchscript and model_N.onnx beside a checkpoint.

    Both take observations "obs" [world observation], as the environment gives them, and return the mean "actions" [world action],
    which the environment clamps to [-1, 1]; any number of worlds. The ONNX file also says in which world it was trained.

    Args:
        model: rsl-rl's network of the policy.
        checkpoint: model_N.pt.

    Returns:
        The two files.
    """
    script, graph = checkpoint.with_suffix(".torchscript"), checkpoint.with_suffix(".onnx")
    with atomic_write(script) as out:
        torch.jit.script(model.as_jit().cpu().eval()).save(str(out))
    with atomic_write(graph) as out, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of torch's exporter about torch itself
        logging.getLogger("torch.onnx").setLevel(logging.ERROR)
        onnx = model.as_onnx(verbose=False).cpu().eval()
        torch.onnx.export(
            onnx,
            (torch.zeros(2, onnx.input_size),),
            str(out),
            input_names=["obs"],
            output_names=["actions"],
            opset_version=18,
            dynamic_shapes=({0: torch.export.Dim("world")},),
            external_data=False,
            verbose=False,
        )
        forget_source(out)
        world = checkpoint.parent / run_world.FILE
        if world.is_file():
            note_world(out, world.read_text())
    return [script, graph]
