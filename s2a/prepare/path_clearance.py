"""Whether an arm touches the room: where it starts, on its way to a handle, and while it leads the handle."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from s2a.prepare.obstacles import Surroundings
from s2a.robot import panda

BEYOND = 10.0
"""What counts for the depth [m] of a clash where the arm cannot reach."""
FINGERS = 4
"""The last spheres of the robot; they touch what they hold."""
TURN = 0.05
"""[rad] Largest turn of a joint between two poses that are looked at: at arm's length 4 cm, the radius of a sphere."""
TRACKS = 8
"""So many ways of the arm are looked at, those that begin nearest to its start."""

Clash = tuple[float, str]
"""How deep the robot reaches into a surface [m] (0: nowhere, above 1: it cannot get there), and the words for it."""


def deepest_clash(
    near: Surroundings, base: np.ndarray, turn: float, way: np.ndarray, tracks: np.ndarray, start: np.ndarray
) -> Clash:
    """Return what the robot bumps into from one place, on the best of the ways of its arm.

    Args:
        near: what is there.
        base: pose of the base, shape [4 4], scene frame.
        turn: by which it is turned to the left of where `tracks` were found [rad].
        way: poses of the tool from the point of approach on, shape [pose 4 4], scene frame.
        tracks: joints that follow it [rad], shape [track pose 7].
        start: joints in which the arm starts [rad], shape [7].
    """
    if not len(tracks):
        return BEYOND, "the arm cannot reach along the whole way"
    depth, owner = _robot(near, base, start[None], moving=True)
    if depth > 0.0:
        return depth, f"the start pose reaches {1000 * depth:.0f} mm into {owner}"
    depth, owner = _straight(near, base @ panda.frames(start[None])[0, panda.TOOL], way[0])
    if depth > 0.0:
        return depth, f"the hand on its way reaches {1000 * depth:.0f} mm into {owner}"
    return _along(near, base, tracks - turn * np.eye(panda.ARM)[0], start)


def _along(near: Surroundings, base: np.ndarray, tracks: np.ndarray, start: np.ndarray) -> Clash:
    """Return how deep the arm reaches into the room on the best way to the handle and with it."""
    inside = (tracks[..., 0] > panda.LOWER[0]) & (tracks[..., 0] < panda.UPPER[0])
    tracks = tracks[inside.all(axis=1)]
    far = np.abs(tracks[:, 0] - start).max(axis=1)
    best: Clash = (BEYOND, "the arm cannot turn so far")
    for track in tracks[np.argsort(far, kind="stable")][:TRACKS]:
        lead = _robot(near, base, track[1:], moving=False, without=FINGERS)
        reach = _robot(near, base, _turning(start, track[0]), moving=True)
        depth, owner, leg = max((*lead, "on its way"), (*reach, "on its way to the handle"))
        if depth <= 0.0:
            return 0.0, ""
        best = min(best, (depth, f"the arm reaches {1000 * depth:.0f} mm into {owner} {leg}"))
    return best


def _turning(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the joints on the straight way of all joints at once, shape [pose 7], without its start."""
    count = max(1, int(np.ceil(np.abs(end - start).max() / TURN)))
    return start + np.linspace(0.0, 1.0, count + 1)[1:, None] * (end - start)


def _robot(near: Surroundings, base: np.ndarray, q: np.ndarray, *, moving: bool, without: int = 0) -> Clash:
    """Return how deep the robot in joints [pose 7] reaches into a surface, less its last spheres, and whose."""
    balls = panda.SPHERES[: len(panda.SPHERES) - without]
    centers = panda.spheres(q)[:, : len(balls)] @ base[:3, :3].T + base[:3, 3]
    return near.hit(centers.reshape(-1, 3), np.tile(balls[:, 4], len(q)), moving=moving)


def _straight(near: Surroundings, start: np.ndarray, end: np.ndarray) -> Clash:
    """Return how deep the hand reaches into a surface on the straight way between two poses of the tool [4 4]."""
    chosen = panda.SPHERES[panda.HAND]
    best = (np.inf, "")
    for flip in (np.eye(3), np.diag([-1.0, -1.0, 1.0])):
        turns = Rotation.from_matrix(np.stack([start[:3, :3], end[:3, :3] @ flip]))
        count = max(2, int(np.linalg.norm(end[:3, 3] - start[:3, 3]) / 0.03))
        share = np.linspace(0.0, 1.0, count)
        matrices = Slerp([0.0, 1.0], turns)(share).as_matrix()
        places = start[:3, 3] + share[:, None] * (end[:3, 3] - start[:3, 3])
        centers = np.einsum("kij,sj->ksi", matrices, chosen[:, 1:4]) + places[:, None]
        best = min(best, near.hit(centers.reshape(-1, 3), np.tile(chosen[:, 4], count), moving=True))
    return best
