"""Labelled boxes and rectangles of a capture -> the objects of a scan: RoomPlan's, ARKitScenes' and Quest's files."""

from __future__ import annotations

import base64
import binascii
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Tf, Usd, UsdGeom
from scipy.spatial.transform import Rotation

from s2a.core.errors import InputError
from s2a.scan.folder import GROUPS, SEGMENTS
from s2a.scan.source import SourceMesh, Stated, colored

MARGIN = 0.05  # How far outside of its box a surface may lie [m]: capture programs fit boxes to rough surfaces
FLAT_MARGIN = 0.12  # How far from its rectangle a wall, a floor or a door may lie [m]

_FLAT = 0.02  # [m]; thinner boxes are rectangles


@dataclass(frozen=True, eq=False)
class LabelledBox:
    """A box around an object, or a rectangle on a wall, which is a box without thickness."""

    label: str  # kind of object ("couch")
    center: np.ndarray  # middle of the box, shape [3]
    axes: np.ndarray  # unit vectors along its edges, one a row, shape [3 3]
    size: np.ndarray  # lengths of its edges, in the order of `axes`, shape [3]

    @property
    def is_flat(self) -> bool:
        """True for a rectangle."""
        return bool(self.size.min() < _FLAT)

    def moved(self, rotation: np.ndarray, scale: float, offset: np.ndarray) -> LabelledBox:
        """Return the box turned by a rotation [3 3], scaled, and then shifted by an offset [3]."""
        center, size = scale * (rotation @ self.center) + offset, scale * self.size
        return replace(self, center=center, axes=self.axes @ rotation.T, size=size)

    def holds(self, points: np.ndarray) -> np.ndarray:
        """Return which points [m], shape [point 3], lie in the box or near its border, shape [point]."""
        margin = np.where(self.size < _FLAT, FLAT_MARGIN, MARGIN)
        inside: np.ndarray = (np.abs((points - self.center) @ self.axes.T) <= self.size / 2 + margin).all(axis=1)
        return inside


def without_doubles(boxes: Sequence[LabelledBox]) -> list[LabelledBox]:
    """Return boxes without the rectangles that are a face of a box with the same label (a table's top)."""
    solid = [box for box in boxes if not box.is_flat]
    return [
        box
        for box in boxes
        if not box.is_flat or not any(one.label == box.label and one.holds(box.center[None])[0] for one in solid)
    ]


def upwards(boxes: Sequence[LabelledBox]) -> np.ndarray | None:
    """Return the up direction, unit, shape [3]: square to the largest labelled floor, to the side where all else is.

    None without a labelled floor, or where the other boxes' middles are not on one side of it.
    """
    floors = [box for box in boxes if box.label == "floor"]
    if not floors:
        return None
    floor = max(floors, key=lambda box: float(np.sort(box.size)[1:].prod()))
    normal: np.ndarray = floor.axes[int(np.argmin(floor.size))]
    heights = np.array([(box.center - floor.center) @ normal for box in boxes if box.label != "floor"])
    above, below = (int((side > FLAT_MARGIN).sum()) for side in (heights, -heights))
    return None if min(above, below) * 4 >= max(above, below) else normal * (1.0 if above > below else -1.0)


def owners(points: np.ndarray, boxes: Sequence[LabelledBox]) -> np.ndarray:
    """Return the box that each point [m], shape [point 3], belongs to, or -1, shape [point].

    A point in several boxes belongs to the smallest; rectangles take what no box holds.
    """
    owner = np.full(len(points), -1)
    order = sorted(range(len(boxes)), key=lambda i: (boxes[i].is_flat, float(np.sort(boxes[i].size)[1:].prod())))
    for index in order:
        owner[(owner < 0) & boxes[index].holds(points)] = index
    return owner


def write(folder: Path, vertices: np.ndarray, boxes: Sequence[LabelledBox]) -> int:
    """Write the objects in boxes as ScanNet++'s segments beside a scan's mesh; return their number.

    Args:
        folder: of the scan.
        vertices: of its mesh [m], shape [vertex 3].
        boxes: in the same coordinates [m].
    """
    owner = owners(vertices, boxes)
    objects = [index for index in range(len(boxes)) if (owner == index).any()]
    groups = [
        {"id": number, "objectId": number, "label": boxes[index].label, "segments": [index + 1]}
        for number, index in enumerate(objects, start=1)
    ]
    for name, data in ((SEGMENTS, {"segIndices": (owner + 1).tolist()}), (GROUPS, {"segGroups": groups})):
        (folder / name).write_text(json.dumps(data, separators=(",", ":")), encoding="utf-8")
    return len(objects)


# Prims below which RoomPlan puts its objects; its walls, doors, windows and openings; and its floors
_ROOMPLAN = ("Object_grp", "Arch_grp", "Floor_grp")
_GROUPS = ("objects", "walls", "doors", "windows", "openings", "floors")
_LAYOUTS = "RoomPlan's JSON or USDZ, or ARKitScenes' *_3dod_annotation.json"


def recognise_boxes(path: Path) -> bool:
    """Return True for a file of labelled boxes."""
    return _reader(path) is not None


def read_boxes(path: Path) -> list[LabelledBox]:
    """Read the labelled boxes of a file, in the coordinates of the mesh that it belongs to.

    Raises:
        InputError: no such file, an unknown or damaged one, or one without boxes.
    """
    if not path.is_file():
        raise InputError(f"labels {str(path)!r} does not exist; give {_LAYOUTS}")
    reader = _reader(path)
    if reader is None:
        raise InputError(f"{path}: holds no labelled boxes; possible: {_LAYOUTS}")
    try:
        boxes = reader(path)
        finite = all(np.isfinite(np.concatenate([box.center, box.size, box.axes.ravel()])).all() for box in boxes)
    except (ValueError, KeyError, TypeError, AttributeError, IndexError) as error:
        reason = " ".join(f"{type(error).__name__} {error}".split())[:120]
        raise InputError(f"{path}: truncated or damaged ({reason}); export it again") from error
    if not boxes or not finite:
        raise InputError(f"{path}: {'a box is not finite' if boxes else 'holds no box'}; export it again")
    return boxes


def _reader(path: Path) -> Callable[[Path], list[LabelledBox]] | None:
    if path.suffix.lower() == ".usdz":
        return _roomplan_usdz if _shapes(_stage(path)) else None
    if path.suffix.lower() != ".json" or not path.is_file():
        return None
    try:
        data = json.loads(path.read_bytes())
    except ValueError:
        return None
    if isinstance(data, dict) and isinstance(data.get("data"), list):
        return _arkitscenes
    return _roomplan_json if isinstance(data, dict) and isinstance(data.get("objects"), list) else None


def _arkitscenes(path: Path) -> list[LabelledBox]:
    boxes = []
    for record in json.loads(path.read_bytes())["data"]:
        box = record["segments"]["obbAligned"]
        axes = np.array(box["normalizedAxes"], dtype=float).reshape(3, 3)
        center, size = (np.array(box[key], dtype=float).reshape(3) for key in ("centroid", "axesLengths"))
        boxes.append(LabelledBox(str(record["label"]).replace("_", " "), center, axes, size))
    return boxes


def _roomplan_json(path: Path) -> list[LabelledBox]:
    data, boxes = json.loads(path.read_bytes()), []
    for group in _GROUPS:
        for record in data.get(group, []):
            columns = np.array(record["transform"], dtype=float).reshape(4, 4)  # stored column by column
            category = record.get("category") if group == "objects" else None
            label = next(iter(category)) if isinstance(category, dict) else category or group.removesuffix("s")
            size = np.array(record["dimensions"], dtype=float).reshape(3)
            boxes.append(LabelledBox(_words(str(label)), columns[3, :3], columns[:3, :3], size))
    return boxes


def _roomplan_usdz(path: Path) -> list[LabelledBox]:
    """Return the boxes around RoomPlan's shapes, meshes and cubes alike, along the axes of their prims ("Table0")."""
    cache, boxes = UsdGeom.XformCache(), []
    for prim in _shapes(stage := _stage(path)):
        extent = UsdGeom.Boundable.ComputeExtentFromPlugins(UsdGeom.Boundable(prim), 0)
        if not extent or np.array(extent[1] - extent[0]).min() < 0.0:
            continue  # a mesh without points
        low, high = np.array(extent, dtype=float)
        matrix = np.array(cache.GetLocalToWorldTransform(prim))
        scale = np.linalg.norm(matrix[:3, :3], axis=1)
        center = (low + high) / 2 @ matrix[:3, :3] + matrix[3, :3]
        label = _words(prim.GetName().rstrip("0123456789"))
        boxes.append(LabelledBox(label, center, matrix[:3, :3] / scale[:, None], (high - low) * scale))
    del stage  # a prim lives as long as its stage
    return boxes


def _stage(path: Path) -> Usd.Stage | None:
    try:
        return Usd.Stage.Open(str(path))
    except Tf.ErrorException:
        return None


def _shapes(stage: Usd.Stage | None) -> list[Usd.Prim]:
    """Return the shapes of RoomPlan's objects, walls and floors; empty for any other file."""
    prims = stage.Traverse() if stage else []
    names = {f"{name}/" for name in _ROOMPLAN}
    return [p for p in prims if p.IsA(UsdGeom.Gprim) and any(f"/{name}" in f"{p.GetPath()}/" for name in names)]


def _words(label: str) -> str:
    """Return "washer dryer" for "washerDryer" and for "Washer_Dryer"."""
    spaced = "".join(f" {letter}" if letter.isupper() else letter for letter in label.replace("_", " "))
    return " ".join(spaced.lower().split())


SUFFIX = ".json"

_ENTITIES, _LABEL, _PLACE = "spatialEntities", "semanticLabel_META", "locatable_META"
_MESH, _BOX, _PLANE = "triangleMesh_META", "bounded3D_META", "bounded2D_META"
_EXTENT = ("width", "height", "depth")
_HEAD = 4096  # bytes in which the file's own keys are named


def recognise_quest(path: Path) -> bool:
    """Return True for a JSON file whose beginning names the headset's entities."""
    if path.suffix.lower() != SUFFIX or not path.is_file():
        return False
    with path.open("rb") as file:
        return f'"{_ENTITIES}"'.encode() in file.read(_HEAD)


def read_quest(path: Path) -> tuple[SourceMesh, list[LabelledBox]]:
    """Read the mesh, y up and in metres, and the labelled boxes and planes in its coordinates.

    Raises:
        InputError: a damaged file, or one without a mesh.
    """
    try:
        entities = json.loads(path.read_bytes())[_ENTITIES]
        meshes = [_triangles(entity) for entity in entities if _MESH in entity]
        boxes = [_box(entity) for entity in entities if _LABEL in entity and (_BOX in entity or _PLANE in entity)]
    except (ValueError, KeyError, TypeError, AttributeError, binascii.Error) as error:
        reason = " ".join(f"{type(error).__name__} {error}".split())[:120]
        raise InputError(f"{path}: truncated or damaged ({reason}); save the scene again") from error
    if not meshes:
        raise InputError(f"{path}: holds no {_MESH}; save the scene with its mesh")
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    vertices = np.concatenate([vertices for vertices, _ in meshes])
    faces = np.concatenate([faces + start for (_, faces), start in zip(meshes, starts, strict=False)])
    if len(faces) and faces.max() >= len(vertices):
        raise InputError(f"{path}: a face names vertex {faces.max()} of {len(vertices)}; save the scene again")
    mesh = colored(vertices, faces, None, Stated("y", 1.0, "a Quest scene"))
    return mesh, without_doubles(boxes)


def _triangles(entity: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    vertices = np.frombuffer(base64.b64decode(entity[_MESH]["vertices"], validate=True), "<f4").reshape(-1, 3)
    faces = np.frombuffer(base64.b64decode(entity[_MESH]["indices"], validate=True), "<u4").reshape(-1, 3)
    rotation, position = _pose(entity)
    return vertices.astype(np.float64) @ rotation.T + position, faces.astype(np.int64)


def _box(entity: dict[str, Any]) -> LabelledBox:
    if _BOX in entity:
        offset, size = _vector(entity[_BOX]["offset"], "xyz"), _vector(entity[_BOX]["extent"], _EXTENT)
    else:  # a rectangle lies across y, as WebXR's planes: its offset and extent are along x and z
        offset, size = (
            np.array([along_x, 0.0, along_z])
            for along_x, along_z in (
                _vector(entity[_PLANE]["offset"], "xy"),
                _vector(entity[_PLANE]["extent"], _EXTENT[:2]),
            )
        )
    rotation, position = _pose(entity)
    label = str(entity[_LABEL]).lower().replace("_", " ").removesuffix(" face")
    return LabelledBox(label, rotation @ (offset + size / 2) + position, rotation.T, size)


def _pose(entity: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return the rotation [3 3] and the position [3] of an entity."""
    rotation = Rotation.from_quat(_vector(entity[_PLACE]["orientation"], "xyzw")).as_matrix()
    return rotation, _vector(entity[_PLACE]["position"], "xyz")


def _vector(values: dict[str, Any], keys: str | tuple[str, ...]) -> np.ndarray:
    vector = np.array([float(values.get(key, 0.0)) for key in keys])  # protobuf's JSON leaves out zeros
    if not np.isfinite(vector).all():
        raise ValueError(f"{values} is not finite")
    return vector
