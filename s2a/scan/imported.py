"""A mesh file -> the folder of a scan that `s2a.scan.read` reads."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from s2a.core.errors import InputError
from s2a.scan import frame, labelled_boxes
from s2a.scan import source as mesh_files
from s2a.scan.bake import Baked, bake
from s2a.scan.folder import MESH
from s2a.scan.frame import FileFrame
from s2a.scan.labelled_boxes import LabelledBox
from s2a.scan.ply_file import write_ply
from s2a.scan.source import SourceMesh
from s2a.scene.scene import Mesh

RECORD = "import.json"  # By this file a folder is known to be an earlier import; it says what was found
# Face of the file of each face of the scan, shape [face], int32; written where faces were split
SOURCE_FACES = "source_faces.npy"
_FAR = 100.0  # [m]; from here on float32 rounds coordinates by 8 um or more


@dataclass(frozen=True)
class Imported:
    """What became of a mesh file."""

    frame: FileFrame  # up axis and unit
    baked: Baked  # the connected mesh, in the file's coordinates
    mesh: Mesh  # the scan
    offset: np.ndarray  # scan's coordinates less the file's turned and scaled ones [m], shape [3]
    source_faces: int  # number of faces in the file
    degenerate: int  # number of faces without area, which keep their places
    boxes: tuple[LabelledBox, ...] = ()  # labelled boxes of the capture, in the scan's coordinates [m]


def convert(
    path: Path,
    texel: float,
    up: str | Sequence[float],
    unit: str,
    floor: bool,
    level: bool = False,
    labels: Path | None = None,
) -> Imported:
    """Read a mesh file and turn it into a scan: z up, metres, vertex colours, faces in their order.

    Args:
        path: GLB, glTF, OBJ, PLY or USD.
        texel: length of the edges to aim at where a texture has detail [m].
        up: a key of `frame.UP`, a vector, or "auto".
        unit: a key of `frame.UNITS`, or "auto".
        floor: Move the floor to z 0.
        level: Correct a small tilt of the up direction to the floor's.
        labels: file of labelled boxes in the mesh's coordinates; None for those that the file itself holds.

    Raises:
        InputError: the file is damaged, or neither it nor the room tells up axis or unit.
    """
    if labelled_boxes.recognise_quest(path):
        source, boxes = labelled_boxes.read_quest(path)
    else:
        source, boxes = mesh_files.read(path), []
    if labels or labelled_boxes.recognise_boxes(path):
        boxes = [*boxes, *labelled_boxes.read_boxes(labels or path)]
    return place(path, source, boxes, texel, up, unit, floor, level)


def place(
    path: Path,
    source: SourceMesh,
    boxes: Sequence[LabelledBox],
    texel: float,
    up: str | Sequence[float],
    unit: str,
    floor: bool,
    level: bool,
    cameras: np.ndarray | None = None,
) -> Imported:
    """Turn a mesh and its labelled boxes into a scan.

    `cameras`: up direction that the poses of cameras speak for, shape [3]; None without cameras.

    Raises:
        InputError: neither the file nor the room tells up axis or unit.
    """
    labelled = labelled_boxes.upwards(boxes)
    hint = frame.Hint(labelled, "the labels") if labelled is not None else None
    hint = frame.Hint(cameras, "the cameras") if cameras is not None else hint
    try:
        file_frame = frame.find(
            source.vertices, source.faces, source.stated, up, unit, level, frame.by_name(path), hint
        )
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    baked = bake(source, texel / file_frame.unit)
    points = file_frame.apply(baked.vertices)
    offset = _offset(points, baked.faces, floor)
    mesh = Mesh(points + offset, baked.faces, baked.colors)
    placed = tuple(box.moved(file_frame.rotation, file_frame.unit, offset) for box in boxes)
    return Imported(file_frame, baked, mesh, offset, len(source.faces), int((mesh.face_areas == 0).sum()), placed)


def write(done: Imported, source: Path, folder: Path) -> int:
    """Write the scan's mesh, its labelled objects, what was found, and the map of faces that were split, into a new folder.

    Returns:
        Number of labelled objects.
    """
    folder.mkdir()
    write_ply(folder / MESH, done.mesh)
    if len(done.mesh.faces) != done.source_faces:
        np.save(folder / SOURCE_FACES, done.baked.source_face.astype(np.int32))
    labelled = labelled_boxes.write(folder, done.mesh.vertices, done.boxes) if done.boxes else 0
    (folder / RECORD).write_text(json.dumps(record(done, source), indent=1), encoding="utf-8")
    return labelled


def record(done: Imported, source: Path) -> dict[str, Any]:
    """Return what was found and done, for the folder: x_scan = matrix @ (x_file, 1)."""
    return {
        "source": source.name,
        "up": done.frame.name if done.frame.name in frame.UP else list(done.frame.up),
        "confidence": done.frame.confidence,
        "up_evidence": done.frame.why_up,
        "metres_per_unit": done.frame.unit,
        "unit_evidence": done.frame.why_unit,
        "matrix": matrix(done).tolist(),
        "source_faces": done.source_faces,
        "faces": len(done.mesh.faces),
        "vertices": len(done.mesh.vertices),
        "degenerate_faces": done.degenerate,
    }


def matrix(done: Imported) -> np.ndarray:
    """Return the transform from the file's coordinates to the scan's, shape [4 4]."""
    transform = np.eye(4)
    transform[:3, :3] = done.frame.rotation * done.frame.unit
    transform[:3, 3] = done.offset
    return transform


def _offset(points: np.ndarray, faces: np.ndarray, floor: bool) -> np.ndarray:
    """Return the translation [m], shape [3], that puts the floor to z 0 and brings a far scan to zero."""
    offset = np.zeros(3)
    if np.abs(points).max() > _FAR:
        offset = -points.min(axis=0)
    if floor:
        offset[2] = -_floor_height(points, faces)
    return offset


def _floor_height(points: np.ndarray, faces: np.ndarray) -> float:
    """Return the height of the level faces at the bottom [m]: the fullest centimetre of the lowest 0.4 m, or the lowest point."""
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normals, axis=1)
    heights = corners[..., 2].mean(axis=1)
    low = np.quantile(points[:, 2], 0.001)
    level = (normals[:, 2] > 0.95 * area) & (heights > low - 0.05) & (heights < low + 0.4) & (area > 0)
    if not level.any():
        return float(points[:, 2].min())
    bins = np.floor((heights[level] - low) / 0.01).astype(int)
    full = np.bincount(bins - bins.min(), area[level])
    near = np.abs(bins - bins.min() - full.argmax()) <= 1
    return float(np.average(heights[level][near], weights=area[level][near]))
