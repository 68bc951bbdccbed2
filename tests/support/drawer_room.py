"""The hand-made cabinet with a box behind the drawer's front, and a cube on top of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from cabinet import box, free_cube, write_cabinet

from s2a.scene.scene import Mesh
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import SimRoom

FLOOR, WALL_TOP = 0.668, 0.74
"""[m] Heights of the drawer's bottom and of its sides."""
DEPTH = (-0.1, 0.3055)
"""[m] Along x, of the box at zero: its back, and the inner face of the front."""
HALF_WIDTH = 0.294
START = np.array([0.2, 0.1, 0.822, 0, 0, 0, 1.0])
"""Where the cube of 4 cm stands, 7-vector."""


def drawer_room(path: Path, side: float = 0.04, *, floor: bool = True, beside: Sequence[Mesh] = ()) -> SimRoom:
    """Write and return the room; without `floor` the drawer is a front alone."""
    middle, long = (DEPTH[0] + DEPTH[1]) / 2, (DEPTH[1] - DEPTH[0]) / 2
    high = (WALL_TOP - FLOOR) / 2
    walls = [box((middle, 0.0, FLOOR - 0.003), (long, 0.3, 0.003))]
    walls += [box((middle, y, FLOOR + high), (long, 0.003, high)) for y in (-0.297, 0.297)]
    walls += [box((DEPTH[0] - 0.003, 0.0, FLOOR + high), (0.003, 0.3, high))]
    start = (*START[:2], 0.802 + side / 2)
    cubes = [free_cube("cube_9", start, side, 0.1), free_cube("cube_10", (0.0, 0.3, 0.827), 0.05, 0.2)]
    return sim_stage.read(
        write_cabinet(path, free=cubes, attached=walls if floor else (), beside=beside), visuals=False
    )
