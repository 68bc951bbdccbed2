"""A glTF 2.0 or GLB file: its JSON and buffers, accessors of every kind, and the colours of its primitives."""

import base64
import json
import math
import struct
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import unquote_to_bytes

import numpy as np

from s2a.core.errors import InputError
from s2a.scan.source import CLAMP, MIRROR, PLAIN, REPEAT, Material, beside, decode

COMPONENTS = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4", 5130: "f8"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
FLOAT, UNSIGNED_SHORT, UNSIGNED_INT = 5126, 5123, 5125
_JSON, _BINARY = 0x4E4F534A, 0x004E4942
_COMPRESSED = {"KHR_draco_mesh_compression": "Draco"}
_COMPRESSED |= dict.fromkeys(("EXT_meshopt_compression", "KHR_meshopt_compression"), "meshopt")
_DECOMPRESS = "npx @gltf-transform/cli copy IN.glb OUT.glb decompresses it"
_MOST = 500_000_000  # numbers in an accessor


class GltfFile:
    """A file whose arrays are read when they are needed.

    Attributes:
        path: of the file.
        document: its JSON.
    """

    def __init__(self, path: Path) -> None:
        """Read JSON and binary chunk; InputError: truncated, no glTF, or another version of it."""
        self.path = path
        data = path.read_bytes()
        text, self._chunk = _chunks(path, data) if data[:4] == b"glTF" or path.suffix.lower() == ".glb" else (data, b"")
        try:
            # Some writers pad with zeros, where the format wants spaces.
            self.document: dict[str, Any] = json.loads(text.rstrip(b"\0").decode("utf-8-sig"))
            version = str(self.document["asset"]["version"])
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise InputError(f"{path}: truncated or no glTF ({error!r}); copy or export it again") from error
        if not version.startswith("2."):
            raise InputError(f"{path}: is glTF {version}; 2.0 is possible: export it again")
        self._buffers: dict[int, bytes] = {}

    def items(self, name: str) -> list[Any]:
        """Return a list of the document's top level; empty where it has none."""
        items = self.document.get(name, [])
        return items if isinstance(items, list) else []

    def refuse_compressed(self, names: list[str]) -> None:
        """Raise an InputError for the first name that stands for a compression."""
        for name in names:
            if name in _COMPRESSED:
                raise InputError(
                    f"{self.path}: is compressed with {_COMPRESSED[name]} ({name}); export it without, or {_DECOMPRESS}"
                )

    def array(self, index: int) -> np.ndarray:
        """Return an accessor's numbers, shape [count width]: float64, normalised integers as 0 to 1 or -1 to 1."""
        accessor = self.items("accessors")[index]
        kind = np.dtype("<" + COMPONENTS[accessor["componentType"]])
        width, count = WIDTHS[accessor["type"]], int(accessor["count"])
        if not 0 <= count * width <= _MOST:
            raise ValueError(f"accessor {index} has {count} elements")
        if "bufferView" in accessor:
            values = self._strided(accessor["bufferView"], accessor.get("byteOffset", 0), kind, count, width)
        else:
            values = np.zeros((count, width), kind)
        if sparse := accessor.get("sparse"):
            values = self._replaced(values, sparse)
        if accessor.get("normalized") and kind.kind in "iu":
            return np.maximum(values.astype(np.float64) / np.iinfo(kind).max, -1.0)
        return values.astype(np.float64) if kind.kind == "f" else values

    def view(self, index: int) -> bytes:
        """Return the bytes of a buffer view."""
        view = self.items("bufferViews")[index]
        if not ("uri" in self.items("buffers")[view["buffer"]] or (view["buffer"] == 0 and self._chunk)):
            self.refuse_compressed(list(view.get("extensions", {})))
        buffer, start = self._buffer(view["buffer"]), int(view.get("byteOffset", 0))
        if not 0 <= start <= start + int(view["byteLength"]) <= len(buffer):
            raise ValueError(f"buffer view {index} ends beyond its buffer")
        return buffer[start : start + int(view["byteLength"])]

    def resource(self, uri: str) -> bytes | None:
        """Return what a URI holds: in itself, or in a file beside this one; None for a file that is missing."""
        if uri.startswith("data:"):
            head, _, data = uri.partition(",")
            plain = unquote_to_bytes(data)
            if not head.lower().endswith(";base64"):
                return plain
            letters = b"".join(plain.split()).rstrip(b"=").translate(bytes.maketrans(b"-_", b"+/"))
            return base64.b64decode(letters + b"=" * (-len(letters) % 4), validate=True)
        file = beside(self.path.parent, uri)
        return None if file is None else file.read_bytes()

    def _buffer(self, index: int) -> bytes:
        if index not in self._buffers:
            uri = self.items("buffers")[index].get("uri")
            data = self._chunk if uri is None else self.resource(str(uri))
            if data is None:
                raise InputError(f"{self.path}: {uri} is missing, which holds its arrays; copy it beside the file")
            self._buffers[index] = data
        return self._buffers[index]

    def _strided(self, view: int, offset: int, kind: np.dtype, count: int, width: int) -> np.ndarray:
        """Return numbers that stand in a buffer view with gaps between elements, shape [count width]."""
        stride = self.items("bufferViews")[view].get("byteStride") or width * kind.itemsize
        data = self.view(view)
        if count and not 0 <= offset <= offset + stride * (count - 1) + width * kind.itemsize <= len(data):
            raise ValueError(f"buffer view {view} is too short")
        return np.ndarray((count, width), kind, data, offset, (stride, kind.itemsize)).copy()

    def _replaced(self, values: np.ndarray, sparse: dict[str, Any]) -> np.ndarray:
        """Return an accessor's numbers with those that differ put in."""
        count, indices, news = int(sparse["count"]), sparse["indices"], sparse["values"]
        kind = np.dtype("<" + COMPONENTS[indices["componentType"]])
        where = self._strided(indices["bufferView"], indices.get("byteOffset", 0), kind, count, 1)[:, 0]
        values[where] = self._strided(
            news["bufferView"], news.get("byteOffset", 0), values.dtype, count, values.shape[1]
        )
        return values


def packed(document: dict[str, Any], arrays: Sequence[tuple[np.ndarray, dict[str, Any] | None]]) -> bytes:
    """Return a GLB file (glTF 2.0) from its JSON and the arrays of its buffer views, each with its accessor if it has one."""
    payload, views, accessors = b"", list[dict[str, Any]](), list[dict[str, Any]]()
    for number, (values, accessor) in enumerate(arrays):
        array = np.ascontiguousarray(values)  # as its bytes are written
        view = {"buffer": 0, "byteOffset": len(payload), "byteLength": array.nbytes}
        # A stride is possible only for what belongs to vertices.
        is_vertices = accessor is not None and accessor["type"] != "SCALAR"
        views.append(view | ({"byteStride": array.strides[0]} if is_vertices else {}))
        accessors += [{"bufferView": number, "count": len(array)} | accessor] if accessor else []
        payload += array.tobytes() + b"\0" * (-array.nbytes % 4)
    lists = {"buffers": [{"byteLength": len(payload)}], "bufferViews": views, "accessors": accessors}
    text = json.dumps({"asset": {"version": "2.0"}} | document | lists, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(payload), b"BIN\0") + payload
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _chunks(path: Path, data: bytes) -> tuple[bytes, bytes]:
    if data[:4] != b"glTF":
        raise InputError(f"{path}: is not a GLB file; export it again")
    try:
        version, length = struct.unpack_from("<II", data, 4)
        if version != 2:
            raise InputError(f"{path}: is GLB {version}; 2 is possible: export it again")
        if length > len(data):
            raise InputError(f"{path}: truncated, {len(data)} of {length} bytes; copy or download it again")
        chunks: dict[int, bytes] = {}
        at = 12
        while at + 8 <= length:
            size, kind = struct.unpack_from("<II", data, at)
            chunks.setdefault(kind, data[at + 8 : at + 8 + size])
            at += 8 + size
            # A chunk's length counts its padding; some writers leave the padding out, others do not count it.
            if at % 4 and struct.unpack_from("<4xI", data.ljust(at + 8, b"\0"), at)[0] not in (_JSON, _BINARY):
                at += -at % 4
        return chunks[_JSON], chunks.get(_BINARY, b"")
    except (struct.error, KeyError) as error:
        raise InputError(f"{path}: truncated or no GLB ({error}); copy or export it again") from error


TRANSFORM, GLOSS = "KHR_texture_transform", "KHR_materials_pbrSpecularGlossiness"
STRENGTH, GLASS = "KHR_materials_emissive_strength", "KHR_materials_transmission"
IMAGES = ("EXT_texture_webp", "EXT_texture_avif")  # Extensions of textures whose images Pillow decodes
READ = (TRANSFORM, GLOSS, *IMAGES)
WRAPS: dict[int | None, str] = {33071: CLAMP, 33648: MIRROR, 10497: REPEAT}


class GltfMaterials:
    """What a file's primitives look like.

    Attributes:
        lost: how many faces or textures lost what.
    """

    def __init__(self, file: GltfFile) -> None:
        self._file, self.lost = file, Counter[str]()
        self._materials: dict[int, tuple[Material, dict[str, Any]]] = {}
        self._images: dict[int, np.ndarray | None] = {}

    def of(
        self, primitive: dict[str, Any], faces: np.ndarray, count: int
    ) -> tuple[np.ndarray, np.ndarray, Material | None]:
        """Return texture coordinates [face 3 2], v upwards, linear colours [face 3 3], and the material of a primitive.

        `faces`: vertex indices, shape [face 3].
        """
        attributes = primitive["attributes"]
        inside = np.clip(faces, 0, count - 1)  # a damaged index is refused later, with its number
        colors = np.full((*faces.shape, 3), np.nan, dtype=np.float32)
        if "COLOR_0" in attributes:
            levels = self._fractions(attributes["COLOR_0"])
            if levels.shape[1] < 3:
                raise ValueError(f"colours of {levels.shape[1]} numbers")
            colors = np.clip(levels[:, :3], 0, 1).astype(np.float32)[inside]
        uv = np.full((*faces.shape, 2), np.nan)
        if "material" not in primitive:
            return uv, colors, None
        material, info = self._material(primitive["material"])
        record = self._file.items("materials")[primitive["material"]]
        glass = record.get("extensions", {}).get(GLASS, {}).get("transmissionFactor", 0)
        if record.get("alphaMode", "OPAQUE") != "OPAQUE" or glass:
            self.lost["faces are transparent or cut out by their texture, and become opaque"] += len(faces)
        if material.texture is None:
            return uv, colors, material
        transform = info.get("extensions", {}).get(TRANSFORM, {})
        name = f"TEXCOORD_{transform.get('texCoord', info.get('texCoord', 0))}"
        if name not in attributes:
            self.lost[f"faces have a texture and no {name}; they get the material's colour"] += len(faces)
            return uv, colors, material
        index = attributes[name]
        exact = "normalized" in self._file.items("accessors")[index]
        exact = exact or "KHR_mesh_quantization" in self._file.items("extensionsUsed")
        coordinates = self._file.array(index).astype(np.float64) if exact else self._fractions(index)
        coordinates[~np.isfinite(coordinates)] = np.nan
        uv = (_transformed(coordinates, transform) * [1, -1] + [0, 1])[inside]
        if gone := int(np.isnan(uv).any(axis=(1, 2)).sum()):
            self.lost["faces have coordinates that are not finite; they get the material's colour"] += gone
        return uv, colors, material

    def _fractions(self, index: int) -> np.ndarray:
        """Return an accessor's numbers; integers become fractions although the file forgot to say so."""
        values = self._file.array(index)
        return values / np.iinfo(values.dtype).max if values.dtype.kind in "iu" else values

    def _material(self, index: int) -> tuple[Material, dict[str, Any]]:
        if index not in self._materials:
            record = self._file.items("materials")[index]
            factor, info = _base(record)
            material = Material(np.asarray(factor, dtype=np.float64)[:3].reshape(3))
            if info:
                texture = self._file.items("textures")[info["index"]]
                image = self._image(texture)
                sampler = self._file.items("samplers")[texture["sampler"]] if "sampler" in texture else {}
                wrap = (WRAPS.get(sampler.get("wrapS"), REPEAT), WRAPS.get(sampler.get("wrapT"), REPEAT))
                material = PLAIN if image is None else Material(material.color, image, wrap)
            self._materials[index] = material, info
        return self._materials[index]

    def _image(self, texture: dict[str, Any]) -> np.ndarray | None:
        """Return a texture's image, sRGB, shape [row column 3]; None, counted or warned of, where it cannot be read."""
        extensions = texture.get("extensions", {})
        sources = [extensions[name]["source"] for name in IMAGES if name in extensions]
        sources += [texture["source"]] if "source" in texture else []
        for source in sources:
            if source not in self._images:
                self._images[source] = self._decoded(source)
            if self._images[source] is not None:
                return self._images[source]
        if not sources:
            self.lost[
                f"textures are in {', '.join(extensions) or 'no image'}, which is not read; their faces become grey"
            ] += 1
        return None

    def _decoded(self, index: int) -> np.ndarray | None:
        image = self._file.items("images")[index]
        uri = str(image.get("uri", ""))
        name = image.get("name") or (f"image {index}" if "bufferView" in image or uri.startswith("data:") else uri)
        data = self._file.view(image["bufferView"]) if "bufferView" in image else self._file.resource(uri)
        if data is None:
            self.lost[f"textures are missing ({uri[:80]}); their faces become grey"] += 1
            return None
        return decode(self._file.path, str(name), data)


def _base(record: dict[str, Any]) -> tuple[list[float], dict[str, Any]]:
    """Return a material's base factor and texture, or the emission of a black one."""
    gloss = record.get("extensions", {}).get(GLOSS)
    if gloss is not None:
        return gloss.get("diffuseFactor", [1.0] * 4), gloss.get("diffuseTexture", {})
    surface = record.get("pbrMetallicRoughness", {})
    factor, info = surface.get("baseColorFactor", [1.0] * 4), surface.get("baseColorTexture", {})
    emission = record.get("emissiveFactor", [0.0] * 3)
    if not any(factor[:3]) and any(emission):  # some capture apps bake a room's light into emission
        strength = record.get("extensions", {}).get(STRENGTH, {}).get("emissiveStrength", 1.0)
        return [float(strength) * light for light in emission], record.get("emissiveTexture", {})
    return factor, info


def _transformed(uv: np.ndarray, transform: dict[str, Any]) -> np.ndarray:
    """Return coordinates [vertex 2], v downwards, as KHR_texture_transform moves them."""
    turn = float(transform.get("rotation", 0))
    cos, sin = math.cos(turn), math.sin(turn)
    turned = (uv * transform.get("scale", [1, 1])) @ np.array([[cos, -sin], [sin, cos]])
    return np.asarray(turned + transform.get("offset", [0, 0]))
