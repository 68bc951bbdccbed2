"""The motion between the frames of two scans of a room: robust point-to-plane ICP over all that stands still."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.joints.register_surface import OrientedMesh, match

SAMPLES = 15000
"""Points that are matched in each step."""
REACHES = (0.5, 0.3, 0.2, 0.1, 0.05, 0.03, 0.015)
"""[m] Distances beyond which a match counts nothing, from coarse to fine."""
STEPS = 8
"""Gauss-Newton steps at each of them."""
ALIKE = 0.8
"""Cosine between normals from which a match counts."""
TURNS = (0.0, -0.15, 0.15)
"""[rad] Turns about z from which the search starts."""


@dataclass(frozen=True)
class Alignment:
    """A motion between two frames.

    Attributes:
        motion: from the other scan's frame to the first's, shape [4 4].
        overlap: fraction of the other surface that lies on the first.
        rms: distance between the two there [m].
    """

    motion: np.ndarray
    overlap: float
    rms: float


def align(first: OrientedMesh, other: OrientedMesh) -> Alignment:
    """Return the rigid motion that brings another scan of a room onto the first, whatever moved in it."""
    middle = np.append((other.vertices.min(axis=0) + other.vertices.max(axis=0)) / 2, 1.0)
    found: list[Alignment] = []
    for turn in TURNS:
        start = np.eye(4)
        start[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
        start[:3, 3] = (middle - start @ middle)[:3]
        found.append(_icp(first, other, start))
        if found[-1].overlap > 0.8:
            break
    return max(found, key=lambda alignment: alignment.overlap)


def _icp(first: OrientedMesh, other: OrientedMesh, motion: np.ndarray) -> Alignment:
    """Return the alignment that is found from a start, shape [4 4]."""
    cloud = other.sample(SAMPLES)
    for reach in REACHES:
        for _ in range(STEPS):
            moved = cloud.moved(motion)
            found = match(moved, first, reach)
            weight = np.where((found.alike > ALIKE) & found.inner, (1 - np.clip(found.gap / reach, 0, 1) ** 2) ** 2, 0)
            step = rigid_step(moved.points, found.normal, found.offset, weight)
            motion = step @ motion
            if np.abs(step - np.eye(4)).max() < 1e-5:
                break
    close = (found.gap < REACHES[-1]) & (found.alike > ALIKE)
    rms = float(np.sqrt(np.mean(found.offset[close] ** 2))) if close.any() else np.inf
    return Alignment(motion, float(close.mean()), rms)


def rigid_step(points: np.ndarray, normals: np.ndarray, offsets: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the small motion, shape [4 4], that best takes points onto planes: one Gauss-Newton step.

    Args:
        points: [m], shape [point 3].
        normals: of their planes, unit, shape [point 3].
        offsets: of the points from the planes [m], shape [point].
        weights: shape [point].
    """
    used = weights > 0
    if used.sum() < 6:
        return np.eye(4)
    centre = np.average(points[used], axis=0, weights=weights[used])
    rows = np.concatenate([np.cross(points[used] - centre, normals[used]), normals[used]], axis=1)
    weighted = rows * weights[used, None]
    x = np.linalg.solve(rows.T @ weighted + 1e-9 * np.eye(6), -weighted.T @ offsets[used])
    step = np.eye(4)
    step[:3, :3] = turned(x[:3])
    step[:3, 3] = centre + x[3:] - step[:3, :3] @ centre
    return step


def turned(vector: np.ndarray) -> np.ndarray:
    """Return the rotation by a rotation vector [rad], shape [3 3]: Rodrigues' formula."""
    angle = float(np.linalg.norm(vector))
    if angle < 1e-12:
        return np.eye(3)
    cross = np.cross(vector / angle, np.eye(3)).T
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
