"""Which neighbours may not collide: fronts of 0.4 x 0.2 m, one above the other, that slide out together or apart."""

from __future__ import annotations

import numpy as np
import pytest

from s2a.prepare.part_hulls import filtered_pairs
from s2a.scene.geometry.convex import box
from s2a.scene.scene import Joint
from s2a.scene.usd.sim_scene import Collider, Mass, SimBody

OUT = Joint("prismatic", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.3))


def front(name: str, low: float) -> SimBody:
    """Return a front that begins at a height [m]."""
    mesh = box(np.array([0.0, 0.0, low + 0.1]), np.eye(3), np.array([0.02, 0.4, 0.2]))
    return SimBody(name, mesh, (Collider(name, mesh),), Mass(5.0, (0.0, 0.0, 0.1), (0.1, 0.1, 0.1)))


@pytest.mark.parametrize(("gap", "filtered"), [(-1e-3, True), (0.0, True), (1e-4, True), (1e-3, False)])
def test_fronts_that_overlap_or_touch_do_not_collide(gap: float, filtered: bool) -> None:
    moving = {"drawer_1": front("drawer_1", 0.0), "drawer_2": front("drawer_2", 0.2 + gap)}
    found = filtered_pairs(moving, {}, dict.fromkeys(moving, OUT))
    assert [list(others) for others in found.values()] == ([["drawer_2"], ["drawer_1"]] if filtered else [[], []])
    # The largest ball in an overlap of 1 mm has half of that as its radius.
    depths = [depth for others in found.values() for depth in others.values()]
    assert depths == pytest.approx([max(0.0, -gap / 2)] * len(depths), abs=2e-5)
