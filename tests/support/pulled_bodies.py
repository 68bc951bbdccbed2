"""A drawer, a door and a lid on their joints, for tests that pull them."""

from __future__ import annotations

import numpy as np

from s2a.joints.pulled import Moving
from s2a.scene.scene import Joint
from s2a.scene.usd.sim_scene import Mass

DRAWER = Moving(
    Joint("prismatic", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.4)),
    Mass(6.0, (0.2, 0.0, 0.5), (0.1, 0.1, 0.1)),
    np.array([0.3, 0.0, 0.5]),
)
DOOR = Moving(
    Joint("revolute", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (-1.6, 0.0)),
    Mass(4.0, (0.2, 0.0, 0.5), (0.1, 0.1, 0.1)),
    np.array([0.4, 0.0, 0.5]),
)
LID = Moving(
    Joint("revolute", (0.0, 1.0, 0.0), (0.0, 0.0, 0.0), (-1.2, 0.0)),
    Mass(3.0, (0.2, 0.0, 0.02), (0.05, 0.05, 0.05)),
    np.array([0.4, 0.0, 0.0]),
)
