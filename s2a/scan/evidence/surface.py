"""The scanned surface of a room: viewpoints in its free interior, floor below a base, swept paths of parts."""

from __future__ import annotations

import copy
from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from s2a.core.bounds import Fraction, Positive
from s2a.scene.articulation import displace, open_limit
from s2a.scene.geometry.mesh_ops import merge, normals, sample, sample_with_faces
from s2a.scene.geometry.mesh_query import Forest, RayMesh, first_hits, nearest_faces, ray_mesh, visible_distance
from s2a.scene.scene import Mesh, Scene

GRID = 7  # Candidate viewpoints along each side of the room's box: half a metre apart in a room of four metres
CLEARANCE = 0.2  # [m] A viewpoint has this much free space around it: a scanner's head or a hand-held device
# Fraction of the rays from a place in a room that hit its surface; outside of it most of them hit nothing
ENCLOSED = 0.7
# Fraction of the rays from free space that hit surfaces from one and the same side; the rest are open edges and noise
FACING = 0.9
SAMPLES = 20_000  # Points that stand for the surface
REACH = 30.0  # [m] Longest line of sight


class ScanSurface:
    """The scanned surface of a scene.

    Attributes:
        scene: its parts.
        mesh: all of their surfaces as one mesh [m], in scene coordinates.
        owner: index of the part of each face among `ids`, shape [face].
        ids: ids of the parts.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.ids = tuple(scene.parts)
        meshes = [scene.parts[i].mesh for i in self.ids]
        self.mesh: Mesh = merge([Mesh(mesh.vertices, mesh.faces) for mesh in meshes])
        self.owner = np.repeat(np.arange(len(meshes), dtype=np.int32), [len(mesh.faces) for mesh in meshes])

    def with_scene(self, scene: Scene) -> ScanSurface:
        """Return the same surface with another annotation of joints; the parts and their meshes must be the same."""
        other = copy.copy(self)
        other.scene = scene
        return other

    @cached_property
    def tree(self) -> RayMesh:
        """The whole surface, for rays."""
        return ray_mesh(self.mesh.vertices, self.mesh.faces, compact=True)

    @cached_property
    def samples(self) -> tuple[np.ndarray, np.ndarray]:
        """Points spread evenly over it [m], and the unit normals of their faces, shape [point 3] each."""
        points, faces = sample_with_faces(self.mesh, SAMPLES, 0)
        return points, normals(self.mesh, faces)

    @property
    def viewpoints(self) -> np.ndarray:
        """Places in the room's free interior [m], shape [viewpoint 3]: surface all around, all of it seen from one side."""
        return self._interior[0]

    @property
    def winding(self) -> float:
        """1 if the normals of the faces look into the room, -1 if the whole mesh is wound the other way."""
        return -1.0 if self._interior[1] else 1.0

    @cached_property
    def _interior(self) -> tuple[np.ndarray, bool]:
        """The viewpoints, and True if they see the backs of the faces: the whole mesh is wound the other way.

        Hollow furniture and the space behind walls are excluded: from there surfaces are seen from the other side. Which
        side is the front is decided by the majority of all places.
        """
        low, high = np.quantile(self.samples[0], [0.005, 0.995], axis=0).astype(np.float64)
        steps = (np.arange(GRID) + 0.5) / GRID
        places = low + (high - low) * np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
        distance, behind = self._around(places)
        hit = distance < REACH
        enclosed = (hit.mean(axis=1) > ENCLOSED) & (distance.min(axis=1) > CLEARANCE)
        fraction = (behind & hit).sum(axis=1) / np.maximum(1, hit.sum(axis=1))
        front, back = enclosed & (fraction < 1 - FACING), enclosed & (fraction > FACING)
        backs = bool(back.sum() > front.sum())
        return places[back if backs else front], backs

    def sight(self, start: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the distance of rays to the surface [m], at most REACH, and if they meet it from behind, shape [ray] each.

        `start`: of the rays [m], shape [ray 3]; `direction`: unit directions, shape [ray 3] or [3].
        """
        distance, behind = visible_distance(self.tree, start, direction, REACH)
        return distance, behind != self._interior[1]

    def is_free(self, points: np.ndarray) -> bool:
        """Return True if points [point 3] lie in free space: surface around them, and hardly any of it seen from behind."""
        distance, behind = self._around(points)
        hit = distance < REACH
        inside = ((behind != self._interior[1]) & hit).sum() / max(1, hit.sum())
        return bool(hit.mean() > ENCLOSED and inside < 1.5 * (1 - FACING))

    def _around(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the distance to the surface in all directions from some places [m], and if it is a face's back there."""
        rays = sphere(48)
        starts, directions = np.repeat(places, len(rays), axis=0), np.tile(rays, (len(places), 1))
        distance, behind = visible_distance(self.tree, starts, directions, REACH)
        return distance.reshape(-1, len(rays)), behind.reshape(-1, len(rays))

    def seen(self, points: np.ndarray, normal: np.ndarray, grazing: float = 0.2) -> tuple[float, float]:
        """Return how much is seen of points on a flat surface from its two sides: fractions of the lines of sight.

        Args:
            points: on the surface [m], shape [point 3].
            normal: unit direction that tells the sides apart, shape [3].
            grazing: lines of sight whose incidence has a smaller cosine tell nothing.

        Returns:
            The fraction of all lines of sight to viewpoints on the side of the normal that are free, and the same for
            the other side; 0 where no viewpoint lies on that side.
        """
        views = self.viewpoints
        if not len(points) or not len(views):
            return 0.0, 0.0
        way = views[None] - points[:, None]
        length = np.linalg.norm(way, axis=2)
        way = way / np.maximum(length, 1e-9)[..., None]
        incidence = way @ normal
        oblique = np.abs(incidence) > grazing
        start = (points[:, None] + 0.01 * way)[oblique]
        free = visible_distance(self.tree, start, way[oblique], min(REACH, float(length.max())))[0]
        open_ = np.zeros(length.shape, bool)
        open_[oblique] = free > length[oblique] - 0.02
        sides = []
        for side in (incidence > grazing, incidence < -grazing):
            sides.append(float((open_ & side).sum() / max(1, side.size)))
        return sides[0], sides[1]


def sphere(count: int) -> np.ndarray:
    """Return unit directions spread evenly, shape [count 3], by the golden angle (Fibonacci lattice)."""
    i = np.arange(count) + 0.5
    height, angle = 1 - 2 * i / count, np.pi * (1 + 5**0.5) * i
    around = np.sqrt(1 - height**2)
    return np.stack([around * np.cos(angle), around * np.sin(angle), height], axis=1)


HEAD = 0.3  # [m] From here above the base the floor is looked for
RING = 8  # Places around the base's middle where the floor is looked for, besides the middle
# Directions in which floor is looked for around a hole, how far from the base's middle, and in which steps [m]
SIDES, HOLE_REACH, STEP = 16, 1.0, 0.05
MIN_ENCLOSED = 10  # Sides on which floor or something upright must be seen; the others may show nothing
# [m] Over a hole that counts as floor nothing is up to here above it: a bed or a couch hides floor,
# and a table shades it
HEADROOM = 2.0


@dataclass(frozen=True)
class FloorConfig:
    """When a robot stands on scanned floor."""

    tolerance: Positive = 0.05  # how far the scanned floor may be from the foot of what stands there [m]
    # fraction of its footprint with floor below. Holes below furniture and where the tripod stood are smaller
    # than a base
    min_fraction: Fraction = 0.5


@dataclass(frozen=True)
class FloorSupport:
    """The floor below a base."""

    fraction: float  # of the footprint below which a surface is at the height of its foot, 0 to 1
    scanned: bool  # that is enough of it
    # it is not, but the scan has a mere hole there, which the floor around it closes at the same height
    assumed: bool = False
    sides: int = 0  # number of the SIDES on which that floor is seen; 0 where it was not looked for


def floor_support(
    base: np.ndarray, pedestal: float, radius: float, surface: RayMesh | Forest, config: FloorConfig
) -> FloorSupport:
    """Return the floor below a base, scanned or assumed.

    A hole counts as floor where nothing is scanned above or below the footprint, no surface lies lower within HOLE_REACH,
    and the base is amid the floor around it: floor at the height of its foot is seen, with nothing in between, on sides no
    two neighbours of which are half a turn apart, and floor or something upright on MIN_ENCLOSED of SIDES.

    Args:
        base: position of the base [m], scene coordinates, shape [3].
        pedestal: height of what it stands on [m].
        radius: of the footprint [m].
        surface: everything that was scanned.
        config: bounds.
    """
    angle = np.arange(RING) * 2.0 * np.pi / RING
    ring = radius * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    foot, tolerance = base - [0.0, 0.0, pedestal], config.tolerance
    footprint = np.concatenate([np.zeros((1, 3)), ring])
    heights = _heights(base + footprint + [0.0, 0.0, HEAD], foot[2], surface)
    fraction = float((np.abs(heights) < tolerance).mean())
    if fraction >= config.min_fraction:
        return FloorSupport(fraction, scanned=True)
    heights = _heights(foot + footprint + [0.0, 0.0, HEADROOM], foot[2], surface)
    if (np.isfinite(heights) & (np.abs(heights) >= tolerance)).any():
        return FloorSupport(fraction, scanned=False)
    return FloorSupport(fraction, False, *_floor_around(foot, radius, surface, tolerance))


def _heights(starts: np.ndarray, level: float, surface: RayMesh | Forest) -> np.ndarray:
    """Return how high above a level the first surfaces below some points [point 3] are [m]; -inf where there is none."""
    down = np.tile([0.0, 0.0, -1.0], (len(starts), 1))
    return starts[:, 2] - first_hits(surface, starts, down) - level


def _floor_around(foot: np.ndarray, radius: float, surface: RayMesh | Forest, tolerance: float) -> tuple[bool, int]:
    """Return whether a hole at the foot of a base [3] is amid floor, and on how many sides that is seen."""
    angle = np.arange(SIDES) * 2.0 * np.pi / SIDES
    ways = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    level = np.array([HEAD / 3, HEAD * 2 / 3, HEAD])
    starts = np.repeat(foot + level[:, None] * [0.0, 0.0, 1.0], SIDES, axis=0)
    stop = first_hits(surface, starts, np.tile(ways, (len(level), 1))).reshape(len(level), SIDES).min(axis=0)
    away = np.arange(radius, HOLE_REACH + 1e-6, STEP)
    places = foot + ways[:, None] * away[:, None] + [0.0, 0.0, HEAD]
    heights = _heights(places.reshape(-1, 3), foot[2], surface).reshape(SIDES, -1)
    heights[away >= stop[:, None]] = -np.inf
    lower = np.isfinite(heights) & (heights <= -tolerance)
    floor = (np.abs(heights) < tolerance).sum(axis=1) > 1
    upright = (stop <= HOLE_REACH) | (heights >= tolerance).any(axis=1)
    seen = np.flatnonzero(floor)
    if not len(seen) or lower.any() or (floor | upright).sum() < MIN_ENCLOSED:
        return False, len(seen)
    gaps = np.diff(seen, append=seen[0] + SIDES)
    return bool(gaps.max() < SIDES // 2), len(seen)


POINTS = 600  # Points of a part whose paths are followed
STEPS = 24  # Straight sections of each path: 4 degrees of a quarter turn
# [m] Length of path on which touching the rest tells nothing: ragged borders, seals, and the gap around a part
CONTACT = 0.03
# Sine of 30 degrees: what meets a face at less slides along its surface; axes are off by a few degrees, faces by 20
GRAZING = 0.5


@dataclass(frozen=True)
class Sweep:
    """How far a part gets."""

    blocked: float  # fraction of its points whose path to the open limit runs through the rest of the scan
    # coordinate up to which no more than the tolerated fraction of points is blocked [m] or [rad], not negative
    free: float
    full: float  # coordinate of the open limit, not negative
    # ids of the parts in the way and the fraction of the points that each of them stops, largest first
    obstacles: tuple[tuple[str, float], ...]


def moved_parts(scene: Scene, part: str) -> set[str]:
    """Return the ids of all that moves with a part: its body, and what is jointed to it."""
    return {part, *scene.descendants(part)}


def sweep(surface: ScanSurface, part: str, tolerated: float) -> Sweep:
    """Follow the points of a part from the scanned pose to its open limit through the rest of the scan.

    `tolerated`: fraction of points that may be blocked: noise and ragged borders.
    """
    scene, joint = surface.scene, surface.scene.joint(part)
    mine = moved_parts(scene, part)
    own = merge([Mesh(m.vertices, m.faces) for m in (scene.parts[i].mesh for i in sorted(mine))])
    points, limit = sample(own, POINTS, 0), open_limit(joint)
    if not len(points):
        return Sweep(0.0, abs(limit), abs(limit), ())
    paths = np.stack([displace(points, joint, q) for q in np.linspace(0.0, limit, STEPS + 1)])
    rest = _near(surface, mine, paths)
    if not len(rest):
        return Sweep(0.0, abs(limit), abs(limit), ())
    tree = ray_mesh(surface.mesh.vertices, surface.mesh.faces[rest])
    facing = normals(Mesh(surface.mesh.vertices, surface.mesh.faces[rest]))
    stopped, places = _stops(tree, facing, paths)
    shares = [(stopped <= step).mean() for step in range(STEPS)]
    free = next((step for step, share in enumerate(shares) if share > tolerated), STEPS)
    hit = stopped < STEPS
    face = nearest_faces(tree, places[hit])[0] if hit.any() else np.empty(0, int)
    owners, counts = np.unique(surface.owner[rest[face]], return_counts=True)
    order = np.argsort(-counts)
    obstacles = tuple((surface.ids[owners[i]], float(counts[i] / len(points))) for i in order)
    return Sweep(float(hit.mean()), abs(limit) * free / STEPS, abs(limit), obstacles)


def _near(surface: ScanSurface, mine: Collection[str], paths: np.ndarray) -> np.ndarray:
    """Return the faces of all parts but some that reach into the box around paths [step point 3], as indices, ascending."""
    low, high = paths.min(axis=(0, 1)), paths.max(axis=(0, 1))
    first, chosen = 0, [np.empty(0, np.int64)]
    for part in surface.ids:
        mesh = surface.scene.parts[part].mesh
        if part not in mine and (mesh.bounds[0] <= high).all() and (mesh.bounds[1] >= low).all():
            chosen.append(first + np.flatnonzero(_reaches(mesh, low, high)))
        first += len(mesh.faces)
    return np.concatenate(chosen)


def _reaches(mesh: Mesh, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return which faces of a mesh reach into a box, shape [face]."""
    # A bit for each side of the box: faces beyond one with all corners are outside. A byte a vertex; corners take 72 a face.
    beyond = np.concatenate([mesh.vertices < low, mesh.vertices > high], axis=1)
    outside = np.packbits(beyond, axis=1)[:, 0]
    first, second, third = (outside[mesh.faces[:, k]] for k in range(3))
    return (first & second & third) == 0


def _stops(tree: RayMesh, facing: np.ndarray, paths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the section in which each path first runs into a surface (STEPS: none), shape [point], and where, [point 3].

    Args:
        tree: the rest of the scan.
        facing: unit normals of its faces, shape [face 3].
        paths: of the points [m], shape [step point 3].
    """
    sections = np.diff(paths, axis=0)
    length = np.linalg.norm(sections, axis=2)
    direction = sections / np.maximum(length, 1e-9)[..., None]
    travelled = np.cumsum(length, axis=0) - length
    start = paths[:-1]
    way = visible_distance(tree, start.reshape(-1, 3), direction.reshape(-1, 3), float(length.max()))[0]
    way = way.reshape(length.shape)
    met = (way < 0.999 * length) & (travelled + way > CONTACT)  # a ray without a hit returns its reach, rounded
    places = start[met] + way[met][:, None] * direction[met]
    if len(places):
        met[met] = np.abs(np.einsum("ij,ij->i", facing[nearest_faces(tree, places)[0]], direction[met])) > GRAZING
    first = np.where(met.any(axis=0), met.argmax(axis=0), len(sections))
    index = np.minimum(first, len(sections) - 1), np.arange(paths.shape[1])
    return first, start[index] + way[index][:, None] * direction[index]
