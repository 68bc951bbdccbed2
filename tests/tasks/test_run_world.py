"""A policy is evaluated in the world it was trained in; what the paper's is."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path

import pytest
import yaml
from s2a.commands.trained import read_world, write_world
from settings import load

from s2a import config
from s2a.commands.train import Config
from s2a.errors import InputError
from s2a.sim.simulation import SimConfig
from s2a.tasks.open_part.config import LEVELS, OpenDrawerConfig


def test_a_checkpoint_brings_the_world_it_was_trained_in(tmp_path: Path) -> None:
    sim = load(SimConfig, "sim/planner", dt=0.002)
    task = load(OpenDrawerConfig, "task/open_drawer", end_opening=9.0)
    write_world(sim, task, tmp_path)
    assert read_world(tmp_path / "model_1.pt", task) == (sim, task)


def test_what_is_counted_beside_the_success_is_up_to_the_evaluation(tmp_path: Path) -> None:
    task = load(OpenDrawerConfig, "task/open_drawer")
    write_world(load(SimConfig, "sim/planner"), task, tmp_path)
    now = replace(task, wide_opening=0.35, end_opening=9.0)
    world = read_world(tmp_path / "model_1.pt", now)
    assert world is not None and world[1] == replace(task, wide_opening=0.35)


def test_a_world_written_before_something_was_counted_can_be_read(tmp_path: Path) -> None:
    sim, task = load(SimConfig, "sim/planner"), load(OpenDrawerConfig, "task/open_drawer")
    older = {key: value for key, value in asdict(task).items() if key not in LEVELS}
    (tmp_path / "world.json").write_text(json.dumps({"sim": asdict(sim), "task": older}))
    assert read_world(tmp_path / "model_1.pt", task) == (sim, task)


def test_a_checkpoint_from_elsewhere_brings_none(tmp_path: Path) -> None:
    assert read_world(tmp_path / "model_1.pt", load(OpenDrawerConfig, "task/open_drawer")) is None


@pytest.mark.parametrize("text", ["{", "[]", "{}", '{"sim": {"dt": 1}, "task": {}}', '{"sim": 1, "task": 2}'])
def test_a_damaged_world_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "world.json").write_text(text)
    with pytest.raises(InputError, match="world.json: not what this version"):
        read_world(tmp_path / "model_1.pt", load(OpenDrawerConfig, "task/open_drawer"))


def test_the_papers_table_states_every_value_of_its_training() -> None:
    table = yaml.safe_load((config.folder() / "experiment/paper.yaml").read_text())
    values = config.compose("train", ["+experiment=paper", "stage=sim.usd", "out=run"])
    for group in ("sim", "task", "policy"):
        assert config.keys(table[group]) == config.keys(values[group])
        assert dict(config.leaves(table[group])) == dict(config.leaves(values[group]))
    settings = config.load(Config, values)
    assert settings.worlds * settings.policy.steps * settings.policy.iterations == 1_228_800_000
    assert settings.sim.dt * settings.sim.substeps == pytest.approx(1.0 / 60.0)
    row3 = config.compose("train", ["+experiment=paper", "reward=handle"])
    assert [row3["reward"][name] for name in ("distance", "rotation", "opening", "finger")] == [50.5, 50.5, 10.0, 50.0]
