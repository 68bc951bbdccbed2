"""Planes measured by the pixels of a panorama.

A pixel's plane comes from its direct neighbours: ones farther away lie beside a handle's bar, which is two or three pixels
wide, and would turn its planes by tens of degrees.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import warp as wp

from s2a.core.workers import in_parallel
from s2a.homes.panorama import pixel_direction, pixel_tangents


@dataclass
class View:
    """A panorama and the planes that its pixels measured.

    Attributes:
        scanner: where it was taken [m].
        tangents: of the pixel centres along a cube-map face (see `s2a.homes.panorama.pixel_tangents`).
        ranges: of its pixels [m], 0 where nothing returned, shape [pixel].
        planes: unit normal towards the scanner, and its product with points of the plane seen from the scanner [m],
            shape [pixel].
    """

    scanner: wp.vec3
    tangents: wp.array
    ranges: wp.array
    planes: wp.array


@wp.func
def _slope(ranges: wp.array(dtype=float), tangents: wp.array(dtype=float), tid: int, place: int, step: int):
    """Difference vector between a pixel's neighbours along a row or column, from the side that continues its surface."""
    n = tangents.shape[0]
    r = ranges[tid]
    back = float(0.0)
    ahead = float(0.0)
    if place >= 1:
        back = ranges[tid - step]
    if place + 1 < n:
        ahead = ranges[tid + step]
    here = r * pixel_direction(tangents, n, tid)
    jump = r * 16.0 / float(n)
    to_back = wp.where(back > 0.0, wp.abs(back - r), 1.0e6)
    to_ahead = wp.where(ahead > 0.0, wp.abs(ahead - r), 1.0e6)
    if wp.min(to_back, to_ahead) > jump:
        return wp.vec3(0.0, 0.0, 0.0)
    p_back = back * pixel_direction(tangents, n, wp.max(tid - step, 0))
    p_ahead = ahead * pixel_direction(tangents, n, wp.min(tid + step, ranges.shape[0] - 1))
    if wp.max(to_back, to_ahead) < 1.0e5 and wp.abs(back + ahead - 2.0 * r) < 0.25 * jump:
        return p_ahead - p_back
    if to_back < to_ahead:
        return here - p_back
    return p_ahead - here


@wp.kernel
def _planes(ranges: wp.array(dtype=float), tangents: wp.array(dtype=float), planes: wp.array(dtype=wp.vec4)):
    tid = wp.tid()
    n = tangents.shape[0]
    if ranges[tid] <= 0.0:
        return
    d = pixel_direction(tangents, n, tid)
    across = wp.cross(_slope(ranges, tangents, tid, tid % n, 1), _slope(ranges, tangents, tid, (tid // n) % n, n))
    normal = -d
    if wp.length(across) > 0.0:
        normal = wp.normalize(across)
        normal = normal * -wp.sign(wp.dot(normal, d))
    planes[tid] = wp.vec4(normal[0], normal[1], normal[2], ranges[tid] * wp.dot(d, normal))


def measure(panoramas: list[np.ndarray], scanners: np.ndarray, spacing: float) -> list[View]:
    """Return panoramas with the planes that their pixels measured.

    Args:
        panoramas: ranges [m] of each panorama (see `s2a.homes.panorama.cast_panorama`), shape [pixel] each.
        scanners: where each was taken [m], shape [panorama 3].
        spacing: angle between the rays [rad].
    """
    tangents = wp.array(pixel_tangents(spacing), dtype=float, device="cpu")

    def view(ranges: np.ndarray, scanner: np.ndarray) -> View:
        pixels = wp.array(ranges, dtype=float, device="cpu", copy=False)
        planes = wp.zeros(len(ranges), dtype=wp.vec4, device="cpu")
        wp.launch(_planes, len(ranges), inputs=[pixels, tangents], outputs=[planes], device="cpu")
        return View(wp.vec3(*map(float, scanner)), tangents, pixels, planes)

    return in_parallel(view, panoramas, scanners)
