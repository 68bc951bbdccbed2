"""Files of labelled boxes that belong to a scanned mesh: Apple's RoomPlan (JSON, USDZ) and ARKitScenes (JSON)."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Tf, Usd, UsdGeom

from s2a.core.errors import InputError
from s2a.scan.labelled_boxes import LabelledBox

_OBJECTS = "Object_grp"  # the prim below which RoomPlan puts its objects
_GROUPS = ("objects", "walls", "doors", "windows", "openings", "floors")
_LAYOUTS = "RoomPlan's JSON or USDZ, or ARKitScenes' *_3dod_annotation.json"


def recognise(path: Path) -> bool:
    """Return True for a file of labelled boxes."""
    return _reader(path) is not None


def read(path: Path) -> list[LabelledBox]:
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
    """Return the reader of a file's layout."""
    if path.suffix.lower() == ".usdz":
        return _roomplan_usdz if _objects(_stage(path)) else None
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
    data = json.loads(path.read_bytes())
    return [_captured(record, group) for group in _GROUPS for record in data.get(group, [])]


def _captured(record: dict[str, Any], group: str) -> LabelledBox:
    """Return one surface or object of a captured room; its transform is stored column by column."""
    transform = np.array(record["transform"], dtype=float).reshape(4, 4).T
    category = record.get("category") if group == "objects" else None
    label = next(iter(category)) if isinstance(category, dict) else category or group.removesuffix("s")
    size = np.array(record["dimensions"], dtype=float).reshape(3)
    return LabelledBox(_words(str(label)), transform[:3, 3], transform[:3, :3].T, size)


def _roomplan_usdz(path: Path) -> list[LabelledBox]:
    """Return the boxes around the meshes of RoomPlan's objects, along the axes of their prims."""
    cache, stage, boxes = UsdGeom.XformCache(), _stage(path), []
    for prim in _objects(stage):
        points = np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get(), dtype=float).reshape(-1, 3)
        matrix = np.array(cache.GetLocalToWorldTransform(prim))
        scale = np.linalg.norm(matrix[:3, :3], axis=1)
        low, high = points.min(axis=0), points.max(axis=0)
        center = (low + high) / 2 @ matrix[:3, :3] + matrix[3, :3]
        label = prim.GetParent().GetName().removesuffix("_grp")
        boxes.append(LabelledBox(_words(label), center, matrix[:3, :3] / scale[:, None], (high - low) * scale))
    return boxes


def _stage(path: Path) -> Usd.Stage | None:
    try:
        return Usd.Stage.Open(str(path))
    except Tf.ErrorException:
        return None


def _objects(stage: Usd.Stage | None) -> list[Usd.Prim]:
    """Return the meshes of RoomPlan's objects; empty for any other file."""
    prims = stage.Traverse() if stage else []
    return [prim for prim in prims if prim.IsA(UsdGeom.Mesh) and f"/{_OBJECTS}/" in str(prim.GetPath())]


def _words(label: str) -> str:
    """Return "washer dryer" for "washerDryer" and for "Washer_Dryer"."""
    spaced = "".join(f" {letter}" if letter.isupper() else letter for letter in label.replace("_", " "))
    return " ".join(spaced.lower().split())
