"""Peaks of a policy against the limits of its robot."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from cabinet import write_cabinet
from settings import load

from s2a.sim.recorder import LimitUse
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import read_stage


@pytest.fixture
def sim(tmp_path: Path) -> Simulation:
    return Simulation(read_stage(write_cabinet(tmp_path / "sim.usda")), load(SimConfig, "sim/planner"), 2)


def test_a_step_of_a_target_is_measured_in_fractions_of_the_limits(sim: Simulation) -> None:
    use = LimitUse(sim)
    sim.joint_target_q[1, 3] += 0.01  # in 1/60 s: 0.6 rad/s of 2.175, 36 rad/s^2 of 12.5
    sim.step()
    use.watch(torch.zeros(2, dtype=torch.bool))
    assert use.peaks["commanded_velocity"].tolist() == pytest.approx([0, 0, 0, 0.6 / 2.175, 0, 0, 0], abs=1e-4)
    assert use.fractions()["commanded_acceleration"] == pytest.approx(36 / 12.5, rel=1e-3)
    # 400 N m/rad x 0.01 rad of 87 N m, less what the motion already took off it
    assert 0.2 * 4 / 87 < float(use.peaks["torque"][3]) < 1.1 * 4 / 87
    assert 0.0 < use.fractions()["velocity"] < 0.6 / 2.175


def test_a_reset_is_no_motion(sim: Simulation) -> None:
    use = LimitUse(sim)
    sim.joint_target_q[0, 0] += 1.0
    sim.joint_qd[0, 0] = 0.0
    use.watch(torch.tensor([True, False]))
    use.watch(torch.tensor([False, False]))
    assert use.fractions()["commanded_velocity"] == use.fractions()["commanded_acceleration"] == 0.0
