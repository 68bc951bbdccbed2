"""Insertion of one object: describe the room, plan, scale, find a pose, check its stability, author a script.

Whether an object stays where it is put is up to the caller's `StabilityCheck`: physics, which this module does not import.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from s2a.language.insert import describe
from s2a.language.insert.author import author, check_words, placement
from s2a.language.insert.context import InsertConfig, InsertContext, Inserted, ObjectRequest
from s2a.language.insert.describe import RoomState
from s2a.language.insert.object_file import ObjectFile, colour_spread, read_object, upright
from s2a.language.insert.place.candidate_poses import CandidatePose, Keep, candidate_poses
from s2a.language.insert.place.contact import PoseConfig, facing_first
from s2a.language.insert.place.fit import NoRoom
from s2a.language.insert.place.stable_pose import concavities, cross_sections, tilt_margins
from s2a.language.insert.plan import Choice, FailedPlan, Plan, plan
from s2a.language.insert.scale import Size, fit_scale, size
from s2a.language.insert.stability import stable_pose
from s2a.language.insert.wishes.check import allowed, decline, objection, planned_place, read_wish, verdict
from s2a.language.insert.wishes.parse import Wish, is_kind_of
from s2a.language.llm.ask import Record, step, tokens
from s2a.language.llm.rules import write_scripts
from s2a.language.sandbox.jail import Sandbox
from s2a.scene.scene import Mesh, Part


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


SINGLE = (
    "tv", "keyboard", "microwave", "kettle", "toaster", "coffee maker", "coffee machine", "printer", "record player",
    "bread bin", "dish rack", "knife block", "toaster oven",
)  # fmt: skip
"""Kinds of which one table or counter has one."""


def like_on(target: str, label: str, lines: list[dict[str, Any]]) -> str | None:
    """Return the id of a thing on a support that is of the same single kind as a label; None if there is none.

    Args:
        target: id of the support.
        label: of the object.
        lines: of the room, see `s2a.language.insert.describe.describe`.
    """
    kinds = [kind for kind in SINGLE if is_kind_of(label, kind)]
    standing = (line for line in lines if line.get("on") == target)
    return next((line["id"] for line in standing if any(is_kind_of(line["label"], kind) for kind in kinds)), None)


def apart_from_likes(plan: Plan, label: str, lines: list[dict[str, Any]], last: bool) -> Plan:
    """Return a plan without the supports that carry a like of the object, or with these at the end if it is the last one.

    Raises:
        NoRoom: nothing is left, and it is not the last plan.
    """
    likes = {choice: like_on(choice.target, label, lines) for choice in plan.choices}
    free = tuple(choice for choice in plan.choices if likes[choice] is None)
    if not free and not last:
        raise NoRoom("; ".join(_clause(choice, like) for choice, like in likes.items()))
    return replace(plan, choices=free + tuple(choice for choice in plan.choices if last and choice not in free))


def _clause(choice: Choice, like: str | None) -> str:
    return (
        f"{choice.relation} {choice.target}: {like} is there already, and people keep one such thing at a place; repeat it if "
        "there is no better place for a second one"
    )


@dataclass(frozen=True)
class Planned:
    """An object whose place is planned and not yet taken.

    Attributes:
        request: what was asked for.
        file: what its file holds.
        facts: about it, as the model was given them.
        wish: the parsed wish.
        where: the plan.
        answer: its usual size.
    """

    request: ObjectRequest
    file: ObjectFile
    facts: Record
    wish: Wish
    where: Plan
    answer: Size

    @property
    def footprint(self) -> float:
        """Area that the object takes of its support [m^2]: big ones are placed before small ones."""
        scale = fit_scale(self.answer, *_extents(self.file, self.where), self.file.unit).scale
        sides = np.ptp(upright(self.file, self.where.up, self.where.front, scale, self.where.hangs).bounds, axis=0)
        return float(sides[0] * sides[1])


def insert(context: InsertContext, request: ObjectRequest) -> Inserted:
    """Find a place for an object in a room and author it: `planned`, then `fixed`.

    Raises:
        NoRoom: no candidate pose is free and stable.
        InputError: a label that no script may contain, a file without an object, a wish that cannot be, or no usable answer
            of the model.
    """
    return fixed(context, planned(context, request))


def planned(context: InsertContext, request: ObjectRequest) -> Planned:
    """Read an object, and ask where it goes and how large it is."""
    check_words(request.label, request.hint)
    room, config, record = context.room, context.config, context.record
    file = read_object(request.file, config.object)
    wish = read_wish(request.hint, room.scene)
    if config.wish == "heed":
        decline(wish, request.hint, room.scene, understood=not config.rules)
    with step(record, "describe") as result:
        result |= {"parts": len(room.lines), "tokens": tokens(describe.text(room.lines))}
    with Sandbox(room.geometry_free_text, config.sandbox, config.trusted) as sandbox:
        sandbox.check_guarantees()  # before the model is asked: its answers may cost money
    facts = _facts(file, request, room.lines)
    where = _plan(context, facts, None)
    with step(record, "scale") as result:
        answer = _size(context, facts, file, where)
        result |= vars(answer)
    return Planned(request, file, facts, wish, where, answer)


def fixed(context: InsertContext, planned: Planned, failed: FailedPlan | None = None) -> Inserted:
    """Find the pose of a planned object in the room as it is now, and author it; by another plan, if one failed."""
    room, record, request, config = context.room, context.record, planned.request, context.config
    where, object, scale, candidate = _place(context, planned, failed)
    if request.hint:
        record["wish"] = verdict(_wish(planned, where), request.hint, room.scene, candidate.pose.moved(object))
    model = context.model if config.script == "model" else write_scripts
    with Sandbox(room.geometry_free_text, config.sandbox, config.trusted) as sandbox, step(record, "script") as result:
        prim = placement(room.scene, request.label, candidate.pose, scale)
        script = author(model, sandbox, prim, context.usage, result)
    own = upright(planned.file, where.up, where.front, 1.0, where.hangs)
    return Inserted(prim, candidate, Part(request.label, candidate.pose.moved(object)), own, script.layer, where)


def _wish(planned: Planned, where: Plan) -> Wish:
    """Return the wish as it was parsed; as the plan understood it, where the parser understood nothing."""
    understood = planned.wish.relations or planned.wish.missing or not planned.request.hint
    return planned.wish if understood else planned_place(where)


def _facts(file: ObjectFile, request: ObjectRequest, lines: list[Record]) -> Record:
    """Return the facts about an object that go into the model's questions."""
    sides = [float(f"{side:.3g}") for side in np.ptp(file.mesh.bounds, axis=0)]
    return {
        "label": request.label,
        "sides": sides,
        "format": request.file.suffix.lower().lstrip("."),
        "up": file.up,
        "feet": tilt_margins(file.mesh),
        "hollow": concavities(file.mesh),
        "slices": cross_sections(file.mesh),
        "varied": colour_spread(file.mesh),
        "wish": request.hint,
        "room": lines,
    }


def _place(
    context: InsertContext, planned: Planned, failed: FailedPlan | None
) -> tuple[Plan, Mesh, float, CandidatePose]:
    """Find a pose; ask for another plan while there is no room, or one only where an earlier plan failed.

    Returns:
        The plan, the object upright and to scale [m], its scale (metres per unit of the file), and the candidate pose.
    """
    where = _plan(context, planned.facts, failed) if failed else planned.where
    if where.declined:
        raise NoRoom(f"no place for {planned.request.label!r}: {where.declined[:300]}")
    for left in reversed(range(1 if failed else context.config.plans)):
        try:
            lines = [] if planned.request.hint else context.room.lines
            where = apart_from_likes(where, planned.request.label, lines, last=not left)
            return where, *_pose(context, planned, where, anyhow=not left)
        except NoRoom as full:
            if not left:
                raise
            where = _plan(context, planned.facts, FailedPlan(where, full.summary, full.unstable))
            if where.declined:
                raise
    raise AssertionError("plans is at least 1")


def _plan(context: InsertContext, facts: Record, failed: FailedPlan | None) -> Plan:
    """Ask for a plan, or for another one after a plan without room."""
    with step(context.record, "plan again" if failed else "plan") as result:
        text = describe.text(context.room.lines)
        scene, retries = context.room.scene, context.config.retries
        found = plan(context.model, scene, facts, text, retries, context.usage, failed)
        result |= found.said()
        if found.declined and not failed:
            raise NoRoom(f"no place for {facts['label']!r}: {found.declined[:300]}; name one with prompt=...")
    return found


def _size(context: InsertContext, facts: Record, file: ObjectFile, where: Plan) -> Size:
    """Ask for the size of the object."""
    room, config = context.room, context.config
    height, longest = _extents(file, where)
    question = {"label": facts["label"], "sides": facts["sides"], "stated": file.unit}
    question |= {"height": float(f"{height:.3g}"), "longest": float(f"{longest:.3g}")}
    question |= describe.context_of(room.scene, room.supports, where, config.neighbours)
    return size(context.model, question, config.retries, context.usage)


def _extents(file: ObjectFile, where: Plan) -> tuple[float, float]:
    """Return an object's height and longest side in the file's unit."""
    sides = np.ptp(file.mesh.bounds, axis=0)
    return float(sides["xyz".index(where.up[1])]), float(sides.max())


def _pose(context: InsertContext, planned: Planned, where: Plan, anyhow: bool) -> tuple[Mesh, float, CandidatePose]:
    """Return the object upright and to scale [m], its scale (metres per unit of the file), and its candidate pose."""
    file = planned.file
    found = fit_scale(planned.answer, *_extents(file, where), file.unit)
    object = upright(file, where.up, where.front, found.scale, where.hangs)
    sides = np.ptp(object.bounds, axis=0)
    context.record["scale"] |= vars(found) | {"size": [round(float(side), 4) for side in sides]}
    return object, found.scale, stable_candidate(context, object, where, _wish(planned, where), anyhow)
