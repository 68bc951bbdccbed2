"""A trained policy as one ONNX file with its world: any run's export, or the bundled one."""

from __future__ import annotations

import json
import logging
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import nn

from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.learn.rl import run_folder
from s2a.learn.rl.run_folder import world_of
from s2a.sim.simulation import SimConfig
from s2a.tasks.base import MdpConfig
from s2a.tasks.env import VecEnv

if TYPE_CHECKING:
    import onnxruntime

PRETRAINED = "pretrained"
"""Names the policy that comes with s2a."""
NORMALIZER_EPS = 1e-2
"""What rsl-rl's normaliser adds to a deviation."""
OBSERVED = 100_000_000
"""Observations that an exported normaliser is taken to be of: the first ones of a new run shall not move it."""
WORLD = "s2a.world"
"""Key of the file's metadata: world.json of the run."""


class PolicyFile:
    """A policy as `s2a train export=true` writes it.

    Attributes:
        name: of the file.
        world: how physics is stepped and what the robot has to do where it was trained.
    """

    def __init__(self, path: Path) -> None:
        """Open a file, or the one that comes with s2a where `path` is "pretrained".

        Raises:
            InputError: there is no such file, it is no ONNX file, or none that s2a wrote.
        """
        file = _found(path)
        self.name = PRETRAINED if str(path) == PRETRAINED else file.name
        self._session = _opened(file)
        metadata = self._session.get_modelmeta().custom_metadata_map
        if WORLD not in metadata:
            raise InputError(f"{file}: does not say in which world it was trained; export it again from its run")
        self.world: tuple[SimConfig, MdpConfig] = world_of(metadata[WORLD], file)

    def bound(self, env: VecEnv) -> Callable[[torch.Tensor], torch.Tensor]:
        """Return the mean action [world action] for an observation [world observation]; InputError where they do not fit."""
        (given,), (actions,) = self._session.get_inputs(), self._session.get_outputs()
        fits = (env.observation.shape[1], env.num_actions)
        if (given.shape[1], actions.shape[1]) != fits:
            raise InputError(
                f"policy {self.name}: for {given.shape[1]} observations and {actions.shape[1]} actions; this robot and task have "
                f"{fits[0]} and {fits[1]}"
            )

        def act(observation: torch.Tensor) -> torch.Tensor:
            seen = observation.cpu().numpy().astype(np.float32, copy=False)
            return torch.from_numpy(self._session.run(None, {given.name: seen})[0]).to(observation.device)

        return act


def _found(path: Path) -> Path:
    """Return the file that a path means; InputError where there is none."""
    file = Path(__file__).parents[1] / "policies/open_part.onnx" if str(path) == PRETRAINED else path
    if not file.is_file():
        raise InputError(f"policy {str(path)!r}: no such file; give an .onnx that s2a train wrote, or {PRETRAINED}")
    return file


def weights(path: Path) -> dict[str, torch.Tensor]:
    """Return a policy's weights and normaliser under rsl-rl's names; errors as of PolicyFile, or of onnx.

    The exporter has folded the normaliser's deviation and its epsilon into one number, which the first division is by.
    """
    import onnx  # 0.2 s to import, which no start of a training should pay

    graph = onnx.load(_found(path)).graph
    values = {each.name: torch.from_numpy(onnx.numpy_helper.to_array(each).copy()) for each in graph.initializer}
    layers = {name: value for name, value in values.items() if name.startswith(("mlp.", "obs_normalizer."))}
    divisor = next(node.input[1] for node in graph.node if node.op_type == "Div")
    deviation = values[divisor] - NORMALIZER_EPS
    of_normalizer = {"_std": deviation, "_var": deviation**2, "count": torch.tensor(OBSERVED)}
    return {**layers, **{f"obs_normalizer.{name}": value for name, value in of_normalizer.items()}}


def _opened(file: Path) -> onnxruntime.InferenceSession:
    """Return a file as onnxruntime runs it, on the CPU; InputError where it cannot."""
    import onnxruntime  # 0.2 s to import, which no start of a training should pay

    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3
    options.intra_op_num_threads = 1  # a network as small as these; physics has the other cores
    try:
        return onnxruntime.InferenceSession(str(file), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # of onnxruntime, which has no class of its own for them
        why = (str(error) or type(error).__name__).splitlines()[0]
        raise InputError(f"{file}: not a policy ({why}); give an .onnx that s2a train wrote") from error


def annotate(file: Path, world: Path) -> None:
    """Write into an ONNX file's metadata in which world it was trained, where a world.json says it.

    What torch's exporter notes of each node is removed: among it are the paths of the source that made it.
    """
    import onnx  # 0.2 s to import, which no start of a training should pay

    model = onnx.load(file)
    for node in model.graph.node:
        node.ClearField("metadata_props")
    if world.is_file():
        onnx.helper.set_model_props(model, {WORLD: json.dumps(json.loads(world.read_text()))})
    onnx.save(model, file)


def export(model: nn.Module, checkpoint: Path) -> list[Path]:
    """Write model_N.torchscript and model_N.onnx beside a checkpoint.

    Both take observations "obs" [world observation], as the environment gives them, and return the mean "actions" [world action],
    which the environment clamps to [-1, 1]; any number of worlds. The ONNX file also says in which world it was trained.

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
        annotate(out, checkpoint.parent / run_folder.FILE)
    return [script, graph]
