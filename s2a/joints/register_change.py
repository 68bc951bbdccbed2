"""What changed between two scans of a room in one frame: surface of one that the other does not show, and its flat patches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from s2a.joints.register_surface import Cloud, OrientedMesh

CHANGED = 0.012
"""[m] Surface that lies farther from the other scan than this has changed; noise of both is 2 to 3 mm each."""
REACH = 0.3
"""[m] Distances from the other scan beyond this are all the same."""
SPACING = 0.013
"""[m] Mean distance of the samples."""
FLAT = 0.006
"""[m] Points of a patch are not farther from its plane."""
TILT = 0.92
"""Cosine between a patch's normal and those of its points, at least."""
CELL = 0.03
"""[m] Patches with a wider gap between them are two."""
MIN_AREA = 0.012
"""[m^2] Smaller patches are none."""
DRAWS, SEED = 60, 0
"""Planes that are tried for each patch."""


@dataclass(frozen=True, eq=False)
class Patch:
    """A flat piece of changed surface.

    Attributes:
        cloud: its samples.
        normal: unit, shape [3].
        centre: mean of its samples [m], shape [3].
        area: [m^2].
    """

    cloud: Cloud
    normal: np.ndarray
    centre: np.ndarray
    area: float


def changed(surface: OrientedMesh, mask: np.ndarray) -> Cloud:
    """Return samples of the faces that the other scan does not show, by a mask [face], SPACING apart."""
    faces = np.flatnonzero(mask)
    area = float(surface.areas[faces].sum())
    if area < MIN_AREA:
        return Cloud(np.empty((0, 3)), np.empty((0, 3)), np.empty(0, int))
    return surface.sample(int(area / SPACING**2) + 1, SEED, faces)


def patches(cloud: Cloud) -> list[Patch]:
    """Return the flat patches of samples, the largest planes first."""
    found: list[Patch] = []
    rng = np.random.default_rng(SEED)
    min_samples = int(MIN_AREA / SPACING**2)
    rest = cloud
    while len(rest) >= min_samples:
        members = _best_plane(rest, rng)
        if len(members) < min_samples:
            break
        found += [patch for patch in connected(rest[members], min_samples)]
        keep = np.ones(len(rest), bool)
        keep[members] = False
        rest = rest[keep]
    return found


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
    cells = np.floor((cloud.points - centre) @ across.T / CELL).astype(int)
    cells -= cells.min(axis=0)
    grid = np.zeros(cells.max(axis=0) + 1, bool)
    grid[tuple(cells.T)] = True
    labels = ndimage.label(grid, np.ones((3, 3)))[0][tuple(cells.T)]
    found = []
    for number in range(1, labels.max() + 1):
        some = cloud[labels == number]
        if len(some) >= min_samples:
            normal, centre = plane(some.points, some.normals)
            found.append(Patch(some, normal, centre, len(some) * SPACING**2))
    return found
