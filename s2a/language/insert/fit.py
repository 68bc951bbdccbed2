"""Exact tests of a pose against the triangles of the scene."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.core.errors import InputError
from s2a.language.sandbox.diff import ORIENTATION, POSITION
from s2a.scene.geometry.convex import halfspaces, sweep
from s2a.scene.geometry.mesh_ops import merge, sample
from s2a.scene.geometry.mesh_query import crossing, depth, inside, kept_ray_mesh, visible_distance
from s2a.scene.geometry.regions import Region
from s2a.scene.scene import Mesh, Scene, Vec3


@dataclass(frozen=True)
class SweptVolume:
    """A convex hull of a section of a part's swept volume."""

    part: str  # id of the moving part
    hull: Mesh  # convex hull of one section of its travel
    planes: np.ndarray  # the hull's planes (nx, ny, nz, d), inside where n.x + d <= 0 [m], shape [plane 4]


def swept_volumes(scene: Scene) -> list[SweptVolume]:
    """Return the swept volumes of all articulated parts of a scene."""
    volumes = []
    for part_id in scene.movable:
        mesh = merge([Mesh(scene.parts[i].mesh.vertices, scene.parts[i].mesh.faces) for i in scene.members(part_id)])
        if len(mesh.faces):
            volumes += [SweptVolume(part_id, piece, halfspaces(piece)) for piece in sweep(mesh, scene.joint(part_id))]
    return volumes


def reaching_into(
    volumes: list[SweptVolume], low: np.ndarray, high: np.ndarray, scene: Scene, carrier: str | None = None
) -> list[SweptVolume]:
    """Return the swept volumes that reach into a box [m].

    `carrier`: id of the part that carries the object; it and its ancestors move along and do not count.
    """
    carriers = () if carrier is None else (carrier, *scene.ancestors(carrier))
    return [
        volume
        for volume in volumes
        if volume.part not in carriers and (volume.hull.bounds[0] < high).all() and (volume.hull.bounds[1] > low).all()
    ]


def intersects(volume: SweptVolume, points: np.ndarray, slack: float) -> bool:
    """Return True if any of the points [point 3] is deeper than `slack` [m] in a swept volume."""
    low, high = volume.hull.bounds
    near = points[((points > low) & (points < high)).all(axis=1)]
    return bool((near @ volume.planes[:, :3].T + volume.planes[:, 3] < -slack).all(axis=1).any())


def heights_within(volume: SweptVolume, places: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the interval along the normal [m] in which lines through places [point 3] are inside; empty: first > last."""
    first, last = np.full(len(places), -np.inf), np.full(len(places), np.inf)
    outside = np.zeros(len(places), bool)
    # Plane by plane: a table of all places and planes does not fit the cache.
    for plane, slope in zip(volume.planes, volume.planes[:, :3] @ normal, strict=True):
        rest = -(places @ plane[:3] + plane[3])
        if slope < -1e-9:
            np.maximum(first, rest / slope, out=first)
        elif slope > 1e-9:
            np.minimum(last, rest / slope, out=last)
        else:
            outside |= rest < 0
    return np.where(outside, np.inf, first), np.where(outside, -np.inf, last)


def fill(layers: np.ndarray, edges: np.ndarray, region: Region, pad: int, volume: SweptVolume, slack: float) -> None:
    """Mark the cells over a region that a swept volume occupies, up to a tolerance.

    Args:
        layers: occupied cells by layer, shape [layer row column]; changed.
        edges: heights of the layers' borders above the region [m], shape [layer + 1].
        region: the region below the grid.
        pad: cells added on each side of the region.
        volume: swept volume of the part.
        slack: tolerance [m].
    """
    corners = region.places(volume.hull.vertices.astype(np.float64))[:, :2] + pad
    first = np.clip(np.floor(corners.min(axis=0)).astype(int), 0, layers.shape[1:])
    last = np.clip(np.ceil(corners.max(axis=0)).astype(int), 0, layers.shape[1:])
    if (last <= first).any():
        return
    cells = np.stack(np.meshgrid(*map(np.arange, first, last), indexing="ij"), axis=-1).reshape(-1, 2)
    low, high = heights_within(volume, region.points(cells - pad + 0.5), region.normal)
    for layer, bottom, top in zip(layers, edges, edges[1:], strict=False):
        inside = (low + slack < top) & (high - slack > bottom) & (high - low > 2 * slack)
        layer[tuple(cells[inside].T)] = True


DEEP = 0.0005  # Penetration depth from which an object is inside another [m]: half of what an insertion may collide
COLLISION = "collide"  # The conflict that a small step back may resolve


class NoRoom(InputError):
    """No pose was found.

    Attributes:
        summary: the collisions of each candidate; goes back to the model.
        unstable: Set where a candidate pose was free, but the object tilted, drifted or fell there.
    """

    def __init__(self, summary: str, *, unstable: bool = False, remedy: str = "") -> None:
        self.summary, self.unstable = summary, unstable
        super().__init__(summary + remedy)


@dataclass(frozen=True)
class Pose:
    """Pose of an object in the scene."""

    position: Vec3  # of the object's origin in the scene [m]
    quaternion: tuple[float, float, float, float]  # its rotation, xyzw
    clearance: float  # distance from the nearest obstacle or the border of the support [m]; 0 where it was not computed
    tried: int  # number of candidates that were tested exactly

    @property
    def yaw(self) -> float:
        """Rotation about z [rad]."""
        return float(Rotation.from_quat(self.quaternion).as_euler("zyx")[0])

    def shifted(self, by: np.ndarray) -> Pose:
        """Return the pose moved by a vector [m]."""
        return replace(self, position=tuple((np.array(self.position) + by).tolist()))

    def rounded(self) -> Pose:
        """Return the pose rounded to the digits of a script."""
        x, y, z = (round(float(value), POSITION) + 0.0 for value in self.position)
        i, j, k, w = (round(float(value), ORIENTATION) + 0.0 for value in self.quaternion)
        return replace(self, position=(x, y, z), quaternion=(i, j, k, w))

    def moved(self, object: Mesh) -> Mesh:
        """Return an object at this pose in the scene."""
        turned = Rotation.from_quat(self.quaternion).apply(object.vertices.astype(np.float64))
        return Mesh(turned + self.position, object.faces, object.colors)


def placement_conflict(scene: Scene, moved: Mesh, local: Mesh, volumes: list[SweptVolume], slack: float) -> str | None:
    """Return the conflict of an object at a pose, as the end of a sentence about "most" poses, or None.

    `slack`: how far the object may reach into them [m].
    """
    if crossing(moved, local) is not None:
        return COLLISION
    points = np.concatenate([moved.vertices[:: max(1, len(moved.vertices) // 8)], moved.vertices.mean(axis=0)[None]])
    for part_id, part in scene.parts.items():
        if len(part.mesh.faces) and inside(part.mesh, points).any():
            return f"are within {part_id!r}"
    surface = np.concatenate([moved.vertices, sample(moved, 1000, seed=0)])
    for volume in volumes:
        if intersects(volume, surface, slack):
            return f"keep {volume.part!r} from opening"
    # Surfaces scanned from one side only enclose nothing, and small objects may be enclosed themselves.
    return "enclose something else, or are in what was scanned in part" if depth(moved, local) > DEEP else None


def moved_into_contact(
    pose: Pose, object: Mesh, local: Mesh, toward: np.ndarray, reach: float, gap: float
) -> Pose | None:
    """Return a pose moved along a direction until the object almost touches; None if there is nothing within reach.

    Rays run from the object's points to the obstacles, and back from their vertices to the object: between two meshes
    the shortest segment starts at a vertex of either, or lies between two edges, which costs a fraction of a millimetre.
    """
    moved = pose.moved(object)
    if not len(local.faces):
        return None
    points = np.concatenate([moved.vertices, sample(moved, 2000, seed=0)])
    there, _ = visible_distance(kept_ray_mesh(local), points, toward, reach)
    back, _ = visible_distance(kept_ray_mesh(moved), local.vertices, -toward, reach)
    distance = float(min(there.min(), back.min()))
    if distance >= reach:
        return None
    return pose.shifted((distance - gap) * toward)
