"""Wavefront OBJ with its libraries and textures -> SourceMesh, in the order of its faces.

Not trimesh's reader: it sorts faces by material, and fans polygons over their notches.
"""

from __future__ import annotations

import codecs
import logging
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from s2a.core.color_space import fractions, to_linear
from s2a.core.errors import InputError
from s2a.scan.source import CLAMP, PLAIN, REPEAT, Material, SourceMesh, Stated, beside, read_image, triangulate

_log = logging.getLogger(__name__)

_ARITY = dict.fromkeys("-blendu -blendv -boost -cc -clamp -colorspace -imfchan -texres -type -bm".split(), 1)
_ARITY |= {"-mm": 2, "-o": 3, "-s": 3, "-t": 3}
"""Options of a map and how many arguments they take; the last three take one to three numbers."""


# A name, maybe with spaces, up to the ending of a library
_ENDED = re.compile(r"""[^\s"'].*?\.mtl(?=\s|$)""", re.IGNORECASE)
_OPAQUE = {"d": 1.0, "Tr": 0.0}  # Values of dissolve and transparency for what one does not see through


@dataclass(frozen=True)
class Painted:
    """A material of a library."""

    material: Material  # its colour and texture
    scale: np.ndarray  # of texture coordinates, shape [2]
    offset: np.ndarray  # of texture coordinates, after scaling, shape [2]


GREY_PAINT = Painted(PLAIN, np.ones(2), np.zeros(2))


def lines(path: Path) -> list[str]:
    """Return the lines of an OBJ or MTL file: any line ends, those continued by a backslash as one.

    The text is UTF-8, UTF-16 with its mark, or else Latin 1.
    """
    data = path.read_bytes()
    try:
        text = data.decode("utf-16" if data[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) else "utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    # Only these end a line: str.splitlines would cut names at other controls, such as Latin 1's 0x85.
    text = re.sub(r"\\[ \t]*(\r\n|\n|\r)", " ", text)
    return re.split(r"\r\n|\n|\r", text)


def name_of(line: str) -> str:
    """Return the name that follows a line's keyword, as a whole: 3ds Max calls materials "Material #25"."""
    whole = (line.split(None, 1) + [""])[1].strip()
    return whole[1:-1] if len(whole) > 1 and whole[0] == whole[-1] == '"' else whole


def short(name: str) -> str:
    """Return a name without what may be a comment behind it."""
    return name.split("#")[0].strip()


def find(name: str, materials: dict[str, Painted]) -> Painted | None:
    """Return the material of a name: the one of this very name, or of the same without comments; None without one."""
    return materials.get(name) or {short(key): paint for key, paint in materials.items()}.get(short(name) or name)


def read_materials(mesh: Path, line: str) -> dict[str, Painted]:
    """Return the materials of the libraries that a `mtllib` line names, by name; the first that describes a name counts.

    A library that is missing is a warning.
    """
    materials: dict[str, Painted] = {}
    for name in _libraries(mesh.parent, name_of(line)):
        file = beside(mesh.parent, name)
        if file is None:
            _log.warning("%s: %s is missing", mesh, name)
            continue
        for key, painted in _library(mesh, file).items():
            materials.setdefault(key, painted)
    return materials


def _libraries(folder: Path, names: str) -> list[str]:
    """Return the names on a `mtllib` line, which may hold several, or one with spaces, or both."""
    # Of "./a.mtl ./b.mtl" the last alone would be found as the bare name of a path.
    ended = [match.split(" #")[0] for match in _ENDED.findall(names) if not match.startswith("#")]
    if len(ended) > 1 and not (folder / names).is_file():
        return ended
    if beside(folder, names) is not None:
        return [names]
    names = short(names) or names
    if '"' in names:
        return [a or b for a, b in re.findall(r'"([^"]*)"|(\S+)', names)]
    words, libraries = names.split(), list[str]()
    while words:
        # As many words as name a file, and otherwise up to the first that ends as libraries do.
        ends = [i for i in range(len(words), 0, -1) if beside(folder, " ".join(words[:i])) is not None]
        ends += [i for i, word in enumerate(words, 1) if word.lower().endswith(".mtl")]
        end = ends[0] if ends else len(words)
        libraries.append(" ".join(words[:end]))
        words = words[end:]
    return libraries


def _library(mesh: Path, file: Path) -> dict[str, Painted]:
    materials: dict[str, Painted] = {}
    current, textured, transparent, plain = "", set[str](), set[str](), dict[str, None]()
    shown: dict[str, np.ndarray] = {}
    for line in lines(file):
        key, *words = line.split() or [""]
        if not words:
            continue
        if key.lower() == "newmtl":
            current = name_of(line)
            if current not in materials:
                materials[current], plain[current] = GREY_PAINT, None
        elif key == "Kd" and current in materials:
            plain.pop(current, None)
            if (color := _color(mesh, file, line)) is not None:
                shown[current] = color
        elif key.lower() == "map_kd" and current in materials:
            materials[current] = _textured(mesh, file, name_of(line))
            plain.pop(current, None)
            textured.add(current)
        elif key == "map_d" or (key in _OPAQUE and _is_number(words[-1]) and float(words[-1]) != _OPAQUE[key]):
            transparent.add(current)
    for name, levels in zip(shown, _fractions(mesh, file, np.array(list(shown.values()))), strict=True):
        if name not in textured:
            materials[name] = Painted(Material(to_linear(levels).astype(np.float64)), np.ones(2), np.zeros(2))
    if transparent:
        _log.warning("%s: %s: %d materials are transparent, and become opaque", mesh, file.name, len(transparent))
    if plain:
        text = "%s: %s: no colour (Kd, map_Kd) is stated by the material %s; its faces become grey"
        _log.warning(text, mesh, file.name, ", ".join(list(plain)[:4]))
    return materials


def _fractions(mesh: Path, file: Path, values: np.ndarray) -> np.ndarray:
    """Return the `Kd` of a library as fractions of the brightest; a warning if they are levels of 255.

    Levels are whole, all of them; a number above 1 beside fractions is a lamp's.
    """
    if values.max(initial=0.0) <= 2 or (values % 1 != 0).any():
        return values.clip(0.0, 1.0)
    _log.warning("%s: %s: its colours (Kd) are read as levels of 255", mesh, file.name)
    return values / 255


def _color(mesh: Path, file: Path, line: str) -> np.ndarray | None:
    """Return the levels of a `Kd` line as shown, shape [3]; None, and a warning, if they are none."""
    words = line.split("#")[0].split()[1:]
    try:
        values = np.array([float(word) for word in words[:3]])
        if len(values) not in (1, 3) or not np.isfinite(values).all():
            raise ValueError("one or three numbers are expected")
    except ValueError:
        _log.warning("%s: %s: %r is no colour; its faces become grey", mesh, file.name, line.strip()[:60])
        return None
    return np.repeat(values, 3) if len(values) == 1 else values


def _textured(mesh: Path, file: Path, text: str) -> Painted:
    """Return the material of a map: options, then the file's name, which may hold spaces, quotes and #."""
    folders = (file.parent, mesh.parent)  # names count from the library, but some exporters mean the mesh
    options, name = _options(text)
    # With options before it, the end of a path alone would be found, and the options be lost.
    place = next(((folder, text) for folder in folders if (folder / text).is_file() or not options), None)
    if place is None or not beside(*place):
        names = (name, name.split(" #")[0].strip(), short(name))
        place = next(((folder, each) for each in names for folder in folders if each and beside(folder, each)), None)
        place = place or (file.parent, name)
    image = read_image(mesh, *place)
    # The factor is left at 1: exporters write Kd 0 or 0.8 beside a texture. Without the texture it tells nothing.
    wrap = CLAMP if options.get("-clamp", ["off"])[0].lower() == "on" else REPEAT
    material = PLAIN if image is None else Material(np.ones(3), image, (wrap, wrap))
    pairs = []
    for key, default in (("-s", 1.0), ("-o", 0.0)):
        values = [float(word) if _is_number(word) else default for word in options.get(key, [])[:2]]
        pairs.append(np.array(values + [default] * (2 - len(values))))
    return Painted(material, *pairs)


def _options(text: str) -> tuple[dict[str, list[str]], str]:
    """Return the options of a map with their arguments, and the rest, which is the file's name."""
    options: dict[str, list[str]] = {}
    rest = text
    while (match := re.match(r"(-[a-z]+)\s+", rest, re.IGNORECASE)) and (key := match[1].lower()) in _ARITY:
        rest, arguments = rest[match.end() :], list[str]()
        for _ in range(_ARITY[key]):
            word = rest.split(None, 1)
            if len(word) < 2 or (key in ("-o", "-s", "-t") and arguments and not _is_number(word[0])):
                break
            arguments.append(word[0])
            rest = word[1]
        options[key] = arguments
    return options, rest.strip()


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


NAME = "OBJ"
ENDINGS = (".obj",)
NO_COORDINATE = -2  # Texture coordinate of a corner that names one which does not exist
# Elements that are left out, with a warning
LOST = {"l": "lines", "p": "points", "curv": "curves", "surf": "free-form surfaces", "call": "call statements"}
POLYPAINT = "#MRGB"  # Begins the comments in which ZBrush writes colours of vertices


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
    highest, number = text.highest
    if highest >= len(points):
        raise InputError(f"{path}: line {number} names vertex {highest + 1} of {len(points)}; export it again")
    corners[corners[:, 1] >= len(text.coordinates), 1] = NO_COORDINATE
    places, polygon = triangulate(points, counts, corners[:, 0])
    faces, material = corners[places, 0], np.array(text.material)[polygon]
    # Some exporters write 7/7/7 without coordinates.
    if gone := int((corners[:, 1] == NO_COORDINATE).sum()):
        _log.warning("%s: %d corners name texture coordinates that do not exist, and have none", path, gone)
    uv = np.array([*text.coordinates, [np.nan, np.nan]])[np.maximum(corners[places, 1], -1)]
    uv[~np.isfinite(uv).all(axis=2)] = np.nan
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
        highest: index of a vertex that a face names, and the number of its line.
    """

    def __init__(self, path: Path) -> None:
        self.vertices: list[list[float]] = []
        self.coordinates: list[list[float]] = []
        self.counts: list[int] = []
        self.corners: list[tuple[int, int]] = []
        self.material: list[int] = []
        self.names: dict[str, int] = {}
        self.materials: dict[str, Painted] = {}
        self.highest = (-1, 0)
        current, lost = -1, Counter[str]()
        for number, line in enumerate(lines(path), 1):
            key, *words = line.split("#")[0].split() or [""]
            lost["lines of ZBrush's polypaint"] += line.startswith(POLYPAINT)
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
                    self.highest = max(self.highest, (max(corners)[0], number), key=lambda each: each[0])
                    self.counts.append(len(corners))
                    self.corners += corners
                    self.material.append(current)
                elif key == "usemtl":
                    name = name_of(line)
                    current = self.names.setdefault(name, len(self.names)) if name else -1
                elif key == "mtllib":
                    for name, painted in read_materials(path, line).items():
                        self.materials.setdefault(name, painted)
                elif key in LOST:
                    lost[LOST[key]] += 1
            except (ValueError, IndexError) as error:
                raise InputError(
                    f"{path}: line {number} {line[:60]!r} cannot be read ({error}); export it again"
                ) from error
        for what, count in (+lost).items():
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
    return table[:, :3], fractions(given)


def _corner(word: str, vertices: int, coordinates: int) -> tuple[int, int]:
    """Return the indices of position and texture coordinate, -1 for none, of "7", "7/3", "7//2", "-1/-1".

    Numbers may be larger than what the lines above hold: some programs write faces first.
    """
    fields = word.split("/")
    place = int(fields[0])
    texture = int(fields[1]) if len(fields) > 1 and fields[1] else 0
    index = place - 1 if place > 0 else vertices + place
    if index < 0 or place == 0:
        raise ValueError("it names a vertex that the lines above do not hold")
    if -texture > coordinates:
        return index, NO_COORDINATE
    return index, texture - 1 if texture >= 0 else coordinates + texture


def _listed(path: Path, names: dict[str, int], materials: dict[str, Painted]) -> list[Painted]:
    """Return the materials in the order of their numbers; grey, and a warning, for those that no library describes."""
    paints = {name: find(name, materials) for name in names}
    if missing := [name for name, paint in paints.items() if paint is None]:
        _log.warning("%s: no .mtl file describes the material %s; its faces become grey", path, ", ".join(missing[:4]))
    return [paint or GREY_PAINT for paint in paints.values()]
