"""The candidate pose at which an object stays, or the pose in which it comes to rest."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import groupby
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.language.insert.place.candidate_poses import CandidatePose
from s2a.language.insert.place.contact import PoseConfig
from s2a.language.insert.place.fit import COLLISION, Pose, moved_into_contact, placement_conflict, reaching_into
from s2a.language.insert.place.supports import nearby
from s2a.language.insert.room_state import RoomState
from s2a.scene.scene import Mesh

UP_HOLDS = np.radians(15.0)
"""Largest tilt at which what rests still has its up [rad]."""
STRAYED = 0.15
"""Largest way from where it was put to where it rests [m]."""
LIFT = 0.003
"""Height from which it is put down again [m]."""
DOWN = np.array([0.0, 0.0, -1.0])


def stable_pose(
    room: RoomState,
    object: Mesh,
    found: Iterable[CandidatePose],
    check: Callable[[CandidatePose], dict[str, Any]],
    accept: Callable[[CandidatePose], str],
    config: PoseConfig,
    reasons: list[str],
) -> CandidatePose | None:
    """Return the first candidate pose at which an object stays; on each support, failing that, one in which it rests.

    Args:
        room: the room.
        object: upright, in metres.
        found: the candidate poses, those of one support after each other.
        check: the drop test; its results have `problem`, and `rest` where the object came to rest elsewhere.
        accept: the objection to a pose whose object stays, such as an unheeded wish; empty if there is none.
        config: of the search.
        reasons: receives why candidates were passed over, one line a support.
    """
    for _, group in groupby(found, key=lambda one: (one.target, one.choice, one.surface.get("height"))):
        resting: list[CandidatePose] = []
        problems: list[str] = []
        for candidate in group:
            result = check(candidate)
            problem = result["problem"] or accept(candidate)
            if not problem:
                return candidate
            problems.append(problem)
            rest = result.get("rest") if result["problem"] else None
            if rest is not None and candidate.choice.relation != "hanging":
                resting.append(at_rest(candidate, rest))
        for candidate in resting:
            again = put_down(room, object, candidate, config)
            if again is None:
                continue
            result = check(again)
            if not (result["problem"] or accept(again)):
                return again
        worst = max(set(problems), key=problems.count)
        count = f" at all {len(problems)} places" if len(problems) > 1 else ""
        reasons.append(f"{candidate.choice.relation} {candidate.target}: {worst}{count}")
    return None


def rests_upright(tilt: float, drift: float) -> bool:
    """Return True if an object that came to rest, tilted by some [rad] and off by some [m], is as it was meant."""
    return tilt <= UP_HOLDS and drift <= STRAYED


def at_rest(candidate: CandidatePose, rest: dict[str, Any]) -> CandidatePose:
    """Return a candidate at the pose in which its object came to rest.

    Args:
        candidate: where it was put.
        rest: `about`, the point [m] about which it turned; `turn`, xyzw; `shift` of that point [m].
    """
    turn, about = Rotation.from_quat(rest["turn"]), np.array(rest["about"])
    position = about + rest["shift"] + turn.apply(np.array(candidate.pose.position) - about)
    quaternion = (turn * Rotation.from_quat(candidate.pose.quaternion)).as_quat()
    pose = replace(candidate.pose, position=tuple(position.tolist()), quaternion=tuple(quaternion.tolist()))
    return replace(candidate, pose=pose)


def put_down(room: RoomState, object: Mesh, candidate: CandidatePose, config: PoseConfig) -> CandidatePose | None:
    """Return a resting candidate lifted out of what it sank into and lowered again; None if it is in conflict there."""
    lifted = replace(candidate.pose, position=tuple((np.array(candidate.pose.position) - LIFT * DOWN).tolist()))
    low, high = lifted.moved(object).bounds + [[-0.05], [0.05]]
    local = nearby(room.scene, low, high)
    pose: Pose | None = moved_into_contact(lifted, object, local, DOWN, 4 * LIFT, config.contact_gap)
    if pose is None:
        return None
    volumes = reaching_into(room.volumes, low, high, room.scene, candidate.target)
    for _ in range(6):
        pose = pose.rounded()
        conflict = placement_conflict(room.scene, pose.moved(object), local, volumes, config.swept_volume_tolerance)
        if conflict is None:
            return replace(candidate, pose=pose)
        if conflict != COLLISION:
            return None
        pose = replace(pose, position=tuple((np.array(pose.position) - config.contact_gap * DOWN).tolist()))
    return None
