"""PLY -> SourceMesh: triangles and other polygons, colours of vertices or faces, MeshLab's textures."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from s2a.core.color_space import to_linear
from s2a.core.errors import InputError
from s2a.scan import ply, ply_file
from s2a.scan.ply_file import Element, Lists, PlyFile
from s2a.scan.source import PLAIN, Material, SourceMesh, Stated, read_image, triangulate

_log = logging.getLogger(__name__)

NAME = "PLY"
ENDINGS = (".ply",)
# Names of the texture coordinates of vertices
COORDINATES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
IMAGE = "texturefile"  # The comment that names a texture


def recognise(path: Path) -> bool:
    """Return whether a file's name ends as PLY's do."""
    return path.suffix.lower() in ENDINGS


def read(path: Path) -> SourceMesh:
    """Read all polygons as triangles, in their order. The format states neither frame nor unit, and colours as shown.

    Raises:
        InputError: a truncated or damaged file, or one without faces.
    """
    file = ply_file.read(path)
    vertex, face = file.elements.get("vertex"), file.elements.get("face")
    if vertex is None or not vertex.count or not set("xyz") <= set(vertex.columns):
        raise InputError(f"{path}: holds no vertices with x, y and z; export a mesh")
    lists = _polygons(file, face)
    if lists is None or not (lists.counts > 2).any():
        raise InputError(f"{path}: holds no faces; export a mesh, not a point cloud")
    points, indices = ply.coordinates(vertex), lists.values.astype(np.int64)
    if few := int((lists.counts < 3).sum()):
        _log.warning("%s: %d faces have fewer than 3 corners, and are left out", path, few)
    corners, polygon = triangulate(points, lists.counts, indices)
    faces = indices[corners]
    if not 0 <= faces.min() <= faces.max() < len(points):
        raise InputError(f"{path}: a face names vertex {faces.max()} of {len(points)}; export it again")
    uv, number, materials = _textures(path, file, faces, corners, polygon)
    colors = _colors(path, file, faces, polygon)
    if not materials and np.isnan(colors).all() and _coordinates(file) != (None, None):
        _log.warning("%s: has texture coordinates, and no texture that is read; its faces become grey", path)
    colors[number >= 0] = np.nan  # a texture holds the colours already
    return SourceMesh(points, faces, uv, colors, number, materials, Stated())


def _polygons(file: PlyFile, face: Element | None) -> Lists | None:
    """Return the vertices of the polygons; triangle strips, as Stanford's first files have them, become triangles."""
    own = None if face is None else ply.corner_lists(face)
    strips = file.elements.get("tristrips")
    lists = None if strips is None else ply.corner_lists(strips)
    if lists is None or (own is not None and len(own.counts)):
        return own
    values = lists.values.astype(np.int64)
    windows = np.stack([values[:-2], values[1:-1], values[2:]], axis=1)
    ends = np.repeat(np.cumsum(lists.counts), lists.counts)  # a strip ends at -1, too, and begins anew after it
    begins = np.maximum.accumulate(
        np.where(np.append(True, (values[:-1] < 0) | (ends[:-1] != ends[1:])), np.arange(len(values)), 0)
    )
    odd = ((np.arange(len(windows)) - begins[: len(windows)]) % 2).astype(bool)
    windows[odd] = windows[odd][:, [1, 0, 2]]
    a, b, c = windows.T
    whole = (windows >= 0).all(axis=1) & (ends[:-2] == ends[2:]) & (a != b) & (b != c) & (c != a)
    return Lists(np.full(int(whole.sum()), 3), windows[whole].ravel())


def _colors(path: Path, file: PlyFile, faces: np.ndarray, polygon: np.ndarray) -> np.ndarray:
    """Return the colours of the corners, linear, shape [face 3 3], float32: of vertices, faces or their materials, else NaN."""
    vertex, face = file.elements["vertex"], file.elements.get("face")
    levels = ply.color_levels(path, vertex)
    if levels is not None:
        return to_linear(levels / 255)[faces]
    levels = None if face is None or not len(face.lists) else ply.color_levels(path, face)
    material, index = file.elements.get("material"), None if face is None else face.columns.get("material_index")
    if levels is None and material is not None and index is not None:
        listed = ply.color_levels(path, material)
        if listed is not None and 0 <= index.min(initial=0) <= index.max(initial=0) < len(listed):
            levels = listed[index.astype(np.int64)]
    if levels is not None:
        return np.repeat(to_linear(levels / 255)[polygon][:, None], 3, axis=1)
    return np.full((*faces.shape, 3), np.nan, dtype=np.float32)


def _coordinates(file: PlyFile) -> tuple[Lists | None, tuple[str, str] | None]:
    """Return the texture coordinates of corners, and the names of those of vertices."""
    face, columns = file.elements.get("face"), set(file.elements["vertex"].columns)
    wedge = None if face is None else face.lists.get("texcoord")
    return wedge, next((pair for pair in COORDINATES if set(pair) <= columns), None)


def _textures(
    path: Path, file: PlyFile, faces: np.ndarray, corners: np.ndarray, polygon: np.ndarray
) -> tuple[np.ndarray, np.ndarray, tuple[Material, ...]]:
    """Return texture coordinates [face 3 2], the material of each face, -1 for none, and the materials."""
    names = [comment.split(None, 1)[1] for comment in file.comments if comment.lower().startswith(f"{IMAGE} ")]
    uv, number = np.full((*faces.shape, 2), np.nan), np.full(len(faces), -1)
    vertex, face = file.elements["vertex"], file.elements.get("face")
    wedge, pair = _coordinates(file)
    if not names or (wedge is None and pair is None):
        if names:
            _log.warning("%s: no texture coordinates are read for the texture %s, which is left out", path, names[0])
        return uv, number, ()
    images = [read_image(path, path.parent, name) for name in names]
    materials = tuple(PLAIN if image is None else Material(np.ones(3), image) for image in images)
    if wedge is not None and face is not None:
        first = np.cumsum(wedge.counts) - wedge.counts
        sides = ply.corner_lists(face)
        assert sides is not None
        start = np.cumsum(sides.counts) - sides.counts
        place = first[polygon][:, None] + 2 * (corners - start[polygon][:, None])
        whole = wedge.counts[polygon] == 2 * sides.counts[polygon]
        place = np.where(whole[:, None], place, 0)
        if len(wedge.values) >= 2:
            corner_uv = np.stack([wedge.values[place], wedge.values[place + 1]], axis=2)
            uv = np.where(whole[:, None, None], corner_uv, np.nan)
    elif pair is not None:
        uv = np.stack([vertex.columns[name].astype(np.float64) for name in pair], axis=1)[faces]
    used = np.zeros(len(faces), np.int64)
    if face is not None and "texnumber" in face.columns:
        used = face.columns["texnumber"].astype(np.int64)[polygon]
    placed = (used >= 0) & (used < len(materials)) & np.isfinite(uv).all(axis=(1, 2))
    if lost := int((~placed).sum()):
        _log.warning("%s: %d faces have no place on a texture, and keep their own colours", path, lost)
    return uv, np.where(placed, used, -1), materials
