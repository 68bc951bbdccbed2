"""A trained policy as one ONNX file with its world: any run's export, the bundled one, or a network from elsewhere."""

from __future__ import annotations

import copy
import json
import logging
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

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

_log = logging.getLogger(__name__)
PRETRAINED = "pretrained"  # Names the policy that comes with s2a
NORMALIZER_EPS = 1e-2  # What rsl-rl's normaliser adds to a deviation
# Observations that an exported normaliser is taken to be of: the first ones of a new run shall not move it
OBSERVED = 100_000_000
WORLD = "s2a.world"  # Key of the file's metadata: world.json of the run


class PolicyFile:
    """A policy as `s2a train export=true` and `wrap` write it, or a network's plain export.

    Attributes:
        name: of the file.
        world: how physics is stepped and what the robot has to do where it was trained; None: the file does not say.
    """

    def __init__(self, path: Path) -> None:
        """Open a file, or the one that comes with s2a where `path` is "pretrained".

        Raises:
            InputError: there is no such file, it is not an ONNX file, or its metadata are of another version.
        """
        file = file_of(path)
        self.name = PRETRAINED if str(path) == PRETRAINED else file.name
        self._session = _opened(file)
        metadata = self._session.get_modelmeta().custom_metadata_map
        self.world: tuple[SimConfig, MdpConfig] | None = None
        if WORLD in metadata:
            self.world = world_of(metadata[WORLD], file)

    def worlds(self, sim: SimConfig, task: MdpConfig) -> tuple[SimConfig, MdpConfig]:
        """Return the file's world, or, with a warning, these settings where it says nothing of it."""
        if self.world is None:
            text = (
                "policy %s: does not state the settings of its training; those of the keys sim and task are used (%s)"
            )
            _log.warning(text, self.name, "api.export_policy writes a file that does")
        return self.world or (sim, task)

    def bound(self, env: VecEnv) -> Callable[[torch.Tensor], torch.Tensor]:
        """Return the mean action [world action] for an observation [world observation].

        Raises:
            InputError: the network does not take these observations, or gives something else than these actions, or none that
                are finite for the first observations of the environment.
        """
        inputs, outputs = self._session.get_inputs(), self._session.get_outputs()
        fits = f"policy {self.name}: {expected(env)}"
        if len(inputs) != 1:
            raise InputError(f"{fits}; it has the inputs {', '.join(each.name for each in inputs)}: export it with one")
        kind = np.float64 if inputs[0].type == "tensor(double)" else np.float32

        def act(observation: torch.Tensor) -> torch.Tensor:
            seen = {inputs[0].name: observation.cpu().numpy().astype(kind, copy=False)}
            return torch.from_numpy(self._session.run([outputs[0].name], seen)[0]).float().to(observation.device)

        given = inputs[0].shape
        if len(given) != 2 or given[1] not in (env.observation.shape[1], None) and not isinstance(given[1], str):
            raise InputError(f"{fits}; it takes {_shape(given)}")
        if isinstance(given[0], int) and given[0] != env.num_envs:
            raise InputError(f"{fits}; it takes {given[0]} at a time: export it with a dynamic first axis")
        _refuse_misfit(act, env, f"policy {self.name}")
        return act


def expected(env: VecEnv) -> str:
    """Return in words what a policy has to take and to give in an environment."""
    taken, given = env.observation.shape[1], env.num_actions
    return f"this robot and task give [world {taken}] observations and take [world {given}] actions"


def _shape(shape: Sequence[object]) -> str:
    return f"[{' '.join(map(str, shape))}]"


def wrap(network: nn.Module | Path, out: Path, env: VecEnv) -> Path:
    """Write a network from elsewhere as a policy file, which says in which world it was trained.

    Args:
        network: a torch module that takes observations [world observation], float32, and returns the mean action
            [world action], which the environment clamps to [-1, 1]; or an ONNX file of one, with its .onnx.data beside it
            where it has one; or "pretrained".
        out: the ONNX file to write.
        env: in which it was trained, or another one with the same settings.

    Raises:
        InputError: the network fails on an observation of the environment, or gives something else than its actions; no file
            is written.
    """
    if out.suffix != ".onnx":
        raise InputError(f"out {str(out)!r}: a policy file ends in .onnx: give {out.with_suffix('.onnx')}")
    import onnx  # 0.2 s to import, which no start of a training should pay

    with atomic_write(out) as file:
        if isinstance(network, nn.Module):
            module = copy.deepcopy(network).cpu().float().eval()
            _refuse_misfit(module, env, "network")
            write_graph(module, {"obs": torch.zeros(2, env.observation.shape[1])}, "actions", file)
        else:
            _opened(file_of(network))
            onnx.save(onnx.load(file_of(network)), file)  # with the weights, also those of a file of their own
        _write_world(file, run_folder.world_json(env.sim.config, env.task.config))
        PolicyFile(file).bound(env)
    return out


def _refuse_misfit(act: Callable[[torch.Tensor], Any], env: VecEnv, name: str) -> None:
    """Raise InputError where a network on the CPU does not give finite actions for an environment's observations."""
    observation = env.observation.cpu().float()
    try:
        with torch.no_grad():
            action = act(observation)
    except Exception as error:  # whatever a user's module raises, or onnxruntime, which has no class of its own for it
        why = (str(error) or type(error).__name__).splitlines()[0]
        raise InputError(f"{name}: {expected(env)}; it fails on {_shape(observation.shape)} ({why})") from error
    if not isinstance(action, torch.Tensor) or action.shape != (env.num_envs, env.num_actions):
        given = _shape(action.shape) if isinstance(action, torch.Tensor) else type(action).__name__
        raise InputError(f"{name}: {expected(env)}; it gives {given} for {_shape(observation.shape)}")
    if not action.isfinite().all():
        raise InputError(f"{name}: its actions are not finite for an observation of this environment")


def file_of(path: Path) -> Path:
    """Return the file that a path or "pretrained" means; InputError where there is none."""
    file = Path(__file__).parents[1] / "policies/open_part.onnx" if str(path) == PRETRAINED else path
    if not file.is_file():
        raise InputError(f"policy {str(path)!r}: no such file; give an .onnx that s2a train wrote, or {PRETRAINED}")
    return file


def weights(path: Path) -> dict[str, torch.Tensor]:
    """Return a policy's weights and normaliser under rsl-rl's names; errors as of PolicyFile, or of onnx.

    The exporter has folded the normaliser's deviation and its epsilon into one number, which the first division is by.
    """
    import onnx  # 0.2 s to import, which no start of a training should pay

    graph = onnx.load(file_of(path)).graph
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
        remedy = "give an .onnx that s2a train wrote, with the file of its weights beside it where it has one"
        raise InputError(f"{file}: not a policy ({why}); {remedy}") from error


def annotate(file: Path, world: Path) -> None:
    """Write into an ONNX file's metadata in which world it was trained, where a world.json says it."""
    _write_world(file, world.read_text() if world.is_file() else None)


def _write_world(file: Path, world: str | None) -> None:
    """Write the text of a world.json into an ONNX file's metadata.

    What torch's exporter notes of each node is removed: among it are the paths of the source that made it.
    """
    import onnx  # 0.2 s to import, which no start of a training should pay

    model = onnx.load(file)
    for node in model.graph.node:
        node.ClearField("metadata_props")
    if world is not None:
        others = {each.key: each.value for each in model.metadata_props}
        onnx.helper.set_model_props(model, others | {WORLD: json.dumps(json.loads(world))})
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
    with atomic_write(graph) as out:
        onnx = model.as_onnx(verbose=False).cpu().eval()
        write_graph(onnx, {"obs": torch.zeros(2, onnx.input_size)}, "actions", out)
        annotate(out, checkpoint.parent / run_folder.FILE)
    return [script, graph]


def write_graph(module: nn.Module, inputs: Mapping[str, torch.Tensor], output: str, out: Path) -> None:
    """Write a module on the CPU as ONNX for any number of worlds.

    Args:
        module: the module.
        inputs: examples of its inputs by name, of more than one world.
        output: name of what it returns.
        out: the file.

    Raises:
        InputError: torch cannot export it.
    """
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of torch's exporter about torch itself
        try:
            torch.onnx.export(
                module,
                tuple(inputs.values()),
                str(out),
                input_names=list(inputs),
                output_names=[output],
                opset_version=18,
                dynamic_shapes=tuple({0: torch.export.Dim("world")} for _ in inputs),
                external_data=False,
                verbose=False,
            )
        except Exception as error:  # of torch.export, of many classes
            why = (str(error) or type(error).__name__).strip().splitlines()[0]
            raise InputError(f"network: torch cannot export it as ONNX ({why}); give an ONNX file of it") from error
