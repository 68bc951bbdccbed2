"""Two scans as registration needs them: samples with normals, the motion between their frames, and what changed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from s2a.scene.geometry.mesh_ops import TriangleSurface
from s2a.scene.geometry.mesh_query import RayMesh, nearest_faces, ray_mesh
from s2a.scene.geometry.occupancy import connected_cells


@dataclass(frozen=True, eq=False)
class OrientedMesh(TriangleSurface):
    """A triangle mesh with normals towards free space."""

    @cached_property
    def tree(self) -> RayMesh:
        """For closest points and rays."""
        return ray_mesh(self.vertices, self.faces)

    def moved(self, motion: np.ndarray) -> OrientedMesh:
        """Return the surface after a rigid motion, shape [4 4]."""
        return OrientedMesh(self.vertices @ motion[:3, :3].T + motion[:3, 3], self.faces)

    def sample(self, count: int, seed: int = 0, among: np.ndarray | None = None) -> Cloud:
        """Return random points, evenly spread over the area. `among`: indices of the faces to take, or None for all."""
        among = np.arange(len(self.faces)) if among is None else among
        rng = np.random.default_rng(seed)
        weights = self.areas[among]
        chosen = among[rng.choice(len(among), count, p=weights / weights.sum())]
        a, b, c = np.moveaxis(self.vertices[self.faces[chosen]], 1, 0)
        u, v = rng.uniform(size=(2, count, 1))
        u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
        return Cloud(a + u * (b - a) + v * (c - a), self.normals[chosen], chosen)


@dataclass(frozen=True, eq=False)
class Cloud:
    """Points on a surface."""

    points: np.ndarray  # [m], shape [point 3]
    normals: np.ndarray  # unit, shape [point 3]
    faces: np.ndarray  # the face of the surface that each lies on, shape [point]

    def __getitem__(self, some: np.ndarray) -> Cloud:
        """Return some of the points, by a mask or by indices."""
        return Cloud(self.points[some], self.normals[some], self.faces[some])

    def __len__(self) -> int:
        return len(self.points)

    def moved(self, motion: np.ndarray) -> Cloud:
        """Return the points after a rigid motion, shape [4 4]."""
        return Cloud(self.points @ motion[:3, :3].T + motion[:3, 3], self.normals @ motion[:3, :3].T, self.faces)


@dataclass(frozen=True, eq=False)
class Matches:
    """Where the points of a cloud meet a surface."""

    face: np.ndarray  # nearest face of each point, -1 where none is within reach, shape [point]
    gap: np.ndarray  # distance to it [m], inf without one
    offset: np.ndarray  # distance from its plane, positive on the side of its normal [m]
    normal: np.ndarray  # its unit normal, shape [point 3]
    alike: np.ndarray  # cosine between the normals of point and face; -1 without a match

    @property
    def inner(self) -> np.ndarray:
        """Mask of the points that meet the surface itself, not its border: most of the gap is along the normal."""
        return (self.face >= 0) & (self.gap**2 - self.offset**2 < 0.003**2 + 0.1 * self.gap**2)


def match(cloud: Cloud, surface: OrientedMesh, reach: float) -> Matches:
    """Return the faces of a surface that are nearest to points, within reach [m]."""
    face, gap = nearest_faces(surface.tree, cloud.points, reach)
    normal, centre = surface.normals[face], surface.centroids[face]
    offset = np.einsum("ij,ij->i", normal, cloud.points - centre)
    alike = np.where(face < 0, -1.0, np.einsum("ij,ij->i", normal, cloud.normals))
    return Matches(face, gap.astype(np.float64), offset, normal, alike)


# [m] Surface that lies farther from the other scan than this has changed; noise of both is 2 to 3 mm each
CHANGED = 0.012
REACH = 0.3  # [m] Distances from the other scan beyond this are all the same
SPACING = 0.013  # [m] Mean distance of the samples
FLAT = 0.006  # [m] Points of a patch are not farther from its plane
TILT = 0.92  # Cosine between a patch's normal and those of its points, at least
CELL = 0.03  # [m] Patches with a wider gap between them are two
MIN_AREA = 0.012  # [m^2] Smaller patches are none
DRAWS, SEED = 60, 0  # Planes that are tried for each patch


@dataclass(frozen=True, eq=False)
class Patch:
    """A flat piece of changed surface."""

    cloud: Cloud  # its samples
    normal: np.ndarray  # unit, shape [3]
    centre: np.ndarray  # mean of its samples [m], shape [3]
    area: float  # [m^2]


def changed(surface: OrientedMesh, mask: np.ndarray) -> Cloud:
    """Return samples of the faces that the other scan does not show, by a mask [face], SPACING apart."""
    faces = np.flatnonzero(mask)
    area = float(surface.areas[faces].sum())
    if area < MIN_AREA:
        return Cloud(np.empty((0, 3)), np.empty((0, 3)), np.empty(0, int))
    return surface.sample(int(area / SPACING**2) + 1, SEED, faces)


def patches(cloud: Cloud) -> list[Patch]:
    """Return the flat patches of samples, the largest planes first."""
    flats: list[Patch] = []
    rng = np.random.default_rng(SEED)
    min_samples = int(MIN_AREA / SPACING**2)
    rest = cloud
    while len(rest) >= min_samples:
        members = _best_plane(rest, rng)
        if len(members) < min_samples:
            break
        flats += connected(rest[members], min_samples)
        rest = rest[np.delete(np.arange(len(rest)), members)]
    return flats


def _best_plane(cloud: Cloud, rng: np.random.Generator) -> np.ndarray:
    """Return the indices of the points on the best of some planes that are drawn around single points."""
    tree = cKDTree(cloud.points)
    best = np.empty(0, int)
    for seed in rng.integers(len(cloud), size=DRAWS):
        near = np.array(tree.query_ball_point(cloud.points[seed], 0.05))
        near = near[cloud.normals[near] @ cloud.normals[seed] > 0.8]
        normal = cloud.normals[near].mean(axis=0)
        length = np.linalg.norm(normal)
        if len(near) < 6 or length < 0.8:
            continue
        members = _on_plane(cloud, normal / length, cloud.points[near].mean(axis=0))
        best = members if len(members) > len(best) else best
    if len(best):
        normal, centre = plane(cloud.points[best], cloud.normals[best])
        best = _on_plane(cloud, normal, centre)
    return best


def _on_plane(cloud: Cloud, normal: np.ndarray, centre: np.ndarray) -> np.ndarray:
    flat = np.abs((cloud.points - centre) @ normal) < FLAT
    return np.flatnonzero(flat & (cloud.normals @ normal > TILT))


def plane(points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the normal [3] and a point [3] of the plane through points with normals, shape [point 3] each."""
    centre = points.mean(axis=0)
    normal = np.linalg.svd(points - centre, full_matrices=False)[2][2]
    return normal * (1.0 if normal @ normals.mean(axis=0) > 0 else -1.0), centre


def connected(cloud: Cloud, min_samples: int) -> list[Patch]:
    """Return the connected pieces of points on one plane that are large enough."""
    normal, centre = plane(cloud.points, cloud.normals)
    across = np.linalg.svd(normal[None])[2][1:]
    labels = connected_cells(np.floor((cloud.points - centre) @ across.T / CELL).astype(int))
    pieces = []
    for number in range(1, labels.max() + 1):
        some = cloud[labels == number]
        if len(some) >= min_samples:
            normal, centre = plane(some.points, some.normals)
            pieces.append(Patch(some, normal, centre, len(some) * SPACING**2))
    return pieces


SAMPLES = 15000  # Points that are matched in each step
# [m] Distances beyond which a match counts nothing, from coarse to fine
REACHES = (0.5, 0.3, 0.2, 0.1, 0.05, 0.03, 0.015)
STEPS = 8  # Gauss-Newton steps at each of them
ALIKE = 0.8  # Cosine between normals from which a match counts
TURNS = (0.0, -0.15, 0.15)  # [rad] Turns about z from which the search starts


@dataclass(frozen=True)
class Alignment:
    """A motion between two frames."""

    motion: np.ndarray  # from the other scan's frame to the first's, shape [4 4]
    overlap: float  # fraction of the other surface that lies on the first
    rms: float  # distance between the two there [m]


def align(first: OrientedMesh, other: OrientedMesh) -> Alignment:
    """Return the rigid motion that brings another scan of a room onto the first, whatever moved in it."""
    middle = np.append((other.vertices.min(axis=0) + other.vertices.max(axis=0)) / 2, 1.0)
    alignments: list[Alignment] = []
    for turn in TURNS:
        start = np.eye(4)
        start[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
        start[:3, 3] = (middle - start @ middle)[:3]
        alignments.append(_icp(first, other, start))
        if alignments[-1].overlap > 0.8:
            break
    return max(alignments, key=lambda alignment: alignment.overlap)


def _icp(first: OrientedMesh, other: OrientedMesh, motion: np.ndarray) -> Alignment:
    """Return the alignment that is found from a start, shape [4 4]."""
    cloud = other.sample(SAMPLES)
    for reach in REACHES:
        for _ in range(STEPS):
            moved = cloud.moved(motion)
            matches = match(moved, first, reach)
            weight = np.where(
                (matches.alike > ALIKE) & matches.inner, (1 - np.clip(matches.gap / reach, 0, 1) ** 2) ** 2, 0
            )
            step = rigid_step(moved.points, matches.normal, matches.offset, weight)
            motion = step @ motion
            if np.abs(step - np.eye(4)).max() < 1e-5:
                break
    close = (matches.gap < REACHES[-1]) & (matches.alike > ALIKE)
    rms = float(np.sqrt(np.mean(matches.offset[close] ** 2))) if close.any() else np.inf
    return Alignment(motion, float(close.mean()), rms)


def rigid_step(points: np.ndarray, normals: np.ndarray, offsets: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the small motion, shape [4 4], that best takes points onto planes: one Gauss-Newton step.

    Args:
        points: [m], shape [point 3].
        normals: of their planes, unit, shape [point 3].
        offsets: of the points from the planes [m], shape [point].
        weights: shape [point].
    """
    used = weights > 0
    if used.sum() < 6:
        return np.eye(4)
    centre = np.average(points[used], axis=0, weights=weights[used])
    rows = np.concatenate([np.cross(points[used] - centre, normals[used]), normals[used]], axis=1)
    weighted = rows * weights[used, None]
    x = np.linalg.solve(rows.T @ weighted + 1e-9 * np.eye(6), -weighted.T @ offsets[used])
    step = np.eye(4)
    step[:3, :3] = Rotation.from_rotvec(x[:3]).as_matrix()
    step[:3, 3] = centre + x[3:] - step[:3, :3] @ centre
    return step
