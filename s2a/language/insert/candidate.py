"""The candidate pose of a plan at which an object stays: squarely and where the plan has it, if there is room so."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from s2a.language.insert.context import InsertConfig, InsertContext
from s2a.language.insert.place.candidate_poses import CandidatePose, Keep, candidate_poses
from s2a.language.insert.place.contact import PoseConfig, facing_first
from s2a.language.insert.place.fit import NoRoom
from s2a.language.insert.plan import Plan
from s2a.language.insert.room_state import RoomState
from s2a.language.insert.settle import stable_pose
from s2a.language.insert.wishes.heed import allowed, objection, planned_place
from s2a.language.insert.wishes.parse import Wish
from s2a.language.llm.usage_log import Record, step
from s2a.scene.scene import Mesh


def stable_candidate(context: InsertContext, object: Mesh, where: Plan, hint: Wish, anyhow: bool) -> CandidatePose:
    """Return the first candidate pose, in the order of the plan, at which the object stays.

    Args:
        context: of the insertion.
        object: upright, in metres.
        where: the plan.
        hint: the parsed placement hint, which holds.
        anyhow: Turn a large object's side or back to the room where there is no other place.

    Raises:
        NoRoom: there is none.
    """
    room, config, record = context.room, context.config, context.record
    results: list[Record] = []
    keeps: dict[Wish, Keep | None] = {}

    def check(candidate: CandidatePose) -> Record:
        with step(record, "verify") as result:
            result.pop("rest", None)  # of earlier candidates
            found = context.check_stability(object, candidate, room.scene)
            result |= found
        results.append(found)
        return found

    for heeded, turned in _searches(object, where, hint, config, anyhow):
        if (
            turned is config.pose
            and turned.pose == "search"
            and any(result.get("unstable", False) for result in results)
        ):
            continue  # it would fall over however it is turned
        reasons: list[str] = []
        if heeded not in keeps:
            keeps[heeded] = allowed(heeded, room.scene, object)
        poses = candidate_poses(room, object, where, config.surface, turned, reasons, keeps[heeded])
        with step(record, "pose") as said:
            candidate = stable_pose(
                room, object, poses, check, partial(_unheeded, room, object, heeded), config.pose, reasons
            )
            if candidate is not None:
                said |= {name: np.asarray(value).tolist() for name, value in vars(candidate.pose).items()}
                record["surface"] = {**candidate.surface, "passed over": reasons}
                return candidate
    unstable = any(result.get("unstable", False) for result in results)
    record["surface"] = {"passed over": reasons}
    summary = f"no place for {record.get('label', 'the object')!r}: {'; '.join(reasons)}"
    raise NoRoom(summary, unstable=unstable, remedy="; name another place with prompt=...")


def _searches(
    object: Mesh, where: Plan, wish: Wish, config: InsertConfig, anyhow: bool
) -> Iterator[tuple[Wish, PoseConfig]]:
    """Yield what is searched for: squarely first, and first where the plan has it; other turns before giving up a wish."""
    preferred = Wish((*wish.relations, *planned_place(where).relations))
    for heeded in ((preferred, wish), (Wish(),)) if config.wish == "prefer" else ((preferred, wish),):
        for turned in facing_first(object, config.pose, anyhow):
            for one in dict.fromkeys(heeded):
                yield one, turned


def _unheeded(room: RoomState, object: Mesh, wish: Wish, candidate: CandidatePose) -> str:
    """Return the relation of a wish that a candidate does not have, as a clause; empty if it has all."""
    return objection(wish, room.scene, candidate.pose.moved(object)) if wish.relations else ""
