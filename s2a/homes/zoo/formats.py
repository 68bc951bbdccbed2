"""Files of coloured meshes, as modellers export them: the coordinates as they are, the colours in each format's own way."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from pxr import Usd, UsdGeom, Vt

from s2a.color_space import to_linear
from s2a.scene.scene import Mesh
from s2a.scene.usd.stage import save

UP_AXES = {"+y": UsdGeom.Tokens.y, "+z": UsdGeom.Tokens.z}
"""What USD can say of a stage; of a mesh with another up axis its file says y, as careless exporters do."""


def write_obj(path: Path, mesh: Mesh, unit: float, up: str) -> None:
    """Write a Wavefront OBJ file whose vertices carry colours from 0 to 1 after their coordinates."""
    rows = np.column_stack([mesh.vertices, _colors(mesh) / 255.0])
    lines = ["v " + " ".join(f"{value:.9g}" for value in row) for row in rows.tolist()]
    path.write_text("\n".join([*lines, *_faces(mesh.faces)]) + "\n")


def write_obj_mtl(path: Path, mesh: Mesh, unit: float, up: str) -> None:
    """Write a Wavefront OBJ file and a material library of the same name: a material for each colour."""
    paints, numbers = np.unique(_colors(mesh)[mesh.faces[:, 0]], axis=0, return_inverse=True)
    lines = [f"mtllib {path.stem}.mtl", *("v " + " ".join(f"{x:.9g}" for x in v) for v in mesh.vertices.tolist())]
    for number in range(len(paints)):
        lines += [f"usemtl paint_{number}", *_faces(mesh.faces[numbers.ravel() == number])]
    path.write_text("\n".join(lines) + "\n")
    materials = [f"newmtl paint_{i}\nKd {r:.6f} {g:.6f} {b:.6f}" for i, (r, g, b) in enumerate(paints / 255.0)]
    path.with_suffix(".mtl").write_text("\n".join(materials) + "\n")


def write_ply(path: Path, mesh: Mesh, unit: float, up: str) -> None:
    """Write a PLY file with a colour for each vertex."""
    trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=_colors(mesh), process=False).export(path)


def write_glb(path: Path, mesh: Mesh, unit: float, up: str) -> None:
    """Write a binary glTF file with a colour for each vertex, linear and in 16 bits as the format wants it.

    glTF means metres and y up; most exporters do not care, and neither does this one.
    """
    colors = np.full((len(mesh.vertices), 4), 65535, "<u2")
    colors[:, :3] = np.round(65535 * to_linear(_colors(mesh)))
    blocks = [mesh.vertices.astype("<f4").tobytes(), colors.tobytes(), mesh.faces.astype("<u4").tobytes()]
    starts = np.cumsum([0] + [len(block) for block in blocks])
    low, high = mesh.bounds.astype(np.float32).tolist()
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": len(colors), "type": "VEC3", "min": low, "max": high},
        {"bufferView": 1, "componentType": 5123, "normalized": True, "count": len(colors), "type": "VEC4"},
        {"bufferView": 2, "componentType": 5125, "count": mesh.faces.size, "type": "SCALAR"},
    ]
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 1}, "indices": 2}]}],
        "accessors": accessors,
        "bufferViews": [
            {"buffer": 0, "byteOffset": int(start), "byteLength": len(block)}
            for start, block in zip(starts, blocks, strict=False)
        ],
        "buffers": [{"byteLength": int(starts[-1])}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = (
        struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", starts[-1], b"BIN\0") + b"".join(blocks)
    )
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def write_usda(path: Path, mesh: Mesh, unit: float, up: str) -> None:
    """Write a USD stage in text that says its unit, and its up axis as well as USD can."""
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageMetersPerUnit(stage, unit)
    UsdGeom.SetStageUpAxis(stage, UP_AXES.get(up, UsdGeom.Tokens.y))
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/thing").GetPrim())
    shape = UsdGeom.Mesh.Define(stage, "/thing/mesh")
    shape.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(mesh.vertices))
    shape.CreateFaceVertexCountsAttr(Vt.IntArray(len(mesh.faces), 3))
    shape.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(mesh.faces.ravel()))
    shape.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    shape.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(mesh.bounds.astype(np.float32)))
    shape.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex).Set(Vt.Vec3fArray.FromNumpy(to_linear(_colors(mesh))))
    save(stage, path)


WRITERS: dict[str, tuple[str, Callable[[Path, Mesh, float, str], None]]] = {
    "obj with vertex colours": (".obj", write_obj),
    "obj with materials": (".obj", write_obj_mtl),
    "ply": (".ply", write_ply),
    "glb": (".glb", write_glb),
    "usda": (".usda", write_usda),
}
"""The ending of each format, and what writes (path, mesh, metres in a unit, up axis)."""


def _colors(mesh: Mesh) -> np.ndarray:
    """Return the colours, shape [vertex 3]; everything in the zoo has them."""
    assert mesh.colors is not None
    return mesh.colors


def _faces(faces: np.ndarray) -> list[str]:
    """Return the lines of an OBJ file for triangles [face 3]; it counts vertices from 1."""
    return [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
