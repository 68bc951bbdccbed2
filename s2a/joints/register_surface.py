"""A scanned surface as registration needs it: samples with normals, and where other points meet it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from s2a.scene.geometry.mesh_query import RayMesh, nearest_faces, ray_mesh


@dataclass(frozen=True, eq=False)
class OrientedMesh:
    """A triangle mesh with normals towards free space.

    Attributes:
        vertices: [m], shape [vertex 3], float64.
        faces: vertex indices, shape [face 3].
    """

    vertices: np.ndarray
    faces: np.ndarray

    @cached_property
    def tree(self) -> RayMesh:
        """For closest points and rays."""
        return ray_mesh(self.vertices, self.faces)

    @cached_property
    def centroids(self) -> np.ndarray:
        """Middle of each face [m], shape [face 3]."""
        return self.vertices[self.faces].mean(axis=1)

    @cached_property
    def _cross(self) -> np.ndarray:
        a, b, c = np.moveaxis(self.vertices[self.faces], 1, 0)
        return np.cross(b - a, c - a)

    @cached_property
    def areas(self) -> np.ndarray:
        """Area of each face [m^2], shape [face]."""
        return 0.5 * np.linalg.norm(self._cross, axis=1)

    @cached_property
    def normals(self) -> np.ndarray:
        """Unit normal of each face, shape [face 3]; zero for a face without area."""
        return self._cross / np.maximum(2.0 * self.areas, 1e-15)[:, None]

    def moved(self, motion: np.ndarray) -> OrientedMesh:
        """Return the surface after a rigid motion, shape [4 4]."""
        return OrientedMesh(self.vertices @ motion[:3, :3].T + motion[:3, 3], self.faces)

    def sample(self, count: int, seed: int = 0, among: np.ndarray | None = None) -> Cloud:
        """Return random points, evenly spread over the area.

        Args:
            count: number of points.
            seed: of the draw.
            among: indices of the faces to take, or None for all.
        """
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
    """Points on a surface.

    Attributes:
        points: [m], shape [point 3].
        normals: unit, shape [point 3].
        faces: the face of the surface that each lies on, shape [point].
    """

    points: np.ndarray
    normals: np.ndarray
    faces: np.ndarray

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
    """Where the points of a cloud meet a surface.

    Attributes:
        face: nearest face of each point, -1 where none is within reach, shape [point].
        gap: distance to it [m], inf without one.
        offset: distance from its plane, positive on the side of its normal [m].
        normal: its unit normal, shape [point 3].
        alike: cosine between the normals of point and face; -1 without a match.
    """

    face: np.ndarray
    gap: np.ndarray
    offset: np.ndarray
    normal: np.ndarray
    alike: np.ndarray

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
