"""USD and USDZ -> SourceMesh: what a renderer shows of a stage at its first moment, placed."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdShade

from s2a.core.color_space import to_linear
from s2a.core.errors import InputError
from s2a.scan.source import Material, SourceMesh, Stated, joined, triangulate
from s2a.scan.usd_materials import SHOWN, Appearance, UsdMaterials
from s2a.scene.usd.stage import reading, refuse_deep

AROUND, ALONG = 32, 16  # Sides of round shapes, and rings from pole to pole of a sphere
_AXES = {"X": [2, 0, 1], "Y": [1, 2, 0], "Z": [0, 1, 2]}


@dataclass(frozen=True)
class Polygons:
    """Polygons in a prim's own frame."""

    points: np.ndarray  # shape [vertex 3], float64
    counts: np.ndarray  # corners of each polygon, shape [polygon], int64
    indices: np.ndarray  # vertices of the corners, one polygon after the other, int64
    number: np.ndarray  # of each polygon among those that the prim has, shape [polygon]; holes are left out
    left_handed: bool = False  # The polygons are wound clockwise


def polygons(prim: Usd.Prim, time: Usd.TimeCode) -> Polygons | None:
    """Return the polygons of a prim; None for a kind that has none here, such as curves and points.

    Raises:
        ValueError: a mesh whose faces name vertices that do not exist.
    """
    if prim.IsA(UsdGeom.Mesh):
        return _mesh(UsdGeom.Mesh(prim), time)
    if prim.IsA(UsdGeom.Cube):
        half = float(UsdGeom.Cube(prim).GetSizeAttr().Get(time)) / 2
        corners = half * np.array([(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], dtype=np.float64)
        return _shape(corners, [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (1, 3, 7, 5), (3, 2, 6, 7), (2, 0, 4, 6)])
    if prim.IsA(UsdGeom.Plane):
        plane = UsdGeom.Plane(prim)
        x, y = float(plane.GetWidthAttr().Get(time)) / 2, float(plane.GetLengthAttr().Get(time)) / 2
        flat = np.array([(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)])
        return _shape(flat[:, _AXES[str(plane.GetAxisAttr().Get(time))]], [(0, 1, 2, 3)])
    outline = _outline(prim, time)
    if outline is None:
        return None
    axis = prim.GetAttribute("axis").Get(time) if prim.GetAttribute("axis") else "Z"
    return _turned(np.array(outline), _AXES[str(axis)])


def _mesh(mesh: UsdGeom.Mesh, time: Usd.TimeCode) -> Polygons:
    points = np.array(mesh.GetPointsAttr().Get(time) or [], dtype=np.float64).reshape(-1, 3)
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get(time) or [], dtype=np.int64)
    indices = np.array(mesh.GetFaceVertexIndicesAttr().Get(time) or [], dtype=np.int64)
    if (counts < 0).any() or counts.sum() != len(indices):
        raise ValueError(f"its faces have {counts.sum()} corners, and {len(indices)} are listed")
    if len(indices) and not 0 <= indices.min() <= indices.max() < len(points):
        raise ValueError("its faces name vertices which do not exist")
    holes = np.array(mesh.GetHoleIndicesAttr().Get(time) or [], dtype=np.int64)
    shown = ~np.isin(np.arange(len(counts)), holes)
    left = mesh.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded
    shown_corners = np.repeat(shown, counts)
    return Polygons(points, counts[shown], indices[shown_corners], np.flatnonzero(shown), left)


def _shape(points: np.ndarray, faces: list[tuple[int, ...]]) -> Polygons:
    counts = np.array([len(face) for face in faces])
    return Polygons(points, counts, np.array([i for face in faces for i in face]), np.arange(len(faces)))


def _outline(prim: Usd.Prim, time: Usd.TimeCode) -> list[tuple[float, float]] | None:
    """Return half of a round shape's outline, (radius, height) from below; None for a prim that is no round shape."""

    def value(name: str) -> float:
        return float(prim.GetAttribute(name).Get(time))

    kind = str(prim.GetTypeName())
    quarter = np.linspace(0, np.pi / 2, ALONG // 2 + 1)
    if kind == "Sphere":
        r = value("radius")
        return [(r * np.sin(a), -r * np.cos(a)) for a in np.linspace(0, np.pi, ALONG + 1)]
    if kind not in ("Cylinder", "Cylinder_1", "Cone", "Capsule", "Capsule_1"):
        return None
    half = value("height") / 2
    low, high = (value("radiusBottom"), value("radiusTop")) if kind.endswith("_1") else 2 * (value("radius"),)
    if kind == "Cone":
        return [(0.0, -half), (low, -half), (0.0, half)]
    if kind.startswith("Cylinder"):
        return [(0.0, -half), (low, -half), (high, half), (0.0, half)]
    below = [(low * np.sin(a), -half - low * np.cos(a)) for a in quarter]
    return below + [(high * np.cos(a), half + high * np.sin(a)) for a in quarter]


def _turned(outline: np.ndarray, axes: list[int]) -> Polygons:
    """Return an outline [ring 2] turned about an axis, its ends closed to points."""
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    radius, height = outline[:, 0], outline[:, 1]
    rings = np.stack(
        np.broadcast_arrays(np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle)), height[:, None]), axis=2
    )
    number = np.arange(len(outline) * AROUND).reshape(len(outline), AROUND)
    number[0], number[-1] = number[0, 0], number[-1, 0]
    faces: list[Any] = []
    for below, above in zip(number[:-1], number[1:], strict=True):
        quads = np.stack([below, np.roll(below, -1), np.roll(above, -1), above], axis=1).tolist()
        faces += [tuple(dict.fromkeys(quad)) for quad in quads]
    return _shape(rings.reshape(-1, 3)[:, axes], [face for face in faces if len(face) > 2])


_log = logging.getLogger(__name__)

NAME = "USD"
ENDINGS = (".usdz", ".usd", ".usda", ".usdc")
# Purposes of what renderers do not show: colliders, and simple shapes in place of others
STANDINS = (UsdGeom.Tokens.guide, UsdGeom.Tokens.proxy)
UNIT = "metersPerUnit"
DEEPEST = 16  # Instancers within instancers
# What attributes of wrong types raise
DAMAGE = (TypeError, ValueError, IndexError, AttributeError, KeyError, OverflowError, MemoryError)
Place = Callable[[Usd.Prim], Any]  # A prim -> matrix [4 4] of USD's row vectors


def recognise(path: Path) -> bool:
    """Return whether a file's name ends as USD's do."""
    return path.suffix.lower() in ENDINGS


def read(path: Path) -> SourceMesh:
    """Read all visible geometry of a stage, in the order of its prims, polygons as triangles.

    Time samples count at the stage's first moment. Guides and proxies, curves and points are left out with a warning.

    Raises:
        InputError: no USD file, a damaged one, or one without meshes.
    """
    refuse_deep(path)
    with reading(path):
        stage = Usd.Stage.Open(str(path))
        if not stage:
            raise InputError(f"{path}: not a USD file, or a damaged one; export it again")
        reader = _Reader(path, stage)
        try:
            parts, stated = list(reader.parts()), _stated(stage)
        except InputError:
            raise
        except DAMAGE as error:
            reason = " ".join(f"{type(error).__name__}: {error}".split())[:120]
            raise InputError(f"{path}: holds values of wrong types ({reason}); export it again") from error
    if not parts:
        raise InputError(f"{path}: holds no meshes; export the scan's mesh{reader.reason}")
    reader.warn()
    return joined(parts, stated)


def _stated(stage: Usd.Stage) -> Stated:
    """Return the stage's up axis and unit, where it states them itself: USD's fallbacks are no statement."""
    up = str(UsdGeom.GetStageUpAxis(stage)).lower() if stage.HasAuthoredMetadata("upAxis") else None
    return Stated(up, _unit(stage.GetRootLayer().pseudoRoot), NAME)


def _unit(root: Sdf.PrimSpec) -> float | None:
    """Return the metres a unit that a layer states, which some programs write as a float, and USD's own query refuses then."""
    return float(root.GetInfo(UNIT)) if root.HasInfo(UNIT) else None


class _Reader:
    def __init__(self, path: Path, stage: Usd.Stage) -> None:
        self._path, self._stage = path, stage
        timed = stage.HasAuthoredTimeCodeRange()
        self._time = Usd.TimeCode(stage.GetStartTimeCode()) if timed else Usd.TimeCode.EarliestTime()
        self._cache, self._lost = UsdGeom.XformCache(self._time), Counter[str]()
        self._looks = UsdMaterials(path, self._time)
        self._local: dict[str, SourceMesh | None] = {}

    @property
    def reason(self) -> str:
        """What was left out, for an error: "; 3 ..."."""
        return "".join(f"; {count} {what}" for what, count in self._lost.items())

    def parts(self) -> Iterator[SourceMesh]:
        """Yield the geometry of all prims, placed; stand-ins where there is nothing else."""
        shown = list(self._shown(self._stage.GetPseudoRoot(), self._cache.GetLocalToWorldTransform, 0))
        if not any(purpose not in STANDINS for _, _, purpose in shown):
            proxies = [(prim, place) for prim, place, purpose in shown if purpose == UsdGeom.Tokens.proxy]
            shown = [(prim, place, UsdGeom.Tokens.render) for prim, place in proxies]
        for prim, matrix, purpose in shown:
            if purpose in STANDINS:
                self._lost[f"prims of purpose {purpose} are left out, which renderers do not show"] += 1
                continue
            key = str(prim.GetPath())
            if key not in self._local:
                self._local[key] = self._mesh(prim)
            mesh = self._local[key]
            if mesh is not None and len(mesh.faces):
                yield _placed(mesh, matrix)

    def warn(self) -> None:
        """Log what is left out."""
        for what, count in self._lost.items():
            _log.warning("%s: %d %s", self._path, count, what)
        if others := [layer for layer in self._stage.GetUsedLayers() if self._differs(layer.pseudoRoot)]:
            text = "%s: %d layers state another up axis or unit, such as %s; USD does not convert what is referenced"
            _log.warning(text, self._path, len(others), others[0].GetDisplayName())
        if errors := self._stage.GetCompositionErrors():
            first = " ".join(str(errors[0]).split())[:160]
            _log.warning("%s: %d references cannot be followed: %s", self._path, len(errors), first)

    def _differs(self, root: Sdf.PrimSpec) -> bool:
        """Return whether a layer states another up axis or unit than the stage has."""
        stated = _stated(self._stage)
        up = str(root.GetInfo("upAxis")).lower() if root.HasInfo("upAxis") else stated.up
        unit = _unit(root) or stated.unit
        same = stated.unit is None or UsdGeom.LinearUnitsAre(unit, stated.unit)
        return stated.up not in (None, up) or not same

    def _shown(self, root: Usd.Prim, place: Place, depth: int) -> Iterator[tuple[Usd.Prim, np.ndarray, str]]:
        """Yield the visible prims with a shape at and below a prim, where they stand, and their purpose."""
        wanted = Usd.PrimIsActive & Usd.PrimIsLoaded
        # What an instancer repeats may be declared as a class or an override, so as not to be seen in its own place.
        predicate = wanted if depth else wanted & Usd.PrimIsDefined & ~Usd.PrimIsAbstract
        walk = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies(predicate)))
        for prim in walk:
            if not prim.IsA(UsdGeom.Imageable):
                continue
            image = UsdGeom.Imageable(prim)
            if prim.IsA(UsdGeom.PointInstancer):
                walk.PruneChildren()
                if image.ComputeVisibility(self._time) != UsdGeom.Tokens.invisible:
                    yield from self._instances(UsdGeom.PointInstancer(prim), np.array(place(prim)), depth)
            elif prim.IsA(UsdGeom.Gprim) and not self._invisible(image):
                yield prim, np.array(place(prim)), image.ComputePurpose()

    def _invisible(self, image: UsdGeom.Imageable) -> bool:
        gone = image.ComputeVisibility(self._time) == UsdGeom.Tokens.invisible
        self._lost["invisible prims are left out"] += int(gone)
        self._lost += Counter()  # drops zeros
        return gone

    def _instances(
        self, instancer: UsdGeom.PointInstancer, matrix: np.ndarray, depth: int
    ) -> Iterator[tuple[Usd.Prim, np.ndarray, str]]:
        """Yield what an instancer repeats, wherever it does."""
        if depth >= DEEPEST:
            raise InputError(
                f"{self._path}: {instancer.GetPath()}: instancers nest deeper than {DEEPEST}; export it again"
            )
        prototypes = [self._stage.GetPrimAtPath(path) for path in instancer.GetPrototypesRel().GetForwardedTargets()]
        numbers = instancer.GetProtoIndicesAttr().Get(self._time) or []
        places = instancer.ComputeInstanceTransformsAtTime(
            self._time, self._time, UsdGeom.PointInstancer.IncludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
        )
        mask = instancer.ComputeMaskAtTime(self._time) or [True] * len(numbers)
        for number, place, shown in zip(numbers, places or [], mask, strict=False):
            prototype = prototypes[number] if 0 <= number < len(prototypes) else None
            if not prototype:
                self._lost["instances of prims that do not exist are left out"] += 1
            elif shown:
                yield from self._shown(prototype, self._within(prototype, np.array(place) @ matrix), depth + 1)
            else:
                self._lost["hidden instances are left out"] += 1

    def _within(self, prototype: Usd.Prim, matrix: np.ndarray) -> Place:
        return lambda prim: np.array(self._cache.ComputeRelativeTransform(prim, prototype)[0]) @ matrix

    def _mesh(self, prim: Usd.Prim) -> SourceMesh | None:
        """Return one prim's triangles in its own frame; None for curves and points, which are counted."""
        try:
            shape = polygons(prim, self._time)
        except (ValueError, TypeError) as error:
            raise InputError(f"{self._path}: {prim.GetPath()}: {error}; export it again") from error
        if shape is None:
            self._lost[f"prims of type {prim.GetTypeName()} are left out"] += 1
            return None
        if prim.HasRelationship("skel:skeleton") or prim.HasAttribute("primvars:skel:jointIndices"):
            self._lost["meshes on a skeleton are read in their bind pose"] += 1
        scheme = prim.GetAttribute("subdivisionScheme")
        flat = (UsdGeom.Tokens.none, UsdGeom.Tokens.bilinear)
        if scheme and scheme.HasAuthoredValue() and str(scheme.Get()) not in flat:
            self._lost["subdivision surfaces are read as their cages"] += 1
        if few := int((shape.counts < 3).sum()):
            self._lost["faces with fewer than 3 corners are left out"] += few
        corners, polygon = triangulate(shape.points, shape.counts, shape.indices)
        if shape.left_handed:
            corners = corners[:, ::-1]
        return self._colored(prim, shape, corners, shape.number[polygon])

    def _colored(self, prim: Usd.Prim, shape: Polygons, corners: np.ndarray, polygon: np.ndarray) -> SourceMesh:
        """Return triangles with the materials of a prim and of subsets of its faces.

        Args:
            prim: whose they are.
            shape: its polygons.
            corners: positions in the polygons' corners, shape [face 3].
            polygon: the prim's polygon of each triangle, shape [face].
        """
        owners = [prim, *(subset.GetPrim() for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets())]
        owner = np.zeros(int(shape.number.max(initial=-1)) + 1, np.int64)
        for number, subset in enumerate(owners[1:], 1):
            indices = np.array(UsdGeom.Subset(subset).GetIndicesAttr().Get(self._time) or [], dtype=np.int64)
            owner[indices[(indices >= 0) & (indices < len(owner))]] = number
        uv, colors = np.full((*corners.shape, 2), np.nan), np.full((*corners.shape, 3), np.nan, dtype=np.float32)
        material, materials = np.full(len(corners), -1), list[Material]()
        values = _Primvars(self._path, prim, shape, self._time)
        for number in np.unique(owner[polygon]):
            mine = owner[polygon] == number
            _, appearance = self._looks.of(owners[number])
            if appearance is None:
                opacity = values.at(corners[mine], polygon[mine], "displayOpacity", 1)
                if lost := int((opacity < 1).any(axis=(1, 2)).sum()):
                    self._lost["faces are transparent (displayOpacity), and become opaque"] += lost
                colors[mine] = values.at(corners[mine], polygon[mine], "displayColor", 3)
                continue
            material[mine] = len(materials)
            materials.append(appearance.material)
            if appearance.primvar is not None:
                colors[mine] = values.at(corners[mine], polygon[mine], appearance.primvar, 3)
            if appearance.material.texture is not None:
                uv[mine] = self._coordinates(values, appearance, corners[mine], polygon[mine])
        return SourceMesh(
            shape.points, shape.indices[corners], uv, np.clip(colors, 0, 1), material, tuple(materials), Stated()
        )

    def _coordinates(
        self, values: _Primvars, appearance: Appearance, corners: np.ndarray, polygon: np.ndarray
    ) -> np.ndarray:
        """Return texture coordinates, shape [face 3 2], NaN where there are none, which is counted."""
        uv = values.at(corners, polygon, appearance.coordinates, 2)
        uv = appearance.placed(np.where(np.isfinite(uv), uv, np.nan))
        if lost := int(np.isnan(uv).any(axis=(1, 2)).sum()):
            self._lost[f"faces have a texture and no coordinates {appearance.coordinates!r}; they become white"] += lost
        return uv


class _Primvars:
    """Values of a prim's primvars at the corners of its triangles."""

    def __init__(self, path: Path, prim: Usd.Prim, shape: Polygons, time: Usd.TimeCode) -> None:
        self._where, self._prim, self._shape, self._time = f"{path}: {prim.GetPath()}", prim, shape, time
        # Corners of polygons that are no holes, counted as the file counts all of them.
        counts = UsdGeom.Mesh(prim).GetFaceVertexCountsAttr().Get(time) if prim.IsA(UsdGeom.Mesh) else None
        whole = np.array(counts if counts is not None else shape.counts, dtype=np.int64)
        ends = np.cumsum(whole)
        corners = (
            [np.arange(ends[i] - whole[i], ends[i]) for i in shape.number] if len(whole) != len(shape.counts) else []
        )
        self._corner = np.concatenate(corners) if corners else np.arange(len(shape.indices))

    def at(self, corners: np.ndarray, polygon: np.ndarray, name: str, width: int) -> np.ndarray:
        """Return a primvar at corners [face 3], shape [face 3 width]; NaN where there is none or its length is wrong."""
        missing = np.full((*corners.shape, width), np.nan)
        primvar = UsdGeom.PrimvarsAPI(self._prim).FindPrimvarWithInheritance(name)
        if not primvar or not primvar.HasValue():
            return missing
        flat = np.array(primvar.ComputeFlattened(self._time), dtype=np.float64)
        if flat.size % max(len(flat), 1) or flat.size // max(len(flat), 1) < width:
            return missing
        values = flat.reshape(len(flat), -1)[:, :width]
        if str(primvar.GetAttr().GetColorSpace()) in SHOWN:
            values = to_linear(values)
        place = {"faceVarying": self._corner[corners], "constant": np.zeros_like(corners)}
        place["uniform"] = np.broadcast_to(polygon[:, None], corners.shape)
        at = place.get(str(primvar.GetInterpolation()), self._shape.indices[corners])
        if at.size and at.max() >= len(values):
            _log.warning("%s: %s holds %d values, too few; it is ignored", self._where, name, len(values))
            return missing
        return np.asarray(values[at])


def _placed(mesh: SourceMesh, matrix: np.ndarray) -> SourceMesh:
    """Return a mesh where a matrix puts it; USD's row vectors: a point stands before the matrix."""
    vertices = mesh.vertices @ matrix[:3, :3] + matrix[3, :3]
    if np.linalg.det(matrix[:3, :3]) >= 0:
        return replace(mesh, vertices=vertices)
    return replace(mesh, vertices=vertices, faces=mesh.faces[:, ::-1], uv=mesh.uv[:, ::-1], colors=mesh.colors[:, ::-1])
