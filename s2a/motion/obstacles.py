"""Obstacles of a robot: the solid hulls of a simulation-ready room, or the surfaces of a scan; and rests of objects on them."""

from __future__ import annotations

import copy
import itertools
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import trimesh
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from s2a.robot.collision import Penetration, base_solids
from s2a.robot.spec import DriveSpec
from s2a.scene.articulation import pose_at
from s2a.scene.geometry.convex import contains
from s2a.scene.geometry.mesh_query import Forest, first_hits, nearest_faces, nearest_meshes, ray_mesh
from s2a.scene.scene import Mesh, Scene
from s2a.scene.usd.sim_scene import SimRoom, in_scene

RADIUS = 2.0  # [m] About a place: what is farther away is out of every arm's reach
INSIDE = 0.3  # [m] Up to which depth a center within a solid is noticed
# [m] Between points on a body's surface at least, and how many there are, about, on a large one
FINEST, MOST = 0.015, 120
COVERED = 1e-3  # [m] Deeper within one of its hulls no point is needed
FOOT = 0.01  # [m] Above an object's lowest point, up to which it stands on its support
# Of a support that is not level, as scanned ones are: [m] between points at which its height is looked up, below an
# object's resting plane down to which its feet may find it, and from that plane, up to which a point carries
CELL, SAG, TOUCH = 0.01, 0.02, 0.002
# [rad] By which an object may lean on it, and by which it can be turned about each side of what carries it before it
# falls over
LEAN, STEADY = 0.1, 0.15

BASE = "its base"  # Name of the robot's own base among obstacles
Named = tuple[str, Mesh]  # Id of the part that a mesh belongs to, and the mesh in the scene frame


class Obstacles:
    """Named meshes, and an upright column such as a pedestal; there may be none of either.

    Attributes:
        names: ids of the parts that the meshes belong to.
        meshes: in the scene frame, in the same order.
        is_solid: the meshes are closed convex hulls: what is within one is in it. Else they are surfaces, and what moves in
            small steps meets them as it would a solid.
        lookups: spheres that were compared with them so far, a measure of work that is the same on every machine.
    """

    def __init__(self, named: Sequence[Named], *, solid: bool) -> None:
        self.names, self.meshes = [name for name, _ in named], [mesh for _, mesh in named]
        self.is_solid, self.lookups = solid, 0
        self._column: tuple[np.ndarray, float] | None = None
        self._tree: _Solids | _Surfaces = _Solids(self.meshes) if solid else _Surfaces(self.meshes)

    @classmethod
    def of_room(cls, room: SimRoom, without: Collection[str], about: np.ndarray) -> Obstacles:
        """Return the collision hulls of a room within RADIUS of a point [3], but for those of some bodies."""
        named = [
            (collider.part, Mesh(in_scene(body, collider.mesh), collider.mesh.faces))
            for body in (*room.bodies.values(), *room.free.values())
            if body.id not in without
            for collider in body.colliders
        ]
        named = [each for each in (*named, *((c.part, c.mesh) for c in room.static_colliders)) if len(each[1].faces)]
        low, high = np.stack([mesh.bounds for _, mesh in named], axis=1) if named else np.zeros((2, 0, 3))
        near = np.linalg.norm(np.clip(about, low, high) - about, axis=1) <= RADIUS
        return cls([*itertools.compress(named, near)], solid=True)

    @classmethod
    def of_scan(cls, scene: Scene, about: np.ndarray, radius: float) -> Obstacles:
        """Return the surfaces of a scan's parts that reach into a square of half this width [m] about a point, seen from above.

        Their search trees are built once, however often a part is an obstacle.
        """
        parts = [(i, part.mesh) for i, part in scene.parts.items() if _is_beside(part.mesh, about[:2], radius)]
        return cls(parts, solid=False)

    @property
    def surface(self) -> Forest:
        """The surfaces of a scan as one, for rays."""
        assert isinstance(self._tree, _Surfaces)
        return self._tree.forest

    def without(self, parts: Collection[str]) -> Obstacles:
        """Return those that belong to other parts, and the column."""
        left = Obstacles(
            [(n, m) for n, m in zip(self.names, self.meshes, strict=True) if n not in parts], solid=self.is_solid
        )
        left._column = self._column
        return left

    def with_column(self, top: np.ndarray, height: float, radius: float) -> Obstacles:
        """Return the same with an upright column [m] from the floor to a point [3]; one of no height is none."""
        more = copy.copy(self)
        more._column = (top, radius) if height > 0.0 else None
        return more

    def with_base(self, drive: DriveSpec, pose: np.ndarray, height: float) -> Obstacles:
        """Return the same with a base that drives, its arm's root link at a pose [4 4], so high above the floor [m]."""
        box, column = base_solids(drive)
        back = [*drive.mount[:2], height]
        own = [(BASE, np.asarray(box.vertices) - back, box.faces), (BASE, np.asarray(column.vertices), column.faces)]
        named = [(name, Mesh(points @ pose[:3, :3].T + pose[:3, 3], np.asarray(faces))) for name, points, faces in own]
        return Obstacles([*zip(self.names, self.meshes, strict=True), *named], solid=self.is_solid)

    def hulls_of(self, part: str) -> list[Mesh]:
        """Return the meshes that belong to a part."""
        return [mesh for mesh, name in zip(self.meshes, self.names, strict=True) if name == part]

    def depth(self, centers: np.ndarray, radii: np.ndarray) -> np.ndarray:
        """Return how deep spheres [... sphere 3] of radii [sphere] reach into them [m], shape [...]; 0 where they are clear."""
        shape = centers.shape[:-1]
        each, _ = self._depths(
            centers.reshape(-1, 3), np.broadcast_to(radii, shape).ravel(), float(radii.max(initial=0.0))
        )
        return np.clip(each.reshape(shape), 0.0, None).max(axis=-1, initial=0.0)

    def deepest(self, centers: np.ndarray, radii: np.ndarray) -> Penetration:
        """Return how deep spheres [... sphere 3] of radii [sphere] reach into them [m] (0: not at all), and into which."""
        if not centers.size:
            return 0.0, ""
        flat = np.broadcast_to(radii, centers.shape[:-1]).ravel()
        each, owner = self._depths(centers.reshape(-1, 3), flat, float(radii.max()))
        k = int(np.argmax(each))
        if each[k] <= 0.0:
            return 0.0, ""
        return float(each[k]), self.names[owner[k]] if owner[k] >= 0 else "its pedestal"

    def below(self, points: np.ndarray) -> tuple[np.ndarray, list[str]]:
        """Return the heights of the first surfaces below points [point 3] [m], -inf for none, and the parts they are of."""
        if not self.meshes:
            return np.full(len(points), -np.inf), [""] * len(points)
        drop = first_hits(self._tree.rays, points, np.broadcast_to([0.0, 0.0, -1.0], points.shape))
        hit = np.isfinite(drop)
        owner = self._tree.owners(points - np.where(hit, drop, 0.0)[:, None] * [0.0, 0.0, 1.0])
        return np.where(hit, points[:, 2] - drop, -np.inf), [self.names[k] for k in owner]

    def in_column(self, place: np.ndarray, low: float, high: float, radius: float) -> str | None:
        """Return which part reaches into an upright column between two heights [m] about a place (x, y); None: none does."""
        steps = np.arange(low, high, radius / 2)
        axis = np.concatenate([np.tile(place, (len(steps), 1)), steps[:, None]], axis=1)
        depth, owner = self.deepest(axis, np.full(len(axis), radius))
        return owner if depth > 0.0 else None

    def _depths(self, centers: np.ndarray, radii: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Return how deep each sphere reaches into the nearest mesh, or the column [m], and its index (-1: the column)."""
        self.lookups += len(centers)
        owner, gap = self._tree.nearest(centers, reach)
        depth = np.where(owner >= 0, radii - gap, 0.0)
        if self._column is not None:
            top, radius = self._column
            beside = np.linalg.norm(centers[:, :2] - top[:2], axis=1) - radius
            into = radii - np.linalg.norm(np.maximum([beside, centers[:, 2] - top[2]], 0.0), axis=0)
            owner, depth = np.where(into > depth, -1, owner), np.maximum(into, depth)
        return depth, owner


class _Solids:
    """Convex hulls as one search tree."""

    def __init__(self, meshes: Sequence[Mesh]) -> None:
        first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
        vertices = np.concatenate([np.zeros((0, 3)), *(np.asarray(mesh.vertices, float) for mesh in meshes)])
        faces = np.concatenate(
            [np.zeros((0, 3), int), *(np.asarray(m.faces) + k for m, k in zip(meshes, first, strict=False))]
        )
        corners = vertices[faces]
        self._corner = corners[:, 0]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self._normal = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
        self._owner = np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes])
        self.rays = ray_mesh(vertices, faces) if len(faces) else None

    def nearest(self, points: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the hull nearest to each point (-1: none within reach), and its distance, below 0 within it [m].

        A point within a convex hull is as far behind the plane of the nearest face as from the face; one outside is before that
        plane or, past an edge, in it.
        """
        if self.rays is None:
            return np.full(len(points), -1), np.full(len(points), np.inf)
        face, gap = nearest_faces(self.rays, points, reach, INSIDE)
        before = np.einsum("pi,pi->p", points - self._corner[face], self._normal[face])
        return np.where(face >= 0, self._owner[face], -1), np.where(before < -0.5 * gap, -gap, gap)

    def owners(self, points: np.ndarray) -> np.ndarray:
        """Return the hull whose surface is nearest to each point."""
        assert self.rays is not None
        return self._owner[nearest_faces(self.rays, points)[0]]


class _Surfaces:
    """Surfaces, each with a search tree that other sets of obstacles share."""

    def __init__(self, meshes: Sequence[Mesh]) -> None:
        self.forest = self.rays = Forest(meshes)
        self._is_empty = not meshes

    def nearest(self, points: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the mesh nearest to each point (-1: none within reach), and its distance [m]."""
        if self._is_empty:
            return np.full(len(points), -1), np.full(len(points), np.inf)
        return nearest_meshes(self.forest, points, reach=reach)

    def owners(self, points: np.ndarray) -> np.ndarray:
        """Return the mesh that is nearest to each point."""
        return nearest_meshes(self.forest, points, reach=100.0)[0]


def _is_beside(mesh: Mesh, place: np.ndarray, radius: float) -> bool:
    """Return True if the bounding box of a surface meets the square of half this width [m] around a place (x, y)."""
    if not len(mesh.faces):
        return False
    return bool((mesh.bounds[0, :2] <= place + radius).all() and (mesh.bounds[1, :2] >= place - radius).all())


def moved_room(room: SimRoom, part: str, q: float, free: Mapping[str, np.ndarray]) -> SimRoom:
    """Return a room with a part, and what hangs on it, at a coordinate, and free objects at poses (7-vectors)."""
    joint, bodies = room.articulations[part].joint, dict(room.bodies)
    for i, body in bodies.items():
        if i == part or (i in room.articulations and part in room.carriers(i)):
            at = pose_at(joint, np.array([*body.position, *body.orientation]), q)
            bodies[i] = replace(body, position=tuple(at[:3]), orientation=tuple(at[3:]))
    objects = dict(room.free)
    for i, at in free.items():
        objects[i] = replace(objects[i], position=tuple(at[:3]), orientation=tuple(at[3:]))
    return replace(room, bodies=bodies, free=objects)


def surface_points(hulls: Sequence[Mesh]) -> np.ndarray:
    """Return points all over the union of hulls [point 3], its corners and edges too, for a body that is tested as small spheres.

    Random points left out the corners, by which a wide object was torn from the gripper as it passed a headboard.
    """
    meshes = [trimesh.convex.convex_hull(np.asarray(h.vertices, float)) for h in hulls]
    apart = max(FINEST, float(np.sqrt(sum(mesh.area for mesh in meshes) / MOST)))
    finer = [trimesh.remesh.subdivide_to_size(m.vertices, m.faces, apart, max_iter=20)[0] for m in meshes]
    points = np.concatenate([*(mesh.vertices for mesh in meshes), *finer])
    # Of those that lie in the same cell, one; corners come first.
    _, first = np.unique(np.floor(points / (apart / 2)).astype(int), axis=0, return_index=True)
    points = points[np.sort(first)]
    return points[~np.any([contains(hull, points, -COVERED) for hull in hulls], axis=0)]


def uneven_rests(
    near: Obstacles, support: str, bottom: Mesh, center: np.ndarray, candidates: np.ndarray, top: float
) -> Iterator[tuple[int, Rotation, float]]:
    """Yield at which of some places an object rests steadily on a support, how it leans, and how high its origin is [m].

    Args:
        near: what is around, without the object.
        support: id of the support.
        bottom: hulls of the object about its origin, turned as they stand.
        center: of its mass, likewise [m], shape [3].
        candidates: places of a grid whose width is a multiple of CELL, the first one the least, shape [spot 2].
        top: height above all of the support [m].
    """
    low, high = (np.floor(f(bottom.vertices[:, :2], axis=0) / CELL).astype(int) for f in (np.min, np.max))
    cells = np.stack(np.meshgrid(*[np.arange(low[k], high[k] + 2) for k in range(2)], indexing="ij"), -1).reshape(-1, 2)
    start = np.c_[cells * CELL, np.full(len(cells), bottom.vertices[:, 2].min() - 1.0)]
    under = start[:, 2] + first_hits(
        ray_mesh(bottom.vertices, bottom.faces), start, np.tile([0.0, 0.0, 1.0], (len(cells), 1))
    )
    cells, under = cells[np.isfinite(under)], under[np.isfinite(under)]
    feet = under <= under.min(initial=np.inf) + FOOT
    if not len(candidates) or feet.sum() < 3:
        return
    # Feet and the cells about them: as for what stands level, the support goes on a little beyond its outline.
    about = np.mgrid[-1:2, -1:2].reshape(2, -1).T
    beside = np.unique((cells[feet][:, None] + about).reshape(-1, 2), axis=0)
    index = np.round((candidates - candidates[0]) / CELL).astype(int)
    size = np.ptp(index, axis=0) + np.ptp(cells, axis=0) + 3
    corner = cells.min(axis=0) - 1
    first = candidates[0] + CELL * corner
    grid = np.stack(np.meshgrid(*[first[k] + CELL * np.arange(size[k]) for k in range(2)], indexing="ij"), axis=-1)
    height, names = near.below(np.c_[grid.reshape(-1, 2), np.full(grid[..., 0].size, top)])
    height, own = height.reshape(size), np.array([n == support for n in names]).reshape(size)
    for k, at in enumerate(index - corner):
        ground = height[tuple((at + beside).T)] - under.min()
        if not np.isfinite(ground).all() or np.ptp(ground) > SAG + 2 * LEAN * CELL * np.ptp(beside):
            continue
        x, y = (at + cells).T
        rest = _rest(CELL * cells, height[x, y] - under, own[x, y], center - [0.0, 0.0, under.min()])
        if rest is not None and (CELL * beside @ rest[1] + rest[2] - ground).max() <= SAG:
            yield k, rest[0], rest[2]


def _rest(
    cells: np.ndarray, height: np.ndarray, own: np.ndarray, center: np.ndarray
) -> tuple[Rotation, np.ndarray, float] | None:
    """Return how an object leans, its slopes [2], and how high its origin is [m]; None: it does not rest steadily.

    It comes to rest on the three points around its centre of mass that carry it highest.

    Args:
        cells: points below the object from its origin [m], shape [point 2].
        height: of the support there, above the object's underside as its origin is at zero [m], shape [point].
        own: True where that is the support's, shape [point].
        center: of mass from the origin's projection on the underside [m], shape [3].
    """
    there = np.isfinite(height)
    cells, height, own = cells[there], height[there], own[there]
    level = float(height.max())
    slope = np.zeros(2)
    if np.ptp(height) > 0.0:
        try:
            sides = ConvexHull(np.c_[cells, height]).equations
        except QhullError:
            return None
        sides = sides[sides[:, 2] > 1e-6]
        planes = np.c_[-sides[:, :2], -sides[:, 3]] / sides[:, 2:3]  # slopes along x and y, and height at the origin
        slope_x, slope_y, level = planes[(planes[:, :2] @ center[:2] + planes[:, 2]).argmin()]
        slope = np.array([slope_x, slope_y])
    carrying = cells @ slope + level - height <= TOUCH
    if np.linalg.norm(slope) > LEAN or not own[carrying].all():
        return None
    try:
        polygon = ConvexHull(cells[carrying]).equations
    except (QhullError, ValueError):
        return None
    inside = -(polygon[:, :2] @ (center[:2] - center[2] * slope) + polygon[:, 2])
    if inside.min() < math.tan(STEADY) * center[2]:
        return None
    normal = np.array([-slope[0], -slope[1], 1.0])
    axis = np.cross([0.0, 0.0, 1.0], normal)
    length = np.linalg.norm(axis)
    return Rotation.from_rotvec(axis / max(length, 1e-12) * math.atan(length)), slope, float(level)
