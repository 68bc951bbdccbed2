"""STL and OFF files, and what of the other formats is lost without a word unless a reader looks for it."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from mesh_features import (
    BLUE,
    COLORS,
    DISPLAY,
    GEOMETRY,
    GREY,
    HALF,
    LEFT,
    LIGHT,
    NAMES,
    NOTCHED,
    PAINTED,
    RED,
    RIGHT,
    SHOWN,
    SQUARE,
    STAGES,
    TEXTURES,
    TWO,
    USE,
    UTM,
    Feature,
    Glb,
    gltf,
    image,
    obj,
    ply,
    rug,
    usd,
    usd_material,
    usd_mesh,
    usd_textured,
)
from mesh_variants import LIST, PLATE, UP, XYZ, Write, ascii_ply, separate, text
from pxr import Sdf

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
    add(NAMES, "all line endings", "STL", solids(end="\r\n"), facing=UP)
    add(NAMES, "all line endings", "STL", solids(end="\r"), facing=UP)
    add(NAMES, "bytes that are not UTF-8", "STL", solids("\n  SOLID K\xfcche {} vertex 1 2 3\n"), facing=UP)
    add(NAMES, "comments and blank lines", "STL", solids("# one\n\nsolid {}\n# two\n"), facing=UP)
    add(GEOMETRY, 'binary files whose header begins with "solid"', "STL", binary(b"solid room"), facing=UP)
    add(GEOMETRY, "bytes after the end", "STL", binary(more=b"\0\0\0"), warned=("3 bytes",), facing=UP)
    add(GEOMETRY, "map coordinates", "STL", text("solid a\n" + facets(SQUARE + UTM) + "endsolid a\n"), facing=UP)
    ended = text("solid a\n" + facets() + "endsolid\n\n# made by hand\n")
    add(NAMES, "comments and blank lines", "STL", ended, facing=UP)
    add(GEOMETRY, "truncated text files", "STL", text("solid a\n" + facets()), refused=("no endsolid",))
    cut = text("solid a\n" + facets().removesuffix("endfacet\n") + "endsolid a\n")
    add(GEOMETRY, "truncated text files", "STL", cut, refused=("1 of 2 facets",))
    second = text("solid a\n" + facets(faces=TWO[:1]) + "endsolid a\nsolid b\n" + facets(faces=TWO[1:]))
    add(GEOMETRY, "truncated text files", "STL", second, refused=("no endsolid",))
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
    off_colors("indices of a colour map", off(faces=("4 0 1 2 3 7",)), GREY, warned=("1 faces", "map"))
    beside = off("STCOFF", " 128 51 26 255 0.5 0.5")
    off_colors("colours besides texture coordinates", beside, GREY, warned=("4 vertices", "texture"))
    off_colors(
        "colours not announced in the header", off(tail=" 128 51 26"), GREY, warned=("4 vertices", "without a C")
    )
    add(NAMES, "comments and blank lines", "OFF", off("OFF # a room\n\n# made by hand", " # a corner"), facing=UP)
    add(NAMES, "missing keyword", "OFF", off(""), facing=UP)
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
    add(GEOMETRY, "index types other than int", "PLY", numbers, facing=UP)
    add(NAMES, "comments between rows", "PLY", _commented, colors=(SHOWN,))
    wide = ascii_ply(XYZ, "list int64 int64 vertex_indices", PLATE, FACES)
    add(GEOMETRY, "index types other than int", "PLY", wide, facing=UP)
    blue = {"b.mtl": "newmtl blue\nKd 0 0 1\n"}
    both = obj(
        "mtllib ./a.mtl ./b.mtl\nusemtl red\nf 1 2 3\nusemtl blue",
        "newmtl red\nKd 1 0 0\n",
        polygons=[(1, 3, 4)],
        files=blue,
    )
    add(NAMES, "several libraries", "OBJ", both, faces=2)
    space = obj("mtllib a.mtl\nusemtl red", "newmtl red\nmap_Kd -colorspace sRGB paint.png", uv=RIGHT)
    add(TEXTURES, "options of texture maps", "OBJ", space, colors=(BLUE,))
    add(COLORS, "transparency", "glTF", gltf(_glass), ".glb", colors=(BLUE,), warned=("opaque",))
    add(STAGES, "references in other units", "USD", _foreign_units, ".usda", warned=("1 layers", "other.usda"))
    return features + _rare_gltf() + _rare_usd() + _rare_others()


BYTES = (188, 124, 90)
"""sRGB levels of linear light 128, 51, 26 of 255."""


def _two_colors(glb: Glb) -> None:
    levels = glb.accessor(np.tile(np.round(np.array(LIGHT) * 255), (4, 1)), "u1", normalized=True)
    glb.mesh(glb.plate(COLOR_0=levels, COLOR_1=glb.accessor(np.tile([0, 0, 0, 255], (4, 1)), "u1", normalized=True)))


def _odd_stride(glb: Glb) -> None:
    """Put positions and colours of bytes into rows of 27 bytes."""
    levels = np.round(np.array(LIGHT) * 255).astype("u1").tobytes()
    data = b"".join(np.array(point, "<f4").tobytes() + levels + bytes(11) for point in SQUARE)
    index, view = glb.accessor(TWO.ravel(), "u1"), glb.view(data, byteStride=27)
    color = {"byteOffset": 12, "componentType": 5121, "normalized": True, "type": "VEC4"}
    for more in ({"componentType": 5126, "type": "VEC3"}, color):
        glb.document["accessors"].append({"bufferView": view, "count": 4, **more})
    glb.mesh({"attributes": {"POSITION": index + 1, "COLOR_0": index + 2}, "indices": index})


def _quantized_uv(values: tuple[float, float], kind: str, scale: float | None) -> Write:
    """Return a writer of a textured plate whose coordinates are integers: normalised, or scaled by the texture."""

    def build(glb: Glb) -> None:
        glb.document["images"] = [{"bufferView": glb.view(image()), "mimeType": "image/png"}]
        glb.document["textures"] = [{"source": 0}]
        move = {"extensions": {"KHR_texture_transform": {"scale": [scale, scale]}}} if scale else {}
        glb.document["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, **move}}}]
        uv = glb.accessor(np.tile(values, (4, 1)), kind, **({} if scale else {"normalized": True}))
        glb.mesh({**glb.plate(TEXCOORD_0=uv), "material": 0})
        glb.require("KHR_mesh_quantization", *(["KHR_texture_transform"] if scale else []))

    return gltf(build)


def _sparse_morph(glb: Glb) -> None:
    """Make the plate longer by half of a target that is zero but for two vertices."""
    plate, moves = glb.plate(), np.array([(2, 0, 0), (2, 0, 0)], "<f4")
    indices = {"bufferView": glb.view(bytes([1, 2])), "componentType": 5121}
    sparse = {"count": 2, "indices": indices, "values": {"bufferView": glb.view(moves.tobytes())}}
    glb.document["accessors"].append({"componentType": 5126, "count": 4, "type": "VEC3", "sparse": sparse})
    target = len(glb.document["accessors"]) - 1
    glb.mesh({**plate, "targets": [{"POSITION": target}]}, {"weights": [0.5]})


def _mirrored_instances(glb: Glb) -> None:
    attributes = {"SCALE": glb.accessor([(-1, 1, 1), (1, 1, 1)]), "_ID": glb.accessor([0.0, 1.0])}
    glb.mesh(glb.plate(), extensions={"EXT_mesh_gpu_instancing": {"attributes": attributes}})
    glb.require("EXT_mesh_gpu_instancing")


def _rare_gltf() -> list[Feature]:
    def feature(group: str, name: str, write: Write, ending: str = ".glb", **expected: Any) -> Feature:
        return Feature(group, name, "glTF", ending, write, **expected)

    uv, beside = "coordinates, 8 and 16 bits", separate("a+b c%.bin", "a+b%20c%25.bin")
    return [
        feature(COLORS, "vertices, 8 bits", gltf(_two_colors), colors=(BYTES,)),
        feature(COLORS, "interleaved arrays", gltf(_odd_stride), colors=(BYTES,)),
        feature(TEXTURES, uv, _quantized_uv((24575, 16384), "i2", None), colors=(BLUE,)),
        feature(TEXTURES, uv, _quantized_uv((95, 64), "i1", None), colors=(BLUE,)),
        feature(TEXTURES, uv, _quantized_uv((49151, 32768), "u2", 1 / 65535), colors=(BLUE,)),
        feature(TEXTURES, uv, _quantized_uv((3072, 2048), "i2", 1 / 4096), colors=(BLUE,)),
        feature(GEOMETRY, "morph weights", gltf(_sparse_morph), area=3.0),
        feature(GEOMETRY, "instances", gltf(_mirrored_instances), area=4.0, faces=4, facing=UP),
        feature(NAMES, "arrays in a separate file", beside, ".gltf", colors=(DISPLAY,)),
    ]


def _float_unit(path: Path) -> None:
    """Write a binary stage whose unit is a float, as a program did: USD's own writer makes a double of it."""
    usd(usd_mesh())(path.with_suffix(".usda"))
    text = path.with_suffix(".usda").read_text().replace("metersPerUnit = 1", "metersPerUnit = 0.5")
    layer = Sdf.Layer.CreateAnonymous(".usda")
    assert layer.ImportFromString(text) and layer.Export(str(path))
    value, double, real = struct.pack("<f", 0.5) + b"\0\0", b"\x09\x40", b"\x08\x40"
    data = path.read_bytes()
    assert data.count(value + double) == 1
    path.write_bytes(data.replace(value + double, value + real))


def _referenced_texture(path: Path) -> None:
    """Write a stage that refers to a layer in another folder, which has a texture in one beside itself."""
    folder = path.parent / "layers"
    (folder / "tex").mkdir(parents=True)
    usd(usd_textured(file="./tex/blue.png"))(folder / "room.usda")
    (folder / "paint.png").rename(folder / "tex/blue.png")
    start = '#usda 1.0\n(\n defaultPrim = "R"\n metersPerUnit = 1\n upAxis = "Z"\n)\n'
    path.write_text(start + 'def "R" (\n prepend references = @layers/room.usda@\n)\n{\n}\n')


GRAPH = """def Material "paint"
{
  color3f inputs:tint = (0.5, 0.5, 0.5)
  token outputs:surface.connect = </R/paint/graph/surface.outputs:surface>
  def NodeGraph "graph"
  {
    color3f inputs:color.connect = </R/paint.inputs:tint>
    def Shader "surface"
    {
      uniform token info:id = "UsdPreviewSurface"
      color3f inputs:diffuseColor.connect = </R/paint/graph.inputs:color>
      token outputs:surface
    }
  }
}
"""
"""A material whose colour comes through the inputs of itself and of a graph."""
INSTANCED = f"""def Xform "set" (
 instanceable = true
 prepend references = </R/source>
)
{{
  double3 xformOp:translate = (0, 0, 5)
  uniform token[] xformOpOrder = ["xformOp:translate"]
}}
def "source"
{{
  def PointInstancer "chairs"
  {{
    rel prototypes = </R/source/chairs/chair>
    int[] protoIndices = [0, 0]
    point3f[] positions = [(0, 0, 0), (5, 0, 0)]
    {usd_mesh("chair")}
  }}
}}
"""
"""An instancer in an instance."""
BOUND = """def SkelRoot "body" (prepend apiSchemas = ["SkelBindingAPI"])
{
  rel skel:skeleton = </R/body/bones>
  def Skeleton "bones"
  {
    uniform token[] joints = ["a"]
  }
  %s
}
"""
"""A mesh that inherits its skeleton."""
JOINTS = 'int[] primvars:skel:jointIndices = [0] (\n interpolation = "constant"\n elementSize = 1\n)'


def _rare_usd() -> list[Feature]:
    def feature(group: str, name: str, write: Write, ending: str = ".usda", **expected: Any) -> Feature:
        return Feature(group, name, "USD", ending, write, **expected)

    shown = 'color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)] (\n colorSpace = "srgb_texture"\n)'
    paint = usd_material('color3f inputs:diffuseColor = (0.5, 0.5, 0.5) (\n colorSpace = "sRGB"\n)')
    painted, levels = usd_mesh(more=PAINTED, api=True), "values marked as sRGB"
    black = 'token inputs:wrapS = "black"\n    token inputs:wrapT = "black"'
    tetrahedron = """def TetMesh "solid"
{
  point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
  int4[] tetVertexIndices = [(0, 1, 2, 3)]
}"""
    tiles = {"colors": (GREY,), "warned": ("paint.<UDIM>.png", "missing")}
    bound = usd(BOUND % usd_mesh(more=JOINTS))
    return [
        feature(COLORS, levels, usd(usd_mesh(more=shown)), colors=((128, 128, 128),)),
        feature(COLORS, levels, usd(painted + paint), colors=((128, 128, 128),)),
        feature(COLORS, "material", usd(painted + GRAPH), colors=(HALF,)),
        feature(TEXTURES, "image", _referenced_texture, colors=(BLUE,)),
        feature(TEXTURES, "wrap mode black", usd(usd_textured(black, st=(1.3, 0.5))), colors=((0, 0, 0),)),
        feature(TEXTURES, "wrap mode black", usd(usd_textured(black)), colors=(BLUE,)),
        feature(TEXTURES, "image tiles (UDIM)", usd(usd_textured(file="paint.<UDIM>.png")), **tiles),
        feature(GEOMETRY, "skins", bound, warned=("1 meshes on a skeleton",)),
        feature(GEOMETRY, "points, lines, curves", usd(usd_mesh() + tetrahedron), warned=("1 prims of type TetMesh",)),
        feature(STAGES, "subdivision surfaces", usd(usd_mesh().replace('"none"', '"bilinear"'))),
        feature(STAGES, "instancers", usd(INSTANCED), area=8.0, faces=8),
        feature(STAGES, "unit as a float", _float_unit, ".usdc"),
    ]


def _empty_faces(path: Path) -> None:
    """Write triangle strips beside an element of no faces."""
    ply(strips=[0, 1, 3, 2])(path)
    empty = b"element face 0\nproperty list uchar int vertex_indices\nelement tristrips"
    path.write_bytes(path.read_bytes().replace(b"element tristrips", empty))


def _material_list(path: Path) -> None:
    """Write faces that name one of two materials."""
    ascii_ply(XYZ, f"{LIST}, int material_index", PLATE, [f"{face} 1" for face in FACES])(path)
    head = "element material 2\n" + "".join(f"property uchar diffuse_{name}\n" for name in ("red", "green", "blue"))
    path.write_text(path.read_text().replace("end_header\n", head + "end_header\n") + "255 0 0\n128 51 26\n")


def _big_endian(path: Path) -> None:
    head = "ply\nformat binary_big_endian 1.0\nelement vertex 4\n" + "".join(f"property double {x}\n" for x in "xyz")
    head += "element face 2\nproperty list ushort ushort vertex_indices\nend_header\n"
    faces = b"".join(struct.pack(">4H", 3, *face) for face in TWO)
    path.write_bytes(head.encode() + SQUARE.astype(">f8").tobytes() + faces)


def _rare_others() -> list[Feature]:
    def feature(group: str, name: str, format: str, write: Write, **expected: Any) -> Feature:
        return Feature(group, name, format, f".{format.lower()}", write, **expected)

    lines = "\n".join(f"v {row}" for row in PLATE)
    groups = f"o f 1 2 3\ng one\n{lines}\nvt 0 0\nvn 0 0 1\nf -4/-1/-1 -3/-1/-1 -2/-1/-1\ng\ns off\no v 9 9 9\n"
    groups += "v 0 0 5\nv 2 0 5\nv 2 1 5\nf -3/-1/-1 -2/-1/-1 -1/-1/-1\n"
    moved = [
        obj(USE, f"newmtl red\nmap_Kd {options}", uv=LEFT)
        for options in (
            "-o 0.5 paint.png",
            "-s 1 1 1 -o 0.5 0 0 .\\paint.png",
            "-s 1 1 \\\n -o 0.5 0 -texres 512 -mm 0 1 textures/paint.png",
        )
    ]
    polypaint = text(f"#MRGB ffff0000ffff0000ffff0000ffff0000\n{lines}\nf 1 2 3 4\n")
    called = text(f"{lines}\nf 1 2 3 4\ncall more.obj\n", {"more.obj": b"v 0 0 0"})
    absent = obj("mtllib a.mtl\nusemtl nowhere", "newmtl red\nKd 1 0 0")
    lamp = "newmtl lamp\nKd 3 3 3\n"
    capitals = text(("solid a\n" + facets() + "endsolid a\n").upper().replace("VERTEX ", "VERTEX\t"))
    empty = text("solid a\nendsolid a\nsolid b\n" + facets() + "endsolid b\n")
    return [
        *(feature(TEXTURES, "transformed coordinates", "OBJ", write, colors=(BLUE,)) for write in moved),
        feature(
            COLORS,
            "material colour of 0 to 255",
            "OBJ",
            obj(USE, "newmtl red\nKd 128 51 26"),
            colors=(SHOWN,),
            warned=("levels of 255",),
        ),
        feature(
            COLORS,
            "material in a library with a light source above 1",
            "OBJ",
            obj(USE, lamp + "newmtl red\nKd 0.5 0.2 0.1"),
            colors=((128, 51, 26),),
        ),
        feature(
            COLORS,
            "material in a library with a light source above 1",
            "OBJ",
            obj("mtllib a.mtl\nusemtl lamp", lamp + "newmtl red\nKd 0.5 0.2 0.1"),
            colors=((255, 255, 255),),
        ),
        feature(COLORS, "missing material", "OBJ", absent, colors=(GREY,), warned=("nowhere",)),
        feature(COLORS, "ZBrush's polypaint", "OBJ", polypaint, colors=(GREY,), warned=("1 lines", "polypaint")),
        feature(GEOMETRY, "OBJ `call` statements", "OBJ", called, warned=("1 call statements",)),
        feature(GEOMETRY, "indices from the end", "OBJ", text(groups), facing=UP),
        feature(COLORS, "materials of faces", "PLY", _material_list, colors=(SHOWN,)),
        feature(GEOMETRY, "strips and fans", "PLY", _empty_faces),
        feature(GEOMETRY, "double coordinates", "PLY", _big_endian, facing=UP),
        feature(GEOMETRY, "several solids", "STL", empty, facing=UP),
        feature(NAMES, "tabs and capitals", "STL", capitals, facing=UP),
        feature(NAMES, "counts on the keyword's line", "OFF", _joined_counts, facing=UP),
    ]


def _joined_counts(path: Path) -> None:
    off()(path)
    path.write_text(path.read_text().replace("OFF\n", "OFF"))


PLAIN_FILES = _plain_files()
