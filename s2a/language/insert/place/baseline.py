"""The baseline's pose: the middle of a plane's points plus half the object, then random offsets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.core.ranges import Count, CountFromZero, NotNegative
from s2a.language.insert.place.fit import NoRoom, Pose
from s2a.language.insert.place.supports import nearby
from s2a.scene.geometry.penetration import crossing
from s2a.scene.geometry.planes import Plane
from s2a.scene.scene import Mesh, Scene


@dataclass(frozen=True)
class PaperConfig:
    """The baseline's random offsets.

    Attributes:
        attempts: number of random offsets.
        spread: standard deviation of the first offset [m]; it grows linearly with the attempts, up to ten times this.
        seed: of the offsets.
    """

    attempts: Count
    spread: NotNegative
    seed: CountFromZero


def place_paper(scene: Scene, object: Mesh, plane: Plane, inliers: np.ndarray, config: PaperConfig) -> Pose:
    """Return the baseline's pose: the mean of the plane's points plus half the object, shifted until nothing collides.

    Half the object is half its extent along the normal. Offsets are random, until no triangle of the object cuts anything;
    it is not turned, and nothing asks what carries it.

    Args:
        scene: the room.
        object: upright, standing on z = 0, in metres.
        plane: from `s2a.scene.geometry.ransac`.
        inliers: the plane's points [m], shape [point 3].
        config: number and spread of the offsets.

    Raises:
        NoRoom: every offset collides.
    """
    middle = object.bounds.mean(axis=0)
    half = float(np.ptp(object.vertices @ plane.normal) / 2)
    start = inliers.mean(axis=0) + half * plane.normal - middle
    random = np.random.default_rng(config.seed)
    for number in range(config.attempts):
        spread = config.spread * min(10.0, number / 10)
        pose = Pose(tuple(start + random.normal(size=3) * spread), (0.0, 0.0, 0.0, 1.0), 0.0, number + 1)
        moved = pose.moved(object)
        if crossing(moved, nearby(scene, *moved.bounds)) is None:
            return pose.rounded()
    raise NoRoom(f"all of {config.attempts} random offsets collide; give surface=regions pose=search")
