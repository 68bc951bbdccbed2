"""Many range panoramas, one surface: a sparse truncated signed distance field and its zero level.

Each voxel near a measured point is projected into every panorama. Its distance to the plane measured there, not along the ray,
is averaged, so that surfaces seen at a grazing angle stay in place. Space that a ray has passed counts as free; space behind a
surface counts less the deeper it lies. The surface is drawn by naive surface nets, only in cells whose eight corners have been
observed (`s2a.geometry.nets`): what no scanner saw is missing.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import warp as wp

from s2a.geometry.rays import direction_pixel, pixel_direction, pixel_tangents
from s2a.progress import track

UNKNOWN = 1.0e9
"""Value of a voxel that no panorama observed."""


@dataclass(frozen=True)
class FusionConfig:
    """How panoramas become a surface.

    Attributes:
        voxel: edge of a voxel [m].
        truncation: distances beyond this are cut off [voxel].
        reach: voxels farther than this from every measured point are left out [voxel]; the farther, the longer the skirts
            that are drawn along the edges of shadows (webs behind handles).
        depth: how far behind a measured point, along its ray, its plane still says what is filled [voxel]; the farther, the
            more of the gap behind a handle that is seen from above or aside is taken for the handle's inside.
        stencil: pixels between the neighbours from which a pixel's normal is estimated.
    """

    voxel: float
    truncation: float
    reach: float
    depth: float
    stencil: int


@dataclass
class Field:
    """A sparse field in blocks of 4 x 4 x 4 voxels.

    Attributes:
        voxel: edge of a voxel [m].
        origin: centre of voxel (0, 0, 0) [m].
        table: row of each block in `blocks`, or -1, shape [block_x block_y block_z].
        blocks: coordinates of the stored blocks, shape [block 3].
        distance: weighted sum of distances, later their mean [m], shape [block * 64]; positive is free.
        weight: sum of weights, shape [block * 64].
    """

    voxel: float
    origin: wp.vec3
    table: wp.array
    blocks: wp.array
    distance: wp.array
    weight: wp.array


@wp.func
def voxel_place(blocks: wp.array(dtype=wp.vec3i), tid: int):
    """Return the coordinates of a stored voxel."""
    b = blocks[tid // 64]
    k = tid % 64
    return wp.vec3i(b[0] * 4 + k // 16, b[1] * 4 + (k // 4) % 4, b[2] * 4 + k % 4)


@wp.func
def voxel_index(table: wp.array3d(dtype=int), i: int, j: int, k: int):
    """Storage index of a voxel, or -1 (a block is always two blocks away from the table's border)."""
    row = table[i // 4, j // 4, k // 4]
    if row < 0:
        return -1
    return row * 64 + (i % 4) * 16 + (j % 4) * 4 + k % 4


@wp.func
def voxel_value(table: wp.array3d(dtype=int), values: wp.array(dtype=float), i: int, j: int, k: int):
    """Return the value of a voxel; UNKNOWN where none is stored."""
    index = voxel_index(table, i, j, k)
    if index < 0:
        return UNKNOWN
    return values[index]


@wp.kernel
def _mark(
    ranges: wp.array(dtype=float),
    tangents: wp.array(dtype=float),
    scanner: wp.vec3,
    origin: wp.vec3,
    block: float,
    reach: float,
    table: wp.array3d(dtype=int),
):
    tid = wp.tid()
    if ranges[tid] <= 0.0:
        return
    p = scanner + ranges[tid] * pixel_direction(tangents, tangents.shape[0], tid) - origin
    for axis in range(3):
        if p[axis] < 2.0 * block + reach or p[axis] > float(table.shape[axis] - 2) * block - reach:
            return
    for i in range(int((p[0] - reach) / block), int((p[0] + reach) / block) + 1):
        for j in range(int((p[1] - reach) / block), int((p[1] + reach) / block) + 1):
            for k in range(int((p[2] - reach) / block), int((p[2] + reach) / block) + 1):
                table[i, j, k] = 1


@wp.func
def _slope(
    ranges: wp.array(dtype=float), tangents: wp.array(dtype=float), tid: int, place: int, step: int, stencil: int
):
    """Difference vector between a pixel's neighbours along a row or column, from the side that continues its surface."""
    n = tangents.shape[0]
    r = ranges[tid]
    back = float(0.0)
    ahead = float(0.0)
    if place >= stencil:
        back = ranges[tid - stencil * step]
    if place + stencil < n:
        ahead = ranges[tid + stencil * step]
    here = r * pixel_direction(tangents, n, tid)
    jump = r * 16.0 * float(stencil) / float(n)
    to_back = wp.where(back > 0.0, wp.abs(back - r), 1.0e6)
    to_ahead = wp.where(ahead > 0.0, wp.abs(ahead - r), 1.0e6)
    if wp.min(to_back, to_ahead) > jump:
        return wp.vec3(0.0, 0.0, 0.0)
    p_back = back * pixel_direction(tangents, n, wp.max(tid - stencil * step, 0))
    p_ahead = ahead * pixel_direction(tangents, n, wp.min(tid + stencil * step, ranges.shape[0] - 1))
    if wp.max(to_back, to_ahead) < 1.0e5 and wp.abs(back + ahead - 2.0 * r) < 0.25 * jump:
        return p_ahead - p_back
    if to_back < to_ahead:
        return here - p_back
    return p_ahead - here


@wp.kernel
def _planes(
    ranges: wp.array(dtype=float), tangents: wp.array(dtype=float), stencil: int, planes: wp.array(dtype=wp.vec4)
):
    tid = wp.tid()
    n = tangents.shape[0]
    if ranges[tid] <= 0.0:
        return
    d = pixel_direction(tangents, n, tid)
    across = wp.cross(
        _slope(ranges, tangents, tid, tid % n, 1, stencil), _slope(ranges, tangents, tid, (tid // n) % n, n, stencil)
    )
    normal = -d
    if wp.length(across) > 0.0:
        normal = wp.normalize(across)
        normal = normal * -wp.sign(wp.dot(normal, d))
    planes[tid] = wp.vec4(normal[0], normal[1], normal[2], ranges[tid] * wp.dot(d, normal))


@wp.kernel
def _fuse(
    blocks: wp.array(dtype=wp.vec3i),
    origin: wp.vec3,
    voxel: float,
    truncation: float,
    depth: float,
    ranges: wp.array(dtype=float),
    planes: wp.array(dtype=wp.vec4),
    scanner: wp.vec3,
    n: int,
    distance: wp.array(dtype=float),
    weight: wp.array(dtype=float),
):
    tid = wp.tid()
    c = voxel_place(blocks, tid)
    x = origin + voxel * wp.vec3(float(c[0]), float(c[1]), float(c[2])) - scanner
    pixel = direction_pixel(x, n)
    r = ranges[pixel]
    if r <= 0.0:
        return
    plane = planes[pixel]
    normal = wp.vec3(plane[0], plane[1], plane[2])
    far = wp.length(x)
    d = wp.dot(x, normal) - plane[3]
    if d < -truncation or far - r > 3.0 * truncation or (d < -1.4 * voxel and far - r > depth):
        return
    w = wp.abs(wp.dot(x, normal)) / (far * far)
    if d < -voxel:
        w = w * (d + truncation) / (truncation - voxel)
    distance[tid] += w * wp.min(d, truncation)
    weight[tid] += w


@wp.kernel
def _average(weight: wp.array(dtype=float), distance: wp.array(dtype=float)):
    tid = wp.tid()
    if weight[tid] > 1.0e-3:
        distance[tid] = distance[tid] / weight[tid]
    else:
        distance[tid] = UNKNOWN


def fuse(
    panoramas: list[np.ndarray], scanners: np.ndarray, spacing: float, bounds: np.ndarray, config: FusionConfig
) -> Field:
    """Return the field of distances that all panoramas together measure.

    Args:
        panoramas: ranges [m] of each panorama (see `s2a.geometry.rays.cast_panorama`), shape [pixel] each.
        scanners: where each was taken [m], shape [panorama 3].
        spacing: angle between the rays [rad].
        bounds: smallest and largest corner of what is of interest [m], shape [2 3]; what lies outside is cropped.
        config: voxels and truncation.
    """
    tangents = wp.array(pixel_tangents(spacing), dtype=float, device="cpu")
    field = _allocate(panoramas, scanners, tangents, bounds, config)
    lengths = [config.voxel, config.voxel * config.truncation, config.voxel * config.depth]

    def add(some: slice) -> None:
        """Add the panorama at hand to some of the blocks, each of 64 voxels."""
        voxels = slice(64 * some.start, 64 * some.stop)
        inputs = [field.blocks[some], field.origin, *lengths, pixels, planes, place, len(tangents)]
        outputs = [field.distance[voxels], field.weight[voxels]]
        wp.launch(_fuse, len(outputs[0]), inputs=inputs, outputs=outputs, device="cpu")

    shares = _shares(len(field.blocks))
    with ThreadPoolExecutor(max(len(shares), 1)) as pool:  # Warp works without Python's lock, on one core a launch
        for ranges, scanner in track(list(zip(panoramas, scanners, strict=True)), "fuse"):
            pixels, place = wp.array(ranges, dtype=float, device="cpu", copy=False), wp.vec3(*map(float, scanner))
            planes = wp.zeros(len(ranges), dtype=wp.vec4, device="cpu")
            wp.launch(_planes, len(ranges), inputs=[pixels, tangents, config.stencil], outputs=[planes], device="cpu")
            list(pool.map(add, shares))
    wp.launch(_average, len(field.weight), inputs=[field.weight], outputs=[field.distance], device="cpu")
    return field


def _shares(count: int) -> list[slice]:
    """Return a share of so many blocks for each processor that this process may use; none is empty."""
    ends = np.unique(np.linspace(0, count, len(os.sched_getaffinity(0)) + 1).astype(int)).tolist()
    return [slice(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True)]


def _allocate(
    panoramas: list[np.ndarray], scanners: np.ndarray, tangents: wp.array, bounds: np.ndarray, config: FusionConfig
) -> Field:
    """Return an empty field with the blocks around every measured point."""
    block, reach = 4.0 * config.voxel, config.reach * config.voxel
    margin = 2 * block + reach
    low = bounds[0] - margin
    table = wp.zeros(tuple(int(n) for n in np.ceil((bounds[1] + margin - low) / block)), dtype=int, device="cpu")
    origin = wp.vec3(*map(float, low))
    for ranges, scanner in zip(panoramas, scanners, strict=True):
        pixels = wp.array(ranges, dtype=float, device="cpu", copy=False)
        inputs = [pixels, tangents, wp.vec3(*map(float, scanner)), origin, block, reach]
        wp.launch(_mark, len(ranges), inputs=inputs, outputs=[table], device="cpu")
    rows = table.numpy()
    blocks = np.argwhere(rows).astype(np.int32)
    rows[...] = -1
    rows[tuple(blocks.T)] = np.arange(len(blocks), dtype=np.int32)
    return Field(
        voxel=config.voxel,
        origin=origin,
        table=table,
        blocks=wp.array(blocks, dtype=wp.vec3i, device="cpu"),
        distance=wp.zeros(64 * len(blocks), dtype=float, device="cpu"),
        weight=wp.zeros(64 * len(blocks), dtype=float, device="cpu"),
    )
