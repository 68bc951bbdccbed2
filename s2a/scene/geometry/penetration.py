"""Penetration between an object and obstacles: exact triangle tests, containment, depth.

Positions are single precision; callers give meshes near the origin, or in a scene of room size.
"""

from __future__ import annotations

import numpy as np
import warp as wp

from s2a.scene.geometry.mesh_ops import normals
from s2a.scene.geometry.mesh_query import nearest_faces, ray_mesh
from s2a.scene.scene import Mesh

SOLID = 0.55
"""Winding number from which a point counts as inside; just behind an open sheet it is 0.5."""

SCALE = wp.constant(1.0e4)
"""Warp's test takes volumes below 1e-6 for zero: in metres it would see triangles of a scan touch that are millimetres apart."""


@wp.kernel
def _cross(
    obstacles: wp.uint64,
    corners: wp.array2d(dtype=wp.vec3),
    crossed: wp.array(dtype=int),
):
    tid = wp.tid()
    a = corners[tid, 0]
    b = corners[tid, 1]
    c = corners[tid, 2]
    query = wp.mesh_query_aabb(obstacles, wp.min(wp.min(a, b), c), wp.max(wp.max(a, b), c))
    face = int(0)
    while wp.mesh_query_aabb_next(query, face):
        p = SCALE * (wp.mesh_get_point(obstacles, 3 * face) - a)
        q = SCALE * (wp.mesh_get_point(obstacles, 3 * face + 1) - a)
        r = SCALE * (wp.mesh_get_point(obstacles, 3 * face + 2) - a)
        if wp.intersect_tri_tri(wp.vec3(0.0, 0.0, 0.0), SCALE * (b - a), SCALE * (c - a), p, q, r) == 1:
            crossed[tid] = face + 1
            return


@wp.kernel
def _wind(
    corners: wp.array2d(dtype=wp.vec3),
    points: wp.array(dtype=wp.vec3),
    winding: wp.array(dtype=float),
):
    tid = wp.tid()
    total = float(0.0)
    for face in range(corners.shape[0]):
        a = corners[face, 0] - points[tid]
        b = corners[face, 1] - points[tid]
        c = corners[face, 2] - points[tid]
        la = wp.length(a)
        lb = wp.length(b)
        lc = wp.length(c)
        below = la * lb * lc + wp.dot(a, b) * lc + wp.dot(b, c) * la + wp.dot(c, a) * lb
        total += wp.atan2(wp.dot(a, wp.cross(b, c)), below)
    winding[tid] = total / (2.0 * wp.pi)


def crossing(mesh: Mesh, obstacles: Mesh) -> int | None:
    """Return a face of the obstacles that a face of the mesh cuts, or None: exact, triangle against triangle."""
    if not len(mesh.faces) or not len(obstacles.faces):
        return None  # Warp cannot ask a mesh without faces
    tree = ray_mesh(obstacles.vertices, obstacles.faces)
    crossed = wp.zeros(len(mesh.faces), dtype=int, device="cpu")
    wp.launch(_cross, dim=len(mesh.faces), inputs=[tree.id, _corners(mesh)], outputs=[crossed], device="cpu")
    hit = crossed.numpy()
    return int(hit[np.argmax(hit > 0)] - 1) if hit.any() else None


def winding(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """Return how often a surface winds around points [point 3], shape [point]: 1 inside, 0 outside, between if it is open."""
    asked = wp.array(np.asarray(points, np.float32), dtype=wp.vec3, device="cpu")
    found = wp.zeros(len(asked), dtype=float, device="cpu")
    wp.launch(_wind, dim=len(asked), inputs=[_corners(mesh), asked], outputs=[found], device="cpu")
    return found.numpy()


def inside(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """Return which points [point 3] a surface encloses, shape [point]; holes of a scan are bridged."""
    found = np.zeros(len(points), bool)
    low, high = mesh.bounds
    near = ((points > low) & (points < high)).all(axis=1)
    if near.any():
        found[near] = winding(mesh, points[near]) > SOLID
    return found


def depth(mesh: Mesh, obstacles: Mesh, reach: float = 0.03) -> float:
    """Return the penetration depth of a closed mesh and a scanned surface [m]; 0 where they are apart.

    A vertex of the surface within the mesh is as deep as the mesh's surface is far; a vertex of the mesh behind the scanned
    surface as deep as that is far, up to `reach`: farther behind, there may be another object's back. Vertices on the rim of the
    scanned surface measure nothing, for there is no behind.

    Args:
        mesh: a closed mesh.
        obstacles: the scan around it.
        reach: largest depth that is measured [m].
    """
    if not len(mesh.faces) or not len(obstacles.faces):
        return 0.0
    swallowed = obstacles.vertices[inside(mesh, obstacles.vertices)]
    own, other = ray_mesh(mesh.vertices, mesh.faces), ray_mesh(obstacles.vertices, obstacles.faces)
    deepest = float(nearest_faces(own, swallowed)[1].max()) if len(swallowed) else 0.0
    face, gap = nearest_faces(other, mesh.vertices, reach)
    near = face >= 0
    if not near.any():
        return deepest
    triangles = obstacles.vertices[obstacles.faces[face[near]]].astype(np.float64)
    away = mesh.vertices[near] - triangles.mean(axis=1)
    height = np.einsum("ij,ij->i", away, normals(obstacles)[face[near]])
    # Straight behind the face itself: its height is the distance.
    behind = (height < 0) & (gap[near] < -height + 1e-4)
    return max(deepest, float(gap[near][behind].max(initial=0.0)))


def _corners(mesh: Mesh) -> wp.array:
    """Return the corners of a mesh's triangles, shape [face 3] of points."""
    return wp.array(mesh.vertices[mesh.faces], dtype=wp.vec3, device="cpu")
