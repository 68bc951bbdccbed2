"""GLB, glTF, OBJ, PLY and USD files of a room -> SourceMesh."""

from __future__ import annotations

import json
import logging
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from s2a.core.errors import InputError
from s2a.scan import obj_file, usd_file
from s2a.scan.source import Material, SourceMesh, Stated, joined

_log = logging.getLogger(__name__)

_COMPRESSED = {"KHR_draco_mesh_compression": "Draco", "EXT_meshopt_compression": "meshopt"}
_DECOMPRESS = "npx @gltf-transform/cli copy IN.glb OUT.glb decompresses it"


def read(path: Path) -> SourceMesh:
    """Read all triangles of a mesh file, in its order, with its own statement of frame and unit.

    A missing texture or material file is a warning; its faces become grey.

    Raises:
        InputError: no such file, another format, a damaged or compressed one, no faces, a vertex in use is not finite.
    """
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "does not exist"
        raise InputError(f"mesh {str(path)!r} {what}; give one mesh file: {', '.join(READERS)}")
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"mesh {str(path)!r}: the ending {path.suffix!r} is unknown; possible: {', '.join(READERS)}")
    if not path.stat().st_size:
        raise InputError(f"{path}: is empty; copy or export it again")
    mesh = reader(path)
    _check(path, mesh)
    return mesh


def _check(path: Path, mesh: SourceMesh) -> None:
    """Raise an InputError for a mesh that holds nothing, or numbers that cannot be right."""
    if not len(mesh.faces):
        raise InputError(f"{path}: holds no faces; export a mesh, not a point cloud")
    if not 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices):
        raise InputError(f"{path}: a face names vertex {mesh.faces.max()} of {len(mesh.vertices)}; export it again")
    finite = np.isfinite(mesh.vertices).all(axis=1)[mesh.faces].all(axis=1)
    if not finite.all():
        bad = np.flatnonzero(~finite)
        raise InputError(
            f"{path}: face {bad[0]} has a corner that is not finite ({len(bad)} such faces); remove them, or export it again"
        )
    if not np.ptp(mesh.vertices[mesh.faces].reshape(-1, 3), axis=0).max() > 0:
        raise InputError(f"{path}: all vertices lie in one point; export it again")


def _gltf(path: Path) -> SourceMesh:
    """Read glTF or GLB through trimesh: y up and metres, says its specification."""
    for name in _gltf_extensions(path):
        if name in _COMPRESSED:
            raise InputError(f"{path}: is compressed with {_COMPRESSED[name]}; export it without, or {_DECOMPRESS}")
    return _by_trimesh(path, Stated("y", 1.0, "glTF"))


def _gltf_extensions(path: Path) -> list[str]:
    """Return the extensions that a reader of the file needs.

    Raises:
        InputError: a truncated or damaged file.
    """
    data = path.read_bytes()
    try:
        if path.suffix.lower() == ".glb":
            magic, _, length, size = struct.unpack("<4sIII", data[:16])
            if magic != b"glTF":
                raise InputError(f"{path}: is no GLB file; export it again")
            if length > len(data):
                raise InputError(f"{path}: truncated, {len(data)} of {length} bytes; copy or download it again")
            data = data[20 : 20 + size]
        header = json.loads(data)
        return [str(name) for name in header.get("extensionsRequired", [])]
    except InputError:
        raise
    except (ValueError, struct.error, AttributeError) as error:
        raise InputError(f"{path}: truncated or no glTF ({error}); copy or export it again") from error


def _ply(path: Path) -> SourceMesh:
    """Read PLY through trimesh, which splits its polygons into triangles."""
    return _by_trimesh(path, Stated())


def _by_trimesh(path: Path, stated: Stated) -> SourceMesh:
    """Read a file's scene: its meshes where its nodes place them.

    Raises:
        InputError: trimesh cannot read it, or it holds no mesh.
    """
    import trimesh

    options = {"fix_texture": False} if path.suffix.lower() == ".ply" else {}
    try:
        scene = trimesh.load_scene(path, process=False, **options)
        placed = [scene.graph[node] for node in scene.graph.nodes_geometry]
    except ModuleNotFoundError:
        raise
    except Exception as error:  # trimesh lets through what damage provokes: ValueError, IndexError, KeyError ...
        raise InputError(
            f"{path}: truncated or damaged ({' '.join(str(error).split())[:120]}); export it again"
        ) from error
    found = [
        (matrix, scene.geometry[name]) for matrix, name in placed if isinstance(scene.geometry[name], trimesh.Trimesh)
    ]
    left = len(placed) - len(found)
    found = [(matrix, mesh) for matrix, mesh in found if len(mesh.faces)]
    if not found:
        raise InputError(f"{path}: holds no faces; export a mesh, not a point cloud")
    if left:
        _log.warning("%s: %d of %d parts are points or lines, and are left out", path, left, len(placed))
    return joined([from_trimesh(path, mesh, matrix) for matrix, mesh in found], stated)


def from_trimesh(path: Path, mesh: Any, matrix: np.ndarray) -> SourceMesh:
    """Return one mesh of a trimesh scene, placed."""
    faces = np.asarray(mesh.faces, dtype=np.int64)
    uv, colors = np.full((len(faces), 3, 2), np.nan), np.full((len(faces), 3, 3), np.nan, dtype=np.float32)
    materials: tuple[Material, ...] = ()
    if mesh.visual.kind == "texture":
        materials = (_material(path, mesh.visual.material),)
        if mesh.visual.uv is not None and len(mesh.visual.uv) == len(mesh.vertices):
            uv = np.asarray(mesh.visual.uv, dtype=np.float64)[faces]
        given = mesh.visual.vertex_attributes.get("color")
        if given is not None and materials[0].texture is None:
            colors = np.asarray(given)[:, :3].astype(np.float32)[faces]
    elif mesh.visual.kind == "vertex":
        colors = np.asarray(mesh.visual.vertex_colors)[:, :3].astype(np.float32)[faces]
    elif mesh.visual.kind == "face":
        colors = np.repeat(np.asarray(mesh.visual.face_colors)[:, None, :3], 3, axis=1).astype(np.float32)
    vertices = np.asarray(mesh.vertices, dtype=np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    if np.linalg.det(matrix[:3, :3]) < 0:  # a mirror turns faces inside out
        faces, uv, colors = faces[:, ::-1], uv[:, ::-1], colors[:, ::-1]
    number = 0 if materials else -1
    return SourceMesh(vertices, faces, uv, colors, np.full(len(faces), number), materials, Stated())


def _material(path: Path, material: Any) -> Material:
    """Return a material's base colour and texture."""
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    factor = getattr(material, "baseColorFactor", None)
    color = (
        np.ones(3) if factor is None else np.asarray(factor)[:3] / (255 if np.asarray(factor).dtype.kind in "iu" else 1)
    )
    if image is None:
        return Material(np.full(3, 170 / 255) if factor is None else color)
    try:
        return Material(color, np.asarray(image.convert("RGB")))
    except (OSError, SyntaxError) as error:
        _log.warning("%s: a texture cannot be read (%s); its faces become grey", path, error)
        return Material(np.full(3, 170 / 255))


READERS: dict[str, Callable[[Path], SourceMesh]] = {
    ".glb": _gltf,
    ".gltf": _gltf,
    ".obj": obj_file.read,
    ".ply": _ply,
    ".usdz": usd_file.read,
    ".usd": usd_file.read,
    ".usda": usd_file.read,
    ".usdc": usd_file.read,
}
"""Readers by the ending of a file's name."""
