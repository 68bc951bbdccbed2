"""A picture of an inserted object from inside the room: the viewpoint is one from which rays reach it."""

from __future__ import annotations

import numpy as np

from s2a.language.insert.place.preferences import floor_height
from s2a.scene.geometry.line_of_sight import visible_distance
from s2a.scene.geometry.mesh_ops import merge, sample
from s2a.scene.geometry.mesh_query import ray_mesh
from s2a.scene.geometry.orbit_camera import CameraPose, OrbitCamera
from s2a.scene.scene import Mesh, Scene

AZIMUTHS, ELEVATIONS = 24, np.radians([5.0, 15.0, 25.0, 40.0, 60.0])
FLAT, STEEP = 0.15, np.radians(25.0)
"""Height over width of what lies flat, and the least elevation from which it is looked at: edge-on it is a line."""
CLOSER = (1.0, 0.6, 0.35, 0.2)
"""Distances that are tried, as fractions of the camera's."""
POINTS = 80
"""Sampled on the object."""
GAP = 0.002
"""Rays start this far from the surface [m]."""
LOW, HIGH = 0.15, 2.3
"""Heights of the camera above the floor [m]."""
ENOUGH = 0.8
"""Share of the best view's visible points that a view farther off must have, to be taken for what it shows of the room."""


def viewpoint(scene: Scene, object: Mesh, front: np.ndarray, camera: OrbitCamera) -> CameraPose:
    """Return the camera pose that shows most of an object, from its front and from afar if it can be.

    Args:
        scene: the room with the object in it.
        object: in the scene [m].
        front: horizontal direction that it faces, shape [3].
        camera: intrinsics; its margin is the largest distance, as a multiple of the one at which the object fills the image.
    """
    points = sample(object, POINTS, seed=0).astype(np.float64)
    middle = object.bounds.mean(axis=0).astype(np.float64)
    eyes, nearness, facing = _eyes(scene, object, middle, front, camera)
    if not len(eyes):
        eyes, nearness, facing = middle[None] + (0.0, 0.0, 1.0), np.ones(1), np.zeros(1)
    share = visible_fraction(scene, points, eyes)
    merit = share + 0.15 * facing * share.max() - 0.5 * nearness * (share < ENOUGH * share.max())
    merit -= 0.1 * nearness * share.max()
    best = int(np.argmax(np.where(share >= ENOUGH * share.max(), merit, -1.0)))
    return CameraPose(tuple(eyes[best].tolist()), tuple(middle.tolist()))


def visible_fraction(scene: Scene, points: np.ndarray, eyes: np.ndarray) -> np.ndarray:
    """Return for each eye [eye 3] the share of some points [point 3] of a scene that it sees, shape [eye]."""
    room = merge([Mesh(part.mesh.vertices, part.mesh.faces) for part in scene.parts.values()])
    away = eyes[:, None] - points
    distance = np.linalg.norm(away, axis=2)
    direction = (away / distance[..., None]).reshape(-1, 3)
    start = np.tile(points, (len(eyes), 1)) + GAP * direction
    reach = float(distance.max())
    seen, _ = visible_distance(ray_mesh(room.vertices, room.faces), start, direction, reach)
    free = seen.reshape(distance.shape) >= np.minimum(distance - 2 * GAP, reach * 0.999)
    return np.asarray(free.mean(axis=1))


def _eyes(
    scene: Scene, object: Mesh, middle: np.ndarray, front: np.ndarray, camera: OrbitCamera
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return possible eyes in the room [eye 3], how near each is (0 at the farthest) and how much in front, [eye] each."""
    radius = float(np.linalg.norm(np.ptp(object.bounds, axis=0))) / 2
    farthest = max(0.6, camera.margin / 2 * radius / np.tan(camera.fov / 2))
    heading = np.arctan2(front[1], front[0])
    azimuth, elevation, closer = (
        grid.ravel()
        for grid in np.meshgrid(np.arange(AZIMUTHS) * 2 * np.pi / AZIMUTHS, ELEVATIONS, CLOSER, indexing="ij")
    )
    level = np.cos(elevation)
    away = np.stack([level * np.cos(heading + azimuth), level * np.sin(heading + azimuth), np.sin(elevation)], axis=1)
    distance = np.maximum(farthest * closer, 1.3 * radius / np.tan(camera.fov / 2))
    eyes = middle + distance[:, None] * away
    bounds = np.array([part.mesh.bounds for part in scene.parts.values() if len(part.mesh.vertices)])
    low, high, floor = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0), floor_height(scene)
    sides = np.ptp(object.bounds, axis=0)
    if sides[2] < FLAT * sides[:2].min():
        steep = elevation >= STEEP - 1e-6
        eyes, closer, azimuth = eyes[steep], closer[steep], azimuth[steep]
    inside = ((eyes > low + 0.05) & (eyes < high - 0.05))[:, :2].all(axis=1)
    inside &= (eyes[:, 2] > floor + LOW) & (eyes[:, 2] < floor + HIGH)
    return eyes[inside], 1.0 - closer[inside], np.cos(azimuth)[inside]
