"""Insertion of one or several objects into a stage, and the files that come of it."""

import json
import os
from dataclasses import dataclass
from pathlib import Path

import yaml
from pxr import Sdf, Usd, UsdGeom

from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write, refuse_loss, require_png
from s2a.core.progress import track
from s2a.language.ask import Model, Record
from s2a.language.client import choose, kind_of
from s2a.language.insert.describe import RoomState
from s2a.language.insert.pipeline import Attempt
from s2a.language.insert.review import image_pose
from s2a.language.insert.rules import rules
from s2a.language.insert.settings import Inserted, InsertSettings, ObjectRequest
from s2a.scene.geometry.camera import OrbitCamera
from s2a.scene.geometry.render import render, write_png
from s2a.scene.scene import Mesh
from s2a.scene.usd import descriptive, geometric
from s2a.scene.usd.stage import ROOT, new_stage, open_stage, referable, save, save_layer, write_mesh
from s2a.scene.usd.stamp import files

KEPT = ("s2a:partId", "s2a:label", "s2a:parent", "s2a:motion")


def geometry_free_text(path: Path) -> str:
    """Return a stage in USD's text with the prims of the one at `path`, and nothing of it that is long.

    Kept are types, transforms, and `s2a:partId`, `s2a:label`, `s2a:parent` and `s2a:motion`; dropped are arrays,
    references, joints and physics.

    Raises:
        InputError: no such file, or not a stage in metres with z up and the default prim `/scene`.
    """
    stage, bare = open_stage(path), new_stage()
    layer = bare.GetRootLayer()
    for prim in Usd.PrimRange(stage.GetPrimAtPath(ROOT)):
        if prim.GetPath() != ROOT:
            _copy(prim, layer)
    return layer.ExportToString()


def _copy(prim: Usd.Prim, layer: Sdf.Layer) -> None:
    """Write a prim's type, transform and short attributes into a layer."""
    spec = Sdf.CreatePrimInLayer(layer, prim.GetPath())
    spec.specifier, spec.typeName = Sdf.SpecifierDef, prim.GetTypeName()
    attributes = [attribute for name in KEPT if (attribute := prim.GetAttribute(name)).HasAuthoredValue()]
    if prim.IsA(UsdGeom.Xformable):
        order = UsdGeom.Xformable(prim).GetXformOpOrderAttr()
        attributes += [order] if order.HasAuthoredValue() else []
        attributes += [op.GetAttr() for op in UsdGeom.Xformable(prim).GetOrderedXformOps()]
    for attribute in attributes:
        kind = attribute.GetTypeName()
        copy = Sdf.AttributeSpec(spec, attribute.GetName(), kind, attribute.GetVariability(), attribute.IsCustom())
        copy.default = attribute.Get()


OBJECT = "/object"  # Default prim of an object's file


def write_object(mesh: Mesh, path: Path) -> None:
    """Write an object's file, as a placement refers to it: `/object` with its surface in `/object/visual`.

    `mesh`: in the object's own frame, metres, z up.

    Raises:
        InputError: the file cannot be written.
    """
    stage = new_stage()
    stage.RemovePrim(ROOT)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, OBJECT).GetPrim())
    write_mesh(stage, f"{OBJECT}/visual", mesh)
    save(stage, path)


def write(added: Sdf.Layer, below: str, path: Path) -> None:
    """Write a layer that shows a stage with what was added; the same input gives the same bytes.

    `added`: `/scene` with the new prims, from `s2a.language.sandbox.diff`; `below`: path of the stage (a geometric.usd
    or an overlay), relative to the folder of `path`.

    Raises:
        InputError: the file cannot be written.
    """
    stage, layer = new_stage(), Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(stage.GetRootLayer())  # a layer alone opens nothing that it names
    layer.subLayerPaths.append(referable(below))
    root = layer.GetPrimAtPath(ROOT)
    root.specifier, root.typeName = Sdf.SpecifierOver, ""
    for prim in added.GetPrimAtPath(ROOT).nameChildren:
        Sdf.CopySpec(added, prim.path, layer, prim.path)
    save_layer(layer, path)


MAX_LIST = 4_000_000  # Of a list of objects [bytes]
LAYER, RECORD = "insert.usda", "insert.json"


@dataclass(frozen=True)
class Insertion:
    """Result of an insertion."""

    layer: Path  # the insert.usda that was written
    inserted: tuple[Inserted, ...]  # objects in their places
    # results by step of every requested object, in order; `problem` is empty for those that were inserted
    records: tuple[Record, ...]


def insert_all(settings: InsertSettings) -> Insertion:
    """Insert the requested objects and write what was added over the stage.

    Raises:
        InputError: nothing could be inserted, or the image file is not PNG; nothing is written.
    """
    if settings.image:
        require_png(settings.image)
    requests, model = read_requests(settings), choose(settings.llm, settings.record, rules)
    room = open_room(settings)
    # Checked before a model is asked: its answers may cost money.
    read = [settings.objects, settings.record, settings.llm.answers, *(request.file for request in requests)]
    refuse_loss(settings.out, RECORD, [file for file in [*read, *files(settings.stage)] if file])
    return insert_into(room, requests, model, settings)


def insert_into(room: RoomState, requests: list[ObjectRequest], model: Model, settings: InsertSettings) -> Insertion:
    """Insert objects into an open room, which keeps them, and write the files.

    Raises:
        InputError: nothing could be inserted; nothing is written.
    """
    # All places are planned before any is taken, and the big objects take theirs first.
    attempts = [Attempt(room, request, model, settings) for request in requests]
    for one in track(attempts, "planning"):
        one.plan()
        if one.error and len(requests) == 1:
            raise one.error
    placed: dict[int, Inserted] = {}
    for number in track(sorted(range(len(attempts)), key=lambda number: -attempts[number].footprint), "inserting"):
        inserted = attempts[number].fix()
        if inserted is not None:
            placed[number] = inserted
            room.add(inserted)
        elif len(requests) == 1 and (error := attempts[number].error):
            raise error
    records = [one.finished() for one in attempts]
    if not placed:
        raise InputError(f"none of {len(requests)} objects could be inserted; the first: {records[0]['problem']}")
    results = [placed[number] for number in sorted(placed)]
    with atomic_write(settings.out, earlier=RECORD) as out:
        _write(results, records, room, settings, out)
    if settings.image:
        _render(results[0], room, settings.camera, settings.image)
    return Insertion(settings.out / LAYER, tuple(results), tuple(records))


def open_room(settings: InsertSettings) -> RoomState:
    """Read a stage and survey its support regions."""
    stage = settings.stage
    return RoomState(geometric.read(stage), geometry_free_text(stage), settings.placement)


def read_requests(settings: InsertSettings) -> list[ObjectRequest]:
    """Return the objects to insert: a single one, or a list.

    Raises:
        InputError: neither or both are given, or a list that cannot be read.
    """
    hint = settings.prompt or ""
    if settings.objects is None:
        if settings.object is None or not (settings.label and settings.label.strip()):
            raise InputError("give object=FILE and label=WORDS, or objects=LIST.yaml with an {object, label} an entry")
        return [ObjectRequest(settings.object, settings.label, hint)]
    if settings.object is not None or settings.label is not None:
        raise InputError("objects=LIST.yaml and object=FILE were both given; give one of them")
    return [ObjectRequest(settings.objects.parent / file, label, hint) for file, label in _read_list(settings.objects)]


def _read_list(path: Path) -> list[tuple[str, str]]:
    """Return the (file, label) entries of a YAML list."""
    try:
        if path.stat().st_size > MAX_LIST:
            raise ValueError(f"larger than {MAX_LIST} bytes")
        entries = yaml.safe_load(path.read_text(encoding="utf-8"))
        if not isinstance(entries, list):
            raise TypeError("it is no list")
        objects = [(_words(entry["object"]), _words(entry["label"])) for entry in entries]
    except (OSError, yaml.YAMLError, TypeError, KeyError, ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())[:300]
        raise InputError(f"{path}: not a list of {{object: FILE, label: WORDS}} ({reason})") from error
    if not objects:
        raise InputError(f"{path} lists no object")
    return objects


def _words(value: object) -> str:
    """Return a value of an entry as text; nothing that is put together, which YAML's aliases can make endless."""
    if not isinstance(value, (str, int, float)):
        raise TypeError(f"a {type(value).__name__}; expected a text")
    return str(value)


def _write(
    objects: list[Inserted], records: list[Record], room: RoomState, settings: InsertSettings, out: Path
) -> None:
    """Write the layer, the objects' files, the descriptive stage and the record."""
    (out / "objects").mkdir(parents=True)
    added = Sdf.Layer.CreateAnonymous(".usda")
    Sdf.CreatePrimInLayer(added, "/scene")
    for one in objects:
        write_object(one.mesh, out / one.placement.reference)
        path = f"/scene/{one.placement.part_id}"
        Sdf.CopySpec(one.layer, path, added, path)
    write(added, Path(os.path.relpath(settings.stage, settings.out)).as_posix(), out / LAYER)
    descriptive.write(room.scene, out / "descriptive.usda")
    about: dict[str, str | None] = {"stage": str(settings.stage), "surface": settings.surface, "pose": settings.pose}
    kind = kind_of(settings.llm)
    about |= {"llm": kind, "model": None if kind == "rules" else settings.llm.model}
    (out / RECORD).write_text(json.dumps({**about, "objects": records}, indent=1) + "\n")


def _render(inserted: Inserted, room: RoomState, camera: OrbitCamera, path: Path) -> None:
    """Render an object in its place, from where it is seen."""
    pose = image_pose(inserted, room.scene, camera)
    with atomic_write(path) as out:
        write_png(render([part.mesh for part in room.scene.parts.values()], pose, camera), out)
