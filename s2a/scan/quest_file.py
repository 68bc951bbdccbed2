"""Scenes of a Meta Quest headset, as the npm package @iwer/sem holds them: a mesh, and labelled boxes and planes."""

from __future__ import annotations

import base64
import binascii
import json
from pathlib import Path
from typing import Any

import numpy as np

from s2a.core.errors import InputError
from s2a.scan.labelled_boxes import LabelledBox, without_doubles
from s2a.scan.source import SourceMesh, Stated, colored

SUFFIX = ".json"

_ENTITIES, _LABEL, _PLACE = "spatialEntities", "semanticLabel_META", "locatable_META"
_MESH, _BOX, _PLANE = "triangleMesh_META", "bounded3D_META", "bounded2D_META"
_HEAD = 4096  # bytes in which the file's own keys are named


def recognise(path: Path) -> bool:
    """Return True for a JSON file whose beginning names the headset's entities."""
    if path.suffix.lower() != SUFFIX or not path.is_file():
        return False
    with path.open("rb") as file:
        return f'"{_ENTITIES}"'.encode() in file.read(_HEAD)


def read(path: Path) -> tuple[SourceMesh, list[LabelledBox]]:
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
    """Return the vertices of a mesh, placed, shape [vertex 3], and its faces, shape [face 3]."""
    vertices = np.frombuffer(base64.b64decode(entity[_MESH]["vertices"], validate=True), "<f4").reshape(-1, 3)
    faces = np.frombuffer(base64.b64decode(entity[_MESH]["indices"], validate=True), "<u4").reshape(-1, 3)
    rotation, position = _pose(entity)
    return vertices.astype(np.float64) @ rotation.T + position, faces.astype(np.int64)


def _box(entity: dict[str, Any]) -> LabelledBox:
    """Return the box or plane of a labelled entity, placed."""
    solid = _BOX in entity
    shape = entity[_BOX] if solid else entity[_PLANE]
    offset = _vector(shape["offset"], "xyz" if solid else "xy")
    size = _vector(shape["extent"], ("width", "height", "depth")[: len(offset)])
    offset, size = (np.pad(values, (0, 3 - len(values))) for values in (offset, size))
    rotation, position = _pose(entity)
    label = str(entity[_LABEL]).lower().replace("_", " ").removesuffix(" face")
    return LabelledBox(label, rotation @ (offset + size / 2) + position, rotation.T, size)


def _pose(entity: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return the rotation [3 3] and the position [3] of an entity."""
    w, x, y, z = _vector(entity[_PLACE]["orientation"], "wxyz")
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    return rotation, _vector(entity[_PLACE]["position"], "xyz")


def _vector(values: dict[str, Any], keys: str | tuple[str, ...]) -> np.ndarray:
    vector = np.array([float(values[key]) for key in keys])
    if not np.isfinite(vector).all():
        raise ValueError(f"{values} is not finite")
    return vector
