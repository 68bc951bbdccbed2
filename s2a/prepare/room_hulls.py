"""Convex hulls of the static room, the flat tops of its supports, and its visible surfaces."""

from collections.abc import Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count
from typing import Annotated

import numpy as np
import trimesh

from s2a.core.bounds import AtLeast, Count, CountFromZero, Fraction, NotNegative, Positive
from s2a.core.cache import recall
from s2a.core.progress import track
from s2a.prepare.grasp import bodies
from s2a.scene.geometry.convex import (
    APART,
    MARGIN,
    clip,
    components,
    contains,
    cut_free,
    hull,
    one_hull,
    overlap,
    vhacd,
    volume,
)
from s2a.scene.geometry.mesh_ops import centroids, keep, normals, sample_with_faces, weld
from s2a.scene.geometry.mesh_query import RayMesh, nearest_faces, ray_mesh
from s2a.scene.geometry.planes import TILT, Plane, find_planes, slabs
from s2a.scene.geometry.simplify import STRUCTURE_LABELS, DecimateConfig, Decimated, decimate_room, is_structure
from s2a.scene.scene import Mesh, Part, Scene, pack, unpack
from s2a.scene.usd.sim_scene import Collider

GRID = 5  # Points along each side of an object's outline below which a top is looked for
INSIDE = 1e-3  # [m] Below the top, for those points


@dataclass(frozen=True)
class TopConfig:
    """How a level top is found."""

    band: Positive = 0.008  # largest distance of its faces from where an object stands on it [m]
    # largest distance from its height of `level_fraction` of it [m]; a bed has no level top
    unevenness: Positive = 0.003
    level_fraction: Fraction = 0.9  # of its area
    cell: Positive = 0.01  # width of the cells of which its boxes are made [m]
    closing: CountFromZero = 6  # holes of up to twice as many cells are closed
    boxes: Count = 8  # largest number of boxes
    headroom: Positive = 0.01  # what hulls of the support reach above the top is cut off up to this height [m]


@dataclass(frozen=True, eq=False)
class LevelTop:
    """The level top of a support."""

    part: str  # id of the support
    height: float  # of the top [m]
    boxes: tuple[Mesh, ...]  # that end there, scene coordinates
    layer: tuple[Mesh, ...]  # what the support's other hulls leave to them, convex hulls, scene coordinates

    def carries(self, low: np.ndarray, high: np.ndarray) -> bool:
        """Return True if there is a box below each of the points of an outline from `low` to `high` [2]."""
        sides = [np.linspace(low[k], high[k], GRID) for k in range(2)]
        points = np.stack(np.meshgrid(*sides, [self.height - INSIDE], indexing="ij"), axis=-1).reshape(-1, 3)
        return bool(np.any([contains(each, points) for each in self.boxes], axis=0).all())


def level_top(part: str, mesh: Mesh, ground: float, thickness: float, config: TopConfig) -> LevelTop | None:
    """Return the top of a support at the height where an object was found to stand; None where that is not level.

    Args:
        part: id of the support.
        mesh: its surface.
        ground: height [m].
        thickness: of the boxes [m].
        config: how.
    """
    height, areas = centroids(mesh)[:, 2], mesh.face_areas
    near = np.flatnonzero((np.abs(height - ground) < config.band) & (normals(mesh)[:, 2] > TILT) & (areas > 0))
    if not len(near):
        return None
    middle = _median(height[near], areas[near])
    flat = near[np.abs(height[near] - middle) <= config.unevenness]
    if areas[flat].sum() < config.level_fraction * areas[near].sum():
        return None
    plane = Plane(np.array([0.0, 0.0, 1.0]), middle, flat)
    boxes = slabs(mesh, plane, config.cell, config.closing, thickness, config.boxes)
    layer = tuple(_raised(each, middle - thickness / 2, config.headroom) for each in boxes)
    return LevelTop(part, middle, tuple(boxes), layer)


def reused(tops: Sequence[LevelTop], part: str, ground: float, band: float) -> LevelTop | None:
    """Return the top of a part that was found before at nearly this height [m]."""
    return next((top for top in tops if top.part == part and abs(top.height - ground) < band), None)


def _raised(hull: Mesh, above: float, height: float) -> Mesh:
    """Return a hull whose vertices above some height are raised [m]."""
    return Mesh(hull.vertices + np.where(hull.vertices[:, 2:] > above, [0.0, 0.0, height], 0.0), hull.faces)


def _median(values: np.ndarray, weights: np.ndarray) -> float:
    """Return the weighted median."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, total[-1] / 2)])


# [m] How far a hull may be off the surface across its faces, and along them: smaller holes are filled. And over which
# fraction of it
OFF, HOLE, NEARLY = 0.02, 0.03, 0.95
SMALLEST, FRAGMENT = 0.15, 0.004  # Size of what is not split further [m], and area of what is left out [m^2]
SPACING = 0.06  # [m] Of the points by which a hull is compared with a surface
MIXED = 0.1  # Fraction of level faces, and of others, from which a piece is split into both
COHERENT = 0.8  # Length of the mean normal from which a piece has a side behind it
DOWN = -0.7  # Vertical component of the normal below which nothing stands on a hull's face, or passes it from above
THIN = 0.1  # Thickness of a hull as a fraction of its width below which it is cut in layers
THINNEST = 0.002  # [m] A thinner layer is not worth a collider


@dataclass(frozen=True, kw_only=True)
class RoomConfig:
    """How the static room becomes convex hulls.

    Attributes:
        resolution: voxels of the decomposition.
    """

    part_hulls: Count = 6  # largest number of hulls of one part
    # the same where those fill air, and hulls that follow the surface replace them; a flat of 100 m^2 has 1600
    surface_hulls: Count = 2000
    min_decomposed_size: NotNegative = 0.4  # parts whose bounding box has a shorter diagonal [m] become one hull
    resolution: Count
    max_vertices: Annotated[int, AtLeast(4)] = 32  # largest number of vertices of a hull
    # words that make a label one of a wall, floor or ceiling; those become thin boxes
    structure_labels: tuple[str, ...] = STRUCTURE_LABELS
    flatness: Positive = 0.02  # largest distance of a wall's surface from its box [m]
    cell: Positive = 0.05  # width of the cells of which a wall's boxes are made [m]
    boxes: Count = 8  # largest number of boxes of each plane of a wall
    thickness: Positive = 0.02  # of those boxes [m]
    base_radius: NotNegative = 0.25  # radius of the upright column around a robot's base that stays free [m]
    base_height: NotNegative = 1.2  # its height [m]
    # what stays free around the paths of the articulated parts [m]. The scan is off by 1 mm and more at curved
    # objects, hulls bulge by as much, and a physics step at 1 m/s is 4 mm
    clearance: NotNegative = 0.003
    # largest number of hulls into which a cut takes one apart. A floor that eight sections of a door's path graze
    # keeps 0.97 of its upper side; 0.90 with 8
    cut_hulls: Count = 12
    # what is left of a hull after cutting counts from this volume on [m^3]. A cube of 2 cm
    min_volume: NotNegative = 8e-06
    # the same for each hull but the largest into which it is taken apart [m^3]. 7 by 7 cm of a floor's box
    min_cut_volume: NotNegative = 0.0001


def part_hulls(part: Part, config: RoomConfig) -> tuple[Collider, ...]:
    """Return the convex hulls of a part of the static room, from the cache where they were made before; part "" owns them."""
    structure = is_structure(part.label, config.structure_labels)
    hulls = recall("room", [part.mesh, repr((structure, config))], lambda: pack(_hulls(part.mesh, structure, config)))
    return tuple(Collider("", each, structure) for each in unpack(hulls))


def cut_out(
    colliders: Sequence[Collider], obstacles: Sequence[Mesh], config: RoomConfig
) -> tuple[tuple[Collider, ...], tuple[str, ...]]:
    """Cut colliders free of obstacles; return them with the ids of the parts of which something was cut off."""
    cut_hulls: list[Collider] = []
    trimmed: dict[str, None] = {}
    for collider in colliders:
        left = cut_all(collider.mesh, obstacles, config.cut_hulls, config.min_volume, config.min_cut_volume)
        if not any(piece is collider.mesh for piece in left):
            trimmed[collider.part] = None
        cut_hulls += [Collider(collider.part, piece, collider.structure) for piece in left]
    return tuple(cut_hulls), tuple(trimmed)


def below_tops(colliders: Sequence[Collider], tops: Sequence[LevelTop], config: RoomConfig) -> list[Collider]:
    """Cut colliders free of the layers of their own part's level tops."""
    cut_hulls: list[Collider] = []
    for collider in colliders:
        layers = [hull for top in tops if top.part == collider.part for hull in top.layer]
        cut_hulls += cut_out([collider], layers, config)[0]
    return cut_hulls


def cut_all(
    hull: Mesh, obstacles: Sequence[Mesh], count: int = 1, min_volume: float = 0.0, min_cut_volume: float = 0.0
) -> list[Mesh]:
    """Return the largest convex parts of a hull that are free of all obstacles, the hull itself where it is free of them.

    `min_volume`: none is left of a cut hull whose largest part is smaller [m^3]; `min_cut_volume` the same for its other parts.
    """
    bounds = np.array([obstacle.bounds for obstacle in obstacles]).reshape(-1, 2, 3)
    apart = ((hull.bounds[0] >= bounds[:, 1]) | (bounds[:, 0] >= hull.bounds[1])).any(axis=1)
    hit = [obstacles[k] for k in np.flatnonzero(~apart).tolist() if overlap(hull, obstacles[k]) > APART]
    if not hit:
        return [hull]
    left = _layers(hull, hit) if count > 1 else [hull]
    for obstacle in hit:
        parts = [part for piece in left for part in cut_free(piece, obstacle, count, min_cut_volume)]
        left = parts if len(parts) <= count else sorted(parts, key=volume, reverse=True)[:count]
    left = sorted(left, key=volume, reverse=True)
    return [part for k, part in enumerate(left) if volume(part) >= (min_cut_volume if k else min_volume)]


def _layers(hull: Mesh, obstacles: Sequence[Mesh]) -> list[Mesh]:
    """Split a thin hull, such as a floor's, below the obstacles that only graze it, so that it gets no hole there."""
    _, _, axes = np.linalg.svd(hull.vertices - hull.vertices.mean(axis=0), full_matrices=False)
    *_, width, thickness = np.ptp(hull.vertices @ axes.T, axis=0)
    if thickness > THIN * width:
        return [hull]
    pieces = [hull]
    for up in (axes[2], -axes[2]):
        above = np.array([(obstacle.vertices @ up).min() for obstacle in obstacles]) - MARGIN
        grazing = above[above > (hull.vertices @ up).min() + THINNEST]
        if len(grazing):
            split = (clip(hull, up, grazing.min()), clip(hull, -up, -grazing.min()))
            pieces = max(pieces, [part for part in split if part is not None], key=len)
    return pieces


def _hulls(mesh: Mesh, structure: bool, config: RoomConfig) -> list[Mesh]:
    """Return thin boxes for a wall; for anything else a few hulls, and where these fill air thin ones that follow the surface."""
    if structure:
        planes = find_planes(mesh, config.flatness, min_area=20 * config.cell**2, count=6)
        boxes = [slabs(mesh, p, config.cell, closing=3, thickness=config.thickness, count=config.boxes) for p in planes]
        return [box for group in boxes for box in group]
    if np.linalg.norm(np.ptp(mesh.bounds, axis=0)) < config.min_decomposed_size:
        return one_hull(mesh, config.max_vertices)
    surface = _Surface.of(mesh)
    hulls = vhacd(mesh, config.part_hulls, config.resolution, config.max_vertices)
    return _sheets(surface, config) if surface.air_in(hulls) else hulls


@dataclass(frozen=True, eq=False)
class _Surface:
    """A scanned surface, to compare hulls with."""

    mesh: Mesh
    tree: RayMesh
    corners: np.ndarray  # of its triangles, shape [face 3 3]

    @classmethod
    def of(cls, mesh: Mesh) -> "_Surface":
        """Return it with its lone vertices merged."""
        whole = weld(mesh)
        return cls(whole, ray_mesh(whole.vertices, whole.faces), whole.vertices[whole.faces].astype(np.float64))

    def air_in(self, solids: Sequence[Mesh]) -> float:
        """Return how much of the outside of hulls, on which something may stand or lean, is off it [m^2]; 0 where little is."""
        air = outside = 0.0
        for k, solid in enumerate(solids):
            facing, area = normals(solid), float(solid.face_areas.sum())
            points, face = sample_with_faces(solid, max(40, int(area / SPACING**2)), 0)
            cell, open_air = area / len(points), facing[face, 2] > DOWN
            for other in (*solids[:k], *solids[k + 1 :]):
                open_air &= ~contains(other, points, -INSIDE)
            points, across = points[open_air], facing[face[open_air]]
            if len(points):
                nearest = self.corners[nearest_faces(self.tree, points)[0]]
                away = points - trimesh.triangles.closest_point(nearest, points)
                off = (np.abs((away * across).sum(axis=1)) > OFF) | (np.linalg.norm(away, axis=1) > HOLE)
                air, outside = air + cell * float(off.sum()), outside + cell * len(points)
        return air if air > (1.0 - NEARLY) * outside else 0.0


def _sheets(surface: _Surface, config: RoomConfig) -> list[Mesh]:
    """Return thin convex hulls that follow a surface: what fills most air is split first, until none does or they are too many.

    A handful of hulls of a bed or of a whole room, in which floor, tables and walls are one surface, stand off it by
    centimetres, and are walls of air across a room.
    """
    number, done, pieces = count(), list[Mesh](), [surface.mesh]
    left: list[tuple[float, int, Mesh]] = []
    while pieces or left:
        for piece in pieces:
            solid = hull(piece.vertices, config.max_vertices)
            small = len(piece.faces) == 1 or np.ptp(piece.bounds, axis=0).max() < SMALLEST
            air = 0.0 if solid is None or small else surface.air_in([solid])
            if air:
                heappush(left, (-air, next(number), piece))
            else:
                done.append(piece)
        if not left or len(left) + len(done) >= config.surface_hulls:
            break
        whole = heappop(left)[2]
        parts = _split(whole)
        pieces = [p for p in parts if p.face_areas.sum() >= FRAGMENT or np.ptp(p.bounds, axis=0).max() >= SMALLEST]
        if (
            whole.face_areas.sum() >= FRAGMENT
        ):  # fragments are left out where little else is near, unlike a plant's leaves
            pieces = pieces or parts
    hulls = [_backed(piece, config) for piece in (*done, *(piece for *_, piece in left))]
    return [each for each in hulls if each is not None]


def _split(piece: Mesh) -> list[Mesh]:
    """Return a surface in parts: its large components and the small ones as one, such as a plant's leaves.

    Of one component level and other faces; of that, and of small ones alone, both halves of the longest side.
    """
    number = components(piece)
    area = np.bincount(number, weights=piece.face_areas)
    large, small = np.flatnonzero(area >= FRAGMENT).tolist(), area[number] < FRAGMENT
    if len(area) > 1 and large:
        return [*(keep(piece, number == k) for k in large), *([keep(piece, small)] if small.any() else [])]
    level = normals(piece)[:, 2] > TILT
    share = float(piece.face_areas[level].sum() / max(piece.face_areas.sum(), 1e-12))
    if len(area) > 1 or not MIXED < share < 1.0 - MIXED:
        at = centroids(piece)[:, int(np.ptp(piece.bounds, axis=0).argmax())]
        level = at < at.mean()
        if level.all() or not level.any():
            level = np.arange(len(at)) < len(at) // 2
    return [keep(piece, level), keep(piece, ~level)]


def _backed(piece: Mesh, config: RoomConfig) -> Mesh | None:
    """Return the hull of a surface and of the same, `thickness` behind it where it has a side that is behind."""
    mean = (normals(piece) * piece.face_areas[:, None]).sum(axis=0) / max(piece.face_areas.sum(), 1e-12)
    behind = piece.vertices - config.thickness * mean * (np.linalg.norm(mean) > COHERENT)
    return hull(np.concatenate([piece.vertices, behind]), config.max_vertices)


class StaticRoom:
    """The static room of a scene; what was made of it once is kept."""

    def __init__(self, scene: Scene, room: RoomConfig, decimate: DecimateConfig) -> None:
        self._scene, self._room, self._decimate = scene, room, decimate
        self._hulls: dict[str, tuple[Collider, ...]] = {}
        self._visuals: dict[tuple[str, ...], Decimated] = {}

    def ahead(self, articulated: Sequence[str]) -> None:
        """Make it as it is if all these parts can be prepared and no object is extracted."""
        static = [i for i, owner in bodies(self._scene, articulated).items() if owner is None]
        self.visual(static)
        self.colliders(static)

    def colliders(self, parts: Sequence[str]) -> list[Collider]:
        """Return the convex hulls of static parts, named after these."""
        colliders = []
        for part in track([i for i in parts if len(self._scene.parts[i].mesh.faces)], "room colliders"):
            if part not in self._hulls:
                self._hulls[part] = part_hulls(self._scene.parts[part], self._room)
            colliders += [Collider(part, hull.mesh, hull.structure) for hull in self._hulls[part]]
        return colliders

    def visual(self, parts: Sequence[str]) -> Decimated:
        """Return static parts as one mesh with fewer faces."""
        key = tuple(parts)
        if key not in self._visuals:
            self._visuals[key] = decimate_room(self._scene, parts, self._decimate)
        return self._visuals[key]
