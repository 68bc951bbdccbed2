"""A small room, z up and in metres, and its files as scanning apps write them: y up, textured, with doubled vertices."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from PIL import Image

SIZE = (4.0, 3.0, 2.5)


def room() -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and faces of a room seen from inside, with a table on the floor; the floor lies at z 0."""
    shell = trimesh.creation.box(SIZE)
    shell.apply_translation((0, 0, SIZE[2] / 2))
    shell.invert()
    table = trimesh.creation.box((1.5, 1.0, 0.7))
    table.apply_translation((0.4, 0.3, 0.36))
    both = trimesh.util.concatenate([shell, table])
    return np.asarray(both.vertices), np.asarray(both.faces)


def y_up(points: np.ndarray) -> np.ndarray:
    """Turn z up into y up: (x, y, z) becomes (x, z, -y)."""
    return points[:, [0, 2, 1]] * [1, 1, -1]


def unwelded() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the room with three vertices a face, and texture coordinates: u along x, v along y."""
    vertices, faces = room()
    corners = vertices[faces].reshape(-1, 3)
    uv = (corners[:, :2] - corners[:, :2].min(axis=0)) / np.ptp(corners[:, :2], axis=0)
    return corners, np.arange(len(corners)).reshape(-1, 3), uv


def half_red_half_blue() -> Image.Image:
    """Return a texture that is red for u below a half and blue above."""
    pixels = np.zeros((32, 64, 3), dtype=np.uint8)
    pixels[:, :32, 0] = pixels[:, 32:, 2] = 255
    return Image.fromarray(pixels)


def glb(path: Path, scale: float = 1.0, textured: bool = True) -> Path:
    """Write the room as GLB, below a node that turns it y up and scales it."""
    corners, faces, uv = unwelded()
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=half_red_half_blue())
    visual = trimesh.visual.TextureVisuals(uv=uv, material=material) if textured else None
    mesh = trimesh.Trimesh(corners, faces, visual=visual, process=False)
    turn = np.eye(4)
    turn[:3, :3] = scale * np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    scene = trimesh.Scene()
    scene.add_geometry(mesh, transform=turn)
    scene.export(path)
    return path


def obj(path: Path, scale: float = 1.0, texture: bool = True, library: bool = True) -> Path:
    """Write the room as OBJ with y up, its MTL file and its texture; two materials take turns from face to face."""
    corners, _, uv = unwelded()
    lines = ["mtllib room.mtl"] if library else ["mtllib missing.mtl"]
    lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in scale * y_up(corners)]
    lines += [f"vt {u:.6f} {v:.6f}" for u, v in uv]
    for i in range(1, len(corners), 3):
        lines += [f"usemtl m{i % 2}", "f " + " ".join(f"{k}/{k}" for k in (i, i + 1, i + 2))]
    path.write_text("\n".join(lines))
    if library:
        (path.parent / "room.mtl").write_text("".join(f"newmtl m{k}\nKd 1 1 1\nmap_Kd paint.png\n" for k in (0, 1)))
    if texture:
        half_red_half_blue().save(path.parent / "paint.png")
    return path


def usdz(path: Path, unit: float = 0.01, up: str = "Y") -> Path:
    """Write the room as USDZ with a texture inside, in the given unit, as quads' and triangles' sake all triangles."""
    from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdUtils, Vt

    corners, faces, uv = unwelded()
    points = (y_up(corners) if up == "Y" else corners) / unit
    half_red_half_blue().save(path.parent / "paint.png")
    layer = path.parent / "room.usda"
    stage = Usd.Stage.CreateNew(str(layer))
    UsdGeom.SetStageUpAxis(stage, up)
    UsdGeom.SetStageMetersPerUnit(stage, unit)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/room").GetPrim())
    mesh = UsdGeom.Mesh.Define(stage, "/room/mesh")
    UsdGeom.XformCommonAPI(mesh).SetTranslate(Gf.Vec3d(0, 0, 0))
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr([3] * len(faces))
    mesh.CreateFaceVertexIndicesAttr(faces.ravel().tolist())
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "faceVarying")
    st.Set(Vt.Vec2fArray.FromNumpy(uv.astype(np.float32)))
    material = UsdShade.Material.Define(stage, "/room/paint")
    surface = UsdShade.Shader.Define(stage, "/room/paint/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    texture = UsdShade.Shader.Define(stage, "/room/paint/texture")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set("./paint.png")
    texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
    slot = surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
    slot.ConnectToSource(texture.ConnectableAPI(), "rgb")
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    stage.Save()
    assert UsdUtils.CreateNewUsdzPackage(str(layer), str(path))
    return path
