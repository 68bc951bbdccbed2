"""The support of a free object: three hulls, so that it rests on three contacts."""

from __future__ import annotations

import numpy as np

from s2a.scene.geometry.convex import clip, contains, hull
from s2a.scene.scene import Mesh

STABLE = 0.001
"""[m] How far inside of its foot an object's centre of mass lies at least; less than half the foot's thickness."""
WEDGE, INNER = np.radians(25), 0.5
"""Half the angle [rad] in which a foot lies, seen from the centre of mass; its inner end as a fraction of its outer one."""


def whole_foot(solid: Mesh, ground: float, center: np.ndarray, thickness: float, max_vertices: int) -> Mesh:
    """Return the flat hull on which an object stands.

    It stood when it was scanned: where its centre of mass is not above what is known of its underside, the rest of that was
    not seen, and all of the object's outline carries it.

    Args:
        solid: the object, scene coordinates.
        ground: height of what carries it [m].
        center: its centre of mass [m], shape [3].
        thickness: of the hull [m].
        max_vertices: largest number of its vertices.
    """
    points = solid.vertices.astype(np.float64)
    for sole in (points[points[:, 2] < ground + thickness], points):
        flat = np.concatenate([sole * [1, 1, 0] + [0, 0, height] for height in (ground, ground + thickness)])
        foot = hull(flat, max_vertices)
        above = np.array([[*center[:2], ground + thickness / 2]])
        if foot is not None and contains(foot, above, -STABLE)[0]:
            break
    return solid if foot is None else foot


def split_foot(foot: Mesh, center: np.ndarray) -> list[Mesh]:
    """Return three separate hulls around the centre of mass [3], cut out of a flat hull; that itself if it is too small.

    MuJoCo gives a pair of hulls a single contact: on one foot an object of one hull stands on a point, and creeps. Wherever
    in its foot each of three contacts lies, the centre of mass is between them.
    """
    spread = np.linalg.svd(foot.vertices[:, :2] - foot.vertices[:, :2].mean(axis=0), full_matrices=False)[2][0]
    first = float(np.arctan2(spread[1], spread[0]))
    hulls = []
    for turn in first + np.arange(3) * 2 * np.pi / 3:
        left: Mesh | None = foot
        for side in (-1.0, 1.0):  # the wedge around one direction
            edge = turn + side * WEDGE
            normal = side * np.array([-np.sin(edge), np.cos(edge), 0.0])
            left = None if left is None else clip(left, normal, float(normal @ center))
        out = np.array([np.cos(turn), np.sin(turn), 0.0])
        if left is not None:
            far = float((left.vertices @ out).max() - out @ center)
            left = clip(left, -out, -float(out @ center + INNER * far))
        if left is None:
            return [foot]
        hulls.append(left)
    return hulls
