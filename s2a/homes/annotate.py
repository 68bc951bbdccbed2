"""The annotator: which face belongs to which part, and joints as a person would place them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from s2a.core.bounds import Fraction, NotNegative
from s2a.homes.catalog import Entry
from s2a.homes.solids import rotation
from s2a.scene.geometry.mesh_query import RayMesh, nearest_faces
from s2a.scene.scene import Joint


@dataclass(frozen=True)
class AnnotationConfig:
    """Errors of annotated parts and joints.

    Attributes:
        border: standard deviation by which a face's place is misjudged near the border of two parts [m].
        axis: largest error of an axis' direction [deg].
        origin: largest error of a joint's origin [m].
        limits: largest relative error of a joint's range.
        missed: probability that a handle is overlooked: its faces then belong to what it sits on.
        reversed: probability that a joint's axis points the wrong way.
    """

    border: NotNegative
    axis: NotNegative
    origin: NotNegative
    limits: NotNegative
    missed: Fraction
    reversed: Fraction


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


def overlooked(entries: list[Entry], config: AnnotationConfig, rng: np.random.Generator) -> set[int]:
    """Return the numbers of the handles that the annotator does not see; nothing is drawn where none is overlooked."""
    parents = {entry.parent for entry in entries}
    leaves = [
        e.number for e in entries if e.piece.style is not None and e.number not in parents and e.parent is not None
    ]
    if config.missed == 0.0:
        return set()
    return {number for number in leaves if rng.uniform() < config.missed}


def without(entries: list[Entry], numbers: np.ndarray, missed: set[int]) -> tuple[list[Entry], np.ndarray]:
    """Return the annotated parts and the part of each face without those that were overlooked."""
    parent = {entry.number: entry.parent for entry in entries}
    changed = numbers.copy()
    for number in missed:
        changed[numbers == number] = parent[number]
    return [entry for entry in entries if entry.number not in missed], changed


def reversed_joints(
    joints: dict[int, Joint], config: AnnotationConfig, rng: np.random.Generator
) -> tuple[dict[int, Joint], set[int]]:
    """Return joints of which some turn or slide the wrong way, and the numbers of those."""
    if config.reversed == 0.0:
        return joints, set()
    wrong = {number for number in joints if rng.uniform() < config.reversed}
    turned = {n: replace(j, axis=(-j.axis[0], -j.axis[1], -j.axis[2])) for n, j in joints.items() if n in wrong}
    return joints | turned, wrong


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
