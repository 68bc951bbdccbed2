"""A room's meshes in USD or USDZ -> SourceMesh."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Ar, Tf, Usd, UsdGeom, UsdShade

from s2a.core.errors import InputError
from s2a.scan.images import decode
from s2a.scan.source import GREY, Material, SourceMesh, Stated, joined

_log = logging.getLogger(__name__)


def read(path: Path) -> SourceMesh:
    """Read all visible meshes of a stage, placed, in the order of its prims; polygons become fans of triangles.

    Raises:
        InputError: no USD file, a damaged one, or one without meshes.
    """
    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:
        raise InputError(f"{path}: not a USD file, or a damaged one; export it again") from error
    if not stage:
        raise InputError(f"{path}: not a USD file, or a damaged one; export it again")
    cache = UsdGeom.XformCache()
    prims = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    meshes = [UsdGeom.Mesh(prim) for prim in prims if prim.IsA(UsdGeom.Mesh)]
    shown = [mesh for mesh in meshes if mesh.ComputeVisibility() != UsdGeom.Tokens.invisible]
    parts = [_mesh(path, mesh, np.array(cache.GetLocalToWorldTransform(mesh.GetPrim()))) for mesh in shown]
    parts = [part for part in parts if len(part.faces)]
    if not parts:
        raise InputError(f"{path}: holds no meshes; export the scan's mesh")
    return joined(parts, _stated(stage))


def _stated(stage: Usd.Stage) -> Stated:
    """Return the stage's up axis and unit, where it states them itself: USD's fallbacks are no statement."""
    up = str(UsdGeom.GetStageUpAxis(stage)).lower() if stage.HasAuthoredMetadata("upAxis") else None
    unit = UsdGeom.GetStageMetersPerUnit(stage) if UsdGeom.StageHasAuthoredMetersPerUnit(stage) else None
    return Stated(up, unit, "USD")


def _mesh(path: Path, mesh: UsdGeom.Mesh, matrix: np.ndarray) -> SourceMesh:
    """Return one mesh of a stage."""
    points = np.array(mesh.GetPointsAttr().Get() or [], dtype=np.float64).reshape(-1, 3)
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get() or [], dtype=np.int64)
    indices = np.array(mesh.GetFaceVertexIndicesAttr().Get() or [], dtype=np.int64)
    where = f"{path}: {mesh.GetPath()}"
    if counts.sum() != len(indices) or (len(indices) and not 0 <= indices.min() <= indices.max() < len(points)):
        raise InputError(f"{where} has faces that name vertices which do not exist; export it again")
    corners, polygon = _fans(counts)
    if mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
        corners = corners[:, ::-1]
    if np.linalg.det(matrix[:3, :3]) < 0:
        corners = corners[:, ::-1]
    place = {"vertex": indices, "varying": indices, "faceVarying": np.arange(len(indices))}
    place |= {"uniform": np.repeat(np.arange(len(counts)), counts), "constant": np.zeros(len(indices), dtype=np.int64)}
    material, name = _material(path, mesh.GetPrim())
    uv = _primvar(where, mesh, name, place, 2)
    colors = _primvar(where, mesh, "displayColor", place, 3)
    # USD's row vectors: a point stands before the matrix.
    vertices = points @ matrix[:3, :3] + matrix[3, :3]
    numbers = np.full(len(corners), -1 if material is None else 0)
    shade = (255 * np.clip(colors, 0, 1)).astype(np.float32)[corners]
    return SourceMesh(
        vertices, indices[corners], uv[corners], shade, numbers, () if material is None else (material,), Stated()
    )


def _fans(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners [triangle 3] of polygons with so many corners, and each triangle's polygon."""
    first = np.cumsum(counts) - counts
    many = np.maximum(counts - 2, 0)
    polygon = np.repeat(np.arange(len(counts)), many)
    step = np.arange(len(polygon)) - np.repeat(np.cumsum(many) - many, many)
    start = first[polygon]
    return np.stack([start, start + step + 1, start + step + 2], axis=1), polygon


def _primvar(where: str, mesh: UsdGeom.Mesh, name: str, place: dict[str, np.ndarray], width: int) -> np.ndarray:
    """Return a primvar's value at each corner, shape [corner width]; NaN where there is none or its length is wrong."""
    primvar = UsdGeom.PrimvarsAPI(mesh.GetPrim()).FindPrimvarWithInheritance(name)
    missing = np.full((len(place["vertex"]), width), np.nan)
    if not primvar or not primvar.HasValue():
        return missing
    values = np.array(primvar.ComputeFlattened(), dtype=np.float64).reshape(-1, width)
    at = place[str(primvar.GetInterpolation())]
    if len(at) and at.max() >= len(values):
        _log.warning("%s: %s holds %d values, too few; it is ignored", where, name, len(values))
        return missing
    return values[at]


def _material(path: Path, prim: Usd.Prim) -> tuple[Material | None, str]:
    """Return the diffuse colour or texture of a prim's material, and the primvar with its texture coordinates."""
    bound = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
    shader = bound.ComputeSurfaceSource()[0] if bound else None
    slot = shader.GetInput("diffuseColor") if shader else None
    if not slot:
        return None, "st"
    for attribute in slot.GetValueProducingAttributes():
        source = UsdShade.Shader(attribute.GetPrim())
        if source and source.GetIdAttr().Get() == "UsdUVTexture":
            return _texture(path, source), _coordinates(source)
        value = attribute.Get()
        return (Material(np.array(value, dtype=np.float64)) if value is not None else None), "st"
    value = slot.Get()
    return (Material(np.array(value, dtype=np.float64)) if value is not None else None), "st"


def _coordinates(texture: UsdShade.Shader) -> str:
    """Return the name of the primvar that a texture reads its coordinates from."""
    slot = texture.GetInput("st")
    for attribute in slot.GetValueProducingAttributes() if slot else ():
        reader = UsdShade.Shader(attribute.GetPrim())
        name = reader.GetInput("varname") if reader else None
        produced = name.GetValueProducingAttributes() if name else ()
        if produced and produced[0].Get():
            return str(produced[0].Get())
    return "st"


def _texture(path: Path, source: UsdShade.Shader) -> Material:
    """Return the image of a texture, also one inside of a USDZ file."""
    asset: Any = source.GetInput("file").Get() if source.GetInput("file") else None
    resolved = asset.resolvedPath if asset else ""
    opened = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved)) if resolved else None
    if opened is None:
        _log.warning("%s: the texture %s is missing; its faces become grey", path, asset.path if asset else "")
        return Material(np.full(3, GREY / 255))
    image = decode(path, asset.path, bytes(opened.GetBuffer()))
    return Material(np.full(3, GREY / 255)) if image is None else Material(np.ones(3), image)
