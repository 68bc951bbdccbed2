"""The exact pose of a candidate: lowered or pushed until it touches, leaned or slid back, and tested for conflicts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.core.bounds import Count, NotNegative
from s2a.language.insert.place.fit import COLLISION, Pose, SweptVolume, moved_into_contact, placement_conflict
from s2a.language.insert.place.search import GridCandidate, SearchConfig
from s2a.language.insert.place.stable_pose import LEAN, leaned, slender
from s2a.language.insert.place.supports import PaperConfig, nearby
from s2a.scene.geometry.regions import Region
from s2a.scene.scene import Mesh, Scene

Relation = Literal["on", "in", "against", "hanging"]
SQUARELY, FACING, LARGE = 10.0, 45.0, 0.25
"""Largest turns from the front of a support of what is longer than `LARGE` [m] and of what is not [deg]."""
SLIDES = (1.0, 0.9, 0.8, 0.6, 0.4, 0.2)
"""Fractions of the way back that are tried."""
DROPPED = 0.006
"""From so much lower than before, what slid back is over the edge of its support [m]."""


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


@dataclass(frozen=True)
class ContactQuery:
    """Inputs of the exact tests, as `place` has them; `base` rotates from the object's frame to the region's."""

    scene: Scene
    object: Mesh
    region: Region
    relation: Relation
    config: PoseConfig
    base: np.ndarray
    volumes: list[SweptVolume]


def facing_first(object: Mesh, config: PoseConfig, anyhow: bool) -> tuple[PoseConfig, ...]:
    """Return settings with the turns at which an object faces as its support does, then with all.

    Large ones stand squarely, and turn their side or back to the room only `anyhow`.
    """
    large = np.ptp(object.bounds, axis=0)[:2].max() > LARGE
    most = SQUARELY if large else FACING
    turns = tuple(turn for turn in config.search.turns if abs(turn) <= most)
    if config.pose != "search" or not turns or len(turns) == len(config.search.turns):
        return (config,)
    facing = replace(config, search=replace(config.search, turns=turns))
    return (facing, config) if anyhow or not large else (facing,)


def refined(query: ContactQuery, candidate: GridCandidate, number: int) -> tuple[Pose, str | None]:
    """Return the exact pose of a candidate, and the conflict there or None; what would fall over leans if it may."""
    if query.relation == "against" and slender(query.object):
        pose, conflict = _touching(query, candidate, number, lean=True)
        if conflict is None:
            return pose, None
    return _touching(query, candidate, number, lean=False)


def _touching(query: ContactQuery, candidate: GridCandidate, number: int, lean: bool) -> tuple[Pose, str | None]:
    """Return the pose of a candidate lowered, or pushed, until it touches, and the conflict there or None."""
    scene, object, region, config = query.scene, query.object, query.region, query.config
    toward = -region.normal if region.kind == "vertical" else np.array([0.0, 0.0, -1.0])
    turn = _turn(region, query.base, candidate.turn)
    turn = leaned(turn) if lean else turn
    start = _start(query, candidate, turn, toward, number)
    if lean:
        # The search found room for it upright; its top is not to begin in the wall.
        forward = turn @ np.array([1.0, 0.0, 0.0]) * (1.0, 1.0, 0.0)
        away = float(np.ptp(object.bounds[:, 2])) * float(np.sin(LEAN)) * forward / np.linalg.norm(forward)
        start = replace(start, position=tuple((np.array(start.position) + away).tolist()))
    against = query.relation == "against"
    reach = config.slide if against else 2 * config.lowering_height
    local = nearby(scene, *_grown(start.moved(object).bounds, reach + 0.01))
    pose = moved_into_contact(start, object, local, toward, 2 * config.lowering_height, config.contact_gap)
    if pose is None:
        return start, "carry nothing"
    if against:
        pose = _slid_back(query, pose, local, turn, config.back_gap)
        if pose is None:
            return start, "have nothing behind them"
    for _ in range(4):
        pose = pose.rounded()
        conflict = placement_conflict(scene, pose.moved(object), local, query.volumes, config.swept_volume_tolerance)
        if conflict != COLLISION:
            break
        # Between two edges the distance may be shorter than from any point that was queried.
        pose = replace(pose, position=tuple((np.array(pose.position) - config.contact_gap * toward).tolist()))
    return pose, conflict


def _slid_back(query: ContactQuery, pose: Pose, local: Mesh, turn: np.ndarray, gap: float) -> Pose | None:
    """Return a standing pose moved back until it almost touches; None if there is nothing behind it.

    A wall behind a chest of drawers may be beyond the edge of that: what slides back stops before it drops.
    """
    # Off the floor, over whose bumps it would stumble.
    up = np.array([0.0, 0.0, query.config.lowering_height])
    lifted = replace(pose, position=tuple((np.array(pose.position) + up).tolist()))
    back = turn @ np.array([-1.0, 0.0, 0.0]) * (1.0, 1.0, 0.0)
    behind = moved_into_contact(lifted, query.object, local, back / np.linalg.norm(back), query.config.slide, gap)
    if behind is None:
        return None
    down, reach = np.array([0.0, 0.0, -1.0]), 3 * query.config.lowering_height
    for fraction in SLIDES:
        between = (1 - fraction) * np.array(lifted.position) + fraction * np.array(behind.position)
        back_there = replace(behind, position=tuple(between.tolist()))
        low = moved_into_contact(back_there, query.object, local, down, reach, query.config.contact_gap)
        if low is not None and low.position[2] > pose.position[2] - DROPPED:
            return low
    return None


def _start(query: ContactQuery, candidate: GridCandidate, turn: np.ndarray, toward: np.ndarray, number: int) -> Pose:
    """Return the pose above a candidate from which the object is lowered."""
    lowest = float((query.object.vertices @ turn.T @ -toward).min())
    start = query.region.points(candidate.place[None])[0] + (lowest - query.config.lowering_height) * toward
    quaternion = tuple(Rotation.from_matrix(turn).as_quat().tolist())
    return Pose(tuple(start.tolist()), quaternion, candidate.room, number)


def _turn(region: Region, base: np.ndarray, turn: float) -> np.ndarray:
    """Return the rotation from the object's frame to the scene's, upright whatever the slope of the region, shape [3 3]."""
    front = region.axes @ base @ np.array([np.cos(turn), np.sin(turn), 0.0])
    yaw = np.arctan2(front[1], front[0])
    return Rotation.from_euler("z", yaw).as_matrix()


def _grown(bounds: np.ndarray, margin: float) -> np.ndarray:
    return bounds + np.array([[-margin], [margin]])
