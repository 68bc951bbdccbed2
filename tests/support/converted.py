"""Hand-made rooms for other simulators: a drawer or a hinged one with dry friction, a lid on it, and a free cube."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from cabinet import HANDLE, box, free_cube, write_cabinet
from scipy.spatial.transform import Rotation
from settings import load

from s2a.scene.scene import Joint
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import Collider, Mass, SimBody
from s2a.sim.solver import SimConfig

PART, LID, CUBE, CABINET = "drawer_2", "lid_6", "cup_5", "cabinet_1"
FRICTION = 1.5
"""Dry friction of the joint [N] or [N m]."""
SLIDE = Joint("prismatic", (1.0, 0.0, 0.0), tuple(HANDLE), (0.0, 0.4))
HINGE = Joint("revolute", (0.0, 0.0, -1.0), (0.32, 0.36, 0.7), (0.0, 1.5))
"""Upright at the left of the front, which turns out of the cabinet."""
LID_HINGE = Joint("revolute", (0.0, -0.6, 0.8), (0.3, 0.1, 0.6), (0.0, 1.0))


def write_room(path: Path, joint: Joint = SLIDE, *, free: bool = False, lid: bool = False) -> Path:
    """Write a room of one part on a joint with dry friction; with a free cube on the floor, and with a lid hinged to the part."""
    cubes = [free_cube(CUBE, (1.2, 0.5, 0.05))] if free else []
    room = sim_stage.read(write_cabinet(path, joint=joint, free=cubes))
    moving = replace(room.articulations[PART], friction=FRICTION)
    body = room.bodies[PART]
    tilted = replace(body, mass=replace(body.mass, axes=tuple(Rotation.from_rotvec((0.1, 0.4, -0.2)).as_quat())))
    bodies = {**room.bodies, PART: tilted}
    articulations = {PART: moving}
    if lid:
        shape = box((0.2, 0.0, 0.65), (0.05, 0.1, 0.01))
        mass = Mass(0.4, (0.2, 0.0, 0.65), (0.002, 0.001, 0.003))
        bodies[LID] = SimBody(LID, shape, (Collider(LID, shape),), mass)
        articulations[LID] = replace(moving, joint=LID_HINGE, parent=PART, filtered=(CABINET,))
    sim_stage.write(replace(room, bodies=bodies, articulations=articulations), path)
    return path


def inertia(mass: Mass) -> np.ndarray:
    """Return the inertia of a body about its centre of mass along the scene's axes [kg m^2], shape [3 3]."""
    turn = Rotation.from_quat(mass.axes).as_matrix()
    return turn @ np.diag(mass.inertia) @ turn.T


def settings(stiffness: float = 0.0, damping: float = 0.0) -> SimConfig:
    """Return the settings of conf/sim/planner with another spring and damping."""
    found: SimConfig = load(
        SimConfig, "sim/planner", joint={"stiffness": stiffness, "damping": damping, "spring": "grasp"}
    )
    return found
