"""Wavefront OBJ with its MTL and textures -> SourceMesh, in the order of its faces (trimesh sorts them by material)."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from s2a.core.errors import InputError
from s2a.scan.images import read_image
from s2a.scan.source import GREY, Material, SourceMesh, Stated

_log = logging.getLogger(__name__)


def read(path: Path) -> SourceMesh:
    """Read an OBJ file; polygons become fans of triangles. It states neither frame nor unit.

    Raises:
        InputError: a line that cannot be read.
    """
    vertices: list[list[float]] = []
    coordinates: list[list[float]] = []
    corners: list[tuple[int, int]] = []
    material: list[int] = []
    names: dict[str, int] = {}
    materials: dict[str, Material] = {}
    current = -1
    for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1):
        key, *words = line.split("#")[0].split() or [""]
        try:
            if key == "v":
                vertices.append([float(word) for word in words])
            elif key == "vt":
                coordinates.append([float(words[0]), float(words[1]) if len(words) > 1 else 0.0])
            elif key == "f":
                fan = [_corner(word, len(vertices), len(coordinates)) for word in words]
                for second, third in zip(fan[1:], fan[2:], strict=False):
                    corners += [fan[0], second, third]
                    material.append(current)
            elif key == "usemtl":
                current = names.setdefault(" ".join(words), len(names))
            elif key == "mtllib":
                materials |= _library(path, line.split(None, 1)[1].strip())
        except (ValueError, IndexError) as error:
            raise InputError(
                f"{path}: line {number} {line[:60]!r} cannot be read ({error}); export it again"
            ) from error
    if not corners:
        raise InputError(f"{path}: holds no faces; export a mesh, not a point cloud")
    return _mesh(path, vertices, coordinates, np.array(corners), np.array(material), _listed(path, names, materials))


def _mesh(
    path: Path,
    vertices: list[list[float]],
    coordinates: list[list[float]],
    corners: np.ndarray,
    material: np.ndarray,
    materials: tuple[Material, ...],
) -> SourceMesh:
    """Return the parsed lists as a mesh; a seventh number a vertex, or too few, is refused."""
    widths = {len(vertex) for vertex in vertices}
    if not widths <= {3, 4, 6, 7} or len(widths) > 1:
        raise InputError(f"{path}: vertices have {sorted(widths)} numbers; expected x y z, or x y z r g b")
    points, faces = np.array(vertices), corners[:, 0].reshape(-1, 3)
    table = np.array([*coordinates, [np.nan, np.nan]])
    colors = np.full((len(faces), 3, 3), np.nan, dtype=np.float32)
    if points.shape[1] >= 6 and 0 <= faces.min() <= faces.max() < len(points):
        given = points[:, -3:]
        colors = (given * (255 if given.max() <= 1 else 1)).astype(np.float32)[faces]
    uv = table[corners[:, 1]].reshape(-1, 3, 2)
    return SourceMesh(points[:, :3], faces, uv, colors, material, materials, Stated())


def _corner(word: str, vertices: int, coordinates: int) -> tuple[int, int]:
    """Return the indices of position and texture coordinate, -1 for none, of "7", "7/3", "7//2", "-1/-1"."""
    fields = word.split("/")
    place = int(fields[0])
    texture = int(fields[1]) if len(fields) > 1 and fields[1] else 0
    index = place - 1 if place > 0 else vertices + place
    if not 0 <= index < vertices or abs(texture) > coordinates:
        raise ValueError("it names what the lines above do not hold")
    return index, texture - 1 if texture >= 0 else coordinates + texture


def _listed(path: Path, names: dict[str, int], materials: dict[str, Material]) -> tuple[Material, ...]:
    """Return the materials in the order of their numbers; grey, and a warning, for those that no MTL file describes."""
    if missing := [name for name in names if name not in materials]:
        _log.warning("%s: no .mtl file describes the material %s; its faces become grey", path, ", ".join(missing[:4]))
    grey = Material(np.full(3, GREY / 255))
    return tuple(materials.get(name, grey) for name in names)


def _library(path: Path, name: str) -> dict[str, Material]:
    """Return the materials of an MTL file beside the OBJ; none, and a warning, if it is missing."""
    file = path.parent / name
    if not file.is_file():
        _log.warning("%s: %s is missing", path, name)
        return {}
    found: dict[str, Material] = {}
    current, textured = "", set[str]()
    for line in file.read_text(encoding="utf-8", errors="replace").splitlines():
        key, *words = line.split("#")[0].split() or [""]
        if key == "newmtl":
            current = " ".join(words)
            found[current] = Material(np.full(3, GREY / 255))
        elif key == "Kd" and len(words) >= 3 and current not in textured:
            found[current] = Material(np.array([float(word) for word in words[:3]]))
        elif key == "map_Kd" and words:
            texture = read_image(path, file.parent / _texture_name(file.parent, words))
            # The factor is left at 1: exporters write Kd 0 or 0.8 beside a texture. Without the texture it tells nothing.
            found[current] = Material(np.full(3, GREY / 255) if texture is None else np.ones(3), texture)
            textured.add(current)
    return found


def _texture_name(folder: Path, words: list[str]) -> str:
    """Return a texture's name, which may hold spaces, after options such as -s 1 1 1."""
    whole = " ".join(words).replace("\\", "/")
    return whole if (folder / whole).is_file() or not whole.startswith("-") else words[-1].replace("\\", "/")
