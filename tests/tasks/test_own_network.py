"""A network of one's own: recipes of other libraries, the file that wraps it, and the page that lists its columns."""

from __future__ import annotations

import importlib
import importlib.util
import json
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import observation_tables
import onnx
import pytest
import torch
from cabinet import write_cabinet
from counting_env import CountingEnv

from s2a import api
from s2a.commands import evaluate
from s2a.core import config
from s2a.core.errors import InputError
from s2a.learn.rl.policy_file import PRETRAINED, PolicyFile, wrap
from s2a.tasks.env import TaskVectorEnv

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "docs/examples"


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A hand-made cabinet."""
    return write_cabinet(tmp_path_factory.mktemp("room") / "sim.usda")


@pytest.fixture(scope="module")
def env(room: Path) -> TaskVectorEnv:
    """Three worlds with settings that are nowhere the default."""
    return api.make("open_part", room, num_envs=3, device="cpu", overrides=["sim.dt=0.002", "task.episode_steps=6"])


class Linear(torch.nn.Module):
    """A network with weights that tell one input from another."""

    def __init__(self, observations: int, actions: int) -> None:
        super().__init__()
        self.layer = torch.nn.Linear(observations, actions)

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        return self.layer(observation)


def sizes(env: TaskVectorEnv) -> tuple[int, int]:
    return env.single_observation_space.shape[0], env.single_action_space.shape[0]


@pytest.mark.slow
def test_a_wrapped_module_acts_alike_in_any_number_of_worlds_and_knows_its_world(
    env: TaskVectorEnv, tmp_path: Path
) -> None:
    network = Linear(*sizes(env))
    file = PolicyFile(api.export_policy(network, tmp_path / "own.onnx", env))
    observation = torch.randn(3, sizes(env)[0])
    expected = network(observation).detach()
    assert torch.allclose(file.bound(env.worlds)(observation), expected, atol=1e-6)
    assert file.world == (env.worlds.sim.config, env.worlds.task.config) and file.world[0].dt == 0.002


def test_an_onnx_file_from_elsewhere_keeps_its_own_metadata(env: TaskVectorEnv, tmp_path: Path) -> None:
    plain = api.export_policy(Linear(*sizes(env)), tmp_path / "plain.onnx", env)
    model = onnx.load(plain)
    onnx.helper.set_model_props(model, {"author": "elsewhere"})
    onnx.save(model, plain)
    assert PolicyFile(plain).world is None
    wrapped = api.export_policy(plain, tmp_path / "own.onnx", env)
    assert PolicyFile(wrapped).world is not None
    assert {"author": "elsewhere"}.items() <= {p.key: p.value for p in onnx.load(wrapped).metadata_props}.items()


def test_an_onnx_file_with_its_weights_beside_it_becomes_one_file(env: TaskVectorEnv, tmp_path: Path) -> None:
    plain = api.export_policy(Linear(*sizes(env)), tmp_path / "plain.onnx", env)
    observation = torch.randn(3, sizes(env)[0])
    expected = PolicyFile(plain).bound(env.worlds)(observation)
    beside = {"save_as_external_data": True, "location": "plain.onnx.data", "size_threshold": 0}
    onnx.save(onnx.load(plain), plain, **beside)  # as torch's exporter does by default
    wrapped = api.export_policy(plain, tmp_path / "alone" / "own.onnx", env)
    assert list(wrapped.parent.iterdir()) == [wrapped]
    assert torch.equal(PolicyFile(wrapped).bound(env.worlds)(observation), expected)
    (tmp_path / "plain.onnx.data").unlink()
    with pytest.raises(InputError, match=r"plain\.onnx\.data.*weights beside it") as error:
        api.export_policy(plain, tmp_path / "again.onnx", env)
    assert "\n" not in str(error.value) and not (tmp_path / "again.onnx").exists()


def test_the_policy_in_the_box_is_wrapped_by_its_name(tmp_path: Path) -> None:
    env = CountingEnv(2)
    env.observation = torch.zeros(2, 67)
    sim, task = PolicyFile(Path(PRETRAINED)).world or ()
    env.sim, env.task = SimpleNamespace(config=sim), SimpleNamespace(config=task)
    file = PolicyFile(wrap(Path(PRETRAINED), tmp_path / "own.onnx", env))
    assert file.world == (sim, task) and file.bound(env)(env.observation).shape == (2, 9)


class Broken(Linear):
    """A network that returns what is not an action for each world."""

    def __init__(self, observations: int, actions: int, broken: str) -> None:
        super().__init__(observations, actions)
        self.broken = broken

    def forward(self, observation: torch.Tensor) -> Any:
        action = self.layer(observation)
        return {"one": action[0], "dict": {"action": action}, "nan": action * torch.nan}[self.broken]


@pytest.mark.parametrize(
    ("network", "message"),
    [
        (Linear(7, 9), r"\[world 23\] observations and take \[world 9\] actions; it fails on \[3 23\] \(mat1 and mat2"),
        (Linear(23, 8), r"it gives \[3 8\] for \[3 23\]"),
        (Broken(23, 9, "one"), r"it gives \[9\] for"),
        (Broken(23, 9, "dict"), "it gives dict for"),
        (Broken(23, 9, "nan"), "not finite"),
    ],
)
def test_a_network_that_does_not_fit_is_one_line_and_no_file(
    network: torch.nn.Module, message: str, env: TaskVectorEnv, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=message) as error:
        api.export_policy(network, tmp_path / "own.onnx", env)
    assert "\n" not in str(error.value) and not list(tmp_path.iterdir())


def graph(file: Path, observations: int, actions: int, batch: int | str, inputs: int = 1, weight: float = 1.0) -> Path:
    """Write the ONNX file of a matrix of equal weights, of a number of inputs of which the first counts."""
    kind = onnx.TensorProto.FLOAT
    given = [onnx.helper.make_tensor_value_info(f"obs{i}", kind, [batch, observations]) for i in range(inputs)]
    out = onnx.helper.make_tensor_value_info("out", kind, [batch, actions])
    weights = onnx.numpy_helper.from_array(np.full((observations, actions), weight, np.float32), "w")
    node = onnx.helper.make_node("MatMul", ["obs0", "w"], ["out"])
    body = onnx.helper.make_graph([node], "g", given, [out], [weights])
    opset = onnx.helper.make_opsetid("", 17)
    onnx.save(onnx.helper.make_model(body, opset_imports=[opset], ir_version=9), file)
    return file


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ({"observations": 24, "actions": 9, "batch": "n"}, r"it takes \[n 24\]"),
        ({"observations": 23, "actions": 7, "batch": "n"}, r"it gives \[3 7\]"),
        ({"observations": 23, "actions": 9, "batch": 1}, "it takes 1 at a time: export it with a dynamic first axis"),
        ({"observations": 23, "actions": 9, "batch": "n", "inputs": 2}, "it has the inputs obs0, obs1"),
        ({"observations": 23, "actions": 9, "batch": "n", "weight": 3.4e38}, "its actions are not finite"),
    ],
)
def test_an_onnx_file_that_does_not_fit_is_one_line(
    shape: dict[str, Any], message: str, env: TaskVectorEnv, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=message):
        PolicyFile(graph(tmp_path / "plain.onnx", **shape)).bound(env.worlds)


def test_a_plain_export_is_measured_in_the_world_of_the_keys_with_a_warning(
    room: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    policy = graph(tmp_path / "plain.onnx", 23, 9, "n")
    keys = [f"stage={room}", f"out={tmp_path / 'e.json'}", f"policy={policy}", "num_envs=2", "device=cpu"]
    keys += ["task.episode_steps=6", "sim.dt=0.002"]
    evaluate.run(config.load(evaluate.Config, config.compose("evaluate", keys)))
    values = json.loads((tmp_path / "e.json").read_text())
    assert (
        values["policy"] == "plain.onnx" and values["episode_steps"] == 6 and values["settings"]["sim"]["dt"] == 0.002
    )
    assert "does not state the settings of its training" in caplog.text


@pytest.mark.slow
@pytest.mark.parametrize(
    ("example", "library", "steps"),
    [("sb3_ppo", "stable_baselines3", 128), ("skrl_ppo", "skrl", 64), ("rsl_rl_ppo", "rsl_rl", 2)],
)
def test_a_recipe_trains_and_its_policy_is_evaluated(
    example: str, library: str, steps: int, room: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip(library)
    monkeypatch.chdir(tmp_path)  # skrl logs into the current folder
    torch.manual_seed(0)
    _module(EXAMPLES / f"{example}.py").main(str(room), None, "own.onnx", steps, num_envs=4)
    keys = [f"stage={room}", "out=e.json", "policy=own.onnx", "num_envs=2", "device=cpu"]
    evaluate.run(config.load(evaluate.Config, config.compose("evaluate", keys)))
    assert json.loads((tmp_path / "e.json").read_text())["episodes"] == 2


def _module(file: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(file.stem, file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_lists_the_tasks_as_they_are() -> None:
    page = (ROOT / "docs/own_network.md").read_text()
    assert observation_tables.tables() in page, "run python tools/observation_tables.py"


@pytest.mark.parametrize("name", list(observation_tables.kinds()))
def test_every_column_has_a_meaning_and_a_unit(name: str, env: TaskVectorEnv) -> None:
    kind, settings = observation_tables.kinds()[name]
    for critic in (False, True):
        for field in observation_tables.observations(kind, settings, 9, critic):
            assert field.meaning and field.unit, field.name
            is_vector = len(field.columns) == 3
            unframed = ("joint_kind", "resistance")
            assert bool(field.frame) == (is_vector and field.name not in unframed), field.name


def test_the_listed_columns_are_those_of_an_environment(env: TaskVectorEnv) -> None:
    task = env.worlds.task
    fields = observation_tables.observations(type(task), task.config, env.worlds.num_actions)
    assert {f.name: slice(f.columns.start, f.columns.stop) for f in fields} == task.columns
    moved = observation_tables.actions(env.worlds.sim.robot, task.config, env.worlds.sim.config)
    speeds = [float(field.unit.split()[0]) for field in moved]
    assert speeds == pytest.approx((env.worlds.action_step / env.worlds.sim.config.control_dt).tolist(), rel=1e-3)
