"""Objects into a room: a small layer over an untouched geometric.usd."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import yaml
from pxr import Sdf
from scipy.spatial.transform import Rotation

from s2a.certify.drop_test import SettleConfig
from s2a.commands.drop import PiecesConfig, drop
from s2a.errors import CheckFailed, InputError
from s2a.geometry.orbit_camera import OrbitCamera, framing_pose
from s2a.geometry.ransac import RansacConfig
from s2a.geometry.regions import RegionConfig
from s2a.geometry.render import render, write_png
from s2a.insert import overlay
from s2a.insert.objects import ObjectConfig
from s2a.insert.pipeline import InsertConfig, Inserted, Room, Thing, insert
from s2a.insert.place.pose import PoseConfig
from s2a.insert.place.supports import SurfaceConfig
from s2a.llm.ask import Model
from s2a.llm.client import LlmConfig, choose, kind_of
from s2a.llm.usage_log import Ledger, Record
from s2a.outputs import atomic_write, refuse_loss, require_png
from s2a.progress import track
from s2a.ranges import Count, CountFromZero
from s2a.sandbox.geometry_free import skeleton
from s2a.sandbox.jail import ConfinementConfig
from s2a.usd import descriptive, geometric
from s2a.usd.files import files

LAYER, RECORD = "insert.usda", "insert.json"


@dataclass(frozen=True)
class PlacementConfig:
    """Where an object goes.

    Attributes:
        regions: how support regions are grown.
        surface: "regions" or "ransac".
        ransac: how the baseline's plane is sought.
        pose: how poses are found.
        settle: how the object is watched.
        object: how objects are read.
    """

    regions: RegionConfig
    surface: Literal["regions", "ransac"]
    ransac: RansacConfig
    pose: PoseConfig
    settle: SettleConfig
    object: ObjectConfig


@dataclass(frozen=True)
class Config:
    """Keys of `s2a insert`.

    Attributes:
        stage: the geometric.usd, or the insert.usda of an earlier insertion; it stays as it is.
        object: a mesh or a USD stage; null if a list is given.
        label: what it is, in plain words; null if a list is given.
        objects: a YAML list of {object, label}, paths relative to it; null for a single object.
        prompt: a wish in words, such as "put it next to the keyboard", or null.
        out: folder that receives insert.usda (open it instead of the stage; delete it and nothing was inserted), objects/,
            descriptive.usda and insert.json.
        image: PNG file to write, an image of the first object in its place, or null.
        record: a file to which the answers of the model are added, for llm=replay; null for none.
        surface: "regions" grows bounded surfaces; "ransac" is the baseline, one plane, and needs pose=paper.
        pose: "search" looks for the best place; "paper" is the baseline, random offsets until nothing collides.
        retries: answers of the model that may be refused, a step.
        plans: that the model is asked for, if there is no room in the places of the first.
        neighbours: things near the place that the model is told of when it says how large an object is.
        llm: who is asked.
        placement: where an object goes.
        confinement: what a script may do.
        pieces: convex pieces that stand for an object while it is watched.
        camera: intrinsics and framing of the image.
    """

    stage: Path
    object: Path | None
    label: str | None
    objects: Path | None
    prompt: str | None
    out: Path
    image: Path | None
    record: Path | None
    surface: Literal["regions", "ransac"]
    pose: Literal["search", "paper"]
    retries: CountFromZero
    plans: Count
    neighbours: CountFromZero
    llm: LlmConfig
    placement: PlacementConfig
    confinement: ConfinementConfig
    pieces: PiecesConfig
    camera: OrbitCamera


def run(config: Config) -> str:
    """Insert the objects, write what was added over the stage, and return where they are.

    Raises:
        InputError: nothing could be inserted, or the picture is no PNG file; nothing is written.
        NotPassed: some of several could not; the others are written.
    """
    if config.image:
        require_png(config.image)
    things, model = _things(config), choose(config.llm, config.record)
    room = open_room(config)
    # Before a model is asked, whose answers may be paid for.
    read = [config.objects, config.record, config.llm.answers, *(thing.file for thing in things), *files(config.stage)]
    refuse_loss(config.out, RECORD, [file for file in read if file])
    return into(room, things, model, config)


def into(room: Room, things: list[Thing], model: Model, config: Config) -> str:
    """Do what `run` does, in a room that is open and fills up."""
    found: list[Inserted] = []
    records: list[Record] = []
    for thing in track(things, "inserting"):
        record: Record = {"object": str(thing.file), "label": thing.label, "wish": thing.wish}
        inserted, record = attempt(room, thing, model, config, record)
        records.append(record)
        if inserted is not None:
            found.append(inserted)
            room.add(inserted)
        elif len(things) == 1:
            raise InputError(record["problem"])
    if not found:
        raise InputError(f"none of {len(things)} objects could be inserted; the first: {records[0]['problem']}")
    with atomic_write(config.out, earlier=RECORD) as out:
        _write(found, records, room, config, out)
    if config.image:
        _draw(found[0], room, config.camera, config.image)
    said = _summary(found, records, config)
    if len(found) < len(things):
        raise CheckFailed(said)
    return said


def open_room(config: Config) -> Room:
    """Read a stage, and what its parts can carry."""
    return Room(geometric.read(config.stage), skeleton(config.stage), settings(config).surface)


def attempt(room: Room, thing: Thing, model: Model, config: Config, record: Record) -> tuple[Inserted | None, Record]:
    """Insert an object; return it, or None, and the record, which has its problem."""
    ledger, inserted = Ledger(config.llm.prices), None
    try:
        inserted = insert(
            room, thing, model, settings(config), drop(config.pieces, config.placement.settle), ledger, record
        )
    except InputError as error:
        record["problem"] = str(error)
    else:
        record |= {"id": inserted.placement.part_id, "problem": ""}
    return inserted, record | {"answers": ledger.entries, "total": ledger.total()}


def settings(config: Config) -> InsertConfig:
    """Return how objects are inserted."""
    where = config.placement
    surface = SurfaceConfig(where.surface, where.regions, where.ransac)
    ours = kind_of(config.llm) == "rules"
    asked = (config.retries, config.plans, config.neighbours)
    return InsertConfig(surface, where.pose, where.object, config.confinement, *asked, ours)


def _things(config: Config) -> list[Thing]:
    """Return what is to be inserted: one object, or a list."""
    wish = config.prompt or ""
    if config.objects is None:
        if config.object is None or not (config.label and config.label.strip()):
            raise InputError("give object=FILE and label=WORDS, or objects=LIST.yaml with an {object, label} an entry")
        return [Thing(config.object, config.label, wish)]
    if config.object is not None or config.label is not None:
        raise InputError("objects=LIST.yaml and object=FILE were both given; give one of them")
    try:
        entries = yaml.safe_load(config.objects.read_text())
        found = [(str(entry["object"]), str(entry["label"])) for entry in entries]
    except (OSError, yaml.YAMLError, TypeError, KeyError, UnicodeDecodeError) as error:
        said = " ".join(str(error).split())
        raise InputError(f"{config.objects}: not a list of {{object: FILE, label: WORDS}} ({said})") from error
    if not found:
        raise InputError(f"{config.objects} lists no object")
    return [Thing(config.objects.parent / file, label, wish) for file, label in found]


def _write(found: list[Inserted], records: list[Record], room: Room, config: Config, out: Path) -> None:
    """Write the layer, the objects' files, the words and the record."""
    (out / "objects").mkdir(parents=True)
    added = Sdf.Layer.CreateAnonymous(".usda")
    Sdf.CreatePrimInLayer(added, "/scene")
    for one in found:
        overlay.write_object(one.mesh, out / one.placement.reference)
        path = f"/scene/{one.placement.part_id}"
        Sdf.CopySpec(one.layer, path, added, path)
    overlay.write(added, Path(os.path.relpath(config.stage, config.out)).as_posix(), out / LAYER)
    descriptive.write(room.scene, out / "descriptive.usda")
    about = {"stage": str(config.stage), "surface": config.surface, "pose": config.pose}
    about |= {"llm": kind_of(config.llm), "model": config.llm.model}
    (out / RECORD).write_text(json.dumps({**about, "objects": records}, indent=1) + "\n")


def _draw(inserted: Inserted, room: Room, camera: OrbitCamera, path: Path) -> None:
    """Draw an object in its place, from its front."""
    front = Rotation.from_quat(inserted.spot.pose.quaternion).apply([1.0, 0.0, 0.0])
    view = framing_pose(inserted.part.mesh.vertices, front, camera)
    with atomic_write(path) as out:
        write_png(render([part.mesh for part in room.scene.parts.values()], view, camera), out)


def _summary(found: list[Inserted], records: list[Record], config: Config) -> str:
    """Return where the objects are, and why others are not there."""
    lines = [f"{config.out / LAYER}: {len(found)} of {len(records)} objects over {config.stage}"]
    for record in records:
        if record["problem"]:
            lines.append(f"  not {record['label']!r}: {record['problem']}")
            continue
        x, y, z = record["pose"]["position"]
        size = " x ".join(f"{side:.2f}" for side in record["scale"]["size"])
        lines.append(f"  {record['id']} on {record['surface']['target']} at ({x:.2f}, {y:.2f}, {z:.2f}), {size} m")
    return "\n".join(lines)
