"""A depth camera before the furniture, and the points of a part in its frame."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from scipy.spatial.transform import Rotation

from s2a import robot
from s2a.core.bounds import Above, AtLeast, Count, NotNegative, Positive
from s2a.core.cache import UNREADABLE
from s2a.core.errors import InputError
from s2a.robot.collision import robot_shape
from s2a.robot.tool_path import matrices
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.mesh_query import Forest, first_hits
from s2a.scene.scene import Mesh
from s2a.scene.usd.sim_scene import SimRoom, in_scene
from s2a.sim.world import SimStage

SAME = 1e-4  # [m] A ray meets a triangle at the same distance in two search trees, but for rounding


class VisibleRoom:
    """The visuals of a room, as one surface and one a body; search trees are made once and shared."""

    def __init__(self, room: SimRoom) -> None:
        self._surfaces = {
            body.id: Mesh(in_scene(body, body.visual), body.visual.faces)
            for body in (*room.bodies.values(), *room.free.values())
            if len(body.visual.faces)
        }
        static = Mesh(room.static_visual.vertices, room.static_visual.faces)
        self._all = Forest([merge([static, *self._surfaces.values()])])

    def surface(self, part: str) -> Mesh | None:
        """Return the surface of what moves with a part, scene coordinates [m]; None where it has none."""
        return self._surfaces.get(part)

    def hits(self, start: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Return the distances at which rays meet the room [m], shape [ray]; inf where they do not.

        `start`: where all rays begin [m], shape [3]; `directions`: unit vectors, shape [ray 3].
        """
        return first_hits(self._all, np.broadcast_to(start, directions.shape), directions)

    def shows(self, part: str, start: np.ndarray, directions: np.ndarray, hits: np.ndarray) -> np.ndarray:
        """Return which rays meet a part first, shape [ray]; `hits` is what `hits` returned for them."""
        own = first_hits(Forest([self._surfaces[part]]), np.broadcast_to(start, directions.shape), directions)
        return own <= hits + SAME


ATTEMPTS = 40  # Places that are drawn for a camera
VISIBLE = 0.3  # Fraction of the grasp region's points that a place has to see
REGION_POINTS = 48  # Points of the grasp region that are asked for
OWN_SURFACE = 0.01  # [m] So much before a point, a surface no longer hides it: it may be its own
MARGIN = 0.15  # Fraction of the part's extent in the image by which it is cut out wider


@dataclass(frozen=True, kw_only=True)
class DepthCameraConfig:
    """A depth camera on a stand, of a kind like Intel's D435, and where it may stand.

    Attributes:
        width: [pixel].
        height: [pixel].
        fov: vertical field of view [rad].
        distance: minimum and maximum distance from the part [m].
        noise: standard deviation of the depth of a pixel at a distance of 1 m [m]; it grows with the distance squared.
    """

    width: Count
    height: Count
    fov: Annotated[float, Above(0.0, 3.0)]
    distance: tuple[Positive, Positive]
    # how far to the side of the line from part to robot it stands at most, turned about z [rad]. [rad] to either
    # side of the line from part to robot
    azimuth: NotNegative = 0.9
    elevation: tuple[float, float] = (0.15, 0.7)  # least and greatest height above the part's horizon [rad]
    aim_error: NotNegative = 0.1  # how far from the part's middle it is aimed at most, in each direction [m]
    noise: NotNegative
    # error of its place in the robot's base frame: standard deviation in each direction [m]
    calibration_shift: NotNegative = 0.002
    calibration_turn: NotNegative = 0.003  # error of its orientation: standard deviation about each axis [rad]
    points: Annotated[int, AtLeast(64)] = 1024  # number of points that are kept of a frame


@dataclass(frozen=True)
class PartCloud:
    """Points of a frame on a part and around it."""

    points: np.ndarray  # in the robot's base frame [m], shape [point 3]
    is_part: np.ndarray  # which lie on the part, as a segmentation mask tells, shape [point]


def capture(
    room: VisibleRoom, stage: SimStage, config: DepthCameraConfig, random: np.random.Generator
) -> PartCloud | None:
    """Return a frame of a stage's part from a place that sees its grasp region, the robot at the start of an episode.

    `room`: the visuals of the stage's room, at the scanned pose.

    Returns:
        All pixels on the part and around it; None where no pixel shows the part.
    """
    surface = room.surface(stage.target)
    if surface is None:
        return None
    links = _robot_spheres(stage)
    eye, axes = _place(room, stage, surface.vertices, links, config, random)
    rays = _rays(surface.vertices, eye, axes, config)
    distance = room.hits(eye, rays)
    seen = np.isfinite(distance) & (distance < _sphere_hits(eye, rays, *links))
    rays, distance = rays[seen], distance[seen]
    is_part = room.shows(stage.target, eye, rays, distance)
    if not is_part.any():
        return None
    forward = rays @ axes[:, 2]
    depth = distance * forward
    depth += config.noise * depth**2 * random.normal(size=len(depth))
    turn = Rotation.from_rotvec(random.normal(0.0, config.calibration_turn, 3)).as_matrix()
    points = (depth / forward)[:, None] * rays @ turn.T + eye + random.normal(0.0, config.calibration_shift, 3)
    to_base = np.linalg.inv(matrices(stage.base[None])[0])
    return PartCloud(points @ to_base[:3, :3].T + to_base[:3, 3], is_part)


def _place(
    room: VisibleRoom,
    stage: SimStage,
    part: np.ndarray,
    links: tuple[np.ndarray, np.ndarray],
    config: DepthCameraConfig,
    random: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Return where a camera stands [m], shape [3], and its right, up and forward axes, columns of [3 3].

    The first place drawn that sees enough of the grasp region, else the one that sees most of it.
    """
    region = stage.region.vertices[np.unique(stage.region.faces)]
    region = random.permutation(region)[:REGION_POINTS]
    middle = 0.5 * (part.min(axis=0) + part.max(axis=0))
    back = stage.base[:2] - middle[:2]
    heading = float(np.arctan2(back[1], back[0]))
    best, most = middle, -1.0
    for _ in range(ATTEMPTS):
        around = heading + random.uniform(-config.azimuth, config.azimuth)
        up = random.uniform(*config.elevation)
        away = np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
        eye = middle + random.uniform(*config.distance) * away
        free = _visible_fraction(room, eye, region, links)
        if free > most:
            best, most = eye, free
        if most >= VISIBLE:
            break
    aim = middle + random.uniform(-config.aim_error, config.aim_error, 3)
    forward = (aim - best) / np.linalg.norm(aim - best)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return best, np.stack([right, np.cross(right, forward), forward], axis=1)


def _visible_fraction(
    room: VisibleRoom, eye: np.ndarray, points: np.ndarray, links: tuple[np.ndarray, np.ndarray]
) -> float:
    """Return the fraction of points [point 3] that a camera sees."""
    rays = points - eye
    far = np.linalg.norm(rays, axis=1)
    rays /= far[:, None]
    nearest = np.minimum(room.hits(eye, rays), _sphere_hits(eye, rays, *links))
    return float(np.mean(nearest > far - OWN_SURFACE))


def _rays(part: np.ndarray, eye: np.ndarray, axes: np.ndarray, config: DepthCameraConfig) -> np.ndarray:
    """Return the directions of the pixels on and around a part, shape [ray 3], unit vectors."""
    half = np.tan(0.5 * config.fov) * np.array([config.width / config.height, 1.0])
    size = np.array([config.width, config.height])
    ahead = (part - eye) @ axes
    ahead = ahead[ahead[:, 2] > 1e-3]
    if not len(ahead):
        return np.zeros((0, 3))
    pixel = 0.5 * (1.0 + ahead[:, :2] / ahead[:, 2:] / half) * size
    low, high = pixel.min(axis=0), pixel.max(axis=0)
    margin = MARGIN * (high - low)
    low = np.clip(np.floor(low - margin), 0, size).astype(int)
    high = np.clip(np.ceil(high + margin), 0, size).astype(int)
    columns, rows = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
    plane = (2.0 * (np.stack([columns.ravel(), rows.ravel()], axis=1) + 0.5) / size - 1.0) * half
    rays = plane @ axes[:, :2].T + axes[:, 2]
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def _robot_spheres(stage: SimStage) -> tuple[np.ndarray, np.ndarray]:
    """Return centers [m], shape [sphere 3], scene frame, and radii [m] of spheres that cover the robot at its start."""
    spec = robot.load(stage.robot)
    shape, base = robot_shape(spec), matrices(stage.base[None])[0]
    return shape.centers(np.array([spec.home]))[0] @ base[:3, :3].T + base[:3, 3], shape.radii


def _sphere_hits(eye: np.ndarray, rays: np.ndarray, centers: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Return the distance at which each ray [ray 3] enters one of some spheres [m], shape [ray]; inf where it misses them."""
    nearest = np.full(len(rays), np.inf)
    for center, radius in zip(centers - eye, radii, strict=True):
        along = rays @ center
        reach = along**2 - (center @ center - radius**2)
        hit = (reach > 0.0) & (along > 0.0)
        nearest[hit] = np.minimum(nearest[hit], along[hit] - np.sqrt(reach[hit]))
    return nearest


PLANES = 64  # Planes through three points that are tried for the front
# [m] Distance from the front's plane up to which a point is of the front: three standard deviations of depth at 1 m
FLAT = 0.006
AROUND = 0.15  # Fraction of the points that lie beside the part
PROTRUDING = 0.5  # Fraction of the points that stand out of the front, at most


@dataclass(frozen=True)
class PartPoints:
    """Points of a part, ready for a network."""

    center: np.ndarray  # mean of the part's points, in the robot's base frame [m], shape [3], float32
    points: np.ndarray  # relative to it [m], shape [point 3], float16: 0.2 mm where it is coarsest
    is_part: np.ndarray  # shape [point]
    height: np.ndarray  # above the front's plane, towards the robot positive [m], shape [point], float16


def sample(frame: PartCloud, count: int, random: np.random.Generator) -> PartPoints:
    """Return `count` points of a frame; some of them more than once where it has too few."""
    part = frame.points[frame.is_part]
    center = part.mean(axis=0)
    height = _height(frame.points, part, center, random)
    stands_out = frame.is_part & (np.abs(height) > FLAT)
    flat = frame.is_part & ~stands_out
    beside = _draw(~frame.is_part, round(AROUND * count), random)
    out = _draw(stands_out, round(PROTRUDING * count), random)
    rest = count - len(beside) - len(out)
    others = np.flatnonzero(flat if flat.any() else frame.is_part)
    chosen = np.concatenate([beside, out, random.choice(others, rest, replace=rest > len(others))])
    return PartPoints(
        center.astype(np.float32),
        (frame.points[chosen] - center).astype(np.float16),
        frame.is_part[chosen],
        height[chosen].astype(np.float16),
    )


def _draw(mask: np.ndarray, most: int, random: np.random.Generator) -> np.ndarray:
    """Return indices of a mask, at most so many."""
    index = np.flatnonzero(mask)
    return random.choice(index, most, replace=False) if len(index) > most else index


def _height(points: np.ndarray, part: np.ndarray, center: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the distance of points [point 3] from the plane that most of the part's lie on [m], positive towards the robot."""
    some = part[random.integers(len(part), size=(PLANES, 3))]
    normals = np.cross(some[:, 1] - some[:, 0], some[:, 2] - some[:, 0])
    length = np.linalg.norm(normals, axis=1)
    normals = normals[length > 1e-9] / length[length > 1e-9, None]
    if not len(normals):
        return np.zeros(len(points))
    few = part[random.integers(len(part), size=1024)]
    offsets = np.einsum("pk,pk->p", some[length > 1e-9, 0], normals)
    on = np.abs(few @ normals.T - offsets) < FLAT
    best = int(on.sum(axis=0).argmax())
    inliers = few[on[:, best]]
    middle = inliers.mean(axis=0)
    normal = np.linalg.svd(inliers - middle, full_matrices=False)[2][-1]
    toward_robot = np.array([0.0, 0.0, 0.8]) - center  # about where the robot's shoulder and a camera are
    normal *= 1.0 if normal @ toward_robot > 0.0 else -1.0
    return np.clip((points - middle) @ normal, -1.0, 1.0)


NAMES = tuple(field.name for field in fields(PartPoints))


def take(room: VisibleRoom, stage: SimStage, config: DepthCameraConfig, count: int, seed: int) -> list[PartPoints]:
    """Return frames of a stage's part, each from a place of its own; fewer where some show nothing of it."""
    random = np.random.default_rng([seed, *stage.target.encode()])
    frames = [capture(room, stage, config, random) for _ in range(count)]
    return [sample(frame, config.points, random) for frame in frames if frame is not None]


def save(clouds: Sequence[PartPoints], path: Path) -> None:
    """Write frames as an npz file."""
    columns: dict[str, Any] = {name: np.stack([getattr(cloud, name) for cloud in clouds]) for name in NAMES}
    np.savez_compressed(path, **columns)


def load(path: Path) -> list[PartPoints]:
    """Read frames that `save` wrote; InputError where the file is none."""
    try:
        with np.load(path) as file:
            columns = [file[name] for name in NAMES]
    except UNREADABLE as error:
        raise InputError(f"{path}: not frames of s2a pool ({error}); make the pool again with frames=8") from error
    return [PartPoints(*values) for values in zip(*columns, strict=True)]
