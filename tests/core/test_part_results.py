"""What the episodes of a pool's parts come to: each part counts once, however many episodes it had."""

from __future__ import annotations

import numpy as np
import pytest

from s2a.learn.evaluate import by_part, interval
from s2a.tasks.pool import PoolPart

PARTS = [
    PoolPart("kitchen_0.usd", "drawer_1", "prismatic", "bar", "a.npz"),
    PoolPart("living_room_3.usd", "door_2", "revolute", "knob", "b.npz"),
]


def test_a_part_of_many_episodes_counts_no_more_than_one_of_few() -> None:
    hits = np.array([1.0, 1.0, 1.0, 0.0])
    found = by_part({"success": hits}, PARTS, np.array([0, 0, 0, 1]), seed=0)
    assert [(part["episodes"], part["success"]) for part in found["parts"]] == [(3, 1.0), (1, 0.0)]
    assert found["over_parts"]["all"]["success"]["rate"] == 0.5
    assert found["over_parts"]["kind"]["prismatic"]["success"]["rate"] == 1.0
    assert set(found["over_parts"]["room"]) == {"kitchen", "living_room"}


def test_the_interval_is_of_the_mean_of_parts_drawn_anew() -> None:
    # Half of 100 parts: the mean's deviation is 0.5 / sqrt(100), and 95 % lie within 1.96 of it.
    found = interval(np.repeat([0.0, 1.0], 50), seed=0)
    assert found["rate"] == 0.5
    assert found["high"] - found["rate"] == pytest.approx(1.96 * 0.05, abs=0.012)
    assert found["rate"] - found["low"] == pytest.approx(1.96 * 0.05, abs=0.012)
    assert interval(np.ones(5), seed=0) == {"rate": 1.0, "low": 1.0, "high": 1.0}
