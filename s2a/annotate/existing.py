"""An annotation that exists already: read to be edited, and written again with what was not edited as it was."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from s2a.annotate import region
from s2a.annotate.annotation import NO_FACES, Draft, Item
from s2a.annotate.region import FrontRegion
from s2a.annotate.surface import ADDED, SplitSurface
from s2a.core.errors import InputError
from s2a.scan import fields, folder, labels
from s2a.scan.folder import ScanFiles
from s2a.scan.formats import articulate3d
from s2a.scan.imported import SOURCE_FACES
from s2a.scan.ply import ScanMesh
from s2a.scene.scene import Joint

Document = dict[str, Any]
NOBODY, NEW = -1, -2  # In place of the number of a part
# Fraction of the rectangle around its corners that a front fills which was cut out as one;
# its handle is not the front's
FULL = 0.97


@dataclass(frozen=True)
class Existing:
    """Articulate3D's two files of a scan, and the parts in them that a page can edit."""

    files: ScanFiles  # of the scan's folder
    parts: Document  # content of `<scene>_parts.json`
    articulations: Document  # content of `<scene>_artic.json`
    listed: Mapping[int, np.ndarray]  # faces of each part by its number
    joints: Mapping[int, Joint]  # of all parts that move
    items: Mapping[int, Item]  # parts that move and have faces of their own
    handles: Mapping[int, tuple[int, ...]]  # numbers of the parts that are each item's handle
    carried: Mapping[int, tuple[int, ...]]  # numbers of all that moves with each item, itself first
    source: np.ndarray  # for each face the face of the first scan that it is a piece of, or ADDED, shape [face]

    def start(self, surface: SplitSurface) -> Draft:
        """Return the annotation as it is."""
        return Draft(surface, tuple(self.items.values()))

    def kept(self, surface: SplitSurface) -> np.ndarray:
        """Return which faces of a surface stay even if no part has them: all but handles that were added [face]."""
        loose = self.source == ADDED
        own = np.zeros(len(loose), bool)
        own[np.concatenate([NO_FACES, *(item.handle for item in self.items.values())])] = True
        scanned = surface.source != ADDED
        return scanned & ~(loose & own)[np.where(scanned, surface.source, 0)]

    def write(self, out: Path, surface: SplitSurface, items: list[Item], origin: np.ndarray, same: bool) -> None:
        """Write both files for a surface of which these are the parts.

        Args:
            out: the folder.
            surface: whose `source` counts in the faces of the scan that was read.
            items: parts with a joint; the others are deleted.
            origin: what is added to coordinates [m], shape [3].
            same: The mesh is the one that was read.
        """
        _Writer(self, surface, items, origin, same).write(out)


def read(path: Path, mesh: ScanMesh, surface: SplitSurface) -> Existing:
    """Read the annotation in the folder of a scan; InputError: there is none by Articulate3D, or a damaged one."""
    if not folder.is_articulate3d(path):
        raise InputError(f"{path}: holds no <scene>_parts.json to edit; leave edit=true out to annotate from the start")
    files = folder.find(path)
    annotated = articulate3d.read_parts(files.parts, mesh)
    names = {number: part.label for number, part in annotated.items()}
    parent_of = labels.parents(names)
    joints = articulate3d.read_joints(files.articulations, names, mesh.origin)
    owner = articulate3d.owners(annotated, labels.depths(parent_of), len(mesh.faces))
    own = {number: np.flatnonzero(owner == i) for i, number in enumerate(annotated)}
    carried = {number: _carried(number, parent_of, joints) for number in joints}
    grasped = labels.grasped(set(joints), parent_of)
    handles = {number: tuple(i for i in those[1:] if i in grasped) for number, those in carried.items()}
    items = {
        number: Item(
            _front(surface, own[number]),
            labels.split(names[number])[0],
            joint,
            np.sort(np.concatenate([NO_FACES, *(own[i] for i in handles[number])])),
            number=number,
        )
        for number, joint in joints.items()
        if len(own[number])
    }
    sources = files.mesh.with_name(SOURCE_FACES)
    source = np.load(sources) if sources.is_file() else np.arange(len(mesh.faces))
    documents = [fields.load(file).values for file in (files.parts, files.articulations)]
    listed = {number: np.sort(part.faces) for number, part in annotated.items()}
    return Existing(files, documents[0], documents[1], listed, joints, items, handles, carried, source)


def _front(surface: SplitSurface, faces: np.ndarray) -> FrontRegion:
    """Return the region of a part's faces; one that was cut out as a rectangle is that rectangle again, to its corners."""
    front = region.around(surface, faces)
    flat = front.local(surface.vertices[surface.faces[faces]].reshape(-1, 3))[:, :2]
    low, high = flat.min(axis=0), flat.max(axis=0)
    if surface.areas[faces].sum() < FULL * float(np.prod(high - low)):
        return front
    return replace(front, center=front.center + front.axes @ (low + high) / 2, size=high - low)


def _carried(number: int, parent_of: Mapping[int, int | None], joints: Mapping[int, Joint]) -> tuple[int, ...]:
    """Return a part and what hangs on it without a joint of its own."""
    carried = [number]
    for part in labels.parents_first(parent_of):
        if parent_of[part] in carried and part not in joints:
            carried.append(part)
    return tuple(carried)


class _Writer:
    """Makes the records of an edited annotation."""

    def __init__(self, old: Existing, surface: SplitSurface, items: list[Item], origin: np.ndarray, same: bool) -> None:
        self._old, self._surface, self._origin, self._same = old, surface, origin, same
        self._items = {item.number: item for item in items if item.number is not None}
        self._new = [item for item in items if item.number is None]
        # Whom each face is given to anew: the number of a part, NEW, or NOBODY.
        self._given = np.full(len(surface.faces), NOBODY)
        for item in items:
            if item.number is None or not (self._front_same(item) and self._handle_same(item)):
                faces = np.union1d(item.region.faces, item.handle)
                self._given[faces] = NEW if item.number is None else item.number
        gone = set(old.items) - set(self._items)
        self._dropped = {part for number in gone for part in old.carried[number]}
        self._dropped |= {
            part for n, item in self._items.items() if not self._handle_same(item) for part in old.handles[n]
        }

    def write(self, out: Path) -> None:
        records = list(self._old.parts["data"]["annotations"])
        number = max((record["partId"] for record in records), default=0)
        paths = [labels.split(record["label"])[1] for record in records]
        index = max((int(path[0]) for path in paths if path and path[0].isdigit()), default=0)
        written, moved = [], {}
        for record in records:
            part = record["partId"]
            if part in self._dropped:
                continue
            written.append(self._part(record))
            item = self._items.get(part)
            if item is not None and not self._handle_same(item) and len(item.handle):
                number += 1
                path = ".".join(labels.split(record["label"])[1])
                written.append(_part(number, f"handle.{path or part}.{number}", item.handle))
        for item in self._new:
            number, index = number + 1, index + 1
            moved[number] = item
            written.append(_part(number, f"{item.name}.{index}", item.front))
            if len(item.handle):
                number += 1
                written.append(_part(number, f"handle.{index}.1", item.handle))
        parts_data = {**self._old.parts["data"], "annotations": written}
        if "stats" in parts_data and not self._same:
            counts = {"totalFaces": len(self._surface.faces), "totalVertices": len(self._surface.vertices)}
            parts_data["stats"] = {**parts_data["stats"], **counts}
        name, content = self._old.files.name, {**self._old.parts, "data": parts_data}
        if "labels" in content and written != records:
            content["labels"] = [record["label"] for record in written]
        _dump(out / f"{name}_parts.json", content)
        articulations = {**self._old.articulations["data"], "articulations": self._articulations(moved)}
        _dump(out / f"{name}_artic.json", {**self._old.articulations, "data": articulations})

    def _part(self, record: Document) -> Document:
        """Return the record of a part that stays, itself where nothing of it was edited."""
        number = record["partId"]
        item, faces = self._items.get(number), self._mapped(self._old.listed[number])
        if item is not None and not self._front_same(item):
            faces = item.front
        else:
            on = next((carrier for carrier, those in self._old.carried.items() if number in those), NOBODY)
            faces = faces[np.isin(self._given[faces], (NOBODY, on))]
        if not np.array_equal(faces, self._old.listed[number]):
            record = {key: value for key, value in record.items() if key != "vertIndices"}
            record["triIndices"] = faces.tolist()
        if item is not None and item.label != self._old.items[number].label:
            record = {**record, "label": ".".join([item.name, *labels.split(record["label"])[1]])}
        return record

    def _articulations(self, new: Mapping[int, Item]) -> list[Document]:
        """Return the records of all joints; where one has to be written again in radians, all are: a file has one unit."""
        records = [r for r in self._old.articulations["data"]["articulations"] if r["pid"] not in self._dropped]
        joints = {**self._old.joints, **{n: item.joint for n, item in self._items.items() if item.joint}}
        changed = [n for n, joint in joints.items() if joint != self._old.joints[n]]
        every = bool(new) or bool(changed) and any(self._in_degrees(record) for record in records)
        moves = not np.allclose(self._origin, self._old_origin(records), atol=1e-12)
        records = [
            {**record, **self._joint(joints[record["pid"]])}
            if record["pid"] in changed or moves or (every and self._in_degrees(record))
            else record
            for record in records
        ]
        return records + [{"pid": n, **self._joint(item.joint)} for n, item in new.items() if item.joint]

    def _joint(self, joint: Joint) -> Document:
        return {
            "type": articulate3d.TYPES[joint.kind],
            "axis": list(joint.axis),
            "origin": (np.array(joint.origin) + self._origin).tolist(),
            "rangeMin": joint.limits[0],
            "rangeMax": joint.limits[1],
        }

    def _in_degrees(self, record: Document) -> bool:
        return not np.allclose([record["rangeMin"], record["rangeMax"]], self._old.joints[record["pid"]].limits)

    def _old_origin(self, records: list[Document]) -> np.ndarray:
        """Return what was added to the coordinates of the file that was read [m], shape [3]."""
        if not records:
            return self._origin
        return np.array(records[0]["origin"]) - self._old.joints[records[0]["pid"]].origin

    def _front_same(self, item: Item) -> bool:
        return self._same_faces(item, lambda one: one.front)

    def _handle_same(self, item: Item) -> bool:
        return self._same_faces(item, lambda one: one.handle)

    def _same_faces(self, item: Item, of: Callable[[Item], np.ndarray]) -> bool:
        assert item.number is not None
        return np.array_equal(np.sort(of(item)), self._mapped(of(self._old.items[item.number])))

    def _mapped(self, faces: np.ndarray) -> np.ndarray:
        """Return faces of the scan that was read as what is left of them and their pieces."""
        inside = np.zeros(len(self._old.source), bool)
        inside[faces] = True
        scanned = self._surface.source != ADDED
        return np.flatnonzero(scanned & inside[np.where(scanned, self._surface.source, 0)])


def _part(number: int, label: str, faces: np.ndarray) -> Document:
    return {"partId": number, "label": label, "triIndices": faces.tolist()}


def _dump(path: Path, content: Document) -> None:
    path.write_text(json.dumps(content, separators=(",", ":")), encoding="utf-8")
