"""The record of a room that goes on from skill to skill."""

from __future__ import annotations

import numpy as np

from s2a.language.do.live import LiveFrames


def test_a_teleport_is_found_and_a_fast_motion_is_none() -> None:
    dt, speed = 1 / 60, 2.0
    q = np.array([[k * dt * speed, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0] for k in range(10)])
    frames = LiveFrames(dt, list(q), list(np.tile([speed, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], (10, 1))))
    names = {"drawer": (0, 0)}, {"cup": (1, 1)}
    assert frames.jumps(*names) == {}
    q[5:, 0] += 0.02  # the drawer
    q[7:, 2] += 0.01  # the cup, which lay still
    assert set(LiveFrames(dt, list(q), frames.qd).jumps(*names)) == {"drawer", "cup"}
