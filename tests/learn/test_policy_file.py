"""A policy as one file that knows its world, and the one that comes with s2a."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from counting_env import CountingEnv
from settings import load

from s2a.core.errors import InputError
from s2a.learn.rl.config import PpoConfig
from s2a.learn.rl.policy_file import PRETRAINED, PolicyFile, annotate, export, weights
from s2a.learn.rl.ppo import load_model, load_policy, train, widened
from s2a.learn.rl.run_folder import FILE, write_world
from s2a.sim.simulation import SimConfig
from s2a.tasks.base import MdpConfig
from s2a.tasks.open_part import OpenPartConfig

SMALL = {"num_steps_per_env": 8, "iterations": 1, "num_learning_epochs": 1, "num_mini_batches": 2, "hidden_dims": [8]}


def settings() -> tuple[SimConfig, MdpConfig]:
    """Return a world that no default describes."""
    return load(SimConfig, "sim/paper", dt=0.002), load(OpenPartConfig, "task/open_part", episode_steps=77)


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a short training."""
    folder = tmp_path_factory.mktemp("trained")
    train(CountingEnv(), load(PpoConfig, "ppo/default", **SMALL), folder)
    write_world(*settings(), folder)
    export(load_model(CountingEnv(), folder / "model_0.pt"), folder / "model_0.pt")
    return folder


@pytest.fixture
def exported(trained: Path, tmp_path: Path) -> Path:
    """Return the ONNX file of that training, a copy of one's own."""
    return shutil.copytree(trained, tmp_path, dirs_exist_ok=True) / "model_0.onnx"


def test_it_acts_as_its_checkpoint_in_the_world_it_was_trained_in(exported: Path) -> None:
    file = PolicyFile(exported)
    assert file.world == settings() and file.name == "model_0.onnx"
    observation = torch.randn(5, 23, generator=torch.Generator().manual_seed(0)) + 10.0
    expected = load_policy(CountingEnv(), exported.with_suffix(".pt"))(observation).detach()
    assert torch.allclose(file.bound(CountingEnv())(observation), expected, atol=1e-5)
    assert float(expected.abs().max()) > 1e-2


def test_a_run_begins_with_its_policy_and_lets_the_critic_alone_learn(exported: Path, tmp_path: Path) -> None:
    config = load(PpoConfig, "ppo/default", **SMALL | {"iterations": 2}, cuda_graph=True, imitation_iterations=2)
    train(CountingEnv(), config, tmp_path / "next", init=exported)
    observation = torch.randn(5, 23, generator=torch.Generator().manual_seed(1))
    before = PolicyFile(exported).bound(CountingEnv())(observation)
    after = load_policy(CountingEnv(), tmp_path / "next/model_1.pt")(observation).detach()
    assert torch.allclose(after, before, atol=1e-5)
    first, last = (torch.load(tmp_path / f"next/model_{i}.pt", weights_only=True)["critic_state_dict"] for i in (0, 1))
    assert not torch.equal(first["mlp.0.weight"], last["mlp.0.weight"])


def test_a_policy_that_a_run_begins_with_goes_on_to_see_as_before(exported: Path, tmp_path: Path) -> None:
    config, out = load(PpoConfig, "ppo/default", **SMALL | {"iterations": 2}), tmp_path / "next"
    before = {name: value for name, value in weights(exported).items() if name.startswith("obs_normalizer")}
    train(CountingEnv(), config, out, init=exported)
    train(CountingEnv(), replace(config, iterations=3), out, checkpoint=out / "model_1.pt", init=exported)
    for name in ("model_1.pt", "model_2.pt"):
        actor = torch.load(out / name, weights_only=True)["actor_state_dict"]
        assert all(torch.equal(actor[key].to(value.dtype), value) for key, value in before.items()), name
    train(CountingEnv(), load(PpoConfig, "ppo/default", **SMALL), tmp_path / "last", init=out / "model_2.pt")
    last = torch.load(tmp_path / "last/model_0.pt", weights_only=True)["actor_state_dict"]
    assert torch.equal(last["obs_normalizer._mean"], before["obs_normalizer._mean"])


@pytest.mark.parametrize("suffix", [".pt", ".onnx"])
def test_a_run_explores_as_much_as_it_asks_whoever_it_begins_with(suffix: str, exported: Path, tmp_path: Path) -> None:
    config = load(PpoConfig, "ppo/default", **SMALL, init_std=0.37, learning_rate=1e-9, desired_kl=1e-9)
    train(CountingEnv(), config, tmp_path / "next", init=exported.with_suffix(suffix))
    actor = torch.load(tmp_path / "next/model_0.pt", weights_only=True)["actor_state_dict"]
    assert actor["distribution.std_param"].numpy() == pytest.approx(0.37, abs=1e-2)


@pytest.mark.parametrize("suffix", [".pt", ".onnx"])
def test_a_run_that_is_told_more_begins_as_the_policy_that_was_told_less(
    suffix: str, exported: Path, tmp_path: Path
) -> None:
    def told_more() -> CountingEnv:
        env = CountingEnv()
        env.observation = torch.zeros(2, 25)
        return env

    config = load(PpoConfig, "ppo/default", **SMALL, learning_rate=1e-12, desired_kl=1e-9)
    train(told_more(), config, tmp_path / "next", init=exported.with_suffix(suffix))
    observation = torch.randn(5, 25, generator=torch.Generator().manual_seed(2)) + 10.0
    before = PolicyFile(exported).bound(CountingEnv())(observation[:, :23])
    after = load_policy(told_more(), tmp_path / "next/model_0.pt")(observation).detach()
    assert torch.allclose(after, before, atol=1e-2) and float(before.abs().max()) > 0.1
    with pytest.raises(InputError, match="observes 25 numbers, and this run gives 23; give the keys of its task"):
        train(CountingEnv(), config, tmp_path / "less", init=tmp_path / "next/model_0.pt")


def test_a_critics_new_inputs_lie_before_what_it_alone_is_told() -> None:
    saved = {"mlp.0.weight": torch.tensor([[1.0, 2.0, 3.0]]), "mlp.0.bias": torch.tensor([4.0])}
    saved |= {f"obs_normalizer.{name}": torch.tensor([[5.0, 6.0, 7.0]]) for name in ("_mean", "_var", "_std")}
    own = {name: torch.full((1, 6), 9.0) for name in saved if name != "mlp.0.bias"} | {"mlp.0.bias": torch.zeros(1)}
    wide = widened(saved, own, 2, 4)  # two more are observed, and a critic is told one more besides
    assert wide["mlp.0.weight"].tolist() == [[1.0, 2.0, 0.0, 0.0, 3.0, 0.0]] and wide["mlp.0.bias"].tolist() == [4.0]
    assert wide["obs_normalizer._mean"].tolist() == [[5.0, 6.0, 0.0, 0.0, 7.0, 0.0]]
    assert wide["obs_normalizer._std"].tolist() == [[5.0, 6.0, 1.0, 1.0, 7.0, 1.0]]


def test_a_policy_of_other_widths_is_refused(exported: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no networks that fit"):
        train(
            CountingEnv(),
            load(PpoConfig, "ppo/default", **SMALL | {"hidden_dims": [4]}),
            tmp_path / "next",
            init=exported,
        )


def test_another_robots_or_tasks_observations_are_refused(exported: Path) -> None:
    env = CountingEnv()
    env.observation = torch.zeros(2, 24)
    with pytest.raises(InputError, match=r"model_0.onnx: .* give \[world 24\] observations .*; it takes \[world 23\]"):
        PolicyFile(exported).bound(env)


@pytest.mark.parametrize("content", [b"", b"no network", b"\x08\x07" + bytes(range(256))])
def test_what_is_no_network_is_one_line(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "p.onnx"
    file.write_bytes(content)
    with pytest.raises(InputError, match=r"p\.onnx: not a policy \(.*\); give an \.onnx that s2a train wrote") as error:
        PolicyFile(file)
    assert "\n" not in str(error.value)


def test_a_missing_file_says_what_there_is() -> None:
    with pytest.raises(
        InputError, match="'nowhere.onnx': no such file; give an .onnx that s2a train wrote, or pretrained"
    ):
        PolicyFile(Path("nowhere.onnx"))


def test_a_network_that_does_not_know_its_world_acts_in_the_given_one_with_a_warning(
    exported: Path, caplog: pytest.LogCaptureFixture
) -> None:
    model = onnx.load(exported)
    del model.metadata_props[:]
    onnx.save(model, exported)
    file = PolicyFile(exported)
    assert file.world is None and file.worlds(*settings()) == settings()
    assert "does not state the settings of its training" in caplog.text


def test_a_run_of_another_program_is_exported_without_a_world(exported: Path) -> None:
    folder = exported.parent
    (folder / FILE).unlink()
    again = export(load_model(CountingEnv(), folder / "model_0.pt"), folder / "model_0.pt")[1]
    assert not onnx.load(again).metadata_props


def test_the_policy_in_the_box_is_small_and_was_trained_as_it_is_said(tmp_path: Path) -> None:
    file = PolicyFile(Path(PRETRAINED))
    assert file.world is not None
    sim, task = file.world
    assert isinstance(task, OpenPartConfig) and task.describe_part and sim.limits is not None and sim.vary is not None
    path = Path(__file__).parents[2] / "s2a/learn/policies/open_part.onnx"
    assert path.stat().st_size < 2e6
    env = CountingEnv(4)
    env.observation = torch.zeros(4, 67)
    actions = file.bound(env)(torch.randn(4, 67, generator=torch.Generator().manual_seed(0)))
    assert actions.shape == (4, 9) and np.isfinite(actions.numpy()).all()


def test_the_policy_in_the_package_tells_of_no_file_of_the_machine_that_made_it() -> None:
    for path in (Path(__file__).parents[2] / "s2a/learn/policies").glob("*.onnx"):
        assert b"site-packages" not in path.read_bytes() and b".py" not in path.read_bytes()


def test_the_published_checkpoint_is_of_the_policy_in_the_box_and_has_a_critic() -> None:
    path = Path(__file__).parents[2] / "experiments/checkpoints/many_parts.pt"
    saved = torch.load(path, weights_only=True)
    assert path.stat().st_size < 2_000_000
    for name, value in weights(Path(PRETRAINED)).items():
        assert torch.allclose(saved["actor_state_dict"][name].to(value.dtype), value, atol=1e-6) or name.endswith(
            "count"
        )
    assert set(saved["critic_state_dict"]) >= {"mlp.0.weight", "obs_normalizer._mean"}


def test_what_the_exporter_notes_of_its_source_is_forgotten(tmp_path: Path) -> None:
    graph = onnx.helper.make_graph(
        [onnx.helper.make_node("Neg", ["obs"], ["actions"])],
        "policy",
        [onnx.helper.make_tensor_value_info("obs", onnx.TensorProto.FLOAT, ["world", 3])],
        [onnx.helper.make_tensor_value_info("actions", onnx.TensorProto.FLOAT, ["world", 3])],
    )
    graph.node[0].metadata_props.add(key="pkg.torch.onnx.stack_trace", value='File "/home/me/mlp.py", line 240')
    onnx.save(onnx.helper.make_model(graph), tmp_path / "policy.onnx")
    assert b"/home/me" in (tmp_path / "policy.onnx").read_bytes()
    annotate(tmp_path / "policy.onnx", tmp_path / "world.json")
    assert b"/home/me" not in (tmp_path / "policy.onnx").read_bytes()
    onnx.checker.check_model(onnx.load(tmp_path / "policy.onnx"))
