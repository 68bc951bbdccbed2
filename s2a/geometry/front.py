"""The flat front behind a handle, and which faces belong to the one and to the other."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from s2a.geometry.planes import fit_plane
from s2a.geometry.surfaces import centroids, keep, merge, normals, sample_with_faces
from s2a.scene import Mesh

AROUND = 0.04
"""[m] How far around the handle its front is looked for."""
SAMPLES = 40000
"""Points by which a front is asked."""
STRAY = 0.004
"""[m] What stands out of the front by more than this, close to the handle, is no front."""
FLUSH = 0.003
"""[m] What stands out of the front by less than this is no handle."""


def front_behind(front: Mesh, region: Mesh, frame: np.ndarray) -> tuple[np.ndarray, float] | None:
    """Return the plane behind a handle as outward normal and offset [m], or None where no front was scanned.

    Args:
        front: the part that carries the handle.
        region: the handle.
        frame: its grasp frame, axes as columns: z into the furniture.
    """
    outwards = -frame[:, 2]
    points, faces = sample_with_faces(front, SAMPLES, seed=0)
    flat = near_region(points, region, frame, AROUND) & (normals(front)[faces] @ outwards > 0.7)
    if flat.sum() < 20:
        return None
    points = points[flat]
    normal, offset = outwards, float(np.median(points @ outwards))
    for tolerance in (2 * STRAY, STRAY, STRAY):
        inside = np.abs(points @ normal - offset) < tolerance
        if inside.sum() < 10:
            break
        normal, offset = fit_plane(points[inside], np.ones(inside.sum()), outwards)
    return normal, offset


def front_coordinate(plane: tuple[np.ndarray, float], frame: np.ndarray, point: np.ndarray) -> float:
    """Return where the line through a point [3] along a frame's z axis meets a plane, as coordinate on it [m]."""
    normal, offset = plane
    z = frame[:, 2]
    return float((offset - normal @ (point - z * (point @ z))) / (normal @ z))


def near_region(points: np.ndarray, region: Mesh, frame: np.ndarray, distance: float) -> np.ndarray:
    """Return which points lie before, behind or beside a handle, seen along its z axis, within a distance [m]."""
    across = points @ frame[:, :2]
    low, high = np.quantile(region.vertices @ frame[:, :2], [0.01, 0.99], axis=0)
    return ((across > low - distance) & (across < high + distance)).all(axis=1)


def part_ways(front: Mesh, region: Mesh, frame: np.ndarray, plane: tuple[np.ndarray, float]) -> tuple[Mesh, Mesh]:
    """Give every face at the border between front and handle to the side that it belongs to.

    Annotators cut along triangles, and one or two of them land on the wrong side; as front, they would pull its hull
    across the gap behind the handle.

    Returns:
        The front without what stands out of it close to the handle, and the handle with that and without what is front.
    """
    normal, offset = plane
    out = centroids(front) @ normal - offset
    stray = near_region(centroids(front), region, frame, AROUND / 2) & (out > STRAY)
    strays = keep(front, stray)
    handle_out = centroids(region) @ normal - offset
    own = handle_out > FLUSH
    if region.face_areas[own].sum() < 0.5 * region.face_areas.sum():
        return front, region  # a recessed cup lies behind its front's plane
    handle = keep(region, own)
    if len(strays.faces):
        reach = cKDTree(handle.vertices).query(centroids(strays))[0] < 2 * STRAY
        handle = merge([handle, keep(strays, reach)])
    return keep(front, ~stray), handle
