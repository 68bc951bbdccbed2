"""Closest-point and ray queries at triangle meshes, on the CPU."""

import weakref
from collections.abc import Sequence

import numpy as np
import warp as wp
from warp import Mesh as RayMesh

from s2a.core.workers import chunks, in_parallel
from s2a.scene.geometry.mesh_ops import normals
from s2a.scene.scene import Mesh


def ray_mesh(vertices: np.ndarray, faces: np.ndarray, *, compact: bool = False) -> RayMesh:
    """Return a mesh for ray and closest-point queries on the CPU; it shares memory with contiguous arrays.

    One for rays may be compact: a fifth of the tree's memory, the same hits. Of faces at one distance it may name another.
    """
    copied = not len(vertices) or not len(faces)  # Warp 1.19 makes no mesh of an empty array that it shares
    points = wp.array(np.ascontiguousarray(vertices, np.float32), dtype=wp.vec3, device="cpu", copy=copied)
    corners = wp.array(np.ascontiguousarray(faces, np.int32).ravel(), dtype=int, device="cpu", copy=copied)
    return wp.Mesh(points, corners, **({"bvh_constructor": "median", "bvh_leaf_size": 8} if compact else {}))


_kept: dict[int, RayMesh] = {}


def kept_ray_mesh(mesh: Mesh) -> RayMesh:
    """Return what `ray_mesh` does of a mesh's arrays, made once and kept as long as the mesh, which never changes."""
    tree = _kept.get(id(mesh))
    if tree is None:
        tree = _kept[id(mesh)] = ray_mesh(mesh.vertices, mesh.faces)
        weakref.finalize(mesh, _kept.pop, id(mesh), None).atexit = False
    return tree


class Forest:
    """Several meshes that are asked as one, each with a search tree that other forests share.

    Attributes:
        ids: Warp's handles of those with faces.
        bounds: smallest and largest corner of these [m], shape [2 mesh 3].
    """

    def __init__(self, meshes: Sequence[Mesh]) -> None:
        """Take the meshes; every one must have faces where `nearest_meshes` is to name them by their order."""
        self._trees = [kept_ray_mesh(mesh) for mesh in meshes]
        self.ids = _ids(self._trees)
        self.bounds = np.array([mesh.bounds for mesh in meshes if len(mesh.faces)]).reshape(-1, 2, 3).swapaxes(0, 1)


def _ids(trees: Sequence[RayMesh]) -> wp.array:
    """Return the handles of meshes, but of those without faces: Warp 1.19 follows such a mesh's tree into nowhere."""
    some = [tree.id for tree in trees if tree.indices.shape[0]]
    return wp.array(np.array(some, np.uint64), dtype=wp.uint64, device="cpu")


@wp.kernel
def _nearest(
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
    nearest = wp.mesh_query_point_no_sign(mesh, points[tid], limit)
    if inside > 0.0 and not nearest.result:
        up = wp.vec3(0.0, 0.0, 1.0)
        above = wp.mesh_query_ray(mesh, points[tid], up, 100.0)
        below = wp.mesh_query_ray(mesh, points[tid], -up, 100.0)
        if (above.result and above.normal[2] > 0.0) or (below.result and below.normal[2] < 0.0):
            nearest = wp.mesh_query_point_no_sign(mesh, points[tid], reach + inside)
    if nearest.result:
        face[tid] = nearest.face
        gap[tid] = wp.length(wp.mesh_eval_position(mesh, nearest.face, nearest.u, nearest.v) - points[tid])


def nearest_faces(
    mesh: RayMesh, points: np.ndarray, reach: float = 100.0, inside: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Return the face nearest to each point (-1: none within reach) and its distance [m] (then inf), shape [point] each.

    Within closed solids it looks for a face up to `inside` [m] farther. Most points are far from every face, and are soon
    known to be by so short a reach and two rays that leave no solid.
    """
    places = np.ascontiguousarray(points, np.float32)
    face, gap = np.full(len(places), -1, np.int32), np.full(len(places), np.inf, np.float32)
    if not mesh.indices.shape[0]:  # Warp 1.19 follows the tree of a mesh without faces into nowhere
        return face, gap

    def ask(some: slice) -> None:
        outputs = [wp.array(a[some], device="cpu", copy=False) for a in (face, gap)]
        inputs = [mesh.id, wp.array(places[some], dtype=wp.vec3, device="cpu", copy=False), reach, inside]
        wp.launch(_nearest, dim=len(places[some]), inputs=inputs, outputs=outputs, device="cpu")

    in_parallel(ask, chunks(len(places)))
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
        nearest = wp.mesh_query_point_no_sign(meshes[i], points[tid], best)
        if nearest.result:
            away = wp.length(wp.mesh_eval_position(meshes[i], nearest.face, nearest.u, nearest.v) - points[tid])
            if index[tid] < 0 or away < best:
                index[tid] = i
                gap[tid] = away
                best = away


def nearest_meshes(forest: Forest, points: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the mesh nearest to each point (-1: none within reach) and its distance [m] (then inf), shape [point] each."""
    places = np.ascontiguousarray(points, np.float32)
    index, gap = np.full(len(places), -1, np.int32), np.full(len(places), np.inf, np.float32)
    if not len(places):
        return index, gap
    low, high = np.nanmin(places, axis=0) - 1.01 * reach, np.nanmax(places, axis=0) + 1.01 * reach
    near = np.flatnonzero(((forest.bounds[0] <= high) & (forest.bounds[1] >= low)).all(axis=1))
    ids = wp.array(forest.ids.numpy()[near], dtype=wp.uint64, device="cpu")
    inputs = [ids, wp.array(places, dtype=wp.vec3, device="cpu", copy=False), reach]
    outputs = [wp.array(a, device="cpu", copy=False) for a in (index, gap)]
    wp.launch(_nearest_of, dim=len(places), inputs=inputs, outputs=outputs, device="cpu")
    return np.append(near, -1)[index], gap


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

    `starts`: of the rays [m], shape [ray 3]; `directions`: unit vectors, shape [ray 3].
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
    starts = wp.array(start, dtype=wp.vec3, device="cpu")
    toward = wp.array(np.broadcast_to(direction, start.shape).astype(np.float32), dtype=wp.vec3, device="cpu")
    distance = wp.empty(len(start), dtype=float, device="cpu")
    behind = wp.zeros(len(start), dtype=wp.bool, device="cpu")
    wp.launch(_look, dim=len(start), inputs=[mesh.id, starts, toward, reach], outputs=[distance, behind], device="cpu")
    return distance.numpy(), behind.numpy()


SOLID = 0.55  # Winding number from which a point counts as inside; just behind an open sheet it is 0.5

# Warp's test takes volumes below 1e-6 for zero: in metres it would see triangles of a scan touch
# that are millimetres apart
SCALE = wp.constant(1.0e4)


@wp.kernel
def _cross(obstacles: wp.uint64, corners: wp.array2d(dtype=wp.vec3), crossed: wp.array(dtype=int)):
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
def _wind(corners: wp.array2d(dtype=wp.vec3), points: wp.array(dtype=wp.vec3), winding: wp.array(dtype=float)):
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
    places = wp.array(np.asarray(points, np.float32), dtype=wp.vec3, device="cpu")
    turns = wp.zeros(len(places), dtype=float, device="cpu")
    wp.launch(_wind, dim=len(places), inputs=[_corners(mesh), places], outputs=[turns], device="cpu")
    return turns.numpy()


def inside(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """Return which points [point 3] a surface encloses, shape [point]; holes of a scan are bridged."""
    within = np.zeros(len(points), bool)
    low, high = mesh.bounds
    near = ((points > low) & (points < high)).all(axis=1)
    if near.any():
        within[near] = winding(mesh, points[near]) > SOLID
    return within


def depth(mesh: Mesh, obstacles: Mesh, reach: float = 0.03) -> float:
    """Return the penetration depth of a closed mesh and a scanned surface [m]; 0 where they are apart.

    A vertex of the surface within the mesh is as deep as the mesh's surface is far; a vertex of the mesh behind the scanned
    surface as deep as that is far, up to `reach`: farther behind, there may be another object's back. Vertices on the rim of the
    scanned surface measure nothing, for there is no behind.

    `reach`: largest depth that is measured [m].
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
