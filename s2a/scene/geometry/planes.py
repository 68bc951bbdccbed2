"""Planar patches: detection in a noisy mesh, and covers of few thin boxes."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_closing
from scipy.spatial import ConvexHull

from s2a.core.bounds import Count, CountFromZero, NotNegative, Positive
from s2a.scene.geometry.convex import box
from s2a.scene.geometry.mesh_ops import centroids, normals
from s2a.scene.scene import Mesh

TILT = 0.8  # Cosine of the largest angle between a face and the plane it belongs to (37°: faces of a scan are rough)


@dataclass(frozen=True)
class Plane:
    """A planar patch of a surface."""

    normal: np.ndarray  # unit, out of the solid, shape [3]
    offset: float  # normal.x on the plane [m]
    faces: np.ndarray  # indices of its faces


def find_planes(mesh: Mesh, tolerance: float, min_area: float, count: int, seed: int = 0) -> list[Plane]:
    """Return the largest planes of a surface, largest first.

    Args:
        mesh: a surface, faces outwards.
        tolerance: largest distance of a face's centroid from its plane [m].
        min_area: smallest area of a plane [m^2].
        count: largest number of planes.
        seed: of the random candidates.
    """
    middle, facing, areas = centroids(mesh), normals(mesh), mesh.face_areas
    random = np.random.default_rng(seed)
    left = np.flatnonzero(areas > 0)
    planes: list[Plane] = []
    while len(planes) < count and areas[left].sum() >= min_area:
        plane = _best_plane(middle, facing, areas, left, tolerance, random)
        if plane is None or areas[plane.faces].sum() < min_area:
            break
        planes.append(plane)
        left = np.setdiff1d(left, plane.faces, assume_unique=True)
    return planes


def fit_plane(points: np.ndarray, weights: np.ndarray, towards: np.ndarray) -> tuple[np.ndarray, float]:
    """Return normal and offset of the plane that fits points [point 3] best; the normal looks along `towards`."""
    center = np.average(points, axis=0, weights=weights)
    spread = (points - center).T @ ((points - center) * weights[:, None])
    normal = np.linalg.eigh(spread)[1][:, 0]
    normal = normal if normal @ towards >= 0 else -normal
    return normal, float(normal @ center)


def slabs(mesh: Mesh, plane: Plane, cell: float, closing: int, thickness: float, count: int) -> list[Mesh]:
    """Cover a plane's faces with boxes [m] behind it: few large rectangles of the cells that its faces occupy.

    Args:
        mesh: the surface.
        plane: one of its planes.
        cell: width of a cell [m].
        closing: gaps up to twice as many cells wide are closed.
        thickness: of the boxes [m].
        count: largest number of boxes.
    """
    triangles = mesh.vertices[mesh.faces[plane.faces]].astype(np.float64)
    axes = plane_axes(plane.normal, triangles.reshape(-1, 3))
    corners = triangles @ axes[:, :2]
    low = corners.min(axis=(0, 1))
    taken = _raster(corners - low, cell, closing)
    boxes = []
    for first, last in rectangles(taken, count, min_fraction=0.97):
        size = (last - first) * cell
        middle = low + (first + last) / 2 * cell
        center = axes[:, :2] @ middle + plane.normal * (plane.offset - thickness / 2)
        boxes.append(box(center, axes, np.array([*size, thickness])))
    return boxes


def rectangles(taken: np.ndarray, count: int, min_fraction: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Cover the true cells of a grid by rectangles, largest first, until a fraction of them is covered.

    Returns:
        Pairs of first cell and last cell + 1, shape [2] each; a rectangle holds true cells only.
    """
    left = taken.copy()
    intervals: list[tuple[np.ndarray, np.ndarray]] = []
    while len(intervals) < count and left.sum() > (1 - min_fraction) * taken.sum():
        first, last = _largest_rectangle(left)
        left[first[0] : last[0], first[1] : last[1]] = False
        intervals.append((first, last))
    return intervals


def _best_plane(
    middle: np.ndarray,
    facing: np.ndarray,
    areas: np.ndarray,
    left: np.ndarray,
    tolerance: float,
    random: np.random.Generator,
) -> Plane | None:
    """Return the plane with the largest area among the remaining faces, fitted to them."""
    few = left if len(left) < 4000 else random.choice(left, 4000, replace=False)
    seeds = random.choice(left, min(64, len(left)), replace=False, p=areas[left] / areas[left].sum())
    heights = np.abs(middle[few] @ facing[seeds].T - np.einsum("ij,ij->i", middle[seeds], facing[seeds]))
    near = (heights < 2 * tolerance) & (facing[few] @ facing[seeds].T > TILT)
    seed = seeds[np.argmax(areas[few] @ near)]
    normal, offset = facing[seed], float(middle[seed] @ facing[seed])
    faces = left[:0]
    for width in (2 * tolerance, tolerance, tolerance):
        faces = left[(np.abs(middle[left] @ normal - offset) < width) & (facing[left] @ normal > TILT)]
        if len(faces) < 1:
            return None
        normal, offset = fit_plane(middle[faces], areas[faces], normal) if len(faces) > 3 else (normal, offset)
    return Plane(normal, offset, faces)


def across(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit vectors across an axis and each other, shape [3] each."""
    u = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    u /= np.linalg.norm(u)
    return u, np.cross(axis, u)


def plane_axes(normal: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return a rotation [3 3]: two directions in the plane and its normal.

    The first is horizontal in an upright plane; in others it runs along a side of the smallest rectangle around the
    points.
    """
    x = np.cross([0.0, 0.0, 1.0], normal)
    if np.linalg.norm(x) < 0.3:
        x = np.cross([0.0, 1.0, 0.0], normal)
    x /= np.linalg.norm(x)
    axes = np.stack([x, np.cross(normal, x), normal], axis=1)
    if abs(normal[2]) > 0.95:
        turn = np.eye(3)
        turn[:2, :2] = min_area_rectangle(points @ axes[:, :2])
        axes = axes @ turn
    return axes


def min_area_rectangle(points: np.ndarray) -> np.ndarray:
    """Return the sides of the smallest rectangle around points [point 2] as columns of a rotation [2 2]."""
    corners = points[ConvexHull(points).vertices]
    edges = np.roll(corners, -1, axis=0) - corners
    along = edges / np.linalg.norm(edges, axis=1, keepdims=True)
    turns = np.stack([along, np.stack([-along[:, 1], along[:, 0]], axis=1)], axis=2)
    sizes = np.ptp(np.einsum("pd,tdk->tpk", corners, turns), axis=1).prod(axis=1)
    return turns[np.argmin(sizes)]


def _raster(corners: np.ndarray, cell: float, closing: int) -> np.ndarray:
    """Return the cells that triangles [face 3 2] touch (by points no farther apart than half a cell), gaps closed."""
    shape = np.ceil(corners.max(axis=(0, 1)) / cell).astype(int) + 1
    taken = np.zeros(shape, bool)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    steps = np.maximum(1, np.ceil(2 * longest / cell).astype(int))
    for step in np.unique(steps):
        i, j = np.array([(i, j) for i in range(step + 1) for j in range(step + 1 - i)]).T
        weights = np.stack([i, j, step - i - j], axis=1) / step
        points = np.einsum("wk,fkd->fwd", weights, corners[steps == step]).reshape(-1, 2)
        taken[tuple((points / cell).astype(int).T)] = True
    margin = closing + 1
    closed = binary_closing(np.pad(taken, margin), np.ones((2 * closing + 1,) * 2))
    return closed[margin:-margin, margin:-margin]


def _largest_rectangle(taken: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest rectangle of true cells as first cell and last cell + 1, by the histogram method."""
    heights = np.zeros(taken.shape[1], int)
    best, corners = 0, (np.zeros(2, int), np.zeros(2, int))
    for row in range(taken.shape[0]):
        heights = np.where(taken[row], heights + 1, 0)
        stack: list[int] = []
        for column in range(len(heights) + 1):
            height = heights[column] if column < len(heights) else 0
            while stack and heights[stack[-1]] >= height:
                tall = heights[stack.pop()]
                left = stack[-1] + 1 if stack else 0
                if tall * (column - left) > best:
                    best = tall * (column - left)
                    corners = (np.array([row - tall + 1, left]), np.array([row + 1, column]))
            stack.append(column)
    return corners


@dataclass(frozen=True, kw_only=True)
class RansacConfig:
    """RANSAC for one plane."""

    threshold: Positive = 0.01  # largest distance of an inlier [m]
    iterations: Count = 1000  # number of planes that are drawn, each through three random points
    max_tilt: NotNegative = 0.26  # largest angle between the plane's normal and the requested direction [rad]
    seed: CountFromZero = 0  # of the random choices


def ransac_plane(points: np.ndarray, upright: bool, config: RansacConfig) -> Plane | None:
    """Return the horizontal (or vertical) plane with the most inliers, as it was drawn; None if no draw had that direction.

    `points`: shape [point 3], [m]; `upright`: Find a vertical plane instead of a horizontal one.

    Returns:
        A plane whose `faces` are the indices of its inliers among the points.
    """
    if len(points) < 3:
        return None
    points = np.asarray(points, np.float64)
    a, b, c = points[np.random.default_rng(config.seed).integers(len(points), size=(3, config.iterations))]
    across = np.cross(b - a, c - a)
    length = np.linalg.norm(across, axis=1)
    normal = across / np.maximum(length, 1e-12)[:, None]
    tilt = np.abs(normal[:, 2])
    wanted = (length > 1e-12) & ((tilt < np.sin(config.max_tilt)) if upright else (tilt > np.cos(config.max_tilt)))
    if not wanted.any():
        return None
    normal, offset = normal[wanted], np.einsum("ij,ij->i", normal, a)[wanted]
    best = int(
        np.argmax([np.sum(np.abs(points @ n - d) < config.threshold) for n, d in zip(normal, offset, strict=True)])
    )
    up = normal[best] * (-1.0 if normal[best][2] < 0 else 1.0)
    offset = float(up @ a[wanted][best])
    return Plane(up, offset, np.flatnonzero(np.abs(points @ up - offset) < config.threshold))
