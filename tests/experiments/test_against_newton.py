"""A pulled part opens in plain MuJoCo as in the simulation here, which experiments/other_simulators.py measures in scans."""

from __future__ import annotations

from pathlib import Path

import converted
import mujoco
import numpy as np
import pytest
from converted import PART, write_room
from other_simulators import GOALS, WRONG, damaged, differences, pulled
from pulled_parts import in_mujoco, in_newton

from s2a.commands import convert
from s2a.sim.world import read_stage


@pytest.mark.slow
def test_the_simulation_here_and_plain_mujoco_agree_and_damage_is_noticed(tmp_path: Path) -> None:
    settings = converted.settings(stiffness=10.0, damping=1.0)
    stage = write_room(tmp_path / "room.usd")
    convert.run(convert.Config(stage, tmp_path / "out", "mjcf", "all", settings))
    model, found = mujoco.MjModel.from_xml_path(str(tmp_path / "out" / "room.xml")), read_stage(stage, PART)
    pull = pulled(model, found, settings)
    reference = in_newton(pull)
    assert np.abs(reference).max() == pytest.approx(0.7 * 0.4, rel=0.02)
    assert np.linalg.norm(pull.at(0)) == 0.0 and np.linalg.norm(pull.at(500)) > 2.0
    assert max(differences(in_mujoco(model, pull), reference, found).values()) < 1e-3
    for damage in WRONG:
        wrong = in_mujoco(damaged(tmp_path / "out", PART, damage), pull)
        assert max(differences(wrong, reference, found).values()) > GOALS["mujoco"]
