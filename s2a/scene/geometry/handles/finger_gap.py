"""The finger gap behind a handle, and its fill ratio by convex hulls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from s2a.scene.geometry.convex import box, contains
from s2a.scene.geometry.mesh_ops import sample
from s2a.scene.scene import Mesh

FINGER_WIDTH = 0.02
"""[m] Width of the space that is kept free for a finger of any gripper, along the handle."""
FINGER_DEPTH = 0.015
"""[m] Its extent across the handle, on either side; certify measures with the boxes of the robot's own fingers."""
CLEARANCE = 0.002
"""[m] What fingers keep from the front; a scan is not surer than that."""
SAMPLES = 20000
"""Points by which a handle is asked."""


@dataclass(frozen=True)
class FingerSpace:
    """Where the fingers are while they hold a handle: boxes in the scene, none if the handle lies flat on the front.

    Attributes:
        behind: the space between bar and front; None if the region reaches the front there (a knob, a webbed bar).
        beside: the two spaces across the bar, from its outer face to the front.
    """

    behind: Mesh | None
    beside: tuple[Mesh, ...]

    @property
    def boxes(self) -> tuple[Mesh, ...]:
        """All spaces."""
        return self.beside if self.behind is None else (self.behind, *self.beside)


def finger_space(region: Mesh, point: np.ndarray, frame: np.ndarray, front: float) -> FingerSpace:
    """Return where the fingers go.

    Args:
        region: the grasp region as scanned, mostly open at its back.
        point: where it is grasped [m], shape [3].
        frame: grasp frame's axes as columns [3 3]: x along the region, y across, z into the furniture.
        front: coordinate along z of the front's surface behind the region [m].
    """
    local = sample(region, SAMPLES, seed=0) @ frame
    middle = point @ frame
    here = local[np.abs(local[:, 0] - middle[0]) < FINGER_WIDTH / 2]
    if len(here) < 50:
        return FingerSpace(None, ())
    (low, face), (high, back) = np.quantile(here[:, 1:], [0.01, 0.99], axis=0)
    end = front - CLEARANCE
    if end - face < 2 * CLEARANCE:
        return FingerSpace(None, ())

    def space(y: tuple[float, float], z: tuple[float, float]) -> Mesh:
        center = np.array([middle[0], np.mean(y), np.mean(z)])
        return box(frame @ center, frame, np.array([FINGER_WIDTH, y[1] - y[0], z[1] - z[0]]))

    margin = CLEARANCE / 2
    below, above = (low - margin - FINGER_DEPTH, low - margin), (high + margin, high + margin + FINGER_DEPTH)
    beside = (space(below, (face, end)), space(above, (face, end)))
    reaches_front = back - face > 0.75 * (front - face)
    return FingerSpace(None if reaches_front else space((low, high), (back + margin, end)), beside)


def fraction_inside(hulls: Sequence[Mesh], points: np.ndarray) -> float:
    """Return the share of points [point 3] that lie in any of the hulls, 0 to 1."""
    inside = np.zeros(len(points), bool)
    for piece in hulls:
        inside |= contains(piece, points)
    return float(inside.mean()) if len(points) else 0.0
