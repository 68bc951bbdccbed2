"""Colours of glTF's primitives: materials, textures with their coordinates, colours of vertices; all factors are linear light."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np

from s2a.scan.gltf_file import GltfFile
from s2a.scan.images import decode
from s2a.scan.source import CLAMP, MIRROR, PLAIN, REPEAT, Material

TRANSFORM, GLOSS = "KHR_texture_transform", "KHR_materials_pbrSpecularGlossiness"
IMAGES = ("EXT_texture_webp", "EXT_texture_avif")
"""Extensions of textures whose images Pillow decodes."""
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

        Args:
            primitive: of a mesh.
            faces: vertex indices, shape [face 3].
            count: number of vertices.
        """
        attributes = primitive["attributes"]
        inside = np.clip(faces, 0, count - 1)  # a damaged index is refused later, with its number
        colors = np.full((*faces.shape, 3), np.nan, dtype=np.float32)
        if "COLOR_0" in attributes:
            colors = self._colors(attributes["COLOR_0"])[inside]
        uv = np.full((*faces.shape, 2), np.nan)
        if "material" not in primitive:
            return uv, colors, None
        material, info = self._material(primitive["material"])
        if self._file.items("materials")[primitive["material"]].get("alphaMode", "OPAQUE") != "OPAQUE":
            self.lost["faces are transparent or cut out by their texture, and become opaque"] += len(faces)
        if material.texture is None:
            return uv, colors, material
        transform = info.get("extensions", {}).get(TRANSFORM, {})
        name = f"TEXCOORD_{transform.get('texCoord', info.get('texCoord', 0))}"
        if name not in attributes:
            self.lost[f"faces have a texture and no {name}; they get the material's colour"] += len(faces)
            return uv, colors, material
        found = self._coordinates(attributes[name])
        return (_transformed(found, transform) * [1, -1] + [0, 1])[inside], colors, material

    def _colors(self, index: int) -> np.ndarray:
        """Return the colours of vertices, linear, shape [vertex 3], float32; integers are fractions of their largest."""
        values = self._fractions(index)
        if values.shape[1] < 3:
            raise ValueError(f"colours of {values.shape[1]} numbers")
        return np.clip(values[:, :3], 0, 1).astype(np.float32)

    def _coordinates(self, index: int) -> np.ndarray:
        accessor = self._file.items("accessors")[index]
        quantized = "KHR_mesh_quantization" in self._file.items("extensionsUsed")
        return (
            self._file.array(index).astype(np.float64)
            if quantized or "normalized" in accessor
            else self._fractions(index)
        )

    def _fractions(self, index: int) -> np.ndarray:
        """Return an accessor's numbers; integers become fractions although the file forgot to say so."""
        values = self._file.array(index)
        return values / np.iinfo(values.dtype).max if values.dtype.kind in "iu" else values

    def _material(self, index: int) -> tuple[Material, dict[str, Any]]:
        """Return a material, and what it says of its texture's coordinates."""
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
        return emission, record.get("emissiveTexture", {})
    return factor, info


def _transformed(uv: np.ndarray, transform: dict[str, Any]) -> np.ndarray:
    """Return coordinates [vertex 2], v downwards, as KHR_texture_transform moves them."""
    scale, turn, offset = (
        transform.get("scale", [1, 1]),
        float(transform.get("rotation", 0)),
        transform.get("offset", [0, 0]),
    )
    cos, sin = math.cos(turn), math.sin(turn)
    moved: np.ndarray = (uv * scale) @ np.array([[cos, -sin], [sin, cos]]) + offset
    return moved
