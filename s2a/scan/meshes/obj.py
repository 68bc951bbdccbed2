"""Wavefront OBJ with its libraries and textures -> SourceMesh, in the order of its faces.

Not trimesh's reader: it sorts faces by material, and fans polygons over their notches.
"""

from __future__ import annotations

import logging
from collections import Counter
from pathlib import Path

import numpy as np

from s2a.core.color_space import to_linear
from s2a.core.errors import InputError
from s2a.scan import mtl
from s2a.scan.mtl import GREY_PAINT, Painted
from s2a.scan.polygons import triangulate
from s2a.scan.source import SourceMesh, Stated

_log = logging.getLogger(__name__)

NAME = "OBJ"
ENDINGS = (".obj",)
NO_COORDINATE = -2
"""Texture coordinate of a corner that names one which does not exist."""
LOST = {"l": "lines", "p": "points", "curv": "curves", "surf": "free-form surfaces"}
"""Elements that are left out, with a warning."""


def recognise(path: Path) -> bool:
    """Return whether a file's name ends as OBJ's do."""
    return path.suffix.lower() in ENDINGS


def read(path: Path) -> SourceMesh:
    """Read an OBJ file, polygons as triangles. The format states neither frame nor unit, and colours as shown.

    Raises:
        InputError: a line that cannot be read.
    """
    text = _Text(path)
    if not text.counts:
        raise InputError(f"{path}: holds no faces; export a mesh, not a point cloud")
    points, given = _vertices(path, text.vertices)
    counts = np.array(text.counts)
    corners = np.array(text.corners).reshape(-1, 2)
    places, polygon = triangulate(points, counts, corners[:, 0])
    faces, material = corners[places, 0], np.array(text.material)[polygon]
    if gone := int((corners[:, 1] == NO_COORDINATE).sum()):
        _log.warning("%s: %d corners name texture coordinates that do not exist, and have none", path, gone)
    uv = np.array([*text.coordinates, [np.nan, np.nan]])[np.maximum(corners[places, 1], -1)]
    paints = _listed(path, text.names, text.materials)
    for index, paint in enumerate(paints):
        mine = material == index
        uv[mine] = uv[mine] * paint.scale + paint.offset
    colors = to_linear(given)[faces]
    # A vertex colour is the colour: exporters write Kd 0.8 or 1 beside it. A texture is drawn over both.
    colored = ~np.isnan(given[faces]).any(axis=(1, 2))
    textured = np.array([paint.material.texture is not None for paint in paints] + [False])[material]
    colors[~colored | textured] = np.nan
    material = np.where(colored & ~textured, -1, material)
    if lost := int((textured & np.isnan(uv).any(axis=(1, 2))).sum()):
        _log.warning("%s: %d faces have a texture and no coordinates on it; they become white", path, lost)
    return SourceMesh(points, faces, uv, colors, material, tuple(paint.material for paint in paints), Stated())


class _Text:
    """The lines of a file, as lists.

    Attributes:
        vertices: numbers of each.
        coordinates: of textures.
        counts: corners of each polygon.
        corners: vertex and texture coordinate of each corner, -1 for none.
        material: of each polygon, -1 for none.
        names: number of each material.
        materials: what the libraries describe.
    """

    def __init__(self, path: Path) -> None:
        self.vertices: list[list[float]] = []
        self.coordinates: list[list[float]] = []
        self.counts: list[int] = []
        self.corners: list[tuple[int, int]] = []
        self.material: list[int] = []
        self.names: dict[str, int] = {}
        self.materials: dict[str, Painted] = {}
        current, lost = -1, Counter[str]()
        for number, line in enumerate(mtl.lines(path), 1):
            key, *words = line.split("#")[0].split() or [""]
            try:
                if key == "v":
                    self.vertices.append([float(word) for word in words])
                elif key == "vt":
                    self.coordinates.append([float(words[0]), float(words[1]) if len(words) > 1 else 0.0])
                elif key in ("f", "fo"):
                    corners = [_corner(word, len(self.vertices), len(self.coordinates)) for word in words]
                    if len(corners) < 3:
                        lost["faces with fewer than 3 corners"] += 1
                        continue
                    self.counts.append(len(corners))
                    self.corners += corners
                    self.material.append(current)
                elif key == "usemtl":
                    name = mtl.name_of(line)
                    current = self.names.setdefault(name, len(self.names)) if name else -1
                elif key == "mtllib":
                    for name, painted in mtl.read(path, line).items():
                        self.materials.setdefault(name, painted)
                elif key in LOST:
                    lost[LOST[key]] += 1
            except (ValueError, IndexError) as error:
                raise InputError(
                    f"{path}: line {number} {line[:60]!r} cannot be read ({error}); export it again"
                ) from error
        for what, count in lost.items():
            _log.warning("%s: %d %s are left out", path, count, what)


def _vertices(path: Path, rows: list[list[float]]) -> tuple[np.ndarray, np.ndarray]:
    """Return positions [vertex 3] and colours as shown, 0 to 1, shape [vertex 3], NaN where there are none."""
    widths = {len(row) for row in rows}
    if not widths <= {3, 4, 6, 7}:
        raise InputError(f"{path}: vertices have {sorted(widths)} numbers; expected x y z, or x y z r g b")
    table = np.array([row + [np.nan] * (7 - len(row)) for row in rows] or np.zeros((0, 7)))
    colored = ~np.isnan(table[:, 5])
    given = table[:, 3:6].copy()
    if 7 in widths:  # x y z r g b a, or x y z w r g b: a and w are 1 (or 255) in all of them
        whole = ~np.isnan(table[:, 6])
        if not np.isin(table[whole, 6], (1.0, 255.0)).all() and (table[whole, 3] == 1).all():
            given[whole] = table[whole, 4:7]
    given[~colored] = np.nan
    return table[:, :3], given / (255 if colored.any() and np.nanmax(given) > 1 else 1)


def _corner(word: str, vertices: int, coordinates: int) -> tuple[int, int]:
    """Return the indices of position and texture coordinate, -1 for none, of "7", "7/3", "7//2", "-1/-1"."""
    fields = word.split("/")
    place = int(fields[0])
    texture = int(fields[1]) if len(fields) > 1 and fields[1] else 0
    index = place - 1 if place > 0 else vertices + place
    if not 0 <= index < vertices:
        raise ValueError("it names a vertex that the lines above do not hold")
    if abs(texture) > coordinates:  # some exporters write 7/7/7 without coordinates
        return index, NO_COORDINATE
    return index, texture - 1 if texture >= 0 else coordinates + texture


def _listed(path: Path, names: dict[str, int], materials: dict[str, Painted]) -> list[Painted]:
    """Return the materials in the order of their numbers; grey, and a warning, for those that no library describes."""
    found = {name: mtl.find(name, materials) for name in names}
    if missing := [name for name, paint in found.items() if paint is None]:
        _log.warning("%s: no .mtl file describes the material %s; its faces become grey", path, ", ".join(missing[:4]))
    return [paint or GREY_PAINT for paint in found.values()]
