"""Exact tests of a pose against the triangles of the scene."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.core.errors import InputError
from s2a.language.insert.place.swept_volumes import SweptVolume, intersects
from s2a.language.insert.placement import ORIENTATION, POSITION
from s2a.scene.geometry.line_of_sight import visible_distance
from s2a.scene.geometry.mesh_ops import sample
from s2a.scene.geometry.mesh_query import RayMesh, ray_mesh
from s2a.scene.geometry.penetration import crossing, depth, inside
from s2a.scene.scene import Mesh, Scene, Vec3

DEEP = 0.0005
"""Penetration depth from which an object is inside another [m]: half of what an insertion may collide."""
COLLISION = "collide"
"""The conflict that a small step back may resolve."""


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
    """Pose of an object in the scene.

    Attributes:
        position: of the object's origin in the scene [m].
        quaternion: its rotation, xyzw.
        clearance: distance from the nearest obstacle or the border of the support [m]; 0 where it was not computed.
        tried: number of candidates that were tested exactly.
    """

    position: Vec3
    quaternion: tuple[float, float, float, float]
    clearance: float
    tried: int

    @property
    def yaw(self) -> float:
        """Rotation about z [rad]."""
        return float(Rotation.from_quat(self.quaternion).as_euler("zyx")[0])

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

    Args:
        scene: the room.
        moved: the object in the scene.
        local: the scene's triangles around it.
        volumes: swept volumes of drawers and doors.
        slack: how far the object may reach into them [m].
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
    there, _ = visible_distance(rays(local), points, toward, reach)
    back, _ = visible_distance(rays(moved), local.vertices, -toward, reach)
    distance = float(min(there.min(), back.min()))
    if distance >= reach:
        return None
    position = np.array(pose.position) + (distance - gap) * toward
    return replace(pose, position=tuple(position.tolist()))


def rays(mesh: Mesh) -> RayMesh:
    """Return a mesh for ray queries."""
    return ray_mesh(mesh.vertices, mesh.faces)
