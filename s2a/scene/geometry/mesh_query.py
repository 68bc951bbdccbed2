"""Closest-point and ray queries at triangle meshes, on the CPU."""

from __future__ import annotations

import weakref
from collections.abc import Sequence

import numpy as np
import warp as wp
from warp import Mesh as RayMesh

from s2a.core.workers import chunks, in_parallel
from s2a.scene.scene import Mesh


def ray_mesh(vertices: np.ndarray, faces: np.ndarray) -> RayMesh:
    """Return a mesh for ray and closest-point queries on the CPU."""
    points = wp.array(np.asarray(vertices, np.float32), dtype=wp.vec3, device="cpu")
    return wp.Mesh(points, wp.array(np.asarray(faces, np.int32).ravel(), dtype=int, device="cpu"))


_kept: dict[int, RayMesh] = {}


def kept_ray_mesh(mesh: Mesh) -> RayMesh:
    """Return what `ray_mesh` does of a mesh's arrays, made once and kept as long as the mesh, which never changes."""
    found = _kept.get(id(mesh))
    if found is None:
        found = _kept[id(mesh)] = ray_mesh(mesh.vertices, mesh.faces)
        weakref.finalize(mesh, _kept.pop, id(mesh), None).atexit = False
    return found


class Forest:
    """Several meshes that are asked as one, each with a search tree that other forests share.

    Attributes:
        ids: Warp's handles of those with faces.
    """

    def __init__(self, meshes: Sequence[Mesh]) -> None:
        """Take the meshes; every one must have faces where `nearest_meshes` is to name them by their order."""
        self._trees = [kept_ray_mesh(mesh) for mesh in meshes]
        self.ids = _ids(self._trees)


def _ids(trees: Sequence[RayMesh]) -> wp.array:
    """Return the handles of meshes, but of those without faces: Warp 1.19 follows such a mesh's tree into nowhere."""
    some = [tree.id for tree in trees if tree.indices.shape[0]]
    return wp.array(np.array(some, np.uint64), dtype=wp.uint64, device="cpu")


@wp.kernel
def _nearest(
    mesh: wp.uint64,
    points: wp.array(dtype=wp.vec3),
    reach: float,
    face: wp.array(dtype=int),
    gap: wp.array(dtype=float),
):
    tid = wp.tid()
    found = wp.mesh_query_point_no_sign(mesh, points[tid], reach)
    face[tid] = -1
    if found.result:
        face[tid] = found.face
        gap[tid] = wp.length(wp.mesh_eval_position(mesh, found.face, found.u, found.v) - points[tid])


def nearest_faces(mesh: RayMesh, points: np.ndarray, reach: float = 100.0) -> tuple[np.ndarray, np.ndarray]:
    """Return the face nearest to each point (-1: none within reach) and its distance [m] (then inf), shape [point] each."""
    asked = np.ascontiguousarray(points, np.float32)
    face, gap = np.full(len(asked), -1, np.int32), np.full(len(asked), np.inf, np.float32)
    if not mesh.indices.shape[0]:  # Warp 1.19 follows the tree of a mesh without faces into nowhere
        return face, gap

    def ask(some: slice) -> None:
        outputs = [wp.array(a[some], device="cpu", copy=False) for a in (face, gap)]
        inputs = [mesh.id, wp.array(asked[some], dtype=wp.vec3, device="cpu", copy=False), reach]
        wp.launch(_nearest, dim=len(asked[some]), inputs=inputs, outputs=outputs, device="cpu")

    in_parallel(ask, chunks(len(asked)))
    return face, gap


@wp.kernel
def _nearest_of_solids(
    mesh: wp.uint64,
    points: wp.array(dtype=wp.vec3),
    reach: float,
    inside: float,
    face: wp.array(dtype=int),
    gap: wp.array(dtype=float),
):
    tid = wp.tid()
    face[tid] = -1
    limit = reach
    found = wp.mesh_query_point_no_sign(mesh, points[tid], limit)
    if not found.result:
        up = wp.vec3(0.0, 0.0, 1.0)
        above = wp.mesh_query_ray(mesh, points[tid], up, 100.0)
        below = wp.mesh_query_ray(mesh, points[tid], -up, 100.0)
        if (above.result and above.normal[2] > 0.0) or (below.result and below.normal[2] < 0.0):
            found = wp.mesh_query_point_no_sign(mesh, points[tid], reach + inside)
    if found.result:
        face[tid] = found.face
        gap[tid] = wp.length(wp.mesh_eval_position(mesh, found.face, found.u, found.v) - points[tid])


def nearest_faces_of_solids(
    mesh: RayMesh, points: np.ndarray, reach: float, inside: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return what `nearest_faces` does, of closed solids; within them it looks for a face up to `inside` [m] farther.

    Most points are far from every face, and are soon known to be by so short a reach and two rays that leave no solid.
    """
    asked = np.ascontiguousarray(points, np.float32)
    face, gap = np.full(len(asked), -1, np.int32), np.full(len(asked), np.inf, np.float32)
    if not mesh.indices.shape[0]:
        return face, gap

    def ask(some: slice) -> None:
        outputs = [wp.array(a[some], device="cpu", copy=False) for a in (face, gap)]
        inputs = [mesh.id, wp.array(asked[some], dtype=wp.vec3, device="cpu", copy=False), reach, inside]
        wp.launch(_nearest_of_solids, dim=len(asked[some]), inputs=inputs, outputs=outputs, device="cpu")

    in_parallel(ask, chunks(len(asked)))
    return face, gap


@wp.kernel
def _nearest_of(
    meshes: wp.array(dtype=wp.uint64),
    points: wp.array(dtype=wp.vec3),
    reach: float,
    index: wp.array(dtype=int),
    gap: wp.array(dtype=float),
):
    tid = wp.tid()
    best = reach
    index[tid] = -1
    for i in range(meshes.shape[0]):
        found = wp.mesh_query_point_no_sign(meshes[i], points[tid], best)
        if found.result:
            away = wp.length(wp.mesh_eval_position(meshes[i], found.face, found.u, found.v) - points[tid])
            if index[tid] < 0 or away < best:
                index[tid] = i
                gap[tid] = away
                best = away


def nearest_meshes(forest: Forest, points: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the mesh nearest to each point (-1: none within reach) and its distance [m] (then inf), shape [point] each."""
    asked = np.ascontiguousarray(points, np.float32)
    index, gap = np.full(len(asked), -1, np.int32), np.full(len(asked), np.inf, np.float32)
    inputs = [forest.ids, wp.array(asked, dtype=wp.vec3, device="cpu", copy=False), reach]
    outputs = [wp.array(a, device="cpu", copy=False) for a in (index, gap)]
    wp.launch(_nearest_of, dim=len(asked), inputs=inputs, outputs=outputs, device="cpu")
    return index, gap


@wp.kernel
def _hit(
    meshes: wp.array(dtype=wp.uint64),
    starts: wp.array(dtype=wp.vec3),
    ahead: wp.array(dtype=wp.vec3),
    distance: wp.array(dtype=float),
):
    tid = wp.tid()
    nearest = float(wp.inf)
    for i in range(meshes.shape[0]):
        hit = wp.mesh_query_ray(meshes[i], starts[tid], ahead[tid], 1.0e3)
        if hit.result:
            nearest = wp.min(nearest, hit.t)
    distance[tid] = nearest


def first_hits(mesh: RayMesh | Forest, starts: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return the distance of each ray to a mesh, or to the nearest of several [m], shape [ray]; inf where it misses.

    Args:
        mesh: what is hit, from either side.
        starts: of the rays [m], shape [ray 3].
        directions: unit vectors, shape [ray 3].
    """
    meshes = mesh.ids if isinstance(mesh, Forest) else _ids([mesh])
    rays = [wp.array(np.asarray(a, np.float32), dtype=wp.vec3, device="cpu") for a in (starts, directions)]
    distance = wp.empty(len(starts), dtype=float, device="cpu")
    wp.launch(_hit, dim=len(starts), inputs=[meshes, *rays], outputs=[distance], device="cpu")
    return distance.numpy()


@wp.kernel
def _look(
    mesh: wp.uint64,
    start: wp.array(dtype=wp.vec3),
    direction: wp.array(dtype=wp.vec3),
    reach: float,
    distance: wp.array(dtype=float),
    behind: wp.array(dtype=wp.bool),
):
    tid = wp.tid()
    hit = wp.mesh_query_ray(mesh, start[tid], direction[tid], reach)
    distance[tid] = reach
    if hit.result:
        distance[tid] = hit.t
        behind[tid] = wp.dot(hit.normal, direction[tid]) > 0.0


def visible_distance(
    mesh: RayMesh, start: np.ndarray, direction: np.ndarray, reach: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the visible distance [m], at most `reach`, shape [ray], and if the first surface is seen from behind, [ray].

    A surface seen from behind tells that the ray began inside of something.

    Args:
        mesh: the obstacles.
        start: origins of the rays [m], shape [ray 3].
        direction: unit directions, shape [ray 3] or [3].
        reach: maximum distance [m].
    """
    start = np.asarray(start, np.float32)
    asked = wp.array(start, dtype=wp.vec3, device="cpu")
    toward = wp.array(np.broadcast_to(direction, start.shape).astype(np.float32), dtype=wp.vec3, device="cpu")
    distance = wp.empty(len(start), dtype=float, device="cpu")
    behind = wp.zeros(len(start), dtype=wp.bool, device="cpu")
    wp.launch(_look, dim=len(start), inputs=[mesh.id, asked, toward, reach], outputs=[distance, behind], device="cpu")
    return distance.numpy(), behind.numpy()
