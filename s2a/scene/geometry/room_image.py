"""An image of a room from above its corner, opened towards the camera, with the axes of its frame."""

from __future__ import annotations

import numpy as np

from s2a.scene.geometry.camera import OrbitCamera, framing_pose, front_of
from s2a.scene.geometry.mesh_ops import painted
from s2a.scene.geometry.render import render
from s2a.scene.scene import Mesh

CAMERA = OrbitCamera(
    width=1200,
    height=900,
    samples=2,
    fov=0.7,
    azimuth=0.35,
    elevation=0.65,
    margin=1.05,
    backface_culling=True,
)
COLORS = ((220, 50, 40), (40, 160, 60), (40, 80, 220))
"""RGB of the axes x, y and z."""

_LENGTH = 0.3  # of the room's diagonal
_THICK = 0.02  # of an axis's length


def room_image(room: Mesh) -> np.ndarray:
    """Return an RGB image, shape [row column 3], uint8, of a room with z up; x is red, y green, z blue.

    The camera stands on the side from which most surfaces were scanned; the axes meet in the lowest corner before it.
    """
    low, high = (np.quantile(room.vertices, fraction, axis=0) for fraction in (0.002, 0.998))
    length = _LENGTH * float(np.linalg.norm(high - low))
    front = front_of([room])
    front = np.array([1.0, 0.0, 0.0]) if front is None else front
    start = np.array([high[0] if front[0] > 0 else low[0], high[1] if front[1] > 0 else low[1], low[2]])
    shown = [room, *(_beam(start, axis, length, COLORS[axis]) for axis in range(3))]
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    subject = np.concatenate([corners, start + length * np.eye(3)])
    return render(shown, framing_pose(subject, front, CAMERA), CAMERA)


def _beam(start: np.ndarray, axis: int, length: float, color: tuple[int, int, int]) -> Mesh:
    """Return a box from a point along an axis, seen from outside."""
    half = _THICK * length * np.ones(3)
    low, high = start - half, start + half
    high[axis] = start[axis] + length
    corners = np.array(
        [[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    )
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return painted(Mesh(corners, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])), color)
