"""A furnished room as a scanner sees it: the scan, its colours, and the part that an annotator gives each face to.

Colours are those of the nearest piece of furniture with wood grain, weave, light and camera noise. On a coarse surface a camera
paints the true point that it sees through each point: a handle that a phone's mesh lacks is in its texture, on the front behind.
"""

from dataclasses import dataclass, replace

import numpy as np

from s2a.core.bounds import Fraction, NotNegative
from s2a.homes.room import Entry, Room
from s2a.homes.scanner import ScannerConfig, scan
from s2a.homes.solids import FABRIC, PLAIN, WOOD, Surface, rotation
from s2a.scene.geometry.mesh_ops import vertex_normals
from s2a.scene.geometry.mesh_query import RayMesh, first_hits, nearest_faces, ray_mesh
from s2a.scene.scene import Joint, Mesh


@dataclass(frozen=True)
class AnnotationConfig:
    """Errors of annotated parts and joints.

    Attributes:
        name: name of the annotator.
        border: standard deviation by which a face's place is misjudged near the border of two parts [m].
        axis: largest error of an axis' direction [deg].
        origin: largest error of a joint's origin [m].
        limits: largest relative error of a joint's range.
        missed: probability that a handle is overlooked: its faces then belong to what it sits on.
        reversed: probability that a joint's axis points the wrong way.
    """

    name: str
    border: NotNegative
    axis: NotNegative
    origin: NotNegative
    limits: NotNegative
    missed: Fraction
    reversed: Fraction


def face_numbers(
    mesh: RayMesh, numbers: np.ndarray, centroids: np.ndarray, config: AnnotationConfig, rng: np.random.Generator
) -> np.ndarray:
    """Return the number of the part that each scanned face is given to, shape [face].

    `centroids`: of the scanned faces, in the frame of the mesh [m], shape [face 3].
    """
    places = centroids + rng.normal(0.0, config.border, centroids.shape)
    return numbers[nearest_faces(mesh, places)[0]]


def annotated_joints(entries: list[Entry], config: AnnotationConfig, rng: np.random.Generator) -> dict[int, Joint]:
    """Return the joint of each moving part as an annotator would write it, by the part's number."""
    return {e.number: _misjudged(e.piece.joint, config, rng) for e in entries if e.piece.joint is not None}


def overlooked(entries: list[Entry], config: AnnotationConfig, rng: np.random.Generator) -> set[int]:
    """Return the numbers of the handles that the annotator does not see; nothing is drawn where none is overlooked."""
    parents = {entry.parent for entry in entries}
    leaves = [
        e.number for e in entries if e.piece.style is not None and e.number not in parents and e.parent is not None
    ]
    if config.missed == 0.0:
        return set()
    return {number for number in leaves if rng.uniform() < config.missed}


def without(entries: list[Entry], numbers: np.ndarray, missed: set[int]) -> tuple[list[Entry], np.ndarray]:
    """Return the annotated parts and the part of each face without those that were overlooked."""
    parent = {entry.number: entry.parent for entry in entries}
    changed = numbers.copy()
    for number in missed:
        changed[numbers == number] = parent[number]
    return [entry for entry in entries if entry.number not in missed], changed


def reversed_joints(
    joints: dict[int, Joint], config: AnnotationConfig, rng: np.random.Generator
) -> tuple[dict[int, Joint], set[int]]:
    """Return joints of which some turn or slide the wrong way, and the numbers of those."""
    if config.reversed == 0.0:
        return joints, set()
    wrong = {number for number in joints if rng.uniform() < config.reversed}
    turned = {n: replace(j, axis=(-j.axis[0], -j.axis[1], -j.axis[2])) for n, j in joints.items() if n in wrong}
    return joints | turned, wrong


def _misjudged(joint: Joint, config: AnnotationConfig, rng: np.random.Generator) -> Joint:
    """Return a joint with small errors; the range still starts at its true lower end, the closed pose."""
    sideways = np.cross(joint.axis, rng.normal(size=3))
    vector = sideways / np.linalg.norm(sideways) * np.radians(config.axis) * rng.uniform(0.2, 1.0)
    axis = rotation(vector)[:3, :3] @ joint.axis
    offset = rng.normal(size=3)
    origin = joint.origin + offset / np.linalg.norm(offset) * config.origin * rng.uniform(0.2, 1.0)
    upper = joint.limits[1] * (1.0 + config.limits * rng.uniform(-1.0, 1.0))
    axis /= np.linalg.norm(axis)
    return replace(joint, axis=tuple(axis), origin=tuple(origin), limits=(joint.limits[0], float(upper)))


# Direction to the light in the room: ceiling lamps, and a window to one side
LIGHT_DIRECTION = np.array((0.35, 0.25, 0.9)) / np.linalg.norm((0.35, 0.25, 0.9))


def vertex_colors(points: np.ndarray, surface: Surface, nearest: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the colour of each scanned point, shape [point 3], uint8.

    `points`: in the room's frame, along which boards and threads run [m], shape [point 3]; `nearest`: its face nearest
    to each point, shape [point].
    """
    a, b, c = np.moveaxis(surface.vertices[surface.faces], 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
    # Half of the light comes from everywhere: walls are white.
    light = (0.78 + 0.22 * (normal @ LIGHT_DIRECTION))[nearest]
    texture = surface.textures[nearest]
    grain = np.select([texture == PLAIN, texture == WOOD, texture == FABRIC], [_plain(points), _wood(points), 1.0], 1.0)
    weave = np.where(texture == FABRIC, 0.08, 0.015) * rng.normal(size=len(points))
    color = surface.colors[nearest] * (light * (grain + weave))[:, None] + rng.normal(0.0, 1.5, (len(points), 3))
    return np.clip(np.rint(color), 0, 255).astype(np.uint8)


def _plain(points: np.ndarray) -> np.ndarray:
    """Return the faint clouds of a painted surface, about 1, shape [point]."""
    x, y, z = points.T
    return 1.0 + 0.015 * np.sin(7 * x + 3 * z) * np.sin(5 * y - 4 * z + 1)


def _wood(points: np.ndarray) -> np.ndarray:
    """Return boards of 0.12 m with grain along x, about 1, shape [point]."""
    x, y, z = points.T
    board = np.floor((y + z) / 0.12)
    tone = 0.08 * np.sin(board * 12.9898)
    return 1.0 + tone + 0.06 * np.sin(260 * (y + z) + 3 * np.sin(4 * x + board) + 2 * np.sin(9 * x))


MAX_ATTEMPTS = 4  # Nearest cameras that are tried for each point
CHUNK = 100_000  # Points that are asked for at once
NEAR = 0.09  # [m] Farther before or behind a point, what a camera sees is something else


def sighted(mesh: RayMesh, points: np.ndarray, normals: np.ndarray, cameras: np.ndarray) -> np.ndarray:
    """Return for each point what the nearest camera sees in its direction, shape [point 3] [m]; itself where none sees it.

    Args:
        mesh: the true room.
        points: of the coarse surface, in the frame of the mesh [m], shape [point 3].
        normals: of that surface towards free space, shape [point 3].
        cameras: where pictures were taken, in the same frame [m], shape [camera 3].
    """
    parts = [slice(i, i + CHUNK) for i in range(0, len(points), CHUNK)]
    return np.concatenate([_sighted(mesh, points[some], normals[some], cameras) for some in parts])


def _sighted(mesh: RayMesh, points: np.ndarray, normals: np.ndarray, cameras: np.ndarray) -> np.ndarray:
    places, open_ = points.astype(np.float64).copy(), np.ones(len(points), bool)
    rays = cameras[None].astype(np.float32) - points[:, None].astype(np.float32)
    far = np.linalg.norm(rays, axis=2)
    facing = np.einsum("pci,pi->pc", rays, normals.astype(np.float32)) / far
    # Pictures from close by and straight ahead are sharpest.
    order = np.argsort(far / np.clip(facing, 0.05, 1.0), axis=1)[:, :MAX_ATTEMPTS]
    for rank in range(order.shape[1]):
        some = np.flatnonzero(open_)
        if not len(some):
            break
        eyes, reach = cameras[order[some, rank]], far[some, order[some, rank]]
        ahead = (points[some] - eyes) / reach[:, None]
        hits = first_hits(mesh, eyes, ahead)
        good = np.abs(hits - reach) < NEAR
        places[some[good]] = eyes[good] + hits[good, None] * ahead[good]
        open_[some[good]] = False
    return places


LUMINANCE = (0.2126, 0.7152, 0.0722)  # Weights of red, green and blue (ITU-R BT.709)
LIGHT = 0.3  # Luminance from which on a surface returns enough infrared light; a pixel value of 76 of 255


class Capture:
    """What one scanner sees of one room.

    Attributes:
        surface: the clean room in the scene.
        room: the furnished room in the scene.
        config: the scanner.
    """

    def __init__(self, surface: Surface, room: Room, config: ScannerConfig, paint: np.random.Generator) -> None:
        self.surface, self.room, self.config, self._paint = surface, room, config, paint
        self._turn = rotation((0.0, 0.0, -room.yaw))[:3, :3]
        self._clean = surface.moved(rotation((0.0, 0.0, -room.yaw)))
        # Rays are fastest where walls are parallel to the axes.
        self._mesh = ray_mesh(self._clean.vertices, self._clean.faces)
        self._places = room.scanners[: config.poses]

    def scan(self, errors: np.random.Generator) -> Mesh:
        """Return the coloured scan, in the scene."""
        bounds = np.stack([self.surface.vertices.min(axis=0), self.surface.vertices.max(axis=0)])
        dropout = swallowed(self.surface, self.config.dark)
        arguments = (self._mesh, dropout, self.room.yaw, self._places, bounds, self.config, errors)
        vertices, faces = scan(*arguments)
        return Mesh(vertices, faces, self.colors(vertices, vertex_normals(vertices, faces)))

    def colors(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Return the colours [point 3] of points of the scan [point 3] with normals [point 3], in the scene."""
        seen = self._seen(points, normals)
        return vertex_colors(seen, self._clean, nearest_faces(self._mesh, seen)[0], self._paint)

    def numbers(self, mesh: Mesh, owners: np.ndarray, config: AnnotationConfig, rng: np.random.Generator) -> np.ndarray:
        """Return the part that an annotator gives each face of the scan to, shape [face]."""
        corners = (mesh.vertices @ self._turn.T)[mesh.faces].mean(axis=1)
        if self.config.colors == "camera":
            normals = vertex_normals(mesh.vertices, mesh.faces)[mesh.faces].mean(axis=1)
            corners = self._sighted(corners, normals)
        return face_numbers(self._mesh, owners, corners, config, rng)

    def _seen(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Return the true points, in the room's frame, that are seen at points of the scan, in the scene."""
        inside = points @ self._turn.T
        return self._sighted(inside, normals) if self.config.colors == "camera" else inside

    def _sighted(self, inside: np.ndarray, normals: np.ndarray) -> np.ndarray:
        return sighted(self._mesh, inside, normals @ self._turn.T, self._places @ self._turn.T)


def swallowed(surface: Surface, dark: float) -> np.ndarray:
    """Return the fraction of rays that each face swallows, shape [face], float32; see `ScannerConfig.dark`."""
    luminance = surface.colors @ np.array(LUMINANCE, np.float32) / 255.0
    return np.maximum(surface.dropout, dark * np.clip(1.0 - luminance / LIGHT, 0.0, 1.0)).astype(np.float32)
