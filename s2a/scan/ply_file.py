"""The elements of a PLY file as columns, ASCII or binary, and a mesh with vertex colours as a PLY file."""

import re
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from s2a.core.errors import InputError
from s2a.scene.scene import Mesh

TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
TYPES |= {"float": "f4", "double": "f8"}
TYPES |= {"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"}
TYPES |= {"float32": "f4", "float64": "f8", "int64": "i8", "uint64": "u8"}
ORDERS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
_MAX_HEADER = 1_000_000  # bytes


@dataclass(frozen=True)
class Lists:
    """A property that is a list in each row."""

    counts: np.ndarray  # entries of each row, shape [row], int64
    values: np.ndarray  # entries of all rows, one after the other, shape [sum of counts]


@dataclass(frozen=True)
class Element:
    """Vertices, faces or others."""

    count: int  # number of rows
    columns: dict[str, np.ndarray]  # numbers of each property, shape [row]
    lists: dict[str, Lists]  # properties that are lists


@dataclass(frozen=True)
class PlyFile:
    """What a file holds."""

    comments: tuple[str, ...]  # of its header, without the keyword
    elements: dict[str, Element]  # by name, names in lower case


@dataclass(frozen=True)
class _Property:
    name: str
    kind: str
    count_kind: str | None  # of a list


Layout = tuple[int, list[_Property]]  # Number of rows and their properties


def read(path: Path) -> PlyFile:
    """Read a PLY file; InputError: the file cannot be read, is truncated, longer than its header says, or no PLY."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path and its permissions") from error
    try:
        return _parsed(data)
    except (ValueError, KeyError, IndexError, OverflowError, MemoryError, struct.error) as error:
        reason = f"truncated, damaged or not a PLY mesh ({' '.join(str(error).split())[:120]})"
        raise InputError(f"{path}: {reason}; copy or download it again") from error


def _parsed(data: bytes) -> PlyFile:
    """Return what the bytes of a file hold; a ValueError and its like say what is wrong with them."""
    start = re.match(rb"(?:\xef\xbb\xbf)?ply[ \t]*(\r\n|\n|\r)", data)
    end = re.compile(rb"[\r\n]end_header[ \t]*(\r\n|\n|\r|$)").search(data, 0, _MAX_HEADER)
    if not start or not end:
        raise ValueError("no header")
    # In a file with single returns the first byte of the data may be a line feed.
    begin = end.end() - (end[1] == b"\r\n" and start[1] == b"\r")
    form, comments, layout = _header(re.split(rb"\r\n|\n|\r", data[: end.start()])[1:])
    if form != "ascii":
        return PlyFile(comments, _elements(data[begin:], layout, ORDERS[form]))
    try:
        return PlyFile(comments, _elements(_doubles(data[begin:].split()), layout, "<", text=True))
    except (ValueError, struct.error):
        words, narrow = _by_lines(data[begin:], layout)
        if narrow == layout and b"comment" not in data[begin:]:
            raise
        return PlyFile(comments, _elements(_doubles(words), narrow, "<", text=True))


def _elements(body: bytes, layout: list[tuple[str, Layout]], order: str, text: bool = False) -> dict[str, Element]:
    """Return the elements of the data behind a header; those of text are doubles, so that one reader does for both."""
    elements, at = {}, 0
    for name, (count, properties) in layout:
        wide = [_Property(p.name, "f8", p.count_kind and "f8") for p in properties] if text else properties
        rows, at = _rows(body, at, count, wide, order)
        elements[name] = _element(count, properties, rows)
    if body[at:].strip():
        raise ValueError(f"{len(body) - at} bytes more than its header states")
    return elements


def _doubles(words: list[bytes]) -> bytes:
    return np.array(words).astype("S64").astype(np.float64).tobytes() if words else b""


def _by_lines(data: bytes, layout: list[tuple[str, Layout]]) -> tuple[list[bytes], list[tuple[str, Layout]]]:
    """Return the words and the layout of a text whose rows hold more than its header tells, one row a line.

    MeshLab writes colours of corners as a list and states them as numbers: what follows the last list of such rows is unknown.
    """
    lines = [line.split() for line in re.split(rb"\r\n|\n|\r", data) if line.strip()]
    lines = [line for line in lines if line[0] != b"comment"]  # which some programs write there, too
    words: list[bytes] = []
    narrow: list[tuple[str, Layout]] = []
    for name, (count, properties) in layout:
        mine, lines = lines[:count], lines[count:]
        ends, places = [], [i for i, prop in enumerate(properties) if prop.count_kind]
        for line in mine:
            at = 0
            for prop in properties[: places[-1] + 1] if places else properties:
                at += 1 + int(float(line[at])) if prop.count_kind else 1
            ends.append(at)
        tail = len(properties) - places[-1] - 1 if places else 0
        if all(len(line) == end + tail for line, end in zip(mine, ends, strict=True)):
            ends, stated = [len(line) for line in mine], properties
        else:
            stated = properties[: places[-1] + 1] if places else properties
        words += [word for line, end in zip(mine, ends, strict=True) for word in line[:end]]
        narrow.append((name, (count, stated)))
    return words, narrow


def _header(lines: list[bytes]) -> tuple[str, tuple[str, ...], list[tuple[str, Layout]]]:
    """Return format, comments, and the elements with their properties."""
    form, comments = "", []
    layout: list[tuple[str, Layout]] = []
    for line in lines:
        key, *words = _text(line).split() or [""]
        if key == "format":
            form = words[0]
        elif key in ("comment", "obj_info"):
            comments.append(_text(line).split(None, 1)[1].strip() if words else "")
        elif key == "element":
            layout.append((words[0].lower(), (int(words[1]), [])))
        elif key == "property" and words[0] == "list":
            layout[-1][1][1].append(_Property(words[3].lower(), TYPES[words[2]], TYPES[words[1]]))
        elif key == "property":
            layout[-1][1][1].append(_Property(words[1].lower(), TYPES[words[0]], None))
    if form not in ORDERS:
        raise ValueError(f"format {form!r}")
    if len({name for name, _ in layout}) < len(layout) or any(count < 0 for _, (count, _) in layout):
        raise ValueError("elements")
    return form, tuple(comments), layout


def _text(line: bytes) -> str:
    """Return a line of the header, in UTF-8 or else in Latin 1, which every byte is a letter of."""
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("latin-1")


def _rows(
    body: bytes, at: int, count: int, properties: list[_Property], order: str
) -> tuple[list[tuple[np.ndarray, np.ndarray]], int]:
    """Return groups of rows whose lists have the same lengths (numbers of the rows, and the rows), and where they end."""
    if not count:
        return [(np.zeros(0, np.int64), np.zeros(0, _dtype(properties, [0] * len(properties), order)))], at
    _, first = _row(body, at, properties, order)
    kind = _dtype(properties, first, order)
    end = at + count * kind.itemsize
    if not kind.itemsize:
        raise ValueError("rows without properties")
    if end <= len(body):
        rows = np.frombuffer(body, kind, count, at)
        lists = [i for i, prop in enumerate(properties) if prop.count_kind]
        if all((rows[f"count{i}"] == first[i]).all() for i in lists):
            return [(np.arange(count), rows)], end
    return _uneven_rows(body, at, count, properties, order)


def _uneven_rows(
    body: bytes, at: int, count: int, properties: list[_Property], order: str
) -> tuple[list[tuple[np.ndarray, np.ndarray]], int]:
    """Return groups of rows whose lists have the same lengths, for lists of different lengths, and where they end."""
    starts = np.zeros(count, np.int64)
    members: dict[tuple[int, ...], list[int]] = {}
    for row in range(count):
        starts[row] = at
        at, counts = _row(body, at, properties, order)
        members.setdefault(tuple(counts), []).append(row)
    raw = np.frombuffer(body, np.uint8)
    groups = []
    for counts_of, numbers in members.items():
        kind, place = _dtype(properties, list(counts_of), order), np.array(numbers)
        cells = raw[starts[place][:, None] + np.arange(kind.itemsize)]
        groups.append((place, np.ascontiguousarray(cells).view(kind)[:, 0]))
    return groups, at


def _row(body: bytes, at: int, properties: list[_Property], order: str) -> tuple[int, list[int]]:
    """Return where a row ends, and the length of its lists (0 for other properties)."""
    counts = []
    for prop in properties:
        length = 0
        if prop.count_kind:
            number = struct.unpack_from(order + _CODES[prop.count_kind], body, at)[0]
            length = int(number)
            if length < 0 or length != number:
                raise ValueError(f"a list of {number} entries")
            at += int(prop.count_kind[1])
        at += int(prop.kind[1]) * (length if prop.count_kind else 1)
        counts.append(length)
    if at > len(body):
        raise ValueError("it ends too early")
    return at, counts


_CODES = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q", "f4": "f", "f8": "d"}


def _dtype(properties: list[_Property], counts: list[int], order: str) -> np.dtype:
    cells: list[tuple[Any, ...]] = []
    for i, (prop, length) in enumerate(zip(properties, counts, strict=True)):
        if prop.count_kind:
            cells += [(f"count{i}", order + prop.count_kind), (f"value{i}", order + prop.kind, (length,))]
        else:
            cells.append((f"value{i}", order + prop.kind))
    return np.dtype(cells)


def _element(count: int, properties: list[_Property], groups: list[tuple[np.ndarray, np.ndarray]]) -> Element:
    columns, lists = {}, {}
    for i, prop in enumerate(properties):
        if not prop.count_kind:
            column = np.zeros(count, prop.kind)
            for place, rows in groups:
                column[place] = _cast(rows[f"value{i}"], prop.kind)
            columns[prop.name] = column
            continue
        counts = np.zeros(count, np.int64)
        for place, rows in groups:
            counts[place] = rows[f"value{i}"].shape[1]
        ends = np.cumsum(counts)
        values = np.zeros(int(ends[-1]) if count else 0, prop.kind)
        for place, rows in groups:
            cells = rows[f"value{i}"]
            values[(ends - counts)[place][:, None] + np.arange(cells.shape[1])] = _cast(cells, prop.kind)
        lists[prop.name] = Lists(counts, values)
    return Element(count, columns, lists)


def _cast(values: np.ndarray, kind: str) -> np.ndarray:
    """Return numbers in a type of the header, which those of an ASCII file, read as doubles, have to fit."""
    if kind[0] == "f" or values.dtype.kind != "f":
        return values.astype(kind)
    limits = np.iinfo(kind)
    if not ((values == np.floor(values)) & (values >= limits.min) & (values <= limits.max)).all():
        raise ValueError("a number does not fit the type of its property")
    return values.astype(kind)


def write_ply(path: Path, mesh: Mesh) -> None:
    """Write a mesh with vertex colours as ScanNet++ does: binary, little endian, float x y z, uchar red green blue."""
    vertex = np.dtype([("xyz", "<f4", 3), ("rgb", "u1", 3)])
    face = np.dtype([("count", "u1"), ("indices", "<i4", 3)])
    vertices, faces = np.empty(len(mesh.vertices), vertex), np.empty(len(mesh.faces), face)
    vertices["xyz"], vertices["rgb"] = mesh.vertices, mesh.colors
    faces["count"], faces["indices"] = 3, mesh.faces
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property float {axis}" for axis in "xyz"] + [f"property uchar {c}" for c in ("red", "green", "blue")]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    with path.open("wb") as file:
        file.write("\n".join(header).encode("ascii"))
        vertices.tofile(file)
        faces.tofile(file)
