"""A mesh file -> the folder of a scan that `s2a.scan.read` reads, its textures as colours of vertices."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from s2a.core.errors import InputError
from s2a.scan import frame, labelled_boxes
from s2a.scan import source as mesh_files
from s2a.scan.folder import MESH
from s2a.scan.frame import FileFrame
from s2a.scan.labelled_boxes import LabelledBox
from s2a.scan.ply_file import write_ply
from s2a.scan.source import SourceMesh, sample
from s2a.scene.scene import Mesh

# Levels of 255 by which a texture must differ from the blend of a face's corners to be worth a split: just visible
DETAIL = 12.0
_ROUNDS = 14
_FINEST = 32  # points along an edge at which a texture is compared; a 1 cm texel then misses nothing up to 32 cm
_CHUNK = 200_000  # points sampled at once


@dataclass(frozen=True)
class Baked:
    """A connected mesh with colours, in the file's unit."""

    vertices: np.ndarray  # shape [vertex 3], float64; each position once, in the order of first use
    faces: np.ndarray  # shape [face 3], int64; the parts of a split face follow one another
    colors: np.ndarray  # RGB, shape [vertex 3], uint8
    source_face: np.ndarray  # face of the file that each face is, or is a part of; ascending, shape [face]


def bake(mesh: SourceMesh, texel: float) -> Baked:
    """Merge vertices by position, split faces along edges longer than `texel` where the texture has detail, and colour them.

    An edge is split for both faces beside it, so that the surface stays connected.

    `texel`: length of the edges to aim at where there is detail, in the file's unit.
    """
    mesh = merged(mesh)
    source_face = np.arange(len(mesh.faces))
    checked = np.zeros(len(mesh.faces), dtype=bool)  # found without detail
    for _ in range(_ROUNDS):
        edges, long = _long_edges(mesh, texel)
        ask = np.flatnonzero(~checked & long.any(axis=1))
        detailed = np.zeros(len(mesh.faces), dtype=bool)
        detailed[ask] = _detail(mesh, ask, texel)
        checked[ask] = ~detailed[ask]
        wanted = np.unique(edges[long & detailed[:, None]])
        if not len(wanted):
            break
        mesh, parent = _split(mesh, edges, wanted)
        source_face, checked = source_face[parent], checked[parent]
    colors = _vertex_colors(mesh)
    return Baked(mesh.vertices, mesh.faces, colors, source_face)


def merged(mesh: SourceMesh) -> SourceMesh:
    """Return the mesh with each position once (seams of textures double vertices), and without vertices of no face.

    Positions are compared in float32, the precision of scans, from a corner of the mesh on: map coordinates of a room (UTM) would
    round to half a metre.
    """
    used, corner = np.unique(mesh.faces, return_inverse=True)
    points = mesh.vertices[used]
    low = points.min(axis=0)
    near = np.where(np.abs(low) > np.ptp(points, axis=0).max(), points - low, points)
    _, first, group = np.unique(near.astype(np.float32), axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    faces = rank[group.ravel()][corner.reshape(-1, 3)]
    return replace(mesh, vertices=points[first[order]], faces=faces)


def _long_edges(mesh: SourceMesh, texel: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a number of each face's edges 01, 12, 20, the same from both sides, and which are longer than `texel`."""
    ends = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2), axis=2)
    lengths = np.linalg.norm(mesh.vertices[ends[..., 0]] - mesh.vertices[ends[..., 1]], axis=2)
    return ends[..., 0] * len(mesh.vertices) + ends[..., 1], lengths > texel


def _detail(mesh: SourceMesh, chosen: np.ndarray, texel: float) -> np.ndarray:
    """Return which of some faces have a texture that their corners' colours do not tell, shape [chosen]."""
    detailed = np.zeros(len(chosen), dtype=bool)
    textured = np.array([material.texture is not None for material in mesh.materials] + [False])[mesh.material[chosen]]
    corners = mesh.vertices[mesh.faces[chosen]]
    size = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).max(axis=1)
    steps = 2 ** np.ceil(np.log2(np.clip(size / texel, 2, _FINEST))).astype(int)
    for count in np.unique(steps[textured]) if textured.any() else ():
        weights = _grid(int(count))
        mine = np.flatnonzero(textured & (steps == count))
        for chunk in np.array_split(mine, max(1, len(mine) * len(weights) // _CHUNK)):
            detailed[chunk] = _differs(mesh, chosen[chunk], weights)
    return detailed


def _differs(mesh: SourceMesh, faces: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return which faces' colours differ from the blend of their corners at points with the weights [point 3]."""
    uv, given = mesh.uv[faces], mesh.colors[faces]
    corners = sample(uv, given, mesh.material[faces], mesh.materials)
    there = sample(weights @ uv, weights.astype(np.float32) @ given, mesh.material[faces], mesh.materials)
    differs: np.ndarray = np.abs(there - weights @ corners).max(axis=(1, 2)) > DETAIL
    return differs


def _grid(count: int) -> np.ndarray:
    """Return barycentric weights of points that divide each edge into `count`, shape [point 3]."""
    i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
    inside = i + j <= count
    return np.stack([count - i - j, i, j], axis=-1)[inside] / count


def _split(mesh: SourceMesh, edges: np.ndarray, wanted: np.ndarray) -> tuple[SourceMesh, np.ndarray]:
    """Cut edges in the middle; return the mesh, and the face that each of its faces was."""
    place = np.minimum(np.searchsorted(wanted, edges), len(wanted) - 1)
    cut = wanted[place] == edges
    low, high = np.divmod(wanted, len(mesh.vertices))
    middle = (mesh.vertices[low] + mesh.vertices[high]) / 2
    six = np.concatenate([mesh.faces, len(mesh.vertices) + place], axis=1)  # corners, then middles of 01, 12, 20
    pieces, owners = _pieces(cut)
    blend = np.concatenate([np.eye(3), (np.eye(3) + np.roll(np.eye(3), 1, axis=1)) / 2])[pieces]
    split = replace(
        mesh,
        vertices=np.concatenate([mesh.vertices, middle]),
        faces=np.take_along_axis(six[owners], pieces, axis=1),
        uv=blend @ mesh.uv[owners],
        colors=(blend @ mesh.colors[owners]).astype(np.float32),
        material=mesh.material[owners],
    )
    return split, owners


def _pieces(cut: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the triangles that replace each face, as positions 0..2 (corners) and 3..5 (middles), and their faces."""
    code = cut @ np.array([1, 2, 4])
    table = {0: [(0, 1, 2)], 7: [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)]}
    for turn in range(3):  # the edge from corner `turn` on is cut, alone or with the next one
        a, b, c = ((turn + k) % 3 for k in range(3))
        table[1 << a] = [(a, 3 + a, c), (3 + a, b, c)]
        table[1 << a | 1 << b] = [(3 + a, b, 3 + b), (a, 3 + a, 3 + b), (a, 3 + b, c)]
    pieces, owners = [], []
    for key, triangles in table.items():
        mine = np.flatnonzero(code == key)
        for triangle in triangles:
            pieces.append(np.broadcast_to(np.array(triangle), (len(mine), 3)))
            owners.append(mine)
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(pieces)[order], owner[order]


def _vertex_colors(mesh: SourceMesh) -> np.ndarray:
    """Return the mean colour of the corners that meet at each vertex, shape [vertex 3], uint8."""
    corners = sample(mesh.uv, mesh.colors, mesh.material, mesh.materials).reshape(-1, 3)
    count = np.bincount(mesh.faces.ravel(), minlength=len(mesh.vertices))
    total = [np.bincount(mesh.faces.ravel(), corners[:, i], len(mesh.vertices)) for i in range(3)]
    return np.clip(np.round(np.stack(total, axis=1) / count[:, None]), 0, 255).astype(np.uint8)


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
