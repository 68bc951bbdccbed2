"""Colliders of the room that a world needs: those near the path of what moves, as many as physics can afford."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from pxr import Usd, UsdGeom, UsdPhysics
from scipy.spatial import ConvexHull, QhullError

_log = logging.getLogger(__name__)

MAX_STATIC = 64
"""Colliders of the room in a world besides its ground: each costs time even where nothing touches it (7 % of a step for 60)."""
LEVEL = 0.05
"""Rise of a floor over its width, at most."""
RAISED = 0.02
"""[m] Above a resting point, from where what carries it is looked for: hulls of scans overlap by millimetres."""
AROUND = 0.1
"""[m] Around a planned path: what the arm may touch as it follows it."""
BESIDE = 0.05
"""[m] What is so near to the path of what moves is needed though the arm does not reach it."""


FLAT = 1e-9
"""Slope of a face up to which it is upright."""


@dataclass(frozen=True)
class Workspace:
    """Where something can be touched.

    Attributes:
        points: of the paths of all that moves, and of the space between the robot's shoulder and them [m], shape [point 3].
        shoulder: of the robot [m], shape [3].
        reach: of its arm [m].
        planned: The points are of all that the arm, too, passes on a plan: what is around them matters most.
        resting: points of what is free to fall, where it stands [m], shape [point 3].
    """

    points: np.ndarray
    shoulder: np.ndarray
    reach: float
    planned: bool = False
    resting: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))

    @cached_property
    def _ball(self) -> tuple[np.ndarray, float]:
        """Centre [m] and radius [m] of a ball around the points."""
        center = (self.points.min(axis=0) + self.points.max(axis=0)) / 2.0
        return center, float(np.linalg.norm(self.points - center, axis=1).max())

    def may_need(self, planes: np.ndarray) -> bool:
        """Return False only where no point is as near to a hull, of planes [plane 4], as what a world may need."""
        center, radius = self._ball
        return _distance(center[None], planes) - radius <= max(AROUND, BESIDE)

    @classmethod
    def around(
        cls, paths: np.ndarray, held: np.ndarray, shoulder: np.ndarray, reach: float, resting: np.ndarray
    ) -> Workspace:
        """Return the workspace of a robot that leads grasp points `held` [point 3] while surfaces move along `paths`."""
        fraction = np.linspace(0.0, 1.0, 7)[:, None, None]
        arm = (shoulder + fraction * (held - shoulder)).reshape(-1, 3)
        return cls(np.concatenate([paths, arm]), shoulder, reach, resting=resting)

    def planned_along(self, points: np.ndarray, resting: np.ndarray) -> Workspace:
        """Return it with the points [point 3] that a plan passes, and those of what it puts somewhere [point 3]."""
        return replace(
            self,
            points=np.concatenate([self.points, points]),
            resting=np.concatenate([self.resting, resting]),
            planned=True,
        )


@dataclass(frozen=True)
class Missing:
    """Colliders that a world lacks though the arm can touch them.

    Attributes:
        room: the file.
        parts: ids of what they stand for, the nearest first.
        count: how many.
        distance: of the nearest from the path [m].
    """

    room: str
    parts: tuple[str, ...]
    count: int
    distance: float


def drop_far(stage: Usd.Stage, colliders: Sequence[Usd.Prim], space: Workspace, room: str) -> Missing | None:
    """Deactivate, in the stage's edit target, all colliders but the ground and the `MAX_STATIC` others that matter most.

    The ground is what carries anything that is free to fall, and every level structure below the robot's shoulder: without
    it what falls would fall forever. Of the others, what a plan passes comes first, then walls and ceiling, then what is
    nearest to the workspace. What is out of the arm's reach and off the path of all that moves is not needed.

    Args:
        stage: the world's stage.
        colliders: those of the static room and of frozen bodies.
        space: where something can be touched.
        room: the file, for messages.

    Returns:
        What is left out though the arm could touch it, or a plan passes it; None where there is none such.
    """
    planes = [_planes(prim) for prim in colliders]
    reached = np.array([_distance(space.shoulder[None], p) for p in planes]) <= space.reach
    distance = np.array(
        [_distance(space.points, p) if r or space.may_need(p) else np.inf for p, r in zip(planes, reached, strict=True)]
    )
    structure = np.array([bool(prim.GetAttribute("s2a:structure").Get()) for prim in colliders], bool)
    ground = _carrying(space.resting, planes)
    for k in np.flatnonzero(structure).tolist():
        ground[k] |= _is_floor(points_of(colliders[k]), space)
    needed = (reached | (distance <= BESIDE)) & ~ground
    first = (distance <= AROUND) & space.planned
    order = np.lexsort((distance, ~structure, ~first, ~needed))
    kept = ground.copy()
    kept[order[: min(int(needed.sum()), MAX_STATIC)]] = True
    for k in np.flatnonzero(~kept).tolist():
        colliders[k].SetActive(False)
    _log.info("%s: %d of %d static colliders are loaded", room, kept.sum(), len(colliders))
    missed = [k for k in order if not kept[k] and reached[k] and (first[k] or not space.planned)]
    if not missed:
        return None
    names = dict.fromkeys(str(colliders[k].GetAttribute("s2a:part").Get()) for k in missed)
    return Missing(room, tuple(names), len(missed), float(distance[missed].min()))


def warn(missing: Sequence[Missing | None]) -> None:
    """Write one warning of what the worlds of some stages lack, of that which lacks most."""
    found = [each for each in missing if each is not None]
    if found:
        most = max(found, key=lambda each: each.count)
        others = f" ({len(found)} of {len(missing)} stages lack some, this one most)" if len(missing) > 1 else ""
        _log.warning(
            "%s: %d colliders within the arm's reach are not loaded, because a world holds %d%s; nearest to the path, %.2f m "
            "from it: %s", most.room, most.count, MAX_STATIC, others, most.distance, ", ".join(most.parts[:8]),
        )  # fmt: skip


def static_colliders(stage: Usd.Stage, roots: Sequence[str]) -> list[Usd.Prim]:
    """Return the active colliders below some prims."""
    prims = (prim for root in roots if (top := stage.GetPrimAtPath(root)) for prim in Usd.PrimRange(top))
    return [prim for prim in prims if prim.HasAPI(UsdPhysics.CollisionAPI)]


def points_of(prim: Usd.Prim) -> np.ndarray:
    """Return a collider's points in the scene [m], shape [point 3]."""
    local = np.asarray(UsdGeom.PointBased(prim).GetPointsAttr().Get() or [], np.float64).reshape(-1, 3)
    matrix = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default()))
    return local @ matrix[:3, :3] + matrix[3, :3]


def _planes(prim: Usd.Prim) -> np.ndarray:
    """Return the planes of a collider's hull, outside where n.x + d > 0, shape [plane 4]; of its bounding box if it is flat."""
    points = points_of(prim)
    try:
        return ConvexHull(points).equations
    except (QhullError, ValueError):
        low, high = points.min(axis=0, initial=np.inf), points.max(axis=0, initial=-np.inf)
        return np.concatenate([np.c_[np.eye(3), -high], np.c_[-np.eye(3), low]])


def _distance(points: np.ndarray, planes: np.ndarray) -> float:
    """Return how far the nearest of some points [point 3] is from a hull [m], at least; 0 if one is inside."""
    return max(0.0, float((points @ planes[:, :3].T + planes[:, 3]).max(axis=1).min()))


def _carrying(points: np.ndarray, planes: Sequence[np.ndarray]) -> np.ndarray:
    """Return which hulls are the first below any of some points [point 3], shape [hull]."""
    found = np.zeros(len(planes), bool)
    if len(points) and len(planes):
        fall = np.stack([_fall(points + [0.0, 0.0, RAISED], p) for p in planes], axis=1)
        first = fall.argmin(axis=1)
        found[first[np.isfinite(fall.min(axis=1))]] = True
    return found


def _fall(points: np.ndarray, planes: np.ndarray) -> np.ndarray:
    """Return how far points [point 3] are above a hull [m], shape [point]; 0 within it, inf where they would miss it."""
    value, slope = points @ planes[:, :3].T + planes[:, 3], planes[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        at = value / slope
    enter = np.where(slope > FLAT, at, -np.inf).max(axis=1)
    leave = np.where(slope < -FLAT, at, np.inf).min(axis=1)
    beside = ((np.abs(slope) <= FLAT) & (value > 0.0)).any(axis=1)
    return np.where(beside | (enter > leave) | (leave < 0.0), np.inf, np.maximum(enter, 0.0))


def _is_floor(points: np.ndarray, space: Workspace) -> bool:
    """Return whether the points [point 3] of a structure's hull are of a level one below the shoulder."""
    size = np.ptp(points, axis=0)
    thickness = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][2]
    level = np.abs(thickness[2]) >= 1.0 / np.hypot(1.0, LEVEL) and size[2] < size[:2].min()
    return bool(level and points[:, 2].max() < space.shoulder[2])
