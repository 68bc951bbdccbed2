"""What leans: things that would fall over on their own stand with their back against a wall."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from s2a.language.insert.place.stable_pose import tilt_margin
from s2a.scene.geometry.mesh_ops import normals, sample
from s2a.scene.scene import Mesh

LEAN = np.radians(10.0)
"""Angle at which things lean [rad]: a guitar, a broom, a board; friction holds their feet up to about 40 deg."""
SHAKY = 0.11
"""Tilt margin below which a thing is leaned, as a share of a right angle: 10 deg."""
TALL = 3.0
"""Height over depth from which a thing is leaned."""
LOWEST, SHAFT = 0.05, (0.1, 0.3)
"""Heights of the foot and of the shaft above it, as fractions of an object's height."""
WIDER, SQUARE = 3.0, 0.5
"""A stand's area over that of the shaft above it, and its width over its length: that of a lamp, not the head of a broom."""


FACE, FLAT, ALIKE, LEANS = 0.85, 0.98, 0.6, 0.06
"""A panel's face: cosine of its normals to where it looks, length of their mean, area over that of the other face, and sine of
its least lean."""


def slender(object: Mesh) -> bool:
    """Return True for an upright object that is tall, shallow and easily tipped: nobody stands it up on its own."""
    deep, _, high = np.ptp(object.bounds, axis=0)
    shaky = tilt_margin(object, np.array([0.0, 0.0, 1.0])) < SHAKY
    return bool(high > TALL * deep and high > 0.4 and shaky and not has_stand(object))


def has_stand(object: Mesh) -> bool:
    """Return True for an upright object on a foot made to stand on: as a floor lamp's, it is wider than the shaft above."""
    points = np.concatenate([sample(object, 4000, seed=0), object.vertices])
    height = (points[:, 2] - points[:, 2].min()) / max(float(np.ptp(points[:, 2])), 1e-9)
    foot = points[height < LOWEST, :2]
    shaft = points[(height > SHAFT[0]) & (height < SHAFT[1]), :2]
    sides = np.ptp(foot, axis=0)
    return bool(outline(foot) > WIDER * outline(shaft) and sides.min() > SQUARE * sides.max())


def outline(points: np.ndarray) -> float:
    """Return the area of the convex hull of points [point 2]; 0 where they have none."""
    try:
        return float(ConvexHull(points).volume)
    except (QhullError, ValueError):
        return 0.0


def leans_forward(mesh: Mesh, up: np.ndarray, front: np.ndarray) -> bool:
    """Return True for a panel whose front looks down and whose back looks up: a photo on its strut that is taken for its back.

    Args:
        mesh: as it stands.
        up: unit direction, shape [3].
        front: unit direction of what is taken for its front, across `up`, shape [3].
    """
    facing, areas = normals(mesh).astype(np.float64), mesh.face_areas.astype(np.float64)
    sides = [facing @ way > FACE for way in (front, -front)]
    ahead, behind = (float(areas[side].sum()) for side in sides)
    if min(ahead, behind) < ALIKE * max(ahead, behind) or not ahead:
        return False
    means = [np.average(facing[side], axis=0, weights=areas[side]) for side in sides]
    if min(np.linalg.norm(mean) for mean in means) < FLAT:  # a leaning rod or a banana has no face
        return False
    forward, backward = (float(mean @ up) for mean in means)
    return forward < -LEANS and backward > LEANS and abs(forward + backward) < LEANS


def leaned(turn: np.ndarray) -> np.ndarray:
    """Return a rotation from the object's frame to the scene's, shape [3 3], tilted backwards so that its top is behind."""
    return np.asarray(turn @ Rotation.from_euler("y", -LEAN).as_matrix())
