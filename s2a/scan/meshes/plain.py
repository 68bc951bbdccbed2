"""STL and OFF -> SourceMesh.

Not trimesh's readers: they fan polygons over their notches, and drop the colours of OFF and of binary STL without a word.
"""

from __future__ import annotations

import logging
import re
from pathlib import Path

import numpy as np

from s2a.core.color_space import fractions, to_linear
from s2a.core.errors import InputError
from s2a.scan.source import SourceMesh, Stated, triangulate

_log = logging.getLogger(__name__)

NAME = "STL and OFF"
ENDINGS = (".stl", ".off")
# A triangle of a binary STL file, which follows 80 bytes of text and their number
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("color", "<u2")])
COLORED = 0x8000  # Bit of a facet's colour: set by VisCAM and SolidView where it counts, by Magics where it does not
CORNER = re.compile(rb"(?:^|[\r\n])[ \t]*vertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.IGNORECASE)
ENDFACET = re.compile(rb"\bend[ \t]?facet\b", re.IGNORECASE)
# The end of a text STL file: a name may follow, and comments
ENDSOLID = re.compile(
    rb"(?:^|[\r\n])[ \t]*end[ \t]?solid\b[^\r\n]*(?:[\r\n][ \t]*(?:#[^\r\n]*)?)*[\s\0\x1a]*\Z", re.IGNORECASE
)
# The first word of an OFF file: what its vertices have beside coordinates, in the order of its letters but for the
# colour. Some programs write the number of vertices right behind it
HEADER = re.compile(r"(ST)?(C)?(N)?(4)?(n)?OFF(\d*)")


def recognise(path: Path) -> bool:
    """Return whether a file's name ends as those of STL or OFF do."""
    return path.suffix.lower() in ENDINGS


def read(path: Path) -> SourceMesh:
    """Read all polygons as triangles, in their order, with colours of vertices or faces where there are any.

    Raises:
        InputError: a truncated or damaged file.
    """
    try:
        return _stl(path, path.read_bytes()) if path.suffix.lower() == ".stl" else _off(path)
    except InputError:
        raise
    except (ValueError, IndexError, OverflowError, MemoryError) as error:
        raise InputError(
            f"{path}: truncated or damaged ({' '.join(str(error).split())[:120]}); export it again"
        ) from error


def _stl(path: Path, data: bytes) -> SourceMesh:
    count = int.from_bytes(data[80:84], "little")
    end = 84 + count * FACET.itemsize
    # Binary files may begin with "solid", too; a text of this very length would be a strange chance.
    if len(data) != end and (found := CORNER.findall(data)):
        corners = np.array(found).astype(np.float64).reshape(-1, 3, 3)
        ends = len(ENDFACET.findall(data))
        if ends < len(corners):
            raise ValueError(f"{ends} of {len(corners)} facets end")
        if not ENDSOLID.search(data[-1000:]):
            raise ValueError("no endsolid at its end")
        return _mesh(corners.reshape(-1, 3), np.full(len(corners), 3), np.arange(3 * len(corners)))
    if len(data) < max(end, 84):
        raise ValueError(f"{len(data)} of {max(end, 84)} bytes")
    if len(data) > end:
        _log.warning("%s: %d bytes behind its %d triangles are left out", path, len(data) - end, count)
    facets = np.frombuffer(data, FACET, count, 84)
    points = facets["corners"].reshape(-1, 3).astype(np.float64)
    return _mesh(points, np.full(count, 3), np.arange(3 * count), of_faces=_facet_colors(data[:80], facets["color"]))


def _facet_colors(header: bytes, words: np.ndarray) -> np.ndarray | None:
    """Return the colours of facets, sRGB, 0 to 1, shape [facet 3], NaN for none; None where no program has written any.

    Five bits a channel, blue lowest; Magics puts red lowest, and the colour of all others into the header.
    """
    levels = np.stack([words >> 10 & 31, words >> 5 & 31, words & 31], axis=1) / 31.0
    own = words & COLORED != 0
    if (start := header.find(b"COLOR=")) >= 0:
        rest = np.frombuffer(header[start + 6 : start + 9].ljust(3, b"\0"), np.uint8) / 255.0
        return np.where(own[:, None], rest, levels[:, ::-1])
    return np.where(own[:, None], levels, np.nan) if own.any() else None


def _off(path: Path) -> SourceMesh:
    text = path.read_bytes().decode("utf-8-sig", "replace")
    rows = [words for line in re.split(r"[\r\n]", text) if (words := line.split("#")[0].split())]
    header = HEADER.fullmatch(rows[0][0])
    if header is None and not rows[0][0].isdigit():
        raise ValueError(f"it begins with {rows[0][0][:20]!r}")
    if header is not None and (header[4] or header[5] or rows[0][1:2] == ["BINARY"]):
        raise InputError(
            f"{path}: has {' '.join(rows[0][:2])}, which is not read; export it as text with three coordinates"
        )
    if header is not None:
        rows[0] = [header[6], *rows[0][1:]] if header[6] else rows[0][1:]
    rows = [row for row in rows if row]
    vertices, faces = int(rows[0][0]), int(rows[0][1])
    if not 0 < vertices + faces <= len(rows) - 1 or min(vertices, faces) < 0:
        raise ValueError(f"{len(rows) - 1} rows of {vertices + faces}")
    points = np.array([row[:3] for row in rows[1 : vertices + 1]]).astype(np.float64)
    polygons = [[int(word) for word in row[1 : int(row[0]) + 1]] for row in rows[vertices + 1 : vertices + 1 + faces]]
    counts = np.array([int(row[0]) for row in rows[vertices + 1 : vertices + 1 + faces]], dtype=np.int64)
    if (counts != [len(polygon) for polygon in polygons]).any():
        raise ValueError("a face with fewer vertices than its row says")
    at = 6 if header is not None and header[3] else 3
    colored = header is not None and header[2] is not None
    of_vertices = _levels(path, "vertices", [row[at:] for row in rows[1 : vertices + 1]], colored)
    of_faces = _levels(path, "faces", [row[1 + n :] for row, n in zip(rows[vertices + 1 :], counts, strict=False)])
    indices = np.array([index for polygon in polygons for index in polygon], dtype=np.int64)
    return _mesh(points, counts, indices, of_vertices, of_faces)


def _levels(path: Path, what: str, rows: list[list[str]], colored: bool = True) -> np.ndarray | None:
    """Return the colours at the ends of rows, sRGB, 0 to 1, shape [row 3], NaN for none; None where no row has one.

    `colored`: whether they are colours by the file's header.
    """
    table = np.full((len(rows), 3), np.nan)
    read = [colored and len(row) in (3, 4) for row in rows]
    for number in np.flatnonzero(read):
        table[number] = [float(word) for word in rows[number][:3]]
    if lost := sum(len(row) > 0 for row, is_read in zip(rows, read, strict=True) if not is_read):
        text = (
            "%s: %d %s end in numbers that are not read (of a colour map, of a texture, or without a C in the header)"
        )
        _log.warning(f"{text}; a colour is 3 or 4 numbers", path, lost, what)
    return None if np.isnan(table).all() else fractions(table)


def _mesh(
    points: np.ndarray,
    counts: np.ndarray,
    indices: np.ndarray,
    of_vertices: np.ndarray | None = None,
    of_faces: np.ndarray | None = None,
) -> SourceMesh:
    """Return polygons as triangles; the formats state neither frame nor unit."""
    corners, polygon = triangulate(points, counts, indices)
    faces = indices[corners].reshape(-1, 3)
    colors = np.full((*faces.shape, 3), np.nan, dtype=np.float32)
    if of_vertices is not None:
        colors = to_linear(of_vertices[np.clip(faces, 0, len(points) - 1)])
    if of_faces is not None:
        own = np.repeat(to_linear(of_faces[polygon])[:, None], 3, axis=1)
        colors = np.where(np.isnan(own), colors, own)
    return SourceMesh(points, faces, np.full((*faces.shape, 2), np.nan), colors, np.full(len(faces), -1), (), Stated())
