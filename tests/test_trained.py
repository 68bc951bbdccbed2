"""A policy is evaluated in the world it was trained in."""

from __future__ import annotations

from pathlib import Path

import pytest
from settings import load

from s2a.errors import InputError
from s2a.sim.simulation import SimConfig
from s2a.task.open_drawer import OpenDrawerConfig
from s2a.verbs.trained import check_world, write_world


def test_the_world_of_the_training_is_accepted_and_another_is_named(tmp_path: Path) -> None:
    paper, planner = load(SimConfig, "sim/paper"), load(SimConfig, "sim/planner")
    task = load(OpenDrawerConfig, "task/open_drawer")
    write_world(paper, task, tmp_path)
    check_world(paper, task, tmp_path / "model_1.pt")
    with pytest.raises(InputError, match=r"trained with sim.robot.arm_stiffness=80.0, not 400.0 \(4 keys differ\)"):
        check_world(planner, task, tmp_path / "model_1.pt")
    with pytest.raises(InputError, match=r"task.end_opening=0.39, not 9.0 \(1 keys differ\)"):
        check_world(paper, load(OpenDrawerConfig, "task/open_drawer", end_opening=9.0), tmp_path / "model_1.pt")


def test_a_checkpoint_from_elsewhere_is_taken_as_it_is(tmp_path: Path) -> None:
    check_world(load(SimConfig, "sim/paper"), load(OpenDrawerConfig, "task/open_drawer"), tmp_path / "model_1.pt")
