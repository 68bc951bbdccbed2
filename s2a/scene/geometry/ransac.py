"""RANSAC for the plane with the most inliers: the baseline to region growth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.core.ranges import Count, CountFromZero, NotNegative, Positive
from s2a.scene.geometry.planes import Plane


@dataclass(frozen=True)
class RansacConfig:
    """RANSAC for one plane.

    Attributes:
        threshold: largest distance of an inlier [m].
        iterations: number of planes that are drawn, each through three random points.
        max_tilt: largest angle between the plane's normal and the requested direction [rad].
        seed: of the random choices.
    """

    threshold: Positive
    iterations: Count
    max_tilt: NotNegative
    seed: CountFromZero


def ransac_plane(points: np.ndarray, upright: bool, config: RansacConfig) -> Plane | None:
    """Return the horizontal (or vertical) plane with the most inliers, as it was drawn; None if no draw had that direction.

    Args:
        points: shape [point 3], [m].
        upright: Find a vertical plane instead of a horizontal one.
        config: threshold and number of iterations.

    Returns:
        A plane whose `faces` are the indices of its inliers among the points.
    """
    if len(points) < 3:
        return None
    points = np.asarray(points, np.float64)
    a, b, c = points[np.random.default_rng(config.seed).integers(len(points), size=(3, config.iterations))]
    across = np.cross(b - a, c - a)
    length = np.linalg.norm(across, axis=1)
    normal = across / np.maximum(length, 1e-12)[:, None]
    tilt = np.abs(normal[:, 2])
    wanted = (length > 1e-12) & ((tilt < np.sin(config.max_tilt)) if upright else (tilt > np.cos(config.max_tilt)))
    if not wanted.any():
        return None
    normal, offset = normal[wanted], np.einsum("ij,ij->i", normal, a)[wanted]
    best = int(
        np.argmax([np.sum(np.abs(points @ n - d) < config.threshold) for n, d in zip(normal, offset, strict=True)])
    )
    up = normal[best] * (-1.0 if normal[best][2] < 0 else 1.0)
    offset = float(up @ a[wanted][best])
    return Plane(up, offset, np.flatnonzero(np.abs(points @ up - offset) < config.threshold))
