"""Material libraries of OBJ files (MTL): diffuse colours and textures, with names as people write them."""

from __future__ import annotations

import codecs
import logging
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from s2a.core.color_space import to_linear
from s2a.scan.images import beside, read_image
from s2a.scan.source import CLAMP, PLAIN, REPEAT, Material

_log = logging.getLogger(__name__)

_ARITY = {
    "-blendu": 1,
    "-blendv": 1,
    "-boost": 1,
    "-cc": 1,
    "-clamp": 1,
    "-imfchan": 1,
    "-texres": 1,
    "-type": 1,
    "-bm": 1,
}
_ARITY |= {"-mm": 2, "-o": 3, "-s": 3, "-t": 3}
"""Options of a map and how many arguments they take; the last three take one to three numbers."""


_OPAQUE = {"d": 1.0, "Tr": 0.0}
"""Values of dissolve and transparency for what one does not see through."""


@dataclass(frozen=True)
class Painted:
    """A material of a library.

    Attributes:
        material: its colour and texture.
        scale: of texture coordinates, shape [2].
        offset: of texture coordinates, after scaling, shape [2].
    """

    material: Material
    scale: np.ndarray
    offset: np.ndarray


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


def read(mesh: Path, line: str) -> dict[str, Painted]:
    """Return the materials of the libraries that a `mtllib` line names, by name; the first that describes a name counts.

    A library that is missing is a warning.
    """
    found: dict[str, Painted] = {}
    for name in _libraries(mesh.parent, name_of(line)):
        file = beside(mesh.parent, name)
        if file is None:
            _log.warning("%s: %s is missing", mesh, name)
            continue
        for key, painted in _library(mesh, file).items():
            found.setdefault(key, painted)
    return found


def _libraries(folder: Path, names: str) -> list[str]:
    """Return the names on a `mtllib` line, which may hold several, or one with spaces, or both."""
    if beside(folder, names) is not None:
        return [names]
    names = short(names) or names
    if '"' in names:
        return [a or b for a, b in re.findall(r'"([^"]*)"|(\S+)', names)]
    words, found = names.split(), list[str]()
    while words:
        # As many words as name a file, and otherwise up to the first that ends as libraries do.
        ends = [i for i in range(len(words), 0, -1) if beside(folder, " ".join(words[:i])) is not None]
        ends += [i for i, word in enumerate(words, 1) if word.lower().endswith(".mtl")]
        end = ends[0] if ends else len(words)
        found.append(" ".join(words[:end]))
        words = words[end:]
    return found


def _library(mesh: Path, file: Path) -> dict[str, Painted]:
    """Return the materials of one library."""
    found: dict[str, Painted] = {}
    current, textured, transparent = "", set[str](), set[str]()
    for line in lines(file):
        key, *words = line.split() or [""]
        if key.lower() == "newmtl":
            current = name_of(line)
            found.setdefault(current, GREY_PAINT)
        elif key == "Kd" and current in found:
            color = _color(mesh, file, line)
            if color is not None and current not in textured:
                found[current] = Painted(Material(color), np.ones(2), np.zeros(2))
        elif key.lower() == "map_kd" and words and current in found:
            found[current] = _textured(mesh, file, name_of(line))
            textured.add(current)
        elif key in _OPAQUE and words and _is_number(words[-1]) and float(words[-1]) != _OPAQUE[key]:
            transparent.add(current)
    if transparent:
        _log.warning("%s: %s: %d materials are transparent, and become opaque", mesh, file.name, len(transparent))
    return found


def _color(mesh: Path, file: Path, line: str) -> np.ndarray | None:
    """Return the linear colour of a `Kd` line, whose numbers are levels as shown; None, and a warning, if they are none."""
    words = line.split("#")[0].split()[1:]
    try:
        values = np.array([float(word) for word in words[:3]])
        if len(values) not in (1, 3) or not np.isfinite(values).all():
            raise ValueError("one or three numbers are expected")
    except ValueError:
        _log.warning("%s: %s: %r is no colour; its faces become grey", mesh, file.name, line.strip()[:60])
        return None
    return to_linear(np.repeat(values, 3) if len(values) == 1 else values).astype(np.float64)


def _textured(mesh: Path, file: Path, text: str) -> Painted:
    """Return the material of a map: options, then the file's name, which may hold spaces, quotes and #."""
    folders = (file.parent, mesh.parent)  # names count from the library, but some exporters mean the mesh
    found = next(((folder, text) for folder in folders if beside(folder, text)), None)
    options: dict[str, list[str]] = {}
    if found is None:
        options, name = _options(text)
        names = (name, name.split(" #")[0].strip(), short(name))
        found = next(((folder, each) for each in names for folder in folders if each and beside(folder, each)), None)
        found = found or (file.parent, name)
    image = read_image(mesh, *found)
    # The factor is left at 1: exporters write Kd 0 or 0.8 beside a texture. Without the texture it tells nothing.
    wrap = CLAMP if options.get("-clamp", ["off"])[0].lower() == "on" else REPEAT
    material = PLAIN if image is None else Material(np.ones(3), image, (wrap, wrap))
    scale, offset = (_two(options.get(key, []), default) for key, default in (("-s", 1.0), ("-o", 0.0)))
    return Painted(material, scale, offset)


def _options(text: str) -> tuple[dict[str, list[str]], str]:
    """Return the options of a map with their arguments, and the rest, which is the file's name."""
    found: dict[str, list[str]] = {}
    rest = text
    while (match := re.match(r"(-[a-z]+)\s+", rest, re.IGNORECASE)) and (key := match[1].lower()) in _ARITY:
        rest, arguments = rest[match.end() :], list[str]()
        for _ in range(_ARITY[key]):
            word = rest.split(None, 1)
            if len(word) < 2 or (key in ("-o", "-s", "-t") and arguments and not _is_number(word[0])):
                break
            arguments.append(word[0])
            rest = word[1]
        found[key] = arguments
    return found, rest.strip()


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _two(words: list[str], default: float) -> np.ndarray:
    """Return the first two of an option's numbers, shape [2]."""
    values = [float(word) if _is_number(word) else default for word in words[:2]]
    return np.array(values + [default] * (2 - len(values)))
