"""The pose of an object on a region.

The object's own frame: upright, standing on z = 0, front towards +x, metres. Places come from a search over the grid of the
region (`search`); the best are tried in turn: the object is lowered (or pushed against the wall) until it touches, and
kept if no triangle of it cuts anything, nothing is within anything, and every drawer and door can still open.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.errors import InputError
from s2a.geometry.regions import Region
from s2a.insert.place.baseline import PaperConfig
from s2a.insert.place.fit import COLLISION, NoRoom, Pose, moved_into_contact, placement_conflict
from s2a.insert.place.lean import LEAN, leaned, slender
from s2a.insert.place.preferences import preferences
from s2a.insert.place.search import GridCandidate, SearchConfig, grid_candidates, occupancy_grid
from s2a.insert.place.supports import facing, flat_things, nearby
from s2a.insert.place.swept_volumes import SweptVolume, reaching_into
from s2a.ranges import Count, NotNegative
from s2a.scene import Mesh, Scene

Relation = Literal["on", "in", "against", "hanging"]


@dataclass(frozen=True)
class PoseConfig:
    """Search for poses.

    Attributes:
        pose: "search" ranks all placements on a grid; "paper" shifts the object at random until nothing collides.
        search: the grid search.
        paper: the baseline.
        attempts: candidates that are tested exactly.
        alternatives: free poses on one region that are offered, in case that the object does not stay at the first ones.
        min_spacing: smallest distance of a candidate from those that failed, as a fraction of the object's radius.
        back_gap: gap between the object's back and what it is against [m].
        contact_gap: gap between the object and what it touches [m].
        slide: way that what stands against something may slide back to it [m].
        lowering_height: height above the region from which the object is lowered [m].
        swept_volume_tolerance: how far the object may reach into a swept volume, whose surface is noisy [m].
    """

    pose: Literal["search", "paper"]
    search: SearchConfig
    paper: PaperConfig
    attempts: Count
    alternatives: Count
    min_spacing: NotNegative
    back_gap: NotNegative
    contact_gap: NotNegative
    slide: NotNegative
    lowering_height: NotNegative
    swept_volume_tolerance: NotNegative


def place(
    scene: Scene,
    object: Mesh,
    region: Region,
    relation: Relation,
    config: PoseConfig,
    target: str,
    volumes: list[SweptVolume],
    near: str | None = None,
) -> Pose:
    """Return the best pose of an object on a region: the first of `places`."""
    return next(places(scene, object, region, relation, config, target, volumes, near))


def places(
    scene: Scene,
    object: Mesh,
    region: Region,
    relation: Relation,
    config: PoseConfig,
    target: str,
    volumes: list[SweptVolume],
    near: str | None = None,
    keep: Callable[[np.ndarray], np.ndarray] | None = None,
) -> Iterator[Pose]:
    """Yield free poses of an object on a region, the best first, one at least.

    Args:
        scene: the room.
        object: upright, standing on z = 0, front towards +x, in metres.
        region: a support region of the target.
        relation: "on" or "in" stands, "against" stands with its back to something, "hanging" hangs on a vertical region.
        config: settings of the search.
        target: id of the part that the region belongs to.
        volumes: swept volumes of the room's drawers and doors, kept free.
        near: id of the preferred neighbour, or None.
        keep: of places [m], shape [place 3], those that a wish allows, shape [place]; None for all.

    Raises:
        NoRoom: no pose is free.
        InputError: a relation that the region does not support.
    """
    if (relation == "hanging") != (region.kind == "vertical"):
        raise InputError(f"relation {relation!r} on a region of kind {region.kind!r}; only hanging goes with vertical")
    base, radius, height = _frame(scene, object, region, target)
    low, high = _box(region, radius, height)
    volumes = reaching_into(volumes, low, high, scene, target)
    obstacles = [*(part.mesh for part in scene.parts.values()), *flat_things(scene, target)]
    grid = occupancy_grid(region, radius, height, obstacles, volumes, config.search)
    tall = float(np.ptp(object.bounds[:, 2]))
    wanted = preferences(scene, region, target, relation == "against", near, tall, config.search.habits)
    found = grid_candidates(grid, region, object, base, wanted, config.search, keep)
    if not found:
        raise NoRoom(_why(region, object))
    task = _Task(scene, object, region, relation, config, base, volumes)
    yield from _free(task, found, max(2.0, config.min_spacing * radius / region.cell), target)


def _free(task: _Task, found: list[GridCandidate], spacing: float, target: str) -> Iterator[Pose]:
    """Yield the free poses among candidates, some cells [cell] apart, one at least."""
    conflicts: list[str] = []
    good = 0
    for number, candidate in enumerate(_spread(found, spacing, task.config.attempts), start=1):
        pose, conflict = _refined(task, candidate, number)
        if conflict is not None:
            conflicts.append(conflict)
            continue
        yield pose
        good += 1
        if good == task.config.alternatives:
            return
    if not good:
        worst = max(set(conflicts), key=conflicts.count)
        height = task.region.height
        raise NoRoom(f"none of {len(conflicts)} places on {target!r} at {height:.2f} m is free: most {worst}")


def _frame(scene: Scene, object: Mesh, region: Region, target: str) -> tuple[np.ndarray, float, float]:
    """Return the rotation from the object's frame to the region's, and the object's radius and height there [m]."""
    if region.kind == "vertical":
        base = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    else:
        front = facing(scene, target, region) @ region.axes[:, :2]
        x, y = front / np.linalg.norm(front)
        base = np.array([[x, -y, 0.0], [y, x, 0.0], [0.0, 0.0, 1.0]])
    local = object.vertices @ base.T
    return base, float(np.linalg.norm(local[:, :2], axis=1).max()), float(np.ptp(local[:, 2]))


def _box(region: Region, radius: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the box in the scene that an object on a region may reach [m]."""
    rows, columns = region.support.shape
    corners = region.points(np.array([(0, 0), (rows, 0), (0, columns), (rows, columns)]))
    corners = np.concatenate([corners, corners + height * region.normal])
    return corners.min(axis=0) - radius - 0.05, corners.max(axis=0) + radius + 0.05


def _spread(found: list[GridCandidate], apart: float, count: int) -> Iterator[GridCandidate]:
    """Yield candidates best first, some cells apart from all earlier ones: what failed there fails next to it, too."""
    left, places = found, np.array([one.place for one in found])
    for _ in range(count):
        if not left:
            return
        first = left[0]
        yield first
        far = np.linalg.norm(places - first.place, axis=1) >= apart
        left, places = [one for one, stays in zip(left, far, strict=True) if stays], places[far]


@dataclass(frozen=True)
class _Task:
    """Inputs of the exact tests, as `place` has them; `base` rotates from the object's frame to the region's."""

    scene: Scene
    object: Mesh
    region: Region
    relation: Relation
    config: PoseConfig
    base: np.ndarray
    volumes: list[SweptVolume]


def _refined(task: _Task, candidate: GridCandidate, number: int) -> tuple[Pose, str | None]:
    """Return the exact pose of a candidate, and the conflict there or None; what would fall over leans if it may."""
    if task.relation == "against" and slender(task.object):
        pose, conflict = _touching(task, candidate, number, lean=True)
        if conflict is None:
            return pose, None
    return _touching(task, candidate, number, lean=False)


def _touching(task: _Task, candidate: GridCandidate, number: int, lean: bool) -> tuple[Pose, str | None]:
    """Return the pose of a candidate lowered, or pushed, until it touches, and the conflict there or None."""
    scene, object, region, config = task.scene, task.object, task.region, task.config
    toward = -region.normal if region.kind == "vertical" else np.array([0.0, 0.0, -1.0])
    turn = _turn(region, task.base, candidate.turn)
    turn = leaned(turn) if lean else turn
    start = _start(task, candidate, turn, toward, number)
    if lean:
        # The search found room for it upright; its top is not to begin in the wall.
        forward = turn @ np.array([1.0, 0.0, 0.0]) * (1.0, 1.0, 0.0)
        away = float(np.ptp(object.bounds[:, 2])) * float(np.sin(LEAN)) * forward / np.linalg.norm(forward)
        start = replace(start, position=tuple((np.array(start.position) + away).tolist()))
    against = task.relation == "against"
    reach = config.slide if against else 2 * config.lowering_height
    local = nearby(scene, *_grown(start.moved(object).bounds, reach + 0.01))
    pose = moved_into_contact(start, object, local, toward, 2 * config.lowering_height, config.contact_gap)
    if pose is None:
        return start, "carry nothing"
    if against:
        pose = _slid_back(task, pose, local, turn, config.back_gap)
        if pose is None:
            return start, "have nothing behind them"
    for _ in range(4):
        pose = pose.rounded()
        conflict = placement_conflict(scene, pose.moved(object), local, task.volumes, config.swept_volume_tolerance)
        if conflict != COLLISION:
            break
        # Between two edges the distance may be shorter than from any point that was queried.
        pose = replace(pose, position=tuple((np.array(pose.position) - config.contact_gap * toward).tolist()))
    return pose, conflict


def _slid_back(task: _Task, pose: Pose, local: Mesh, turn: np.ndarray, gap: float) -> Pose | None:
    """Return a standing pose moved back until it almost touches; None if there is nothing behind it."""
    # Off the floor, over whose bumps it would stumble.
    up = np.array([0.0, 0.0, task.config.lowering_height])
    lifted = replace(pose, position=tuple((np.array(pose.position) + up).tolist()))
    back = turn @ np.array([-1.0, 0.0, 0.0]) * (1.0, 1.0, 0.0)
    behind = moved_into_contact(lifted, task.object, local, back / np.linalg.norm(back), task.config.slide, gap)
    if behind is None:
        return None
    down, reach = np.array([0.0, 0.0, -1.0]), 3 * task.config.lowering_height
    return moved_into_contact(behind, task.object, local, down, reach, task.config.contact_gap)


def _start(task: _Task, candidate: GridCandidate, turn: np.ndarray, toward: np.ndarray, number: int) -> Pose:
    """Return the pose above a candidate from which the object is lowered."""
    lowest = float((task.object.vertices @ turn.T @ -toward).min())
    start = task.region.points(candidate.place[None])[0] + (lowest - task.config.lowering_height) * toward
    quaternion = tuple(Rotation.from_matrix(turn).as_quat().tolist())
    return Pose(tuple(start.tolist()), quaternion, candidate.room, number)


def _turn(region: Region, base: np.ndarray, turn: float) -> np.ndarray:
    """Return the rotation from the object's frame to the scene's, upright whatever the slope of the region, shape [3 3]."""
    front = region.axes @ base @ np.array([np.cos(turn), np.sin(turn), 0.0])
    yaw = np.arctan2(front[1], front[0])
    return Rotation.from_euler("z", yaw).as_matrix()


def _why(region: Region, object: Mesh) -> str:
    """Return the message for a region without any candidate."""
    size = " x ".join(f"{extent:.2f}" for extent in np.ptp(object.bounds, axis=0))
    room = " x ".join(f"{extent:.2f}" for extent in region.size)
    return (
        f"an object of {size} m finds no place on a {region.kind} region of {room} m at {region.height:.2f} m with"
        f" {region.free_area:.3f} m^2 free and {region.clearance:.2f} m of room; choose another region or a smaller object"
    )


def _grown(bounds: np.ndarray, margin: float) -> np.ndarray:
    return bounds + np.array([[-margin], [margin]])
