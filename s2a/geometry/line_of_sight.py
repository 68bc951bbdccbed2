"""How far one sees from points along directions."""

from __future__ import annotations

import numpy as np
import warp as wp

from s2a.geometry.mesh_query import RayMesh


@wp.kernel
def _look(
    mesh: wp.uint64,
    start: wp.array(dtype=wp.vec3),
    direction: wp.array(dtype=wp.vec3),
    reach: float,
    way: wp.array(dtype=float),
    behind: wp.array(dtype=wp.bool),
):
    tid = wp.tid()
    hit = wp.mesh_query_ray(mesh, start[tid], direction[tid], reach)
    way[tid] = reach
    if hit.result:
        way[tid] = hit.t
        behind[tid] = wp.dot(hit.normal, direction[tid]) > 0.0


def sight(mesh: RayMesh, start: np.ndarray, direction: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Return how far one sees [m], at most `reach`, shape [ray], and whether the first surface is seen from behind, [ray].

    A surface seen from behind tells that the ray began inside of something.

    Args:
        mesh: what stands in the way.
        start: where the rays begin [m], shape [ray 3].
        direction: where to, unit, shape [ray 3] or [3].
        reach: how far to look [m].
    """
    start = np.asarray(start, np.float32)
    asked = wp.array(start, dtype=wp.vec3, device="cpu")
    toward = wp.array(np.broadcast_to(direction, start.shape).astype(np.float32), dtype=wp.vec3, device="cpu")
    way = wp.empty(len(start), dtype=float, device="cpu")
    behind = wp.zeros(len(start), dtype=wp.bool, device="cpu")
    wp.launch(_look, dim=len(start), inputs=[mesh.id, asked, toward, reach], outputs=[way, behind], device="cpu")
    return way.numpy(), behind.numpy()
