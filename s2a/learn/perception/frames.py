"""Frames of parts: taken of a room's visuals, and kept beside a pool's other files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from s2a.core.cache import UNREADABLE
from s2a.core.errors import InputError
from s2a.learn.perception.cloud import PartPoints, sample
from s2a.learn.perception.depth_camera import DepthCameraConfig, capture
from s2a.learn.perception.visible_room import VisibleRoom
from s2a.sim.world import SimStage

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
