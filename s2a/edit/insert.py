"""One object into a room: described, planned, scaled, given a surface and a pose, and written by a script; then a candidate.

Whether it stays where it is put is for the caller to say (`watch`): a simulator's business, which this package knows nothing of.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Sdf

from s2a.edit import describe
from s2a.edit.ask import Model
from s2a.edit.author import author, placement
from s2a.edit.confine import ConfinementConfig
from s2a.edit.fit import NoRoom
from s2a.edit.objects import ObjectConfig, ObjectFile, read_object, upright
from s2a.edit.placement import Placement
from s2a.edit.plan import Choice, Plan, plan
from s2a.edit.pose import PoseConfig
from s2a.edit.record import Ledger, tokens
from s2a.edit.scale import fit, size
from s2a.edit.spots import Spot, spots
from s2a.edit.stance import feet
from s2a.edit.surfaces import SurfaceConfig
from s2a.errors import InputError
from s2a.scene import Mesh, Part, Scene

Record = dict[str, Any]
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
        neighbours: things near the place that a model is told of when it says how large an object is.
        trusted: whether the scripts are our own.
    """

    surface: SurfaceConfig
    pose: PoseConfig
    object: ObjectConfig
    confinement: ConfinementConfig
    retries: int
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


class Room:
    """A room that fills up.

    Attributes:
        scene: the room with what was inserted so far.
        skeleton: text of its stage, without it.
        supports: what its parts can carry.
        lines: its description.
    """

    def __init__(self, scene: Scene, skeleton: str, config: SurfaceConfig) -> None:
        self.scene, self.skeleton, self._config = scene, skeleton, config.regions
        self.supports = describe.survey(scene, config.regions)
        self.lines = describe.describe(scene, self.supports)

    def add(self, inserted: Inserted) -> None:
        """Take an object into the room."""
        name, part = inserted.placement.part_id, inserted.part
        self.scene = Scene(self.scene.name, {**self.scene.parts, name: part}, self.scene.origin)
        self.supports |= describe.survey(self.scene, self._config, (inserted.spot.target, name))
        self.lines = describe.describe(self.scene, self.supports)


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
        InputError: the file holds no object, no answer of the model could be used, or no place is free.
    """
    file = read_object(thing.file, config.object)
    with _step(record, "describe") as said:
        text = describe.text(room.lines)
        said |= {"parts": len(room.lines), "tokens": tokens(text)}
    facts = _facts(file, thing, room.lines)
    with _step(record, "plan") as said:
        where = plan(model, room.scene, facts, text, config.retries, ledger)
        said |= {"up": where.up, "front": where.front, "near": where.near, "choices": [vars(c) for c in where.choices]}
    with _step(record, "scale") as said:
        scale = _scale(model, room, facts, file, where, config, ledger, said)
    object, _ = upright(file, where.up, where.front, scale)
    spot = _spot(room, object, where, config, watch, record)
    with _step(record, "script") as said:
        planned = placement(room.scene, thing.label, spot.pose, scale)
        outcome = author(model, room.skeleton, planned, config.confinement, config.trusted, ledger, said)
    own, _ = upright(file, where.up, where.front, 1.0)
    return Inserted(planned, spot, Part(thing.label, spot.pose.moved(object)), own, outcome.layer)


@contextmanager
def _step(record: Record, name: str) -> Iterator[Record]:
    """Note what a step says and how long it took, also where it fails."""
    said: Record = record.setdefault(name, {})
    start = time.perf_counter()
    try:
        yield said
    except InputError as error:
        said["problem"] = str(error)
        raise
    finally:
        said["seconds"] = round(said.get("seconds", 0.0) + time.perf_counter() - start, 3)


def _facts(file: ObjectFile, thing: Thing, lines: list[Record]) -> Record:
    """Return what is asked about an object."""
    sides = [float(f"{side:.3g}") for side in np.ptp(file.mesh.bounds, axis=0)]
    return {
        "label": thing.label,
        "sides": sides,
        "up": file.up,
        "feet": feet(file.mesh),
        "wish": thing.wish,
        "room": lines,
    }


def _scale(
    model: Model,
    room: Room,
    facts: Record,
    file: ObjectFile,
    where: Plan,
    config: InsertConfig,
    ledger: Ledger,
    said: Record,
) -> float:
    """Return metres in a unit of an object's file."""
    sides = np.ptp(file.mesh.bounds, axis=0)
    height, longest = float(sides["xyz".index(where.up[1])]), float(sides.max())
    asked = {"label": facts["label"], "sides": facts["sides"], "stated": file.unit}
    asked |= {"height": float(f"{height:.3g}"), "longest": float(f"{longest:.3g}")}
    asked |= _surroundings(room, where.choices[0], config.neighbours)
    answer = size(model, asked, config.retries, ledger)
    found = fit(answer, height, longest, file.unit)
    said |= vars(answer) | vars(found) | {"size": [round(found.scale * float(side), 4) for side in sides]}
    return found.scale


def _surroundings(room: Room, choice: Choice, count: int) -> Record:
    """Return the support that is meant, and what is near it, as a model is told."""
    regions = room.supports.get(choice.target, [])
    meant = choice.height
    if meant is not None:
        regions = sorted(regions, key=lambda region: abs(region.height - meant))
    part = room.scene.parts[choice.target]
    support: Record = {"part": part.label}
    middle = part.mesh.bounds.mean(axis=0) if len(part.mesh.vertices) else np.zeros(3)
    if regions:
        support |= describe.support(regions[0]) | {"widest": round(float(np.hypot(*regions[0].size)), 2)}
        middle = regions[0].center
    near = []
    for i in describe.shown(room.scene):
        bounds = room.scene.parts[i].mesh.bounds
        if i != choice.target and np.ptp(bounds, axis=0).max() < 1.0:
            near.append((float(np.linalg.norm(bounds.mean(axis=0) - middle)), i))
    boxes = [(room.scene.parts[i].label, describe.box_of(room.scene, i)) for _, i in sorted(near)[:count]]
    return {
        "support": support,
        "neighbours": [{"label": w, "size": [round(s, 2) for s in box.size]} for w, box in boxes],
    }


def _spot(room: Room, object: Mesh, where: Plan, config: InsertConfig, watch: Watch, record: Record) -> Spot:
    """Return the first spot, in the order of the plan, at which the object stays."""
    reasons: list[str] = []
    found = spots(room.scene, object, where, config.surface, config.pose, reasons)
    while True:
        with _step(record, "pose"):
            spot = next(found, None)
        if spot is None:
            break
        with _step(record, "verify") as said:
            said |= watch(object, spot, room.scene)
        if not said["problem"]:
            record["surface"] = {**spot.surface, "passed over": reasons}
            record["pose"] |= {name: np.asarray(value).tolist() for name, value in vars(spot.pose).items()}
            return spot
        reasons.append(f"{spot.choice.relation} {spot.target}: {said['problem']}")
    record["surface"] = {"passed over": reasons}
    raise NoRoom(
        f"no place for {record.get('label', 'the object')!r}: {'; '.join(reasons)}; wish for another place with prompt=..."
    )
