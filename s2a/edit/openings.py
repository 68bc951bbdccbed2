"""The space that drawers and doors need to open."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.geometry.convex import halfspaces
from s2a.geometry.surfaces import merge
from s2a.prepare.motion import sweep
from s2a.scene import Joint, Mesh, Scene


@dataclass(frozen=True)
class Opening:
    """A convex piece of the way of a part.

    Attributes:
        part: id of the part that moves.
        piece: what it passes through.
        planes: the piece's planes (nx, ny, nz, d), inside where n.x + d <= 0 [m], shape [plane 4].
    """

    part: str
    piece: Mesh
    planes: np.ndarray


def openings(scene: Scene, low: np.ndarray, high: np.ndarray, carrier: str | None = None) -> list[Opening]:
    """Return the ways of the jointed parts that reach into a box [m].

    Args:
        scene: the room.
        low: the box's lower corner.
        high: its upper corner.
        carrier: id of the part on which the object will be: what carries it along is not in its way.
    """
    carriers = _carriers(scene, carrier)
    found = []
    for part_id in scene.movable:
        mesh = merge([Mesh(scene.parts[i].mesh.vertices, scene.parts[i].mesh.faces) for i in scene.members(part_id)])
        joint = scene.joint(part_id)
        if part_id in carriers or not len(mesh.faces) or not _may_reach(mesh, joint, low, high):
            continue
        for piece in sweep(mesh, joint):
            if (piece.bounds[0] < high).all() and (piece.bounds[1] > low).all():
                found.append(Opening(part_id, piece, halfspaces(piece)))
    return found


def blocked(opening: Opening, points: np.ndarray, slack: float) -> bool:
    """Whether any of the points [point 3] is in the way of a part by more than `slack` [m]."""
    return bool((points @ opening.planes[:, :3].T + opening.planes[:, 3] < -slack).all(axis=1).any())


def heights_within(opening: Opening, places: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return from where to where [m] along the normal the lines through places [point 3] run inside; empty: first > last."""
    slope = opening.planes[:, :3] @ normal
    rest = -(places @ opening.planes[:, :3].T + opening.planes[:, 3])
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = rest / slope
    first = np.where(slope < -1e-9, reach, -np.inf).max(axis=1)
    last = np.where(slope > 1e-9, reach, np.inf).min(axis=1)
    outside = ((np.abs(slope) <= 1e-9) & (rest < 0)).any(axis=1)
    return np.where(outside, np.inf, first), np.where(outside, -np.inf, last)


def _carriers(scene: Scene, part_id: str | None) -> set[str]:
    """Return a part and its ancestors."""
    found: set[str] = set()
    while part_id is not None:
        found.add(part_id)
        part_id = scene.parts[part_id].parent
    return found


def _may_reach(mesh: Mesh, joint: Joint, low: np.ndarray, high: np.ndarray) -> bool:
    """Whether a part's box, grown by the longest way of any of its points, meets another box."""
    way = max(abs(limit) for limit in joint.limits)
    if joint.kind == "revolute":
        way = 2.0 * float(np.linalg.norm(mesh.vertices - np.array(joint.origin), axis=1).max())
    return bool((mesh.bounds[0] - way < high).all() and (mesh.bounds[1] + way > low).all())
