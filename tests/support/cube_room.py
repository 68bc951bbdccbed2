"""A cube on a cabinet of 0.802 m, to be picked and placed 0.3 m to the side."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from cabinet import free_cube, write_cabinet

from s2a.motion.obstacles import Obstacles
from s2a.scene.scene import Mesh
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import SimRoom

START, GOAL = np.array([0.2, 0.1, 0.828, 0, 0, 0, 1.0]), np.array([0.2, -0.2, 0.828, 0, 0, 0, 1.0])
APPROACH = 0.1
"""[m] Straight path to the grasp."""


def room_of(folder: Path, side: float = 0.05, **more: object) -> SimRoom:
    """Return the room; `more` goes to `write_cabinet`."""
    cube = free_cube("cube_9", tuple(START[:3]), side, 0.2)
    return sim_stage.read(write_cabinet(folder / "sim.usda", free=[cube], **more), visuals=False)


def with_hulls(near: Obstacles, *extra: Mesh) -> Obstacles:
    """Return obstacles with further hulls."""
    named = [*zip(near.names, near.meshes, strict=True), *(("extra", mesh) for mesh in extra)]
    return Obstacles(named, solid=True)
