"""The JSON and the buffers of a glTF 2.0 or GLB file: accessors of every type, sparse, normalised or strided, as arrays.

Not trimesh's reader: it leaves out normalisation, sparse accessors, instances, strips and fans, further sets of coordinates.
"""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote_to_bytes

import numpy as np

from s2a.core.errors import InputError
from s2a.scan.images import beside

COMPONENTS = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4", 5130: "f8"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_JSON, _BINARY = 0x4E4F534A, 0x004E4942
_COMPRESSED = {
    "KHR_draco_mesh_compression": "Draco",
    "EXT_meshopt_compression": "meshopt",
    "KHR_meshopt_compression": "meshopt",
}
_DECOMPRESS = "npx @gltf-transform/cli copy IN.glb OUT.glb decompresses it"
_MOST = 500_000_000  # numbers in an accessor


class GltfFile:
    """A file whose arrays are read when they are needed.

    Attributes:
        path: of the file.
        document: its JSON.
    """

    def __init__(self, path: Path) -> None:
        """Read JSON and binary chunk.

        Raises:
            InputError: truncated, no glTF, or another version of it.
        """
        self.path = path
        data = path.read_bytes()
        text, self._chunk = _chunks(path, data) if data[:4] == b"glTF" or path.suffix.lower() == ".glb" else (data, b"")
        try:
            self.document: dict[str, Any] = json.loads(text.decode("utf-8-sig"))
            version = str(self.document["asset"]["version"])
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise InputError(f"{path}: truncated or no glTF ({error!r}); copy or export it again") from error
        if not version.startswith("2."):
            raise InputError(f"{path}: is glTF {version}; 2.0 is possible: export it again")
        self._buffers: dict[int, bytes] = {}

    def items(self, name: str) -> list[Any]:
        """Return a list of the document's top level; empty where it has none."""
        found = self.document.get(name, [])
        return found if isinstance(found, list) else []

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
        kind, width, count = (
            np.dtype("<" + COMPONENTS[accessor["componentType"]]),
            WIDTHS[accessor["type"]],
            int(accessor["count"]),
        )
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
        self.refuse_compressed(list(view.get("extensions", {})) if not self._has_bytes(view["buffer"]) else [])
        buffer, start = self._buffer(view["buffer"]), int(view.get("byteOffset", 0))
        if not 0 <= start <= start + int(view["byteLength"]) <= len(buffer):
            raise ValueError(f"buffer view {index} ends beyond its buffer")
        return buffer[start : start + int(view["byteLength"])]

    def resource(self, uri: str) -> bytes | None:
        """Return what a URI holds: in itself, or in a file beside this one; None for a file that is missing."""
        if uri.startswith("data:"):
            head, _, data = uri.partition(",")
            return (
                base64.b64decode(data + "=" * (-len(data) % 4)) if head.endswith(";base64") else unquote_to_bytes(data)
            )
        file = beside(self.path.parent, uri)
        return None if file is None else file.read_bytes()

    def _has_bytes(self, index: int) -> bool:
        return "uri" in self.items("buffers")[index] or (index == 0 and bool(self._chunk))

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


def _chunks(path: Path, data: bytes) -> tuple[bytes, bytes]:
    """Return the JSON and the binary chunk of a GLB file."""
    if data[:4] != b"glTF":
        raise InputError(f"{path}: is no GLB file; export it again")
    try:
        version, length = struct.unpack_from("<II", data, 4)
        if version != 2:
            raise InputError(f"{path}: is GLB {version}; 2 is possible: export it again")
        if length > len(data):
            raise InputError(f"{path}: truncated, {len(data)} of {length} bytes; copy or download it again")
        found: dict[int, bytes] = {}
        at = 12
        while at + 8 <= length:
            size, kind = struct.unpack_from("<II", data, at)
            found.setdefault(kind, data[at + 8 : at + 8 + size])
            at += 8 + size
            # A chunk's length counts its padding; some writers leave the padding out, others do not count it.
            if at % 4 and struct.unpack_from("<4xI", data.ljust(at + 8, b"\0"), at)[0] not in (_JSON, _BINARY):
                at += -at % 4
        return found[_JSON], found.get(_BINARY, b"")
    except (struct.error, KeyError) as error:
        raise InputError(f"{path}: truncated or no GLB ({error}); copy or export it again") from error
