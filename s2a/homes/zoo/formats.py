"""Files of coloured meshes, as modellers export them: the coordinates as they are, the colours in each format's own way."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from pxr import Usd, UsdGeom, Vt

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


def write_by_trimesh(path: Path, mesh: Mesh, unit: float, up: str) -> None:
    """Write a PLY or a binary glTF file with a colour for each vertex.

    glTF means metres and y up; most exporters do not care, and neither does this one.
    """
    shape = trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=_colors(mesh), process=False)
    shape.export(path)


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
    colors = Vt.Vec3fArray.FromNumpy(_colors(mesh).astype(np.float32) / np.float32(255.0))
    shape.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex).Set(colors)
    save(stage, path)


WRITERS: dict[str, tuple[str, Callable[[Path, Mesh, float, str], None]]] = {
    "obj with vertex colours": (".obj", write_obj),
    "obj with materials": (".obj", write_obj_mtl),
    "ply": (".ply", write_by_trimesh),
    "glb": (".glb", write_by_trimesh),
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
