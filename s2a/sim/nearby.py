"""Which colliders of the room a world needs: those near the path of what moves, as many as physics can afford."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom, UsdPhysics
from scipy.spatial import ConvexHull, QhullError

_log = logging.getLogger(__name__)

MAX_STATIC = 64
"""Colliders of the room in a world: each costs time even where nothing touches it (7 % of a step for 60 of them)."""
AROUND = 0.1
"""[m] Around a planned path: what the arm may touch as it follows it."""
BESIDE = 0.05
"""[m] What is so near to the path of what moves is needed though the arm does not reach it."""


@dataclass(frozen=True)
class Workspace:
    """Where something can be touched.

    Attributes:
        points: of the paths of all that moves, and of the space between the robot's shoulder and them [m], shape [point 3].
        shoulder: of the robot [m], shape [3].
        reach: of its arm [m].
        planned: The points are of all that the arm, too, passes on a plan: what is around them matters most.
    """

    points: np.ndarray
    shoulder: np.ndarray
    reach: float
    planned: bool = False

    @classmethod
    def around(cls, paths: np.ndarray, held: np.ndarray, shoulder: np.ndarray, reach: float) -> Workspace:
        """Return the workspace of a robot that leads grasp points `held` [point 3] while surfaces move along `paths`."""
        fraction = np.linspace(0.0, 1.0, 7)[:, None, None]
        arm = (shoulder + fraction * (held - shoulder)).reshape(-1, 3)
        return cls(np.concatenate([paths, arm]), shoulder, reach)


def drop_far(stage: Usd.Stage, colliders: Sequence[Usd.Prim], space: Workspace, room: str) -> None:
    """Deactivate, in the stage's edit target, all but the `MAX_STATIC` colliders that matter most.

    What a plan passes comes first, then walls, floor and ceiling, then what is nearest to the workspace. What is out of the
    arm's reach and off the path of all that moves is not needed. Logs what is left out; warns where the arm could have
    touched it, or a plan passes it.

    Args:
        stage: the world's stage.
        colliders: those of the static room and of frozen bodies.
        space: where something can be touched.
        room: the file, for messages.
    """
    planes = [_planes(prim) for prim in colliders]
    distance = np.array([_distance(space.points, p) for p in planes])
    reached = np.array([_distance(space.shoulder[None], p) for p in planes]) <= space.reach
    structure = np.array([bool(prim.GetAttribute("s2a:structure").Get()) for prim in colliders], bool)
    needed = reached | (distance <= BESIDE)
    first = (distance <= AROUND) & space.planned
    order = np.lexsort((distance, ~structure, ~first, ~needed))
    count = min(int(needed.sum()), MAX_STATIC)
    kept, left = order[:count], order[count:]
    for k in left:
        colliders[k].SetActive(False)
    missed = [k for k in left if reached[k] and (first[k] or not space.planned)]
    _log.info("%s: %d of %d static colliders are loaded", room, len(kept), len(colliders))
    if missed:
        names = dict.fromkeys(str(colliders[k].GetAttribute("s2a:part").Get()) for k in missed)
        _log.warning(
            "%s: %d colliders within the arm's reach are not loaded, because a world holds %d; nearest to the path, %.2f m from "
            "it: %s", room, len(missed), MAX_STATIC, distance[missed].min(), ", ".join(list(names)[:8]),
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
