"""Points of a part in a depth frame: a fixed number of them, taken of rooms and kept beside a pool."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from s2a.core.cache import UNREADABLE
from s2a.core.errors import InputError
from s2a.learn.perception.depth_camera import DepthCameraConfig, PartCloud, VisibleRoom, capture
from s2a.sim.world import SimStage

PLANES = 64
"""Planes through three points that are tried for the front."""
FLAT = 0.006
"""[m] Distance from the front's plane up to which a point is of the front: three standard deviations of depth at 1 m."""
AROUND = 0.15
"""Fraction of the points that lie beside the part."""
PROTRUDING = 0.5
"""Fraction of the points that stand out of the front, at most."""


@dataclass(frozen=True)
class PartPoints:
    """Points of a part, ready for a network.

    Attributes:
        center: mean of the part's points, in the robot's base frame [m], shape [3], float32.
        points: relative to it [m], shape [point 3], float16: 0.2 mm where it is coarsest.
        is_part: shape [point].
        height: above the front's plane, towards the robot positive [m], shape [point], float16.
    """

    center: np.ndarray
    points: np.ndarray
    is_part: np.ndarray
    height: np.ndarray


def sample(frame: PartCloud, count: int, random: np.random.Generator) -> PartPoints:
    """Return `count` points of a frame; some of them more than once where it has too few."""
    part = frame.points[frame.is_part]
    center = part.mean(axis=0)
    height = _height(frame.points, part, center, random)
    stands_out = frame.is_part & (np.abs(height) > FLAT)
    flat = frame.is_part & ~stands_out
    beside = _draw(~frame.is_part, round(AROUND * count), random)
    out = _draw(stands_out, round(PROTRUDING * count), random)
    rest = count - len(beside) - len(out)
    others = np.flatnonzero(flat if flat.any() else frame.is_part)
    chosen = np.concatenate([beside, out, random.choice(others, rest, replace=rest > len(others))])
    return PartPoints(
        center.astype(np.float32),
        (frame.points[chosen] - center).astype(np.float16),
        frame.is_part[chosen],
        height[chosen].astype(np.float16),
    )


def _draw(mask: np.ndarray, most: int, random: np.random.Generator) -> np.ndarray:
    """Return indices of a mask, at most so many."""
    index = np.flatnonzero(mask)
    return random.choice(index, most, replace=False) if len(index) > most else index


def _height(points: np.ndarray, part: np.ndarray, center: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the distance of points [point 3] from the plane that most of the part's lie on [m], positive towards the robot."""
    some = part[random.integers(len(part), size=(PLANES, 3))]
    normals = np.cross(some[:, 1] - some[:, 0], some[:, 2] - some[:, 0])
    length = np.linalg.norm(normals, axis=1)
    normals = normals[length > 1e-9] / length[length > 1e-9, None]
    if not len(normals):
        return np.zeros(len(points))
    few = part[random.integers(len(part), size=1024)]
    offsets = np.einsum("pk,pk->p", some[length > 1e-9, 0], normals)
    on = np.abs(few @ normals.T - offsets) < FLAT
    best = int(on.sum(axis=0).argmax())
    inliers = few[on[:, best]]
    middle = inliers.mean(axis=0)
    normal = np.linalg.svd(inliers - middle, full_matrices=False)[2][-1]
    toward_robot = np.array([0.0, 0.0, 0.8]) - center  # about where the robot's shoulder and a camera are
    normal *= 1.0 if normal @ toward_robot > 0.0 else -1.0
    return np.clip((points - middle) @ normal, -1.0, 1.0)


NAMES = tuple(field.name for field in fields(PartPoints))


def take(room: VisibleRoom, stage: SimStage, config: DepthCameraConfig, count: int, seed: int) -> list[PartPoints]:
    """Return frames of a stage's part, each from a place of its own; fewer where some show nothing of it."""
    random = np.random.default_rng([seed, *stage.target.encode()])
    frames = [capture(room, stage, config, random) for _ in range(count)]
    return [sample(frame, config.points, random) for frame in frames if frame is not None]


def save(clouds: Sequence[PartPoints], path: Path) -> None:
    """Write frames as an npz file."""
    columns: dict[str, Any] = {name: np.stack([getattr(cloud, name) for cloud in clouds]) for name in NAMES}
    np.savez_compressed(path, **columns)


def load(path: Path) -> list[PartPoints]:
    """Read frames that `save` wrote; InputError where the file is none."""
    try:
        with np.load(path) as file:
            columns = [file[name] for name in NAMES]
    except UNREADABLE as error:
        raise InputError(f"{path}: not frames of s2a pool ({error}); make the pool again with frames=8") from error
    return [PartPoints(*values) for values in zip(*columns, strict=True)]
