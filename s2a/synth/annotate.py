"""The annotator: which face belongs to which part, and joints as a person would place them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from s2a.geometry.mesh_query import RayMesh, nearest_faces
from s2a.ranges import NotNegative
from s2a.scene import Joint
from s2a.synth.catalog import Entry
from s2a.synth.solids import rotation


@dataclass(frozen=True)
class AnnotationConfig:
    """Errors of annotated parts and joints.

    Attributes:
        border: standard deviation by which a face's place is misjudged near the border of two parts [m].
        axis: largest error of an axis' direction [deg].
        origin: largest error of a joint's origin [m].
        limits: largest relative error of a joint's range.
    """

    border: NotNegative
    axis: NotNegative
    origin: NotNegative
    limits: NotNegative


def face_numbers(
    mesh: RayMesh, numbers: np.ndarray, centroids: np.ndarray, config: AnnotationConfig, rng: np.random.Generator
) -> np.ndarray:
    """Return the number of the part that each scanned face is given to, shape [face].

    Args:
        mesh: the clean room.
        numbers: the part of each of its faces.
        centroids: of the scanned faces, in the frame of the mesh [m], shape [face 3].
        config: how ragged borders are.
        rng: where the errors come from.
    """
    places = centroids + rng.normal(0.0, config.border, centroids.shape)
    return numbers[nearest_faces(mesh, places)[0]]


def annotated_joints(entries: list[Entry], config: AnnotationConfig, rng: np.random.Generator) -> dict[int, Joint]:
    """Return the joint of each moving part as an annotator would write it, by the part's number."""
    return {e.number: _misjudged(e.piece.joint, config, rng) for e in entries if e.piece.joint is not None}


def _misjudged(joint: Joint, config: AnnotationConfig, rng: np.random.Generator) -> Joint:
    """Return a joint with small errors; the range still starts at its true lower end, the closed pose."""
    sideways = np.cross(joint.axis, rng.normal(size=3))
    vector = sideways / np.linalg.norm(sideways) * np.radians(config.axis) * rng.uniform(0.2, 1.0)
    axis = rotation(vector)[:3, :3] @ joint.axis
    offset = rng.normal(size=3)
    origin = joint.origin + offset / np.linalg.norm(offset) * config.origin * rng.uniform(0.2, 1.0)
    upper = joint.limits[1] * (1.0 + config.limits * rng.uniform(-1.0, 1.0))
    axis /= np.linalg.norm(axis)
    return replace(joint, axis=tuple(axis), origin=tuple(origin), limits=(joint.limits[0], float(upper)))
