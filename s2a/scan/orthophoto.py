"""Orthophotos of planes: photos of a recording, seen square on, from the keyframes that see a plane best."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from s2a.core.errors import InputError
from s2a.scan.recording import KEYFRAME_LIST, KEYFRAMES, Intrinsics
from s2a.scan.recording_files import image_file, image_size
from s2a.scene.geometry.mesh_ops import centroids, normals
from s2a.scene.geometry.mesh_query import RayMesh, first_hits, ray_mesh
from s2a.scene.geometry.planes import fit_plane, plane_axes
from s2a.scene.scene import Mesh

UNSEEN = (255, 255, 255)  # RGB where no keyframe sees the plane
SIDE = 8000  # Most pixels along one side of an orthophoto

_CELL = 0.03  # [m] on which views are compared
_STEEP = 0.2  # cosine of the angle to the normal below which a view says nothing
_CLEAR = 0.06  # [m] off the plane from which on something hides it: handles and the scan's noise do not
_BORDER = 6  # [pixel] of a photo that are not used
_MUCH, _LITTLE = (
    1.5,
    0.02,
)  # times better than the other views, and share of the whole, from which on one more is worth a seam
_SEAM = 5.0  # [pixel] over which neighbouring views blend


@dataclass(frozen=True, eq=False)
class Keyframe:
    """A photo that a scan keeps."""

    image: Path  # its file
    camera: Intrinsics  # intrinsics
    pose: np.ndarray  # camera to scan, x right, y down, z forward, [m], shape [4 4]
    sharpness: float  # mean square of what neighbouring pixels do not foretell


@dataclass(frozen=True, eq=False)
class Rectangle:
    """A rectangle in space that is seen from its front."""

    center: np.ndarray  # [m], shape [3]
    axes: np.ndarray  # columns are right and up as the viewer sees them, and the normal towards the viewer, shape [3 3]
    size: tuple[float, float]  # width and height [m]

    def points(self, rows: np.ndarray, columns: np.ndarray, pixel: float) -> np.ndarray:
        """Return the places of pixels, counted from the left upper corner, shape [... 3]."""
        right = (columns + 0.5) * pixel - self.size[0] / 2
        up = self.size[1] / 2 - (rows + 0.5) * pixel
        places: np.ndarray = self.center + right[..., None] * self.axes[:, 0] + up[..., None] * self.axes[:, 1]
        return places


@dataclass(frozen=True, eq=False)
class Orthophoto:
    """A plane seen square on."""

    image: np.ndarray  # RGB, first row on top, shape [row column 3], uint8; UNSEEN where no keyframe sees it
    seen: np.ndarray  # True where one does, shape [row column]
    used: tuple[str, ...]  # names of the photos that it shows


def read_keyframes(folder: Path) -> list[Keyframe]:
    """Return the photos that the folder of a scan keeps; InputError: none there, or a damaged list."""
    path = folder / KEYFRAMES / KEYFRAME_LIST
    if not path.is_file():
        raise InputError(f"{folder}: has no photos; only a scan of s2a import frames=RECORDING has them")
    try:
        records = json.loads(path.read_text(encoding="utf-8"))["frames"]
        frames = [
            Keyframe(
                path.parent / record["image"],
                Intrinsics(**record["camera"]),
                np.array(record["camera_to_scan"], dtype=float).reshape(4, 4),
                float(record["sharpness"]),
            )
            for record in records
        ]
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: damaged ({type(error).__name__} {str(error)[:80]})") from error
    missing = [frame.image.name for frame in frames if not frame.image.is_file()]
    if missing:
        raise InputError(f"{path}: {len(missing)} of {len(frames)} photos are missing, first {missing[0]}")
    return frames


def upright(center: Sequence[float], yaw: float, size: tuple[float, float]) -> Rectangle:
    """Return an upright rectangle whose front looks along (cos yaw, sin yaw, 0)."""
    normal = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    right = np.array([-normal[1], normal[0], 0.0])
    return Rectangle(np.array(center, dtype=float), np.stack([right, [0.0, 0.0, 1.0], normal], axis=1), size)


def around(mesh: Mesh, margin: float = 0.05) -> Rectangle:
    """Return the rectangle around a surface, in the plane that fits it best and on the side that its faces look to.

    `mesh`: such as the front of a drawer [m]; `margin`: that the rectangle is wider on each side [m].

    Raises:
        InputError: the surface has no area.
    """
    areas = mesh.face_areas
    if not len(areas) or areas.sum() <= 0:
        raise InputError("a surface without area has no orthophoto")
    towards = (normals(mesh) * areas[:, None]).sum(axis=0)
    normal, offset = fit_plane(centroids(mesh), areas, towards)
    axes = plane_axes(normal, mesh.vertices)
    places = mesh.vertices @ axes
    low, high = places[:, :2].min(axis=0) - margin, places[:, :2].max(axis=0) + margin
    width, height = (high - low).tolist()
    return Rectangle(axes @ np.array([*(low + high) / 2, offset]), axes, (width, height))


def orthophoto(
    keyframes: Sequence[Keyframe], rectangle: Rectangle, surface: Mesh | None = None, pixel: float = 0.002
) -> Orthophoto:
    """Return a rectangle as the keyframes see it.

    Each place shows the photo that sees it best: square on, near, sharp, and with nothing of the surface before it. Photos that
    see much of the rectangle are preferred, so that seams are few; their brightness is matched.

    Args:
        keyframes: photos.
        rectangle: what is seen.
        surface: of the scan, which hides what is behind it; None: nothing is hidden.
        pixel: edge of a pixel [m].

    Raises:
        InputError: the image would be too large, no photo sees the rectangle, or one cannot be read.
    """
    width, height = (max(1, round(length / pixel)) for length in rectangle.size)
    if max(width, height) > SIDE:
        raise InputError(f"an orthophoto of {width} x {height} pixels is larger than {SIDE}; give larger pixels")
    step = max(1, round(_CELL / pixel))
    rows, columns = np.mgrid[0 : height + step : step, 0 : width + step : step]
    cells = rectangle.points(rows, columns, pixel)
    tree = ray_mesh(surface.vertices, surface.faces) if surface is not None and len(surface.faces) else None
    typical = float(np.median([frame.sharpness for frame in keyframes])) if keyframes else 1.0
    scores = [_score(frame, cells, rectangle, pixel, typical, tree) for frame in keyframes]
    totals = np.array([score.sum() for score in scores])
    if not len(totals) or totals.max() <= 0:
        raise InputError(f"none of {len(keyframes)} photos sees the rectangle from its front")
    weighted = np.stack(scores) * (0.25 + 0.75 * totals / totals.max())[:, None, None]
    views = _few(weighted)
    image, best, label = _merged(keyframes, views, weighted, rectangle, (height, width), step, pixel)
    seen = best > 0
    image[~seen] = UNSEEN
    used = [keyframes[view].image.name for place, view in enumerate(views) if (seen & (label == place)).any()]
    return Orthophoto(np.clip(np.round(image), 0, 255).astype(np.uint8), seen, tuple(used))


def _few(scores: np.ndarray) -> list[int]:
    """Return the views [view row column] that show all that any shows, as few as do so well, the most useful first."""
    aim = scores.max(axis=0)
    views: list[int] = []
    current = np.zeros(scores.shape[1:])
    while True:
        # A view counts where it shows what none does yet, or much better than those that are taken.
        gains = np.where(scores > _MUCH * current, scores - current, 0.0).sum(axis=(1, 2))
        best = int(gains.argmax())
        if views and gains[best] < _LITTLE * aim.sum():
            return views
        views.append(best)
        current = np.maximum(current, scores[best])


def _merged(
    keyframes: Sequence[Keyframe],
    views: list[int],
    weighted: np.ndarray,
    rectangle: Rectangle,
    shape: tuple[int, int],
    step: int,
    pixel: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the image, the best score of each pixel and the place in `views` of the view that has it."""
    rows, columns = np.mgrid[0 : shape[0], 0 : shape[1]]
    fine = np.stack([rows, columns]) / step
    best, label = np.zeros(shape), np.zeros(shape, int)
    for place, view in enumerate(views):
        score = map_coordinates(weighted[view], fine, order=1, mode="nearest")
        # What a cell's corner does not see, no pixel beside it shows.
        score *= map_coordinates((weighted[view] > 0).astype(float), fine, order=1, mode="nearest") > 0.5
        better = score > best
        best[better], label[better] = score[better], place
    places = rectangle.points(rows, columns, pixel)
    total, weight = np.zeros((*shape, 3)), np.zeros(shape)
    for place, view in enumerate(views):
        mask = gaussian_filter(((label == place) & (best > 0)).astype(np.float32), _SEAM)
        taken = mask > 1e-3
        if not taken.any():
            continue
        colors, inside = _colors(keyframes[view], places[taken])
        mask = mask[taken] * inside
        done = weight[taken]
        both = (done > 0.05) & (mask > 0.05)
        if both.sum() > 200:  # the same place has the same brightness in both
            earlier = (total[taken][both] / done[both, None]).mean(axis=0)
            colors = colors * np.clip(earlier / np.maximum(colors[both].mean(axis=0), 1.0), 0.6, 1.6)
        total[taken] += mask[:, None] * colors
        weight[taken] += mask
    best[weight <= 0] = 0.0
    return total / np.maximum(weight, 1e-9)[..., None], best, label


def _score(
    frame: Keyframe, cells: np.ndarray, rectangle: Rectangle, pixel: float, typical: float, tree: RayMesh | None
) -> np.ndarray:
    """Return how well a photo shows some places [row column 3]: 0 where it does not, shape [row column]."""
    eye = frame.pose[:3, 3]
    towards = eye - cells
    distance = np.linalg.norm(towards, axis=-1)
    cosine = (towards @ rectangle.axes[:, 2]) / np.maximum(distance, 1e-9)
    columns, rows, ahead = _pixels(frame, cells)
    width, height = image_size(frame.image)
    inside = (columns >= _BORDER) & (rows >= _BORDER) & (columns < width - _BORDER) & (rows < height - _BORDER)
    shown = inside & (ahead > 0.1) & (cosine > _STEEP)
    if tree is not None and shown.any():
        start = cells[shown] + (_CLEAR / cosine[shown] / distance[shown])[:, None] * towards[shown]
        rays = eye - start
        length = np.linalg.norm(rays, axis=1)
        shown[shown] = first_hits(tree, start, rays / length[:, None]) > length
    # Pixels of the photo across one of the orthophoto, of use up to two; a steep view has fewer.
    detail = np.minimum(frame.camera.fx * pixel / np.maximum(distance, 1e-3), 2.0)
    sharp = np.clip(np.sqrt(frame.sharpness / max(typical, 1e-9)), 0.5, 1.5)
    return np.where(shown, np.maximum(cosine, 0.0) ** 1.5 * detail * sharp, 0.0)


def _pixels(frame: Keyframe, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return column, row and distance along the optical axis [m] of points [... 3] in a photo, shape [...] each."""
    x = (points - frame.pose[:3, 3]) @ frame.pose[:3, :3]
    ahead = np.where(x[..., 2] > 1e-6, x[..., 2], 1e-6)
    camera = frame.camera
    return camera.fx * x[..., 0] / ahead + camera.cx, camera.fy * x[..., 1] / ahead + camera.cy, x[..., 2]


def _colors(frame: Keyframe, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the colours of points [point 3] in a photo, shape [point 3], and whether they are in it, shape [point]."""
    with image_file(frame.image, frame.image) as image:
        photo = np.asarray(image.convert("RGB")).astype(np.float32)
    columns, rows, ahead = _pixels(frame, points)
    inside = (
        (columns >= 0) & (rows >= 0) & (columns <= photo.shape[1] - 1) & (rows <= photo.shape[0] - 1) & (ahead > 0.1)
    )
    colors = [map_coordinates(photo[..., band], [rows, columns], order=1, mode="nearest") for band in range(3)]
    return np.stack(colors, axis=-1), inside
