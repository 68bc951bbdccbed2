"""Materials of a USD stage: UsdPreviewSurface, MDL (OmniPBR and its like) and MaterialX; colours are linear light."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Ar, Usd, UsdShade

from s2a.core.color_space import to_bytes, to_linear
from s2a.scan.source import BLACK, CLAMP, MIRROR, PLAIN, REPEAT, Material, beside, decode, has_holes

_log = logging.getLogger(__name__)

# Render contexts of surfaces, in the order in which they are asked; the first is the universal one
CONTEXTS = ("", "mdl", "mtlx")
COLORS = (
    "diffuseColor base_color baseColor diffuse_color_constant diffuse_reflection_color albedo_color diffuse_color BaseColor "
    "DiffuseColor glass_color color"
).split()
TEXTURES = (
    "diffuse_texture base_color_texture albedo_texture diffuse_reflection_color_image baseColorTexture BaseColor_Tex albedo_map "
    "baseColorMap base_color_image"
).split()
# Inputs of surfaces: colours, images of MDL, and what multiplies both
FACTORS = ("diffuse_tint", "albedo_brightness", "base", "base_weight")
WRAPS = {"clamp": CLAMP, "mirror": MIRROR, "black": BLACK}
# Colour spaces of colours that are levels as shown; others are linear light
SHOWN = ("sRGB", "srgb_texture", "srgb_rec709_display", "srgb_rec709_scene")
RAW = ("raw", "Raw", "lin_rec709", "lin_srgb", "lin_rec709_scene")
READERS = ("UsdPrimvarReader_float3", "UsdPrimvarReader_float4", "ND_geompropvalue_color3", "ND_geompropvalue_color4")


@dataclass(frozen=True)
class Appearance:
    """What a material makes of a mesh."""

    material: Material  # colour and texture
    coordinates: str = "st"  # name of the primvar with texture coordinates
    scale: np.ndarray = field(default_factory=lambda: np.ones(2))  # of the coordinates, shape [2]
    turn: float = 0.0  # rotation of the coordinates after that [rad]
    offset: np.ndarray = field(default_factory=lambda: np.zeros(2))  # of the coordinates after that, shape [2]
    primvar: str | None = None  # name of a primvar that gives the colour, or None

    def placed(self, uv: np.ndarray) -> np.ndarray:
        """Return texture coordinates [... 2] as the material moves them."""
        cos, sin = math.cos(self.turn), math.sin(self.turn)
        moved: np.ndarray = (uv * self.scale) @ np.array([[cos, sin], [-sin, cos]]) + self.offset
        return moved


class UsdMaterials:
    """The materials of a stage, each read once."""

    def __init__(self, path: Path, time: Usd.TimeCode) -> None:
        self._path, self._time = path, time
        self._known: dict[str, Appearance | None] = {}

    def of(self, prim: Usd.Prim) -> tuple[bool, Appearance | None]:
        """Return whether a prim (a mesh, a subset of faces) has a material, and its appearance; None where it cannot be read."""
        binding = UsdShade.MaterialBindingAPI(prim)
        bound = next(
            (material for use in ("full", "preview") if (material := binding.ComputeBoundMaterial(use)[0])), None
        )
        if bound is None:
            return False, None
        key = str(bound.GetPath())
        if key not in self._known:
            self._known[key] = self._appearance(bound)
            if self._known[key] is None:
                text = "%s: the material %s has no base colour that is read; its faces show their own colours, or grey"
                _log.warning(text, self._path, key)
        return True, self._known[key]

    def _appearance(self, material: UsdShade.Material) -> Appearance | None:
        for context in CONTEXTS:
            shader = material.ComputeSurfaceSource(context)[0]
            if shader and (appearance := self._surface(shader)) is not None:
                if self._transparent(shader):
                    text = "%s: the material of %s is transparent, and becomes opaque"
                    _log.warning(text, self._path, shader.GetPath())
                return appearance
        return None

    def _transparent(self, shader: UsdShade.Shader) -> bool:
        """Return whether one sees through a surface; where an image's alpha decides, whether any of it is below 1."""
        slot = shader.GetInput("opacity")
        for attribute in slot.GetValueProducingAttributes() if slot else ():
            if not UsdShade.Output.IsOutput(attribute):
                opacity = attribute.Get(self._time)
                return opacity is not None and float(opacity) < 1
            asset = self._value(UsdShade.Shader(attribute.GetPrim()), "file")
            return attribute.GetBaseName() != "a" or has_holes(self._bytes(asset) or b"")
        return False

    def _constant(self, shader: UsdShade.Shader, name: str) -> Any:
        """Return the value of an input that is not connected; None without one."""
        slot = shader.GetInput(name)
        return slot.Get(self._time) if slot and not slot.HasConnectedSource() else None

    def _surface(self, shader: UsdShade.Shader) -> Appearance | None:
        """Return the appearance of a surface shader: its image, or else its colour, times its factors."""
        appearance = next((look for name in TEXTURES if (look := self._image_input(shader, name))), None)
        if appearance is not None:
            appearance = self._moved_by_mdl(shader, appearance)
        for name in COLORS if appearance is None else ():
            slot = shader.GetInput(name)
            if slot and (appearance := self._color(slot)) is not None:
                break
        if appearance is None and str(shader.GetIdAttr().Get()) == "UsdPreviewSurface":
            appearance = Appearance(Material(np.full(3, 0.18)))  # the specification's own default
        if appearance is None:
            return None
        if appearance.material.texture is None and appearance.primvar is None and not appearance.material.color.any():
            glow = shader.GetInput("emissiveColor")  # some capture apps bake a room's light into emission
            appearance = (self._color(glow) if glow else None) or appearance
        factor = np.ones(3)
        for name in FACTORS:
            value = self._constant(shader, name)
            factor = factor * (1.0 if value is None else np.array(value, dtype=np.float64).ravel()[:3])
        if appearance.material is PLAIN or (factor == 1).all():
            return appearance
        return replace(appearance, material=replace(appearance.material, color=appearance.material.color * factor))

    def _color(self, slot: UsdShade.Input) -> Appearance | None:
        """Return the appearance of a colour input: a value, a texture or a primvar; None for a network that is not read."""
        produced = slot.GetValueProducingAttributes()
        for attribute in produced:
            source = UsdShade.Shader(attribute.GetPrim())
            kind = str(source.GetIdAttr().Get() or "") if source else ""
            if UsdShade.Output.IsOutput(attribute):
                if kind == "UsdUVTexture":
                    return self._texture(source)
                if kind.startswith(("ND_image_color", "ND_tiledimage_color")):
                    return self._image(source.GetInput("file"), source.GetInput("texcoord"))
                if kind in READERS:
                    name = self._value(source, "varname") or self._value(source, "geomprop") or "displayColor"
                    return Appearance(Material(np.ones(3)), primvar=str(name))
                return None
            value = attribute.Get(self._time)
            if value is None:
                return None
            color = np.array(value, dtype=np.float64)[:3]
            return Appearance(Material(to_linear(color) if str(attribute.GetColorSpace()) in SHOWN else color))
        return None

    def _texture(self, source: UsdShade.Shader) -> Appearance:
        appearance = self._image(
            source.GetInput("file"), source.GetInput("st"), str(self._value(source, "sourceColorSpace") or "auto")
        )
        if appearance.material is PLAIN or appearance.material.texture is None:
            return appearance
        wrap = tuple(WRAPS.get(str(self._value(source, name)), REPEAT) for name in ("wrapS", "wrapT"))
        scale, bias = (self._value(source, name) for name in ("scale", "bias"))
        color = np.ones(3) if scale is None else np.array(scale, dtype=np.float64)[:3]
        image = appearance.material.texture
        if bias is not None and any(bias[:3]):
            image, color = to_bytes(to_linear(image) * color + np.array(bias, dtype=np.float64)[:3]), np.ones(3)
        return replace(appearance, material=Material(color, image, (wrap[0], wrap[1])))

    def _image_input(self, shader: UsdShade.Shader, name: str) -> Appearance | None:
        value: Any = self._value(shader, name)
        return self._image(shader.GetInput(name), None) if value is not None and value.path else None

    def _image(
        self, slot: UsdShade.Input | None, coordinates: UsdShade.Input | None, space: str = "auto"
    ) -> Appearance:
        """Return the appearance of an image, also one inside of a USDZ file; grey, and a warning, if it cannot be read."""
        asset: Any = None
        for attribute in slot.GetValueProducingAttributes() if slot else ():
            asset = attribute.Get(self._time)
            space = str(attribute.GetColorSpace()) if space == "auto" and attribute.HasColorSpace() else space
        image = self._read(asset)
        if image is None:
            return Appearance(PLAIN)
        material = Material(np.ones(3), to_bytes(image / 255.0) if space in RAW else image)
        return self._coordinates(coordinates, Appearance(material)) if coordinates else Appearance(material)

    def _read(self, asset: Any) -> np.ndarray | None:
        name, data = str(asset.path) if asset else "", self._bytes(asset)
        if data is not None:
            return decode(self._path, name, data)
        _log.warning("%s: the texture %s is missing; its faces become grey", self._path, name)
        return None

    def _bytes(self, asset: Any) -> bytes | None:
        """Return what a file holds that an attribute names, also one inside of a USDZ file; None where it is missing."""
        resolved = asset.resolvedPath if asset else ""
        opened = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved)) if resolved else None
        if opened is not None:
            return bytes(opened.GetBuffer())
        file = beside(self._path.parent, str(asset.path)) if asset and asset.path else None
        return None if file is None else file.read_bytes()

    def _coordinates(self, slot: UsdShade.Input, appearance: Appearance) -> Appearance:
        """Return a appearance with the primvar that its texture reads coordinates from, and what moves them on the way."""
        for _ in range(8):  # transforms in a row
            produced = slot.GetValueProducingAttributes()
            reader = UsdShade.Shader(produced[0].GetPrim()) if produced else None
            kind = str(reader.GetIdAttr().Get() or "") if reader else ""
            if reader and kind == "UsdTransform2d":
                scale, turn, offset = (self._value(reader, name) for name in ("scale", "rotation", "translation"))
                inner = Appearance(
                    appearance.material,
                    scale=np.ones(2) if scale is None else np.array(scale, dtype=np.float64),
                    turn=math.radians(float(turn or 0.0)),
                    offset=np.zeros(2) if offset is None else np.array(offset, dtype=np.float64),
                )
                appearance = replace(inner, coordinates=appearance.coordinates)
                following = reader.GetInput("in")
                if not following:
                    return appearance
                slot = following
                continue
            name = (self._value(reader, "varname") or self._value(reader, "geomprop")) if reader else None
            return replace(appearance, coordinates=str(name)) if name else appearance
        return appearance

    def _moved_by_mdl(self, shader: UsdShade.Shader, appearance: Appearance) -> Appearance:
        scale, turn, offset = (self._value(shader, f"texture_{name}") for name in ("scale", "rotate", "translate"))
        return replace(
            appearance,
            scale=appearance.scale if scale is None else np.array(scale, dtype=np.float64),
            turn=math.radians(float(turn or 0.0)),
            offset=appearance.offset if offset is None else np.array(offset, dtype=np.float64),
        )

    def _value(self, shader: UsdShade.Shader, name: str) -> Any:
        """Return the value of an input, which may be connected to the material's own input; None without one."""
        slot = shader.GetInput(name)
        produced = slot.GetValueProducingAttributes() if slot else ()
        return produced[0].Get(self._time) if produced else None
