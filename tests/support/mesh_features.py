"""Files of every format, one for each thing that it can hold, with what reading them has to give.

They are written by hand, number by number, so that no reader or writer of the package has a part in them.
"""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

SQUARE = np.array([(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0)], float)
TWO = np.array([(0, 1, 2), (0, 2, 3)])
"""A plate of 2 x 1 as two triangles."""
NOTCHED = np.array([(4, 0, 0), (4, 1.5, 0), (2, 1.5, 0), (2, 3, 0), (0, 3, 0), (0, 0, 0)], float)
"""An L of area 9; from its first corner not all of it is seen."""
LEFT, RIGHT = (0.25, 0.5), (0.75, 0.5)
"""Texture coordinates in the middle of the red and of the blue half of an image."""
RED, BLUE, GREY, WHITE = (255, 0, 0), (0, 0, 255), (170, 170, 170), (255, 255, 255)
UTM = np.array([447123.25, 5411987.5, 318.0])
COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}


@dataclass(frozen=True)
class Feature:
    """Something that a file holds.

    Attributes:
        group: heading of the table.
        name: row of the table.
        format: column of the table.
        ending: of the file's name.
        write: writes the file, and others beside it.
        area: of all faces; None: not looked at.
        faces: their number; None: not looked at.
        facing: direction of the sum of all faces' area vectors; None: not looked at.
        colors: all colours of the mesh's vertices, within a level of 255.
        warned: words of the warning; none if nothing is lost.
        refused: words of the error; none if it is read.
    """

    group: str
    name: str
    format: str
    ending: str
    write: Callable[[Path], None]
    area: float | None = 2.0
    faces: int | None = 2
    facing: tuple[float, float, float] | None = None
    colors: tuple[tuple[int, int, int], ...] | None = None
    warned: tuple[str, ...] = ()
    refused: tuple[str, ...] = ()

    @property
    def status(self) -> str:
        """What the table says."""
        return "refused" if self.refused else "warned" if self.warned else "read"


def image(path: Path | None = None, kind: str = "PNG", mode: str = "RGB") -> bytes:
    """Return an image, its left half red and its right half blue, and write it."""
    picture = Image.new("RGB", (16, 16), RED)
    picture.paste(BLUE, (8, 0, 16, 16))
    file = io.BytesIO()
    picture.convert(mode).save(file, kind, **({"lossless": True} if kind == "WEBP" else {}))
    if path is not None:
        path.write_bytes(file.getvalue())
    return file.getvalue()


class Glb:
    """A glTF file under construction."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
        }
        self.document |= {"meshes": [], "accessors": [], "bufferViews": [], "materials": []}

    def view(self, data: bytes, **more: Any) -> int:
        self.data += bytes(-len(self.data) % 4)
        self.document["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data), **more}
        )
        self.data += data
        return len(self.document["bufferViews"]) - 1

    def accessor(self, values: Any, kind: str = "f4", **more: Any) -> int:
        array = np.asarray(values).astype(f"<{kind}")
        shape = "SCALAR" if array.ndim == 1 else "MAT4" if array.ndim == 3 else f"VEC{array.shape[1]}"
        row = array.itemsize * int(np.prod(array.shape[1:]))
        stride = row + -row % 4  # attributes of vertices stand at multiples of four bytes
        padded = (
            array.tobytes() if array.ndim == 1 else b"".join(item.tobytes() + bytes(stride - row) for item in array)
        )
        view = self.view(padded, **({"byteStride": stride} if stride != row and array.ndim > 1 else {}))
        entry = {"bufferView": view, "componentType": COMPONENTS[kind], "count": len(array), "type": shape, **more}
        self.document["accessors"].append(entry)
        return len(self.document["accessors"]) - 1

    def mesh(self, primitive: dict[str, Any], mesh: dict[str, Any] | None = None, **node: Any) -> None:
        self.document["meshes"].append({"primitives": [primitive], **(mesh or {})})
        self.document["nodes"].append({"mesh": len(self.document["meshes"]) - 1, **node})
        self.document["scenes"][0]["nodes"].append(len(self.document["nodes"]) - 1)

    def plate(self, points: np.ndarray = SQUARE, faces: np.ndarray = TWO, **attributes: int) -> dict[str, Any]:
        return {
            "attributes": {"POSITION": self.accessor(points), **attributes},
            "indices": self.accessor(faces.ravel(), "u2"),
        }

    def require(self, *names: str, only_used: bool = False) -> None:
        self.document["extensionsUsed"] = list(names)
        if not only_used:
            self.document["extensionsRequired"] = list(names)

    def write(self, path: Path) -> None:
        self.document["buffers"] = [{"byteLength": len(self.data)}]
        text = json.dumps({key: value for key, value in self.document.items() if value != []}).encode()
        text += b" " * (-len(text) % 4)
        data = bytes(self.data) + bytes(-len(self.data) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def gltf_color(values: Any, kind: str, factor: Any = None, **more: Any) -> Callable[[Path], None]:
    """Return a writer of a plate with a colour for each vertex, as numbers of a type, and maybe a material."""

    def write(path: Path) -> None:
        glb = Glb()
        primitive = glb.plate(COLOR_0=glb.accessor(np.tile(values, (4, 1)), kind, **more))
        if factor is not None:
            glb.document["materials"] = [{"pbrMetallicRoughness": {"baseColorFactor": factor} if factor else {}}]
            primitive["material"] = 0
        glb.mesh(primitive)
        glb.write(path)

    return write


def gltf_texture(
    *sets: Any,
    info: dict[str, Any] | None = None,
    kind: str = "f4",
    material: dict[str, Any] | None = None,
    surface: dict[str, Any] | None = None,
    texture: dict[str, Any] | None = None,
    sampler: dict[str, Any] | None = None,
    data: bytes | None = None,
    need: tuple[str, ...] = (),
    used: bool = False,
    color: Any = None,
    uri: str | None = None,
) -> Callable[[Path], None]:
    """Return a writer of a plate with a texture and sets of coordinates, the same for each vertex."""

    def write(path: Path) -> None:
        glb = Glb()
        if uri is None:
            glb.document["images"] = [
                {"bufferView": glb.view(image() if data is None else data), "mimeType": "image/png"}
            ]
        else:
            glb.document["images"] = [{"uri": uri}]
        glb.document["textures"] = [{"source": 0} if texture is None else texture]
        if sampler:
            glb.document["samplers"], glb.document["textures"][0]["sampler"] = [sampler], 0
        base = {"baseColorTexture": {"index": 0, **(info or {})}, **(surface or {})}
        glb.document["materials"] = [{"pbrMetallicRoughness": base} if material is None else material]
        top = {"f4": 1, "u1": 255, "u2": 65535}[kind]
        more = {"normalized": True} if top > 1 else {}
        at = {
            f"TEXCOORD_{i}": glb.accessor(np.round(np.tile(uv, (4, 1)) * top, 6), kind, **more)
            for i, uv in enumerate(sets)
        }
        if color is not None:
            at["COLOR_0"] = glb.accessor(np.tile(color, (4, 1)))
        glb.mesh({**glb.plate(**at), "material": 0})
        if need:
            glb.require(*need, only_used=used)
        glb.write(path)

    return write


def gltf(build: Callable[[Glb], None]) -> Callable[[Path], None]:
    """Return a writer of what a function puts into a file."""

    def write(path: Path) -> None:
        glb = Glb()
        build(glb)
        glb.write(path)

    return write


def _quantized(kind: str, top: int, normalized: bool) -> Callable[[Path], None]:
    def build(glb: Glb) -> None:
        values = np.round(SQUARE / 2 * top)
        more = {"normalized": True} if normalized else {}
        scale = 2.0 if normalized else 2.0 / top
        primitive = {
            "attributes": {"POSITION": glb.accessor(values, kind, **more)},
            "indices": glb.accessor(TWO.ravel(), "u1"),
        }
        glb.mesh(primitive, scale=[scale] * 3)
        glb.require("KHR_mesh_quantization")

    return gltf(build)


def _instances(glb: Glb) -> None:
    turns = np.array([(0, 0, 0, 1), (0, 0, np.sqrt(0.5), np.sqrt(0.5)), (0, 0, 0, 1)]) * 32767
    attributes = {
        "TRANSLATION": glb.accessor([(0, 0, 0), (5, 0, 0), (9, 0, 0)]),
        "ROTATION": glb.accessor(turns, "i2", normalized=True),
        "SCALE": glb.accessor([(1, 1, 1), (1, 1, 1), (2, 2, 2)]),
    }
    glb.mesh(glb.plate(), extensions={"EXT_mesh_gpu_instancing": {"attributes": attributes}})
    glb.require("EXT_mesh_gpu_instancing")


def _sparse(glb: Glb) -> None:
    index, flat = glb.accessor(TWO.ravel(), "u2"), glb.accessor(np.zeros((4, 3)))
    rows = np.array([1, 2, 3], "<u2")
    values = {"bufferView": glb.view(SQUARE[rows].astype("<f4").tobytes())}
    indices = {"bufferView": glb.view(rows.tobytes()), "componentType": 5123}
    glb.document["accessors"][flat]["sparse"] = {"count": 3, "indices": indices, "values": values}
    glb.mesh({"attributes": {"POSITION": flat}, "indices": index})


def _morph(glb: Glb) -> None:
    longer = np.where(SQUARE == 2, 4, 0) * [1, 0, 0]
    target = glb.accessor(longer.astype(float))
    glb.mesh({**glb.plate(), "targets": [{"POSITION": target}]}, {"weights": [0.5]})  # from 2 x 1 to 4 x 1


def _skin(glb: Glb) -> None:
    joints, weights = glb.accessor(np.zeros((4, 4)), "u1"), glb.accessor(np.tile([1, 0, 0, 0], (4, 1)))
    glb.document["nodes"].append({"scale": [3, 1, 1]})
    glb.document["scenes"][0]["nodes"].append(0)
    glb.document["skins"] = [{"joints": [0], "inverseBindMatrices": glb.accessor(np.eye(4)[None])}]
    glb.mesh(glb.plate(JOINTS_0=joints, WEIGHTS_0=weights), skin=0, scale=[7, 7, 7])  # of its own node nothing counts


def _scenes(glb: Glb) -> None:
    glb.mesh(glb.plate())
    glb.mesh(glb.plate())
    glb.document["scenes"] = [{"nodes": [0]}, {"nodes": [1]}]


def _mode(mode: int, order: list[int]) -> Callable[[Path], None]:
    def build(glb: Glb) -> None:
        glb.mesh({**glb.plate(faces=np.array(order)), "mode": mode})

    return gltf(build)


def _with_lines(glb: Glb) -> None:
    glb.mesh(glb.plate())
    glb.mesh({**glb.plate(), "mode": 1})
    glb.mesh({**glb.plate(), "mode": 0})


def _hidden(glb: Glb) -> None:
    glb.mesh(glb.plate())
    glb.mesh(glb.plate(), extensions={"KHR_node_visibility": {"visible": False}})


def _needs(name: str) -> Callable[[Path], None]:
    def build(glb: Glb) -> None:
        glb.mesh(glb.plate())
        glb.require(name)

    return gltf(build)


def _far(glb: Glb) -> None:
    points, faces = rug()
    glb.mesh(glb.plate(points, faces), translation=UTM.tolist())


def rug() -> tuple[np.ndarray, np.ndarray]:
    """Return a grid of 21 x 21 points 5 cm apart, 1 m2, as triangles."""
    x, y = np.meshgrid(np.linspace(0, 1, 21), np.linspace(0, 1, 21), indexing="ij")
    i = np.arange(441).reshape(21, 21)
    a, b, c, d = (part.ravel() for part in (i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return np.stack([x.ravel(), y.ravel(), np.zeros(441)], 1), faces


def obj(
    body: str = "",
    library: str | bytes = "",
    points: np.ndarray = SQUARE,
    polygons: Iterable[Iterable[int]] = ((1, 2, 3, 4),),
    uv: tuple[float, float] | None = None,
    files: dict[str, str | bytes] | None = None,
    end: str = "\n",
    colors: np.ndarray | None = None,
) -> Callable[[Path], None]:
    """Return a writer of an OBJ file: vertices, lines of one's own, then polygons; a library a.mtl; an image paint.png."""

    def write(path: Path) -> None:
        rows = points if colors is None else np.column_stack([points, np.tile(colors, (len(points), 1))])
        lines = ["v " + " ".join(f"{x:.9g}" if abs(x) < 1e4 else f"{x:.4f}" for x in row) for row in rows]
        lines += [f"vt {uv[0]} {uv[1]}"] if uv else []
        lines += body.split("\n")
        lines += ["f " + " ".join(f"{k}/1" if uv else f"{k}" for k in polygon) for polygon in polygons]
        path.write_bytes(end.join([*lines, ""]).encode())
        (path.parent / "a.mtl").write_bytes(
            library if isinstance(library, bytes) else library.replace("\n", end).encode()
        )
        image(path.parent / "paint.png")
        for name, content in (files or {}).items():
            file = path.parent / name
            file.parent.mkdir(exist_ok=True)
            file.write_bytes(content if isinstance(content, bytes) else content.encode())

    return write


USE = "mtllib a.mtl\nusemtl red"


def ply(
    kind: str | None = None,
    top: float = 1,
    polygons: Iterable[Iterable[int]] = ((0, 1, 2), (0, 2, 3)),
    form: str = "binary_little_endian",
    points: np.ndarray = SQUARE,
    coordinate: str = "float",
    face_color: bool = False,
    extra: tuple[str, ...] = (),
    comment: bytes = b"",
    uv: tuple[float, float] | None = None,
    end: bytes = b"\n",
    strips: list[int] | None = None,
) -> Callable[[Path], None]:
    """Return a writer of a PLY file; colours 128, 51, 26 of 255 as numbers of a type up to `top`."""
    types = {"uchar": "u1", "ushort": "u2", "float": "f4", "double": "f8", "int": "i4"}

    def write(path: Path) -> None:
        order = ">" if "big" in form else "<"
        values = [float(np.round(level / 255 * top, 6 if top == 1 else 0)) for level in (128, 51, 26)]
        columns = [(coordinate, name) for name in "xyz"] + [("float", name) for name in ("s", "t") if uv]
        columns += [(kind, name) for name in ("red", "green", "blue")] if kind and not face_color else []
        head = [
            "ply",
            f"format {form} 1.0",
            *extra,
            f"element vertex {len(points)}",
            *(f"property {k} {n}" for k, n in columns),
        ]
        rows = [[*point, *(uv or ()), *(values if kind and not face_color else ())] for point in points.tolist()]
        lists = list(polygons) if strips is None else [strips]
        head += [
            f"element {'face' if strips is None else 'tristrips'} {len(lists)}",
            "property list uchar int vertex_indices",
        ]
        head += [f"property {kind} {name}" for name in ("red", "green", "blue")] if face_color else []
        tail = values if face_color else []
        if form == "ascii":
            lines = [" ".join(f"{x:.9g}" for x in row) for row in rows]
            lines += [" ".join(f"{x:g}" for x in (len(list(each)), *each, *tail)) for each in lists]
            body = "\n".join([*lines, ""]).encode()
        else:
            body = b"".join(
                np.array(x, order + types[k]).tobytes() for row in rows for x, (k, _) in zip(row, columns, strict=True)
            )
            for each in lists:
                body += struct.pack("B", len(list(each))) + np.array(list(each), f"{order}i4").tobytes()
                body += b"".join(np.array(x, order + types[kind or "uchar"]).tobytes() for x in tail)
        lines_of_head = [line.encode() for line in head]
        lines_of_head[2:2] = [b"comment " + comment] if comment else []
        path.write_bytes(end.join([*lines_of_head, b"end_header", b""]) + body)
        image(path.parent / "paint.png")

    return write


def rows(values: Any) -> str:
    """Return points or colours as USD's text."""
    return "[" + ", ".join("(" + ", ".join(f"{x:.9g}" for x in row) + ")" for row in np.asarray(values).tolist()) + "]"


def usd_mesh(
    name: str = "plate",
    more: str = "",
    points: np.ndarray = SQUARE,
    polygons: tuple[tuple[int, ...], ...] = ((0, 1, 2), (0, 2, 3)),
    api: bool = False,
) -> str:
    """Return a Mesh prim; `more` are further lines."""
    head = f'def Mesh "{name}" (prepend apiSchemas = ["MaterialBindingAPI"])' if api else f'def Mesh "{name}"'
    return f"""{head}
{{
  point3f[] points = {rows(points)}
  int[] faceVertexCounts = {[len(polygon) for polygon in polygons]}
  int[] faceVertexIndices = {[i for polygon in polygons for i in polygon]}
  uniform token subdivisionScheme = "none"
  {more}
}}
"""


def usd(body: str, head: str = "") -> Callable[[Path], None]:
    """Return a writer of a stage with prims below /R, and an image paint.png beside it."""

    def write(path: Path) -> None:
        image(path.parent / "paint.png")
        start = f'#usda 1.0\n(\n  defaultPrim = "R"\n  metersPerUnit = 1\n  upAxis = "Z"\n  {head}\n)\n'
        path.write_text(f'{start}def Xform "R"\n{{\n{body}\n}}\n')

    return write


PAINTED = "rel material:binding = </R/paint>\n"


def usd_material(
    inputs: str, nodes: str = "", shader: str = 'uniform token info:id = "UsdPreviewSurface"', context: str = ""
) -> str:
    """Return a material /R/paint whose surface has these inputs; `nodes` are further shaders of it."""
    output = f"outputs:{context}surface"
    return f"""def Material "paint"
{{
  token {output}.connect = </R/paint/surface.outputs:surface>
  def Shader "surface"
  {{
    {shader}
    {inputs}
    token outputs:surface
  }}
  {nodes}
}}
"""


def usd_textured(
    texture: str = "",
    st: tuple[float, float] = RIGHT,
    primvar: str = "st",
    nodes: str = "",
    source: str = "reader",
    file: str = "paint.png",
) -> str:
    """Return a plate with a UsdUVTexture whose coordinates are the same everywhere."""
    mesh = f'{PAINTED}texCoord2f[] primvars:{primvar} = {rows([st] * 4)} (\n interpolation = "vertex"\n)'
    shaders = f"""def Shader "image"
  {{
    uniform token info:id = "UsdUVTexture"
    asset inputs:file = @{file}@
    float2 inputs:st.connect = </R/paint/{source}.outputs:result>
    {texture}
    float3 outputs:rgb
  }}
  def Shader "reader"
  {{
    uniform token info:id = "UsdPrimvarReader_float2"
    string inputs:varname = "{primvar}"
    float2 outputs:result
  }}
  {nodes}"""
    slot = "color3f inputs:diffuseColor.connect = </R/paint/image.outputs:rgb>"
    return usd_mesh(more=mesh, api=True) + usd_material(slot, shaders)


MOVED = """def Shader "moved"
  {
    uniform token info:id = "UsdTransform2d"
    float2 inputs:in.connect = </R/paint/reader.outputs:result>
    float2 inputs:scale = (2, 1)
    float inputs:rotation = 0
    float2 inputs:translation = (0.25, 0)
    float2 outputs:result
  }"""
SUBSETS = """def GeomSubset "first" (prepend apiSchemas = ["MaterialBindingAPI"])
  {
    uniform token elementType = "face"
    uniform token familyName = "materialBind"
    int[] indices = [0]
    rel material:binding = </R/paint>
  }"""
PRIMVAR = """def Shader "reader"
  {
    uniform token info:id = "UsdPrimvarReader_float3"
    string inputs:varname = "shade"
    float3 outputs:result
  }"""
MDL = """uniform token info:implementationSource = "sourceAsset"
    uniform asset info:mdl:sourceAsset = @OmniPBR.mdl@
    uniform token info:mdl:sourceAsset:subIdentifier = "OmniPBR\""""
HALF = (188, 188, 188)
"""sRGB levels of linear light 0.5: 1.055 * 0.5 ** (1 / 2.4) - 0.055 of 255."""
DISPLAY = (188, 124, 89)
"""sRGB levels of linear light 0.5, 0.2, 0.1."""
SHOWN = (128, 51, 26)
CORNERS = ((0, 1, 2), (0, 2, 3))
LIGHT = (0.5, 0.2, 0.1, 1.0)
ROTATED = {"extensions": {"KHR_texture_transform": {"offset": [0.25, 0.25], "rotation": np.pi / 2, "scale": [1, 1]}}}
"""Of (0.25, 0.5): u' = cos u + sin v + 0.25 = 0.75."""
GLOSS = {"extensions": {"KHR_materials_pbrSpecularGlossiness": {"diffuseTexture": {"index": 0}}}}
KTX = b"\xabKTX 20\xbb\r\n\x1a\n" + bytes(64)
BASISU = {"extensions": {"KHR_texture_basisu": {"source": 0}}}

NESTED = f"""def PointInstancer "outer"
{{
  rel prototypes = </R/outer/inner>
  int[] protoIndices = [0, 0]
  point3f[] positions = [(0, 0, 0), (0, 10, 0)]
  def PointInstancer "inner"
  {{
    rel prototypes = </R/library/chair>
    int[] protoIndices = [0, 0, 0]
    point3f[] positions = [(0, 0, 0), (3, 0, 0), (6, 0, 0)]
  }}
}}
class Xform "library"
{{
  def Xform "chair"
  {{
    {usd_mesh()}
  }}
}}"""
"""An instancer of instancers; what they repeat is a class, which shows nowhere else."""

COLORS, TEXTURES, GEOMETRY, STAGES, NAMES = "colours", "textures", "geometry", "stages", "names and encodings"


def _features() -> list[Feature]:
    """Return all features."""
    found: list[Feature] = []

    def add(group: str, name: str, format: str, write: Callable[[Path], None], **expected: Any) -> None:
        ending = {"glTF": ".glb", "OBJ": ".obj", "PLY": ".ply", "USD": ".usda"}[format]
        found.append(Feature(group, name, format, ending, write, **expected))

    def color(
        name: str, format: str, write: Callable[[Path], None], *colors: tuple[int, int, int], **more: Any
    ) -> None:
        add(COLORS, name, format, write, colors=colors, **more)

    def texture(
        name: str, format: str, write: Callable[[Path], None], *colors: tuple[int, int, int], **more: Any
    ) -> None:
        add(TEXTURES, name, format, write, colors=colors or (BLUE,), **more)

    bytes_of = np.round(np.array(LIGHT) * 255)
    color("vertices, 8 bits", "glTF", gltf_color(bytes_of, "u1", normalized=True), (188, 124, 90))
    color("vertices, 8 bits", "PLY", ply("uchar", 255), SHOWN)
    color("vertices, 8 bits", "OBJ", obj(colors=np.array([128, 51, 26])), SHOWN)
    color("vertices, 16 bits", "glTF", gltf_color(np.round(np.array(LIGHT) * 65535), "u2", normalized=True), DISPLAY)
    color("vertices, 16 bits", "PLY", ply("ushort", 65535), SHOWN)
    color("vertices, 16 bits", "PLY", ply("ushort", 65535, form="ascii"), SHOWN)
    color("vertices, floats", "glTF", gltf_color(LIGHT[:3], "f4"), DISPLAY)
    color("vertices, floats", "PLY", ply("float"), SHOWN)
    color("vertices, floats", "PLY", ply("double", form="binary_big_endian"), SHOWN)
    color("vertices, floats", "OBJ", obj(colors=np.array([128, 51, 26]) / 255), SHOWN)
    vertex = f'color3f[] primvars:displayColor = {rows([LIGHT[:3]] * 4)} (\n interpolation = "vertex"\n)'
    color("vertices, floats", "USD", usd(usd_mesh(more=vertex)), DISPLAY)
    color(
        "vertices with a white material",
        "glTF",
        gltf_color(np.round(np.array(LIGHT) * 65535), "u2", [], normalized=True),
        DISPLAY,
    )
    color(
        "vertices with a white material",
        "OBJ",
        obj(USE, "newmtl red\nKd 1 1 1", colors=np.array([128, 51, 26]) / 255),
        SHOWN,
    )
    color("product of material and vertices", "glTF", gltf_color([1, 0.4, 0.2], "f4", [0.5, 0.5, 0.5, 1]), DISPLAY)
    both = usd_mesh(more=vertex + "\n" + PAINTED, api=True) + usd_material("color3f inputs:diffuseColor = (0, 0, 1)")
    color("material overrides vertices", "USD", usd(both), BLUE)
    color("material", "glTF", _factor([0.5, 0.5, 0.5, 1]), HALF)
    color("material", "OBJ", obj(USE, "newmtl red\nKd 0.5 0.2 0.1"), (128, 51, 26))
    plain = usd_mesh(more=PAINTED, api=True) + usd_material("color3f inputs:diffuseColor = (0.5, 0.5, 0.5)")
    color("material", "USD", usd(plain), HALF)
    color("material, specular glossiness", "glTF", _factor(None, {"diffuseFactor": [0.5, 0.5, 0.5, 1]}), HALF)
    uniform = 'color3f[] primvars:displayColor = [(0.5, 0.5, 0.5), (0.5, 0.5, 0.5)] (\n interpolation = "uniform"\n)'
    color("faces", "PLY", ply("uchar", 255, face_color=True), SHOWN)
    color("faces", "USD", usd(usd_mesh(more=uniform)), HALF)
    indexed = (
        'color3f[] primvars:displayColor = [(1, 0, 0), (0.5, 0.5, 0.5)] (\n interpolation = "vertex"\n)\n'
        "int[] primvars:displayColor:indices = [1, 1, 1, 1]"
    )
    color("indexed primvars", "USD", usd(usd_mesh(more=indexed)), HALF)
    shade = f'color3f[] primvars:shade = {rows([LIGHT[:3]] * 4)} (\n interpolation = "vertex"\n)\n{PAINTED}'
    slot = "color3f inputs:diffuseColor.connect = </R/paint/reader.outputs:result>"
    color(
        "material that reads a primvar",
        "USD",
        usd(usd_mesh(more=shade, api=True) + usd_material(slot, PRIMVAR)),
        DISPLAY,
    )
    mdl = "color3f inputs:diffuse_color_constant = (0.5, 0.5, 0.5)"
    color("MDL", "USD", usd(usd_mesh(more=PAINTED, api=True) + usd_material(mdl, "", MDL, "mdl:")), HALF)
    color(
        "MDL",
        "USD",
        usd(
            usd_mesh(more=PAINTED, api=True)
            + usd_material(f"{mdl}\ncolor3f inputs:diffuse_tint = (1, 0, 0)", "", MDL, "mdl:")
        ),
        (188, 0, 0),
    )
    unknown = usd_mesh(more=f"{vertex}\n{PAINTED}", api=True) + usd_material(
        "float inputs:mist = 1", "", 'uniform token info:id = "Fog"'
    )
    color("unknown shader", "USD", usd(unknown), DISPLAY, warned=("/R/paint", "no base colour"))
    subset = usd_mesh(more=f"{SUBSETS}\n{uniform}", points=SQUARE[[0, 1, 2, 0, 2, 3]], polygons=((0, 1, 2), (3, 4, 5)))
    color(
        "subsets of faces",
        "USD",
        usd(subset + usd_material("color3f inputs:diffuseColor = (0, 0, 1)")),
        BLUE,
        HALF,
        (94, 94, 222),
        faces=2,
    )
    inherited = f'def Xform "above"\n{{\n color3f[] primvars:displayColor = [(0, 0, 1)]\n {usd_mesh()}\n}}'
    color("inherited from a parent prim", "USD", usd(inherited), BLUE)
    blue = usd_material("color3f inputs:diffuseColor = (0, 0, 1)")
    color(
        "inherited from a parent prim", "USD", usd(f'def Xform "above"\n{{\n {PAINTED} {usd_mesh()}\n}}\n{blue}'), BLUE
    )
    timed = "color3f[] primvars:displayColor.timeSamples = { 1: [(0, 0, 1)], 5: [(1, 0, 0)] }"
    color("time samples", "USD", usd(usd_mesh(more=timed)), BLUE)
    surface = 'uniform token info:id = "ND_standard_surface_surfaceshader"'
    inputs = "color3f inputs:base_color = (1, 1, 1)\nfloat inputs:base = 0.5"
    color("MaterialX", "USD", usd(usd_mesh(more=PAINTED, api=True) + usd_material(inputs, "", surface, "mtlx:")), HALF)
    color("colours of 0 to 255 in a wider type", "PLY", ply("ushort", 255), SHOWN, warned=("levels of 255",))
    color("transparency", "glTF", _factor([0.5, 0.5, 0.5, 0.3], mode="BLEND"), HALF, warned=("2 faces", "opaque"))

    clear = usd_material("color3f inputs:diffuseColor = (0.5, 0.5, 0.5)\nfloat inputs:opacity = 0.3")
    color("transparency", "USD", usd(usd_mesh(more=PAINTED, api=True) + clear), HALF, warned=("/R/paint", "opaque"))
    color("transparency", "OBJ", obj(USE, "newmtl red\nKd 0.5 0.2 0.1\nd 0.3"), SHOWN, warned=("1 materials", "opaque"))

    texture("image", "glTF", gltf_texture(RIGHT))
    texture("image", "OBJ", obj(USE, "newmtl red\nKd 0.8 0.8 0.8\nmap_Kd paint.png", uv=RIGHT))
    texture("image", "PLY", ply(uv=RIGHT, comment=b"TextureFile paint.png"))
    texture("image", "USD", usd(usd_textured()))
    texture(
        "WebP",
        "glTF",
        gltf_texture(
            RIGHT,
            texture={"extensions": {"EXT_texture_webp": {"source": 0}}},
            data=image(kind="WEBP"),
            need=("EXT_texture_webp",),
        ),
    )
    texture("second set of coordinates", "glTF", gltf_texture(LEFT, RIGHT, info={"texCoord": 1}))
    texture("second set of coordinates", "USD", usd(usd_textured(primvar="UVMap_2")))
    transform = {"extensions": {"KHR_texture_transform": {"offset": [0.5, 0.0]}}}
    texture("transformed coordinates", "glTF", gltf_texture(LEFT, info=transform, need=("KHR_texture_transform",)))
    texture("transformed coordinates", "glTF", gltf_texture(LEFT, info=ROTATED, need=("KHR_texture_transform",)))
    other = {"extensions": {"KHR_texture_transform": {"texCoord": 1}}}
    texture(
        "transformed coordinates",
        "glTF",
        gltf_texture(LEFT, RIGHT, info=other, need=("KHR_texture_transform",), used=True),
    )
    texture("transformed coordinates", "OBJ", obj(USE, "newmtl red\nmap_Kd -s 2 1 1 -o 0.25 0 0 paint.png", uv=LEFT))
    texture("transformed coordinates", "USD", usd(usd_textured(st=LEFT, nodes=MOVED, source="moved")))
    texture("coordinates, 8 and 16 bits", "glTF", gltf_texture(RIGHT, kind="u1"))
    texture("coordinates, 8 and 16 bits", "glTF", gltf_texture(RIGHT, kind="u2"))
    texture("clamped, mirrored", "glTF", gltf_texture((1.3, 0.5), sampler={"wrapS": 33071}))
    texture("clamped, mirrored", "glTF", gltf_texture((1.3, 0.5), sampler={"wrapS": 33648}))
    texture("clamped, mirrored", "OBJ", obj(USE, "newmtl red\nmap_Kd -clamp on paint.png", uv=(1.3, 0.5)))
    texture("clamped, mirrored", "USD", usd(usd_textured('token inputs:wrapS = "mirror"', st=(1.3, 0.5))))
    texture(
        "product of image, factor and vertices",
        "glTF",
        gltf_texture(RIGHT, surface={"baseColorFactor": [1, 1, 0.5, 1]}, color=[1, 1, 1]),
        (0, 0, 188),
    )
    texture("product of image, factor and vertices", "glTF", gltf_texture(RIGHT, color=[1, 1, 0.5]), (0, 0, 188))
    texture(
        "product of image, factor and vertices",
        "USD",
        usd(usd_textured("float4 inputs:scale = (1, 1, 0.5, 1)")),
        (0, 0, 188),
    )
    texture("specular glossiness", "glTF", gltf_texture(RIGHT, material=GLOSS))
    emission = {
        "emissiveFactor": [1, 1, 1],
        "emissiveTexture": {"index": 0},
        "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]},
    }
    texture("emission of a black surface", "glTF", gltf_texture(RIGHT, material=emission))
    mdl = f'{PAINTED}texCoord2f[] primvars:st = {rows([RIGHT] * 4)} (\n interpolation = "vertex"\n)'
    texture(
        "MDL",
        "USD",
        usd(usd_mesh(more=mdl, api=True) + usd_material("asset inputs:diffuse_texture = @paint.png@", "", MDL, "mdl:")),
    )
    texture(
        "KTX2, required",
        "glTF",
        gltf_texture(RIGHT, texture=BASISU, data=KTX, need=("KHR_texture_basisu",)),
        refused=("KHR_texture_basisu",),
    )
    texture(
        "KTX2, optional",
        "glTF",
        gltf_texture(RIGHT, texture=BASISU, data=KTX, need=("KHR_texture_basisu",), used=True),
        GREY,
        warned=("KHR_texture_basisu",),
    )
    texture("missing image", "glTF", gltf_texture(RIGHT, uri="gone.png"), GREY, warned=("gone.png", "grey"))
    texture(
        "missing image", "OBJ", obj(USE, "newmtl red\nmap_Kd gone.png", uv=RIGHT), GREY, warned=("gone.png", "missing")
    )
    texture(
        "missing image", "PLY", ply(uv=RIGHT, comment=b"TextureFile gone.png"), GREY, warned=("gone.png", "missing")
    )
    texture("missing image", "USD", usd(usd_textured(file="gone.png")), GREY, warned=("gone.png", "missing"))
    texture("missing coordinates", "glTF", gltf_texture(), WHITE, warned=("TEXCOORD_0", "2 faces"))
    texture("missing coordinates", "OBJ", obj(USE, "newmtl red\nmap_Kd paint.png"), WHITE, warned=("2 faces", "white"))
    texture(
        "missing coordinates",
        "USD",
        usd(usd_textured().replace("primvars:st ", "primvars:other ")),
        WHITE,
        warned=("'st'", "2 faces"),
    )

    notch: dict[str, Any] = {"area": 9.0, "faces": 4}
    add(GEOMETRY, "concave polygons", "OBJ", obj(points=NOTCHED, polygons=[range(1, 7)]), **notch)
    add(GEOMETRY, "concave polygons", "PLY", ply(points=NOTCHED, polygons=[range(6)]), **notch)
    add(GEOMETRY, "concave polygons", "PLY", ply(points=NOTCHED, polygons=[range(6)], form="ascii"), **notch)
    add(GEOMETRY, "concave polygons", "USD", usd(usd_mesh(points=NOTCHED, polygons=(tuple(range(6)),))), **notch)
    dart = np.array([(0, 0, 0), (4, 0, 0), (1, 1, 0), (0, 4, 0)], float)  # a quad with a notch at its third corner: 4
    add(GEOMETRY, "concave quads", "OBJ", obj(points=dart[[1, 2, 3, 0]]), area=4.0)
    add(GEOMETRY, "concave quads", "PLY", ply(points=dart[[1, 2, 3, 0]], polygons=[range(4)]), area=4.0)
    add(GEOMETRY, "concave quads", "USD", usd(usd_mesh(points=dart[[1, 2, 3, 0]], polygons=((0, 1, 2, 3),))), area=4.0)
    add(GEOMETRY, "strips and fans", "glTF", _mode(5, [0, 1, 3, 2]))
    add(GEOMETRY, "strips and fans", "glTF", _mode(6, [0, 1, 2, 3]))
    add(GEOMETRY, "strips and fans", "PLY", ply(strips=[0, 1, 3, 2, -1, 0, 1, 2]), area=3.0, faces=3)
    add(GEOMETRY, "sparse arrays", "glTF", gltf(_sparse))
    add(GEOMETRY, "quantised positions", "glTF", _quantized("u2", 65535, False))
    add(GEOMETRY, "quantised positions", "glTF", _quantized("u2", 65535, True))
    add(GEOMETRY, "quantised positions", "glTF", _quantized("i2", 32767, True))
    add(GEOMETRY, "quantised positions", "glTF", _quantized("u1", 254, False))
    add(GEOMETRY, "instances", "glTF", gltf(_instances), area=2.0 + 2.0 + 8.0, faces=6)
    add(GEOMETRY, "morph weights", "glTF", gltf(_morph), area=4.0)
    add(GEOMETRY, "skins", "glTF", gltf(_skin), area=6.0)
    add(GEOMETRY, "additional scenes", "glTF", gltf(_scenes), warned=("1 meshes", "scene 0"))
    add(
        GEOMETRY,
        "points, lines, curves",
        "glTF",
        gltf(_with_lines),
        warned=("1 primitives of lines", "1 primitives of points"),
    )
    add(GEOMETRY, "points, lines, curves", "OBJ", obj("l 1 2\nl 2 3\np 1"), warned=("2 lines", "1 points"))
    curve = 'def BasisCurves "wire" { int[] curveVertexCounts = [2]\n point3f[] points = [(0, 0, 0), (1, 1, 1)]\n }'
    add(GEOMETRY, "points, lines, curves", "USD", usd(usd_mesh() + curve), warned=("1 prims of type BasisCurves",))
    add(GEOMETRY, "faces with two corners", "OBJ", obj("f 1 2"), warned=("1 faces", "fewer than 3"))
    add(GEOMETRY, "faces with two corners", "PLY", ply(polygons=((0, 1), *CORNERS)), warned=("1 faces", "fewer than 3"))
    grid: dict[str, Any] = {"area": 1.0, "faces": 800}
    points, faces = rug()
    one = [tuple(int(i) + 1 for i in face) for face in faces]
    zero = [tuple(map(int, face)) for face in faces]
    add(GEOMETRY, "map coordinates", "OBJ", obj(points=points + UTM, polygons=one), **grid)
    add(GEOMETRY, "map coordinates", "PLY", ply(points=points + UTM, polygons=zero, coordinate="double"), **grid)
    add(GEOMETRY, "map coordinates", "glTF", gltf(_far), **grid)
    far = f'double3 xformOp:translate = ({UTM[0]}, {UTM[1]}, {UTM[2]})\nuniform token[] xformOpOrder = ["xformOp:translate"]'
    add(GEOMETRY, "map coordinates", "USD", usd(usd_mesh(more=far, points=points, polygons=tuple(zero))), **grid)
    add(GEOMETRY, "compressed", "glTF", _needs("KHR_draco_mesh_compression"), refused=("Draco", "gltf-transform"))
    add(GEOMETRY, "compressed", "glTF", _needs("EXT_meshopt_compression"), refused=("meshopt", "gltf-transform"))
    add(
        GEOMETRY,
        "unknown extension, required",
        "glTF",
        _needs("ACME_secret_geometry"),
        refused=("ACME_secret_geometry",),
    )

    add(STAGES, "invisible", "glTF", gltf(_hidden), warned=("1 nodes are invisible",))
    add(
        STAGES,
        "invisible",
        "USD",
        usd(usd_mesh() + usd_mesh("gone", 'token visibility = "invisible"')),
        warned=("1 invisible",),
    )
    add(
        STAGES,
        "guides and proxies",
        "USD",
        usd(usd_mesh() + usd_mesh("hull", 'uniform token purpose = "guide"')),
        warned=("1 prims of purpose guide",),
    )
    add(
        STAGES,
        "guides and proxies",
        "USD",
        usd(
            usd_mesh("fine", 'uniform token purpose = "render"') + usd_mesh("rough", 'uniform token purpose = "proxy"')
        ),
        warned=("1 prims of purpose proxy",),
    )
    instancer = f"""def PointInstancer "chairs"
{{
  rel prototypes = </R/chairs/proto>
  int[] protoIndices = [0, 0, 0]
  point3f[] positions = [(0, 0, 0), (5, 0, 0), (9, 0, 0)]
  float3[] scales = [(1, 1, 1), (1, 1, 1), (2, 2, 2)]
  {usd_mesh("proto")}
}}"""
    add(STAGES, "instancers", "USD", usd(instancer), area=12.0, faces=6)
    hidden = instancer.replace("float3[] scales", "int64[] invisibleIds = [1]\n  float3[] scales")
    add(STAGES, "instancers", "USD", usd(hidden), area=10.0, faces=4, warned=("1 hidden instances",))
    sampled = f"point3f[] points.timeSamples = {{ 1: {rows(SQUARE)}, 9: {rows(3 * SQUARE)} }}"
    mesh = usd_mesh().replace(f"point3f[] points = {rows(SQUARE)}", sampled)
    add(STAGES, "time samples", "USD", usd(mesh, "startTimeCode = 1\n  endTimeCode = 9"))
    add(STAGES, "time samples", "USD", usd(mesh, "startTimeCode = 5\n  endTimeCode = 9"), area=8.0)
    add(STAGES, "time samples", "USD", usd(mesh))
    growing = "double3 xformOp:scale.timeSamples = { 1: (2, 2, 2), 9: (5, 5, 5) }\n"
    growing += 'uniform token[] xformOpOrder = ["xformOp:scale"]'
    add(STAGES, "time samples", "USD", usd(usd_mesh(more=growing)), area=8.0)
    fading = 'token visibility.timeSamples = { 1: "invisible", 5: "inherited" }'
    add(STAGES, "time samples", "USD", usd(usd_mesh() + usd_mesh("late", fading)), warned=("1 invisible",))
    source = f'def Xform "source"\n{{\n{usd_mesh()}\n}}\n'
    copy = 'def Xform "copy" (\n instanceable = true\n prepend references = </R/source>\n)\n{\n}\n'
    add(STAGES, "instanceable prims", "USD", usd(source + copy), area=4.0, faces=4)
    add(STAGES, "instancers", "USD", usd(NESTED), area=12.0, faces=12)
    add(STAGES, "guides and proxies", "USD", usd(usd_mesh("only", 'uniform token purpose = "proxy"')))
    add(STAGES, "cubes, spheres, cylinders", "USD", usd('def Cube "a"\n{\n double size = 2\n}'), area=24.0, faces=12)
    add(
        STAGES,
        "cubes, spheres, cylinders",
        "USD",
        usd('def Plane "a"\n{\n double width = 2\n double length = 3\n uniform token axis = "X"\n}'),
        area=6.0,
    )
    around = 32 * np.sin(np.pi / 32)  # of a circle of 32 sides with radius 1, half the circumference
    cylinder = 'def Cylinder "a"\n{\n double height = 2\n double radius = 1\n}'
    add(
        STAGES,
        "cubes, spheres, cylinders",
        "USD",
        usd(cylinder),
        area=float(2 * 2 * around + 2 * around * np.cos(np.pi / 32)),
        faces=128,
    )
    add(STAGES, "holes", "USD", usd(usd_mesh(more="int[] holeIndices = [1]")), area=1.0, faces=1)
    reference = 'def Xform "other" (prepend references = @gone.usda@)\n{\n}\n'
    cage = usd_mesh().replace('subdivisionScheme = "none"', 'subdivisionScheme = "catmullClark"')
    add(STAGES, "subdivision surfaces", "USD", usd(cage), warned=("1 subdivision surfaces", "cages"))
    add(STAGES, "missing references", "USD", usd(usd_mesh() + reference), warned=("1 references", "gone.usda"))

    def named(
        name: str, format: str, write: Callable[[Path], None], *colors: tuple[int, int, int], **more: Any
    ) -> None:
        add(NAMES, name, format, write, colors=colors or (BLUE,), **more)

    odd, quoted = "my #1 paint (2).png", '"my paint.png"'
    named("images with spaces, #, quotes", "glTF", _beside(gltf_texture(RIGHT, uri="my%20%231%20paint%20(2).png"), odd))
    named("images with spaces, #, quotes", "OBJ", obj(USE, f"newmtl red\nmap_Kd {odd}", uv=RIGHT, files={odd: image()}))
    named(
        "images with spaces, #, quotes",
        "OBJ",
        obj(USE, f"newmtl red\nmap_Kd {quoted}", uv=RIGHT, files={"my paint.png": image()}),
    )
    named(
        "images with spaces, #, quotes",
        "OBJ",
        obj(USE, f"newmtl red\nmap_Kd -bm 1 -s 1 1 1 {odd}", uv=RIGHT, files={odd: image()}),
    )
    named("images with spaces, #, quotes", "OBJ", obj(USE, "newmtl red\nmap_Kd paint.png # the paint", uv=RIGHT))
    named("images with spaces, #, quotes", "PLY", _beside(ply(uv=RIGHT, comment=b"TextureFile " + odd.encode()), odd))
    named("images with spaces, #, quotes", "USD", _beside(usd(usd_textured(file=odd)), odd))
    named("absolute paths of another machine", "OBJ", obj(USE, "newmtl red\nmap_Kd C:\\Users\\me\\Paint.PNG", uv=RIGHT))
    named(
        "absolute paths of another machine",
        "OBJ",
        obj(USE, "newmtl red\nmap_Kd tex\\p.png", uv=RIGHT, files={"tex/p.png": image()}),
    )
    named("absolute paths of another machine", "USD", usd(usd_textured(file="C:/Users/me/Paint.PNG")))
    library = {"lib/b.mtl": "newmtl red\nmap_Kd paint.png"}
    named("absolute paths of another machine", "OBJ", obj("mtllib lib/b.mtl\nusemtl red", uv=RIGHT, files=library))
    blue = "newmtl {}\nKd 0 0 1\n"
    named("materials with spaces and #", "OBJ", obj("mtllib a.mtl\nusemtl Material #25", blue.format("Material #25")))
    named("materials with spaces and #", "OBJ", obj("mtllib a.mtl\nusemtl red # mine", blue.format("red")))
    named("materials with spaces and #", "OBJ", obj("mtllib a.mtl\nusemtl my  wood", blue.format("my  wood")))
    named(
        "several libraries",
        "OBJ",
        obj("mtllib a.mtl b.mtl\nusemtl red", "newmtl x\nKd 1 0 0", files={"b.mtl": blue.format("red")}),
    )
    named(
        "several libraries",
        "OBJ",
        obj("mtllib a.mtl\nmtllib my b.mtl\nusemtl red", "newmtl x\nKd 1 0 0", files={"my b.mtl": blue.format("red")}),
    )
    named(
        "several libraries",
        "OBJ",
        obj("mtllib my b.mtl c d.mtl\nusemtl red", files={"my b.mtl": "", "c d.mtl": blue.format("red")}),
    )
    named("all line endings", "OBJ", obj(USE, blue.format("red"), end="\r\n"))
    named("all line endings", "OBJ", obj(USE, blue.format("red"), end="\r"))
    named("all line endings", "OBJ", obj("mtllib a.mtl\nusemtl \\\nred", "newmtl red\nKd 0 \\\n0 1"))
    named("all line endings", "PLY", ply("uchar", 255, end=b"\r\n"), SHOWN)
    named("all line endings", "PLY", ply("uchar", 255, end=b"\r"), SHOWN)
    named("bytes that are not UTF-8", "OBJ", obj(USE, b"# caf\xe9 \x85\nnewmtl red\nKd 0 0 1\n"))
    named("bytes that are not UTF-8", "OBJ", _utf16)
    named("bytes that are not UTF-8", "PLY", ply("uchar", 255, comment=b"caf\xe9 \x85 Stra\xdfe"), SHOWN)
    named(
        "triangles and quads in one binary file",
        "PLY",
        ply("uchar", 255, polygons=((0, 1, 2), (0, 2, 3), (0, 1, 2, 3))),
        SHOWN,
        area=4.0,
        faces=4,
    )
    named(
        "triangles and quads in one binary file",
        "PLY",
        ply("uchar", 255, polygons=((0, 1, 2, 3), (0, 1, 2)), form="binary_big_endian"),
        SHOWN,
        area=3.0,
        faces=3,
    )
    named(
        "corners with invalid indices of texture coordinates",
        "OBJ",
        obj("f 1/7/7 2/8/8 3/9/9"),
        GREY,
        warned=("3 corners",),
        area=3.0,
        faces=3,
    )
    named("rows with additional values", "PLY", _wedges, SHOWN)
    named("chunks without padding", "glTF", _unpadded, HALF)
    named("missing material library", "OBJ", obj("mtllib gone.mtl\nusemtl red"), GREY, warned=("gone.mtl", "missing"))
    return found


def _factor(
    factor: list[float] | None, gloss: dict[str, Any] | None = None, mode: str = "OPAQUE"
) -> Callable[[Path], None]:
    def build(glb: Glb) -> None:
        material: dict[str, Any] = {
            "alphaMode": mode,
            "pbrMetallicRoughness": {"baseColorFactor": factor or [1, 0, 0, 1]},
        }
        if gloss:
            material["extensions"] = {"KHR_materials_pbrSpecularGlossiness": gloss}
        glb.document["materials"] = [material]
        glb.mesh({**glb.plate(), "material": 0})

    return gltf(build)


def _utf16(path: Path) -> None:
    """Write an OBJ file in UTF-16 with its mark."""
    obj(USE, "newmtl red\nKd 0 0 1\n")(path)
    path.write_bytes(path.read_text().encode("utf-16"))


def _wedges(path: Path) -> None:
    """Write a PLY file as MeshLab does: colours of corners as a list, and a header that says three numbers."""
    ply("uchar", 255, form="ascii")(path)
    text = path.read_text().replace(
        "vertex_indices\n", "vertex_indices\n" + "".join(f"property uchar {c}\n" for c in ("red", "green", "blue"))
    )
    head, _, body = text.partition("end_header\n")
    rows = [f"{line} 9 1 1 1 1 1 1 1 1 1" if line.startswith("3 ") else line for line in body.splitlines()]
    path.write_text(head + "end_header\n" + "\n".join(rows) + "\n")


def _unpadded(path: Path) -> None:
    """Write a GLB file whose JSON has an odd length, and the next chunk right behind it."""
    _factor([0.5, 0.5, 0.5, 1])(path)
    data = path.read_bytes()
    size = struct.unpack_from("<I", data, 12)[0]
    text = data[20 : 20 + size].rstrip() + b" "
    text += b" " * (len(text) % 2 == 0)
    rest = data[20 + size :]
    path.write_bytes(
        struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A) + text + rest
    )


def _beside(write: Callable[[Path], None], name: str) -> Callable[[Path], None]:
    """Return a writer that puts an image beside the file."""

    def both(path: Path) -> None:
        write(path)
        image(path.parent / name)

    return both


FEATURES = _features()


def table(features: list[Feature]) -> str:
    """Return the lists of docs/own_scan.md: a row for each feature that a reader warns of or refuses; the others by format."""
    columns, small = ("glTF", "OBJ", "PLY", "USD"), ("STL", "OFF")
    rows, others = [f"| | {' | '.join(columns)} |", "|---|" + "---|" * len(columns)], []
    apart: dict[str, list[str]] = {}
    for group in (COLORS, TEXTURES, GEOMETRY, STAGES, NAMES):
        read: dict[str, list[str]] = {}
        for name in dict.fromkeys(each.name for each in features if each.group == group):
            mine = [each for each in features if (each.group, each.name) == (group, name)]
            cells = {
                format: dict.fromkeys(each.status for each in mine if each.format == format)
                for format in (*columns, *small)
            }
            if any(set(cells[format]) - {"read"} for format in columns):
                rows.append(f"| {name} | " + " | ".join(", ".join(cells[format]) for format in columns) + " |")
                continue
            for format in small:
                for status in set(cells[format]) - {"read"}:
                    apart.setdefault(f"{format}, {status}", []).append(name)
            holders = [format for format, cell in cells.items() if set(cell) == {"read"}]
            if holders:
                read.setdefault(", ".join(holders), []).append(name)
        others += ["", f"Read, {group}:", "", *(f"- {holders}: {'; '.join(names)}" for holders, names in read.items())]
    rows += ["", ". ".join(f"{what}: {'; '.join(names)}" for what, names in apart.items()) + "."]
    return "\n".join([*rows, *others]) + "\n"
