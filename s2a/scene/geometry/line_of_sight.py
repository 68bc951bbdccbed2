"""Lines of sight: distance to the first surface along rays."""

from __future__ import annotations

import numpy as np
import warp as wp

from s2a.scene.geometry.mesh_query import RayMesh


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
