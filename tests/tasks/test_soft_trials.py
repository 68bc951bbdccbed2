"""Where a soft body starts and ends in a trial, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from drawer_room import drawer_room
from settings import load
from soft_cube import cube_asset

from s2a import robot
from s2a.core.errors import InputError
from s2a.learn.evaluate import _soft_summary
from s2a.scene.usd.sim_scene import SimRoom
from s2a.sim.soft_body import SoftBody, SoftConfig, SoftShape, soft_body
from s2a.tasks import soft
from s2a.tasks.pick_place import PickPlaceConfig
from s2a.tasks.soft import COLUMNS, SoftMetrics

SOFT = SoftConfig()
START = "0.2 0.0 0.9"
TOP = 0.802
"""[m] Of the cabinet."""


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> tuple[SimRoom, SoftBody]:
    """Return a room with a cabinet, and a cube of 5 cm."""
    folder = tmp_path_factory.mktemp("soft")
    return drawer_room(folder / "sim.usda"), soft_body(SoftShape(0.05, 3, 0.5), cube_asset(folder))


def task(**changes: object) -> PickPlaceConfig:
    return load(PickPlaceConfig, "task/pick_place", **{"start": START, "place": "0.2 -0.2 0.9", **changes})


def test_a_drawn_pose_stands_on_the_support_within_its_shift(scene: tuple[SimRoom, SoftBody]) -> None:
    room, body = scene
    (start, _), *_ = soft._candidates(room, body, SOFT, task())
    shaken = task(start_shift=0.03, start_turn=0.5)
    poses = [soft._drawn(room, body, start, shaken, np.random.default_rng(k)) for k in range(5)]
    away = np.abs(np.array(poses)[:, :2] - start[:2])
    assert 0.01 < away.max() <= 0.03
    for pose in poses:
        assert pose[2] + body.vertices[:, 2].min() == pytest.approx(TOP + 0.003, abs=1e-3)


@pytest.mark.parametrize("changes", [{"start": None}, {"place": None}, {"place": START}, {"start": "insert.json"}])
def test_a_start_or_a_place_that_is_missing_is_said(scene: tuple[SimRoom, SoftBody], changes: dict) -> None:
    with pytest.raises(InputError, match="is not part of the room"):
        next(soft.trials(*scene, SOFT, task(**changes), robot.load("panda"), 0.1, 1, 0))


def test_a_support_that_is_not_there_is_said(scene: tuple[SimRoom, SoftBody]) -> None:
    with pytest.raises(InputError, match="'sofa_3' is neither a pose nor a part"):
        next(soft.trials(*scene, SOFT, task(place="sofa_3"), robot.load("panda"), 0.1, 1, 0))


def test_a_trial_without_a_plan_counts_as_failed() -> None:
    """Of two trials one succeeds."""
    done = dict.fromkeys(COLUMNS, True) | {"trial": 1, "limit_use": {"torque": 0.5}}
    values = dict.fromkeys(("position_error", "carried_fraction", "drift", "arm_depth", "grip_force"), 0.1)
    found = _soft_summary([{"trial": 0, "success": False, "cause": "no plan"}, done | values], SoftMetrics())
    assert found["episodes"] == 2
    assert all(found[name]["rate"] == 0.5 for name in COLUMNS)
    assert found["limit_use"] == {"torque": 0.5}
