"""Where a robot may stand before a handle, and the pose of its base there."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.prepare.grasp import floor_height, floor_points, heading, lowest_point
from s2a.prepare.obstacles import Obstacles
from s2a.robot.spec import RobotSpec
from s2a.scan.evidence.floor import FloorConfig, floor_fraction
from s2a.scene.geometry.convex import column, overlap
from s2a.scene.scene import Mesh, Scene


@dataclass(frozen=True)
class Candidate:
    """A candidate: distance and offset to the side [m], height of the pedestal [m], turn [rad]."""

    distance: float
    side: float
    pedestal: float
    turn: float = 0.0

    @property
    def standing(self) -> Candidate:
        """The same place, facing the handle."""
        return replace(self, turn=0.0)

    def __str__(self) -> str:
        words = [f"{self.distance:.2f} m before the handle"]
        words += [f"{abs(self.side):.2f} m to its {'left' if self.side > 0 else 'right'}"] if self.side else []
        words += [f"on a pedestal of {self.pedestal:.2f} m"] if self.pedestal else ["on the floor"]
        words += [f"turned by {math.degrees(self.turn):.0f} degrees"] if self.turn else []
        return ", ".join(words)


def candidates(distances: Sequence[float], sides: Sequence[float], pedestals: Sequence[float]) -> list[Candidate]:
    """Return all combinations [m], in the order of how far they are from the preferred one."""
    places = [Candidate(*p) for p in itertools.product(distances, sides, pedestals)]
    return sorted(places, key=lambda p: abs(p.distance - distances[0]) + abs(p.side) + 0.5 * p.pedestal)


class Ground:
    """The floor before a handle, and where on it a base can stand."""

    def __init__(
        self,
        scene: Scene,
        target: str,
        point: np.ndarray,
        near: Obstacles,
        swept: Sequence[Mesh],
        known: FloorConfig,
        robot: RobotSpec,
    ) -> None:
        """Take the floor before the handle of a target at a point [m], shape [3]; `swept` is where the target opens."""
        self._point, self._ahead = point, heading(scene, target)
        floor = floor_points(scene)
        self._asks_floor = len(floor) > 0
        self._floor = floor if self._asks_floor else lowest_point(scene)
        self._near, self._swept, self._known, self._body = near, swept, known, robot.base

    def base(self, place: Candidate) -> np.ndarray:
        """Return the pose of the base at a place, facing the handle, shape [4 4], scene frame."""
        left = np.array([-self._ahead[1], self._ahead[0]])
        position = self._point[:2] - place.distance * self._ahead + place.side * left
        towards = self._point[:2] - position
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_euler("z", math.atan2(towards[1], towards[0])).as_matrix()
        pose[:3, 3] = [*position, floor_height(self._floor, position) + place.pedestal]
        return pose

    def taken(self, base: np.ndarray, place: Candidate) -> str | None:
        """Return why a base [4 4] cannot stand at a place, or None if it can."""
        body, foot = self._body, base[:3, 3]
        floor = foot[2] - place.pedestal
        low, high = floor + 0.05 + body.radius, foot[2] + body.shoulder_height
        standing = self._near.standing_in(foot[:2], low, high, body.radius)
        if standing is not None:
            return f"{standing} stands where the base has to stand"
        if self._asks_floor and not self._on_floor(foot, place):
            return "no floor was scanned there"
        height = place.pedestal + body.shoulder_height + body.upper_arm
        trunk = column(np.array([*foot[:2], floor]), body.radius, height)
        opens_into = any(overlap(trunk, piece) > 1e-3 for piece in self._swept)
        return "the part would open into the base" if opens_into else None

    def _on_floor(self, foot: np.ndarray, place: Candidate) -> bool:
        """Return True if there is scanned floor below a base [3]; `s2a certify` asks the same."""
        below = floor_fraction(foot, place.pedestal, self._body.radius, self._near.surface, self._known.tolerance)
        return below >= self._known.min_fraction


def turned(base: np.ndarray, turn: float, shoulder: np.ndarray) -> np.ndarray:
    """Return a base turned about its arm's vertical first axis, through a point [3] of its frame."""
    pose = base.copy()
    pose[:3, :3] = base[:3, :3] @ Rotation.from_euler("z", turn).as_matrix()
    pose[:3, 3] += (base[:3, :3] - pose[:3, :3]) @ shoulder
    return pose
