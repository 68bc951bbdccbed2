"""Where a camera stands so that something fills its picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from s2a.ranges import Above, Count, Positive
from s2a.scene import Mesh, Vec3


@dataclass(frozen=True)
class LookConfig:
    """How a picture is taken.

    Attributes:
        width: of the picture [pixel].
        height: of the picture [pixel].
        samples: rays a pixel, along each side.
        fov: angle between the upper and the lower edge [rad].
        azimuth: how far the camera stands to the right of straight in front [rad].
        elevation: how far above [rad].
        margin: distance as a multiple of what just fits.
        see_through: whether surfaces seen from behind are left out, which opens a scanned room to a look from outside.
    """

    width: Count
    height: Count
    samples: Count
    fov: Annotated[float, Above(0.0, 3.0)]
    azimuth: float
    elevation: float
    margin: Positive
    see_through: bool


@dataclass(frozen=True)
class View:
    """From where to where a camera looks; the picture's upper edge is the one nearer to +z.

    Attributes:
        eye: position of the camera [m].
        target: what is in the middle of the picture [m].
    """

    eye: Vec3
    target: Vec3


def frame(points: np.ndarray, front: np.ndarray, look: LookConfig) -> View:
    """Return the view that shows points, filling the picture but for the margin.

    Args:
        points: what is to be seen [m], shape [point 3].
        front: horizontal direction in which it faces, from which azimuth is measured, shape [3].
        look: angles and margin.
    """
    heading, level = np.arctan2(front[1], front[0]) + look.azimuth, np.cos(look.elevation)
    back = np.array([level * np.cos(heading), level * np.sin(heading), np.sin(look.elevation)])
    across = np.stack(axes(-back))
    tangents = np.tan(look.fov / 2) * np.array([look.width / look.height, 1.0])
    sideways, nearness = (points @ across.T) / tangents, (points @ back)[:, None]
    # A point is inside where |sideways - middle / tangent| <= distance - nearness: each edge touches its own farthest point.
    low, high = (nearness - sideways).max(axis=0), (nearness + sideways).max(axis=0)
    middle = tangents * (high - low) / 2 @ across + nearness.mean() * back
    distance = look.margin * ((high + low).max() / 2 - nearness.mean())
    return View(tuple(middle + distance * back), tuple(middle))


def front_of(meshes: Sequence[Mesh]) -> np.ndarray | None:
    """Return the horizontal direction in which scanned surfaces face, shape [3], each counting the same; None if in none.

    A scan shows a part only from where the scanner stood, so that its normals do not cancel.
    """
    total = np.zeros(3)
    for mesh in meshes:
        a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(np.float64), 1, 0)
        normal = 0.5 * np.cross(b - a, c - a).sum(axis=0) * (1.0, 1.0, 0.0)
        # A closed surface leaves nothing but noise.
        if np.linalg.norm(normal) > 0.05 * mesh.face_areas.sum():
            total += normal / np.linalg.norm(normal)
    length = np.linalg.norm(total)
    return total / length if length > 1e-6 else None


def axes(forward: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the unit vectors to the right and up of a direction of view; straight down, +y is up."""
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right = right / np.linalg.norm(right) if np.linalg.norm(right) > 1e-9 else np.array([1.0, 0.0, 0.0])
    return right, np.cross(right, forward)
