"""A front as a flat region, grown or drawn as a rectangle, and the joints that it may have."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from s2a.annotate.surface import SplitSurface, connected
from s2a.core.bounds import Positive
from s2a.scan.predictions import USUAL_RANGE
from s2a.scene.geometry.mesh_ops import weighted_quantile
from s2a.scene.geometry.planes import fit_plane, plane_axes
from s2a.scene.scene import Joint

START = 0.08  # [m] Faces within this distance of the clicked place make the first plane
ROUNDS = 3  # Times a plane is fitted to what grew from it
BESIDE = 0.05  # [m] Faces whose middles lie so far beside a rectangle may cross its sides
ALIGNED = 0.6  # Cosine between a face of a front and its plane, at least
TRIM = 0.01  # Fraction of a region's area beyond each side of its rectangle: ragged ends


@dataclass(frozen=True)
class GrowConfig:
    """How a region grows."""

    # largest distance of a face's middle from the plane [m]. A phone's mesh is smoothed, and waves by 5 mm
    distance: Positive = 0.015
    angle: Positive = 30.0  # largest angle between a face and the plane [deg]. Noise tilts small faces
    # largest angle between two faces that share an edge [deg]. A phone rounds edges over several triangles
    edge: Positive = 25.0
    # largest difference of a face's colour from the region's, Euclidean in RGB. Shadows differ by 30,
    # neighbouring furniture by 80 and more
    color: Positive = 60.0
    # how far behind the plane faces inside of a rectangle belong to it [m]. Sides of a front that a scan shows
    thickness: Positive = 0.03


@dataclass(frozen=True, eq=False)
class FrontRegion:
    """A flat piece of a surface and the rectangle around it."""

    normal: np.ndarray  # unit, to the side that its faces look to, shape [3]
    center: np.ndarray  # middle of the rectangle, on the plane [m], shape [3]
    axes: np.ndarray  # directions of the rectangle's sides as columns: the first level, shape [3 2]
    size: np.ndarray  # lengths of its sides along `axes` [m], shape [2]
    faces: np.ndarray  # numbers of its faces, sorted

    @property
    def offset(self) -> float:
        """normal.x on the plane [m]."""
        return float(self.normal @ self.center)

    @property
    def corners(self) -> np.ndarray:
        """Corners of the rectangle [m], around it, shape [4 3]."""
        signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / 2
        return np.asarray(self.center + (signs * self.size) @ self.axes.T)

    def local(self, points: np.ndarray) -> np.ndarray:
        """Return points [point 3] from the centre along the two sides and the normal [m], shape [point 3]."""
        return np.asarray((points - self.center) @ np.column_stack([self.axes, self.normal]))

    def sides(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return the middle of each side and its outward direction: right, left, top, bottom as seen from the room."""
        outward = [sign * self.axes[:, k] for k in (0, 1) for sign in (1.0, -1.0)]
        return [(self.center + way * self.size[i // 2] / 2, way) for i, way in enumerate(outward)]


def grow(surface: SplitSurface, face: int, config: GrowConfig) -> FrontRegion:
    """Return the flat region around a face: connected faces near one plane, no sharp edge and no other colour between."""
    near = np.linalg.norm(surface.centroids - surface.centroids[face], axis=1) < START
    like = near & (surface.normals @ surface.normals[face] > np.cos(np.radians(config.angle)))
    faces = surface.component(np.array([face]), like)
    color = np.median(surface.face_colors[faces], axis=0)
    for _ in range(ROUNDS):
        normal, offset = _plane(surface, faces)
        wider = _grown(surface, face, normal, offset, color, config)
        if not len(wider):
            break
        faces, color = wider, np.median(surface.face_colors[wider], axis=0)
    return around(surface, np.union1d(faces, [face]))


def grow_most(surface: SplitSurface, faces: np.ndarray, config: GrowConfig) -> FrontRegion:
    """Return the flat region around one of some faces, on whose plane most of them lie.

    A handle, or an edge that a phone has rounded, can lie at the middle of a rectangle and is another plane than the front.

    `faces`: that a rectangle shows, evenly spread; of two equal regions the one of the first face is taken.
    """
    best, most, grown = None, -1, np.empty(0, int)
    for face in faces:
        if face in grown:
            continue
        candidate = grow(surface, int(face), config)
        grown = np.union1d(grown, candidate.faces)
        near = np.abs(surface.centroids[faces] @ candidate.normal - candidate.offset) < config.distance
        near &= surface.normals[faces] @ candidate.normal > np.cos(np.radians(config.angle))
        if near.sum() > most:
            best, most = candidate, int(near.sum())
    assert best is not None
    return best


def around(surface: SplitSurface, faces: np.ndarray) -> FrontRegion:
    """Return faces as a region: the plane through them, and the rectangle around them but for ragged ends."""
    normal, offset = _plane(surface, faces)
    points = surface.centroids[faces]
    axes = rectangle_axes(normal, points)
    areas = surface.areas[faces]
    flat = points @ axes
    low, high = (np.array([weighted_quantile(flat[:, k], areas, q) for k in (0, 1)]) for q in (TRIM, 1 - TRIM))
    center = axes @ (low + high) / 2 + normal * offset
    return FrontRegion(normal, center, axes, np.maximum(high - low, 1e-3), np.sort(faces))


def rectangle_axes(normal: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the directions of a rectangle's sides across a normal [3 2], the first level; of a level one by its points."""
    return np.asarray(plane_axes(normal, points)[:, :2])


def cut_out(
    surface: SplitSurface, region: FrontRegion, config: GrowConfig
) -> tuple[SplitSurface, FrontRegion, np.ndarray]:
    """Split the triangles that cross the sides of a region's rectangle; return the region of all faces inside of it.

    Returns:
        The surface, the region, and for each appended face the face that it was cut from.
    """
    near = np.flatnonzero(_inside(surface, region, BESIDE, config))
    parents = np.empty(0, int)
    for middle, outward in region.sides():
        first = len(surface.faces)
        surface, parent = surface.split(near, outward, float(outward @ middle))
        near = np.concatenate([near, first + np.flatnonzero(np.isin(parent, near))])
        parents = np.concatenate([parents, parent])
    return surface, replace(region, faces=np.flatnonzero(_inside(surface, region, 0.0, config))), parents


def inside(surface: SplitSurface, region: FrontRegion, distance: float) -> np.ndarray:
    """Return the faces whose middles lie in a region's rectangle, nearer to its plane than [m], and facing as it does."""
    place = region.local(surface.centroids)
    flat = (np.abs(place[:, :2]) < region.size / 2).all(axis=1) & (np.abs(place[:, 2]) < distance)
    return np.flatnonzero(flat & (surface.normals @ region.normal > ALIGNED))


def _inside(surface: SplitSurface, region: FrontRegion, margin: float, config: GrowConfig) -> np.ndarray:
    """Return which faces lie within a region's rectangle, widened by a margin [m], near its plane and not turned away."""
    place = region.local(surface.centroids)
    flat = (np.abs(place[:, :2]) < region.size / 2 + margin).all(axis=1)
    deep = (place[:, 2] > -config.thickness) & (place[:, 2] < config.thickness)
    return flat & deep & (surface.normals @ region.normal > 0.1)


def _plane(surface: SplitSurface, faces: np.ndarray) -> tuple[np.ndarray, float]:
    """Return normal and offset of the plane through faces."""
    areas = np.maximum(surface.areas[faces], 1e-12)
    mean = np.average(surface.normals[faces], axis=0, weights=areas)
    if len(faces) < 4:
        normal = mean / max(float(np.linalg.norm(mean)), 1e-12)
        return normal, float(normal @ np.average(surface.centroids[faces], axis=0, weights=areas))
    return fit_plane(surface.centroids[faces], areas, mean)


def _grown(
    surface: SplitSurface, face: int, normal: np.ndarray, offset: float, color: np.ndarray, config: GrowConfig
) -> np.ndarray:
    """Return the faces that are connected to one through faces near a plane and of one colour, with no sharp edge between."""
    allowed = np.abs(surface.centroids @ normal - offset) < config.distance
    allowed &= surface.normals @ normal > np.cos(np.radians(config.angle))
    allowed &= np.linalg.norm(surface.face_colors - color, axis=1) < config.color
    allowed[face] = True
    some = np.flatnonzero(allowed)
    pairs = surface.adjacent(some)
    facing = surface.normals[some]
    flat = np.einsum("ij,ij->i", facing[pairs[:, 0]], facing[pairs[:, 1]]) > np.cos(np.radians(config.edge))
    number = connected(pairs[flat], len(some))
    return np.asarray(some[number == number[np.searchsorted(some, face)]])


Direction = Literal["out", "right", "left", "up", "down"]
DIRECTIONS: tuple[Direction, ...] = ("out", "right", "left", "up", "down")
NEAR_SIDE = 0.06  # [m] Picked points this near to a side mean that side


def slide(region: FrontRegion, direction: Direction = "out") -> Joint:
    """Return the slide of a front: out of its plane by a usual drawer's travel, or along a side by its own length."""
    if direction == "out":
        return _joint("prismatic", region.normal, region.center, USUAL_RANGE["translation"])
    k, sign = (0 if direction in ("right", "left") else 1), (1.0 if direction in ("right", "up") else -1.0)
    return _joint("prismatic", sign * region.axes[:, k], region.center, float(region.size[k]))


def hinge(region: FrontRegion, points: np.ndarray) -> Joint:
    """Return the hinge of a front from picked points: along the side that is near, or else along the line through two.

    It opens to the side to which the front looks.

    `points`: one or two points [m], shape [point 3].

    Raises:
        ValueError: two points at one place.
    """
    points = points - np.outer((points - region.center) @ region.normal, region.normal)
    nearest = [side(region, point) for point in points]
    if len(points) == 1 or (nearest[0][0] == nearest[1][0] and max(gap for _, gap in nearest) < NEAR_SIDE):
        return hinge_at(region, nearest[0][0])
    along = points[1] - points[0]
    length = float(np.linalg.norm(along))
    if length < 1e-3:
        raise ValueError("both points are at one place; pick two ends of the edge")
    return _hinge(region, points.mean(axis=0), along / length)


def hinge_at(region: FrontRegion, index: int) -> Joint:
    """Return the hinge along a side of a front: 0 right, 1 left, 2 top, 3 bottom, as seen from the room."""
    return _hinge(region, region.sides()[index][0], region.axes[:, 1 - index // 2])


def side(region: FrontRegion, point: np.ndarray) -> tuple[int, float]:
    """Return the side of a front that is nearest to a point [3], and its distance in the plane [m]."""
    x, y = region.local(point[None])[0, :2]
    half = region.size / 2
    gaps = [
        np.hypot(place - end, max(abs(other) - half[1 - k], 0.0))
        for k, place, other in ((0, x, y), (1, y, x))
        for end in (half[k], -half[k])
    ]
    return int(np.argmin(gaps)), float(min(gaps))


def _hinge(region: FrontRegion, origin: np.ndarray, along: np.ndarray) -> Joint:
    opens = float(np.cross(along, region.center - origin) @ region.normal)
    return _joint("revolute", along if opens >= 0 else -along, origin, USUAL_RANGE["rotation"])


def _joint(kind: Literal["prismatic", "revolute"], axis: np.ndarray, origin: np.ndarray, limit: float) -> Joint:
    unit = axis / np.linalg.norm(axis)
    return Joint(kind, tuple(unit.tolist()), tuple(origin.tolist()), (0.0, limit))
