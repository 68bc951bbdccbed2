"""What a page plays: how robots, joints and free objects of several worlds moved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from s2a.scene.scene import Mesh


@dataclass(frozen=True)
class PlayedWorld:
    """One world.

    Attributes:
        name: what the page calls it.
        q: joint coordinates by part [m] or [rad], shape [frame].
        moved: displacement of each free object by its id: scene pose = displacement @ scanned pose, shape [frame 4 4].
        links: poses of the robot's links: position [m], quaternion xyzw, scene frame, shape [frame link 7].
    """

    name: str
    q: Mapping[str, np.ndarray]
    moved: Mapping[str, np.ndarray]
    links: np.ndarray

    @property
    def frames(self) -> int:
        """Number of frames; the last one stays."""
        return len(self.links)


@dataclass(frozen=True)
class Played:
    """Worlds that are shown side by side.

    Attributes:
        rate: frames a second.
        links: surfaces of the robot's links, each in its own frame.
        worlds: all of them are in the same room.
    """

    rate: float
    links: tuple[Mesh, ...]
    worlds: tuple[PlayedWorld, ...]

    @property
    def frames(self) -> int:
        """Number of frames of the longest."""
        return max(world.frames for world in self.worlds)
