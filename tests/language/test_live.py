"""The record of a room that goes on from skill to skill."""

from __future__ import annotations

from collections.abc import Callable

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


def creep(q: np.ndarray) -> None:
    q[:, 0] += 0.005 * np.arange(len(q))  # in each step as far beyond its velocity as a contact may throw it once


def leap(q: np.ndarray) -> None:
    q[20:, 0] += 0.02


def lift(q: np.ndarray) -> None:
    q[30:, 3] += 0.01


def turn(q: np.ndarray) -> None:
    q[30:, 4:8] = [0.0, 0.0, np.sin(0.25), np.cos(0.25)]  # by 0.5 rad


def spin(q: np.ndarray) -> None:
    angle = 0.1 * np.arange(len(q))
    q[:, 6], q[:, 7] = np.sin(angle / 2), np.cos(angle / 2)


@pytest.mark.parametrize(
    ("cheat", "moved"), [(leap, "drawer"), (creep, "drawer"), (lift, "cup"), (turn, "cup"), (spin, "cup")]
)
def test_a_teleport_is_found_and_a_fast_motion_is_none(cheat: Callable[[np.ndarray], None], moved: str) -> None:
    dt, speed = 1 / 60, 2.0
    q = np.array([[k * dt * speed, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0] for k in range(60)])
    qd = list(np.tile([speed, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], (60, 1)))
    names = {"drawer": (0, 0, np.inf)}, {"cup": (1, 1, 0.0)}
    assert LiveFrames(dt, list(q), qd).jumps(*names) == {}
    assert set(LiveFrames(dt, list(q), qd).jumps({"base": (0, 0, 1.0)}, {})) == {"base"}  # faster than its limit
    cheat(q)
    assert set(LiveFrames(dt, list(q), qd).jumps(*names)) == {moved}
