"""Which way round the hand takes hold of what is round: so that there is room for the hand itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.prepare import panda
from s2a.prepare.surroundings import Surroundings
from s2a.scene import Scene
from s2a.usd.simscene import Grasp

ROUND = 1.5
"""A grasp region whose section is less elongated than this can be held any way round."""
TURNS = (0, 90, 45, -45)
"""[degrees] Rolls about the approach, the preferred one first: the fingers close along the vertical."""
APPROACH = 0.1
"""[m] Way of the hand that has to be free before the grasp."""
AROUND = 0.4
"""[m] How far from the grasp the hand reaches in plan."""
BETTER = 0.005
"""[m] By so much less another roll has to reach into the room: scans are rough."""


def free_roll(scene: Scene, target: str, grasp: Grasp) -> Grasp:
    """Return a grasp, rolled about its approach if its region is round and the hand would otherwise reach into the room."""
    along, across, _ = grasp.size
    if max(along, across) >= ROUND * min(along, across):
        return grasp
    near = Surroundings(scene, (target, *scene.descendants(target)), np.array(grasp.point), AROUND)
    rolls = [_rolled(grasp, turn) for turn in TURNS]
    depths = [_depth(near, roll) for roll in rolls]
    best = int(np.argmin(depths))
    return rolls[best] if depths[best] < depths[0] - BETTER else grasp


def _rolled(grasp: Grasp, degrees: float) -> Grasp:
    """Return a grasp with its frame turned about the approach, and its extents with it."""
    if not degrees:
        return grasp
    turn = Rotation.from_quat(grasp.orientation) * Rotation.from_euler("z", degrees, degrees=True)
    x, y, z, w = map(float, turn.as_quat(canonical=True))
    points = turn.inv().apply(grasp.region.vertices[grasp.region.faces.ravel()])
    along, across = np.ptp(points[:, :2], axis=0) if degrees % 90 else (grasp.size[1], grasp.size[0])
    return replace(grasp, orientation=(x, y, z, w), size=(float(along), float(across), grasp.size[2]))


def _depth(near: Surroundings, grasp: Grasp) -> float:
    """Return how deep the open hand reaches into what does not move, on its straight way to the grasp [m]."""
    turn, hand = Rotation.from_quat(grasp.orientation), panda.SPHERES[panda.HAND]
    back = np.linspace(0.0, APPROACH, 6)[:, None, None] * np.array([0.0, 0.0, 1.0])
    centers = turn.apply((hand[None, :, 1:4] - back).reshape(-1, 3)) + grasp.point
    return near.hit(centers, np.tile(hand[:, 4], 6), moving=False)[0]
