"""Projection of a fused surface onto the measured points.

A vertex of surface nets is the mean of the places where its cell's edges cross the surface, and lies within whatever is convex:
a bar of 12 mm in voxels of 6 mm loses a millimetre all around even if the field is exact. Rays that pass beside it, and say of
the voxels there no more than that they are free, take as much again. Poisson reconstruction, by which real scans become
meshes, fits the points that were measured; so does this.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import warp as wp

from s2a.core.workers import chunks, in_parallel
from s2a.homes.panorama import View, direction_pixel
from s2a.scene.geometry.surface_nets import Net

BEHIND = (0.33, 0.66)
"""Share of the reach by which a vertex lies behind what was measured, on average over the panoramas, from which on it moves
less, and not at all: so far behind hang the skirts along the edges of shadows, which no one has measured."""
ALIKE = 0.5
"""Cosine of the largest angle between a vertex's normal and those of the planes onto which it is drawn."""


@wp.kernel
def _pull(
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    ranges: wp.array(dtype=float),
    planes: wp.array(dtype=wp.vec4),
    scanner: wp.vec3,
    n: int,
    reach: float,
    total: wp.array(dtype=wp.vec3),
):
    """Add to the normal equations of how far each vertex moves along its normal, and to its mean depth behind the points."""
    tid = wp.tid()
    x = points[tid] - scanner
    pixel = direction_pixel(x, n)
    r = ranges[pixel]
    far = wp.length(x)
    if r <= 0.0 or wp.abs(far - r) > reach:
        return
    plane = planes[pixel]
    normal = wp.vec3(plane[0], plane[1], plane[2])
    d = wp.dot(x, normal) - plane[3]
    alike = wp.dot(normal, normals[tid])
    if alike < ALIKE or wp.abs(d) > reach:
        return
    w = wp.abs(wp.dot(x, normal)) / (far * far)
    total[tid] += w * alike * wp.vec3(d, alike, alike * (far - r))


@wp.kernel
def _move(
    total: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    near: float,
    far: float,
    points: wp.array(dtype=wp.vec3),
):
    """Move each vertex as far as all panoramas ask; panoramas left out one by one for their depth would bias it."""
    tid = wp.tid()
    if total[tid][1] > 0.0:
        share = wp.clamp((far - total[tid][2] / total[tid][1]) / (far - near), 0.0, 1.0)
        points[tid] -= normals[tid] * share * total[tid][0] / total[tid][1]


def project_to_scan(net: Net, views: list[View], reach: float) -> Net:
    """Return a surface whose vertices have moved along their normals onto the planes measured about them.

    Each panorama that sees a vertex weighs as much as in the fusion; where none measured anything, it stays.

    Args:
        net: the surface.
        views: the panoramas.
        reach: planes farther than this from a vertex, across or along the ray, are of something else [m].
    """

    def settle(some: slice) -> np.ndarray:
        points = wp.array(net.points[some], dtype=wp.vec3, device="cpu")
        normals = wp.array(net.normals[some], dtype=wp.vec3, device="cpu")
        total = wp.zeros(len(points), dtype=wp.vec3, device="cpu")
        for view in views:
            pixels = [view.ranges, view.planes, view.scanner, len(view.tangents)]
            inputs = [points, normals, *pixels, reach]
            wp.launch(_pull, len(points), inputs=inputs, outputs=[total], device="cpu")
        wp.launch(
            _move,
            len(points),
            inputs=[total, normals, BEHIND[0] * reach, BEHIND[1] * reach],
            outputs=[points],
            device="cpu",
        )
        return points.numpy()

    return replace(net, points=np.concatenate(in_parallel(settle, chunks(len(net.points)))))
