"""Posed depth and colour images, one coloured surface: a sparse truncated signed distance field and its zero level.

Each voxel near a measured point is projected into every depth image; its distance along the optical axis is averaged, nearer
measurements count more. Colours are averaged over the images that see a voxel near the surface. The field and its zero level
are those of the virtual scanner (`s2a.scene.geometry.surface_nets`).
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from s2a.core.errors import InputError
from s2a.core.workers import chunks, in_parallel
from s2a.scene.geometry.surface_nets import UNKNOWN, Field, extract, mark_blocks, voxel_place
from s2a.scene.scene import Mesh

GREY = 170  # Level of a surface that no colour image saw

_BLOCK = 4  # voxels along the edge of a block
_REACH = 2.0  # [voxel]; blocks this near to a measured point are stored
_EDGE = 0.03  # relative step between neighbouring pixels from which on depth is a blend of two surfaces


@dataclass(frozen=True, eq=False)
class Image:
    """One posed frame in memory."""

    depth: np.ndarray  # along the optical axis [m], 0 where there is none, shape [row column], float32
    color: np.ndarray | None  # RGB, shape [row column 3], uint8, or None
    pose: np.ndarray  # camera to world, x right, y down, z forward, shape [4 4]
    camera: tuple[float, float, float, float]  # focal lengths and centre of the depth image [pixel]: fx, fy, cx, cy
    color_camera: tuple[float, float, float, float]  # those of the colour image
    # transform from the depth camera's coordinates to the colour camera's, shape [4 4]; None where one camera saw both
    color_from_depth: np.ndarray | None = None


@wp.kernel
def _mark(points: wp.array(dtype=wp.vec3), origin: wp.vec3, block: float, reach: float, table: wp.array3d(dtype=int)):
    p = points[wp.tid()] - origin
    mark_blocks(p, block, reach, table)


@wp.kernel
def _fuse(
    blocks: wp.array(dtype=wp.vec3i),
    origin: wp.vec3,
    voxel: float,
    truncation: float,
    depth: wp.array2d(dtype=float),
    color: wp.array2d(dtype=wp.vec3),
    to_camera: wp.mat33,
    eye: wp.vec3,
    camera: wp.vec4,
    color_camera: wp.vec4,
    color_turn: wp.mat33,
    color_shift: wp.vec3,
    nearest: wp.array2d(dtype=float),
    coarse: float,
    first: int,
    distance: wp.array(dtype=float),
    weight: wp.array(dtype=float),
    paint: wp.array(dtype=wp.vec3),
    painted: wp.array(dtype=float),
):
    tid = first + wp.tid()
    c = voxel_place(blocks, tid)
    x = to_camera * (origin + voxel * wp.vec3(float(c[0]), float(c[1]), float(c[2])) - eye)
    if x[2] < 0.1:
        return
    u = int(wp.round(camera[0] * x[0] / x[2] + camera[2]))
    v = int(wp.round(camera[1] * x[1] / x[2] + camera[3]))
    if u < 0 or v < 0 or u >= depth.shape[1] or v >= depth.shape[0]:
        return
    z = depth[v, u]
    if z <= 0.0:
        return
    d = z - x[2]
    if d < -truncation:
        return
    w = 1.0 / (z * z)
    distance[tid] += w * wp.min(d, truncation)
    weight[tid] += w
    if wp.abs(d) < truncation:
        x = color_turn * x + color_shift
        if x[2] < 0.1:
            return
        u = int(wp.round(color_camera[0] * x[0] / x[2] + color_camera[2]))
        v = int(wp.round(color_camera[1] * x[1] / x[2] + color_camera[3]))
        if u >= 0 and v >= 0 and u < color.shape[1] and v < color.shape[0]:
            i = int(float(v) / coarse)
            j = int(float(u) / coarse)
            # The other camera may see something nearer there.
            if i < nearest.shape[0] and j < nearest.shape[1] and x[2] > nearest[i, j] + truncation:
                return
            paint[tid] += w * color[v, u]
            painted[tid] += w


@wp.kernel
def _average(min_weight: float, weight: wp.array(dtype=float), distance: wp.array(dtype=float)):
    tid = wp.tid()
    if weight[tid] > min_weight:
        distance[tid] = distance[tid] / weight[tid]
    else:
        distance[tid] = UNKNOWN


class DepthFusion:
    """A field that depth images are added to.

    Args:
        points: measured points that mark where the surface is [m], shape [point 3].
        voxel: edge of a voxel [m].
        truncation: distance beyond which what lies behind a surface is unknown [m].
        device: Warp device that holds the field and adds images; empty: a GPU where there is one.
    """

    def __init__(self, points: np.ndarray, voxel: float, truncation: float, device: str = "") -> None:
        device = device or ("cuda:0" if wp.is_cuda_available() else "cpu")
        block, reach = _BLOCK * voxel, max(_REACH * voxel, truncation)
        low = points.min(axis=0) - 2 * block - reach
        size = np.ceil((points.max(axis=0) - low + 2 * block + reach) / block).astype(int) + 1
        table = wp.zeros(tuple(int(n) for n in size), dtype=int, device="cpu")
        origin = wp.vec3(*map(float, low))
        placed = wp.array(points.astype(np.float32), dtype=wp.vec3, device="cpu")
        wp.launch(_mark, len(points), inputs=[placed, origin, block, reach], outputs=[table], device="cpu")
        rows = table.numpy()
        blocks = np.argwhere(rows).astype(np.int32)
        rows[...] = -1
        rows[tuple(blocks.T)] = np.arange(len(blocks), dtype=np.int32)
        count = len(blocks) * _BLOCK**3
        stored = wp.array(blocks, dtype=wp.vec3i, device=device)
        empty = [wp.zeros(count, dtype=float, device=device) for _ in range(3)]
        self._field = Field(voxel, origin, table, stored, empty[0], empty[1])
        self._paint, self._painted = wp.zeros(count, dtype=wp.vec3, device=device), empty[2]
        self._truncation, self._device = truncation, device

    def add(self, image: Image) -> None:
        """Add a frame."""
        field, device = self._field, self._device
        clean = without_edges(image.depth)
        depth = wp.array(clean, dtype=float, device=device)
        colors = np.zeros((0, 0, 3), np.float32) if image.color is None else image.color.astype(np.float32)
        color = wp.array(colors, dtype=wp.vec3, device=device)
        turn, eye = wp.mat33(*image.pose[:3, :3].T.reshape(-1).tolist()), wp.vec3(*image.pose[:3, 3].tolist())
        move = np.eye(4) if image.color_from_depth is None else image.color_from_depth
        nearest, coarse = np.zeros((0, 0), np.float32), 1.0
        if image.color_from_depth is not None and image.color is not None:
            nearest, coarse = _nearest(image, clean, move)
        cameras = [
            wp.vec4(*image.camera),
            wp.vec4(*image.color_camera),
            wp.mat33(*move[:3, :3].reshape(-1).tolist()),
            wp.vec3(*move[:3, 3].tolist()),
            wp.array(nearest, dtype=float, device=device),
            coarse,
        ]
        inputs = [field.blocks, field.origin, field.voxel, self._truncation, depth, color, turn, eye, *cameras]
        outputs = [field.distance, field.weight, self._paint, self._painted]

        def part(some: slice) -> None:
            wp.launch(_fuse, some.stop - some.start, inputs=[*inputs, some.start], outputs=outputs, device=device)

        if device == "cpu":
            in_parallel(part, chunks(len(field.weight)))
        else:
            part(slice(0, len(field.weight)))

    def surface(self, min_weight: float) -> Mesh:
        """Return the coloured surface; what was measured with less than some weight [1/m^2] is left out."""
        arrays = ("blocks", "distance", "weight")
        field = replace(self._field, **{name: getattr(self._field, name).to("cpu") for name in arrays})
        wp.launch(
            _average, len(field.weight), inputs=[min_weight, field.weight], outputs=[field.distance], device="cpu"
        )
        net = extract(field)
        painted = self._painted.numpy()[net.cells, None]
        colors = self._paint.numpy()[net.cells] / np.maximum(painted, 1e-9)
        return Mesh(net.points, net.faces, np.where(painted > 0, colors, GREY).clip(0, 255).astype(np.uint8))


def measured_points(images: Iterable[Image], step: int = 8) -> np.ndarray:
    """Return points of some images [m], every so many rows and columns, shape [point 3].

    Raises:
        InputError: no image has depth.
    """
    points = np.concatenate([_points(image, step) for image in images])
    if not len(points):
        raise InputError("no frame has depth that is near and confident enough; raise far, or check the unit of depth")
    return points


def without_edges(depth: np.ndarray) -> np.ndarray:
    """Return a depth image without the pixels whose neighbours are much nearer or farther, which blend two surfaces."""
    step = np.zeros(depth.shape, np.float32)
    for axis in (0, 1):
        difference = np.abs(np.diff(depth, axis=axis))
        ahead, behind = [slice(None)] * 2, [slice(None)] * 2
        ahead[axis], behind[axis] = slice(1, None), slice(None, -1)
        for side in (tuple(ahead), tuple(behind)):
            step[side] = np.maximum(step[side], difference)
    return np.where(step < _EDGE * depth, depth, 0).astype(np.float32)


def _nearest(image: Image, depth: np.ndarray, move: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the distance of the nearest point that the colour camera may see [m], in cells of its image, and a cell's edge.

    Cells are wide enough that a surface leaves none empty, as seen by half of the depth image's rows and columns.
    """
    assert image.color is not None
    wide = 4.0 * image.color_camera[0] / image.camera[0]
    shape = tuple(int(np.ceil(n / wide)) for n in image.color.shape[:2])
    x = _rays(image, depth[::2, ::2], 2) @ move[:3, :3].T + move[:3, 3]
    x = x[x[:, 2] > 0.1]
    fx, fy, cx, cy = image.color_camera
    columns = (fx * x[:, 0] / x[:, 2] + cx) / wide
    rows = (fy * x[:, 1] / x[:, 2] + cy) / wide
    inside = (columns >= 0) & (rows >= 0) & (columns < shape[1]) & (rows < shape[0])
    nearest = np.full(shape, np.inf, np.float32)
    np.minimum.at(nearest, (rows[inside].astype(int), columns[inside].astype(int)), x[inside, 2].astype(np.float32))
    return nearest, wide


def _rays(image: Image, depth: np.ndarray, step: int) -> np.ndarray:
    """Return the points of every so many rows and columns in the camera's coordinates [m], shape [point 3]."""
    rows, columns = np.mgrid[0 : depth.shape[0], 0 : depth.shape[1]] * step
    fx, fy, cx, cy = image.camera
    points: np.ndarray = (
        np.stack([(columns - cx) / fx, (rows - cy) / fy, np.ones(depth.shape)], axis=-1) * depth[..., None]
    )
    return points[depth > 0]


def _points(image: Image, step: int) -> np.ndarray:
    points: np.ndarray = _rays(image, without_edges(image.depth)[::step, ::step], step)
    return points @ image.pose[:3, :3].T + image.pose[:3, 3]
