"""The worlds: joints that stop at their limits and stay where they are put."""

from __future__ import annotations

from pathlib import Path

import pytest
import warp as wp
from cabinet import TRAVEL, write_cabinet
from settings import load

from s2a.core.errors import InputError
from s2a.scene.usd.stage import new_stage, save
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import read_stage


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A hand-made cabinet."""
    return write_cabinet(tmp_path_factory.mktemp("cabinet") / "sim.usda")


def test_a_drawer_pressed_against_its_limits_stays_within_half_a_millimetre(stage: Path) -> None:
    sim = Simulation(read_stage(stage), load(SimConfig, "sim/paper"), 1, with_robot=False)
    force, step = wp.to_torch(sim.control.joint_f), sim.capture(sim.step)
    for push, limit in ((30.0, TRAVEL), (-30.0, 0.0)):
        force[0] = push
        for _ in range(80):
            step()
        assert float(sim.joint_q[0, 0]) == pytest.approx(limit, abs=5e-4)


def test_a_drawer_that_meets_its_limit_at_a_decimetre_a_second_stops_within_three_millimetres(stage: Path) -> None:
    sim = Simulation(read_stage(stage), load(SimConfig, "sim/paper"), 1, with_robot=False)
    step, furthest = sim.capture(sim.step), 0.0
    sim.joint_q[0, 0], sim.joint_qd[0, 0] = TRAVEL - 0.002, 0.1
    for _ in range(30):
        step()
        furthest = max(furthest, float(sim.joint_q[0, 0]))
    assert TRAVEL - 0.001 < furthest <= TRAVEL + 3e-3


def test_an_undisturbed_drawer_stays_where_it_was_scanned(stage: Path) -> None:
    sim = Simulation(read_stage(stage), load(SimConfig, "sim/paper"), 1, with_robot=False)
    step = sim.capture(sim.step)
    for _ in range(120):
        step()
    assert abs(float(sim.joint_q[0, 0])) < 1e-4


def test_an_odd_number_of_substeps_is_refused(stage: Path) -> None:
    with pytest.raises(InputError, match="'sim.substeps' is 3; .* even"):
        Simulation(read_stage(stage), load(SimConfig, "sim/paper", substeps=3), 1)


def test_another_kind_of_stage_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_stage(tmp_path / "missing.usd")
    other = tmp_path / "other.usda"
    save(new_stage(), other)
    with pytest.raises(InputError, match="not a simulation-ready stage"):
        read_stage(other)
