"""An orbit camera: intrinsics, and the pose from which its subject fills the image."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from s2a.core.bounds import Above, Count, Positive
from s2a.scene.scene import Mesh, Vec3


@dataclass(frozen=True)
class OrbitCamera:
    """Intrinsics and framing of an image.

    Attributes:
        width: image width [pixel].
        height: image height [pixel].
        samples: rays per pixel along each side (supersampling).
        fov: vertical field of view [rad].
        azimuth: angle of the camera to the right of the subject's front [rad].
        elevation: angle above the horizon [rad].
        margin: camera distance as a multiple of the smallest that shows the whole subject.
        backface_culling: Hide surfaces seen from behind, which opens a scanned room to a camera outside of it.
    """

    width: Count
    height: Count
    samples: Count
    fov: Annotated[float, Above(0.0, 3.0)]
    azimuth: float
    elevation: float
    margin: Positive
    backface_culling: bool


@dataclass(frozen=True)
class CameraPose:
    """Position and aim of a camera; +z is up in the image."""

    eye: Vec3  # camera position in scene coordinates [m]
    target: Vec3  # point at the centre of the image [m]


def framing_pose(points: np.ndarray, front: np.ndarray, camera: OrbitCamera) -> CameraPose:
    """Return the camera pose from which points fill the image up to the margin.

    Args:
        points: the subject, scene coordinates [m], shape [point 3].
        front: horizontal direction that the subject faces, zero of the azimuth, shape [3].
        camera: intrinsics, angles and margin.
    """
    heading, level = np.arctan2(front[1], front[0]) + camera.azimuth, np.cos(camera.elevation)
    back = np.array([level * np.cos(heading), level * np.sin(heading), np.sin(camera.elevation)])
    across = np.stack(axes(-back))
    tangents = np.tan(camera.fov / 2) * np.array([camera.width / camera.height, 1.0])
    sideways, nearness = (points @ across.T) / tangents, (points @ back)[:, None]
    # A point is inside where |sideways - middle / tangent| <= distance - nearness: each edge touches its own farthest point.
    low, high = (nearness - sideways).max(axis=0), (nearness + sideways).max(axis=0)
    middle = tangents * (high - low) / 2 @ across + nearness.mean() * back
    distance = camera.margin * ((high + low).max() / 2 - nearness.mean())
    return CameraPose(tuple(middle + distance * back), tuple(middle))


def front_of(meshes: Sequence[Mesh]) -> np.ndarray | None:
    """Return the mean horizontal normal of scanned surfaces, unit, shape [3], equal weights; None if the normals cancel.

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
    """Return the camera's right and up unit vectors for a viewing direction [3]; looking straight down, +y is up."""
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right = right / np.linalg.norm(right) if np.linalg.norm(right) > 1e-9 else np.array([1.0, 0.0, 0.0])
    return right, np.cross(right, forward)
