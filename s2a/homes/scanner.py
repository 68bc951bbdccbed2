"""Scanner on a tripod or in a hand: from a furnished room to one noisy surface with holes.

A hand-held scanner also drifts along its path, and its fused surface is smoothed.
"""

from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Literal

import numpy as np
import warp as wp
from scipy.sparse import coo_array

from s2a.core.bounds import AtLeast, CountFromZero, Fraction, NotNegative, Positive
from s2a.core.progress import track
from s2a.core.workers import chunks, in_parallel
from s2a.homes.panorama import NoiseConfig, View, cast_panorama, direction_pixel, measure, pixel_direction
from s2a.homes.solids import rotation, translation
from s2a.scene.geometry.mesh_query import RayMesh
from s2a.scene.geometry.surface_nets import UNKNOWN, Field, Net, ThinConfig, extract, mark_blocks, thin, voxel_place


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

    `bounds`: smallest and largest corner of what is of interest [m], shape [2 3]; what lies outside is cropped.
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


# Share of the reach by which a vertex lies behind what was measured, on average over the panoramas, from which on it
# moves less, and not at all: so far behind hang the skirts along the edges of shadows, which no one has measured
BEHIND = (0.33, 0.66)
ALIKE = 0.5  # Cosine of the largest angle between a vertex's normal and those of the planes onto which it is drawn


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

    `reach`: planes farther than this from a vertex, across or along the ray, are of something else [m].
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


@dataclass(frozen=True)
class DriftConfig:
    """Errors of the places and directions in which a scanner believes to be: a random walk from pose to pose.

    Attributes:
        step: standard deviation of what each pose adds to the error of its place, along each axis [m].
        turn: the same of its orientation, about each axis [rad].
        closure: fraction of the error at the last pose that closing the loop takes back, spread over all poses.
    """

    step: NotNegative
    turn: NotNegative
    closure: NotNegative


def drifts(count: int, config: DriftConfig, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return errors of places [m] and rotation vectors [rad], shape [pose 3] each; nothing is drawn where there are none."""
    if config.step == 0.0 and config.turn == 0.0:
        return np.zeros((count, 3)), np.zeros((count, 3))
    walks = []
    for size in (config.step, config.turn):
        walk = np.cumsum(rng.normal(0.0, size, (count, 3)), axis=0)
        walks.append(walk - config.closure * np.linspace(0.0, 1.0, count)[:, None] * walk[-1])
    return walks[0], walks[1]


def smoothed(net: Net, passes: int) -> Net:
    """Return a surface whose vertices moved half way to the mean of their neighbours, so many times."""
    points = net.points
    if not passes:
        return net
    edges = np.concatenate([net.faces[:, [0, 1]], net.faces[:, [1, 2]], net.faces[:, [2, 0]]])
    both = np.concatenate([edges, edges[:, ::-1]])
    links = coo_array((np.ones(len(both), np.float32), both.T), shape=(len(points), len(points))).tocsr()
    count = np.maximum(np.asarray(links.sum(axis=1)).reshape(-1, 1), 1.0)
    for _ in range(passes):
        points = 0.5 * points + 0.5 * (links @ points) / count
    return replace(net, points=points.astype(np.float32))


@dataclass(frozen=True)
class ScannerConfig:
    """How a room is scanned.

    Attributes:
        name: name of the scanner.
        poses: number of places from which it is scanned.
        spacing: mean angle between rays [rad].
        reach: longest range that is measured [m].
        noise: errors of the ranges.
        drift: errors of the places.
        dark: fraction of the rays that a black surface swallows; less on lighter ones, none from a luminance of LIGHT on.
        fusion: how all panoramas become one surface.
        smooth: passes of averaging over neighbouring vertices after the fusion.
        project_to_scan: Project vertices onto the measured planes, which keeps a laser's detail.
        colors: "surface": of the nearest true surface; "camera": of what is seen from where the scanner stood, so that a
            handle that is missing in the mesh is painted on its front.
        thin: how that surface is thinned out.
        glb: Write a textured GLB with y up beside the annotated scan.
    """

    name: str
    poses: Annotated[int, AtLeast(4, 24)]
    spacing: Positive
    reach: Positive
    noise: NoiseConfig
    drift: DriftConfig
    dark: Fraction
    fusion: FusionConfig
    smooth: CountFromZero
    project_to_scan: bool
    colors: Literal["surface", "camera"]
    thin: ThinConfig
    glb: bool


def scan(
    mesh: RayMesh,
    dropout: np.ndarray,
    yaw: float,
    scanners: np.ndarray,
    bounds: np.ndarray,
    config: ScannerConfig,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the scanned surface: vertices [m] in the scene, shape [vertex 3], float32, and faces, shape [face 3], int32.

    Args:
        mesh: the room in its own frame.
        dropout: share of rays that each face swallows, shape [face].
        yaw: rotation of the room's frame about z against the scene [rad].
        scanners: where the scanner stood in the scene [m], shape [pose 3].
        bounds: of what is of interest in the scene [m], shape [2 3].
        config: the scanner.
        rng: where its errors come from.
    """
    T_room_scene = rotation((0.0, 0.0, -yaw))
    offsets, turns = drifts(len(scanners), config.drift, rng)
    panoramas = []
    for i, errors in track(list(enumerate(rng.spawn(len(scanners)))), "scan"):
        pose = T_room_scene @ translation(scanners[i]) @ rotation(turns[i])
        ranges = cast_panorama(mesh, dropout, pose, config.spacing, config.noise, errors)
        panoramas.append(np.where(ranges > config.reach, np.float32(0.0), ranges))
    views = measure(panoramas, scanners + offsets, config.spacing)
    net = extract(fuse(views, bounds, config.fusion))
    net = project_to_scan(net, views, config.fusion.voxel) if config.project_to_scan else net
    return thin(smoothed(net, config.smooth), config.thin)
