"""The record of a room that goes on from skill to skill."""

from __future__ import annotations

import numpy as np
import pytest

from s2a.core import config
from s2a.core.errors import InputError
from s2a.language.commands import do
from s2a.language.do.live import LiveFrames


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (("robot=panda_mobile", "images=shown"), "'images' needs a robot with a fixed base"),
        (("robot=panda_mobile", "policy=pretrained"), "'policy' needs a robot with a fixed base"),
        (("states=s.npz",), "'states' records a robot that drives"),
    ],
)
def test_what_a_robot_cannot_do_is_not_left_out_silently(keys: tuple[str, ...], message: str) -> None:
    values = config.compose("do", ["sentence=open drawer_2", "stage=room.usd", "out=do.json", *keys])
    with pytest.raises(InputError, match=message):
        do.run(config.load(do.Config, values))


def test_a_teleport_is_found_and_a_fast_motion_is_none() -> None:
    dt, speed = 1 / 60, 2.0
    q = np.array([[k * dt * speed, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0] for k in range(10)])
    frames = LiveFrames(dt, list(q), list(np.tile([speed, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], (10, 1))))
    names = {"drawer": (0, 0)}, {"cup": (1, 1)}
    assert frames.jumps(*names) == {}
    q[5:, 0] += 0.02  # the drawer
    q[7:, 2] += 0.01  # the cup, which lay still
    assert set(LiveFrames(dt, list(q), frames.qd).jumps(*names)) == {"drawer", "cup"}
