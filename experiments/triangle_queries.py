"""Rays, depths and points of triangle meshes for independent checks: Warp's own queries, apart from s2a.scene.geometry."""

from __future__ import annotations

import numpy as np
import warp as wp
from scipy import ndimage

from s2a.scene.scene import Mesh, Scene


@wp.kernel
def _rays(
    mesh: wp.uint64,
    start: wp.array(dtype=wp.vec3),
    direction: wp.array(dtype=wp.vec3),
    t: wp.array(dtype=float),
    f: wp.array(dtype=int),
):
    i = wp.tid()
    hit = wp.mesh_query_ray(mesh, start[i], direction[i], t[i])
    f[i] = -1
    if hit.result:
        t[i] = hit.t
        f[i] = hit.face


@wp.kernel
def _signed(mesh: wp.uint64, points: wp.array(dtype=wp.vec3), reach: float, depth: wp.array(dtype=float)):
    i = wp.tid()
    hit = wp.mesh_query_point_sign_winding_number(mesh, points[i], reach)
    if hit.result:
        near = wp.mesh_eval_position(mesh, hit.face, hit.u, hit.v)
        depth[i] = -hit.sign * wp.length(near - points[i])


def cast(mesh: wp.Mesh, start: np.ndarray, direction: np.ndarray, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the distance [m], at most `reach`, and the face (-1: none) that rays [ray 3] meet first, shape [ray] each."""
    if not len(start):
        return np.zeros(0), np.zeros(0, int)
    t = wp.array(np.asarray(reach, np.float32), dtype=float, device="cpu")
    face = wp.zeros(len(start), dtype=int, device="cpu")
    wp.launch(_rays, len(start), inputs=[mesh.id, _vec(start), _vec(direction)], outputs=[t, face], device="cpu")
    return t.numpy().astype(np.float64), face.numpy()


def depths(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """Return how deep points [point 3] are in a closed mesh [m], 0 outside, shape [point]."""
    if not len(points):
        return np.zeros(0)
    asked, depth = tree(mesh.vertices, mesh.faces, winding=True), wp.zeros(len(points), dtype=float, device="cpu")
    wp.launch(_signed, len(points), inputs=[asked.id, _vec(points), 10.0], outputs=[depth], device="cpu")
    return np.maximum(depth.numpy(), 0.0)


def tree(vertices: np.ndarray, faces: np.ndarray, winding: bool = False) -> wp.Mesh:
    """Return a mesh to ask; with `winding`, what is inside of it can be asked, too."""
    index = wp.array(np.asarray(faces, np.int32).ravel(), dtype=int, device="cpu")
    return wp.Mesh(_vec(vertices), index, support_winding_number=winding)


def dense(corners: np.ndarray) -> np.ndarray:
    """Return corners, edges' middles and middles of triangles [face 3 3], as points [point 3]."""
    edges = 0.5 * (corners + np.roll(corners, 1, axis=1))
    return np.concatenate([corners.reshape(-1, 3), edges.reshape(-1, 3), corners.mean(axis=1)]).reshape(-1, 3)


def spread(mesh: Mesh, count: int = 6000) -> np.ndarray:
    """Return points spread over a mesh by area, and its vertices, shape [point 3]."""
    rng, corners = np.random.default_rng(7), mesh.vertices[mesh.faces].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    face = rng.choice(len(corners), count, p=area / area.sum())
    weight = rng.dirichlet(np.ones(3), count)
    return np.concatenate([np.einsum("pc,pcd->pd", weight, corners[face]), mesh.vertices])


def _vec(points: np.ndarray) -> wp.array:
    return wp.array(np.asarray(points, np.float32), dtype=wp.vec3, device="cpu")


class Obstacles:
    """The room around one object: all triangles but its own, and which part each belongs to."""

    def __init__(self, scene: Scene, leave_out: str | None = None) -> None:
        parts = [(i, part) for i, part in scene.parts.items() if i != leave_out and len(part.mesh.faces)]
        self.ids = [i for i, _ in parts]
        starts = np.cumsum([0, *(len(part.mesh.vertices) for _, part in parts)])
        self.vertices = np.concatenate([part.mesh.vertices for _, part in parts]).astype(np.float32)
        self.faces = np.concatenate([part.mesh.faces + start for (_, part), start in zip(parts, starts, strict=False)])
        self.owner = np.repeat(np.arange(len(parts)), [len(part.mesh.faces) for _, part in parts])
        self.tree = tree(self.vertices, self.faces)

    def cast(self, start: np.ndarray, direction: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the distance (`reach` if there is none) and the face (-1) of the first triangle along rays [ray 3]."""
        return cast(self.tree, start, direction, np.full(len(start), reach))

    def part_of(self, face: np.ndarray) -> str:
        """Return the part that most of some faces belong to; empty if there are none."""
        found = self.owner[face[face >= 0]]
        return self.ids[int(np.bincount(found).argmax())] if len(found) else ""

    def outlined(self, part_id: str, level: float, places: np.ndarray) -> np.ndarray:
        """Return which places [place 2] are in the outline of a part at a height [m]: what stood there left a hole."""
        if not part_id:
            return np.zeros(len(places), bool)
        points = dense(self.vertices[self.faces[self.owner == self.ids.index(part_id)]])
        flat = points[np.abs(points[:, 2] - level) < 0.02, :2]
        low, cell = np.minimum(flat.min(axis=0), places.min(axis=0)) - 0.3, 0.015
        high = np.maximum(flat.max(axis=0), places.max(axis=0)) + 0.3
        grid = np.zeros(np.ceil((high - low) / cell).astype(int), bool)
        grid[tuple(((flat - low) / cell).astype(int).T)] = True
        grid = ndimage.binary_fill_holes(ndimage.binary_closing(grid, iterations=5))
        return grid[tuple(((places - low) / cell).astype(int).T)]

    def points_near(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Return points on the triangles that meet a box: corners, middles and edges' middles, shape [point 3]."""
        corners = self.vertices[self.faces]
        return dense(corners[((corners.min(axis=1) <= high) & (corners.max(axis=1) >= low)).all(axis=1)])
