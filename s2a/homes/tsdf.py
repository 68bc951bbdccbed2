"""Many range panoramas, one surface: a sparse truncated signed distance field and its zero level.

Each voxel near a measured point is projected into every panorama. Its distance to the plane measured there, not along the ray,
is averaged, so that surfaces seen at a grazing angle stay in place. Space that a ray has passed counts as free; space behind a
surface counts less the deeper it lies. The surface is drawn by naive surface nets, only in cells whose eight corners have been
observed (`s2a.scene.geometry.surface_nets`), and drawn onto the measured
planes (`project_to_scan`): what no scanner saw is missing.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
import warp as wp

from s2a.core.bounds import NotNegative, Positive
from s2a.core.progress import track
from s2a.core.workers import chunks, in_parallel
from s2a.homes.panorama import View, direction_pixel, pixel_direction
from s2a.scene.geometry.surface_nets import UNKNOWN, Field, mark_blocks, voxel_place


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
    """

    voxel: Positive
    truncation: Positive
    reach: Positive
    depth: NotNegative


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
    mark_blocks(p, block, reach, table)


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
    first: int,
    distance: wp.array(dtype=float),
    weight: wp.array(dtype=float),
):
    tid = first + wp.tid()
    c = voxel_place(blocks, tid)
    x = origin + voxel * wp.vec3(float(c[0]), float(c[1]), float(c[2])) - scanner
    pixel = direction_pixel(x, n)
    r = ranges[pixel]
    far = wp.length(x)
    if r <= 0.0 or far - r > 3.0 * truncation:
        return
    plane = planes[pixel]
    normal = wp.vec3(plane[0], plane[1], plane[2])
    d = wp.dot(x, normal) - plane[3]
    if d < -truncation or (d < -1.4 * voxel and far - r > depth):
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


def fuse(views: list[View], bounds: np.ndarray, config: FusionConfig) -> Field:
    """Return the field of distances that all panoramas together measure.

    Args:
        views: the panoramas.
        bounds: smallest and largest corner of what is of interest [m], shape [2 3]; what lies outside is cropped.
        config: voxels and truncation.
    """
    field = _allocate(views, bounds, config)
    lengths = [config.voxel, config.voxel * config.truncation, config.voxel * config.depth]

    def add(view: View, some: slice) -> None:
        """Add a panorama to some of the voxels."""
        inputs = [field.blocks, field.origin, *lengths, view.ranges, view.planes, view.scanner, len(view.tangents)]
        outputs = [field.distance, field.weight]
        wp.launch(_fuse, some.stop - some.start, inputs=[*inputs, some.start], outputs=outputs, device="cpu")

    for view in track(views, "fuse"):
        in_parallel(partial(add, view), chunks(len(field.weight)))
    wp.launch(_average, len(field.weight), inputs=[field.weight], outputs=[field.distance], device="cpu")
    return field


def _allocate(views: list[View], bounds: np.ndarray, config: FusionConfig) -> Field:
    """Return an empty field with the blocks around every measured point."""
    block, reach = 4.0 * config.voxel, config.reach * config.voxel
    margin = 2 * block + reach
    low = bounds[0] - margin
    table = wp.zeros(tuple(int(n) for n in np.ceil((bounds[1] + margin - low) / block)), dtype=int, device="cpu")
    origin = wp.vec3(*map(float, low))

    def mark(view: View) -> None:
        inputs = [view.ranges, view.tangents, view.scanner, origin, block, reach]
        wp.launch(_mark, len(view.ranges), inputs=inputs, outputs=[table], device="cpu")

    in_parallel(mark, views)  # All write the same number into the table.
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
