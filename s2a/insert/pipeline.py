"""One object into a room: described, planned, scaled, given a surface and a pose, and written by a script; then a candidate.

Whether it stays where it is put is for the caller to say (`watch`): a simulator's business, which this package knows nothing of.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from pxr import Sdf

from s2a.errors import InputError
from s2a.insert import describe
from s2a.insert.author import author, placement
from s2a.insert.objects import ObjectConfig, ObjectFile, read_object, upright
from s2a.insert.place.candidates import Spot, spots
from s2a.insert.place.fit import NoRoom
from s2a.insert.place.pose import PoseConfig
from s2a.insert.place.stable_pose import feet, hollows, slices
from s2a.insert.place.supports import SurfaceConfig
from s2a.insert.placement import Placement
from s2a.insert.plan import Plan, plan
from s2a.insert.room import Room
from s2a.insert.scale import Size, fit, size
from s2a.llm.ask import Model
from s2a.llm.usage_log import Ledger, Record, step, tokens
from s2a.sandbox.jail import Cell, ConfinementConfig
from s2a.sandbox.policy import HIDDEN
from s2a.scene import Mesh, Part, Scene

ELSEWHERE = "; wish for another place with prompt=..."
Watch = Callable[[Mesh, Spot, Scene], Record]
"""Of an upright object, the spot where it is put, and the room: what comes of it, with the key `problem`, empty if it stays."""


@dataclass(frozen=True)
class InsertConfig:
    """How objects are inserted.

    Attributes:
        surface: how surfaces are found.
        pose: how poses are found.
        object: how objects are read.
        confinement: what scripts may do.
        retries: answers of a model that may be refused, a step.
        plans: that a model is asked for, if there is no room in the places of the first.
        neighbours: things near the place that a model is told of when it says how large an object is.
        trusted: whether the scripts are our own.
    """

    surface: SurfaceConfig
    pose: PoseConfig
    object: ObjectConfig
    confinement: ConfinementConfig
    retries: int
    plans: int
    neighbours: int
    trusted: bool


@dataclass(frozen=True)
class Thing:
    """What is to be inserted.

    Attributes:
        file: a mesh or a USD stage.
        label: what it is, in any words.
        wish: where somebody wants it, or empty.
    """

    file: Path
    label: str
    wish: str


@dataclass(frozen=True)
class Inserted:
    """An object in its place.

    Attributes:
        placement: where.
        spot: how it was found.
        part: itself in the room.
        mesh: its surface upright, in the unit of its file, as its own USD file holds it.
        layer: what the script made.
    """

    placement: Placement
    spot: Spot
    part: Part
    mesh: Mesh
    layer: Sdf.Layer


def insert(
    room: Room, thing: Thing, model: Model, config: InsertConfig, watch: Watch, ledger: Ledger, record: Record
) -> Inserted:
    """Find an object's place in a room and write it down.

    Args:
        room: where to; it is not changed.
        thing: what.
        model: who is asked.
        config: how.
        watch: says whether the object stays in a place.
        ledger: where the answers are noted.
        record: filled step by step, also where it ends in an error.

    Raises:
        InputError: a label that no script may spell, the file holds no object, no answer of the model could be used, or no
            place is free.
    """
    if HIDDEN.search(thing.label):
        raise InputError(f"label {thing.label!r} has a word that begins with an underscore, or two; use plain words")
    file = read_object(thing.file, config.object)
    with step(record, "describe") as said:
        text = describe.text(room.lines)
        said |= {"parts": len(room.lines), "tokens": tokens(text)}
    with Cell(room.skeleton, config.confinement, config.trusted) as cell:
        facts = _facts(file, thing, room.lines)
        where = _planned(model, room, facts, text, config, ledger, record, None)
        with step(record, "scale") as said:
            answer = _size(model, room, facts, file, where, config, ledger, said)
        for left in reversed(range(config.plans)):
            try:
                object, scale, spot = _placed(room, file, where, answer, config, watch, record)
                break
            except NoRoom as full:
                if not left:
                    raise
                reason = str(full).removesuffix(ELSEWHERE)
                where = _planned(model, room, facts, text, config, ledger, record, (where, reason))
        with step(record, "script") as said:
            planned = placement(room.scene, thing.label, spot.pose, scale)
            outcome = author(model, cell, planned, ledger, said)
    own = upright(file, where.up, where.front, 1.0, where.hangs)
    return Inserted(planned, spot, Part(thing.label, spot.pose.moved(object)), own, outcome.layer)


def _facts(file: ObjectFile, thing: Thing, lines: list[Record]) -> Record:
    """Return what is asked about an object."""
    sides = [float(f"{side:.3g}") for side in np.ptp(file.mesh.bounds, axis=0)]
    return {
        "label": thing.label,
        "sides": sides,
        "format": thing.file.suffix.lower().lstrip("."),
        "up": file.up,
        "feet": feet(file.mesh),
        "hollow": hollows(file.mesh),
        "slices": slices(file.mesh),
        "wish": thing.wish,
        "room": lines,
    }


def _planned(
    model: Model,
    room: Room,
    facts: Record,
    text: str,
    config: InsertConfig,
    ledger: Ledger,
    record: Record,
    failed: tuple[Plan, str] | None,
) -> Plan:
    """Ask for a plan, or for another one after a plan without room."""
    with step(record, "plan again" if failed else "plan") as said:
        found = plan(model, room.scene, facts, text, config.retries, ledger, failed)
        said |= asdict(found)
    return found


def _size(
    model: Model,
    room: Room,
    facts: Record,
    file: ObjectFile,
    where: Plan,
    config: InsertConfig,
    ledger: Ledger,
    said: Record,
) -> Size:
    """Ask how large an object is."""
    height, longest = _extents(file, where)
    asked = {"label": facts["label"], "sides": facts["sides"], "stated": file.unit}
    asked |= {"height": float(f"{height:.3g}"), "longest": float(f"{longest:.3g}")}
    asked |= describe.surroundings(room.scene, room.supports, where.choices[0], config.neighbours)
    answer = size(model, asked, config.retries, ledger)
    said |= vars(answer)
    return answer


def _extents(file: ObjectFile, where: Plan) -> tuple[float, float]:
    """Return an object's height and longest side in the file's unit."""
    sides = np.ptp(file.mesh.bounds, axis=0)
    return float(sides["xyz".index(where.up[1])]), float(sides.max())


def _placed(
    room: Room, file: ObjectFile, where: Plan, answer: Size, config: InsertConfig, watch: Watch, record: Record
) -> tuple[Mesh, float, Spot]:
    """Return an object upright and in its size, metres in a unit of its file, and its spot."""
    found = fit(answer, *_extents(file, where), file.unit)
    object = upright(file, where.up, where.front, found.scale, where.hangs)
    sides = np.ptp(object.bounds, axis=0)
    record["scale"] |= vars(found) | {"size": [round(float(side), 4) for side in sides]}
    return object, found.scale, _spot(room, object, where, config, watch, record)


def _spot(room: Room, object: Mesh, where: Plan, config: InsertConfig, watch: Watch, record: Record) -> Spot:
    """Return the first spot, in the order of the plan, at which the object stays."""
    reasons: list[str] = []
    found = spots(room, object, where, config.surface, config.pose, reasons)
    while True:
        with step(record, "pose"):
            spot = next(found, None)
        if spot is None:
            break
        with step(record, "verify") as said:
            said |= watch(object, spot, room.scene)
        if not said["problem"]:
            record["surface"] = {**spot.surface, "passed over": reasons}
            record["pose"] |= {name: np.asarray(value).tolist() for name, value in vars(spot.pose).items()}
            return spot
        reasons.append(f"{spot.choice.relation} {spot.target}: {said['problem']}")
    record["surface"] = {"passed over": reasons}
    raise NoRoom(f"no place for {record.get('label', 'the object')!r}: {'; '.join(reasons)}{ELSEWHERE}")
