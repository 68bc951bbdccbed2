"""Files that are whole and common, and seldom thought of: for each what reading it has to give."""

from __future__ import annotations

import base64
import io
import json
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import quote

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
    PAINTED,
    RED,
    RIGHT,
    SHOWN,
    SQUARE,
    STAGES,
    TEXTURES,
    TWO,
    USE,
    WHITE,
    Feature,
    Glb,
    gltf,
    gltf_color,
    gltf_texture,
    image,
    obj,
    ply,
    rows,
    usd,
    usd_material,
    usd_mesh,
    usd_textured,
)
from PIL import Image

UP, DOWN = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
Write = Callable[[Path], None]


def picture(mode: str, kind: str = "PNG", level: Any = None) -> bytes:
    """Return an image of one colour, blue where its mode has any."""
    file = io.BytesIO()
    if mode == "I;16":
        Image.fromarray(np.full((8, 8), level, np.uint16)).save(file, kind)
    elif mode == "P":
        Image.new("RGB", (8, 8), BLUE).quantize(4).save(file, kind)
    else:
        Image.new(mode, (8, 8), level).save(file, kind, **({"quality": 100} if kind == "JPEG" else {}))
    return file.getvalue()


def deep_png() -> bytes:
    """Return a PNG file of 16 bits a channel, all texels 0, 0, 65535."""
    import zlib

    row = b"\0" + struct.pack(">3H", 0, 0, 65535) * 4

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", 4, 4, 16, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(row * 4)) + chunk(b"IEND", b"")


def turned_jpeg() -> bytes:
    """Return a photo whose EXIF says that it is turned upside down, which glTF and USD do not heed."""
    photo = Image.open(io.BytesIO(image()))
    exif = Image.Exif()
    exif[0x0112] = 3
    file = io.BytesIO()
    photo.save(file, "JPEG", quality=100, subsampling=0, exif=exif)
    return file.getvalue()


def data_uri(escape: Callable[[str], str]) -> Write:
    """Return a writer of a glTF file that holds its buffer and its image in itself, escaped."""

    def write(path: Path) -> None:
        gltf_texture(RIGHT)(path)
        data = path.read_bytes()
        size = struct.unpack_from("<I", data, 12)[0]
        document, chunk = json.loads(data[20 : 20 + size]), data[28 + size :]
        view = document["bufferViews"][document["images"][0].pop("bufferView")]
        start = view.get("byteOffset", 0)
        del document["images"][0]["mimeType"]
        paint = base64.b64encode(chunk[start : start + view["byteLength"]]).decode()
        document["images"][0]["uri"] = "data:image/png;base64," + escape(paint)
        whole = base64.b64encode(chunk).decode()
        document["buffers"][0]["uri"] = "data:application/octet-stream;base64," + escape(whole)
        path.write_text(json.dumps(document))

    return write


def _one_colored(glb: Glb) -> None:
    """Put two primitives into one mesh: one has colours of vertices, the other a material."""
    glb.document["materials"] = [{"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 1, 1]}}]
    colored = glb.plate(COLOR_0=glb.accessor(np.tile(LIGHT, (4, 1))))
    plain = {**glb.plate(SQUARE + [5, 0, 0]), "material": 0}
    glb.document["meshes"].append({"primitives": [colored, plain]})
    glb.document["nodes"].append({"mesh": 0})
    glb.document["scenes"][0]["nodes"].append(0)


def _interleaved(glb: Glb) -> None:
    """Put positions, colours and a gap into one buffer view, as most exporters do."""
    colors = np.tile(LIGHT[:3], (4, 1))
    data = np.concatenate([SQUARE, np.full((4, 2), 9.0), colors], axis=1).astype("<f4").tobytes()
    index = glb.accessor(TWO.ravel(), "u2")
    view = glb.view(data, byteStride=32)
    kind = {"bufferView": view, "componentType": 5126, "count": 4, "type": "VEC3"}
    glb.document["accessors"] += [{**kind}, {**kind, "byteOffset": 20}]
    glb.mesh({"attributes": {"POSITION": index + 1, "COLOR_0": index + 2}, "indices": index})


def _unlit(glb: Glb) -> None:
    glb.document["materials"] = [
        {"extensions": {"KHR_materials_unlit": {}}, "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1]}}
    ]
    glb.mesh({**glb.plate(), "material": 0})
    glb.require("KHR_materials_unlit")


def _emissive(strength: float | None) -> Write:
    def build(glb: Glb) -> None:
        material: dict[str, Any] = {
            "emissiveFactor": [0.5, 0.2, 0.1],
            "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]},
        }
        if strength is not None:
            material["emissiveFactor"] = [0.25, 0.1, 0.05]
            material["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
        glb.document["materials"] = [material]
        glb.mesh({**glb.plate(), "material": 0})

    return gltf(build)


def _mirrored(glb: Glb) -> None:
    glb.mesh(glb.plate(), scale=[-1, 1, 1])


def _twice_mirrored(glb: Glb) -> None:
    glb.mesh(glb.plate(), matrix=[-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 3, 4, 5, 1])


def _sheared(glb: Glb) -> None:
    glb.mesh(glb.plate(), matrix=[1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])


def _without_indices(glb: Glb) -> None:
    points = SQUARE[[0, 1, 2, 0, 2, 3]]
    glb.mesh({"attributes": {"POSITION": glb.accessor(points)}})


def _no_scenes(glb: Glb) -> None:
    glb.mesh(glb.plate())
    glb.document["nodes"] = [{"children": [1], "scale": [2, 2, 2]}, {"mesh": 0}]
    del glb.document["scene"]
    glb.document["scenes"] = []


def _shared(glb: Glb) -> None:
    glb.mesh(glb.plate())
    glb.document["nodes"].append({"mesh": 0, "translation": [0, 5, 0], "scale": [1, 1, -1]})
    glb.document["scenes"][0]["nodes"].append(1)


def _quantized_morph(glb: Glb) -> None:
    target = glb.accessor(np.where(SQUARE == 2, 127, 0) * [1, 0, 0], "i1", normalized=True)
    glb.mesh({**glb.plate(), "targets": [{"NORMAL": 0}, {"POSITION": target}]}, {"weights": [9, 1]}, weights=[9, 2])
    glb.require("KHR_mesh_quantization")


def _fallback(glb: Glb) -> None:
    primitive = glb.plate()
    glb.mesh({**primitive, "extensions": {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {}}}})
    glb.require("KHR_draco_mesh_compression", only_used=True)


def chunks(fill: bytes, more: bytes = b"") -> Write:
    """Return a writer of a GLB file with its JSON padded by a byte, and chunks of others behind."""

    def write(path: Path) -> None:
        gltf_color(LIGHT[:3], "f4")(path)
        data = path.read_bytes()
        size = struct.unpack_from("<I", data, 12)[0]
        text, rest = data[20 : 20 + size].rstrip(), data[20 + size :]
        text += fill * (8 - len(text) % 4)
        parts = struct.pack("<II", len(text), 0x4E4F534A) + text + rest + more
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(parts)) + parts)

    return write


def separate(name: str, uri: str) -> Write:
    """Return a writer of a glTF file whose buffer is a file beside it."""

    def write(path: Path) -> None:
        gltf_color(LIGHT[:3], "f4")(path)
        data = path.read_bytes()
        size = struct.unpack_from("<I", data, 12)[0]
        document = json.loads(data[20 : 20 + size])
        document["buffers"][0]["uri"] = uri
        (path.parent / name).write_bytes(data[28 + size :])
        path.write_bytes(b"\xef\xbb\xbf" + json.dumps(document).encode())

    return write


def text(content: str, files: dict[str, bytes] | None = None) -> Write:
    """Return a writer of a file of text, and of others beside it."""

    def write(path: Path) -> None:
        path.write_text(content)
        for name, data in (files or {}).items():
            (path.parent / name).write_bytes(data)

    return write


def ascii_ply(vertex: str, face: str, vertices: list[str], faces: list[str], *more: str) -> Write:
    """Return a writer of a PLY file of text from its properties and rows; `more` are elements that come first."""
    head = ["ply", "format ascii 1.0", *(line for line in more if line.startswith(("element", "property")))]
    head += [f"element vertex {len(vertices)}", *(f"property {each}" for each in vertex.split(", "))]
    head += [f"element face {len(faces)}", *(f"property {each}" for each in face.split(", ")), "end_header"]
    first = [line for line in more if not line.startswith(("element", "property"))]
    return text("\n".join([*head, *first, *vertices, *faces, ""]))


PLATE = [" ".join(f"{x:g}" for x in point) for point in SQUARE]
"""The corners of the plate as text."""
XYZ, LIST = "float x, float y, float z", "list uchar int vertex_indices"


def package(write: Write, *names: str) -> Write:
    """Return a writer of a USDZ file from a stage and images beside it: stored, at multiples of 64 bytes."""

    def zipped(path: Path) -> None:
        layer = path.parent / "layer.usda"
        write(layer)
        with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as file:
            for name in ("layer.usda", *names):
                entry = zipfile.ZipInfo(name)
                place = file.fp.tell() + 30 + len(name.encode())  # type: ignore[union-attr]
                entry.extra = struct.pack("<HH", 0x1986, (-place - 4) % 64) + bytes((-place - 4) % 64)
                file.writestr(entry, (path.parent / (name if name == "layer.usda" else "paint.png")).read_bytes())
        (path.parent / "paint.png").unlink()

    return zipped


def _vertex(values: Any, interpolation: str = "vertex", kind: str = "color3f", name: str = "displayColor") -> str:
    return f'{kind}[] primvars:{name} = {rows(values)} (\n interpolation = "{interpolation}"\n)'


def _variants() -> list[Feature]:
    """Return all files."""
    features: list[Feature] = []

    def add(group: str, name: str, format: str, write: Write, ending: str | None = None, **expected: Any) -> None:
        ending = ending or {"glTF": ".glb", "OBJ": ".obj", "PLY": ".ply", "USD": ".usda"}[format]
        features.append(Feature(group, name, format, ending, write, **expected))

    def color(name: str, format: str, write: Write, *colors: tuple[int, int, int], **more: Any) -> None:
        add(COLORS, name, format, write, colors=colors, **more)

    def texture(name: str, format: str, write: Write, *colors: tuple[int, int, int], **more: Any) -> None:
        add(TEXTURES, name, format, write, colors=colors or (BLUE,), **more)

    two = {"area": 4.0, "faces": 4}
    color("some parts have none", "glTF", gltf(_one_colored), DISPLAY, BLUE, **two)
    red = "\n".join(
        ["v 0 0 0 1 0 0", "v 2 0 0 1 0 0", "v 2 1 0 1 0 0", "v 0 1 0 1 0 0", "v 0 5 0", "v 2 5 0", "v 2 6 0"]
    )
    body = f"{red}\nf 1 2 3\nf 1 3 4\nusemtl b\nf 5 6 7\n"
    library = {"b.mtl": b"newmtl b\nKd 0 0 1\n"}
    color("some parts have none", "OBJ", text("mtllib b.mtl\n" + body, library), RED, BLUE, area=3.0, faces=3)
    color("interleaved arrays", "glTF", gltf(_interleaved), DISPLAY)
    color("material, unlit", "glTF", gltf(_unlit), HALF)
    color("emission of a black surface", "glTF", _emissive(None), DISPLAY)
    color("emission of a black surface", "glTF", _emissive(2.0), DISPLAY)
    color("values slightly above 1", "OBJ", obj(colors=np.array([1.0004, 0, 0])), RED)
    over = [f"{row} 1.0004 0 0" for row in PLATE]
    color(
        "values slightly above 1",
        "PLY",
        ascii_ply(f"{XYZ}, float red, float green, float blue", LIST, over, ["3 0 1 2", "3 0 2 3"]),
        RED,
    )
    color("values slightly above 1", "glTF", gltf_color([1.5, 0, 0], "f4"), RED)
    levels = [f"{row} 127.6 51.3 25.7" for row in PLATE]
    color(
        "vertices, floats",
        "PLY",
        ascii_ply(f"{XYZ}, float red, float green, float blue", LIST, levels, ["3 0 1 2", "3 0 2 3"]),
        SHOWN,
    )
    color("vertices, floats", "OBJ", obj(colors=np.array([127.6, 51.3, 25.7])), SHOWN)
    shades = [f"{row} 128 51 26 0" for row in PLATE]
    names = f"{XYZ}, uchar diffuse_red, uchar diffuse_green, uchar diffuse_blue, uchar alpha"
    color("vertices with alpha", "PLY", ascii_ply(names, LIST, shades, ["3 0 1 2", "3 0 2 3"]), SHOWN)
    color("vertices with alpha", "OBJ", obj(colors=np.array([128, 51, 26, 255]) / 255), SHOWN)
    color("vertices with alpha", "glTF", gltf_color([0.5, 0.2, 0.1, 0.0], "f4"), DISPLAY)
    varying = (
        _vertex([(1, 0, 0), LIGHT[:3]], "faceVarying") + "\nint[] primvars:displayColor:indices = [1, 1, 1, 1, 1, 1]"
    )
    color("indexed primvars", "USD", usd(usd_mesh(more=varying)), DISPLAY)
    uniform = _vertex([(1, 0, 0), LIGHT[:3]], "uniform") + "\nint[] primvars:displayColor:indices = [1, 1]"
    color("indexed primvars", "USD", usd(usd_mesh(more=uniform)), DISPLAY)
    color("faces", "USD", usd(usd_mesh(more=_vertex([LIGHT[:3]], "constant"))), DISPLAY)
    color("faces", "USD", usd(usd_mesh(more=_vertex([LIGHT[:3]] * 4, "varying"))), DISPLAY)
    few = _vertex([LIGHT[:3]] * 3, "vertex")
    color("too few colour values", "USD", usd(usd_mesh(more=few)), GREY, warned=("displayColor", "3 values"))
    half = _vertex([LIGHT] * 4, "vertex", "half4", "shade").replace("half4[]", "color4h[]")
    reader = """def Shader "reader"
  {
    uniform token info:id = "UsdPrimvarReader_float4"
    string inputs:varname = "shade"
    float4 outputs:result
  }"""
    slot = "color3f inputs:diffuseColor.connect = </R/paint/reader.outputs:result>"
    color(
        "material that reads a primvar",
        "USD",
        usd(usd_mesh(more=f"{half}\n{PAINTED}", api=True) + usd_material(slot, reader)),
        DISPLAY,
    )
    strong = 'rel material:binding = </R/paint> (\n bindMaterialAs = "strongerThanDescendants"\n)'
    other = 'def Material "own"\n{\n}\n'
    inside = usd_mesh(more="rel material:binding = </R/own>", api=True)
    above = f'def Xform "above" (prepend apiSchemas = ["MaterialBindingAPI"])\n{{\n{strong}\n{inside}\n}}\n{other}'
    gray = usd_material("color3f inputs:diffuseColor = (0.5, 0.5, 0.5)")
    color("inherited from a parent prim", "USD", usd(above + gray), HALF)
    collection = """def Xform "all" (prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:walls"])
{{
  uniform token collection:walls:expansionRule = "expandPrims"
  rel collection:walls:includes = </R/all/plate>
  rel material:binding:collection:walls = [</R/all.collection:walls>, </R/paint>]
  {}
}}
"""
    color("bound by a collection", "USD", usd(collection.format(usd_mesh()) + gray), HALF)
    color("material without a colour", "OBJ", obj(USE, "newmtl red\nKs 1 0 0"), GREY, warned=("red", "no colour"))
    color("transparency", "OBJ", obj(USE, "newmtl red\nKd 0.5 0.2 0.1\nmap_d paint.png"), SHOWN, warned=("opaque",))
    clear = _vertex([LIGHT[:3]]).replace('"vertex"', '"constant"') + "\nfloat[] primvars:displayOpacity = [0.2]"
    color("transparency", "USD", usd(usd_mesh(more=clear)), DISPLAY, warned=("opaque",))

    masked = {"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    texture("alpha cutout", "glTF", gltf_texture(RIGHT, material=masked), warned=("2 faces", "opaque"))
    alpha = "float inputs:opacity.connect = </R/paint/image.outputs:a>\n    color3f inputs:diffuseColor.connect"
    cut = usd_textured("float outputs:a").replace("color3f inputs:diffuseColor.connect", alpha)
    holes = io.BytesIO()
    Image.new("RGBA", (8, 8), (0, 0, 255, 0)).save(holes, "PNG")
    texture("alpha cutout", "USD", _painted(usd(cut), holes.getvalue()), warned=("/R/paint", "opaque"))
    texture("alpha cutout", "USD", usd(cut))  # an image without alpha has no holes
    kinds = {
        "PNG of 16 bits": (deep_png(), BLUE),
        "grey PNG of 16 bits": (picture("I;16", level=128 * 257), (128, 128, 128)),
        "PNG with a palette": (picture("P"), BLUE),
        "grey JPEG": (picture("L", "JPEG", 128), (128, 128, 128)),
        "CMYK JPEG": (picture("CMYK", "JPEG", (255, 255, 0, 0)), BLUE),
        "black and white PNG": (picture("1", level=1), WHITE),
    }
    for name, (data, expected) in kinds.items():
        texture(name, "glTF", gltf_texture(RIGHT, data=data), expected)
        texture(name, "USD", _painted(usd(usd_textured()), data), expected)
        texture(name, "OBJ", obj(USE, "newmtl red\nmap_Kd my.img", uv=RIGHT, files={"my.img": data}), expected)
    texture("JPEG with EXIF data", "glTF", gltf_texture(RIGHT, data=turned_jpeg()), (0, 0, 254))
    texture("image of a single pixel", "glTF", gltf_texture((7.3, -2.1), data=_texel()), BLUE)
    texture("clamped, mirrored", "glTF", gltf_texture((-0.3, 0.5), sampler={"wrapS": 33648, "wrapT": 33071}), RED)
    texture("clamped, mirrored", "glTF", gltf_texture((-0.3, 0.5), sampler={"magFilter": 9728}))
    texture("coordinates far outside [0, 1]", "glTF", gltf_texture((1000.75, -999.5)))
    texture("coordinates far outside [0, 1]", "OBJ", obj(USE, "newmtl red\nmap_Kd paint.png", uv=(-999.25, 77.5)))
    texture("coordinates far outside [0, 1]", "USD", usd(usd_textured(st=(1000.75, -999.5))))
    texture(
        "coordinates that are not finite",
        "OBJ",
        obj(USE, "newmtl red\nmap_Kd paint.png", uv=(np.inf, 0.5)),
        WHITE,
        warned=("2 faces", "white"),
    )
    texture("coordinates that are not finite", "glTF", gltf_texture((np.inf, 0.5)), WHITE, warned=("2 faces",))
    texture("coordinates that are not finite", "USD", usd(usd_textured(st=(np.inf, 0.5))), WHITE, warned=("2 faces",))
    texture("images in URIs", "glTF", data_uri(str), ending=".gltf")
    texture("images in URIs", "glTF", data_uri(lambda data: quote(data, safe="")), ending=".gltf")
    texture("images in URIs", "glTF", data_uri(lambda data: data.replace("+", "-").replace("/", "_")), ending=".gltf")
    texture("images in URIs", "glTF", data_uri(lambda data: data.rstrip("=")), ending=".gltf")
    texture("several images", "USD", package(usd(_two_textured()), "a.png", "b.png"), ending=".usdz", **two)
    texture("image", "USD", usd(usd_textured(primvar="map1").replace("texCoord2f[]", "float2[]")))
    texture(
        "raw colour space",
        "USD",
        _painted(usd(usd_textured('token inputs:sourceColorSpace = "raw"')), picture("RGB", level=(128, 128, 128))),
        HALF,
    )
    texture(
        "base colour factor in place of a missing image",
        "glTF",
        gltf_texture(uri="gone.png"),
        GREY,
        warned=("gone.png",),
    )

    facing = {"facing": DOWN}
    add(GEOMETRY, "mirrored nodes", "glTF", gltf(_mirrored), facing=UP)
    add(GEOMETRY, "mirrored nodes", "glTF", gltf(_twice_mirrored), facing=UP)
    add(GEOMETRY, "mirrored nodes", "glTF", gltf(_shared), area=4.0, faces=4, facing=None)
    mirror = 'float3 xformOp:scale = (-1, 1, 1)\nuniform token[] xformOpOrder = ["xformOp:scale"]'
    add(GEOMETRY, "mirrored nodes", "USD", usd(usd_mesh(more=mirror)), facing=UP)
    left = 'uniform token orientation = "leftHanded"'
    add(GEOMETRY, "left-handed faces", "USD", usd(usd_mesh(more=left)), **facing)
    add(GEOMETRY, "left-handed faces", "USD", usd(usd_mesh(more=f"{left}\n{mirror}")), **facing)
    add(GEOMETRY, "sheared nodes", "glTF", gltf(_sheared), facing=UP)
    add(GEOMETRY, "faces without indices", "glTF", gltf(_without_indices), facing=UP)
    add(GEOMETRY, "files without a scene", "glTF", gltf(_no_scenes), area=8.0, facing=UP)
    add(GEOMETRY, "morph weights", "glTF", gltf(_quantized_morph), area=4.0)
    add(GEOMETRY, "compressed", "glTF", gltf(_fallback))
    lines = "\n".join(f"v {row}" for row in PLATE)
    add(GEOMETRY, "indices from the end", "OBJ", text(f"{lines}\nf -4 -3 -2\nf -4//-1 -2// -1/\n"), facing=UP)
    far = f"v 9 9 9\nv 9 9 9\n{lines}\nf -4 -3 -2 -1\nv 7 7 7\n"
    add(GEOMETRY, "indices from the end", "OBJ", text(far), facing=UP)
    add(GEOMETRY, "faces listed before their vertices", "OBJ", text(f"f 1 2 3\nf 1 3 4\n{lines}\n"), facing=UP)
    add(GEOMETRY, "continued lines", "OBJ", text(f"{lines}\nf 1 \\\n2 3\\\n 4 # end\n"), facing=UP)
    add(
        GEOMETRY,
        "all notations of numbers",
        "OBJ",
        text("v +0 -0 0.\r\nv\t2e0  0 0\r\nv 2. 1.E0 0 1.0\r\nv 0 1 .0\r\nf 1/ 2// 3 4\r\n"),
        facing=UP,
    )
    order = ascii_ply(
        "list uchar float weights, float nx, double x, float64 y, float z",
        f"list uint8 int8 flags, {LIST}",
        [f"{i} {'9 ' * i}7 {row}" for i, row in enumerate(PLATE)],
        ["1 5 3 0 1 2", "0 3 0 2 3"],
    )
    add(GEOMETRY, "list properties before coordinates", "PLY", order, facing=UP)
    camera = ("element camera 1", "property float view_px", "property list uchar float k", "1 2 8 9")
    add(
        GEOMETRY,
        "elements before vertices",
        "PLY",
        ascii_ply(XYZ, "list uchar uint vertex_index", PLATE, ["3 0 1 2", "3 0 2 3"], *camera),
        facing=UP,
    )
    add(GEOMETRY, "faces listed before their vertices", "PLY", _faces_first, facing=UP)
    add(GEOMETRY, "double coordinates", "PLY", ply(coordinate="double", form="binary_big_endian"), facing=UP)
    add(
        GEOMETRY,
        "polygons that repeat a corner",
        "OBJ",
        obj(polygons=[(1, 2, 2, 3), (1, 3, 4, 1)]),
        faces=None,
        area=2.0,
    )

    inner = usd_mesh()
    stored = {"other.usda": f'#usda 1.0\n(\n defaultPrim = "P"\n)\ndef Xform "P"\n{{\n{inner}\n}}\n'}
    for name, arc in (("references", "references = @other.usda@"), ("payloads", "payload = @other.usda@")):
        add(STAGES, name, "USD", _files(usd(f'def Xform "a" (\n prepend {arc}\n)\n{{\n}}\n'), stored), facing=UP)
    switch = f"""def Xform "room" (
  variants = {{
    string look = "full"
  }}
  prepend variantSets = "look"
)
{{
  variantSet "look" = {{
    "empty" {{
    }}
    "full" {{
      {inner}
    }}
  }}
}}
"""
    add(STAGES, "variants", "USD", usd(switch), facing=UP)
    add(
        STAGES,
        "sublayers",
        "USD",
        _files(usd("", "subLayers = [@other.usda@]"), {"other.usda": f'#usda 1.0\ndef Xform "R"\n{{\n{inner}\n}}\n'}),
        facing=UP,
    )
    idle = (
        usd_mesh() + usd_mesh("off").replace('"off"', '"off" (active = false)') + usd_mesh("o").replace("def", "over")
    )
    add(STAGES, "inactive prims and overrides", "USD", usd(idle), facing=UP)
    pivot = """double3 xformOp:translate = (5, 0, 0)
float3 xformOp:translate:pivot = (1, 1, 0)
float xformOp:rotateZ = 90
uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:translate:pivot", "xformOp:rotateZ", """
    pivot += '"!invert!xformOp:translate:pivot"]'
    add(STAGES, "pivots", "USD", usd(usd_mesh(more=pivot)), facing=UP)
    twice = f"""def Xform "source"
{{
  {usd_mesh(more="float3 xformOp:scale = (-2, 1, 1)" + chr(10) + 'uniform token[] xformOpOrder = ["xformOp:scale"]')}
}}
def Xform "copy" (
 instanceable = true
 prepend references = </R/source>
)
{{
  double3 xformOp:translate = (0, 0, 5)
  uniform token[] xformOpOrder = ["xformOp:translate"]
  color3f[] primvars:displayColor = [(0, 0, 1)]
}}
"""
    add(STAGES, "instanceable prims", "USD", usd(twice), area=8.0, faces=4, facing=UP, colors=(GREY, BLUE))

    add(NAMES, "padding by zeros", "glTF", chunks(b"\0"), colors=(DISPLAY,))
    add(NAMES, "unknown chunks", "glTF", chunks(b" ", struct.pack("<II", 4, 0x58585858) + b"abcd"), colors=(DISPLAY,))
    add(
        NAMES,
        "arrays in a separate file",
        "glTF",
        separate("my data (1).bin", "my%20data%20(1).bin"),
        ".gltf",
        colors=(DISPLAY,),
    )
    add(NAMES, "arrays in a separate file", "glTF", separate("büro.bin", "b%C3%BCro.bin"), ".gltf", colors=(DISPLAY,))
    blue = "newmtl red\nKd 0 0 1\n"
    add(
        NAMES,
        "material used before its library is named",
        "OBJ",
        text(f"usemtl red\n{lines}\nf 1 2 3 4\nmtllib late.mtl\n", {"late.mtl": blue.encode()}),
        colors=(BLUE,),
    )
    add(
        NAMES,
        "tabs and capitals",
        "OBJ",
        obj("mtllib\ta.MTL \nusemtl\t red\t", "\tnewmtl red \n\tKd\t0  0 1 # blue\n"),
        colors=(BLUE,),
    )
    add(NAMES, "all line endings", "PLY", ply("uchar", 255, form="ascii", end=b"\r\n"), colors=(SHOWN,))
    add(NAMES, "blank lines", "PLY", _blank_lines, colors=(SHOWN,))
    return features


def _painted(write: Write, data: bytes) -> Write:
    """Return a writer that replaces the image paint.png."""

    def both(path: Path) -> None:
        write(path)
        (path.parent / "paint.png").write_bytes(data)

    return both


def _files(write: Write, files: dict[str, str]) -> Write:
    def both(path: Path) -> None:
        write(path)
        for name, content in files.items():
            (path.parent / name).write_text(content)

    return both


def _texel() -> bytes:
    file = io.BytesIO()
    Image.new("RGB", (1, 1), BLUE).save(file, "PNG")
    return file.getvalue()


def _two_textured() -> str:
    first, second = usd_textured(file="a.png"), usd_textured(file="b.png", st=LEFT)
    second = second.replace("/R/paint", "/R/other").replace('"paint"', '"other"').replace('"plate"', '"second"')
    return first + second.replace(rows([LEFT] * 4), rows([RIGHT] * 4))


def _faces_first(path: Path) -> None:
    head = f"ply\nformat ascii 1.0\nelement face 2\nproperty {LIST}\nelement vertex 4\n"
    head += "".join(f"property {each}\n" for each in XYZ.split(", ")) + "end_header\n"
    path.write_text(head + "\n".join(["3 0 1 2", "3 0 2 3", *PLATE, ""]))


def _blank_lines(path: Path) -> None:
    ply("uchar", 255, form="ascii")(path)
    head, _, body = path.read_text().partition("end_header\n")
    path.write_text(
        head + "end_header\n" + "\n".join(f"{line}  " for line in body.splitlines()).replace("\n", "\n\n") + "\n\n\n"
    )


VARIANTS = _variants()
