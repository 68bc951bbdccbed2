"""The update that never waits for the device, against rsl-rl's."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from counting_env import OBSERVATIONS, CountingEnv
from rsl_rl.algorithms import PPO
from settings import load
from tensordict import TensorDict

from s2a.core.errors import InputError
from s2a.learn.rl.adapter import RslRlEnv
from s2a.learn.rl.config import PpoConfig
from s2a.learn.rl.cuda_graph_ppo import GraphPpo
from s2a.learn.rl.ppo import Runner, make_runner

SMALL = {
    "num_steps_per_env": 8,
    "num_learning_epochs": 3,
    "num_mini_batches": 4,
    "hidden_dims": [16, 8],
    "entropy_coef": 0.01,
}


class NoisyEnv(CountingEnv):
    """An environment whose observations and rewards are noise that depends on the actions."""

    def __init__(self) -> None:
        super().__init__()
        self.noise = torch.Generator().manual_seed(3)

    def step(self, action: torch.Tensor) -> None:
        """Draw an observation, and pay for it."""
        self.observation.copy_(torch.randn(2, OBSERVATIONS, generator=self.noise) + action.mean())
        self.reward.copy_(self.observation[:, 0] * action[:, 0])


def learned(
    graph: bool, iterations: int = 3, prepare: Callable[[PPO], None] = lambda alg: None, **changes: object
) -> Runner:
    """Return what has learned for some iterations from a fixed seed, after `prepare`."""
    torch.manual_seed(0)
    settings = load(PpoConfig, "ppo/default", **SMALL, **changes, cuda_graph=graph)
    runner = make_runner(RslRlEnv(NoisyEnv(), 1.0), settings, None)
    runner.alg.act = _reproducible(runner.alg)
    prepare(runner.alg)
    runner.learn(iterations)
    return runner


def _reproducible(alg: object) -> object:
    """Return the algorithm's `act` with noise of its own: rsl-rl's update draws some that it does not need."""
    act, generator = type(alg).act, torch.Generator().manual_seed(1)

    def seeded(observation: object) -> torch.Tensor:
        torch.manual_seed(int(torch.randint(2**31, (), generator=generator)))
        return act(alg, observation)

    return seeded


@pytest.mark.parametrize("changes", [{}, {"use_clipped_value_loss": False, "desired_kl": 1e-5}, {"desired_kl": 10.0}])
def test_the_update_is_the_librarys_own(changes: dict[str, object]) -> None:
    theirs, ours = (learned(graph, **changes).alg for graph in (False, True))
    assert type(ours).__name__ == "GraphPpo" and type(theirs).__name__ == "PPO"
    assert ours.learning_rate == pytest.approx(theirs.learning_rate, rel=1e-5)
    _assert_alike(ours, theirs)


@pytest.mark.slow  # inductor compiles C++ for half a minute
def test_the_compiled_update_is_the_librarys_own() -> None:
    theirs, ours = learned(False).alg, learned(True, prepare=_compile_the_loss).alg
    assert ours._loss is not ours._objective
    _assert_alike(ours, theirs)


def _compile_the_loss(alg: GraphPpo) -> None:
    """Compile the update alone: a compiled actor draws other noise while it collects."""
    alg._loss = torch.compile(alg._objective, dynamic=False)


def _assert_alike(ours: PPO, theirs: PPO) -> None:
    for model in ("actor_state_dict", "critic_state_dict"):
        expected = theirs.save()[model]
        for name, value in ours.save()[model].items():
            assert torch.allclose(value, expected[name], atol=2e-5), name


def test_its_learning_goes_on_from_a_checkpoint(tmp_path: Path) -> None:
    first = learned(True)
    torch.save(first.alg.save() | {"iter": 2, "infos": {}}, tmp_path / "model_2.pt")
    second = learned(True, iterations=1)
    second.load(str(tmp_path / "model_2.pt"))
    assert second.alg.learning_rate == pytest.approx(first.alg.learning_rate) != 5e-4
    assert float(second.alg._rate) == pytest.approx(first.alg.learning_rate)
    steps = [float(state["step"]) for state in second.alg.optimizer.state.values()]
    assert set(steps) == {3.0 * 3 * 4}
    second.learn(1)
    assert {float(state["step"]) for state in second.alg.optimizer.state.values()} == {4.0 * 3 * 4}


def test_a_policy_that_is_no_number_is_never_saved(tmp_path: Path) -> None:
    runner = learned(False, iterations=1)
    next(runner.alg.actor.parameters()).data[0] = torch.nan
    with pytest.raises(InputError, match="the policy has non-finite parameters"):
        runner.save(str(tmp_path / "model_0.pt"))
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("bad", [torch.inf, torch.nan])
def test_a_policy_that_is_no_number_any_more_ends_the_training(bad: float) -> None:
    class Broken(NoisyEnv):
        steps = 0

        def step(self, action: torch.Tensor) -> None:
            super().step(action)
            self.steps += 1
            if self.steps == 12:  # in the second iteration
                self.reward[0] = bad

    env = Broken()
    runner = make_runner(RslRlEnv(env, 1.0), load(PpoConfig, "ppo/default", **SMALL, cuda_graph=True), None)
    with pytest.raises(InputError, match="the policy has non-finite parameters; continue from the last checkpoint"):
        runner.learn(3)
    assert env.steps == 16  # two iterations of 8


class Teacher:
    """Who always does what the first observations say, up to 0.5."""

    def __call__(self, observation: torch.Tensor) -> torch.Tensor:
        """Return the actions to imitate."""
        return observation[:, :9].clamp(-0.5, 0.5)

    def state_dict(self) -> dict[str, torch.Tensor]:
        """Return nothing."""
        return {}

    def load_state_dict(self, state: dict[str, torch.Tensor]) -> None:
        """Take nothing."""


def imitating(iterations: int, folder: Path | None = None) -> Runner:
    """Return a runner that imitates for some iterations."""
    torch.manual_seed(0)
    settings = load(PpoConfig, "ppo/default", **SMALL, cuda_graph=True, imitation_iterations=iterations)
    adapter = RslRlEnv(NoisyEnv(), 1.0, teacher=Teacher())
    return make_runner(adapter, settings, str(folder) if folder else None)


def differences(runner: Runner) -> float:
    """Return the mean squared difference of the policy's mean action to the teacher's."""
    seen = torch.randn(256, OBSERVATIONS, generator=torch.Generator().manual_seed(5))
    policy = runner.get_inference_policy(device="cpu")
    with torch.no_grad():
        return float((policy(TensorDict({"policy": seen}, [256])) - Teacher()(seen)).square().mean())


@pytest.mark.slow
def test_the_first_iterations_imitate_at_the_first_learning_rate_and_those_after_them_do_not() -> None:
    runner = imitating(150)
    before = differences(runner)
    runner.learn(150)
    after = differences(runner)
    assert after < 0.3 * before
    assert runner.alg.learning_rate == pytest.approx(5e-4)
    rates = []
    for _ in range(4):
        runner.learn(1)
        rates.append(runner.alg.learning_rate)
    assert len(set(rates)) > 1, "the divergence adapts it again"


def test_imitation_alone_moves_the_actor_and_rewards_the_critic() -> None:
    class Unpaid(NoisyEnv):
        def step(self, action: torch.Tensor) -> None:
            super().step(action)
            self.reward.zero_()

    paid, unpaid = imitating(9), imitating(9)
    unpaid.env.env.__class__ = Unpaid
    torch.manual_seed(1)
    paid.learn(3)
    torch.manual_seed(1)
    unpaid.learn(3)
    states = [runner.alg.save() for runner in (paid, unpaid)]
    for name, value in states[0]["actor_state_dict"].items():
        assert torch.equal(value, states[1]["actor_state_dict"][name]), name
    assert any(
        not torch.equal(value, states[1]["critic_state_dict"][name])
        for name, value in states[0]["critic_state_dict"].items()
    )


@pytest.mark.slow
def test_a_critic_that_begins_reaches_returns_beyond_what_the_clip_lets_it_move() -> None:
    class Rich(NoisyEnv):
        def step(self, action: torch.Tensor) -> None:
            super().step(action)
            self.reward.fill_(10.0)  # returns of up to 1000

    values = []
    for iterations in (6, 0):  # the critic alone; PPO, whose clip stops it early in an update
        torch.manual_seed(0)
        changes = {**SMALL, "learning_rate": 1e-2, "desired_kl": 1e9, "num_learning_epochs": 20}
        changes["imitation_iterations"] = iterations
        runner = make_runner(RslRlEnv(Rich(), 1.0), load(PpoConfig, "ppo/default", **changes, cuda_graph=True), None)
        runner.learn(6)
        values.append(float(runner.alg.storage.values.mean()))
    assert values[0] > 4.0 * values[1]


def test_a_policy_that_waited_for_its_critic_begins_with_small_steps() -> None:
    torch.manual_seed(0)
    changes = {**SMALL, "num_learning_epochs": 1, "num_mini_batches": 1, "imitation_iterations": 30}
    runner = make_runner(RslRlEnv(NoisyEnv(), 1.0), load(PpoConfig, "ppo/default", **changes, cuda_graph=True), None)
    actor = [parameter.detach() for parameter in runner.alg.actor.parameters()]
    first = [parameter.clone() for parameter in actor]
    runner.learn(30)
    assert all(map(torch.equal, actor, first)), "the critic alone learns"
    runner.learn(1)
    steps = [float((now - then).abs().max()) for now, then in zip(actor, first, strict=True)]
    # Adam's first step is the rate, whatever the gradient's size: 1e-5, which the first divergence, of 0, does not raise.
    assert max(steps) == pytest.approx(1e-5, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("rate", [None, 1e-2])
def test_a_critic_with_a_rate_of_its_own_learns_while_the_divergence_holds_the_actor_back(rate: float | None) -> None:
    class Paying(NoisyEnv):
        def step(self, action: torch.Tensor) -> None:
            super().step(action)
            self.reward.fill_(0.1)

    torch.manual_seed(0)
    changes = {**SMALL, "num_learning_epochs": 20, "desired_kl": 1e-9, "critic_learning_rate": rate}
    changes["use_clipped_value_loss"] = False
    runner = make_runner(RslRlEnv(Paying(), 1.0), load(PpoConfig, "ppo/default", **changes, cuda_graph=True), None)
    runner.learn(10)
    assert runner.alg.learning_rate == pytest.approx(1e-5)
    assert (float(runner.alg.storage.values.mean()) > 1.0) == (rate is not None)


def test_a_critics_own_rate_goes_on_from_a_checkpoint(tmp_path: Path) -> None:
    first = learned(True, critic_learning_rate=3e-3)
    torch.save(first.alg.save() | {"iter": 2, "infos": {}}, tmp_path / "model_2.pt")
    second = learned(True, iterations=1, critic_learning_rate=3e-3)
    second.load(str(tmp_path / "model_2.pt"))
    second.learn(1)
    rates = [float(group["lr"]) for group in second.alg.optimizer.param_groups]
    assert rates == pytest.approx([second.alg.learning_rate, 3e-3])


@pytest.mark.parametrize(("done", "left"), [(0, 3), (2, 1), (3, 0), (9, 0)])
def test_a_run_that_goes_on_imitates_for_the_rest_of_its_iterations(done: int, left: int, tmp_path: Path) -> None:
    first = imitating(4)
    torch.save(first.alg.save() | {"iter": done, "infos": {}}, tmp_path / "model.pt")
    second = imitating(4)
    second.load(str(tmp_path / "model.pt"))
    assert second.alg._imitating == left
    networks = imitating(4)
    networks.load(str(tmp_path / "model.pt"), {"actor": True, "critic": True})
    assert networks.alg._imitating == 4, "another run's networks are no iterations of this one"


class GpuEnv(NoisyEnv):
    """The same on a GPU."""

    def __init__(self) -> None:
        super().__init__()
        for name, value in vars(self).items():
            if isinstance(value, torch.Tensor):
                setattr(self, name, value.cuda())
        self.sim.device, self.noise = "cuda:0", torch.Generator("cuda").manual_seed(3)

    def step(self, action: torch.Tensor) -> None:
        """Draw an observation, and pay for it."""
        noise = torch.randn(2, OBSERVATIONS, generator=self.noise, device="cuda")
        self.observation.copy_(noise + action.mean())
        self.reward.copy_(self.observation[:, 0] * action[:, 0])


@pytest.mark.gpu
def test_replayed_graphs_learn_as_the_library_does_on_a_gpu() -> None:
    learned = []
    for graph in (False, True):
        torch.manual_seed(0)
        runner = make_runner(RslRlEnv(GpuEnv(), 1.0), load(PpoConfig, "ppo/default", **SMALL, cuda_graph=graph), None)
        runner.alg.act = _reproducible(runner.alg)
        runner.learn(4)
        learned.append((runner.alg.learning_rate, runner.alg.save()["actor_state_dict"]))
    (rate, expected), (own_rate, found) = learned
    assert own_rate == pytest.approx(rate, rel=1e-3)
    assert all(torch.allclose(found[name], value, atol=1e-3) for name, value in expected.items())


@pytest.mark.gpu
@pytest.mark.parametrize("graph", [True, pytest.param(False, marks=pytest.mark.xfail(strict=True))])
def test_collecting_never_waits_for_a_gpu(graph: bool, tmp_path: Path) -> None:
    settings = load(PpoConfig, "ppo/default", **SMALL, cuda_graph=graph)
    runner = make_runner(RslRlEnv(GpuEnv(), 1.0, log_every=SMALL["num_steps_per_env"]), settings, tmp_path)
    act, process = runner.alg.act, runner.logger.process_env_step

    def watched(observation: object) -> object:
        torch.cuda.set_sync_debug_mode("error")
        return act(observation)

    def released(*step: object) -> None:
        process(*step)
        torch.cuda.set_sync_debug_mode("default")

    runner.alg.act, runner.logger.process_env_step = watched, released
    try:
        runner.learn(2)
    finally:
        torch.cuda.set_sync_debug_mode("default")
