"""A scan of ten triangles with all that a real one has: door frame, door, handle base, handle; a chair; a rest."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from s2a import scan
from s2a.core.errors import InputError
from s2a.scene.scene import Part, Scene

NAME = "0a5c013435"
VERTICES = np.array([[i * 0.5, i % 2, 0.1 * i] for i in range(12)])
FACES = np.array([[i, i + 1, i + 2] for i in range(10)])
COLORS = np.array([[i, 2 * i, 255 - i] for i in range(12)], dtype=np.uint8)
PLY = "mesh_aligned_0.05.ply"
PARTS = f"{NAME}_parts.json"
ARTIC = f"{NAME}_artic.json"


def contents() -> dict[str, Any]:
    """Return the four annotation files by name, as JSON values that a test may change before it writes them."""
    parts = [(1, "door frame.1", [0, 1]), (3, "door.1.2", [2, 3]), (4, "handle base.1.2.1", [4])]
    parts += [(5, "handle.1.2.1.1", [5])]
    joint = dict(pid=3, type="rotation", origin=[1.0, 0.5, 0.25], axis=[0, 0, 1], base=[1], rangeMin=0, rangeMax=1.57)
    return {
        PARTS: {
            "modelId": f"scannetpp.{NAME}",
            "labels": [label for _, label, _ in parts],
            "data": {
                "stats": {"totalFaces": len(FACES), "totalVertices": len(VERTICES)},
                "annotations": [annotation(*part) for part in parts],
            },
        },
        ARTIC: {"modelId": f"scannetpp.{NAME}", "data": {"articulations": [joint]}},
        "segments.json": {"segIndices": list(range(12))},
        "segments_anno.json": {
            "segGroups": [
                {"id": 1, "objectId": 1, "label": "door", "segments": [0, 1, 2, 3, 4, 5, 6, 7]},
                {"id": 2, "objectId": 2, "label": "office chair", "segments": [8, 9, 10]},
            ]
        },
    }


def annotation(number: int, label: str, faces: list[int]) -> dict[str, Any]:
    """Return one part as `_parts.json` holds it."""
    vertices = sorted({int(vertex) for face in faces for vertex in FACES[face]}) if max(faces, default=0) < 10 else []
    return {"partId": number, "objectId": number, "label": label, "triIndices": faces, "vertIndices": vertices}


def write(folder: Path, files: dict[str, Any] | None = None, mesh: bytes | None = None) -> Path:
    """Write a scan folder: by default the tiny scan as it is."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / PLY).write_bytes(ply() if mesh is None else mesh)
    for name, content in (contents() if files is None else files).items():
        (folder / name).write_text(json.dumps(content))
    return folder


def read(tmp_path: Path, files: dict[str, Any] | None = None, mesh: bytes | None = None) -> Scene:
    """Write a scan, the tiny one by default, and read it."""
    return scan.read(write(tmp_path / "scan", files, mesh))


def triangles(part: Part) -> np.ndarray:
    """Return the corners of a part's faces [m], shape [face 3 3]."""
    return part.mesh.vertices[part.mesh.faces]


def corners(*faces: int) -> np.ndarray:
    """Return the corners of some faces of the tiny scan [m], shape [face 3 3]."""
    return VERTICES[FACES[list(faces)]].astype(np.float32)


def assert_refused(path: Path, *words: str) -> None:
    """Check that reading fails in one line that names the path and contains the words."""
    with pytest.raises(InputError) as caught:
        scan.read(path)
    message = str(caught.value)
    assert "\n" not in message and str(path) in message and len(message) < 500, message
    missing = [word for word in words if not re.search(rf"(?<![\w-]){re.escape(word)}(?!\w)", message)]
    assert not missing, f"{missing} not in: {message}"


def labels_of(tree: dict[int, int | None], names: dict[int, str] | None = None) -> dict[int, str]:
    """Label parts by their place in a tree, as annotators do: "name.1", "name.1.1", "name.1.2" ..."""
    position: dict[int, int] = {}
    counted: dict[int | None, int] = {}
    for number, parent in tree.items():
        counted[parent] = position[number] = counted.get(parent, 0) + 1

    def path(number: int) -> str:
        parent = tree[number]
        return f"{'' if parent is None else path(parent)}.{position[number]}"

    return {number: f"{(names or {}).get(number, 'thing')}{path(number)}" for number in tree}


def ply(
    vertices: np.ndarray = VERTICES,
    faces: np.ndarray = FACES,
    colors: np.ndarray | None = COLORS,
    double: bool = False,
    extras: bool = False,
    text: bool = False,
) -> bytes:
    """Return a PLY file: binary or text, float or double, with or without normals, alpha and a face property."""
    scalar = "f8" if double else "f4"
    columns = [(name, scalar, vertices[:, i]) for i, name in enumerate("xyz")]
    columns += [(f"n{axis}", scalar, np.linspace(0, 1, len(vertices))) for axis in "xyz"] if extras else []
    if colors is not None:
        columns += [(name, "u1", colors[:, i]) for i, name in enumerate(("red", "green", "blue"))]
        columns += [("alpha", "u1", np.full(len(vertices), 255))] if extras else []
    rows = np.empty(len(vertices), dtype=[(name, f"<{kind}") for name, kind, _ in columns])
    for name, _, values in columns:
        rows[name] = values
    face_rows = np.empty(len(faces), [("n", "u1"), ("v", "<i4", faces.shape[1])] + [("id", "<u2")] * extras)
    face_rows["n"], face_rows["v"] = faces.shape[1], faces
    if extras:
        face_rows["id"] = 7
    types = {"f4": "float", "f8": "double", "u1": "uchar"}
    header = ["ply", f"format {'ascii' if text else 'binary_little_endian'} 1.0", f"element vertex {len(vertices)}"]
    header += [f"property {types[kind]} {name}" for name, kind, _ in columns]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    header += ["property ushort objectId"] * extras + ["end_header", ""]
    body = _lines(rows) + _lines(face_rows) if text else rows.tobytes() + face_rows.tobytes()
    return "\n".join(header).encode() + body


def _lines(rows: np.ndarray) -> bytes:
    """Return the rows of a structured array as text."""
    flat = (" ".join(str(x) for value in row for x in np.atleast_1d(value)) for row in rows.tolist())
    return "".join(f"{line}\n" for line in flat).encode()
