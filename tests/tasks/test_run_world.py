"""A policy is evaluated in the world it was trained in; what the paper's is."""

from __future__ import annotations

from pathlib import Path

import pytest
from part_worlds import task_settings
from settings import load

from s2a.commands.train import Config
from s2a.core import config
from s2a.core.errors import InputError
from s2a.learn.rl.run_folder import read_world, write_world
from s2a.sim.simulation import SimConfig
from s2a.tasks.pick_place import PickPlaceConfig


def test_a_checkpoint_brings_the_world_it_was_trained_in(tmp_path: Path) -> None:
    sim, task = load(SimConfig, "sim/planner", dt=0.002), task_settings(termination_opening=9.0)
    write_world(sim, task, tmp_path)
    assert read_world(tmp_path / "model_1.pt") == (sim, task)


def test_what_is_reported_is_up_to_the_evaluation(tmp_path: Path) -> None:
    write_world(load(SimConfig, "sim/planner"), task_settings(), tmp_path)
    text = (tmp_path / "world.json").read_text()
    names = config.compose("metrics/open_part")["metrics"].keys() - config.compose("task/open_part")["task"].keys()
    assert {"success_opening", "grasp_fraction"} <= names and not [name for name in names if name in text]


def test_a_checkpoint_from_elsewhere_brings_none(tmp_path: Path) -> None:
    assert read_world(tmp_path / "model_1.pt") is None


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        "{}",
        '{"sim": {"dt": 1}, "task": {}}',
        '{"sim": 1, "task": 2}',
        '{"sim": {}, "task": {"name": "fly"}}',
    ],
)
def test_a_damaged_world_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "world.json").write_text(text)
    with pytest.raises(InputError, match="world.json: not what this version") as refused:
        read_world(tmp_path / "model_1.pt")
    assert "\n" not in str(refused.value)


def test_the_papers_experiment_is_the_papers() -> None:
    values = config.compose("train", ["+experiment=paper", "stage=sim.usd", "out=run"])
    settings = config.load(Config, values)
    assert settings.num_envs * settings.ppo.num_steps_per_env * settings.ppo.iterations == 1_228_800_000
    assert settings.sim.dt * settings.sim.substeps == pytest.approx(1.0 / 60.0)
    assert settings.sim.gains and (settings.sim.gains.arm_stiffness, settings.sim.gains.arm_damping) == (80.0, 4.0)
    assert (settings.task.termination_opening, settings.task.bonus_openings) == (0.39, (0.01, 0.2, 0.35))
    assert (settings.ppo.learning_rate, settings.ppo.gamma, settings.ppo.hidden_dims) == (5e-4, 0.99, (256, 128, 64))
    assert settings.metrics.success_opening == 0.2 and settings.demo_reset_fraction == 0.0
    assert settings.reward == dict(distance=1.5, rotation=1.5, opening=10.0, finger=2.0, bonus=0.25, action=-0.05)
    row3 = config.compose("train", ["+experiment=paper", "reward=handle"])
    assert [row3["reward"][name] for name in ("distance", "rotation", "opening", "finger")] == [50.5, 50.5, 10.0, 50.0]


def test_a_world_of_another_task_gets_none_of_the_keys_that_opening_got(tmp_path: Path) -> None:
    sim, task = load(SimConfig, "sim/pick_place"), load(PickPlaceConfig, "task/pick_place", place="desk_1")
    write_world(sim, task, tmp_path)
    assert read_world(tmp_path / "model_1.pt") == (sim, task)
