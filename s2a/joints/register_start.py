"""Joints that could have brought a flat patch of the closed scan to one of the open scan, by how much surface they explain."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from s2a.joints.register_change import SPACING, Patch, connected
from s2a.joints.register_surface import Cloud, OrientedMesh, match
from s2a.scene.articulation import transform
from s2a.scene.scene import Joint

PARALLEL = np.radians(4.0)
"""[rad] Patches at a smaller angle are parallel: what is between them is a slide."""
MIN_SLIDE = 0.04
"""[m] A slide is longer."""
MAX_SLIDE = 1.2
"""[m] And shorter."""
MAX_TURN = 2.6
"""[rad] A hinge turns less."""
UPRIGHT = 0.9
"""Cosine to the vertical beyond which nothing slides: what seems to is a floor below something that opened over it."""
NEAR_AXIS = 0.12
"""[m] A hinge is not farther from the patch that it turns."""
SETBACKS = np.arange(-0.06, 0.0601, 0.01)
"""[m] How far a hinge may lie behind the crossing of both planes, or before it."""
REACH = 0.025
"""[m] A moved point explains surface within this distance."""
ALIKE = 0.8
"""Cosine between normals from which it does."""
POINTS = 400
"""Points of a patch that are tried."""
MIN_FRACTION = 0.2
"""Fraction of a patch that a joint has to explain, or MIN_FRONT of it: a drawer's front beside a door's in one plane."""
MIN_FRONT = 0.02
"""[m^2] Smallest front."""


@dataclass(frozen=True, eq=False)
class Start:
    """A joint that could be.

    Attributes:
        joint: in the closed scan's frame, its limits from 0 to the coordinate of the open scan.
        patch: index of the closed patch.
        area: surface that it explains [m^2].
        fraction: of the patch.
    """

    joint: Joint
    patch: int
    area: float
    fraction: float

    @property
    def q(self) -> float:
        """Coordinate in the open scan [m] or [rad]."""
        return self.joint.limits[1]


def starts(closed: list[Patch], opened: list[Patch], surface: OrientedMesh) -> list[Start]:
    """Return the joints that explain enough of a patch, the most surface first.

    Args:
        closed: patches that only the closed scan shows.
        opened: patches that only the open scan shows.
        surface: what only the open scan shows, all of it.
    """
    found = []
    for index, patch in enumerate(closed):
        cloud = patch.cloud[np.linspace(0, len(patch.cloud) - 1, min(POINTS, len(patch.cloud))).astype(int)]
        for other in opened:
            best = None
            for joint in _joints(patch, other):
                fraction = explained(cloud, surface, joint)
                if fraction >= min(MIN_FRACTION, MIN_FRONT / patch.area) and (best is None or fraction > best.fraction):
                    best = Start(joint, index, fraction * patch.area, fraction)
            if best is not None:
                found.append(best)
    return sorted(found, key=lambda start: -start.area)


def front_of(start: Start, patch: Patch, surface: OrientedMesh) -> Patch:
    """Return what a joint explains of a patch, its largest connected piece: fronts beside each other in a plane come as one."""
    found = match(patch.cloud.moved(transform(start.joint, start.q)), surface, REACH)
    pieces = connected(patch.cloud[found.alike > ALIKE], int(MIN_FRONT / SPACING**2))
    return max(pieces, key=lambda piece: piece.area) if pieces else patch


def explained(cloud: Cloud, surface: OrientedMesh, joint: Joint) -> float:
    """Return how well moved points lie on a surface: 1 if all do exactly, 0 if none is within REACH."""
    found = match(cloud.moved(transform(joint, joint.limits[1])), surface, REACH)
    worth = np.where(found.alike > ALIKE, 1.0 - (np.minimum(found.gap, REACH) / REACH) ** 2, 0.0)
    return float(worth.mean())


def _joints(patch: Patch, other: Patch) -> Iterator[Joint]:
    """Yield joints that take the plane of a patch to that of another."""
    axis = np.cross(patch.normal, other.normal)
    sine, cosine = float(np.linalg.norm(axis)), float(patch.normal @ other.normal)
    if np.arctan2(sine, cosine) < PARALLEL:
        way = float((other.centre - patch.centre) @ patch.normal)
        if MIN_SLIDE < abs(way) < MAX_SLIDE and abs(patch.normal[2]) < UPRIGHT:
            direction = np.sign(way) * patch.normal
            yield _slide(direction, patch.centre, abs(way))
        return
    axis /= sine
    angle = float(np.arctan2(sine, cosine))
    bisector = patch.normal + other.normal
    length = float(np.linalg.norm(bisector))
    if angle > MAX_TURN:
        return
    planes = np.stack([patch.normal, other.normal, axis])
    offsets = np.array([patch.normal @ patch.centre, other.normal @ other.centre, axis @ patch.centre])
    crossing = np.linalg.solve(planes, offsets)
    for setback in SETBACKS:
        origin = crossing - setback * bisector / length
        if _distance(patch.cloud.points, axis, origin) < NEAR_AXIS:
            yield Joint("revolute", tuple(axis), tuple(origin), (0.0, angle))


def _slide(direction: np.ndarray, centre: np.ndarray, q: float) -> Joint:
    return Joint("prismatic", tuple(direction / np.linalg.norm(direction)), tuple(centre), (0.0, q))


def _distance(points: np.ndarray, axis: np.ndarray, origin: np.ndarray) -> float:
    """Return the distance from a line to the nearest of some points [m]."""
    return float(np.linalg.norm(np.cross(axis, points - origin), axis=1).min())
