"""STL and OFF files, and what of the other formats is lost without a word unless a reader looks for it."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from mesh_features import (
    BLUE,
    COLORS,
    GEOMETRY,
    GREY,
    NAMES,
    NOTCHED,
    RED,
    RIGHT,
    SHOWN,
    SQUARE,
    STAGES,
    TEXTURES,
    TWO,
    UTM,
    Feature,
    gltf,
    image,
    obj,
    ply,
    rug,
    usd,
    usd_mesh,
)
from mesh_variants import LIST, PLATE, UP, XYZ, Write, ascii_ply, text

FACES = ["3 0 1 2", "3 0 2 3"]


def facets(points: np.ndarray = SQUARE, faces: np.ndarray = TWO) -> str:
    """Return triangles as STL's text."""
    loops = [
        "facet normal 0 0 1\nouter loop\n"
        + "".join(f"vertex {x:.9e} {y:.9e} {z:.9e}\n" for x, y, z in points[face])
        + "endloop\nendfacet\n"
        for face in faces
    ]
    return "".join(loops)


def solids(head: str = "solid {}\n", end: str = "\n") -> Write:
    """Return a writer of two solids of a triangle each, in one file."""
    pieces = [f"{head.format(name)}{facets(faces=TWO[i : i + 1])}endsolid {name}\n" for i, name in enumerate("ab")]
    return lambda path: path.write_bytes("".join(pieces).replace("\n", end).encode("latin-1")) and None


def binary(header: bytes = b"", color: int = 0, more: bytes = b"") -> Write:
    """Return a writer of a binary STL file."""
    rows = [struct.pack("<12fH", 0, 0, 1, *SQUARE[face].ravel(), color) for face in TWO]
    data = header.ljust(80)[:80] + struct.pack("<I", len(rows)) + b"".join(rows) + more
    return lambda path: path.write_bytes(data) and None


def off(
    head: str = "OFF", tail: str = "", faces: tuple[str, ...] = ("4 0 1 2 3",), points: np.ndarray = SQUARE
) -> Write:
    """Return a writer of an OFF file whose vertices end in a text."""
    rows = [" ".join(f"{x:.9g}" if abs(x) < 1e4 else f"{x:.4f}" for x in point) + tail for point in points]
    return text("\n".join([f"{head}\n{len(points)} {len(faces)} 0", *rows, *faces, ""]))


def _textured(comment: str, coordinates: str) -> Write:
    def write(path: Path) -> None:
        image(path.parent / "paint.png")
        ascii_ply(f"{XYZ}, {coordinates}", LIST, [f"{row} 0.75 0.5" for row in PLATE], FACES)(path)
        path.write_text(path.read_text().replace("format ascii 1.0", f"format ascii 1.0{comment}"))

    return write


def _marked(path: Path) -> None:
    """Write a PLY file with a byte order mark."""
    ply("uchar", 255, form="ascii")(path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())


def _commented(path: Path) -> None:
    """Write a PLY file with comments between its rows."""
    ply("uchar", 255, form="ascii")(path)
    head, _, body = path.read_text().partition("end_header\n")
    path.write_text(head + "end_header\ncomment one\n" + body.replace("\n", "\ncomment two\n", 2))


def _foreign_units(path: Path) -> None:
    """Write a stage that references one in centimetres."""
    usd('def "a" (\n prepend references = @other.usda@\n)\n{\n}')(path)
    other = usd(usd_mesh())
    other(path.parent / "other.usda")
    file = path.parent / "other.usda"
    file.write_text(file.read_text().replace("metersPerUnit = 1", "metersPerUnit = 0.01"))


def _glass(glb: Any) -> None:
    glb.document["materials"] = [
        {
            "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 1, 1]},
            "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0}},
        }
    ]
    glb.mesh({**glb.plate(), "material": 0})


def _plain_files() -> list[Feature]:
    features: list[Feature] = []

    def add(group: str, name: str, format: str, write: Write, ending: str | None = None, **expected: Any) -> None:
        features.append(Feature(group, name, format, ending or f".{format.lower()}", write, **expected))

    def off_colors(name: str, write: Write, *colors: tuple[int, int, int], **more: Any) -> None:
        add(COLORS, name, "OFF", write, colors=colors, **more)

    add(GEOMETRY, "several solids", "STL", solids(), facing=UP)
    add(GEOMETRY, "several solids", "STL", solids("solid\n"), facing=UP)
    add(NAMES, "line ends", "STL", solids(end="\r\n"), facing=UP)
    add(NAMES, "line ends", "STL", solids(end="\r"), facing=UP)
    add(NAMES, "bytes that are not UTF-8", "STL", solids("\n  SOLID K\xfcche {} vertex 1 2 3\n"), facing=UP)
    add(NAMES, "comments and blank lines", "STL", solids("# one\n\nsolid {}\n# two\n"), facing=UP)
    add(GEOMETRY, "binary files that begin with solid", "STL", binary(b"solid room"), facing=UP)
    add(GEOMETRY, "bytes behind the end", "STL", binary(more=b"\0\0\0"), warned=("3 bytes",), facing=UP)
    add(GEOMETRY, "map coordinates", "STL", text("solid a\n" + facets(SQUARE + UTM) + "endsolid a\n"), facing=UP)
    ended = text("solid a\n" + facets() + "endsolid\n\n# made by hand\n")
    add(NAMES, "comments and blank lines", "STL", ended, facing=UP)
    add(GEOMETRY, "cut texts", "STL", text("solid a\n" + facets()), refused=("no endsolid",))
    cut = text("solid a\n" + facets().removesuffix("endfacet\n") + "endsolid a\n")
    add(GEOMETRY, "cut texts", "STL", cut, refused=("1 of 2 facets",))
    second = text("solid a\n" + facets(faces=TWO[:1]) + "endsolid a\nsolid b\n" + facets(faces=TWO[1:]))
    add(GEOMETRY, "cut texts", "STL", second, refused=("no endsolid",))
    add(COLORS, "faces", "STL", binary(b"VisCAM", 0x8000 | 31), colors=(BLUE,))
    add(COLORS, "faces", "STL", binary(b"COLOR=\xff\0\0\xff,MATERIAL=", 31 << 10), colors=(BLUE,))
    add(COLORS, "faces", "STL", binary(b"COLOR=\xff\0\0\xff,MATERIAL=", 0x8000), colors=(RED,))
    add(COLORS, "faces", "STL", binary(b"grey", 31), colors=(GREY,))

    add(GEOMETRY, "concave polygons", "OFF", off(faces=("6 0 1 2 3 4 5",), points=NOTCHED), area=9.0, faces=4)
    points, faces = rug()
    rug_rows = tuple("3 " + " ".join(map(str, face)) for face in faces)
    add(GEOMETRY, "map coordinates", "OFF", off(points=points + UTM, faces=rug_rows), area=1.0, faces=800)
    off_colors("vertices, 8 bits", off("COFF", " 128 51 26 255"), SHOWN)
    off_colors("vertices, floats", off("COFF", " 0.502 0.2 0.102"), SHOWN)
    off_colors("vertices, 8 bits", off("CNOFF # normals first", " 0 0 1 128 51 26"), SHOWN)
    off_colors("faces", off(faces=("4 0 1 2 3 128 51 26",)), SHOWN)
    off_colors("faces", off(faces=("4 0 1 2 3 0.502 0.2 0.102 1.0",)), SHOWN)
    off_colors("faces", off("COFF", " 0 0 1.0", ("4 0 1 2 3 1.0 0.0 0.0",)), RED)
    off_colors("numbers of a colour map", off(faces=("4 0 1 2 3 7",)), GREY, warned=("1 faces", "map"))
    beside = off("STCOFF", " 128 51 26 255 0.5 0.5")
    off_colors("colours beside texture coordinates", beside, GREY, warned=("4 vertices", "texture"))
    off_colors("colours without C in the header", off(tail=" 128 51 26"), GREY, warned=("4 vertices", "without a C"))
    add(NAMES, "comments and blank lines", "OFF", off("OFF # a room\n\n# made by hand", " # a corner"), facing=UP)
    add(NAMES, "no keyword", "OFF", off(""), facing=UP)
    add(GEOMETRY, "four coordinates", "OFF", off("4OFF", " 1"), refused=("4OFF", "three coordinates"))
    add(GEOMETRY, "binary files", "OFF", off("OFF BINARY"), refused=("OFF BINARY", "as text"))

    add(
        COLORS,
        "vertices, grey",
        "PLY",
        ascii_ply(f"{XYZ}, uchar gray", LIST, [f"{row} 99" for row in PLATE], FACES),
        colors=((99,) * 3,),
    )
    named = _textured("\ncomment TextureFile paint.png", "float texcoord_u, float texcoord_v")
    add(TEXTURES, "missing coordinates", "PLY", named, colors=(GREY,), warned=("no texture coordinates", "paint.png"))
    unnamed = _textured("", "float s, float t")
    add(TEXTURES, "missing image", "PLY", unnamed, colors=(GREY,), warned=("texture coordinates", "no texture"))
    add(NAMES, "byte order mark", "PLY", _marked, colors=(SHOWN,))
    numbers = ascii_ply(XYZ, "list uchar float vertex_indices", PLATE, FACES)
    add(GEOMETRY, "indices of other types", "PLY", numbers, facing=UP)
    add(NAMES, "comments among rows", "PLY", _commented, colors=(SHOWN,))
    wide = ascii_ply(XYZ, "list int64 int64 vertex_indices", PLATE, FACES)
    add(GEOMETRY, "indices of other types", "PLY", wide, facing=UP)
    blue = {"b.mtl": "newmtl blue\nKd 0 0 1\n"}
    both = obj(
        "mtllib ./a.mtl ./b.mtl\nusemtl red\nf 1 2 3\nusemtl blue",
        "newmtl red\nKd 1 0 0\n",
        polygons=[(1, 3, 4)],
        files=blue,
    )
    add(NAMES, "several libraries", "OBJ", both, faces=2)
    space = obj("mtllib a.mtl\nusemtl red", "newmtl red\nmap_Kd -colorspace sRGB paint.png", uv=RIGHT)
    add(TEXTURES, "options of maps", "OBJ", space, colors=(BLUE,))
    add(COLORS, "transparency", "glTF", gltf(_glass), ".glb", colors=(BLUE,), warned=("opaque",))
    add(STAGES, "references in other units", "USD", _foreign_units, ".usda", warned=("1 layers", "other.usda"))
    return features


PLAIN_FILES = _plain_files()
