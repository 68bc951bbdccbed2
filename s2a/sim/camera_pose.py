"""From where the robot and what it opens can be seen: on the robot's side, with nothing of the room in between."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator

import numpy as np

from s2a import robot
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import in_scene
from s2a.sim.world import SimStage

AZIMUTHS = (1.0, -1.0, 0.7, -0.7, 1.3, -1.3, 0.4, -0.4)
"""Fractions of the requested azimuth that are tried, in this order at each distance."""
NEARER = (1.0, 0.85, 0.7, 0.55)
"""Fractions of the requested distance."""
HIGHER = (1.0, 0.5, 1.6)
"""Fractions of the requested elevation."""
BEFORE = 0.05
"""[m] So much before what is looked at, a surface no longer hides it: it may be its own."""


def viewpoint(stage: SimStage, distance: float, azimuth: float, elevation: float) -> tuple[np.ndarray, np.ndarray]:
    """Return where a camera stands and the point in the middle of its image [m], shape [3] each, scene frame.

    The first place that sees all of grasp, gripper before it and shoulder; else the one that sees most of them.

    Args:
        stage: what is looked at.
        distance: from the middle between robot and handle [m].
        azimuth: to the side of the line from handle to robot, turned about z [rad].
        elevation: above the horizon [rad].
    """
    base, grasp = stage.base[:3], stage.grasp[:3]
    middle = 0.5 * (base + grasp) + [0.0, 0.0, 0.2]
    back = base - grasp
    shoulder = base + [0.0, 0.0, robot.load(stage.robot).base.shoulder_height]
    seen = np.stack([grasp, grasp + 0.15 * back / np.linalg.norm(back), shoulder])
    places = places_around(middle, float(np.arctan2(back[1], back[0])), distance, azimuth, elevation)
    return first_free(places, seen, _obstacles(stage)), middle


def first_free(places: Iterable[np.ndarray], seen: np.ndarray, room: np.ndarray) -> np.ndarray:
    """Return the first place [3] from which all points [point 3] are seen past triangles [face 3 3], else the best."""
    best, most = np.zeros(3), -1
    for place in places:
        free = sum(not blocked(place, point, room) for point in seen)
        if free > most:
            best, most = place, free
        if most == len(seen):
            break
    return best


def blocked(start: np.ndarray, end: np.ndarray, triangles: np.ndarray) -> bool:
    """Whether a triangle, seen from either side, hides one point from another.

    Args:
        start: [m], shape [3].
        end: [m], shape [3].
        triangles: corners [m], shape [face 3 3].
    """
    ray = end - start
    ray *= max(0.0, 1.0 - BEFORE / max(float(np.linalg.norm(ray)), 1e-9))
    first = triangles[:, 0]
    a, b = triangles[:, 1] - first, triangles[:, 2] - first
    across = np.cross(ray, b)
    size = np.einsum("fk,fk->f", a, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("fk,fk->f", start - first, across) / size
        turned = np.cross(start - first, a)
        v = turned @ ray / size
        t = np.einsum("fk,fk->f", b, turned) / size
        return bool(((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < 1)).any())


def places_around(
    middle: np.ndarray, heading: float, distance: float, azimuth: float, elevation: float
) -> Iterator[np.ndarray]:
    """Yield places around a point [m], shape [3] each, the requested one first; they come nearer and go to other sides.

    Args:
        middle: the point [m], shape [3].
        heading: angle about z of the direction from the point to a camera without azimuth [rad].
        distance: of the first ones [m].
        azimuth: to the side of the heading [rad].
        elevation: above the horizon [rad].
    """
    for near, high, around in itertools.product(NEARER, HIGHER, AZIMUTHS):
        turn, up = heading + around * azimuth, min(high * elevation, 1.4)
        level = np.array([np.cos(turn), np.sin(turn), 0.0]) * np.cos(up)
        yield middle + near * distance * (level + [0.0, 0.0, np.sin(up)])


def _obstacles(stage: SimStage) -> np.ndarray:
    """Return the triangles of all that is seen and stands still [m], shape [face 3 3]."""
    room, found = sim_stage.read(stage.path), [np.zeros((0, 3, 3))]
    for body in (*room.bodies.values(), *room.free.values()):
        if body.id != stage.target:
            found.append(in_scene(body, body.visual)[body.visual.faces])
    return np.concatenate([*found, room.static_visual.vertices[room.static_visual.faces].astype(float)])
