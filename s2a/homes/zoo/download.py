"""Objects as downloads are: any unit, up axis, heading, origin and format, some of them dirty.

Files of coloured meshes are as modellers export them: the coordinates as they are, the colours in each format's own way.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import trimesh
from pxr import Usd, UsdGeom, Vt

from s2a.core.color_space import to_linear
from s2a.homes.solids import rotation, translation
from s2a.homes.zoo.shapes import ZooObject
from s2a.scan.gltf_file import FLOAT, UNSIGNED_INT, UNSIGNED_SHORT, packed
from s2a.scene.scene import Mesh
from s2a.scene.usd.stage import save

# What USD can say of a stage; of a mesh with another up axis its file says y, as careless exporters do
UP_AXES = {"+y": UsdGeom.Tokens.y, "+z": UsdGeom.Tokens.z}


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
    low, high = mesh.bounds.astype(np.float32).tolist()
    document = {
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 1}, "indices": 2}]}],
    }
    arrays: list[tuple[np.ndarray, dict[str, Any] | None]] = [
        (mesh.vertices.astype("<f4"), {"componentType": FLOAT, "type": "VEC3", "min": low, "max": high}),
        (colors, {"componentType": UNSIGNED_SHORT, "normalized": True, "type": "VEC4"}),
        (mesh.faces.astype("<u4").ravel(), {"componentType": UNSIGNED_INT, "type": "SCALAR"}),
    ]
    path.write_bytes(packed(document, arrays))


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


# The ending of each format, and what writes (path, mesh, metres in a unit, up axis)
WRITERS: dict[str, tuple[str, Callable[[Path, Mesh, float, str], None]]] = {
    "obj with vertex colours": (".obj", write_obj),
    "obj with materials": (".obj", write_obj_mtl),
    "ply": (".ply", write_ply),
    "glb": (".glb", write_glb),
    "usda": (".usda", write_usda),
}


def _colors(mesh: Mesh) -> np.ndarray:
    """Return the colours, shape [vertex 3]; everything in the zoo has them."""
    assert mesh.colors is not None
    return mesh.colors


def _faces(faces: np.ndarray) -> list[str]:
    """Return the lines of an OBJ file for triangles [face 3]; it counts vertices from 1."""
    return [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]


T = TypeVar("T")

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": 0.0254}  # Metres in each
# How the z axis is turned to each up axis: a vector of rotation [rad]
UPS = {"+y": (-np.pi / 2, 0.0, 0.0), "+z": (0.0, 0.0, 0.0), "+x": (0.0, np.pi / 2, 0.0)}
# What is at zero: the middle of the underside, the middle, the lowest corner, or nothing near
ORIGINS = ("base", "centre", "corner", "far")
FAR = (3.2, -1.7, 0.6)  # Where the middle of the underside is for the last [m]
# This many objects of a hundred; the others are clean
FLAWS = (*["duplicated vertices"] * 6, "inconsistent winding", "non-manifold edge")


@dataclass(frozen=True)
class Download:
    """An object as it comes."""

    object: ZooObject  # what it really is
    unit: str  # key of UNITS in which its file counts
    up: str  # key of UPS
    yaw: int  # how far it was turned about its upright axis first [deg]
    origin: str  # one of ORIGINS
    flaw: str | None  # one of FLAWS, or None
    form: str  # key of `formats.WRITERS`

    @property
    def file(self) -> str:
        """Its file's name."""
        return self.object.slug + WRITERS[self.form][0]

    @property
    def transform(self) -> np.ndarray:
        """The similarity from the upright object in metres to the coordinates in its file, shape [4 4]."""
        scale = np.diag([1 / UNITS[self.unit]] * 3 + [1.0])
        turn = rotation(UPS[self.up]) @ rotation((0.0, 0.0, np.radians(self.yaw)))
        return np.array(np.round(scale @ turn @ translation(-self._zero()), 9))

    def _zero(self) -> np.ndarray:
        """The place in the upright object that becomes its file's origin [m], shape [3]."""
        vertices = self.object.surface.vertices
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        base = np.array([*(low + high)[:2] / 2, low[2]])
        return {"base": base, "centre": (low + high) / 2, "corner": low, "far": base - FAR}[self.origin]

    def mesh(self, rng: np.random.Generator) -> Mesh:
        """Return the mesh in its file's coordinates, with its flaw.

        `rng`: which triangles are turned over, where winding is inconsistent.
        """
        clean = self.object.surface.mesh
        vertices = self.object.surface.vertices @ self.transform[:3, :3].T + self.transform[:3, 3]
        mesh = Mesh(vertices, clean.faces, clean.colors)
        return mesh if self.flaw is None else _DIRT[self.flaw](mesh, rng)

    def truth(self, metres: Sequence[float]) -> dict[str, Any]:
        """Return what is known of it, ready for JSON. `metres`: the true extents along depth, width and height [m]."""
        front = np.round(self.transform[:3, :3] @ (1.0, 0.0, 0.0) * UNITS[self.unit]).astype(int)
        axis = int(np.abs(front).argmax())
        return {
            "label": self.object.label,
            "category": self.object.category,
            "size": [round(float(x), 6) for x in metres],
            "unit": self.unit,
            "up": self.up,
            "front": "-+"[int(front[axis] > 0)] + "xyz"[axis],
            "origin": self.origin,
            "transform": self.transform.tolist(),
            "placement": self.object.placement,
            "rare": self.object.rare,
            "flaw": self.flaw,
            "format": self.form,
        }


def download(objects: Sequence[ZooObject], rng: np.random.Generator) -> list[Download]:
    """Return the objects as they come; each unit, axis, origin and format comes equally often, but for y and z up."""

    def deal(options: Sequence[T]) -> list[T]:
        """Options in turn, one for each object, shuffled."""
        return [options[i % len(options)] for i in rng.permutation(len(objects))]

    flaws = [*FLAWS, *[None] * (100 - len(FLAWS))]
    dealt = zip(
        deal(list(UNITS)),
        deal(["+y", "+y", "+z", "+z", "+x"]),
        deal([0, 90, 180, 270]),
        deal(ORIGINS),
        deal(flaws),
        deal(list(WRITERS)),
        strict=True,
    )
    return [Download(item, *rest) for item, rest in zip(objects, dealt, strict=True)]


def _duplicated(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """Give each triangle three vertices of its own."""
    assert mesh.colors is not None
    corners = mesh.faces.ravel()
    return Mesh(mesh.vertices[corners], np.arange(len(corners)).reshape(-1, 3), mesh.colors[corners])


def _turned_over(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """Turn about every third triangle over."""
    faces = mesh.faces.copy()
    over = rng.uniform(size=len(faces)) < 0.3
    faces[over] = faces[over][:, ::-1]
    return Mesh(mesh.vertices, faces, mesh.colors)


def _finned(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """Add a third triangle to the first edge, its tip in the middle of the mesh."""
    assert mesh.colors is not None
    vertices = np.concatenate([mesh.vertices, mesh.vertices.mean(axis=0)[None]])
    faces = np.concatenate([mesh.faces, [[*mesh.faces[0][:2], len(mesh.vertices)]]])
    return Mesh(vertices, faces, np.concatenate([mesh.colors, mesh.colors[mesh.faces[0, :1]]]))


_DIRT = {"duplicated vertices": _duplicated, "inconsistent winding": _turned_over, "non-manifold edge": _finned}
