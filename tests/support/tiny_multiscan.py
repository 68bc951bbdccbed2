"""The tiny scan's ten triangles as MultiScan annotates them: a cabinet, a bag, a sliding door, something to remove."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from tiny_scan import COLORS, FACES, VERTICES

from s2a import scan
from s2a.scene.scene import Scene

NAME = "scene_00042_01"
ANNOTATIONS = f"{NAME}.annotations.json"
SEMSEG = f"{NAME}.semseg.json"
PLY = f"{NAME}.ply"
IDS = np.array([(1, 1), (1, 1), (1, 2), (1, 2), (1, 3), (2, 4), (3, 5), (3, 6), (4, 7), (0, 0)])
TURN = dict(type="rotation", origin=[1.0, 0.5, 0.25], axis=[0, 0, -2], rangeMin=0, rangeMax=1.5, state=0, isClosed=True)
SLIDE = TURN | dict(type="translation", axis=[0, 1, 0], rangeMin=-0.25, rangeMax=0.5)


def released() -> dict[str, Any]:
    """Return the annotation in the released schema, as JSON values that a test may change before it writes them."""
    objects = [("wall_cabinet.1", "fixed", [1, 2, 3]), ("bag.1", "movable", [4]), ("door.1", "fixed", [5, 6])]
    objects += [("remove", "unknown", [7])]
    parts: list[dict[str, Any]] = [
        {"label": "wall_cabinet.1"},
        {"label": "door.1", "parentId": 1, "articulations": [dict(TURN)]},
        {"label": "shelf.1", "parentId": 1},
        {"label": "bag.1"},
        {"label": "door.1", "parentId": 6, "articulations": [dict(SLIDE)]},
        {"label": "door_frame.1"},
        {"label": "remove"},
    ]
    return {
        "version": "multiscan@0.0.1",
        "scanId": NAME,
        "objects": [
            {"objectId": i, "label": label, "mobilityType": mobility, "partIds": ids}
            for i, (label, mobility, ids) in enumerate(objects, start=1)
        ],
        "parts": [{"partId": i} | part for i, part in enumerate(parts, start=1)],
    }


def older() -> dict[str, Any]:
    """Return the same annotation in the older schema."""
    objects = [("wall_cabinet.1", ["door.1", "shelf.1", "wall_cabinet.1"]), ("bag.1", None)]
    objects += [("door.1", ["door.1", "door_frame.1"]), ("remove", None)]
    return {
        "scanId": NAME,
        "objects": [{"label": label} | ({"parts": parts} if parts else {}) for label, parts in objects],
        "articulations": {"wall_cabinet.1:door.1": dict(TURN), "door.1:door.1": dict(SLIDE)},
    }


def semseg() -> dict[str, Any]:
    """Return the older schema's lists of faces."""
    lists = {"wall_cabinet.1:wall_cabinet.1": [0, 1], "wall_cabinet.1:door.1": [2, 3], "wall_cabinet.1:shelf.1": [4]}
    lists |= {"bag.1": [5], "door.1:door.1": [6], "door.1:door_frame.1": [7], "remove": [8]}
    return {"scanId": NAME, "triIndices": lists}


def write(folder: Path, annotation: dict[str, Any], mesh: bytes, faces: dict[str, Any] | None = None) -> Path:
    """Write a scan folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / PLY).write_bytes(mesh)
    (folder / ANNOTATIONS).write_text(json.dumps(annotation))
    if faces is not None:
        (folder / SEMSEG).write_text(json.dumps(faces))
    return folder


def write_released(folder: Path, annotation: dict[str, Any] | None = None, ids: np.ndarray = IDS) -> Path:
    """Write a scan folder in the released schema."""
    return write(folder, annotation or released(), ply(ids))


def write_older(folder: Path, annotation: dict[str, Any] | None = None, faces: dict[str, Any] | None = None) -> Path:
    """Write a scan folder in the older schema, whose mesh has no ids."""
    return write(folder, annotation or older(), ply(None), faces or semseg())


def read_released(tmp_path: Path, annotation: dict[str, Any] | None = None, ids: np.ndarray = IDS) -> Scene:
    """Write a scan in the released schema and read it."""
    return scan.read(write_released(tmp_path / "scan", annotation, ids))


def read_older(tmp_path: Path, annotation: dict[str, Any] | None = None, faces: dict[str, Any] | None = None) -> Scene:
    """Write a scan in the older schema and read it."""
    return scan.read(write_older(tmp_path / "older", annotation, faces))


def ply(ids: np.ndarray | None = IDS, shift: tuple[float, float, float] = (0, 0, 0), text: bool = False) -> bytes:
    """Return the mesh with MultiScan's header: doubles, normals, alpha, and objectId and partId of each face."""
    points = [(*(p + np.array(shift)).tolist(), 0.0, 0.0, 1.0) for p in VERTICES]
    rows = np.array(
        [(*p, *c, 255) for p, c in zip(points, COLORS.tolist(), strict=True)],
        dtype=[(f"f{i}", "<f8") for i in range(6)] + [(f"c{i}", "u1") for i in range(4)],
    )
    with_ids = np.zeros((len(FACES), 0), dtype=int) if ids is None else ids
    columns = (
        [("n", "u1")] + [(f"v{i}", "<i4") for i in range(3)] + [(f"i{i}", "<u2") for i in range(with_ids.shape[1])]
    )
    faces = np.array([(3, *f, *i) for f, i in zip(FACES.tolist(), with_ids.tolist(), strict=True)], dtype=columns)
    header = ["ply", f"format {'ascii' if text else 'binary_little_endian'} 1.0", f"element vertex {len(rows)}"]
    header += [f"property double {name}" for name in ("x", "y", "z", "nx", "ny", "nz")]
    header += [f"property uchar {name}" for name in ("red", "green", "blue", "alpha")]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    header += [f"property ushort {name}" for name in ("objectId", "partId")[: with_ids.shape[1]]] + ["end_header", ""]
    lines = "".join(" ".join(map(str, row)) + "\n" for row in [*rows.tolist(), *faces.tolist()]).encode()
    return "\n".join(header).encode() + (lines if text else rows.tobytes() + faces.tobytes())
