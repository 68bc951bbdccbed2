"""A textured mesh as phones write it: one GLB (glTF 2.0, Khronos Group) with y up, and an image with a place for each triangle.

Two triangles share a square of the image, a texel apart.
"""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

TEXELS = 6
"""Along each side of the square of two triangles."""
Y_UP = np.array(((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)))
"""Rotation from z up to y up: (x, y, z) becomes (x, z, -y)."""
Paint = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Returns the colours [point 3] of points [point 3] with normals [point 3]."""


def write(path: Path, vertices: np.ndarray, faces: np.ndarray, paint: Paint) -> None:
    """Write a mesh with a texture.

    Args:
        path: of the file.
        vertices: z up [m], shape [vertex 3].
        faces: vertex indices, shape [face 3].
        paint: colours of points on it.
    """
    across = int(np.ceil(np.sqrt(np.ceil(len(faces) / 2))))
    image = _texture(vertices[faces].astype(np.float64), across, paint)
    corners = (vertices[faces].reshape(-1, 3) @ Y_UP.T).astype("<f4")
    coordinates = _coordinates(len(faces), across).astype("<f4")
    indices = np.arange(len(corners), dtype="<u4")
    file = io.BytesIO()
    Image.fromarray(image).save(file, format="PNG")
    _container(path, corners, coordinates, indices, file.getvalue())


def _squares(count: int, across: int) -> np.ndarray:
    """Return column and row of each triangle's square, shape [face 2]."""
    square = np.arange(count) // 2
    return np.stack([square % across, square // across], axis=1)


def _coordinates(count: int, across: int) -> np.ndarray:
    """Return texture coordinates of all triangles' corners, in the middle of texels, shape [3 face 2]."""
    low, high = 0.5 / TEXELS, 1.0 - 0.5 / TEXELS
    gap = 1.0 / TEXELS
    first = np.array([(low, low), (high - gap, low), (low, high - gap)])
    second = np.array([(high, high), (low + gap, high), (high, low + gap)])
    corners = np.where((np.arange(count) % 2 == 0)[:, None, None], first, second)
    return ((_squares(count, across)[:, None] + corners) / across).reshape(-1, 2)


def _texture(triangles: np.ndarray, across: int, paint: Paint) -> np.ndarray:
    """Return the image, shape [row column 3], uint8."""
    count = len(triangles)
    size = across * TEXELS
    column, row = np.meshgrid(np.arange(TEXELS), np.arange(TEXELS))
    upper = (column + row > TEXELS - 1).ravel()
    span = TEXELS - 2
    u, v = column.ravel() / span, row.ravel() / span
    lower_uv = np.stack([u, v], axis=1)
    upper_uv = np.stack([(TEXELS - 1 - column.ravel()) / span, (TEXELS - 1 - row.ravel()) / span], axis=1)
    image = np.zeros((size, size, 3), np.uint8)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    squares = _squares(count, across) * TEXELS
    for parity, mine, weights in ((0, ~upper, lower_uv), (1, upper, upper_uv)):
        some = np.arange(parity, count, 2)
        uv = weights[mine]
        a, b, c = np.moveaxis(triangles[some], 1, 0)
        points = a[:, None] + uv[None, :, :1] * (b - a)[:, None] + uv[None, :, 1:] * (c - a)[:, None]
        colors = paint(points.reshape(-1, 3), np.repeat(normals[some], len(uv), axis=0))
        x = squares[some, 0][:, None] + column.ravel()[mine]
        y = squares[some, 1][:, None] + row.ravel()[mine]
        image[y.ravel(), x.ravel()] = colors
    return image


def _container(path: Path, corners: np.ndarray, coordinates: np.ndarray, indices: np.ndarray, image: bytes) -> None:
    """Write the JSON and the binary part of a GLB."""
    blocks = [corners.tobytes(), coordinates.tobytes(), indices.tobytes(), image]
    padded = [block + b"\0" * (-len(block) % 4) for block in blocks]
    offsets = np.cumsum([0, *(len(block) for block in padded)])
    content = {
        "asset": {"version": "2.0", "generator": "s2a sample"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "scan"}],
        **_look(),
        "accessors": _accessors(corners, len(coordinates), len(indices)),
        "bufferViews": [
            {"buffer": 0, "byteOffset": int(start), "byteLength": len(block)}
            for start, block in zip(offsets, blocks, strict=False)
        ],
        "buffers": [{"byteLength": int(offsets[-1])}],
    }
    text = json.dumps(content, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    binary = b"".join(padded)
    with path.open("wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(binary)))
        file.write(struct.pack("<I4s", len(text), b"JSON") + text)
        file.write(struct.pack("<I4s", len(binary), b"BIN\0") + binary)


def _look() -> dict[str, Any]:
    """Return the mesh with its material: the image, as dull as paint, from both sides."""
    attributes = {"POSITION": 0, "TEXCOORD_0": 1}
    paint = {"baseColorTexture": {"index": 0}, "metallicFactor": 0.0, "roughnessFactor": 1.0}
    return {
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 2, "material": 0, "mode": 4}]}],
        "materials": [{"pbrMetallicRoughness": paint, "doubleSided": True}],
        "textures": [{"source": 0}],
        "images": [{"bufferView": 3, "mimeType": "image/png"}],
    }


def _accessors(corners: np.ndarray, coordinates: int, indices: int) -> list[dict[str, Any]]:
    """Return what the first three blocks hold: 5126 are floats, 5125 are unsigned integers."""
    low, high = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    return [
        {"bufferView": 0, "componentType": 5126, "count": len(corners), "type": "VEC3", "min": low, "max": high},
        {"bufferView": 1, "componentType": 5126, "count": coordinates, "type": "VEC2"},
        {"bufferView": 2, "componentType": 5125, "count": indices, "type": "SCALAR"},
    ]
